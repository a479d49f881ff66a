// SPDX-License-Identifier: MIT
// limits.js - how near a cylinder is to the ends of its stroke, and a pose to the limits of its axes. Both pictures and the words under them take it from here.
const NEAR_END = 0.03, CLOSE_TO_END = 0.1; // of the stroke

// "end", "close" or "free"; extension_mm as far as it is known.
export function nearness(extension_mm, stroke_mm) {
  const share = extension_mm / stroke_mm;
  const left = Math.min(share, 1 - share);
  return left < NEAR_END ? "end" : left < CLOSE_TO_END ? "close" : "free";
}

export const extensionOf = (cylinder) => cylinder.actual_mm ?? cylinder.sent_mm;

// Axes of a pose that stand at a limit of theirs: their names.
export function atLimits(limits, pose) {
  const near = (range) => Math.max((range[1] - range[0]) * 0.005, 1e-3);
  return Object.entries(limits ?? {}).filter(([axis, range]) => range[1] > range[0] && pose?.[axis] !== null && pose?.[axis] !== undefined
    && (pose[axis] >= range[1] - near(range) || pose[axis] <= range[0] + near(range))).map(([axis]) => axis);
}
