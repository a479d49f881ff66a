// SPDX-License-Identifier: MIT
// incidents.js - what the black box has written, and one of them looked at: time line, curves, the platform at any speed, its files.
import { drawBand } from "./band.js";
import { colours } from "./curves.js";
import { envelope, readFrames, readGeometry, readTable, rowAt, statesOf } from "./incident.js";
import { t } from "./text.js";
import { button, choice, element, fill, number, penOn, table } from "./ui.js";
import { View } from "./view.js";

const FILES = ["trace.csv", "feedback.csv", "frames", "platform.ini"];
const SPEEDS = ["0.05", "0.1", "0.25", "0.5", "1", "2", "5", "10", "50"];
const GROUPS = {
  sentMm: () => ["x_mm", "y_mm", "z_mm"], sentDeg: () => ["roll_deg", "pitch_deg", "yaw_deg"],
  errors: (trace) => trace.names.filter((name) => /^c\d_mm$/.test(name)), cylinders: (trace, feedback) => feedback.names.filter((name) => /^c\d_actual_mm$/.test(name)),
};
const SHADES = { OFF: "line", FAULT: "bad", ESTOP: "bad", HOLD: "warn", ENGAGED: "good", SERVICE: "warn" };

export async function build({ page, shown, request, place }) {
  const platform = shown.platform;
  const list = element("div", {});
  const show = (answer) => answer?.incidents && fill(list, answer.incidents.length ? table([t("incidents"), "", ""], [...answer.incidents].reverse().map((one) => [one.name,
    `${one.dump ? t("asDump") : ""} ${one.seen ? "" : t("new")}`, button(t("open"), null, { "data-incident": one.name, "aria-label": `${t("open")} ${one.name}` })]), true) : element("p", {}, t("noIncidents")));
  list.addEventListener("click", (event) => { if (event.target.dataset.incident) open(page, shown, platform, event.target.dataset.incident, place); });
  place.replaceChildren(element("section", {}, element("h2", {}, t("incidents")), element("p", {}, t("incidentHelp")),
    element("div", { class: "buttons" }, button(t("seen"), async () => show(await request("seen"))), button(t("dump"), async () => { await request("dump"); show(await request("incidents")); }, { "data-request": "dump" })), list));
  show(await request("incidents"));
}

const pathOf = (platform, name, file) => `api/incident/${platform}/${name}/${file}`;

async function read(platform, name, file) {
  const answer = await fetch(pathOf(platform, name, file));
  if (!answer.ok) throw new Error((await answer.json()).error);
  return answer.text();
}

async function open(page, shown, platform, name, place) {
  place.replaceChildren(element("section", {}, element("h2", {}, name), element("p", {}, t("loading"))));
  try {
    const [trace, frames, platformText] = await Promise.all(["trace.csv", "frames", "platform.ini"].map((file) => read(platform, name, file)));
    const rows = readTable(trace);
    const story = readFrames(frames, rows.before);
    const geometry = story.hash && story.hash === shown.status?.configuration.hash ? shown.geometry : readGeometry(platformText);
    if (rows.t.length < 2) throw new Error(t("noIncidents"));
    new Replay({ page, platform, name, place, rows, story, geometry }).build();
  } catch (error) {
    place.replaceChildren(element("section", {}, element("h2", {}, name), element("p", { class: "bad" }, String(error.message))));
  }
}

class Replay {
  constructor(given) {
    Object.assign(this, given, { group: "sentMm", speed: 1, isPlaying: false, feedback: null });
    this.states = statesOf(this.rows);
    this.from = this.rows.t[0];
    this.to = this.rows.t[this.rows.t.length - 1];
    this.ends = [this.from, this.to];
    const trouble = this.states.find((run) => run.state === "FAULT" || run.state === "ESTOP");
    this.now = trouble ? trouble.t : this.from;
    this.events = [...this.story.events, ...this.states.map((run) => ({ t: run.t, kind: "state", text: run.state }))].sort((a, b) => a.t - b.t);
  }

  build() {
    const { name, platform, story } = this;
    this.slider = element("input", { type: "range", class: "wide", min: this.ends[0], max: this.ends[1], step: "any", "aria-label": t("time"), id: "replay-time" });
    this.slider.addEventListener("input", () => { this.isPlaying = false; this.seek(Number(this.slider.value)); });
    this.playing = button(t("play"), () => this.play(!this.isPlaying), { id: "replay-play" });
    this.curves = element("canvas", { role: "img", "aria-label": t("curves") });
    this.curves.addEventListener("pointerdown", (event) => this.seek(this.from + (this.to - this.from) * event.offsetX / this.curves.clientWidth));
    const view = element("div", { class: "view" });
    this.readings = element("div", { id: "replay-readings" });
    const line = table([t("time"), t("what"), ""], this.events.map((one) => [`${(one.t / 1000).toFixed(3)} s`, t(one.kind), one.kind === "state" ? t(one.text) : one.text]), true);
    line.id = "time-line";
    line.classList.add("tall");
    [...line.querySelectorAll("tbody tr")].forEach((row, i) => {
      row.tabIndex = 0;
      row.addEventListener("click", () => this.seek(this.events[i].t));
      row.addEventListener("keydown", (event) => { if (event.key === "Enter") this.seek(this.events[i].t); });
    });
    const zoom = (factor) => () => this.zoom(factor);
    this.place.replaceChildren(element("div", { class: "grid" },
      element("section", {}, element("h2", {}, name), element("p", {}, name.endsWith("-dump") ? t("asDump") : story.head[1] ?? ""), element("p", {}, `${t("length")}: ${((this.ends[1] - this.ends[0]) / 1000).toFixed(1)} s; ${t("framesHad")}: ${story.frames}`),
        element("div", { class: "buttons" }, ...FILES.map((file) => element("a", { class: "button", href: pathOf(platform, name, file), download: `${name}-${file}` }, `${t("download")} ${file}`))))),
    element("div", { class: "grid wide" }, element("section", {}, element("h2", {}, t("curves")), element("div", { class: "buttons" },
      choice(t("group"), Object.keys(GROUPS), this.group, (value) => this.choose(value), t), button("+", zoom(0.5), { "aria-label": t("zoomIn") }), button("−", zoom(2), { "aria-label": t("zoomOut") })), this.curves, this.readings,
    this.slider, element("div", { class: "buttons" }, this.playing, choice(t("atSpeed"), SPEEDS, "1", (value) => { this.speed = Number(value); }, (value) => `× ${value}`))),
    element("section", {}, element("h2", {}, t("machine")), this.geometry ? view : element("p", {}, t("noGeometry")))),
    element("section", {}, element("h2", {}, t("timeLine")), line));
    this.picture = this.geometry ? new View(view) : null;
    this.page.end = () => this.picture?.end();
    this.page.frame = () => this.step();
    this.seek(this.now);
  }

