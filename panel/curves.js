// SPDX-License-Identifier: MIT
// curves.js - curves of the samples, every cycle of the last half minute: each place of the screen shows the least and the most of what lies in it, so that no peak is lost, at any zoom. And the
// spectrum of one of them.
import { drawBand, widened } from "./band.js";
import { penOn } from "./ui.js";

// As the page is light or dark; they differ in lightness too.
export const colours = () => { const style = getComputedStyle(document.documentElement); return [1, 2, 3, 4, 5, 6, 7].map((n) => style.getPropertyValue(`--c${n}`).trim()); };
export const KEPT_S = 30;
const LEAST_S = 0.02, MOST_S = 30;
const LEFT = 62, FOOT = 24;
const DASHES = [[], [8, 4], [2, 3]];
const NONE = 4294967; // ms and more: there was no frame yet

// Records by age, the oldest first; the first column is the time in ms.
export class Store {
  constructor(columns, cycleUs) {
    Object.assign(this, { columns, capacity: Math.ceil(KEPT_S * 1e6 / cycleUs) + 1, count: 0 });
    this.data = columns.map(() => new Float64Array(this.capacity));
  }

  get length() { return Math.min(this.count, this.capacity); }

  value(column, i) { return this.data[column][(this.count - this.length + i) % this.capacity]; }

  add(columns, row) {
    const at = this.count % this.capacity;
    columns.forEach((values, c) => { this.data[c][at] = values[row]; });
    this.count += 1;
  }

  // The first record that is not before a time; `length` where there is none.
  find(ms) {
    let low = 0, high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.value(0, middle) < ms) low = middle + 1; else high = middle;
    }
    return low;
  }

  // A column in so many places between two times, as of band.js.
  envelope(column, from, to, places) {
    const out = new Array(places).fill(null), scale = places / (to - from), ring = this.data[column], times = this.data[0], begin = this.count - this.length;
    for (let i = this.find(from); i < this.length; i++) {
      const at = (begin + i) % this.capacity, place = Math.floor((times[at] - from) * scale), value = ring[at];
      if (place >= places) break;
      if (value < NONE) out[place] = widened(out[place], value);
    }
    return out;
  }

  // The newest values of a column, the oldest of them first.
  tail(column, rows) {
    const length = this.length, from = Math.max(0, length - rows);
    return Array.from({ length: length - from }, (_, i) => this.value(column, from + i));
  }
}

