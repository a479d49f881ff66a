// SPDX-License-Identifier: MIT
// commission.js - putting a machine into service, step by step: what is there, which leg is which, zeros, ends, relays, switches, test signals, and a report to
// print. What was found is kept in this browser, so that it can be left and continued. All motion is by a held button, as on the page Service.
import { drawBode } from "./bode.js";
import { stateOf } from "./drives.js";
import { Hand } from "./hand.js";
import { store } from "./store.js";
import { chinese, refusalOf, t } from "./text.js";
import { button, choice, element, fill, number, rowsOf, table } from "./ui.js";

const STEPS = ["inventory", "legs", "zeros", "ends", "outputs", "switches", "signals", "report"];
const AXES = ["z", "x", "y", "roll", "pitch", "yaw"];
const WAY_MM = 5;

// What was found on a platform, over the whole of a commissioning.
class Record {
  constructor(platform) {
    this.name = `heave-commission-${platform}`;
    this.all = JSON.parse(store.get(this.name) ?? "null") ?? { began: new Date().toISOString(), found: {}, done: {} };
  }

  of(step) { return this.all.found[step] ?? {}; }

  note(step, found) {
    const before = JSON.stringify(this.of(step));
    this.all.found[step] = { ...this.of(step), ...found };
    if (JSON.stringify(this.all.found[step]) !== before) this.keep();
  }

  finish(step, is) {
    this.all.done[step] = is ? new Date().toISOString() : undefined;
    this.keep();
  }

  keep() { store.set(this.name, JSON.stringify(this.all)); }

  begin() { store.remove(this.name); }
}

export async function build({ page, shown, request, say, place, link, take }) {
  const platform = shown.platform;
  let record = new Record(platform), step = STEPS.find((one) => !record.all.done[one]) ?? "report", view = {}, isHere = true;
  page.end = () => { isHere = false; }; // another page may be wanted before heaved has answered
  const selftest = (await request("selftest")) ?? {};
  if (!isHere) return;
  const hand = new Hand(link, platform, say);
  link.send({ op: "ticks", platform, on: true, id: 0 });
  const tabs = element("div", { class: "buttons steps", role: "tablist" }), body = element("div", { class: "grid" }), controls = element("div", {}), done = element("div", { class: "buttons noprint" });
  const held = (text, line, name, attributes = {}) => { const made = button(text, null, { "aria-label": name, class: "hold", ...attributes }); hand.attach(made, line); return made; };
  const tools = { shown, request, say, record: () => record, held, hand, link, platform, selftest, refresh };

  function refresh() {
    fill(tabs, ...STEPS.map((name, i) => button(`${record.all.done[name] ? "✔ " : ""}${i + 1}. ${t(`step_${name}`)}`, null, { role: "tab", "data-step": name, "aria-selected": String(name === step) })));
    fill(controls, element("p", {}, shown.isMine ? t("yours") : t("takeFirst")), element("p", { class: shown.status.state === "SERVICE" ? "good" : "warn" }, shown.status.state === "SERVICE" ? t("serviceHelp") : t("notService")),
      element("div", { class: "buttons" }, button(shown.isMine ? t("drop") : t("take"), null, { "data-act": shown.isMine ? "drop" : "take" }), ...[["enterService", "service"], ["leaveService", "service-off"], ["torqueOn", "torque all on"], ["torqueOff", "torque all off"]].map(([name, line]) => button(t(name), null, { "data-line": line }))));
    fill(done, ...(step === "report" ? [] : [button(t(record.all.done[step] ? "stepOpen" : "stepDone"), null, { "data-act": "done", class: record.all.done[step] ? "" : "main" })]), ...(step === "report" ? [button(t("print"), null, { "data-act": "print", class: "main" }), button(t("beginAnew"), null, { "data-act": "anew" })] : []));
    view.update?.(shown.status);
  }

  function show(name) {
    hand.letGo();
    step = name;
    view = VIEWS[step](tools);
    body.replaceChildren(...view.parts);
    refresh();
  }

  const acts = {
    take: () => take("take"), drop: () => take("drop"), print: () => window.print(),
    done: () => { const is = !record.all.done[step]; record.finish(step, is); if (is) show(STEPS[STEPS.indexOf(step) + 1]); else refresh(); },
    anew: () => { record.begin(); record = new Record(platform); show(STEPS[0]); },
  };
  place.replaceChildren(element("div", { class: "grid" }, element("section", { class: "noprint" }, element("h2", {}, t("commission")), element("p", {}, t("commissionHelp")), tabs), body, element("section", { class: "noprint" }, done),
    element("section", { class: "noprint" }, element("h2", {}, t("controls")), controls)));
  place.onclick = (event) => {
    const { act, step: to, line } = event.target.dataset ?? {};
    if (act) acts[act]?.();
    if (to) show(to);
    if (line) request(line);
  };
  let known = "";
  page.update = () => { // ten times a second: only what has changed is built anew
    const now = `${shown.isMine} ${shown.holder} ${shown.status.state}`;
    if (now === known) { view.update?.(shown.status); return; }
    known = now;
    refresh();
  };
  page.heard = (tick) => { hand.heard(tick); view.heard?.(tick); };
  page.event = (event) => view.event?.(event);
  page.end = () => { isHere = false; hand.end(); link.send({ op: "ticks", platform, on: false, id: 0 }); place.onclick = null; };
  show(step);
}