  async choose(group) {
    if (group === "cylinders" && !this.feedback) this.feedback = readTable(await read(this.platform, this.name, "feedback.csv"));
    this.group = group;
    this.draw();
  }

  play(isPlaying) {
    if (isPlaying && this.now >= this.ends[1]) this.now = this.ends[0];
    this.isPlaying = isPlaying;
    this.last = performance.now();
    this.playing.textContent = t(isPlaying ? "pause" : "play");
  }

  step() {
    if (!this.isPlaying) return;
    const now = performance.now();
    const next = this.now + (now - this.last) * this.speed;
    this.last = now;
    this.seek(Math.min(next, this.ends[1]));
    if (next >= this.ends[1]) this.play(false);
  }

  zoom(factor) {
    const width = Math.max(20, Math.min(this.ends[1] - this.ends[0], (this.to - this.from) * factor));
    this.from = Math.max(this.ends[0], Math.min(this.now - width / 2, this.ends[1] - width));
    this.to = this.from + width;
    this.draw();
  }

  seek(time) {
    this.now = time;
    if (time < this.from || time > this.to) {
      const width = this.to - this.from;
      this.from = Math.max(this.ends[0], Math.min(time - width / 2, this.ends[1] - width));
      this.to = this.from + width;
    }
    this.slider.value = time;
    this.draw();
  }

  draw() {
    const source = this.group === "cylinders" ? this.feedback : this.rows;
    const names = GROUPS[this.group](this.rows, this.feedback);
    const row = rowAt(source.t, this.now), own = rowAt(this.rows.t, this.now);
    const lines = colours();
    drawCurves(this.curves, { ...this, source, names, lines });
    fill(this.readings, element("b", {}, `${(this.now / 1000).toFixed(3)} s  ${t(this.rows.column.state[own])}  `), ...names.map((name, i) => {
      const one = element("span", {}, `■ ${name} ${number(source.column[name][row], 3)}   `);
      one.style.color = lines[i % lines.length];
      return one;
    }), element("span", { class: "soft" }, `${t("relays")} ${this.rows.column.relays[own]}  ${this.rows.column.flags[own]}`));
    if (this.picture) {
      const value = (name) => this.rows.column[name][own];
      const pose = Object.fromEntries(["roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm"].map((name) => [name, value(name)]));
      this.picture.draw(this.geometry, { pose_sent: pose, pose_asked: null, cylinders: this.geometry.base_mm.map((_, i) => ({ sent_mm: value(`c${i + 1}_mm`), stroke_mm: this.geometry.stroke_mm[i] })) });
    }
  }
}

// States as a band above, the least and the most of each pixel below, a line where the replay is.
function drawCurves(canvas, { source, names, lines, from, to, now, states }) {
  const tall = 300, band = 16, left = 56, made = penOn(canvas, tall);
  if (made === null) return;
  const { pen, width, colour } = made;
  pen.font = "12px sans-serif";
  const x = (time) => width * (time - from) / (to - from);
  for (const run of states) {
    if (run.until < from || run.t > to) continue;
    pen.fillStyle = colour(SHADES[run.state] ?? "act");
    pen.fillRect(x(run.t), 0, Math.max(1, x(run.until) - x(run.t)), band);
  }
  const bands = names.map((name) => envelope(source.t, source.column[name], from, to, Math.max(1, Math.floor(width))));
  const all = bands.flat().filter((one) => one !== null).flat();
  if (!all.length) return;
  let least = all.reduce((a, b) => Math.min(a, b)), most = all.reduce((a, b) => Math.max(a, b));
  const spare = Math.max((most - least) * 0.08, 1e-3);
  least -= spare; most += spare;
  const y = (value) => band + (tall - band) * (1 - (value - least) / (most - least));
  Object.assign(pen, { strokeStyle: colour("line"), fillStyle: colour("soft"), lineWidth: 1 });
  for (let k = 0; k <= 4; k++) {
    const value = least + (most - least) * k / 4;
    pen.beginPath(); pen.moveTo(left, y(value)); pen.lineTo(width, y(value)); pen.stroke();
    pen.fillText(value.toFixed(most - least < 1 ? 3 : 1), 2, Math.max(band + 11, Math.min(tall - 4, y(value) + 4)));
  }
  bands.forEach((envelopes, i) => {
    pen.strokeStyle = lines[i % lines.length];
    pen.lineWidth = 1.5;
    drawBand(pen, envelopes, (at) => at, y);
  });
  pen.strokeStyle = colour("front");
  pen.lineWidth = 2;
  pen.beginPath(); pen.moveTo(x(now), 0); pen.lineTo(x(now), tall); pen.stroke();
}
