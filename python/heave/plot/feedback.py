# SPDX-License-Identifier: MIT
"""feedback.py - what the drives said, from feedback.csv of an incident: where they were, and when the first fault came."""
import csv

from heave.plot.window import NAMES, TraceError


class Feedback:
    """actual: {"c1": [mm or None]} at times_us; fault: (us, name) or None."""

    def __init__(self, lines, from_us=None, to_us=None, name="feedback.csv"):
        rows = csv.reader(lines)
        head = next(rows, [])
        if not head or head[0] != "t_ms" or head[-1] != "fault":
            raise TraceError(f"{name}: line 1 is not the header of a feedback.csv: t_ms, ..., fault")
        places = {}
        for i, column in enumerate(head):
            axis, _, unit = column.partition("_actual_")
            if unit and axis in NAMES:
                places[axis] = i
        self.times_us, self.actual, self.fault = [], {axis: [] for axis in places}, None
        for row in rows:
            try:
                t_us = round(float(row[0]) * 1000)
                values = {axis: float(row[i]) if row[i] and row[places[axis] - 1] != "offline" else None for axis, i in places.items()}
                fault = row[len(head) - 1]
            except (ValueError, IndexError):
                raise TraceError(f"{name}: line {rows.line_num} is no row of feedback: {','.join(row)[:60]}") from None
            if (from_us is not None and t_us < from_us) or (to_us is not None and t_us > to_us):
                continue
            self.times_us.append(t_us)
            for axis, value in values.items():
                self.actual[axis].append(value)
            if fault and self.fault is None:
                self.fault = (t_us, fault)