const section = (title, ...children) => element("section", {}, element("h2", {}, t(title)), ...children);

// --- 1: what is there ---

function inventory({ shown, request, record }) {
  const drives = element("div", {}), bus = element("div", {}), counts = element("div", {});
  let last = 0;
  const count = async () => {
    const answer = await request("counts");
    if (answer?.drives) fill(counts, table([t("drive"), t("state"), t("counts"), t("actual"), t("homed"), t("torque")], answer.drives.map((one) => [String(one.drive), t(one.state === "fault" ? "faulted" : one.state), String(one.counts ?? "–"),
      number(one.actual_mm ?? one.actual_deg, 3), t(one.homed ? "yes" : "no"), t(one.torque ? "on" : "none")])));
  };
  count();
  return {
    parts: [section("step_inventory", element("p", {}, t("inventoryHelp")), bus, drives), section("countsTitle", element("p", {}, t("countsHelp")), counts)],
    update(status) {
      const flat = (object) => Object.entries(object ?? {}).filter(([, value]) => ["string", "number", "boolean"].includes(typeof value) && value !== "");
      fill(bus, status.bus ? rowsOf(flat(status.bus).map(([name, value]) => [name, String(value)])) : element("p", { class: "soft" }, t("noBus")));
      fill(drives, table([t("drive"), t("state"), t("homed"), t("report")], status.cylinders.map((one) => [String(one.number), stateOf(one), t(one.homed ? "yes" : "no"), flat(one.report).map(([name, value]) => `${name}: ${value}`).join(", ") || "–"]), true));
      record().note("inventory", { drives: status.cylinders.map((one) => ({ number: one.number, drive: one.drive, report: Object.fromEntries(flat(one.report)) })), bus: Object.fromEntries(flat(status.bus)) });
      if (Date.now() - last > 500) { last = Date.now(); count(); }
    },
  };
}

// --- 2: which leg is which ---

function legs({ shown, held, record, refresh }) {
  const cylinders = shown.status.cylinders.length, advice = element("div", { id: "legs-advice" });
  const found = () => record().of("legs");
  const answer = (drive, what, value) => { record().note("legs", { [drive]: { ...found()[drive], [what]: value } }); refresh(); };
  const rows = Array.from({ length: cylinders }, (_, i) => {
    const drive = String(i + 1), own = found()[drive] ?? {};
    return element("div", { class: "leg" }, element("b", {}, `${t("drive")} ${drive}`), held("−", () => `jog ${drive} -2 ${WAY_MM}`, `${t("drive")} ${drive} −`), held("+", () => `jog ${drive} 2 ${WAY_MM}`, `${t("drive")} ${drive} +`),
      choice(t("movedLeg"), ["", ...Array.from({ length: cylinders }, (_, k) => String(k + 1)), "other"], own.leg ?? "", (value) => answer(drive, "leg", value), (value) => (value === "" ? "?" : value === "other" ? t("severalLegs") : value)),
      choice(t("plusIs"), ["", "out", "in"], own.way ?? "", (value) => answer(drive, "way", value), (value) => (value === "" ? "?" : t(`way_${value}`))));
  });
  return {
    parts: [section("step_legs", element("p", {}, t("legsHelp")), ...rows, advice)],
    update() {
      const all = found(), said = Object.entries(all);
      const wrong = said.filter(([drive, one]) => one.leg && one.leg !== drive).map(([drive, one]) => element("p", { class: "bad" }, `${t("drive")} ${drive}: ${one.leg === "other" ? t("legOther") : `${t("legIs")} ${one.leg}. ${t("legSwap")}`}`));
      const backwards = said.filter(([, one]) => one.way === "in").map(([drive]) => element("p", { class: "bad" }, `${t("drive")} ${drive}: ${t("legBackwards")}`));
      const isRight = said.length === cylinders && said.every(([drive, one]) => one.leg === drive && one.way === "out");
      fill(advice, ...wrong, ...backwards, isRight ? element("p", { class: "good" }, t("legsRight")) : null);
    },
  };
}

