// SPDX-License-Identifier: MIT
// bode.js - gain and phase over frequency of what an identification has found: the axis thick, its drives thin. The numbers are heaved's side of the link; nothing is worked out here.
import { colours } from "./curves.js";
import { t } from "./text.js";
import { penOn } from "./ui.js";

const LEFT = 52, GAP = 26, BOTTOM = 24;

export function drawBode(canvas, result) {
  const tall = 380, channels = result.channels.filter((one) => one.moved), made = channels.length > 0 ? penOn(canvas, tall) : null;
  if (made === null) return;
  const { pen, width, colour } = made, lines = colours();
  pen.font = "12px sans-serif";
  const low = Math.log10(result.from_hz), high = Math.log10(result.to_hz);
  const x = (hz) => LEFT + (width - LEFT - 8) * (Math.log10(hz) - low) / (high - low);
  const half = (tall - GAP - BOTTOM) / 2;
  const plots = [{ top: 4, name: `${t("gain")} (dB)`, value: (p) => 20 * Math.log10(p.gain), marks: [0, -3], least: -12, most: 3 }, { top: half + GAP, name: `${t("phase")} (°)`, value: (p) => p.phase_deg, marks: [0, -90], least: -120, most: 10 }];
  for (const plot of plots) {
    const all = channels.flatMap((one) => one.response.map(plot.value)).filter(Number.isFinite);
    const least = Math.min(plot.least, ...all), most = Math.max(plot.most, ...all), y = (value) => plot.top + half * (most - value) / (most - least);
    Object.assign(pen, { lineWidth: 1, strokeStyle: colour("line"), fillStyle: colour("soft") });
    pen.strokeRect(LEFT, plot.top, width - LEFT - 8, half);
    for (const value of plot.marks) {
      pen.setLineDash([4, 4]);
      pen.beginPath(); pen.moveTo(LEFT, y(value)); pen.lineTo(width - 8, y(value)); pen.stroke();
      pen.setLineDash([]);
      pen.fillText(String(value), 24, y(value) + 4);
    }
    pen.fillText(plot.name, LEFT + 6, plot.top + half - 6);
    for (const hz of [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50]) {
      if (hz < result.from_hz * 0.99 || hz > result.to_hz * 1.01) continue;
      pen.beginPath(); pen.moveTo(x(hz), plot.top); pen.lineTo(x(hz), plot.top + half); pen.stroke();
      if (plot !== plots[0]) pen.fillText(`${hz}`, x(hz) - 8, tall - 8);
    }
    pen.save();
    pen.beginPath(); pen.rect(LEFT, plot.top, width - LEFT - 8, half); pen.clip();
    [...channels].reverse().forEach((one) => {
      const i = result.channels.indexOf(one);
      Object.assign(pen, { strokeStyle: lines[i % lines.length], lineWidth: i ? 1.2 : 3, globalAlpha: i ? 0.8 : 1 });
      pen.beginPath();
      one.response.forEach((p, k) => (k ? pen.lineTo(x(p.frequency_hz), y(plot.value(p))) : pen.moveTo(x(p.frequency_hz), y(plot.value(p)))));
      pen.stroke();
    });
    pen.restore();
  }
}
