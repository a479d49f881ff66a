// SPDX-License-Identifier: MIT
// app.js - the pages: what is shown, and what buttons ask for. All that is known comes from heaved's status; nothing is guessed.
import { stateOf } from "./drives.js";
import { Hand } from "./hand.js";
import { atLimits, extensionOf, nearness } from "./limits.js";
import { Link } from "./link.js";
import { Motion } from "./motion.js";
import { Recorder } from "./recorder.js";
import { chinese, noticesIn, putBackOf, refusalOf, switchLanguage, t } from "./text.js";
import { button, element, fill, number, rowsOf, table } from "./ui.js";
import { View } from "./view.js";

const at = (id) => document.getElementById(id);
const shown = { me: null, platform: null, tab: "operate", status: null, isGone: false, holder: null, isMine: false, geometry: null, all: {}, heardMs: {} };
const OLD_MS = 1000; // from then on a page says how old it is
const SELDOM_MS = 1000; // between two statuses of a platform that is on the wall only
const SLOW = ["reset", "dump", "sdo"]; // may take heaved some seconds
const AXES = ["roll", "pitch", "yaw", "x", "y", "z"];
const unitOf = (axis) => (["x", "y", "z"].includes(axis) ? "mm" : "deg");
let link, page = {}, hand, recorder;
const takers = {}; // of blocks, by stream

// --- Small things ---

let sayTimer;
function say(text) {
  at("said").textContent = text;
  at("said").classList.add("shown");
  clearTimeout(sayTimer);
  sayTimer = setTimeout(() => at("said").classList.remove("shown"), 8000);
}

// Nobody presses twice, or believes that it was done, because nothing is said.
function saySlow(message) {
  const word = message.line?.split(" ")[0] ?? message.op;
  say(`${t(word) ?? word}: ${t(message.op === "configure" || SLOW.includes(word) ? "underWay" : "noAnswer")}`);
}

async function request(line) {
  const got = await link.ask({ op: "request", platform: shown.platform, line, tick: shown.status?.tick }); // heaved does not do what comes late
  const why = refusalOf(got);
  if (why) say(why);
  return got.answer;
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
  const names = ["operate", "live", "service", "incidents", ...(shown.me?.role === "look" ? [] : ["log"]), ...(shown.me?.role === "service" ? ["configuration", "commission"] : []), ...(shown.me?.platforms.length > 1 ? ["wall"] : [])];
  fill(at("tabs"), ...names.map((name) => button(t(name), null,
    { role: "tab", "aria-selected": String(name === shown.tab), "data-tab": name })));
}

const agesMs = (name) => performance.now() - (shown.heardMs[name] ?? performance.now());

// What is shown may have changed since. A panel, a heaved or a network that stands still looks like a machine that does.
function showAge() {
  const ageMs = agesMs(shown.platform);
  at("age").textContent = shown.status && ageMs >= OLD_MS ? `${t("noNews")} ${Math.floor(ageMs / 1000)} s` : "";
  if (shown.tab === "wall" && link?.isOpen) page.update?.();
}
setInterval(showAge, 250);

at("platforms").addEventListener("click", (event) => event.target.dataset.platform && choose(event.target.dataset.platform));
at("tabs").addEventListener("click", (event) => { if (event.target.dataset.tab) { shown.tab = event.target.dataset.tab; build(); } });
let isHoldPressed = false; // by a pointer: its click, if one comes, is that same press
at("hold").addEventListener("pointerdown", () => { isHoldPressed = true; request("hold"); }); // when it is touched: a long press, or a finger that slips, makes no click
at("hold").addEventListener("click", (event) => { if (event.detail === 0 || !isHoldPressed) request("hold"); isHoldPressed = false; }); // by keyboard or screen reader
at("hold").addEventListener("contextmenu", (event) => event.preventDefault());
at("language").addEventListener("click", () => { switchLanguage(); build(); });
at("logout").addEventListener("click", async () => { await fetch("api/logout", { method: "POST", headers: { "Content-Type": "application/json" }, body: "{}" }); location.reload(); });
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
  const putBack = putBackOf(status);
  return [...noticesIn(status).map(t), ...(putBack ? [`${t("putBack")} ${putBack}`] : [])].map((text) => element("p", { class: "notice bad" }, text));
}

function senderOf(status) {
  const stream = status.stream;
  if (!status.sender) return rowsOf([[t("sender"), status.waiting_for_sender ? t("noSender") : "–"]]);
  return rowsOf([[t("sender"), status.sender.address], [t("period"), `${number(stream.period_ms)} ms ${stream.sender ? `(${t(stream.sender)})` : ""}`],
    [t("jitter"), `${number(stream.jitter_ms)} ms`], [t("delay"), `${number(stream.delay_ms, 1)} ms`], [t("losses"), `${stream.lost_permille} ‰`],
    [t("age"), `${number(stream.last_frame_age_ms, 0)} ms`]]);
}

