# SPDX-License-Identifier: MIT
"""window.py - a window of a trace, column-wise, with differences computed from its nine-decimal integers. See command.py."""
from itertools import groupby

from heave.configuration import POSE_AXES
from heave.errors import HeaveError
from heave.trace import BEFORE_ZERO, COLUMNS, HEADER, NANO, ROW

NAMES = [column.rsplit("_", 1)[0] for column in COLUMNS]  # roll ... z, angle, c1 ... c6
UNITS = dict(zip(NAMES, (column.rsplit("_", 1)[1] for column in COLUMNS)))
CYLINDERS = NAMES[len(POSE_AXES) + 1:]
GROUPS = {"pose": list(POSE_AXES), "cylinders": CYLINDERS, "all": NAMES}
HIGHEST_ORDER = 3


class TraceError(HeaveError):
    """The file is no trace, or holds nothing of what was asked for."""


def axes_named(text):
    """["roll", "z"] of "roll,z"; the names of groups stand for their axes."""
    result = []
    for word in text.split(","):
        word = word.strip().removesuffix("_mm").removesuffix("_deg")
        if word not in GROUPS and word not in NAMES:
            raise ValueError(f"{word!r} is no axis: {', '.join(NAMES)}, or {', '.join(GROUPS)}")
        result += [name for name in GROUPS.get(word, [word]) if name not in result]
    return result


WITHOUT_LIMITS = ("OFF", "FAULT", "ESTOP")


class Window:
    """Rows from_us to to_us (either may be None). times_us, states and flags are lists; column(name) is one of integers of 1e-9."""

    def __init__(self, lines, from_us=None, to_us=None, name="trace"):
        self.name = name
        self.times_us, self.states, self.flags, self.rows, self._before = [], [], [], [], []
        lines = iter(lines)
        if next(lines, "").rstrip("\r\n") != HEADER:
            raise TraceError(f"{name}: line 1 is not the header of a trace: {HEADER[:40]}...")
        for number, line in enumerate(lines, 2):
            if line.endswith(BEFORE_ZERO):
                continue
            match = ROW.fullmatch(line)
            if not match:
                raise TraceError(f"{name}: line {number} is no row of a trace: {line.rstrip()[:60]}")
            whole, part, state, numbers, _, flags = match.groups()
            t_us = int(whole) * 1000 + (int(part.ljust(3, "0")) if part else 0)
            if to_us is not None and t_us > to_us:
                break
            row = list(map(int, numbers[:-1].replace(".", "").split(",")))
            if from_us is not None and t_us < from_us:
                self._before = [*self._before[1 - HIGHEST_ORDER:], (t_us, row)]
                continue
            self.times_us.append(t_us)
            self.states.append(state)
            self.flags.append(flags)
            self.rows.append(row)
        if not self.rows:
            raise TraceError(f"{name}: no row in the time asked for")
        times = [t_us for t_us, _ in self._before] + self.times_us
        self.cycle_us = min((b - a for a, b in zip(times, times[1:]) if b > a), default=1000)

    def column(self, name):
        index = NAMES.index(name)
        return [row[index] for row in self.rows]

    def is_used(self, name):
        return any(self.column(name))

    def rates(self, name, order):
        """The order-th rate in units per second^order, one per row; None where rows are missing before it."""
        index = NAMES.index(name)
        times = [t_us for t_us, _ in self._before] + self.times_us
        values = [row[index] for _, row in self._before] + self.column(name)
        for _ in range(order):
            values = [None] + [None if a is None or b is None else b - a for a, b in zip(values, values[1:])]
        scale = (10**6 / self.cycle_us)**order / NANO
        result, run = [], 0
        for i, value in enumerate(values):
            run = run + 1 if i and times[i] - times[i - 1] == self.cycle_us else 0
            result.append(value * scale if run >= order else None)
        return result[len(self._before):]

    def extent(self, names, order):
        """(least, most) of what is drawn where limits apply: in OFF, FAULT and ESTOP set-points jump to where the drives are. None: no such row."""
        free = 0
        least, most = None, None
        columns = [self.rates(name, order) for name in names]
        for i, state in enumerate(self.states):
            free = order + 1 if state in WITHOUT_LIMITS else max(0, free - 1)
            for value in (column[i] for column in columns if not free):
                if value is not None:
                    least, most = (value, value) if least is None else (min(least, value), max(most, value))
        return None if least is None else (least, most)

    def state_bands(self):
        """[(state, from_us, to_us)], each up to where the next begins."""
        return [(state, start, end) for state, start, end in self._spans(self.states)]

    def flag_bands(self):
        """{word: [(from_us, to_us)]} in the order in which they appear."""
        result = {}
        for words, start, end in self._spans(self.flags):
            for word in words.split("|") if words else []:
                bands = result.setdefault(word, [])
                if bands and bands[-1][1] == start:
                    bands[-1] = (bands[-1][0], end)
                else:
                    bands.append((start, end))
        return result

    def _spans(self, values):
        i = 0
        for value, group in groupby(values):
            start, i = i, i + sum(1 for _ in group)
            yield value, self.times_us[start], self.times_us[i] if i < len(self.times_us) else self.times_us[-1] + self.cycle_us


def thinned(times, values, most):
    """The same line with few enough points to draw, but every peak kept: first, least, greatest and last of each of most / 4 pieces. A piece
    with a None keeps one, so that the line breaks there."""
    if len(times) <= most:
        return times, values
    size = -(-len(times) * 4 // most)
    kept = []
    for start in range(0, len(times), size):
        piece = range(start, min(start + size, len(times)))
        known = [i for i in piece if values[i] is not None]
        missing = [i for i in piece if values[i] is None][:1]
        extremes = [known[0], min(known, key=values.__getitem__), max(known, key=values.__getitem__), known[-1]] if known else []
        kept += sorted({*extremes, *missing})
    return [times[i] for i in kept], [values[i] for i in kept]