// --- 3: zeros ---

function zeros({ shown, held, record }) {
  const list = element("div", {});
  const buttons = shown.status.cylinders.map((one) => held(`${t("homeOne")} ${one.number}`, () => `home ${one.number}`, `${t("homeOne")} ${one.number}`));
  return {
    parts: [section("step_zeros", element("p", {}, t("zerosHelp")), element("div", { class: "buttons" }, held(t("homeAll"), () => "home all", t("homeAll")), ...buttons), list)],
    update(status) {
      fill(list, table([t("drive"), t("state"), t("homed"), t("actual")], status.cylinders.map((one) => [String(one.number), stateOf(one), t(one.homed ? "yes" : "no"), number(one.actual_mm, 3)])));
      record().note("zeros", { homed: status.cylinders.map((one) => one.homed) });
    },
  };
}

// --- 4: ends of the stroke ---

function ends({ shown, held, record }) {
  const list = element("div", {});
  const speed = () => shown.geometry?.jog_mm_s ?? 2;
  const rows = shown.status.cylinders.map((one) => element("div", { class: "leg" }, element("b", {}, `${t("drive")} ${one.number}`), held(t("toLower"), () => `jog ${one.number} ${-speed()}`, `${t("drive")} ${one.number} ${t("toLower")}`), held(t("toUpper"), () => `jog ${one.number} ${speed()}`, `${t("drive")} ${one.number} ${t("toUpper")}`)));
  const together = element("div", { class: "leg" }, element("b", {}, t("together")), held(t("toLower"), () => `jog z ${-speed()}`, `${t("together")} ${t("toLower")}`), held(t("toUpper"), () => `jog z ${speed()}`, `${t("together")} ${t("toUpper")}`));
  return {
    parts: [section("step_ends", element("p", {}, t("endsHelp")), together, ...rows, list)],
    update(status) {
      const before = record().of("ends").reached ?? [];
      const reached = status.cylinders.map((one, i) => {
        const own = before[i] ?? { least: null, most: null, behind: 0 };
        if (one.actual_mm === null || status.state !== "SERVICE") return own;
        return { least: own.least === null ? one.actual_mm : Math.min(own.least, one.actual_mm), most: own.most === null ? one.actual_mm : Math.max(own.most, one.actual_mm), behind: Math.max(own.behind, Math.abs(one.sent_mm - one.actual_mm)) };
      });
      record().note("ends", { reached });
      fill(list, table([t("drive"), t("leastSeen"), t("mostSeen"), t("stroke"), t("following")], reached.map((one, i) => [String(i + 1), number(one.least, 1), number(one.most, 1), number(status.cylinders[i].stroke_mm, 1), number(one.behind, 2)])));
    },
  };
}

// --- 5: relays; 6: switches ---

const yesNo = (value, onchange, label) => choice(label, ["", "yes", "no", "none"], value, onchange, (one) => (one === "" ? "?" : t(`worked_${one}`)));

function outputs({ selftest, held, record, refresh }) {
  const count = selftest.relays ?? 0, now = element("div", {});
  const rows = Array.from({ length: count }, (_, i) => {
    const name = String(i + 1);
    return element("div", { class: "leg" }, element("b", {}, `${t("relay")} ${name}`), held(t("holdOn"), () => `relay ${name}`, `${t("holdOn")}: ${t("relay")} ${name}`, { "data-relay": name }), yesNo(record().of("outputs")[name] ?? "", (value) => { record().note("outputs", { [name]: value }); refresh(); }, t("hasWorked")));
  });
  return {
    parts: [section("step_outputs", element("p", {}, t(count ? "outputsHelp" : "noRelays")), ...rows, now)],
    update(status) { fill(now, element("p", {}, `${t("on")}: ${status.relays.on.join(", ") || t("none")}`)); },
  };
}

