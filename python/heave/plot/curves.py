# SPDX-License-Identifier: MIT
"""curves.py - draws windows of traces with matplotlib. See command.py."""
from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  the backend has to be chosen first
from matplotlib.lines import Line2D  # noqa: E402
from matplotlib.patches import Patch  # noqa: E402
from matplotlib.ticker import EngFormatter, MaxNLocator  # noqa: E402

from heave.configuration import Configuration  # noqa: E402
from heave.plot.dots import Dot  # noqa: E402
from heave.plot.feedback import Feedback  # noqa: E402
from heave.plot.window import UNITS, Window, labels_of, thinned  # noqa: E402

Axes = Any  # of matplotlib, which older distributions have without types
Figure = Any
Panels = Any

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444")  # told apart by colour-blind people too
STATE_COLOURS = {"OFF": "#C9C9C9", "HOMING": "#D9CDEB", "SETTLED": "#E2E2E2", "RISING": "#CFE4F5", "NEUTRAL": "#DCEFD8", "ENGAGED": "#FFFFFF",
                 "HOLD": "#FFF1BF", "SETTLING": "#DDE3F3", "SERVICE": "#E6DDF2", "FAULT": "#F8C9C4", "ESTOP": "#F2A59D"}
FLAG_COLOUR, LIMIT_COLOUR = "#8A3A2E", "#B00020"
ORDER_LABEL = ("set-point", "speed", "acceleration", "jerk")
ORDER_UNIT = ("", "/s", "/s²", "/s³")
MOST_POINTS = 6000      # of one line
MANY_DOTS = 60          # more are drawn smaller, and behind the line
FAR_LIMIT = 2.5         # a limit further out than so many times the peak would flatten the curve: it is told in words
FAULT_ROWS = 5          # of labels below each other
LABEL_ROOM = 0.05       # of the width: requests nearer than that share a label
PANEL_WIDTH, PANEL_HEIGHT, FLAG_HEIGHT, LEGEND_HEIGHT = 7.5, 2.1, 0.2, 0.45  # inches


class Scene:
    """One trace and what belongs to it."""

    def __init__(self, window: Window, platform: Configuration | None = None, dots: Sequence[Dot] = (), requests: Sequence[tuple[int, str]] = (), feedback: Feedback | None = None,
                 faults: Sequence[tuple[int, str]] = ()) -> None:
        self.window, self.platform, self.dots, self.requests, self.feedback, self.faults = window, platform, dots, requests, feedback, faults


def draw(scenes: Sequence[Scene], axes: Sequence[str], path: Path) -> None:
    """A column of panels per scene and unit; a row per order, and one of flags."""
    units = [unit for unit in ("deg", "mm") if any(UNITS[name] == unit for name in axes)]
    columns = [(scene, unit) for scene in scenes for unit in units]
    flags = sorted({word for scene in scenes for word in scene.window.flag_bands()})
    heights = [PANEL_HEIGHT] * len(ORDER_LABEL) + [0.15 + FLAG_HEIGHT * max(1, len(flags))]
    # constrained_layout, gridspec_kw and ncol also mean something to the matplotlib of older distributions
    figure, panels = plt.subplots(len(heights) + 1, len(columns), squeeze=False, constrained_layout=True,
                                  figsize=(0.8 + PANEL_WIDTH * len(columns), 0.9 + LEGEND_HEIGHT + sum(heights)),
                                  gridspec_kw={"height_ratios": [*heights, LEGEND_HEIGHT]})
    for panel in panels[-1]:
        panel.axis("off")
    panels = panels[:-1]
    for c, (scene, unit) in enumerate(columns):
        names = [name for name in axes if UNITS[name] == unit]
        for order in range(len(ORDER_LABEL)):
            _panel(panels[order][c], scene, names, axes, order, unit)
        _flag_panel(panels[-1][c], scene, flags)
        _requests(panels, c, scene)
        _faults(panels, c, scene)
        panels[0][c].set_title(scene.window.name + (f" ({unit})" if len(units) > 1 else ""), fontsize=10, pad=26 if scene.requests else 6)
        last = panels[-1]
        for row in panels:
            row[c].set_xlim(scene.window.times_us[0] / 1e6, (scene.window.times_us[-1] + scene.window.cycle_us) / 1e6)
            row[c].tick_params(labelbottom=row[c] is last[c])
        last[c].set_xlabel("t [s]")
    _same_scales(panels, columns)
    for panel, (scene, unit) in zip(panels[0], columns):
        _dots(panel, scene, [name for name in axes if UNITS[name] == unit], axes)
    _legend(figure, scenes, axes, wide=len(columns) > 1)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _panel(panel: Axes, scene: Scene, names: Sequence[str], axes: Sequence[str], order: int, unit: str) -> None:
    window = scene.window
    extent = window.extent(names, order)
    peak = max(map(abs, extent)) if extent else 0.0
    for state, start, end in window.state_bands():
        panel.axvspan(start / 1e6, end / 1e6, color=STATE_COLOURS.get(state, "#FFFFFF"), linewidth=0, zorder=0)
    times = [t_us / 1e6 for t_us in window.times_us]
    for name in names:
        values = window.rates(name, order)
        drawn_times, drawn = thinned(times, values, MOST_POINTS)
        panel.plot(drawn_times, [math.nan if value is None else value for value in drawn], color=colour_of(name, axes), linewidth=1.0, zorder=3)
    if order == 0 and scene.feedback:
        _feedback(panel, scene.feedback, names, axes)
    panel.margins(y=0.08)
    if extent and extent[0] < extent[1]:
        room = 0.08 * (extent[1] - extent[0])
        panel.set_ylim(extent[0] - room, extent[1] + room)
    if scene.platform:
        _limits(panel, scene.platform, names, axes, order, peak, unit)
    panel.set_ylabel(f"{ORDER_LABEL[order]} [{unit}{ORDER_UNIT[order]}]", fontsize=9)
    panel.yaxis.set_major_locator(MaxNLocator(6))
    if order:
        panel.yaxis.set_major_formatter(EngFormatter(sep=""))
    panel.grid(color="#000000", alpha=0.12, linewidth=0.6, zorder=1)
    panel.tick_params(labelsize=8)


