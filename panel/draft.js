// SPDX-License-Identifier: MIT
// draft.js - a configuration as somebody edits it: the text, the one it was made from, and what heaved says of it. Kept in the browser until it is applied: a
// lost network, a closed tab or an empty battery loses nothing.
import { store } from "./store.js";
import { chinese } from "./text.js";

const CHECK_AFTER_MS = 500, AGAIN_MS = 700;
const headOf = (line) => /^\[([^\]]+)\]/.exec(line)?.[1];
const keyOf = (line) => /^([A-Za-z0-9_:]+)\s*[=:]/.exec(line)?.[1];

// Where keys stand: [{section, key, value, line}], lines from 1.
export function entriesOf(text) {
  let section = "";
  const entries = [];
  text.split("\n").forEach((line, i) => {
    section = headOf(line) ?? section;
    const key = keyOf(line);
    if (key && section) entries.push({ section, key, value: line.slice(line.search(/[=:]/) + 1).replace(/\s;.*$/, "").trim(), line: i + 1 });
  });
  return entries;
}

// The text with another value of a key; null takes it out. Comments and order stay; a new key goes behind the last one of its section.
export function withValue(text, section, key, value) {
  const lines = text.split("\n");
  let now = "", last = -1;
  for (let i = 0; i < lines.length; i++) {
    now = headOf(lines[i]) ?? now;
    if (now !== section) continue;
    if (lines[i].trim() !== "" && !lines[i].startsWith(";")) last = i;
    if (keyOf(lines[i]) !== key) continue;
    if (value === null) lines.splice(i, 1);
    else lines[i] = `${key} = ${value}${/\s+;.*$/.exec(lines[i])?.[0] ?? ""}`;
    return lines.join("\n");
  }
  if (value === null) return text;
  if (last < 0) return `${text.replace(/\n*$/, "\n\n")}[${section}]\n${key} = ${value}\n`;
  lines.splice(last + 1, 0, `${key} = ${value}`);
  return lines.join("\n");
}

// [[" ", line], ["-", line], ["+", line]]: what makes one text of the other.
export function difference(before, after) {
  const a = before.split("\n"), b = after.split("\n");
  let from = 0, endA = a.length, endB = b.length;
  while (from < endA && from < endB && a[from] === b[from]) from++;
  while (endA > from && endB > from && a[endA - 1] === b[endB - 1]) { endA--; endB--; }
  const x = a.slice(from, endA), y = b.slice(from, endB), middle = [];
  if (x.length * y.length > 4e6) {
    middle.push(...x.map((line) => ["-", line]), ...y.map((line) => ["+", line]));
  } else {
    const width = y.length + 1, longest = new Uint32Array((x.length + 1) * width);
    for (let i = x.length - 1; i >= 0; i--) {
      for (let j = y.length - 1; j >= 0; j--) longest[i * width + j] = x[i] === y[j] ? longest[(i + 1) * width + j + 1] + 1 : Math.max(longest[(i + 1) * width + j], longest[i * width + j + 1]);
    }
    for (let i = 0, j = 0; i < x.length || j < y.length;) {
      if (i < x.length && j < y.length && x[i] === y[j]) { middle.push([" ", x[i]]); i++; j++; }
      else if (i < x.length && (j === y.length || longest[(i + 1) * width + j] >= longest[i * width + j + 1])) middle.push(["-", x[i++]]);
      else middle.push(["+", y[j++]]);
    }
  }
  return [...a.slice(0, from).map((line) => [" ", line]), ...middle, ...a.slice(endA).map((line) => [" ", line])];
}

export class Draft {
  constructor(platform) {
    Object.assign(this, { platform, text: "", base: null, isRestored: false, staged: "", found: null, geometry: null, error: "", listeners: new Set(), count: 0 });
  }

  get name() { return `heave-draft-${this.platform}`; }
  get isChanged() { return this.base !== null && this.text !== this.base.text; }

  // The configuration in force. The draft that was left stays the text.
  async load() {
    const answer = await fetch(`api/config/${this.platform}`);
    const got = await answer.json();
    if (!answer.ok) throw new Error(got.error);
    const kept = JSON.parse(store.get(this.name) ?? "null");
    this.isRestored = kept !== null && kept.text !== got.text && `${kept.text}\n` !== got.text; // heaved ends the last line of what it keeps
    this.wasMadeFrom = this.isRestored ? kept.base : got.digest;
    this.text = this.isRestored ? kept.text : got.text;
    this.base = got;
    this.keep();
    await this.check();
  }

  // Another one is in force meanwhile, and the draft is made from that from now on.
  async rebase() {
    store.set(this.name, JSON.stringify({ base: this.base.digest, text: this.text }));
    await this.load();
    this.wasMadeFrom = this.base.digest;
    this.keep();
    this.tell();
  }

  // What was handed over is in force only once heaved has started with it; should it not be able to, the draft is here again.
  handedOver() { store.set(this.name, JSON.stringify({ base: this.base.digest, text: this.text })); }

  keep() {
    if (this.isChanged) store.set(this.name, JSON.stringify({ base: this.wasMadeFrom, text: this.text }));
    else store.remove(this.name);
  }

  set(text) {
    if (text === this.text) return;
    this.text = text;
    this.staged = "";
    this.keep();
    this.tell();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), CHECK_AFTER_MS);
  }

  value(section, key) { return entriesOf(this.text).find((one) => one.section === section && one.key === key)?.value ?? null; }

  setValue(section, key, value) { this.set(withValue(this.text, section, key, value)); }

  revert() {
    this.set(this.base.text);
    this.isRestored = false;
    this.wasMadeFrom = this.base.digest;
    this.keep();
  }

  // What heaved --check says of the text as it is now.
  async check() {
    const mine = ++this.count;
    let got = {};
    try {
      const answer = await fetch(`api/check/${this.platform}${chinese() ? "/zh" : ""}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ text: this.text }) });
      got = await answer.json();
      if (answer.status === 503 && mine === this.count) { this.error = got.error; this.tell(); this.timer = setTimeout(() => this.check(), AGAIN_MS); return; }
    } catch (error) {
      got = { error: String(error.message) };
      this.timer = setTimeout(() => this.check(), AGAIN_MS * 4);
    }
    if (mine !== this.count) return;
    this.error = got.error ?? "";
    this.staged = got.staged ?? "";
    this.found = got.check ?? this.found;
    this.geometry = this.found?.geometry ?? this.geometry; // while there are mistakes, the last one that was right
    this.tell();
  }

  tell() { for (const one of this.listeners) one(); }

  end() { clearTimeout(this.timer); this.count++; this.listeners.clear(); }
}
