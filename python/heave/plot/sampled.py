# SPDX-License-Identifier: MIT
"""sampled.py - samples as `heavectl scope > FILE` writes them, as the lines of a trace and of a feedback.csv: what plots read. See docs/samples.md for the columns."""
from __future__ import annotations

import csv
from collections.abc import Iterable

from heave.faults import fault_text
from heave.plot.window import NAMES, TraceError
from heave.trace import COLUMNS, HEADER

STATES = ("OFF", "HOMING", "SETTLED", "RISING", "NEUTRAL", "ENGAGED", "HOLD", "SETTLING", "SERVICE", "FAULT", "ESTOP")
FLAGS = ("clamped", "speed", "accel", "stretched", "takeover", "cylinders", "off-path", "no-pose")  # from bit 0 on
HAS_POSE = 4  # of the column bits
OFFLINE = 0   # of the columns drive1 ...
SENT = {f"sent_{column}": column for column in COLUMNS}
ACTUAL = {f"actual_{column}": name for name, column in zip(NAMES, COLUMNS)}
UNKNOWN_STATE = "ENGAGED"  # of samples without the column: drawn on white


def is_sampled(first_line: str) -> bool:
    """Whether a file that begins so holds samples."""
    head = first_line.rstrip("\r\n").split(",")
    return "t_ms" in head and any(column in SENT or column in ACTUAL for column in head)


class Sampled:
    """Of a file, or of what somebody chose of the columns: t_ms is needed, and one of sent_."""

    def __init__(self, lines: Iterable[str], name: str = "samples") -> None:
        rows = csv.reader(lines)
        self.head = next(rows, [])
        if "t_ms" not in self.head or not any(column in SENT for column in self.head):
            raise TraceError(f"{name}: samples are drawn over t_ms, and from the columns sent_...: take both, or all: heavectl scope > FILE")
        self.trace = [f"{HEADER}\n"]
        self.feedback: list[str] = []
        self._actual = [column for column in self.head if column in ACTUAL]
        if self._actual:
            told = [f"{ACTUAL[column]}_state,{ACTUAL[column]}_actual_{column.rsplit('_', 1)[1]}" for column in self._actual]
            self.feedback.append(",".join(["t_ms", *told, "fault"]) + "\n")
        for row in rows:
            try:
                self._take(dict(zip(self.head, row, strict=True)))
            except (ValueError, IndexError, KeyError):
                raise TraceError(f"{name}: line {rows.line_num} is no row of samples: {','.join(row)[:60]}") from None

    def _take(self, row: dict[str, str]) -> None:
        t_ms = f"{float(row['t_ms']):.3f}"
        state = STATES[int(row["state"])] if "state" in row else UNKNOWN_STATE
        numbers = ",".join(f"{float(row.get(f'sent_{column}', 0)):.9f}" for column in COLUMNS)
        bits = int(row.get("flags", 0))
        flags = "|".join(word for i, word in enumerate(FLAGS) if bits >> i & 1)
        self.trace.append(f"{t_ms},{state},{numbers},{int(row.get('relays', 0)) & 0xFFFF:04X},{flags}\n")
        if self._actual:
            fault = int(row.get("fault", 0))
            told = [f"{'' if self._is_told(row, ACTUAL[column]) else 'offline'},{row[column]}" for column in self._actual]
            self.feedback.append(",".join([t_ms, *told, f'"{fault_text(fault, row.get("fault_axis", 0))}"' if fault else ""]) + "\n")

    @staticmethod
    def _is_told(row: dict[str, str], name: str) -> bool:
        """Whether the position is one: cylinders of drives that are there, a pose that they make."""
        if name.startswith("c"):
            return int(row.get(f"drive{name[1:]}", OFFLINE + 1)) != OFFLINE
        return name == "angle" or "bits" not in row or bool(int(row["bits"]) & HAS_POSE)
