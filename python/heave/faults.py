# SPDX-License-Identifier: MIT
"""faults.py - the faults of heaved by their numbers, which they keep. docs/faults.md says more about each."""
from __future__ import annotations

NAMES = ("", "drive-fault", "drive-offline", "drive-dropped", "drive-timeout", "bus-lost", "following-error", "bus-failing", "setpoint-jump", "estop-channels", "power-failing",
         "outside-stroke")


def fault_text(fault: int | str, axis: int | str = 0) -> str:
    """"6 following-error, axis 3", of a number or a name; one of a newer heaved by what is known of it."""
    word = str(fault)
    number = int(word) if word.isdigit() else NAMES.index(word) if word in NAMES else 0
    name = NAMES[number] if 0 < number < len(NAMES) else "" if word.isdigit() else word
    return " ".join(filter(None, [str(number) if number else "", name])) + (f", axis {axis}" if int(axis) else "")
