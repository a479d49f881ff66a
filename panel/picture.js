// SPDX-License-Identifier: MIT
// picture.js - the platform as it is: joints, cylinders with their stroke, plate, and in grey where the sender asks it to be. A flat canvas:
// the same on a phone without WebGL.
import { camera, plateJoints } from "/space.js";
import { t } from "/text.js";

const NEAR_END = 0.03; // of the stroke

export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.azimuth = 25;
    this.height = 20;
    canvas.addEventListener("pointerdown", (event) => { this.last = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
    canvas.addEventListener("pointerup", () => { this.last = null; });
    canvas.addEventListener("pointercancel", () => { this.last = null; });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.last) return;
      this.turnBy(event.clientX - this.last[0], event.clientY - this.last[1]);
      this.last = [event.clientX, event.clientY];
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] }[event.key];
      if (step) { this.turnBy(...step); event.preventDefault(); }
    });
  }

  turnBy(dx, dy) {
    this.azimuth += dx * 0.4;
    this.height = Math.min(89, Math.max(-10, this.height + dy * 0.4));
    this.draw(this.geometry, this.status);
  }

  draw(geometry, status) {
    Object.assign(this, { geometry, status });
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, tall = Math.round(Math.min(width * 0.75, 420));
    if (!geometry || !status || width === 0) return;
    this.canvas.style.height = `${tall}px`;
    this.canvas.width = width * ratio;
    this.canvas.height = tall * ratio;
    const pen = this.canvas.getContext("2d");
    const style = getComputedStyle(document.body);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.scale(ratio, ratio);
    const radius = Math.max(...geometry.base_mm.map((p) => Math.hypot(p[0], p[1])));
    const high = geometry.zero_height_mm;
    const project = camera(this.azimuth, this.height, [0, 0, high / 2], Math.min(width / (3 * radius), tall / (high + 1.4 * radius)), width, tall);
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
    const plate = plateJoints(geometry, status.pose_sent);
    status.cylinders.forEach((cylinder, i) => {
      const share = (cylinder.actual_mm ?? cylinder.sent_mm) / cylinder.stroke_mm;
      const isNear = share < NEAR_END || share > 1 - NEAR_END;
      const base = geometry.base_mm[i], top = plate[i];
      const whole = Math.hypot(...base.map((v, k) => top[k] - v));
      const body = Math.min(1, geometry.retracted_length_mm[i] / whole);
      const middle = base.map((v, k) => v + (top[k] - v) * body);
      line([base, middle], isNear ? colour("bad") : colour("soft"), 9, false);
      line([middle, top], isNear ? colour("bad") : colour("act"), 5, false);
      const [x, y] = project(base);
      pen.fillStyle = colour("front");
      pen.fillText(String(i + 1), x - 4, y + 18);
    });
    line(plate, colour("good"), 5, true);
    this.canvas.setAttribute("aria-label", `${t("picture")}; ${t("ghost")}; ${t("atEnd")}`);
    this.joints = plate;
  }
}
