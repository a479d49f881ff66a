# SPDX-License-Identifier: MIT
"""frames.py - the text of the frames of protocol V3.0."""
from __future__ import annotations

import math
from collections.abc import Sequence

from heave.errors import FrameError

POSE = ("roll", "pitch", "yaw", "x", "y", "z")
CYLINDERS = ("c1", "c2", "c3", "c4", "c5", "c6")
COMMANDS: dict[str, tuple[str, ...]] = {
    "A3": ("roll", "pitch", "z"), "A4": ("roll", "pitch", "z", "angle"), "A6": POSE, "A7": (*POSE, "angle"),
    "C3": CYLINDERS[:3], "C6": CYLINDERS, "C7": (*CYLINDERS, "angle"),
}
TIME_MAX_MS = 3_600_000
MASK_MAX = 0xFFFF
VALUE_END = 32768  # Q16.16


def _number(name: str, value: float) -> str:
    if isinstance(value, bool) or not isinstance(value, (int, float)) and not hasattr(value, "__float__"):
        raise FrameError(f"{name}: {value!r} is no number")
    number = float(value)
    if not math.isfinite(number) or not -VALUE_END <= number < VALUE_END:
        raise FrameError(f"{name}: {value!r} is not within -{VALUE_END} and {VALUE_END}")
    return repr(int(number)) if number.is_integer() else repr(number)


def frame(command: str, values: Sequence[float], *, mask: int | None = None, time_ms: float | None = None) -> str:
    """`frame("A6", (5, 6, 0, 5.5, 3, 20), mask=0xF0)` is "@A6:5,6,0,5.5,3,20,F0#".

    mask: the relays that are to be closed, bit 0 is relay 1; None leaves them as they are. time_ms makes a T frame: arrive in that time."""
    names = COMMANDS.get(command)
    if names is None:
        raise FrameError(f"{command!r} is no command; there are {', '.join(COMMANDS)}")
    if len(values) != len(names):
        raise FrameError(f"{command} takes {len(names)} values ({', '.join(names)}), not {len(values)}")
    fields = [_number(f"{command} {name}", value) for name, value in zip(names, values)]
    if time_ms is not None:
        if mask is not None:
            raise FrameError(f"{command}T has no mask: relays stay as they are")
        if not 0 <= time_ms <= TIME_MAX_MS:
            raise FrameError(f"time_ms: {time_ms!r} is not within 0 and {TIME_MAX_MS}")
        return f"@{command}T:{','.join([*fields, str(round(time_ms))])}#"
    if mask is not None:
        if not isinstance(mask, int) or not 0 <= mask <= MASK_MAX:
            raise FrameError(f"mask: {mask!r} is not within 0 and 0x{MASK_MAX:X}")
        fields.append(f"{mask:X}")
    return f"@{command}:{','.join(fields)}#"