def _feedback(panel: Axes, feedback: Feedback, names: Sequence[str], axes: Sequence[str]) -> None:
    """Where the drives were, dashed. Set-points have the scale: feedback beside them is cut off, as where a drive lies about itself."""
    for name in names:
        times, values = thinned([t_us / 1e6 for t_us in feedback.times_us], feedback.actual.get(name, []), MOST_POINTS) if feedback.actual.get(name) else ([], [])
        panel.plot(times, [math.nan if value is None else value for value in values], color=colour_of(name, axes), linewidth=0.9, linestyle=(0, (4, 2)), zorder=4)


def _faults(panels: Panels, column: int, scene: Scene) -> None:
    """A line through all panels where a fault came, with its number and name; those beside each other below each other."""
    first, last = scene.window.times_us[0], scene.window.times_us[-1]
    for i, (t_us, text) in enumerate((t_us, text) for t_us, text in scene.faults if first <= t_us <= last):
        for row in panels:
            row[column].axvline(t_us / 1e6, color=LIMIT_COLOUR, linewidth=1, zorder=2)
        is_at_end = t_us > last - 4 * LABEL_ROOM * (last - first)
        panels[0][column].annotate(text, (t_us / 1e6, 1), xycoords=("data", "axes fraction"), xytext=(-3 if is_at_end else 3, -9 - 11 * (i % FAULT_ROWS)), textcoords="offset points",
                                   fontsize=7.5, color=LIMIT_COLOUR, ha="right" if is_at_end else "left", bbox={"facecolor": "white", "linewidth": 0, "pad": 1}, zorder=5)


def colour_of(name: str, axes: Sequence[str]) -> str:
    return COLOURS[axes.index(name) % len(COLOURS)]


def _dots(panel: Axes, scene: Scene, names: Sequence[str], axes: Sequence[str]) -> None:
    """Frames may ask for anything: what lies outside the panel becomes an arrow at its edge."""
    first, last = scene.window.times_us[0], scene.window.times_us[-1]
    low, high = panel.get_ylim()
    kinds: dict[tuple[str, str, bool], list[tuple[float, float]]] = {}
    for dot in scene.dots:
        for name in names if first <= dot.t_us <= last else ():
            value = dot.values.get(name)
            if value is not None:
                marker = "^" if value > high else "v" if value < low else "D" if dot.is_timed else "o"
                kinds.setdefault((name, marker, dot.is_timed), []).append((dot.t_us / 1e6, min(max(value, low), high)))
    for (name, marker, is_timed), points in kinds.items():
        is_dense = marker == "o" and len(points) > MANY_DOTS
        size = 16 if not is_dense else 5 if len(points) <= 5 * MANY_DOTS else 1
        colour = colour_of(name, axes)
        panel.scatter(*zip(*points), s=size, marker=marker, linewidths=0.5, edgecolors=colour, facecolors="white" if is_timed else colour,
                      zorder=2.5 if is_dense else 4, clip_on=marker not in "^v")
    panel.set_ylim(low, high)


def bounds_of(platform: Configuration, name: str, order: int) -> tuple[float, float] | None:
    """(low, high) of an axis or a cylinder, None where there is none."""
    if name.startswith("c"):
        index = int(name[1:]) - 1
        if index >= platform.cylinders:
            return None
        limits, low, high = platform.limits, platform.margin, platform.strokes[index] - platform.margin
    elif name in platform.axes:
        axis = platform.axes[name]
        limits, low, high = axis, axis.low, axis.high
    else:
        return None
    if order == 0:
        return float(low), float(high)
    limit = float((limits.speed, limits.accel, limits.jerk)[order - 1])
    return -limit, limit


