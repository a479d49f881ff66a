// SPDX-License-Identifier: MIT
// app.js - the pages: what is shown, and what buttons ask for. All that is known comes from heaved's status; nothing is guessed.
import { Curves, spectrum, strongest } from "/curves.js";
import { Hand } from "/hand.js";
import { Link } from "/link.js";
import { Picture } from "/picture.js";
import { chinese, switchLanguage, t } from "/text.js";

const at = (id) => document.getElementById(id);
const shown = { me: null, platform: null, tab: "operate", status: null, isGone: false, holder: null, isMine: false, geometry: null, all: {} };
const AXES = ["roll", "pitch", "yaw", "x", "y", "z"];
const unitOf = (axis) => (["x", "y", "z"].includes(axis) ? "mm" : "deg");
const GROUPS = {
  translations: ["x", "y", "z"].flatMap((axis) => [`sent_${axis}_mm`, `actual_${axis}_mm`]),
  rotations: ["roll", "pitch", "yaw"].flatMap((axis) => [`sent_${axis}_deg`, `actual_${axis}_deg`]),
  cylinders: null, errors: null,
};
let link, page = {}, picture, hand;

// --- Small things ---

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const button = (text, onclick, attributes = {}) => element("button", { type: "button", onclick, ...attributes }, text);
const number = (value, digits = 2) => (value === null || value === undefined ? "–" : value.toFixed(digits));

let sayTimer;
function say(text) {
  at("said").textContent = text;
  at("said").classList.add("shown");
  clearTimeout(sayTimer);
  sayTimer = setTimeout(() => at("said").classList.remove("shown"), 8000);
}

async function request(line) {
  const got = await link.ask({ op: "request", platform: shown.platform, line });
  if (got.error || got.answer?.ok === false) say(got.error ?? got.answer.error);
  return got.answer;
}

// Rebuilds a part of the page only where it says something else: focus and a finger stay where they are.
function fill(part, ...children) {
  if (!part) return;
  const fresh = element("div", {}, ...children);
  if (part.dataset.shown !== fresh.innerHTML) {
    part.dataset.shown = fresh.innerHTML;
    part.replaceChildren(...fresh.childNodes);
  }
}

const rowsOf = (pairs) => element("dl", {}, ...pairs.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));

function table(head, rows) {
  const cell = (tag) => (value, i) => element(tag, { class: i ? "number" : "" }, value);
  return element("div", { class: "scroll", tabindex: "0" }, element("table", {}, element("thead", {}, element("tr", {}, ...head.map(cell("th")))),
    element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map(cell("td")))))));
}

// --- The frame of every page ---

function showFrame() {
  const status = shown.status;
  document.documentElement.lang = chinese() ? "zh-CN" : "en";
  at("hold").textContent = shown.me?.platforms.length > 1 && shown.platform ? `${t("hold")}: ${shown.platform}` : t("hold");
  at("hold").title = t("holdHelp");
  at("language").textContent = t("language");
  at("logout").textContent = t("logout");
  at("logout").hidden = !shown.me?.login_needed || !shown.me.role;
  at("state").textContent = shown.isGone ? t("gone") : status ? t(status.state) : "";
  at("state").className = shown.isGone || ["FAULT", "ESTOP"].includes(status?.state) ? "bad" : status?.state === "ENGAGED" ? "good" : "";
  at("link").textContent = link?.isOpen ? t("connected") : t("lost");
  at("link").className = link?.isOpen ? "" : "lost";
  fill(at("platforms"), ...(shown.me?.platforms ?? []).map((name) => button(name, null, { "aria-pressed": String(name === shown.platform), "data-platform": name })));
  const names = ["operate", "live", "service", "incidents", ...(shown.me?.platforms.length > 1 ? ["wall"] : [])];
  fill(at("tabs"), ...names.map((name) => button(t(name), null,
    { role: "tab", "aria-selected": String(name === shown.tab), "data-tab": name })));
}

