# SPDX-License-Identifier: MIT
"""dots.py - where the frames of a FRAMES file ask the platform to be, for plots. Only well-formed frames of the V3.0 form give a dot."""
from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from heave.configuration import POSE_AXES, Configuration
from heave.recording import Line

FRAME = re.compile(r"@([AC])([3467])(T?):([^@#]*)#")
ORDER = {"A3": ["roll", "pitch", "z"], "A4": ["roll", "pitch", "z", "angle"], "A6": list(POSE_AXES), "A7": [*POSE_AXES, "angle"],
         "C3": ["c1", "c2", "c3"], "C6": [f"c{i + 1}" for i in range(6)], "C7": [*(f"c{i + 1}" for i in range(6)), "angle"]}


@dataclass
class Dot:
    t_us: int
    is_timed: bool
    values: dict[str, float]  # axis: asked, in its own unit


def dots_of(lines: Iterable[Line], platform: Configuration | None = None) -> list[Dot]:
    """The dots of recording.Line's. With a platform, values are those of its axes, and poses give extensions too."""
    result = []
    for line in lines:
        for space, number, timed, text in [] if line.is_request else FRAME.findall(line.text):
            values = _values(ORDER.get(space + number), text, bool(timed))
            if values:
                result.append(Dot(line.t_us, bool(timed), _asked(values, space, platform)))
    return result


def _values(names: list[str] | None, text: str, is_timed: bool) -> dict[str, float] | None:
    """{axis: number} or None; the last field is the mask or the time, a mask may be missing."""
    fields = [field.strip() for field in text.split(",")]
    if names is None or len(fields) not in ((len(names) + 1,) if is_timed else (len(names), len(names) + 1)):
        return None
    try:
        return dict(zip(names, map(float, fields)))
    except ValueError:
        return None


def _asked(values: dict[str, float], space: str, platform: Configuration | None) -> dict[str, float]:
    if platform is None:
        return values
    if space == "A":
        values = {**{name: 0.0 for name in POSE_AXES}, **values}
    asked = {name: _of_axis(platform, name, value) for name, value in values.items()}
    # the pose of a 3-RPS is not complete: what its hinges add is not known here
    if space == "A" and platform.kind != "tripod-3rps":
        pose = [asked[name] for name in POSE_AXES]
        asked.update((f"c{i + 1}", extension) for i, extension in enumerate(platform.extensions(pose)))
    return asked


def _of_axis(platform: Configuration, name: str, value: float) -> float:
    axis = platform.axes.get(name)
    if axis is None:
        return value if name.startswith("c") else 0.0
    return float(axis.sign * axis.scale) * value + float(axis.offset)