def _limits(panel: Axes, platform: Configuration, names: Sequence[str], axes: Sequence[str], order: int, peak: float, unit: str) -> None:
    bounds = {name: pair for name, pair in ((name, bounds_of(platform, name, order)) for name in names) if pair}
    is_common = len(set(bounds.values())) == 1
    low, high = panel.get_ylim()
    room = (high - low) / 4 if order == 0 else peak * (FAR_LIMIT - 1)
    words, drawn = [], []
    for name, pair in bounds.items():
        colour = LIMIT_COLOUR if is_common else colour_of(name, axes)
        for value in set(pair):
            if low - room <= value <= high + room:
                panel.axhline(value, color=colour, linewidth=1.0, linestyle=(0, (5, 3)), zorder=2)
                drawn.append(value)
        if not all(low - room <= value <= high + room for value in pair):
            words.append(("" if is_common else f"{name} ") + (f"{pair[0]:g}..{pair[1]:g}" if order == 0 else f"±{pair[1]:g}"))
    if words:
        text = f"limits: {', '.join(dict.fromkeys(words))} {unit}{ORDER_UNIT[order]}"
        at_right = [y for line in panel.lines[:len(names)] for y in line.get_ydata()[-len(line.get_ydata()) // 4:] if not math.isnan(y)]
        is_free = max(at_right, default=low) < low + 0.8 * (high - low)  # else the lines are there: the text goes below
        panel.text(0.995, 0.97 if is_free else 0.03, text, transform=panel.transAxes, ha="right", va="top" if is_free else "bottom",
                   fontsize=7.5, color=LIMIT_COLOUR, zorder=5, bbox={"facecolor": "white", "linewidth": 0, "pad": 1.5})
    if drawn:
        spread = max(high, *drawn) - min(low, *drawn)
        panel.set_ylim(min(low, min(drawn) - 0.06 * spread), max(high, max(drawn) + 0.06 * spread))


def _flag_panel(panel: Axes, scene: Scene, flags: Sequence[str]) -> None:
    bands = scene.window.flag_bands()
    span_us = scene.window.times_us[-1] - scene.window.times_us[0]
    for i, word in enumerate(flags):
        # a single cycle has to stay visible
        least_us = max(scene.window.cycle_us, span_us / 700)
        spans = [(start / 1e6, max(end - start, least_us) / 1e6) for start, end in bands.get(word, [])]
        panel.broken_barh(spans, (i + 0.15, 0.7), color=FLAG_COLOUR, linewidth=0)
    panel.set_ylim(max(1, len(flags)), 0)
    panel.set_yticks([i + 0.5 for i in range(len(flags))], flags, fontsize=8)
    panel.tick_params(axis="x", labelsize=8)
    panel.tick_params(axis="y", length=0)
    panel.grid(axis="x", color="#000000", alpha=0.12, linewidth=0.6)
    panel.set_axisbelow(True)
    if not flags:
        panel.text(0.5, 0.5, "no flags", transform=panel.transAxes, ha="center", va="center", fontsize=8, color="#666666")


def _requests(panels: Panels, column: int, scene: Scene) -> None:
    first, last = scene.window.times_us[0], scene.window.times_us[-1]
    shown = [(t_us, text) for t_us, text in scene.requests if first <= t_us <= last]
    for t_us, _ in shown:
        for row in panels:
            row[column].axvline(t_us / 1e6, color="#444444", linewidth=0.8, linestyle=":", zorder=2)
    for t_us, text in labels_of(shown, LABEL_ROOM * (last - first)):
        is_at_end = t_us > last - 2 * LABEL_ROOM * (last - first)  # else it would end beside the picture
        panels[0][column].annotate(text, (t_us / 1e6, 1.01), xycoords=("data", "axes fraction"), fontsize=7.5, ha="right" if is_at_end else "left", va="bottom",
                                   rotation=0 if is_at_end else 35)


def _same_scales(panels: Panels, columns: Sequence[tuple[Scene, str]]) -> None:
    """Panels of the same unit side by side get the same scale: that is what a comparison is for."""
    for row in panels[:-1]:
        for unit in {unit for _, unit in columns}:
            group = [panel for panel, (_, u) in zip(row, columns) if u == unit]
            low, high = min(panel.get_ylim()[0] for panel in group), max(panel.get_ylim()[1] for panel in group)
            for panel in group:
                panel.set_ylim(low, high)


def _legend(figure: Figure, scenes: Sequence[Scene], axes: Sequence[str], wide: bool) -> None:
    handles = [Line2D([], [], color=colour_of(name, axes), linewidth=2, label=name) for name in axes]
    if any(scene.platform for scene in scenes):
        handles.append(Line2D([], [], color=LIMIT_COLOUR, linewidth=1, linestyle=(0, (5, 3)), label="limit"))
    for is_timed, label, face in ((False, "frame", "#555555"), (True, "timed frame", "white")):
        if any(dot.is_timed == is_timed for scene in scenes for dot in scene.dots):
            handles.append(Line2D([], [], linestyle="", marker="D" if is_timed else "o", markersize=4, markerfacecolor=face, color="#555555",
                                  label=label))
    seen = dict.fromkeys(state for scene in scenes for state in scene.window.states)
    handles += [Patch(facecolor=STATE_COLOURS.get(state, "#FFFFFF"), edgecolor="#999999", linewidth=0.5, label=state) for state in seen]
    figure.legend(handles=handles, loc="lower center", ncol=min(len(handles), 16 if wide else 8), fontsize=8, frameon=False)
