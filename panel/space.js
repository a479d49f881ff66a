// SPDX-License-Identifier: MIT
// space.js - Heave's space: left-handed, +X forward, +Y right, +Z up; R = Rz(yaw) Ry(pitch) Rx(roll). Where joints are in a pose, and how a
// point comes onto a flat picture. Nothing else of the pages knows about coordinates.
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
