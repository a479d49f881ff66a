# SPDX-License-Identifier: MIT
"""bode.py - draws measured frequency responses: gain and phase over frequency, of files with columns frequency_hz, gain, phase_deg and, where there are several, axis."""
from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from heave.plot.window import TraceError

Point = tuple[float, float, float]  # Hz, gain, degrees
Response = dict[str, list[Point]]
COLUMNS = ("frequency_hz", "gain", "phase_deg")
OF_WHOM = ("axis", "drive")


def read_response(lines: Iterable[str], name: str) -> Response:
    """{axis: [(Hz, gain, degrees)]} by rising frequency; "" where the file has one response."""
    rows = csv.reader(line for line in lines if not line.startswith("#"))
    head = [word.strip() for word in next(rows, [])]
    missing = [column for column in COLUMNS if column not in head]
    if missing:
        raise TraceError(f"{name}: line 1 has no column {missing[0]}; a frequency response has {', '.join(COLUMNS)}")
    who = next((head.index(column) for column in OF_WHOM if column in head), None)
    places = [head.index(column) for column in COLUMNS]
    result: Response = {}
    for row in rows:
        if not row:
            continue
        try:
            frequency, gain, phase = (float(row[place]) for place in places)
            label = "" if who is None else row[who]
        except (ValueError, IndexError):
            raise TraceError(f"{name}: line {rows.line_num} is no row of a frequency response: {','.join(row)[:60]}") from None
        if not (frequency > 0 and gain > 0 and math.isfinite(frequency + gain + phase)):
            raise TraceError(f"{name}: line {rows.line_num}: frequency and gain have to be above 0, not {frequency:g} Hz and {gain:g}")
        result.setdefault(label, []).append((frequency, gain, phase))
    if not result:
        raise TraceError(f"{name}: no row behind the header")
    return {label: sorted(points) for label, points in result.items()}


def unwrapped(degrees: Iterable[float]) -> list[float]:
    """The same phases without jumps of a turn."""
    result: list[float] = []
    for value in degrees:
        result.append(value if not result else value - 360 * round((value - result[-1]) / 360))
    return result


def bandwidth_hz(points: Sequence[Point]) -> float | None:
    """Where the gain falls below 1/sqrt(2) for the first time, between two points by their logarithms; None: it does not."""
    least = math.sqrt(0.5)
    for (f0, g0, _), (f1, g1, _) in zip(points, points[1:]):
        if g0 >= least > g1:
            share = math.log(g0 / least) / math.log(g0 / g1)
            return math.exp(math.log(f0) + share * (math.log(f1) - math.log(f0)))
    return None


def draw_bode(responses: Sequence[tuple[str, Response]], path: Path) -> None:
    """responses: [(name of the file, what read_response() gave)]."""
    import matplotlib.pyplot as plt

    from heave.plot.curves import COLOURS, LIMIT_COLOUR
    figure, (gains, phases) = plt.subplots(2, 1, sharex=True, constrained_layout=True, figsize=(9, 6.4))
    lines = [(name, label, points) for name, response in responses for label, points in response.items()]
    for i, (name, label, points) in enumerate(lines):
        frequencies, values, degrees = zip(*points)
        limit_hz = bandwidth_hz(points)
        text = " ".join([*([name] if len(responses) > 1 else []), label]).strip() or name
        style: dict[str, Any] = {"color": COLOURS[i % len(COLOURS)], "linewidth": 1.2, "marker": ".", "markersize": 4, "label": text + (f": -3 dB at {limit_hz:.3g} Hz" if limit_hz else "")}
        gains.semilogx(frequencies, [20 * math.log10(value) for value in values], **style)
        phases.semilogx(frequencies, unwrapped(degrees), **style)
    gains.axhline(-3, color=LIMIT_COLOUR, linewidth=0.8, linestyle=(0, (5, 3)))
    phases.axhline(-90, color=LIMIT_COLOUR, linewidth=0.8, linestyle=(0, (5, 3)))
    gains.set_ylabel("gain [dB]")
    phases.set_ylabel("phase [deg]")
    phases.set_xlabel("Hz")
    for panel in (gains, phases):
        panel.grid(which="both", color="#000000", alpha=0.12, linewidth=0.6)
        panel.tick_params(labelsize=8)
    gains.legend(fontsize=8, loc="lower left")
    gains.set_title(" and ".join(name for name, _ in responses), fontsize=10)
    figure.savefig(path, dpi=130)
    plt.close(figure)
