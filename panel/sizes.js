// SPDX-License-Identifier: MIT
// sizes.js - the sizes of a platform as a form over the same draft, beside what heaved makes of them: seen from above with its measures, and in a pose.
import { extensions } from "./space.js";
import { t } from "./text.js";
import { button, choice, element, fill, number, table } from "./ui.js";
import { View } from "./view.js";

const SIZES = ["base_radius_mm", "base_spread_deg", "base_turn_deg", "plate_radius_mm", "plate_spread_deg", "plate_turn_deg"];
const LENGTHS = ["retracted_length_mm", "stroke_mm", "margin_mm", "zero_height_mm", "mrp_mm"];
const NOTHING = { roll_deg: 0, pitch_deg: 0, yaw_deg: 0, x_mm: 0, y_mm: 0, z_mm: 0 };
const AXES = Object.keys(NOTHING);
const RAD = Math.PI / 180;

const joints = (what, count) => Array.from({ length: count }, (_, i) => `${what}${i + 1}_mm`);

// What sizes the joints come to: radius of the circle, angle between the two of a pair, how far the first pair is turned.
export function sizesOf(points, isBase) {
  const radius = points.reduce((sum, p) => sum + Math.hypot(p[0], p[1]), 0) / points.length;
  const angle = (i) => Math.atan2(points[i][1], points[i][0]) / RAD;
  if (points.length !== 6) return { radius, spread: null, turn: angle(0) };
  const [a, b] = isBase ? [0, 1] : [1, 2];
  const spread = ((angle(b) - angle(a)) % 360 + 360) % 360, middle = angle(a) + spread / 2 - (isBase ? 0 : 60);
  return { radius, spread, turn: ((middle + 180) % 360 + 360) % 360 - 180 };
}

export function buildSizes({ draft, sections }) {
  const known = sections.find((one) => one.name === "geometry").keys;
  const cylinders = draft.value("platform", "kind")?.startsWith("tripod") ? 3 : 6;
  const isByJoints = () => draft.value("geometry", "base1_mm") !== null;
  const fields = element("div", { class: "fields" }), mode = element("div", { class: "buttons" }), others = element("div", { id: "size-mistakes" }), lengths = element("div", {});
  const plan = element("div", { class: "plan" }), inPose = element("div", {});
  const pose = { ...NOTHING }, sliders = element("div", { class: "fields" }), picture = new View(inPose);
  let last = [], focus = "", shownMode = null, inputs = {};

  const wanted = () => (isByJoints() ? [...joints("base", cylinders), ...joints("plate", cylinders)] : SIZES.filter((name) => cylinders === 6 || !name.includes("spread"))).concat(LENGTHS).filter((name) => known.some((key) => key.name === name));

  function makeFields() {
    inputs = {};
    fields.replaceChildren(...wanted().map((name) => {
      const key = known.find((one) => one.name === name), id = `size-${name}`;
      const input = element("input", { id, type: "text", inputmode: "decimal", autocomplete: "off", placeholder: key.default ?? "", "aria-describedby": `${id}-help ${id}-wrong` });
      const wrong = element("p", { class: "bad", id: `${id}-wrong` });
      input.value = draft.value("geometry", name) ?? "";
      input.addEventListener("input", () => draft.setValue("geometry", name, input.value.trim() === "" ? null : input.value.trim()));
      input.addEventListener("focus", () => { focus = name; drawPlan(); });
      inputs[name] = { input, wrong };
      return element("div", { class: "field" }, element("label", { for: id }, `${t(`size_${name.replace(/\d_mm$/, "_joint")}`)} `, element("code", {}, name)), input, element("p", { class: "soft", id: `${id}-help` }, `${key.help}: ${key.allowed}`), wrong);
    }));
    fill(mode, button(t("bySizes"), null, { "data-mode": "sizes", "aria-pressed": String(!isByJoints()) }), button(t("byJoints"), null, { "data-mode": "joints", "aria-pressed": String(isByJoints()) }));
    shownMode = isByJoints();
  }

  // The same joints, written the other way.
  function change(toJoints) {
    const geometry = draft.geometry;
    if (toJoints === isByJoints() || !geometry) return;
    for (const [what, points] of [["base", geometry.base_mm], ["plate", geometry.plate_mm]]) {
      const found = sizesOf(points, what === "base"), round = (value) => String(Math.round(value * 1000) / 1000);
      points.forEach((p, i) => draft.setValue("geometry", `${what}${i + 1}_mm`, toJoints ? p.map(round).join(", ") : null));
      draft.setValue("geometry", `${what}_radius_mm`, toJoints ? null : round(found.radius));
      draft.setValue("geometry", `${what}_spread_deg`, toJoints || found.spread === null ? null : round(found.spread));
      draft.setValue("geometry", `${what}_turn_deg`, toJoints || Math.abs(found.turn) < 0.001 ? null : round(found.turn));
    }
    makeFields();
  }

  function drawPlan() {
    const geometry = draft.geometry;
    if (geometry) plan.replaceChildren(planOf(geometry, focus));
  }

  function drawPose() {
    const geometry = draft.geometry;
    if (!geometry) return;
    const reach = extensions(geometry, pose);
    picture.draw(geometry, { pose_sent: pose, pose_asked: null, cylinders: reach.map((mm, i) => ({ sent_mm: mm, stroke_mm: geometry.stroke_mm[i] })) });
    fill(lengths, table([t("drive"), t("extension"), t("stroke")], reach.map((mm, i) => [String(i + 1), element("span", { class: mm < 0 || mm > geometry.stroke_mm[i] ? "bad" : "" }, `${number(mm, 1)} mm`), `${number(geometry.stroke_mm[i], 0)} mm`])));
  }

  function makeSliders() {
    const limits = draft.geometry?.limits;
    if (!limits || sliders.childNodes.length) return;
    sliders.replaceChildren(...AXES.filter((axis) => limits[axis] && limits[axis][1] > limits[axis][0]).map((axis) => {
      const value = element("span", {}, "0"), slider = element("input", { type: "range", class: "wide", min: limits[axis][0], max: limits[axis][1], step: "any", value: 0, "aria-label": axis });
      slider.addEventListener("input", () => { pose[axis] = Number(slider.value); value.textContent = number(pose[axis], 1); drawPose(); });
      return element("label", {}, `${axis.replace("_", " ")}: `, value, slider);
    }));
  }

  mode.addEventListener("click", (event) => { if (event.target.dataset.mode) change(event.target.dataset.mode === "joints"); });
  makeFields();
  return {
    part: element("div", { class: "grid two" }, element("section", {}, element("h2", {}, t("config_sizes")), element("p", {}, t("sizesHelp")), mode, fields, others),
      element("section", {}, element("h2", {}, t("fromAbove")), plan, element("h2", {}, t("inAPose")), inPose, sliders, lengths)),
    end() { picture.end(); },
    refresh() {
      const now = [draft.text, draft.found, draft.staged];
      if (now.every((one, i) => one === last[i])) return;
      last = now;
      if (shownMode !== isByJoints()) makeFields();
      const errors = draft.found?.ok === false && draft.staged ? draft.found.errors : [], mine = new Set();
      for (const [name, { input, wrong }] of Object.entries(inputs)) {
        const its = errors.filter((one) => one.text.startsWith(`[geometry] ${name}: `));
        its.forEach((one) => mine.add(one));
        wrong.textContent = its.map((one) => one.text.slice(`[geometry] ${name}: `.length)).join("; ");
        input.setAttribute("aria-invalid", String(its.length > 0));
        if (document.activeElement !== input) input.value = draft.value("geometry", name) ?? "";
      }
      const warnings = (draft.found?.report ?? "").split("\n").filter((line) => line.startsWith("warning"));
      fill(others, ...errors.filter((one) => !mine.has(one)).map((one) => element("p", { class: "bad" }, `${one.line ? `${t("line")} ${one.line}: ` : ""}${one.text}`)), ...warnings.map((line) => element("p", { class: "warn" }, line)));
      makeSliders();
      drawPlan();
      drawPose();
    },
  };
}

