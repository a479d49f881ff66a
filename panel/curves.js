// SPDX-License-Identifier: MIT
// curves.js - curves of the samples, every cycle. The server sends the least and the most of so many cycles, so that no peak is lost.
// And the spectrum of one of them.
const COLOURS = ["#0060c0", "#c04000", "#008050", "#8000a0", "#907000", "#d00060", "#406080"];
const DASHES = [[], [7, 4], [2, 3]];

export class Curves {
  constructor(canvas) {
    Object.assign(this, { canvas, spanS: 10, isPaused: false, cursor: null, lost: 0 });
    this.begin([], 1000, 1);
    canvas.addEventListener("pointermove", (event) => { this.cursor = event.offsetX / canvas.clientWidth; });
    canvas.addEventListener("pointerleave", () => { this.cursor = null; });
  }

  // columns: {name, unit}; the first is the time.
  begin(columns, cycleUs, every) {
    Object.assign(this, { columns, cycleUs, every, lost: 0, rows: [] });
  }

  // Rows of the time in s and the values, the oldest first.
  take(block) {
    this.lost += block.lost;
    if (this.isPaused || block.columns.length !== this.columns.length) return;
    for (let i = 0; i < block.rows; i++) this.rows.push(block.columns.map((column) => column[i]));
    const newest = this.rows.length ? this.rows[this.rows.length - 1][0] : 0;
    const old = this.rows.findIndex((row) => row[0] > newest - this.spanS * 1000);
    if (old > 0) this.rows.splice(0, old);
  }

  draw() {
    const ratio = window.devicePixelRatio || 1;
    const width = this.canvas.clientWidth, tall = 320, left = 56, foot = 22;
    if (width === 0) return;
    this.canvas.style.height = `${tall}px`;
    this.canvas.width = width * ratio;
    this.canvas.height = tall * ratio;
    const pen = this.canvas.getContext("2d");
    const style = getComputedStyle(document.body);
    const colour = (name) => style.getPropertyValue(`--${name}`).trim();
    pen.scale(ratio, ratio);
    pen.font = "12px sans-serif";
    const rows = this.rows;
    if (rows.length < 2) return;
    const end = rows[rows.length - 1][0], begin = end - this.spanS * 1000;
    let least = Infinity, most = -Infinity;
    for (const row of rows) for (let c = 1; c < row.length; c++) { least = Math.min(least, row[c]); most = Math.max(most, row[c]); }
    const spare = Math.max((most - least) * 0.08, 1e-3);
    least -= spare; most += spare;
    const x = (ms) => left + (ms - begin) / (end - begin) * (width - left);
    const y = (value) => (tall - foot) * (1 - (value - least) / (most - least));
    Object.assign(pen, { strokeStyle: colour("line"), fillStyle: colour("soft"), lineWidth: 1 });
    for (let k = 0; k <= 4; k++) {
      const value = least + (most - least) * k / 4;
      pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width, y(value)); pen.stroke();
      pen.fillText(value.toFixed(most - least < 1 ? 3 : 1), 2, Math.min(tall - foot, y(value) + 11));
      pen.fillText(`${(-this.spanS * (4 - k) / 4).toFixed(1)} s`, Math.min(width - 44, left + (width - left) * k / 4), tall - 6);
    }
    for (let c = 1; c < this.columns.length; c++) {
      pen.beginPath();
      pen.strokeStyle = COLOURS[(c - 1) % COLOURS.length];
      pen.setLineDash(DASHES[Math.floor((c - 1) / COLOURS.length) % DASHES.length]);
      pen.lineWidth = 2;
      rows.forEach((row, i) => (i ? pen.lineTo(x(row[0]), y(row[c])) : pen.moveTo(x(row[0]), y(row[c]))));
      pen.stroke();
    }
    pen.setLineDash([]);
    if (this.cursor !== null) {
      const at = Math.max(left, this.cursor * width);
      pen.strokeStyle = colour("front");
      pen.beginPath(); pen.moveTo(at, 0); pen.lineTo(at, tall - foot); pen.stroke();
    }
  }

  // What stands at the cursor, or the newest: [{name, unit, value, colour}].
  readings() {
    if (!this.rows.length) return [];
    const end = this.rows[this.rows.length - 1][0];
    const left = 56 / (this.canvas.clientWidth || 1);
    const at = this.cursor === null ? end : end - this.spanS * 1000 * (1 - Math.max(0, (this.cursor - left) / (1 - left)));
    let row = this.rows[0];
    for (const one of this.rows) { if (one[0] <= at) row = one; else break; }
    return this.columns.slice(1).map((column, i) => ({ ...column, value: row[i + 1], colour: COLOURS[i % COLOURS.length] }));
  }
}

// Amplitudes of a real signal by frequency, Hann window: [[Hz, amplitude]], without the mean. Length: the largest power of 2 that fits.
export function spectrum(values, rateHz) {
  let n = 1;
  while (n * 2 <= values.length) n *= 2;
  if (n < 16) return [];
  const tail = values.slice(values.length - n);
  const mean = tail.reduce((a, b) => a + b, 0) / n;
  const re = tail.map((v, i) => (v - mean) * (0.5 - 0.5 * Math.cos(2 * Math.PI * i / n))), im = new Array(n).fill(0);
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) { [re[i], re[j]] = [re[j], re[i]]; }
  }
  for (let size = 2; size <= n; size *= 2) {
    const angle = -2 * Math.PI / size;
    for (let start = 0; start < n; start += size) {
      for (let k = 0; k < size / 2; k++) {
        const c = Math.cos(angle * k), s = Math.sin(angle * k), a = start + k, b = a + size / 2;
        const tr = re[b] * c - im[b] * s, ti = re[b] * s + im[b] * c;
        re[b] = re[a] - tr; im[b] = im[a] - ti; re[a] += tr; im[a] += ti;
      }
    }
  }
  const out = [];
  for (let k = 1; k < n / 2; k++) out.push([k * rateHz / n, 4 * Math.hypot(re[k], im[k]) / n]);
  return out;
}

// The strongest line, between the bins by a parabola: [Hz, amplitude].
export function strongest(lines) {
  let best = 1;
  for (let k = 2; k < lines.length - 1; k++) if (lines[k][1] > lines[best][1]) best = k;
  if (lines.length < 3) return [0, 0];
  const [a, b, c] = [lines[best - 1][1], lines[best][1], lines[best + 1][1]];
  const shift = a - 2 * b + c === 0 ? 0 : 0.5 * (a - c) / (a - 2 * b + c);
  return [lines[best][0] + shift * (lines[1][0] - lines[0][0]), b];
}
