# SPDX-License-Identifier: MIT
"""feedback.py - what the drives said, from feedback.csv of an incident: where they were, and which faults came."""
from __future__ import annotations

import csv
from collections.abc import Iterable

from heave.faults import fault_text
from heave.plot.window import NAMES, TraceError


class Feedback:
    """actual: {"c1": [mm or None]} at times_us; faults: [(us, number and name)], each when it came. From time zero on, as traces are drawn."""

    def __init__(self, lines: Iterable[str], from_us: int | None = None, to_us: int | None = None, name: str = "feedback.csv") -> None:
        rows = csv.reader(lines)
        head = next(rows, [])
        if not head or head[0] != "t_ms" or head[-1] != "fault":
            raise TraceError(f"{name}: line 1 is not the header of a feedback.csv: t_ms, ..., fault")
        places = {}
        for i, column in enumerate(head):
            axis, _, unit = column.partition("_actual_")
            if unit and axis in NAMES:
                places[axis] = i
        self.times_us: list[int] = []
        self.actual: dict[str, list[float | None]] = {axis: [] for axis in places}
        self.faults: list[tuple[int, str]] = []
        newest_us, before = 0, ""
        for row in rows:
            try:
                t_us = round(float(row[0]) * 1000)
                values = {axis: float(row[i]) if row[i] and row[places[axis] - 1] != "offline" else None for axis, i in places.items()}
                fault = row[len(head) - 1]
            except (ValueError, IndexError):
                raise TraceError(f"{name}: line {rows.line_num} is no row of feedback: {','.join(row)[:60]}") from None
            if t_us < newest_us:  # time zero: what was before it belongs to no row of the trace that is drawn
                self._forget()
                before = ""
            newest_us = t_us
            if (from_us is not None and t_us < from_us) or (to_us is not None and t_us > to_us):
                continue
            self.times_us.append(t_us)
            for axis, value in values.items():
                self.actual[axis].append(value)
            if fault and fault != before:
                self.faults.append((t_us, fault_text(fault)))
            before = fault

    def _forget(self) -> None:
        self.times_us.clear()
        self.faults.clear()
        for values in self.actual.values():
            values.clear()
