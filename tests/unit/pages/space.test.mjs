// SPDX-License-Identifier: MIT
import assert from "node:assert/strict";
import test from "node:test";
const { camera, extensions, fromThree, plateJoints, plateMatrix, standpoint, toThree, turn } = await import("/space.js");

const GEOMETRY = { mrp_mm: [10, -20, 50], zero_height_mm: 500, base_mm: [[400, -60, 0], [-150, 380, 5]], plate_mm: [[190, -230, -10], [90, 300, 0]], retracted_length_mm: [520, 500] };
const POSE = { roll_deg: 5, pitch_deg: -4, yaw_deg: 10, x_mm: 7, y_mm: -3, z_mm: 20 };
const near = (a, b, what = "") => a.forEach((value, i) => assert.ok(Math.abs(value - b[i]) < 1e-9, `${what} ${a} / ${b}`));
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

test("axes and turns are Heave's: forward, right, up, and positive as in docs/geometry.md", () => {
  near(turn([1, 0, 0], 0, 0, 90), [0, 1, 0], "yaw turns forward to the right");
  near(turn([0, 1, 0], 90, 0, 0), [0, 0, 1], "roll turns right upwards");
  near(turn([0, 0, 1], 0, 90, 0), [1, 0, 0], "pitch turns up forwards");
});

test("three.js: forward is into the screen, right stays right, up stays up, and there is a way back", () => {
  near(toThree([1, 0, 0]), [0, 0, -1]);
  near(toThree([0, 1, 0]), [1, 0, 0]);
  near(toThree([0, 0, 1]), [0, 1, 0]);
  near(fromThree(toThree([3, -4, 5])), [3, -4, 5]);
  const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(toThree);
  near(cross(x, y), z.map((value) => -value), "a left-handed frame becomes a right-handed one");
});

test("the matrix of the plate puts joints where the kinematics have them, and is a rotation", () => {
  const m = plateMatrix(GEOMETRY, POSE), expected = plateJoints(GEOMETRY, POSE);
  GEOMETRY.plate_mm.forEach((joint, k) => {
    const p = toThree(joint.map((value, i) => value - GEOMETRY.mrp_mm[i]));
    const at = [0, 1, 2].map((row) => m[4 * row] * p[0] + m[4 * row + 1] * p[1] + m[4 * row + 2] * p[2] + m[4 * row + 3]);
    near(fromThree(at), expected[k]);
  });
  const column = (c) => [m[c], m[4 + c], m[8 + c]];
  near(cross(column(0), column(1)), column(2), "no mirror is left in it");
});

test("extensions are lengths less retracted lengths", () => {
  const joints = plateJoints(GEOMETRY, POSE);
  near(extensions(GEOMETRY, POSE), joints.map((p, i) => Math.hypot(...p.map((value, k) => value - GEOMETRY.base_mm[i][k])) - GEOMETRY.retracted_length_mm[i]));
});

test("the flat camera and that of three.js stand on the same side", () => {
  for (const azimuth of [0, 30, 90, 200]) {
    const place = fromThree(standpoint(azimuth, 20, [0, 0, 100], 1000)), depth = camera(azimuth, 20, [0, 0, 100], 1, 400, 300)(place)[2];
    assert.ok(Math.abs(depth + 1000) < 1e-9, `${azimuth}: ${depth}`);
  }
});
