// SPDX-License-Identifier: MIT
// incident.js - what the files of an incident say (docs/operation.md, docs/offline.md): columns over time, states, and what happened when.
import { widened } from "./band.js";

const WORDS = { from: "fromSender", fault: "wasFault", drive: "atDrive", estop: "atEstop", late: "wasLate", config: "wasReload" };

// Columns of a CSV of numbers; the others as texts. Time runs on over time zero, where t_ms begins anew: what was before it is negative.
export function readTable(text) {
  const lines = text.split("\n");
  const names = lines[0].split(",");
  const rows = [];
  for (let i = 1; i < lines.length; i++) {
    const cells = lines[i].split(",");
    if (cells.length === names.length) rows.push(cells);
  }
  const column = {};
  names.forEach((name, c) => {
    const isText = name === "state" || name === "relays" || name === "flags" || name === "fault" || /_(state|code|error)$/.test(name);
    column[name] = isText ? rows.map((row) => row[c]) : Float64Array.from(rows, (row) => Number(row[c]));
  });
  let zero = -1;
  for (let i = 1; i < rows.length; i++) if (column.t_ms[i] < column.t_ms[i - 1]) zero = i;
  const before = zero > 0 ? column.t_ms[zero - 1] : 0;
  const t = zero > 0 ? column.t_ms.map((ms, i) => (i < zero ? ms - before : ms)) : column.t_ms;
  return { t, column, names, before };
}

// Runs of one state: [{t, until, state}].
export function statesOf(trace) {
  const runs = [];
  trace.column.state.forEach((state, i) => {
    const last = runs[runs.length - 1];
    if (last && last.state === state) last.until = trace.t[i];
    else runs.push({ t: trace.t[i], until: trace.t[i], state });
  });
  return runs;
}

// {head: the comments, hash: of the configuration, events: [{t, kind: a name in text.js, text}], frames}. before: of readTable(), for what is told of the time before time zero.
export function readFrames(text, before = 0) {
  const head = [], events = [], senders = new Map();
  let sender = "127.0.0.1", frames = 0, isZero = false;
  for (const line of text.split("\n")) {
    const found = /^(; )?(-?[\d.]+) (.*)$/.exec(line);
    if (!found) {
      if (line.startsWith("; time zero")) isZero = true;
      else if (line.startsWith(";")) head.push(line.slice(2));
      continue;
    }
    const t = Number(found[2]) - (found[1] && !isZero ? before : 0);
    if (found[3].startsWith("!")) {
      const word = /^!(\w*)/.exec(found[3])[1];
      if (word === "from") sender = found[3].slice(6);
      if (!["feedback", "state", "end", "from"].includes(word)) events.push({ t, kind: WORDS[word] ?? "wasRequest", text: found[3].slice(1) });
    } else {
      frames += 1;
      if (!senders.has(sender)) events.push({ t, kind: "fromSender", text: sender });
      senders.set(sender, t);
    }
  }
  return { head, hash: /, ([0-9a-f]{16}), incident-/.exec(head[0] ?? "")?.[1] ?? "", events, frames };
}

// The mechanism of a platform.ini, as `geometry` has it; null where it takes heaved to know.
export function readGeometry(text) {
  const value = {};
  let section = "";
  for (const line of text.split("\n")) {
    const head = /^\[(\w[\w-]*)\]/.exec(line), pair = /^(\w+) *= *(.*?) *$/.exec(line);
    if (head) section = head[1];
    else if (pair) value[`${section}.${pair[1]}`] = pair[2];
  }
  const numbers = (name) => (value[name] ?? "").split(",").map(Number);
  const count = value["platform.kind"] === "hexapod" ? 6 : 3;
  const joints = (side) => Array.from({ length: count }, (_, i) => numbers(`geometry.${side}${i + 1}_mm`));
  const same = (name) => { const all = numbers(name); return Array.from({ length: count }, (_, i) => all[i] ?? all[0]); };
  const geometry = { base_mm: joints("base"), plate_mm: joints("plate"), retracted_length_mm: same("geometry.retracted_length_mm"), stroke_mm: same("geometry.stroke_mm"),
    zero_height_mm: Number(value["geometry.zero_height_mm"]), mrp_mm: numbers("geometry.mrp_mm") };
  const isWhole = [...geometry.base_mm.flat(), ...geometry.plate_mm.flat(), ...geometry.retracted_length_mm, ...geometry.mrp_mm, geometry.zero_height_mm].every(Number.isFinite);
  return isWhole && count * 3 === geometry.base_mm.flat().length && value["geometry.as_measured"] !== "yes" ? geometry : null;
}

// Index of the row that holds at a time.
export function rowAt(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

// A column in so many places between two times, as of band.js.
export function envelope(times, values, from, to, places) {
  const out = Array.from({ length: places }, () => null);
  for (let i = rowAt(times, from); i < times.length && times[i] <= to; i++) {
    if (times[i] < from) continue;
    const place = Math.min(places - 1, Math.floor((times[i] - from) / (to - from) * places));
    out[place] = widened(out[place], values[i]);
  }
  return out;
}