function switches({ selftest, record, refresh }) {
  const there = Object.entries(selftest.switches ?? {}).filter(([, is]) => is).map(([name]) => name);
  const lines = element("div", {}), watched = { estop: "estop_active", estop2: "estop_active", power: "power_failing" };
  const asked = [...there.filter((name) => !watched[name]), ...(selftest.healthy_pulse ? ["pulse"] : [])];
  return {
    parts: [section("step_switches", element("p", {}, t(there.length ? "switchesHelp" : "noSwitches")), lines, ...asked.map((name) => element("div", { class: "leg" }, element("b", {}, t(`switch_${name}`)), yesNo(record().of("switches")[name] ?? "", (value) => { record().note("switches", { [name]: value }); refresh(); }, t("hasWorked")))))],
    update(status) {
      for (const name of there.filter((one) => watched[one])) {
        const own = record().of("switches")[name] ?? {}, isOn = status[watched[name]];
        record().note("switches", { [name]: { pressed: own.pressed || isOn, released: own.released || (own.pressed === true && !isOn) } });
      }
      fill(lines, ...there.filter((name) => watched[name]).map((name) => {
        const own = record().of("switches")[name] ?? {};
        return element("p", { class: own.pressed && own.released ? "good" : "warn" }, `${t(`switch_${name}`)}: ${t(status[watched[name]] ? "isOpen" : "isClosed")}; ${own.pressed ? "✔" : "…"} ${t("seenOpen")}, ${own.released ? "✔" : "…"} ${t("seenClosed")}`);
      }));
    },
  };
}

// --- 7: test signals ---

function signals({ shown, hand, held, record, say, refresh }) {
  const axes = [...(shown.geometry?.kind === "tripod" ? ["z", "roll", "pitch"] : AXES), ...shown.status.cylinders.map((one) => String(one.number))];
  const input = (id, label, placeholder) => element("input", { id, type: "number", min: 0, step: "any", placeholder, "aria-label": label });
  const amplitude = input("signal-amplitude", t("amplitude"), "2"), from = input("signal-from", t("fromHz"), "0.2"), to = input("signal-to", t("toHz"), "20");
  const state = element("p", { id: "signal-state", role: "status", "aria-live": "polite" }), result = element("div", { id: "signal-result" });
  let axis = "z", began = 0;
  const message = () => { began = Date.now(); state.textContent = t("signalGoes"); return { op: "identify", axis, amplitude: Number(amplitude.value) || 0, from_hz: Number(from.value) || 0, to_hz: Number(to.value) || 0, cylinder_limits: shown.geometry?.cylinder_limits }; };
  const found = element("section", {}, element("h2", {}, t("bode")), result);
  const show = () => { const own = Object.values(record().of("signals")); found.hidden = own.length === 0; result.replaceChildren(...own.map((one) => resultOf(one))); };
  show();
  return {
    parts: [section("step_signals", element("p", {}, t("signalsHelp")), element("div", { class: "buttons" }, choice(t("axis"), axes, axis, (value) => { axis = value; }), element("label", {}, `${t("amplitude")} (mm, deg) `, amplitude), element("label", {}, `${t("fromHz")} `, from), element("label", {}, `${t("toHz")} `, to)),
      held(t("holdSignal"), message, t("holdSignal"), { id: "signal-hold" }), state), found],
    update() { if (hand.series && began) state.textContent = `${t("signalGoes")} ${((Date.now() - began) / 1000).toFixed(0)} s`; },
    heard(tick) { if (tick.finished === tick.series && began && !hand.series && state.textContent.startsWith(t("signalGoes"))) state.textContent = t("signalWorks"); },
    event(event) {
      if (event.event !== "identified") return;
      began = 0;
      if (!event.result.ok) { state.textContent = refusalOf({ ...event, answer: event.result }); say(state.textContent); return; }
      state.textContent = t("signalDone");
      record().note("signals", { [event.result.axis]: event.result });
      show();
      refresh();
    },
  };
}

