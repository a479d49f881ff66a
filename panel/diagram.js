// SPDX-License-Identifier: MIT
// diagram.js - the states of a platform: where it is, where it is going, and what can happen next, as a picture and in words.
import { ACTORS, ROWS, WORDS } from "./states.js";
import { chinese, t } from "./text.js";
import { element, fill } from "./ui.js";

const WIDE = 104, TALL = 38;
const PLACES = { OFF: [180, 402], HOMING: [180, 332], SETTLED: [180, 262], RISING: [180, 180], NEUTRAL: [180, 104], ENGAGED: [180, 28], HOLD: [304, 104], SETTLING: [304, 222], SERVICE: [56, 332], FAULT: [56, 28], ESTOP: [56, 104] };
const NAMED = { engage: "engage", hold: "hold", resume: "resume", park: "park", reset: "reset", service: "enterService", "service-off": "leaveService" }; // as on the buttons

export const shortName = (state) => (chinese() ? t(state).split("：")[0] : state);

// {event: [{to, guard}]} of what can change a state, by who does it.
export function possible(state) {
  const out = {};
  for (const [actor, events] of Object.entries(ACTORS)) {
    for (const [from, event, guard, to] of ROWS) {
      if (from !== state || !events.includes(event)) continue;
      ((out[actor] ??= {})[event] ??= []).push({ to, guard });
    }
  }
  return out;
}

function svg(tag, attributes, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// Where a line between the middles of two boxes leaves the first one, a little to its left: the way back has its own line.
function edge(from, to) {
  const [ax, ay] = PLACES[from], [bx, by] = PLACES[to], dx = bx - ax, dy = by - ay, long = Math.hypot(dx, dy);
  const sx = dy / long * 7, sy = -dx / long * 7;
  const share = Math.min(Math.abs((WIDE / 2 + 3) / (dx || 1e-9)), Math.abs((TALL / 2 + 3) / (dy || 1e-9)));
  return { x1: ax + dx * share + sx, y1: ay + dy * share + sy, x2: bx - dx * share + sx, y2: by - dy * share + sy };
}

export class Diagram {
  constructor(place) {
    this.words = element("div", {});
    this.picture = element("div", {});
    place.replaceChildren(this.picture, this.words);
  }

  update(status) {
    const now = `${status.state} ${status.goal} ${chinese()}`;
    if (now === this.now) return;
    this.now = now;
    const leads = new Set(ROWS.filter(([from]) => from === status.state).map((row) => row[3]));
    const arrow = (id, colour) => svg("marker", { id, viewBox: "0 0 10 10", refX: 9, refY: 5, markerWidth: 9, markerHeight: 9, markerUnits: "userSpaceOnUse", orient: "auto" }, svg("path", { d: "M0 0L10 5L0 10z", fill: colour }));
    const picture = svg("svg", { viewBox: "0 0 360 430", class: "states", role: "img", "aria-label": `${t("state")}: ${shortName(status.state)}; ${t("goal")}: ${shortName(status.goal)}` },
      svg("defs", {}, arrow("thin", "var(--line)"), arrow("thick", "var(--act)")));
    const pairs = new Map(ROWS.filter(([from]) => from !== "ANY").map(([from, , , to]) => [`${from} ${to}`, [from, to]]));
    for (const [from, to] of [...pairs.values()].sort((a, b) => (a[0] === status.state) - (b[0] === status.state))) {
      const isNext = from === status.state;
      picture.append(svg("line", { ...edge(from, to), stroke: `var(--${isNext ? "act" : "line"})`, "stroke-width": isNext ? 3 : 1, "marker-end": `url(#${isNext ? "thick" : "thin"})` }));
    }
    for (const [name, [x, y]] of Object.entries(PLACES)) {
      const isHere = name === status.state, isNext = leads.has(name);
      picture.append(svg("rect", { x: x - WIDE / 2, y: y - TALL / 2, width: WIDE, height: TALL, rx: 7, fill: `var(--${isHere ? "front" : "back"})`, stroke: `var(--${isNext ? "act" : isHere ? "front" : "line"})`, "stroke-width": isNext ? 3 : 1.5,
        ...(name === status.goal && !isHere ? { "stroke-dasharray": "6 4" } : {}) }),
      svg("text", { x, y: y + 5, "text-anchor": "middle", "font-size": 15, "font-weight": isHere || isNext ? 700 : 400, fill: `var(--${isHere ? "back" : "front"})` }, shortName(name)));
    }
    this.picture.replaceChildren(picture);
    const words = WORDS[chinese() ? "zh" : "en"];
    const target = ({ to, guard }) => `${shortName(to)}${guard === "ALWAYS" ? "" : ` (${words.guards[guard]})`}`;
    fill(this.words, element("p", {}, `${t("goal")}: ${shortName(status.goal)}`), element("dl", {}, ...Object.entries(possible(status.state)).flatMap(([actor, events]) => [element("dt", {}, words.actors[actor]),
      element("dd", {}, ...Object.entries(events).map(([event, to]) => element("div", {}, `${NAMED[event] ? t(NAMED[event]) : words.events[event]} → ${to.map(target).join(", ")}`)))])),
    element("p", { class: "soft" }, t("anyTime")));
  }
}