// What the colours of the picture mean; they differ in lightness too, and a sign stands beside them. Words have the colour of text: those of lines are too light to be read in sunlight.
function legend() {
  const word = (name, text) => { const sign = element("i", { "aria-hidden": "true" }); sign.style.background = `var(--${name})`; return element("span", {}, sign, text); };
  return element("p", { class: "legend" }, t("legend"), element("br"), word("soft", t("ghost")), word("close", `${t("closeToEnd")} ▲▼`), word("end", `${t("atEnd")} ▲▼`));
}

// The picture in words.
function toldOf(status) {
  const pose = status.pose_actual ?? status.pose_sent;
  return [t("picture"), AXES.map((axis) => `${axis} ${number(pose[`${axis}_${unitOf(axis)}`], 1)} ${unitOf(axis)}`).join(", "), limitsOf(status)].join("; ");
}

function limitsOf(status) {
  const near = status.cylinders.filter((one) => nearness(extensionOf(one), one.stroke_mm) !== "free").map((one) => one.number);
  const axes = atLimits(shown.geometry?.limits, status.pose_sent).map((axis) => axis.split("_")[0]);
  return [near.length ? `${t("nearEnd")}: ${near.join(", ")}` : "", axes.length ? `${t("limitOf")}: ${axes.join(", ")}` : ""].filter(Boolean).join("; ") || t("farFromLimits");
}

const controlsText = () => (shown.isMine ? t("yours") : shown.holder ? `${shown.holder} ${t("others")}` : t("nobody"));

function takeButton() {
  return button(shown.isMine ? t("drop") : t("take"), null, { "data-op": shown.isMine ? "drop" : "take" });
}

function buildOperate() {
  const main = at("page");
  const intensity = element("input", { type: "number", min: 0, max: 100, step: 1, required: true, "aria-label": t("intensity"), id: "intensity" });
  page = {
    problems: element("div", {}), controls: element("div", {}), sender: element("div", {}), relays: element("div", {}), pose: element("div", {}), limits: element("div", {}),
    update(status) {
      fill(page.problems, faultOf(status), ...noticesOf(status));
      fill(page.controls, element("p", {}, controlsText()), element("div", { class: "buttons" }, takeButton()));
      fill(page.sender, senderOf(status));
      fill(page.relays, element("p", {}, `${t("on")}: ${status.relays.on.join(", ") || t("none")}${status.relays.known ? "" : ` (${t("unknown")})`}`));
      fill(page.pose, table([t("axis"), t("asked"), t("sent"), t("actual")], AXES.map((axis) => {
        const name = `${axis}_${unitOf(axis)}`;
        return [`${axis} (${unitOf(axis)})`, number(status.pose_asked?.[name]), number(status.pose_sent?.[name]), number(status.pose_actual?.[name])];
      })));
      page.motion.heard(status);
      page.view.tell(toldOf(status));
      fill(page.limits, element("p", {}, limitsOf(status)));
      if (document.activeElement !== intensity) intensity.value = status.intensity.percent;
    },
  };
  const view = element("div", { class: "view" });
  main.replaceChildren(page.problems, element("div", { class: "grid wide" }, element("div", { class: "stack" },
    element("section", {}, element("h2", {}, t("operate")), page.controls, element("div", { class: "buttons" }, ...["engage", "resume", "park", "reset"].map((name) =>
      button(t(name), () => request(name), { class: name === "engage" ? "main" : "", "data-request": name }))),
    element("h2", {}, t("intensity")), element("div", { class: "buttons" }, intensity, button(t("apply"), () => intensity.reportValidity() && request(`intensity ${intensity.valueAsNumber}`)))),
    element("section", {}, element("h2", {}, t("machine")), view, page.limits, legend())),
  element("div", { class: "stack" }, element("section", {}, element("h2", {}, t("sender")), page.sender, element("h2", {}, t("relays")), page.relays),
    element("section", {}, element("h2", {}, t("pose")), page.pose))));
  const mine = new View(view), motion = new Motion({ link, takers, platform: shown.platform, view: mine });
  Object.assign(page, { view: mine, motion, end() { motion.end(); mine.end(); } });
  motion.begin(shown.geometry, shown.status);
  page.controls.addEventListener("click", (event) => { if (event.target.dataset.op) take(event.target.dataset.op); });
}

