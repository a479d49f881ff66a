// SPDX-License-Identifier: MIT
// times.js - how long things took since the start: a histogram of each, and its percentiles.
import { t } from "./text.js";
import { element, number, penOn, table } from "./ui.js";

const TALL = 96, FOOT = 18;
const KINDS = [["frame_latency", "frameLatency"], ["wake_latency", "wakeLatency"], ["cycle_time", "cycleTime"]];

export const span = (us) => (us >= 1000 ? `${us / 1000} ms` : `${us} µs`);

// Bars of a logarithm: one late cycle in a million is seen.
function draw(canvas, bounds, counts) {
  const made = penOn(canvas, TALL);
  if (made === null) return;
  const { pen, width, colour } = made;
  pen.font = "12px system-ui, sans-serif";
  const most = Math.log10(1 + Math.max(1, ...counts)), each = width / counts.length, floor = TALL - FOOT;
  counts.forEach((count, i) => {
    const high = Math.log10(1 + count) / most * (floor - 4);
    pen.fillStyle = colour("act");
    if (count) pen.fillRect(i * each + 1, floor - Math.max(high, 2), each - 2, Math.max(high, 2));
  });
  Object.assign(pen, { strokeStyle: colour("line"), lineWidth: 1, fillStyle: colour("soft") });
  pen.beginPath(); pen.moveTo(0, floor + 0.5); pen.lineTo(width, floor + 0.5); pen.stroke();
  bounds.forEach((bound, i) => {
    if (![10, 100, 1000].includes(bound)) return;
    pen.beginPath(); pen.moveTo(i * each, floor); pen.lineTo(i * each, floor + 5); pen.stroke();
    pen.textAlign = "center";
    pen.fillText(span(bound), Math.min(width - 20, i * each), TALL - 2);
  });
}

export class Times {
  constructor(place) {
    this.canvases = KINDS.map(([, name]) => element("canvas", { role: "img", "aria-label": t(name) }));
    this.numbers = element("div", {});
    place.replaceChildren(...KINDS.flatMap(([, name], i) => [element("h3", {}, t(name)), this.canvases[i]]), this.numbers);
  }

  // answer: of the request `times`; status: for the percentiles.
  update(answer, status) {
    KINDS.forEach(([kind], i) => { if (answer?.[kind]) draw(this.canvases[i], answer.bounds_us, answer[kind]); });
    const us = (value) => number(value, 0);
    this.numbers.replaceChildren(table(["µs", "50 %", "99 %", "99.9 %", t("most")], KINDS.map(([kind, name]) => { const one = status[kind]; return [t(name), us(one.p50_us), us(one.p99_us), us(one.p99_9_us), us(one.max_us)]; })),
      element("p", { class: "soft" }, `${t("late")}: ${status.late_cycles}; ${t("sinceStart")}`));
  }
}