at("platforms").addEventListener("click", (event) => event.target.dataset.platform && choose(event.target.dataset.platform));
at("tabs").addEventListener("click", (event) => { if (event.target.dataset.tab) { shown.tab = event.target.dataset.tab; build(); } });
at("hold").addEventListener("click", () => request("hold"));
at("language").addEventListener("click", () => { switchLanguage(); build(); });
at("logout").addEventListener("click", async () => { await fetch("/api/logout", { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" }); location.reload(); });
document.addEventListener("keydown", (event) => { if (event.key === "Escape") { event.preventDefault(); request("hold"); } });

// --- Operate ---

function faultOf(status) {
  const suffix = chinese() ? "_zh" : "";
  const fault = status.fault;
  if (fault.code === 0) return null;
  const where = fault.axis ? ` (${t("onAxis")} ${fault.axis})` : "";
  return element("section", { class: "fault" }, element("b", {}, `${t("fault")}: ${fault[`text${suffix}`]}${where}`),
    element("p", {}, `${t("cause")}: ${fault[`cause${suffix}`]}`), element("p", {}, `${t("remedy")}: ${fault[`remedy${suffix}`]}`),
    fault.device_text ? element("p", {}, fault.device_text) : null);
}

function noticesOf(status) {
  const rows = [[status.estop_active, "estop"], [status.power_failing, "power"], [status.selftest.due, "due"], [status.configuration.barred, "barred"]];
  return rows.filter(([is]) => is).map(([, name]) => element("p", { class: "notice bad" }, t(name)));
}

function senderOf(status) {
  const stream = status.stream;
  if (!status.sender) return rowsOf([[t("sender"), status.waiting_for_sender ? t("noSender") : "–"]]);
  return rowsOf([[t("sender"), status.sender.address], [t("period"), `${number(stream.period_ms)} ms ${stream.sender ? `(${t(stream.sender)})` : ""}`],
    [t("jitter"), `${number(stream.jitter_ms)} ms`], [t("delay"), `${number(stream.delay_ms, 1)} ms`], [t("losses"), `${stream.lost_permille} ‰`],
    [t("age"), `${number(stream.last_frame_age_ms, 0)} ms`]]);
}

const controlsText = () => (shown.isMine ? t("yours") : shown.holder ? `${shown.holder} ${t("others")}` : t("nobody"));

function takeButton() {
  return button(shown.isMine ? t("drop") : t("take"), null, { "data-op": shown.isMine ? "drop" : "take" });
}

function buildOperate() {
  const main = at("page");
  const intensity = element("input", { type: "number", min: 0, max: 100, step: 1, "aria-label": t("intensity"), id: "intensity" });
  page = {
    problems: element("div", {}), controls: element("div", {}), sender: element("div", {}), relays: element("div", {}), pose: element("div", {}), drives: element("div", {}),
    update(status) {
      fill(page.problems, faultOf(status), ...noticesOf(status));
      fill(page.controls, element("p", {}, controlsText()), element("div", { class: "buttons" }, takeButton()));
      fill(page.sender, senderOf(status));
      fill(page.relays, element("p", {}, `${t("on")}: ${status.relays.on.join(", ") || t("none")}${status.relays.known ? "" : ` (${t("unknown")})`}`));
      fill(page.pose, table([t("axis"), t("asked"), t("sent"), t("actual")], AXES.map((axis) => {
        const name = `${axis}_${unitOf(axis)}`;
        return [`${axis} (${unitOf(axis)})`, number(status.pose_asked?.[name]), number(status.pose_sent?.[name]), number(status.pose_actual?.[name])];
      })));
      picture.draw(shown.geometry, status);
      if (document.activeElement !== intensity) intensity.value = status.intensity.percent;
    },
  };
  const canvas = element("canvas", { tabindex: "0", role: "img" });
  main.replaceChildren(page.problems, element("div", { class: "grid wide" },
    element("section", {}, element("h2", {}, t("operate")), element("div", { class: "buttons" }, ...["engage", "resume", "park", "reset"].map((name) =>
      button(t(name), () => request(name), { class: name === "engage" ? "main" : "", "data-request": name }))),
    element("h2", {}, t("intensity")), element("div", { class: "buttons" }, intensity, button(t("apply"), () => request(`intensity ${Math.round(Number(intensity.value))}`)))),
    element("section", {}, element("h2", {}, t("controls")), page.controls, element("h2", {}, t("sender")), page.sender, element("h2", {}, t("relays")), page.relays),
    element("section", {}, element("h2", {}, t("machine")), canvas, element("p", {}, `${t("ghost")}; ${t("atEnd")}`)),
    element("section", {}, element("h2", {}, t("pose")), page.pose)));
  picture = new Picture(canvas);
  page.controls.addEventListener("click", (event) => { if (event.target.dataset.op) take(event.target.dataset.op); });
}

async function take(op) {
  const got = await Promise.race([link.ask({ op, platform: shown.platform }), new Promise((resolve) => setTimeout(() => resolve({}), 300))]);
  if (got.error) say(got.error);
}

// --- Live ---

const SPECTRUM_S = 4.1;
const FLOOR = 0.0005; // what is less is rounding
const curvesOf = {};

async function subscribe() {
  const curves = page.curves;
  if (!curves || !shown.status) return;
  const cylinders = shown.status.cylinders.length;
  const names = GROUPS[page.group] ?? Array.from({ length: cylinders }, (_, i) => `${page.group === "cylinders" ? "actual" : "sent"}_c${i + 1}_mm`);
  if (page.stream) link.send({ op: "samples-end", platform: shown.platform, stream: page.stream, id: 0 });
  const width = at("page").clientWidth || 800;
  const every = Math.max(1, Math.floor(curves.spanS * 1e6 / shown.status.cycle_us / width));
  const mine = page;
  const got = await link.ask({ op: "samples", platform: shown.platform, columns: ["t_ms", ...names], every, history_s: curves.spanS });
  if (got.error) return say(got.error);
  if (mine !== page) return link.send({ op: "samples-end", platform: shown.platform, stream: got.stream, id: 0 });
  page.stream = got.stream;
  curvesOf[got.stream] = curves;
  curves.begin(got.columns, got.cycle_us, got.every);
  return listen(mine, names[0]);
}

// The first curve once more, every cycle of it: the least and the most of some cycles have no spectrum.
async function listen(mine, name) {
  if (mine.raw) link.send({ op: "samples-end", platform: shown.platform, stream: mine.raw, id: 0 });
  const got = await link.ask({ op: "samples", platform: shown.platform, columns: [name], every: 1, history_s: SPECTRUM_S });
  if (got.error) return;
  Object.assign(mine, { raw: got.stream, values: [], unit: got.columns[0].unit, rate: 1e6 / got.cycle_us });
  curvesOf[got.stream] = { take(block) {
    if (!mine.curves.isPaused) mine.values.push(...block.columns[0]);
    mine.values.splice(0, Math.max(0, mine.values.length - SPECTRUM_S * mine.rate));
  } };
}

function buildLive() {
  const canvas = element("canvas", { role: "img", "aria-label": t("curves") });
  const curves = new Curves(canvas);
  const lines = element("canvas", { role: "img", "aria-label": t("spectrum") });
  const choice = (label, values, chosen, onchange, name = (value) => value) => element("label", {}, `${label} `, element("select", { onchange: (event) => onchange(event.target.value) },
    ...values.map((value) => element("option", { value, selected: value === chosen }, name(value)))));
  const pause = button(t("pause"), () => { curves.isPaused = !curves.isPaused; pause.textContent = t(curves.isPaused ? "go" : "pause"); pause.setAttribute("aria-pressed", String(curves.isPaused)); });
  page = {
    curves, group: "translations", readings: element("div", {}), drives: element("div", {}), bus: element("div", {}), peak: element("p", { id: "peak" }),
    update(status) {
      fill(page.drives, table([t("drive"), t("state"), t("homed"), t("sent"), t("actual")], status.cylinders.map((one) => [String(one.number), t(one.drive === "fault" ? "faulted" : one.drive),
        t(one.homed ? "yes" : "no"), number(one.sent_mm), number(one.actual_mm)])), ...status.cylinders.filter((one) => one.report?.trouble).map((one) => element("p", { class: "warn" }, `${one.number}: ${one.report.trouble}`)));
      fill(page.bus, rowsOf([[t("bus"), status.bus ? status.bus.trouble || status.bus.last_trouble || t("none") : t("none")], [t("late"), String(status.late_cycles)]]));
    },
    frame() {
      curves.draw();
      fill(page.readings, ...curves.readings().map((one) => { const row = element("span", {}, `■ ${one.name} ${number(one.value, 3)} ${one.unit}   `); row.style.color = one.colour; return row; }),
        element("span", { class: curves.lost ? "warn" : "" }, `${t("rows")}: ${curves.lost}`));
      page.count = (page.count ?? 0) + 1;
      if (page.count % 10 === 0) showSpectrum(lines);
    },
  };
  at("page").replaceChildren(element("section", {}, element("h2", {}, t("curves")), element("div", { class: "buttons" },
    choice(t("group"), Object.keys(GROUPS), page.group, (value) => { page.group = value; subscribe(); }, t),
    choice(t("span"), ["2", "10", "20"], "10", (value) => { curves.spanS = Number(value); subscribe(); }, (value) => `${value} s`), pause), canvas, page.readings,
  element("h2", {}, t("spectrum")), lines, page.peak), element("div", { class: "grid two" }, element("section", {}, element("h2", {}, t("drives")), page.drives),
    element("section", {}, element("h2", {}, t("latency")), page.bus)));
  subscribe();
}

function showSpectrum(canvas) {
  const found = spectrum(page.values ?? [], page.rate);
  const [hz, amplitude] = strongest(found);
  page.peak.textContent = amplitude > FLOOR ? `${t("strongest")}: ${hz.toFixed(2)} Hz, ${amplitude.toFixed(4)} ${page.unit}` : "";
  const width = canvas.clientWidth, tall = 120, pen = canvas.getContext("2d");
  canvas.style.height = `${tall}px`;
  canvas.width = width;
  canvas.height = tall;
  const most = Math.max(...found.map((line) => line[1]), FLOOR);
  pen.strokeStyle = getComputedStyle(document.body).getPropertyValue("--act");
  pen.beginPath();
  found.forEach(([f, a], i) => { const x = width * i / found.length, y = tall * (1 - a / most); if (i) pen.lineTo(x, y); else pen.moveTo(x, y); });
  pen.stroke();
}

// --- Service ---

function buildService() {
  const speed = element("input", { type: "number", min: 0.1, max: 100, step: 0.1, value: 2, "aria-label": t("speed") });
  hand?.end();
  hand = new Hand(link, shown.platform, say);
  link.send({ op: "ticks", platform: shown.platform, on: true, id: 0 });
  const held = (text, line, name) => { const made = button(text, null, { "aria-label": name }); hand.attach(made, line); return made; };
  const jogs = [...(shown.geometry ? shown.geometry.base_mm.map((_, i) => String(i + 1)) : []), ...(shown.geometry?.kind === "tripod" ? ["roll", "pitch", "z"] : AXES)];
  page = {
    controls: element("div", {}), notice: element("p", { class: "notice" }), counts: element("div", {}),
    update(status) {
      fill(page.controls, element("p", {}, controlsText()), element("div", { class: "buttons" }, takeButton()));
      page.notice.textContent = status.state === "SERVICE" ? t("serviceHelp") : t("notService");
      fill(page.counts, table([t("drive"), t("state"), t("homed"), t("actual")], status.cylinders.map((one) => [String(one.number), t(one.drive === "fault" ? "faulted" : one.drive), t(one.homed ? "yes" : "no"), number(one.actual_mm, 3)])));
    },
    end() { hand.end(); link.send({ op: "ticks", platform: shown.platform, on: false, id: 0 }); hand = null; },
  };
  at("page").replaceChildren(element("div", { class: "grid two" }, element("section", {}, element("h2", {}, t("service")), page.notice, element("div", { class: "buttons" },
    ...[["enterService", "service"], ["leaveService", "service-off"], ["torqueOn", "torque all on"], ["torqueOff", "torque all off"]].map(([name, line]) => button(t(name), () => request(line), { "data-request": line })),
    held(t("homeAll"), () => "home all", t("homeAll"))), element("h2", {}, `${t("speed")} (mm/s, deg/s)`), speed,
  element("div", { class: "jog" }, ...jogs.flatMap((axis) => [element("span", {}, axis.length === 1 && axis < "9" && axis > "0" ? `${t("drive")} ${axis}` : axis),
    held("−", () => `jog ${axis} ${-Math.abs(Number(speed.value))}`, `${axis} −`), held("+", () => `jog ${axis} ${Math.abs(Number(speed.value))}`, `${axis} +`)]))),
  element("section", {}, element("h2", {}, t("controls")), page.controls, element("h2", {}, t("drives")), page.counts)));
  page.controls.addEventListener("click", (event) => { if (event.target.dataset.op) take(event.target.dataset.op); });
}

// --- Incidents ---

async function buildIncidents() {
  page = { update() {}, list: element("div", {}) };
  const mine = page;
  const show = (answer) => mine === page && answer?.incidents && fill(page.list, answer.incidents.length
    ? table([t("incidents"), ""], [...answer.incidents].reverse().map((one) => [one.name, `${one.dump ? t("asDump") : ""} ${one.seen ? "" : t("new")}`])) : element("p", {}, t("noIncidents")));
  at("page").replaceChildren(element("section", {}, element("h2", {}, t("incidents")), element("p", {}, t("incidentHelp")),
    element("div", { class: "buttons" }, button(t("seen"), async () => show(await request("seen"))), button(t("dump"), async () => { await request("dump"); show(await request("incidents")); })), page.list));
  show(await request("incidents"));
}

// --- The wall: every platform of the box ---

function buildWall() {
  page = {
    cards: element("div", { class: "grid two" }),
    update() {
      fill(page.cards, ...shown.me.platforms.map((name) => {
        const status = shown.all[name];
        const state = status ? t(status.state) : t("gone");
        const isBad = !status || ["FAULT", "ESTOP"].includes(status.state);
        return element("section", { class: isBad ? "fault" : "" }, element("h2", {}, name), element("b", { class: isBad ? "bad" : status.state === "ENGAGED" ? "good" : "" }, state),
          status ? element("p", {}, status.fault.code ? status.fault[chinese() ? "text_zh" : "text"] : `${t("sender")}: ${status.sender?.address ?? "–"}; ${t("intensity")} ${status.intensity.percent} %`) : null);
      }));
    },
  };
  at("page").replaceChildren(page.cards);
}

// --- All of it ---

function build() {
  page.end?.();
  for (const stream of [page.stream, page.raw]) if (stream) link.send({ op: "samples-end", platform: shown.platform, stream, id: 0 });
  page = {};
  showFrame();
  if (shown.tab !== "wall" && (!shown.status || shown.isGone)) {
    at("page").replaceChildren(element("p", {}, shown.isGone ? t("gone") : t("noWebSocket")));
    return;
  }
  ({ operate: buildOperate, live: buildLive, service: buildService, incidents: buildIncidents, wall: buildWall })[shown.tab]();
  page.update?.(shown.status);
}

async function choose(name) {
  Object.assign(shown, { platform: name, status: null, isGone: false, geometry: null, holder: null, isMine: false });
  for (const one of shown.me.platforms) link.send({ op: "status", platform: one, hz: one === name ? 10 : 1, id: 0 });
  build();
}

async function onEvent(event) {
  if (event.event === "status" || event.event === "gone") {
    shown.all[event.platform] = event.status ?? null;
    if (shown.tab === "wall") page.update?.();
  }
  if (event.platform !== shown.platform) return;
  if (event.event === "status") {
    const isFirst = shown.status === null || shown.isGone;
    Object.assign(shown, { status: event.status, isGone: false });
    if (isFirst) {
      shown.geometry = (await request("geometry")) ?? null;
      build();
    }
    showFrame();
    page.update?.(shown.status);
  } else if (event.event === "gone") {
    Object.assign(shown, { isGone: true, status: null });
    build();
  } else if (event.event === "controls") {
    Object.assign(shown, { holder: event.holder, isMine: event.yours });
    if (shown.status) page.update?.(shown.status);
  } else if (event.event === "tick") {
    hand?.heard(event.tick);
  }
}

function showLogin() {
  const role = element("select", { id: "role" }, ...["look", "operate", "service"].map((name) => element("option", { value: name }, t(name === "look" ? "look" : `${name}Role`))));
  const password = element("input", { type: "password", id: "password", autocomplete: "current-password" });
  showFrame();
  at("page").replaceChildren(element("form", { class: "login", onsubmit: async (event) => {
    event.preventDefault();
    const answer = await fetch("/api/login", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ role: role.value, password: password.value }) });
    if (answer.ok) location.reload(); else say((await answer.json()).error);
  } }, element("h2", {}, t("login")), element("label", { for: "role" }, t("role")), role, element("label", { for: "password" }, t("password")), password, element("button", {}, t("login"))));
}

async function start() {
  shown.me = await (await fetch("/api/me")).json();
  if (!shown.me.role) return showLogin();
  link = new Link({
    onEvent,
    onBlock: (block) => curvesOf[block.stream]?.take(block),
    onChange: (isOpen) => { hand?.letGo(); shown.isMine = false; if (isOpen) choose(shown.platform ?? shown.me.platforms[0]); else { shown.status = null; build(); } },
  });
  const animate = () => { page.frame?.(); requestAnimationFrame(animate); };
  animate();
  return undefined;
}

start();