async function take(op) {
  const got = await Promise.race([link.ask({ op, platform: shown.platform }), new Promise((resolve) => setTimeout(() => resolve({}), 300))]);
  if (got.error) say(refusalOf(got));
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
      fill(page.counts, table([t("drive"), t("state"), t("homed"), t("actual")], status.cylinders.map((one) => [String(one.number), stateOf(one), t(one.homed ? "yes" : "no"), number(one.actual_mm, 3)])));
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

// --- Pages that are loaded when somebody looks at them ---

function buildLater(module) {
  page = { update() {} };
  const mine = page;
  at("page").replaceChildren(element("p", {}, t("loading")));
  import(module).then((its) => mine === page && its.build({ page: mine, shown, request, say, place: at("page"), link, take, recorder, takers, senderOf, legend, toldOf }));
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
        const isOld = status && agesMs(name) >= OLD_MS + SELDOM_MS;
        return element("section", { class: isBad ? "fault" : "" }, element("h2", {}, name), element("b", { class: isBad ? "bad" : status.state === "ENGAGED" ? "good" : "" }, state),
          isOld ? element("p", { class: "notice bad" }, `${t("noNews")} ${Math.floor(agesMs(name) / 1000)} s`) : null,
          status ? element("p", {}, status.fault.code ? status.fault[chinese() ? "text_zh" : "text"] : `${t("sender")}: ${status.sender?.address ?? "–"}; ${t("intensity")} ${status.intensity.percent} %`) : null);
      }));
    },
  };
  at("page").replaceChildren(page.cards);
}

// --- All of it ---

function build() {
  page.end?.();
  for (const stream of [page.stream]) if (stream) link.send({ op: "samples-end", platform: shown.platform, stream, id: 0 });
  page = {};
  showFrame();
  if (shown.tab !== "wall" && (!shown.status || shown.isGone)) {
    at("page").replaceChildren(element("p", {}, shown.isGone ? t("gone") : t("noWebSocket")));
    return;
  }
  ({ operate: buildOperate, live: () => buildLater("./live.js"), service: buildService, incidents: () => buildLater("./incidents.js"), log: () => buildLater("./log.js"), configuration: () => buildLater("./configuration.js"), commission: () => buildLater("./commission.js"), wall: buildWall })[shown.tab]();
  page.update?.(shown.status);
}

async function choose(name) {
  Object.assign(shown, { platform: name, status: null, isGone: false, geometry: null, holder: null, isMine: false });
  for (const one of shown.me.platforms) link.send({ op: "status", platform: one, hz: one === name ? 10 : 1, id: 0 });
  build();
}

async function onEvent(event) {
  if (event.put_back_zh) event.status.configuration.put_back_zh = event.put_back_zh;
  if (event.event === "status" || event.event === "gone") {
    shown.all[event.platform] = event.status ?? null;
    shown.heardMs[event.platform] = performance.now();
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
    recorder.stop();
    Object.assign(shown, { isGone: true, status: null });
    build();
  } else if (event.event === "controls") {
    Object.assign(shown, { holder: event.holder, isMine: event.yours });
    if (shown.status) page.update?.(shown.status);
  } else if (event.event === "tick") {
    hand?.heard(event.tick);
    page.heard?.(event.tick);
  } else {
    page.event?.(event);
  }
}

function showLogin() {
  const role = element("select", { id: "role" }, ...["look", "operate", "service"].map((name) => element("option", { value: name }, t(name === "look" ? "look" : `${name}Role`))));
  const password = element("input", { type: "password", id: "password", autocomplete: "current-password" });
  showFrame();
  at("page").replaceChildren(element("form", { class: "login", onsubmit: async (event) => {
    event.preventDefault();
    const answer = await fetch("api/login", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ role: role.value, password: password.value }) });
    if (answer.ok) location.reload(); else say((await answer.json()).error);
  } }, element("h2", {}, t("login")), element("label", { for: "role" }, t("role")), role, element("label", { for: "password" }, t("password")), password, element("button", {}, t("login"))));
}

// A panel that was restarted knows nobody any more.
async function mayConnect() {
  try {
    shown.me = await (await fetch("api/me")).json();
  } catch {
    return false;
  }
  if (!shown.me.role) {
    showLogin();
    return null;
  }
  return true;
}

async function start() {
  shown.me = await (await fetch("api/me")).json();
  if (!shown.me.role) return showLogin();
  link = new Link({
    onEvent,
    onBlock: (block) => takers[block.stream]?.take(block),
    onSlow: saySlow,
    mayConnect,
    onChange: (isOpen) => { hand?.letGo(); recorder?.stop(); shown.isMine = false; if (isOpen) choose(shown.platform ?? shown.me.platforms[0]); else { shown.status = null; build(); } },
  });
  recorder = new Recorder(link, takers);
  const animate = () => { page.frame?.(); requestAnimationFrame(animate); };
  animate();
  return undefined;
}

start();
