// SPDX-License-Identifier: MIT
// space.js - Heave's space: left-handed, +X forward, +Y right, +Z up; R = Rz(yaw) Ry(pitch) Rx(roll). Where joints are in a pose, how a
// point comes onto a flat picture, and how it comes into the right-handed space of three.js. Nothing else of the pages knows about coordinates.
const RAD = Math.PI / 180;

export function turn([x, y, z], roll, pitch, yaw) {
  let c = Math.cos(roll * RAD), s = Math.sin(roll * RAD);
  [y, z] = [c * y - s * z, s * y + c * z];
  c = Math.cos(pitch * RAD); s = Math.sin(pitch * RAD);
  [x, z] = [c * x + s * z, -s * x + c * z];
  c = Math.cos(yaw * RAD); s = Math.sin(yaw * RAD);
  return [c * x - s * y, s * x + c * y, z];
}

// pose: {roll_deg, pitch_deg, yaw_deg, x_mm, y_mm, z_mm}. Joints of the plate in the base frame, mm.
export function plateJoints(geometry, pose) {
  const m = geometry.mrp_mm;
  return geometry.plate_mm.map((p) => {
    const [x, y, z] = turn([p[0] - m[0], p[1] - m[1], p[2] - m[2]], pose.roll_deg, pose.pitch_deg, pose.yaw_deg);
    return [m[0] + pose.x_mm + x, m[1] + pose.y_mm + y, geometry.zero_height_mm + m[2] + pose.z_mm + z];
  });
}

export function extensions(geometry, pose) {
  return plateJoints(geometry, pose).map((p, i) => Math.hypot(p[0] - geometry.base_mm[i][0], p[1] - geometry.base_mm[i][1], p[2] - geometry.base_mm[i][2]) - geometry.retracted_length_mm[i]);
}

// A camera that looks at `centre` from `azimuth` (0: from behind, +X away) and `height` degrees above. Left-handed: +Y is to the right then.
export function camera(azimuth, height, centre, scale, width, tall) {
  const ca = Math.cos(azimuth * RAD), sa = Math.sin(azimuth * RAD), ch = Math.cos(height * RAD), sh = Math.sin(height * RAD);
  return ([x, y, z]) => {
    const dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
    const away = ca * dx + sa * dy, right = -sa * dx + ca * dy;
    const depth = ch * away - sh * dz, up = sh * away + ch * dz;
    const near = 1 / (1 + depth * scale / 2500);
    return [width / 2 + right * scale * near, tall / 2 - up * scale * near, depth];
  };
}

// three.js: right-handed, +X right, +Y up, -Z forward. A mirror, so that forward, right and up stay what they are.
export const toThree = ([x, y, z]) => [y, z, -x];
export const fromThree = ([x, y, z]) => [-z, x, y];

// Where the plate is, for three.js: rows of a 4 x 4 matrix that brings a point of the plate, given from the motion reference point and put through toThree(), to its place in the base frame.
export function plateMatrix(geometry, pose) {
  const m = geometry.mrp_mm;
  const at = toThree([m[0] + pose.x_mm, m[1] + pose.y_mm, geometry.zero_height_mm + m[2] + pose.z_mm]);
  const column = (unit) => toThree(turn(fromThree(unit), pose.roll_deg, pose.pitch_deg, pose.yaw_deg));
  const [a, b, c] = [column([1, 0, 0]), column([0, 1, 0]), column([0, 0, 1])];
  return [a[0], b[0], c[0], at[0], a[1], b[1], c[1], at[1], a[2], b[2], c[2], at[2], 0, 0, 0, 1];
}

// Where a camera of three.js stands that looks at `centre` as camera() does: `azimuth` degrees round, `height` degrees up, `away` from it.
export function standpoint(azimuth, height, centre, away) {
  const ca = Math.cos(azimuth * RAD), sa = Math.sin(azimuth * RAD), ch = Math.cos(height * RAD), sh = Math.sin(height * RAD);
  return toThree([centre[0] - ca * ch * away, centre[1] - sa * ch * away, centre[2] + sh * away]);
}
