# SPDX-License-Identifier: MIT
"""animation.py - a run as one page for a browser: the platform in motion, to be turned, stopped and looked at row by row. It asks nothing of any network."""
from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence

from heave.configuration import Configuration
from heave.plot.window import Window

FRAMES_PER_S = 25
FAULTY = ("FAULT", "ESTOP")
MOST_FRAMES = 15_000  # ten minutes; longer runs have fewer a second

PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'">
<title>@TITLE@</title>
<style>
body { margin: 0; font: 15px sans-serif; background: #f4f4f2; color: #222; display: flex; flex-direction: column; height: 100vh }
canvas { flex: 1; min-height: 0; width: 100%; touch-action: none; cursor: grab }
footer { display: flex; gap: .8em; align-items: center; padding: .5em 1em; background: #fff; flex-wrap: wrap }
input[type=range] { flex: 1; min-width: 10em }
button, select { font: inherit; padding: .3em .9em }
output { font-variant-numeric: tabular-nums; min-width: 20em }
</style></head><body>
<canvas id="view" role="img" aria-label="the platform in motion"></canvas>
<footer><button id="play">Play</button>
<label>Speed <select id="speed"><option>0.1</option><option>0.25</option><option selected>1</option><option>2</option><option>5</option></select></label>
<input id="at" type="range" min="0" value="0" step="1" aria-label="time"><output id="said"></output></footer>
<script id="run" type="application/json">@RUN@</script>
<script>
"use strict";
const run = JSON.parse(document.getElementById("run").textContent), view = document.getElementById("view"), pen = view.getContext("2d");
const at = document.getElementById("at"), button = document.getElementById("play"), said = document.getElementById("said"), speed = document.getElementById("speed");
let turn = 0.5, tilt = 0.35, isPlaying = false, frame = 0, since = 0;
at.max = run.t.length - 1;
// Left-handed: x forward (away from the viewer), y right, z up.
function project(p) {
  const s = Math.sin(turn), c = Math.cos(turn), right = c * p[1] - s * p[0], away = s * p[1] + c * p[0], up = p[2] - run.middle;
  const depth = away * Math.cos(tilt) - up * Math.sin(tilt), size = Math.min(view.width, view.height) / (2.6 * run.size) * 4 / (4 + depth / run.size);
  return [view.width / 2 + right * size, view.height / 2 - (up * Math.cos(tilt) + away * Math.sin(tilt)) * size];
}
function shape(points, fill, stroke) {
  pen.beginPath();
  points.forEach((p, i) => { const q = project(p); if (i) pen.lineTo(q[0], q[1]); else pen.moveTo(q[0], q[1]); });
  pen.closePath(); pen.fillStyle = fill; pen.fill(); pen.strokeStyle = stroke; pen.lineWidth = 2; pen.stroke();
}
function line(a, b, colour, width) {
  const p = project(a), q = project(b);
  pen.beginPath(); pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]); pen.strokeStyle = colour; pen.lineWidth = width; pen.lineCap = "round"; pen.stroke();
}
function draw() {
  const scale = window.devicePixelRatio || 1;
  view.width = view.clientWidth * scale; view.height = view.clientHeight * scale;
  const n = Math.round(frame), plate = run.plate[n], out = run.extensions[n];
  shape(run.base, "#d8d8d4", "#888");
  run.base.forEach((foot, i) => {
    const share = (out[i] - run.margin) / (run.stroke[i] - 2 * run.margin), head = plate[i], body = run.retracted[i] / Math.hypot(head[0] - foot[0], head[1] - foot[1], head[2] - foot[2]);
    const joint = foot.map((value, k) => value + (head[k] - value) * Math.min(1, 0.95 * body));
    line(foot, joint, "#555", 9 * scale); line(joint, head, share < 0.02 || share > 0.98 ? "#b00020" : "#0072b2", 5 * scale);
  });
  shape(plate, "rgba(230,159,0,.55)", "#a66f00");
  const middle = plate[0].map((_, k) => plate.reduce((sum, p) => sum + p[k], 0) / plate.length);
  line(middle, run.nose[n], "#222", 3 * scale);
  at.value = n;
  said.textContent = run.t[n].toFixed(2) + " s  " + run.state[n] + (run.flags[n] ? "  " + run.flags[n] : "") + "   " + run.names.map((name, k) => name + " " + run.pose[n][k].toFixed(1)).join("  ");
}
function step(now) {
  if (!isPlaying) return;
  const elapsed = Math.min(0.2, (now - since) / 1000) * Number(speed.value);
  since = now;
  frame = Math.min(run.t.length - 1, frame + elapsed / run.step);
  if (frame >= run.t.length - 1) toggle();
  draw(); requestAnimationFrame(step);
}
function toggle() {
  isPlaying = !isPlaying; button.textContent = isPlaying ? "Pause" : "Play"; since = performance.now();
  if (isPlaying && frame >= run.t.length - 1) frame = 0;
  if (isPlaying) requestAnimationFrame(step);
}
button.onclick = toggle;
at.oninput = () => { frame = Number(at.value); draw(); };
view.onpointermove = event => { if (event.buttons) { turn += event.movementX / 150; tilt = Math.max(-0.2, Math.min(1.5, tilt + event.movementY / 200)); draw(); } };
view.onpointerdown = event => view.setPointerCapture(event.pointerId);
window.onresize = draw;
draw();
</script></body></html>
"""


def chosen(window: Window) -> tuple[list[int], int]:
    """The rows that are shown."""
    step_us = max(1_000_000 // FRAMES_PER_S, window.cycle_us, (window.times_us[-1] - window.times_us[0]) // MOST_FRAMES)
    rows, due = [], window.times_us[0]
    for i, t_us in enumerate(window.times_us):
        if t_us >= due:
            rows.append(i)
            due = max(due + step_us, t_us)  # rows may be missing
    return rows, step_us


def rounded(points: Iterable[Sequence[float]], digits: int = 1) -> list[list[float]]:
    return [[round(value, digits) for value in point] for point in points]


def told_states(window: Window, faults: Sequence[tuple[int, str]]) -> list[str]:
    """The states; those that a fault leads to with the newest fault."""
    told, newest, due = [], "", list(faults)
    for t_us, state in zip(window.times_us, window.states):
        while due and due[0][0] <= t_us:
            newest = due.pop(0)[1]
        told.append(f"{state} {newest}".rstrip() if state in FAULTY else state)
    return told


def page(window: Window, platform: Configuration, faults: Sequence[tuple[int, str]] = ()) -> str:
    """The HTML. Where no pose belongs to the extensions the plate is left where it was."""
    states = told_states(window, faults)
    rows, step_us = chosen(window)
    nose = [[max(abs(value) for arm in platform.arms for value in arm[:2]), 0.0, max(arm[2] for arm in platform.arms)]]
    plates: list[list[list[float]]] = []
    noses: list[list[float]] = []
    poses: list[list[float]] = []
    for i in rows:
        if "no-pose" not in window.flags[i].split("|") or not plates:
            pose = [value / 1e9 for value in window.rows[i][:6]]
            joints, tip = platform.place(pose, platform.arms), platform.place(pose, nose)[0]
        plates.append(rounded(joints))
        noses.append(rounded([tip])[0])
        poses.append([round(value, 2) for value in pose])
    size = max(abs(value) for foot in platform.base for value in foot[:2])
    run = {"t": [round(window.times_us[i] / 1e6, 3) for i in rows], "step": step_us / 1e6, "state": [states[i] for i in rows], "flags": [window.flags[i] for i in rows],
           "names": ["roll", "pitch", "yaw", "x", "y", "z"], "pose": poses, "plate": plates, "nose": noses, "base": rounded(platform.base),
           "extensions": rounded([[value / 1e9 for value in window.rows[i][7:7 + platform.cylinders]] for i in rows]),
           "stroke": [float(value) for value in platform.strokes], "margin": float(platform.margin), "retracted": platform.retracted,
           "size": size, "middle": platform.centre[2] / 2}
    text = json.dumps(run, separators=(",", ":")).replace("<", "\\u003c")  # nothing in it ends the element
    return PAGE.replace("@TITLE@", html.escape(f"{window.name}")).replace("@RUN@", text)
