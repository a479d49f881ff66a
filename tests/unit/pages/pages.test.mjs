// SPDX-License-Identifier: MIT
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";
const { possible } = await import("/diagram.js");
const { wordsOf } = await import("/drives.js");
const { Hand, isHolding } = await import("/hand.js").catch(() => ({}));
const { atLimits, nearness } = await import("/limits.js");
const { ACTORS, ROWS, WORDS } = await import("/states.js");
const { TEXT, noticesIn } = await import("/text.js");
const { span } = await import("/times.js");

const css = readFileSync(new URL("../../../panel/style.css", import.meta.url), "utf8");
const parts = css.match(/:root \{[^}]*\}/g), themes = { light: parts[0], dark: parts[1] };
const colour = (theme, name) => new RegExp(`--${name}: (#[0-9a-f]{6})`).exec(themes[theme])[1];
const linear = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255).map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;
const contrast = (a, b) => { const [x, y] = [luminance(linear(a)), luminance(linear(b))]; return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05); };
// Machado, Oliveira, Fernandes 2009: what is left of colours without one kind of cones.
const BLIND = {
  protanopia: [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
  deuteranopia: [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
  tritanopia: [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
};
const seenBy = (kind, hex) => BLIND[kind].map((row) => Math.min(1, Math.max(0, row.reduce((sum, weight, i) => sum + weight * linear(hex)[i], 0))));
function lab([r, g, b]) {
  const f = (v) => (v > 0.008856 ? Math.cbrt(v) : 7.787 * v + 16 / 116);
  const [x, y, z] = [(0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047, 0.2126 * r + 0.7152 * g + 0.0722 * b, (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883].map(f);
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
const apart = (kind, a, b) => Math.hypot(...lab(seenBy(kind, a)).map((v, i) => v - lab(seenBy(kind, b))[i]));

test("in sunlight: text has a contrast of 12, coloured words 6, lines 3, light and dark", () => {
  for (const theme of ["light", "dark"]) {
    for (const ground of ["back", "box"]) {
      for (const ink of ["front", "soft", "good", "bad", "act"]) assert.ok(contrast(colour(theme, ink), colour(theme, ground)) >= (ink === "front" ? 12 : 6), `${theme} ${ink} on ${ground}: ${contrast(colour(theme, ink), colour(theme, ground))}`);
      for (const line of ["c1", "c2", "c3", "c4", "c5", "c6", "c7", "close", "end", "warn"]) assert.ok(contrast(colour(theme, line), colour(theme, ground)) >= 3, `${theme} ${line} on ${ground}: ${contrast(colour(theme, line), colour(theme, ground))}`);
    }
  }
});

test("for the colour-blind: free, close and end differ, and so do good and bad", () => {
  for (const theme of ["light", "dark"]) {
    for (const kind of Object.keys(BLIND)) {
      for (const [a, b] of [["act", "close"], ["close", "end"], ["act", "end"], ["good", "bad"]]) {
        assert.ok(apart(kind, colour(theme, a), colour(theme, b)) > 15, `${theme} ${kind} ${a} ${b}: ${apart(kind, colour(theme, a), colour(theme, b))}`);
      }
    }
  }
});

test("every event and condition of the states has words in both languages, and every state a name", () => {
  for (const [from, event, guard, to] of ROWS) {
    for (const words of Object.values(WORDS)) assert.ok(words.events[event] && (guard === "ALWAYS" || words.guards[guard]), `${event} ${guard}`);
    for (const state of [from, to]) assert.ok(state === "ANY" || TEXT[state], state);
  }
  assert.deepEqual(Object.values(ACTORS).flat().sort(), Object.keys(WORDS.en.events).sort());
});

test("what is possible next is what the supervisor has", () => {
  assert.deepEqual(possible("OFF").operator, { engage: [{ to: "HOMING", guard: "ALWAYS" }], park: [{ to: "HOMING", guard: "ALWAYS" }], service: [{ to: "SERVICE", guard: "STANDS_STILL" }] });
  assert.deepEqual(Object.keys(possible("FAULT").operator), ["reset"]);
  assert.equal(possible("HOLD").operator.resume.length, 5);
});

test("limits: near an end of a stroke, and at a limit of an axis", () => {
  assert.deepEqual([-1, 2, 5, 50, 95, 98, 101].map((mm) => nearness(mm, 100)), ["end", "end", "close", "free", "close", "end", "end"]);
  const limits = { roll_deg: [-10, 10], yaw_deg: [0, 0], z_mm: [-40, 40] };
  assert.deepEqual(atLimits(limits, { roll_deg: -10, yaw_deg: 0, z_mm: 39 }), ["roll_deg"]);
  assert.deepEqual(atLimits(limits, null), []);
});

test("a drive's words: trouble with what was found and wanted, emergencies, notes; nothing where there is nothing", () => {
  assert.deepEqual(wordsOf({ device_code: 0, report: null }), []);
  const report = { trouble: "no answer", detail: "timeout", object: 0x6060, sub_index: 0, found: 1, wanted: 8, emergency: { code: 0x8130, text: "heartbeat", over: true, count: 2 }, notes: ["warning"] };
  assert.deepEqual(wordsOf({ device_code: 0x7305, report }).map(([text]) => text), ["code of the drive 0x7305", "no answer; timeout; 0x6060:0; 1 / 8", "EMCY 0x8130 heartbeat (over) × 2", "warning"]);
});

test("a hand is holding from the answer until it lets go, whatever ends it", async () => {
  globalThis.window = globalThis.document = { addEventListener() {}, removeEventListener() {} };
  const sent = [], hand = new Hand({ ask: async () => ({ answer: { ok: true, series: 3, tick: 10 } }), send: (message) => sent.push(message) }, "ride", () => {});
  assert.equal(isHolding(), false);
  await hand.press("jog 1 1");
  assert.equal(isHolding(), true);
  await new Promise((go) => setTimeout(go, 130));
  hand.heard({ tick: 11, held: false, series: 3 });
  assert.equal(isHolding(), false);
  hand.letGo();
  assert.equal(isHolding(), false);
  assert.ok(sent.filter((one) => one.op === "beat").length >= 1 && sent.at(-1).op === "release", JSON.stringify(sent));
});

test("times have units", () => assert.deepEqual([20, 1000, 1500].map(span), ["20 µs", "1 ms", "1.5 ms"]));

test("what people have to know first is told, and nothing else", () => {
  const well = { estop_active: false, power_failing: false, selftest: { due: false }, configuration: { barred: false, slow_rise: false } };
  assert.deepEqual(noticesIn(well), []);
  assert.deepEqual(noticesIn({ ...well, configuration: { barred: false, slow_rise: true } }), ["slowRise"]);
  assert.deepEqual(noticesIn({ estop_active: true, power_failing: true, selftest: { due: true }, configuration: { barred: true, slow_rise: true } }), ["estop", "power", "due", "barred", "slowRise"]);
  for (const name of ["estop", "power", "due", "barred", "slowRise"]) assert.ok(TEXT[name].length === 2 && TEXT[name].every((text) => text.length > 0), name);
});