function resultOf(result) {
  const canvas = element("canvas", { role: "img", "aria-label": `${t("bode")} ${result.axis}` });
  requestAnimationFrame(() => drawBode(canvas, result));
  return element("div", { class: "bode" }, element("h3", {}, `${result.axis}: ${result.amplitude} ${result.unit}, ${result.from_hz}–${result.to_hz} Hz, ${result.seconds} s`), canvas,
    table(["", t("lagMs"), t("gain"), "−3 dB (Hz)", "−90° (Hz)", t("following"), t("hysteresis")], result.channels.map((one, i) => [i || !result.axis.match(/[a-z]/) ? `${t("drive")} ${one.name}` : one.name, ...(one.moved ? [number(one.lag_ms), number(one.gain, 3), number(one.gain_3db_hz), number(one.phase_90_hz), number(one.following_most, 3), number(one.hysteresis, 3)] : ["–", "–", "–", "–", "–", "–"])])),
    ...(result.advice.length ? result.advice.map((one) => element("p", { class: "warn" }, one)) : [element("p", { class: "good" }, t("noAdvice"))]));
}

// --- 8: the report ---

function report({ shown, record, platform }) {
  const all = record().all, status = shown.status, notes = element("textarea", { id: "report-notes", rows: 4, class: "wide", "aria-label": t("notes") });
  const when = (text) => (text ? new Date(text).toLocaleString(chinese() ? "zh-CN" : "en-GB") : "–");
  const of = (step) => all.found[step] ?? {};
  const words = (value) => (value === undefined || value === "" ? "–" : t(`worked_${value}`));
  notes.value = of("report").notes ?? "";
  const printed = element("p", { class: "printed" }, notes.value);
  notes.addEventListener("input", () => { record().note("report", { notes: notes.value }); printed.textContent = notes.value; });
  const reached = of("ends").reached ?? [];
  const said = Object.entries(of("legs"));
  return {
    parts: [element("section", { id: "report" }, element("h1", {}, `${t("reportTitle")}: ${platform}`),
      rowsOf([[t("reportBegan"), when(all.began)], [t("reportNow"), when(new Date().toISOString())], ["heaved", `${status.version} (${status.build})`], [t("configuration"), `${status.configuration.hash}, ${status.configuration.digest}`], [t("machine"), `${shown.geometry?.kind ?? "–"}, ${status.cylinders.length} × ${number(status.cylinders[0]?.stroke_mm, 0)} mm`]]),
      element("h2", {}, t("steps")), table(["", t("what"), t("finished")], STEPS.slice(0, -1).map((name, i) => [String(i + 1), t(`step_${name}`), all.done[name] ? when(all.done[name]) : t("notDone")]), true),
      element("h2", {}, t("step_inventory")), table([t("drive"), t("state"), t("report")], (of("inventory").drives ?? []).map((one) => [String(one.number), t(one.drive === "fault" ? "faulted" : one.drive), Object.entries(one.report).map(([name, value]) => `${name}: ${value}`).join(", ") || "–"]), true),
      element("h2", {}, t("step_legs")), table([t("drive"), t("movedLeg"), t("plusIs")], said.map(([drive, one]) => [drive, one.leg === "other" ? t("severalLegs") : one.leg || "–", one.way ? t(`way_${one.way}`) : "–"]), true),
      element("h2", {}, t("step_ends")), table([t("drive"), t("homed"), t("leastSeen"), t("mostSeen"), t("following")], reached.map((one, i) => [String(i + 1), t(of("zeros").homed?.[i] ? "yes" : "no"), number(one.least, 1), number(one.most, 1), number(one.behind, 2)])),
      element("h2", {}, `${t("step_outputs")}, ${t("step_switches")}`), rowsOf([...Object.entries(of("outputs")).map(([name, value]) => [`${t("relay")} ${name}`, words(value)]), ...Object.entries(of("switches")).map(([name, value]) => [t(`switch_${name}`), typeof value === "string" ? words(value) : value.pressed && value.released ? t("worked_yes") : "–"])]),
      element("h2", {}, t("step_signals")), ...(Object.values(of("signals")).length ? Object.values(of("signals")).map(resultOf) : [element("p", {}, t("notDone"))]),
      element("h2", {}, t("notes")), notes, printed, element("div", { class: "signatures" }, element("p", {}, t("signature")), element("p", {}, t("secondPerson"))))],
  };
}

const VIEWS = { inventory, legs, zeros, ends, outputs, switches, signals, report };