// Seen from above, +X upwards, +Y to the right: circles, joints with their numbers, and the measure that somebody types just now.
function planOf(geometry, focus) {
  const svg = (tag, attributes, ...children) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };
  const all = [...geometry.base_mm, ...geometry.plate_mm], far = Math.max(...all.map((p) => Math.hypot(p[0], p[1]))), scale = 150 / far;
  const at = (p) => [200 + p[1] * scale, 200 - p[0] * scale];
  const parts = [svg("line", { x1: 200, y1: 200, x2: 200, y2: 12, class: "axis" }), svg("text", { x: 208, y: 18 }, "+X"), svg("line", { x1: 200, y1: 200, x2: 388, y2: 200, class: "axis" }), svg("text", { x: 366, y: 194 }, "+Y")];
  for (const [what, points] of [["base", geometry.base_mm], ["plate", geometry.plate_mm]]) {
    const { radius, spread } = sizesOf(points, what === "base"), isOn = (name) => focus === `${what}_${name}`;
    parts.push(svg("circle", { cx: 200, cy: 200, r: radius * scale, class: `ring ${what}` }));
    parts.push(svg("polygon", { points: points.map((p) => at(p).join(",")).join(" "), class: `shape ${what}` }));
    const pair = what === "base" ? [0, 1] : [1, 2];
    if (isOn("radius_mm")) parts.push(svg("line", { x1: 200, y1: 200, x2: at(points[0])[0], y2: at(points[0])[1], class: "measure" }), svg("text", { x: (200 + at(points[0])[0]) / 2 + 6, y: (200 + at(points[0])[1]) / 2, class: "value" }, `${number(radius, 1)} mm`));
    if (spread !== null && (isOn("spread_deg") || isOn("turn_deg"))) {
      for (const i of pair) parts.push(svg("line", { x1: 200, y1: 200, x2: at(points[i])[0], y2: at(points[i])[1], class: "measure" }));
      const [x, y] = at(points[pair[1]]);
      parts.push(svg("text", { x: 200 + (x - 200) * 0.55 + 6, y: 200 + (y - 200) * 0.55, class: "value" }, `${number(spread, 1)}°`));
    }
    points.forEach((p, i) => {
      const [x, y] = at(p), isMine = focus === `${what}${i + 1}_mm`, out = what === "base" ? 1.1 : 0.84;
      parts.push(svg("circle", { cx: x, cy: y, r: isMine ? 9 : 5, class: `joint ${what}` }));
      parts.push(svg("text", { x: 200 + (x - 200) * out - 5, y: 200 + (y - 200) * out + 5, class: what }, String(i + 1)));
    });
  }
  geometry.base_mm.forEach((p, i) => parts.unshift(svg("line", { x1: at(p)[0], y1: at(p)[1], x2: at(geometry.plate_mm[i])[0], y2: at(geometry.plate_mm[i])[1], class: "leg" })));
  return svg("svg", { viewBox: "0 0 400 400", role: "img", "aria-label": t("fromAbove") }, ...parts);
}
