// SPDX-License-Identifier: MIT
// live.js - what the platform does now: curves of every cycle, the platform, its states, who sends, how late things are, what buses and drives say.
import { Curves, spectrum, strongest } from "./curves.js";
import { Diagram } from "./diagram.js";
import { busOf, drivesOf } from "./drives.js";
import { Motion } from "./motion.js";
import { refusalOf, t } from "./text.js";
import { Times } from "./times.js";
import { button, choice, element, fill, number, penOn } from "./ui.js";
import { View } from "./view.js";

const SPECTRUM_ROWS = 4096, FLOOR = 0.0005; // what is less is rounding
const FRAME_MS = 45, SLOW_EVERY = 6, TIMES_MS = 2000;
const AXES = { translations: ["x_mm", "y_mm", "z_mm"], rotations: ["roll_deg", "pitch_deg", "yaw_deg"] };
const each = (count, name) => Array.from({ length: count }, (_, i) => name(i + 1));
// Columns of a group; `a-b` is a difference, made by the panel cycle by cycle.
const GROUPS = {
  translations: () => AXES.translations.flatMap((axis) => [`sent_${axis}`, `actual_${axis}`]), rotations: () => AXES.rotations.flatMap((axis) => [`sent_${axis}`, `actual_${axis}`]),
  askedGroup: () => [...AXES.translations, ...AXES.rotations].map((axis) => `asked_${axis}`), cylinders: (n) => each(n, (i) => `actual_c${i}_mm`), errors: (n) => each(n, (i) => `sent_c${i}_mm`),
  followingGroup: (n) => each(n, (i) => `sent_c${i}_mm-actual_c${i}_mm`), drivesGroup: (n) => each(n, (i) => `drive${i}`), torqueGroup: (n) => each(n, (i) => `drive${i}_torque_percent`), ageGroup: () => ["frame_age_ms"], cycleGroup: () => ["wake_us", "work_us"],
};

export function build(given) {
  new Live(given).build();
}

class Live {
  constructor(given) {
    Object.assign(this, given, { group: "translations", count: 0, drawn: 0, asked: 0, platform: given.shown.platform });
  }

  build() {
    const { shown, page, place, link, takers } = this;
    this.canvas = element("canvas", { role: "img", tabindex: "0", "aria-label": t("curves") });
    this.lines = element("canvas", { role: "img", "aria-label": t("spectrum") });
    this.curves = new Curves(this.canvas);
    this.pause = button(t("pause"), () => { const go = this.curves.isPaused; this.curves.pause(!go); if (go) this.subscribe(); }, { id: "pause" });
    this.level = element("input", { type: "number", step: "any", value: 0, "aria-label": t("level"), id: "level" });
    this.trigger = button(t("trigger"), () => { const go = this.curves.isPaused; this.curves.arm(Number(this.level.value)); if (go) this.subscribe(); }, { id: "trigger" });
    this.record = button(t("record"), () => this.keep(), { id: "record" });
    this.chosen = element("div", {});
    Object.assign(this, { readings: element("div", { class: "chips", id: "readings" }), facts: element("div", {}), peak: element("p", { id: "peak" }), drives: element("div", {}), bus: element("div", {}), sender: element("div", {}) });
    this.readings.addEventListener("click", (event) => { const chip = event.target.closest("[data-column]"); if (chip) this.hide(Number(chip.dataset.column)); });
    const view = element("div", { class: "view" }), states = element("div", {}), times = element("div", {});
    const zoom = (factor) => () => { this.curves.zoom(factor); };
    const section = (name, ...parts) => element("section", {}, element("h2", {}, t(name)), ...parts);
    place.replaceChildren(element("div", { class: "grid wide" },
      element("div", { class: "stack" },
        section("curves", element("div", { class: "buttons" }, choice(t("group"), Object.keys(GROUPS).filter((name) => name !== "torqueGroup" || shown.status.cylinders.some((one) => one.report?.telemetry)), this.group, (value) => { this.group = value; this.subscribe(); }, t), this.pause,
          button("+", zoom(0.5), { "aria-label": t("zoomIn"), id: "zoom-in" }), button("−", zoom(2), { "aria-label": t("zoomOut"), id: "zoom-out" }), this.record), this.canvas, this.readings, this.facts,
        element("p", { class: "soft" }, t("marksHelp")), element("h2", {}, t("spectrum")), element("div", { class: "buttons" }, this.chosen, element("label", {}, `${t("level")} `, this.level), this.trigger), this.lines, this.peak),
        section("drives", this.drives, element("h2", {}, t("busAndRelays")), this.bus), section("latencies", times)),
      element("div", { class: "stack" }, section("machine", view, this.legend()), section("sender", this.sender), section("states", states))));
    this.view = new View(view);
    this.motion = new Motion({ link, takers, platform: this.platform, view: this.view });
    this.diagram = new Diagram(states);
    this.times = new Times(times);
    Object.assign(page, { update: (status) => this.update(status), frame: () => this.frame(), end: () => this.end(), curves: this.curves, view: this.view });
    this.update(shown.status);
    this.motion.begin(shown.geometry, shown.status);
    this.subscribe();
  }

  async subscribe() {
    const { link, shown, curves } = this;
    const status = shown.status;
    if (!status || this.isOver) return;
    if (this.stream) this.endStream();
    const names = GROUPS[this.group](status.cylinders.length), turn = (this.turn = (this.turn ?? 0) + 1);
    const got = await link.ask({ op: "samples", platform: this.platform, columns: ["t_ms", ...names], every: 1, history_s: 30 });
    if (got.error) { this.say(refusalOf(got)); return; }
    this.stream = got.stream;
    if (this.isOver || turn !== this.turn) { this.endStream(); return; }
    curves.begin(got.columns, got.cycle_us);
    this.takers[got.stream] = curves;
    fill(this.chosen, choice(t("chosen"), got.columns.slice(1).map((_, i) => String(i + 1)), String(curves.chosen), (value) => { curves.chosen = Number(value); }, (value) => got.columns[value].name));
  }

