// SPDX-License-Identifier: MIT
// picture.js - the platform as it is: joints, cylinders with their stroke, plate, and in grey where the sender asks it to be. A flat canvas:
// the same on a phone without WebGL.
import { extensionOf, nearness } from "./limits.js";
import { camera, plateJoints } from "./space.js";

export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
  }

  // width, tall in CSS pixels; azimuth and height of the look in degrees.
  draw(geometry, status, { width, tall, azimuth, height }) {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = width * ratio;
    this.canvas.height = tall * ratio;
    const pen = this.canvas.getContext("2d");
    const style = getComputedStyle(document.body);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.scale(ratio, ratio);
    const radius = Math.max(...geometry.base_mm.map((p) => Math.hypot(p[0], p[1])));
    const high = geometry.zero_height_mm;
    const project = camera(azimuth, height, [0, 0, high / 2], Math.min(width / (3 * radius), tall / (high + 1.4 * radius)), width, tall);
    const line = (points, stroke, thick, isClosed, dash = []) => {
      pen.beginPath();
      points.map(project).forEach(([x, y], i) => (i ? pen.lineTo(x, y) : pen.moveTo(x, y)));
      if (isClosed) pen.closePath();
      Object.assign(pen, { strokeStyle: stroke, lineWidth: thick, lineJoin: "round", lineCap: "round" });
      pen.setLineDash(dash);
      pen.stroke();
    };
    line(geometry.base_mm, colour("soft"), 3, true);
    line([[0, 0, 0], [radius * 1.2, 0, 0]], colour("line"), 2, false); // forward
    const [fx, fy] = project([radius * 1.25, 0, 0]);
    pen.fillStyle = colour("soft");
    pen.font = "13px sans-serif";
    pen.fillText("+X", fx, fy);
    if (status.pose_asked) line(plateJoints(geometry, status.pose_asked), colour("line"), 2, true, [6, 5]);
    const plate = plateJoints(geometry, status.pose_actual ?? status.pose_sent);
    status.cylinders.forEach((cylinder, i) => {
      const extension = extensionOf(cylinder), stroke = cylinder.stroke_mm ?? geometry.stroke_mm[i], near = nearness(extension, stroke);
      const base = geometry.base_mm[i], top = plate[i];
      const whole = Math.hypot(...base.map((v, k) => top[k] - v));
      const body = Math.min(1, geometry.retracted_length_mm[i] / whole);
      const middle = base.map((v, k) => v + (top[k] - v) * body);
      line([base, middle], colour(near === "end" ? "end" : "soft"), 9, false);
      line([middle, top], colour(near === "free" ? "act" : near), 5, false);
      const [x, y] = project(base);
      pen.fillStyle = colour(near === "end" ? "end" : "front");
      pen.fillText(`${i + 1}: ${Math.round(extension)}${near === "free" ? "" : extension > stroke / 2 ? " \u25b2" : " \u25bc"}`, x - 10, y + 18);
    });
    line(plate, colour("good"), 5, true);
  }
}
