# SPDX-License-Identifier: MIT
"""shares.py - draws how much of each limit a run used, and the spectra of its accelerations, with matplotlib. See command.py."""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy
from matplotlib.ticker import PercentFormatter

from heave.configuration import POSE_AXES, Configuration
from heave.plot.curves import LIMIT_COLOUR, ORDER_LABEL, Axes, Scene, bounds_of, colour_of
from heave.plot.window import UNITS, TraceError, Window

SEGMENT = 4096    # rows of one spectrum; of all of them the mean is drawn
LEAST_ROWS = 256
FULL = 0.85       # of a limit
MOST_SHOWN = 2.5  # of a limit: of bars that are longer the number tells
LEAST_DENSITY = 1e-9
DECADES = 4       # below the highest peak of a unit: further down is the rounding of set-points
NOT_LED = {"OFF", "HOMING", "FAULT", "ESTOP"}  # there set-points follow the actual positions: no limit holds


def shares_of(window: Window, platform: Configuration) -> dict[str, list[float | None]]:
    """{name: [share of the limit on position, speed, acceleration, jerk]}; of the rows that are led, and of a position the distance from the middle of its range.
    None: there is no row in which the limit applies."""
    led = [state not in NOT_LED and "loose" not in flags for state, flags in zip(window.states, window.flags)]
    names = [*platform.axes, *(f"c{i + 1}" for i in range(platform.cylinders))]
    result: dict[str, list[float | None]] = {}
    for name in names:
        # cylinder by cylinder, no limit of a pose axis holds
        counts = [is_led and (name not in POSE_AXES or not {"cylinders", "no-pose", "off-path", "takeover"} & set(flags.split("|"))) for is_led, flags in zip(led, window.flags)]
        result[name] = []
        for order in range(len(ORDER_LABEL)):
            bounds = bounds_of(platform, name, order)
            assert bounds is not None, "a name of the platform"
            low, high = bounds
            middle, half = (low + high) / 2, (high - low) / 2
            values = [value for value, is_counted in zip(window.rates(name, order), counts) if is_counted and value is not None]
            result[name].append(None if not values else max(abs(value - middle) for value in values) / half if half else 0.0)
    return result


def draw_limits(scene: Scene, platform: Configuration, path: Path) -> None:
    shares = shares_of(scene.window, platform)
    figure, panels = plt.subplots(1, len(ORDER_LABEL), sharey=True, constrained_layout=True, figsize=(12, 1.4 + 0.28 * len(shares)))
    places = range(len(shares))
    for order, panel in enumerate(panels):
        known = [of_axis[order] for of_axis in shares.values()]
        values = [value or 0.0 for value in known]
        end = min(1.15 * max(1.0, *values), MOST_SHOWN)
        panel.barh(places, values, color=[LIMIT_COLOUR if value > 1 + 1e-6 else "#0072B2" for value in values])
        for place, value in zip(places, known):
            _share(panel, place, value, end)
        panel.axvline(1, color=LIMIT_COLOUR, linewidth=1, linestyle=(0, (5, 3)), zorder=0.5)
        panel.set_xlim(0, end)
        panel.xaxis.set_major_formatter(PercentFormatter(1.0))
        panel.set_title(ORDER_LABEL[order] if order else "range, from its middle", fontsize=10)
        panel.tick_params(labelsize=8)
    panels[0].set_yticks(list(places), list(shares))
    panels[0].invert_yaxis()
    figure.suptitle(f"{scene.window.name}: share of each limit that was used", fontsize=10)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _share(panel: Axes, place: int, value: float | None, end: float) -> None:
    """Beside its bar, and inside one that is nearly full, where the line of the limit is, or that goes on beyond the picture."""
    if value is None:
        panel.text(0, place, " not led", va="center", fontsize=7.5, color="#666666")
    elif value > FULL:
        panel.text(min(value, end), place, f"{value:.0%} ", va="center", ha="right", fontsize=7.5, color="white")
    else:
        panel.text(value, place, f" {value:.0%}", va="center", fontsize=7.5)


def spectrum_of(window: Window, name: str) -> tuple[Any, Any]:
    """(frequencies in Hz, amplitude density in unit/s^2 per sqrt Hz) of the acceleration, by the mean of Hann windows that overlap by half."""
    values = window.rates(name, 2)
    pieces: list[list[float]] = []
    piece: list[float] = []
    for value, state in zip(values, window.states):
        if value is None or state in NOT_LED:
            pieces, piece = [*pieces, piece], []
        else:
            piece.append(value)
    longest = numpy.array(max([*pieces, piece], key=len))
    if len(longest) < LEAST_ROWS:
        raise TraceError(f"{window.name}: {len(longest)} rows in a row that are led; a spectrum takes {LEAST_ROWS}")
    rate, size = 1e6 / window.cycle_us, min(SEGMENT, len(longest))
    shape = numpy.hanning(size)
    starts = range(0, len(longest) - size + 1, max(1, size // 2))
    power = numpy.mean([numpy.abs(numpy.fft.rfft(shape * longest[start:start + size])) ** 2 for start in starts], axis=0)
    return numpy.fft.rfftfreq(size, 1 / rate), numpy.sqrt(2 * power / (rate * numpy.sum(shape**2)))


def draw_spectrum(scenes: Sequence[Scene], axes: Sequence[str], path: Path) -> None:
    units = [unit for unit in ("deg", "mm") if any(UNITS[name] == unit for name in axes)]
    figure, panels = plt.subplots(len(units), len(scenes), squeeze=False, sharex=True, sharey="row", constrained_layout=True, figsize=(7.5 * len(scenes), 3.2 * len(units)))
    peaks = [LEAST_DENSITY] * len(units)
    for column, scene in enumerate(scenes):
        for row, unit in enumerate(units):
            panel = panels[row][column]
            for name in [name for name in axes if UNITS[name] == unit]:
                frequencies, density = spectrum_of(scene.window, name)
                peaks[row] = max(peaks[row], float(density[1:].max()))
                panel.loglog(frequencies[1:], numpy.maximum(density[1:], LEAST_DENSITY), color=colour_of(name, axes), linewidth=1, label=name)
            panel.set_ylim(peaks[row] / 10**DECADES, 3 * peaks[row])
            panel.set_ylabel(f"acceleration [{unit}/s²/√Hz]", fontsize=9)
            panel.grid(which="both", color="#000000", alpha=0.12, linewidth=0.6)
            panel.legend(fontsize=8, loc="best")
            panel.tick_params(labelsize=8)
        panels[0][column].set_title(scene.window.name, fontsize=10)
        panels[-1][column].set_xlabel("Hz")
    figure.savefig(path, dpi=130)
    plt.close(figure)