  endStream() {
    this.link.send({ op: "samples-end", platform: this.platform, stream: this.stream, id: 0 });
    delete this.takers[this.stream];
    this.stream = 0;
  }

  hide(column) {
    const { hidden } = this.curves;
    if (!hidden.delete(column)) hidden.add(column);
  }

  async keep() {
    const { recorder } = this;
    if (recorder.isOn) {
      recorder.stop();
      recorder.save();
      if (recorder.lost) this.say(`${t("rows")}: ${recorder.lost}`);
      return;
    }
    const error = await recorder.begin(this.platform, this.shown.status.cylinders.length);
    if (error) this.say(error);
  }

  update(status) {
    fill(this.drives, ...drivesOf(status));
    fill(this.bus, busOf(status));
    fill(this.sender, this.senderOf(status));
    this.diagram.update(status);
    this.motion.heard(status);
    this.view.tell(this.toldOf(status));
    if (performance.now() - this.asked > TIMES_MS) {
      this.asked = performance.now();
      this.link.ask({ op: "request", platform: this.platform, line: "times" }).then((got) => { if (!this.isOver) this.times.update(got.answer?.ok ? got.answer : null, this.shown.status ?? status); });
    }
  }

  frame() {
    const now = performance.now(), { curves, recorder } = this;
    if (now - this.drawn < FRAME_MS) return;
    this.drawn = now;
    curves.draw(Math.max(260, Math.min(420, window.innerHeight * 0.42)));
    this.count += 1;
    if (this.count % 3 === 0) this.show();
    this.trigger.textContent = t(curves.isArmed ? (curves.metAt === null ? "armed" : "met") : "trigger");
    this.pause.textContent = t(curves.isPaused ? "go" : "pause");
    this.pause.setAttribute("aria-pressed", String(curves.isPaused));
    if (this.count % SLOW_EVERY === 0) {
      this.showSpectrum();
      this.record.textContent = recorder.isOn ? `${t("recordStop")} ${recorder.seconds.toFixed(0)} s` : t("record");
    }
  }

  // Names and values of the curves: each a button that hides its curve.
  show() {
    const { curves } = this, all = curves.readings();
    const names = all.map((one) => `${one.name} ${one.colour} ${curves.hidden.has(one.column)}`).join();
    if (names !== this.named) {
      this.named = names;
      this.readings.replaceChildren(...all.map((one) => {
        const made = button("", null, { class: "chip", "data-column": one.column, "aria-pressed": String(!curves.hidden.has(one.column)) });
        const sign = element("span", { "aria-hidden": "true" }, one.isDashed ? "┅ " : "━ ");
        sign.style.color = one.colour;
        made.replaceChildren(sign, `${one.name} `, element("b", {}));
        return made;
      }));
    }
    all.forEach((one, i) => { this.readings.children[i].querySelector("b").textContent = `${number(one.value, 3)} ${one.unit}`; });
    const found = curves.between();
    fill(this.facts, element("p", { class: curves.lost ? "warn" : "soft" }, `${t("span")}: ${curves.spanS < 1 ? `${Math.round(curves.spanS * 1000)} ms` : `${curves.spanS.toFixed(1)} s`}; ${t("rows")}: ${curves.lost}`),
      found && element("p", { id: "between" }, `${t("between")}: ${found.ms.toFixed(1)} ms (${found.hz.toFixed(2)} Hz); ${found.values.map((value, i) => `${curves.columns[i + 1].name} ${value.toFixed(3)}`).join("; ")}`));
  }

  showSpectrum() {
    const { curves, lines: canvas } = this;
    const rate = 1e6 / curves.cycleUs, found = spectrum(curves.store.tail(curves.chosen, SPECTRUM_ROWS), rate), [hz, amplitude] = strongest(found);
    this.peak.textContent = amplitude > FLOOR ? `${t("strongest")}: ${hz.toFixed(2)} Hz, ${amplitude.toFixed(4)} ${curves.columns[curves.chosen].unit}` : t("noLine");
    const tall = 150, foot = 20, made = penOn(canvas, tall);
    if (made === null) return;
    const { pen, width, colour } = made;
    pen.font = "13px system-ui, sans-serif";
    const most = Math.max(...found.map((line) => line[1]), FLOOR), low = 0.25, x = (f) => width * Math.log(f / low) / Math.log(rate / 2 / low);
    Object.assign(pen, { strokeStyle: colour("line"), fillStyle: colour("soft"), lineWidth: 1, textAlign: "center" });
    for (const f of [0.5, 1, 2, 5, 10, 20, 50, 100, 200]) {
      if (f >= rate / 2) continue;
      pen.beginPath(); pen.moveTo(x(f), 0); pen.lineTo(x(f), tall - foot); pen.stroke();
      pen.fillText(f === 200 ? "200 Hz" : String(f), x(f), tall - 5);
    }
    Object.assign(pen, { strokeStyle: colour("act"), lineWidth: 2 });
    pen.beginPath();
    found.forEach(([f, a], i) => { const y = (tall - foot) * (1 - 0.95 * a / most); if (i) pen.lineTo(x(f), y); else pen.moveTo(x(f), y); });
    pen.stroke();
  }

  end() {
    this.isOver = true;
    if (this.stream) this.endStream();
    this.motion.end();
    this.view.end();
  }
}