export class Curves {
  constructor(canvas) {
    Object.assign(this, { canvas, spanS: 10, endMs: null, isPaused: false, cursorMs: null, lost: 0, marks: [], level: 0, isArmed: false, metAt: null, chosen: 1, hidden: new Set(), touches: new Map() });
    this.begin([], 1000);
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.up(event));
    canvas.addEventListener("pointercancel", (event) => { this.touches.delete(event.pointerId); this.moved = Infinity; });
    canvas.addEventListener("pointerleave", () => { if (!this.isPaused) this.cursorMs = null; });
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.timeAt(event.offsetX)); }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const act = { "+": () => this.zoom(0.5), "-": () => this.zoom(2), ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), Enter: () => this.mark(this.cursorMs) }[event.key];
      if (act) { act(); event.preventDefault(); }
    });
  }

  // columns: {name, unit}; the first is the time.
  begin(columns, cycleUs) {
    Object.assign(this, { columns, cycleUs, lost: 0, endMs: null, cursorMs: null, store: new Store(columns, cycleUs), hidden: new Set(), chosen: Math.min(this.chosen, Math.max(1, columns.length - 1)) });
  }

  get newest() { return this.store.length ? this.store.value(0, this.store.length - 1) : 0; }

  get end() { return this.endMs ?? this.newest; }

  get width() { return this.canvas.clientWidth - LEFT; }

  timeAt(px) { return this.end - this.spanS * 1000 * (1 - Math.max(0, px - LEFT) / this.width); }

  // --- Fingers, mouse and keys ---

  down(event) {
    this.touches.set(event.pointerId, event.offsetX);
    Object.assign(this, { moved: this.touches.size > 1 ? Infinity : 0, cursorMs: this.timeAt(event.offsetX) });
    this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const before = this.touches.get(event.pointerId);
    if (before === undefined) {
      this.cursorMs = this.timeAt(event.offsetX);
      return;
    }
    const [one, other] = [...this.touches.values()];
    this.touches.set(event.pointerId, event.offsetX);
    this.moved += Math.abs(event.offsetX - before);
    if (this.touches.size === 2) {
      const [a, b] = [...this.touches.values()];
      this.zoom(Math.max(0.5, Math.min(2, Math.abs(one - other) / Math.max(1, Math.abs(a - b)))), this.timeAt((a + b) / 2));
    } else if (this.isPaused && this.moved > 6) {
      this.pan(-(event.offsetX - before) / this.width * this.spanS * 1000);
    } else {
      this.cursorMs = this.timeAt(event.offsetX);
    }
  }

  up(event) {
    if (this.touches.size === 1 && this.moved <= 6) this.mark(this.timeAt(event.offsetX));
    this.touches.delete(event.pointerId);
  }

  // Shows so many times as much time, and keeps a moment where it is. What runs keeps its newest end.
  zoom(factor, keptMs = this.cursorMs ?? this.end - this.spanS * 500) {
    const span = Math.max(LEAST_S, Math.min(MOST_S, this.spanS * factor));
    if (this.isPaused) this.endMs = keptMs + (this.end - keptMs) * span / this.spanS;
    this.spanS = span;
    this.pan(0);
  }

  pan(ms) {
    if (!this.isPaused || !this.store.length) return;
    const span = this.spanS * 1000, oldest = this.store.value(0, 0);
    this.endMs = Math.min(this.newest, Math.max(Math.min(oldest + span, this.newest), this.end + ms));
  }

  // The cursor by one record, or by a hundredth of the screen where that is more.
  step(way) {
    const ms = Math.max(this.cycleUs / 1000, this.spanS * 10);
    this.cursorMs = (this.cursorMs ?? this.end - this.spanS * 500) + way * ms;
    if (this.cursorMs > this.end) this.pan(ms); else if (this.cursorMs < this.end - this.spanS * 1000) this.pan(-ms);
  }

  // Two marks in what stands still: the third one begins again.
  mark(time) {
    if (this.isPaused && time !== null) this.marks = this.marks.length === 2 ? [time] : [...this.marks, time];
  }

  pause(isPaused) {
    Object.assign(this, { isPaused, endMs: isPaused ? this.newest : null, marks: [], isArmed: false, metAt: null });
  }

  // Stands still half a screen after the chosen curve has risen through the level.
  arm(level) {
    Object.assign(this, { level, isArmed: true, metAt: null, isPaused: false, endMs: null, marks: [] });
  }

  watch() {
    const last = this.store.length - 1;
    if (!this.isArmed || last < 1) return;
    if (this.metAt === null && this.store.value(this.chosen, last - 1) < this.level && this.store.value(this.chosen, last) >= this.level) this.metAt = this.newest;
    if (this.metAt !== null && this.newest >= this.metAt + this.spanS * 500) Object.assign(this, { isArmed: false, isPaused: true, endMs: this.newest });
  }

  // The values at a time, the time first; null where there are none.
  rowAt(ms) {
    const { store } = this;
    if (!store.length) return null;
    const at = Math.max(0, Math.min(store.length - 1, store.find(ms + 1e-6) - 1));
    return this.columns.map((_, c) => store.value(c, at));
  }

  // Between the marks: {ms, hz, values}; null where there are not two.
  between() {
    if (this.marks.length < 2 || !this.store.length) return null;
    const [a, b] = [...this.marks].sort((one, other) => one - other), first = this.rowAt(a), second = this.rowAt(b);
    return { ms: b - a, hz: 1000 / (b - a), values: this.columns.slice(1).map((_, i) => second[i + 1] - first[i + 1]) };
  }

  take(block) {
    this.lost += block.lost;
    if (this.isPaused || block.columns.length !== this.columns.length) return;
    for (let i = 0; i < block.rows && !this.isPaused; i++) {
      this.store.add(block.columns, i);
      this.watch();
    }
  }

  draw(tall) {
    const made = penOn(this.canvas, tall);
    if (made === null) return;
    const { pen, width, colour } = made;
    pen.font = "13px system-ui, sans-serif";
    if (this.store.length < 2) return;
    const end = this.end, begin = end - this.spanS * 1000, places = Math.floor(this.width);
    const bands = this.columns.map((_, c) => (c && !this.hidden.has(c) ? this.store.envelope(c, begin, end + this.cycleUs / 2000, places) : null));
    const [least, most] = ends(bands);
    const x = (ms) => LEFT + (ms - begin) / (end - begin) * this.width, y = (value) => (tall - FOOT) * (1 - (value - least) / (most - least));
    this.scale(pen, { colour, x, y, least, most, begin, end, width, tall });
    const lines = colours();
    bands.forEach((places, c) => { if (places) this.curve(pen, places, y, lines[(c - 1) % lines.length], DASHES[Math.floor((c - 1) / lines.length) % DASHES.length]); });
    pen.setLineDash([]);
    const upright = (ms, stroke, dash = []) => {
      if (ms === null || ms < begin || ms > end) return;
      Object.assign(pen, { strokeStyle: colour(stroke), lineWidth: 2 });
      pen.setLineDash(dash);
      pen.beginPath(); pen.moveTo(x(ms), 0); pen.lineTo(x(ms), tall - FOOT); pen.stroke();
      pen.setLineDash([]);
    };
    for (const mark of this.marks) upright(mark, "act");
    upright(this.metAt, "act", [3, 5]);
    if ((this.isArmed || this.metAt !== null) && this.level > least && this.level < most) {
      pen.strokeStyle = colour("act");
      pen.setLineDash([3, 5]);
      pen.beginPath(); pen.moveTo(LEFT, y(this.level)); pen.lineTo(width, y(this.level)); pen.stroke();
      pen.setLineDash([]);
    }
    upright(this.cursorMs, "front");
  }

  curve(pen, places, y, stroke, dash) {
    Object.assign(pen, { strokeStyle: stroke, lineWidth: 2, lineJoin: "round" });
    pen.setLineDash(dash);
    drawBand(pen, places, (at) => LEFT + at, y);
  }

  scale(pen, { colour, y, least, most, width, tall, end }) {
    Object.assign(pen, { strokeStyle: colour("line"), fillStyle: colour("soft"), lineWidth: 1 });
    for (const value of ticks(least, most, 5)) {
      pen.beginPath(); pen.moveTo(LEFT, y(value)); pen.lineTo(width, y(value)); pen.stroke();
      pen.textAlign = "right";
      if (y(value) > 10 && y(value) < tall - FOOT - 2) pen.fillText(value.toFixed(most - least < 0.02 ? 4 : most - least < 2 ? 3 : most - least < 20 ? 2 : 1), LEFT - 6, y(value) + 4);
    }
    const late = (this.newest - end) / 1000, digits = this.spanS < 0.5 ? 3 : this.spanS < 5 ? 2 : 1;
    const places = this.width < 420 ? 2 : 4;
    for (let k = 0; k <= places; k++) {
      pen.textAlign = k === 0 ? "left" : k === places ? "right" : "center";
      pen.fillText(`${(-late - this.spanS * (places - k) / places).toFixed(digits)} s`, LEFT + this.width * k / places, tall - 7);
    }
    pen.textAlign = "left";
    const unit = this.columns[this.chosen]?.unit;
    if (unit) pen.fillText(unit, 4, 14);
  }

  // What stands at the cursor, or the newest: [{name, unit, value, colour, column}].
  readings() {
    const row = this.rowAt(this.cursorMs ?? this.end);
    if (!row) return [];
    const lines = colours();
    return this.columns.slice(1).map((column, i) => ({ ...column, value: row[i + 1] < NONE ? row[i + 1] : null, colour: lines[i % lines.length], column: i + 1, isDashed: i >= lines.length }));
  }
}

// The ends of a scale over all of it, with some room.
export function ends(bands) {
  let least = Infinity, most = -Infinity;
  for (const places of bands) {
    for (const one of places ?? []) {
      if (one === null) continue;
      least = Math.min(least, one[0]);
      most = Math.max(most, one[1]);
    }
  }
  if (least > most) [least, most] = [0, 1];
  const spare = Math.max((most - least) * 0.08, 1e-3);
  return [least - spare, most + spare];
}

// Round values between two: 1, 2 or 5 times a power of ten apart.
export function ticks(least, most, wanted) {
  const raw = (most - least) / wanted, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find((one) => one * power >= raw) * power;
  const out = [];
  for (let k = Math.ceil(least / step); k * step <= most; k++) out.push(k * step);
  return out;
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
