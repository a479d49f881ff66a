# SPDX-License-Identifier: MIT
"""window.py - a window of a trace, column-wise, with differences computed from its nine-decimal integers. See command.py."""
from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from heave.configuration import POSE_AXES
from heave.errors import HeaveError
from heave.trace import BEFORE_ZERO, COLUMNS, HEADER, NANO, ROW

NAMES = [column.rsplit("_", 1)[0] for column in COLUMNS]  # roll ... z, angle, c1 ... c6
UNITS = dict(zip(NAMES, (column.rsplit("_", 1)[1] for column in COLUMNS)))
CYLINDERS = NAMES[len(POSE_AXES) + 1:]
GROUPS = {"pose": list(POSE_AXES), "cylinders": CYLINDERS, "all": NAMES}
HIGHEST_ORDER = 3
MOST_LETTERS = 14  # of a request's label


class TraceError(HeaveError):
    """The file is no trace, or holds nothing of what was asked for."""


def axes_named(text: str) -> list[str]:
    """["roll", "z"] of "roll,z"; the names of groups stand for their axes."""
    result: list[str] = []
    for word in text.split(","):
        word = word.strip().removesuffix("_mm").removesuffix("_deg")
        if word not in GROUPS and word not in NAMES:
            raise ValueError(f"{word!r} is no axis: {', '.join(NAMES)}, or {', '.join(GROUPS)}")
        result += [name for name in GROUPS.get(word, [word]) if name not in result]
    return result


WITHOUT_LIMITS = ("OFF", "FAULT", "ESTOP")


class Window:
    """Rows from_us to to_us (either may be None). times_us, states and flags are lists; column(name) is one of integers of 1e-9."""

    def __init__(self, lines: Iterable[str], from_us: int | None = None, to_us: int | None = None, name: str = "trace") -> None:
        self.name = name
        self.times_us: list[int] = []
        self.states: list[str] = []
        self.flags: list[str] = []
        self.rows: list[list[int]] = []
        self._before: list[tuple[int, list[int]]] = []
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

    def column(self, name: str) -> list[int]:
        index = NAMES.index(name)
        return [row[index] for row in self.rows]

    def is_used(self, name: str) -> bool:
        return any(self.column(name))

    def rates(self, name: str, order: int) -> list[float | None]:
        """The order-th rate in units per second^order, one per row; None where rows are missing before it."""
        index = NAMES.index(name)
        times = [t_us for t_us, _ in self._before] + self.times_us
        values: list[int | None] = [*(row[index] for _, row in self._before), *self.column(name)]
        for _ in range(order):
            values = [None, *(None if a is None or b is None else b - a for a, b in zip(values, values[1:]))]
        scale = float(10**6 / self.cycle_us)**order / NANO
        result: list[float | None] = []
        run = 0
        for i, value in enumerate(values):
            run = run + 1 if i and times[i] - times[i - 1] == self.cycle_us else 0
            result.append(value * scale if value is not None and run >= order else None)
        return result[len(self._before):]

    def extent(self, names: Iterable[str], order: int) -> tuple[float, float] | None:
        """(least, most) of what is drawn where limits apply: in OFF, FAULT and ESTOP set-points jump to where the drives are. None: no such row."""
        free = 0
        extent: tuple[float, float] | None = None
        columns = [self.rates(name, order) for name in names]
        for i, state in enumerate(self.states):
            free = order + 1 if state in WITHOUT_LIMITS else max(0, free - 1)
            for value in (column[i] for column in columns if not free):
                if value is not None:
                    extent = (value, value) if extent is None else (min(extent[0], value), max(extent[1], value))
        return extent

    def state_bands(self) -> list[tuple[str, int, int]]:
        """[(state, from_us, to_us)], each up to where the next begins."""
        return [(state, start, end) for state, start, end in self._spans(self.states)]

    def flag_bands(self) -> dict[str, list[tuple[int, int]]]:
        """{word: [(from_us, to_us)]} in the order in which they appear."""
        result: dict[str, list[tuple[int, int]]] = {}
        for words, start, end in self._spans(self.flags):
            for word in words.split("|") if words else []:
                bands = result.setdefault(word, [])
                if bands and bands[-1][1] == start:
                    bands[-1] = (bands[-1][0], end)
                else:
                    bands.append((start, end))
        return result

    def _spans(self, values: Iterable[str]) -> Iterator[tuple[str, int, int]]:
        i = 0
        for value, group in groupby(values):
            start, i = i, i + sum(1 for _ in group)
            yield value, self.times_us[start], self.times_us[i] if i < len(self.times_us) else self.times_us[-1] + self.cycle_us


def thinned(times: list[float], values: list[float | None], most: int) -> tuple[list[float], list[float | None]]:
    """The same line with few enough points to draw, but every peak kept: first, least, greatest and last of each of most / 4 pieces. A piece
    with a None keeps one, so that the line breaks there."""
    if len(times) <= most:
        return times, values
    size = -(-len(times) * 4 // most)
    kept: list[int] = []
    for start in range(0, len(times), size):
        piece = range(start, min(start + size, len(times)))
        known = {i: value for i, value in ((i, values[i]) for i in piece) if value is not None}
        missing = [i for i in piece if values[i] is None][:1]
        extremes = [min(known), min(known, key=known.__getitem__), max(known, key=known.__getitem__), max(known)] if known else []
        kept += sorted({*extremes, *missing})
    return [times[i] for i in kept], [values[i] for i in kept]


def labels_of(requests: Sequence[tuple[int, str]], room_us: float) -> list[tuple[int, str]]:
    """One label where requests would cover each other: the first of them, and how many more there are."""
    groups: list[list[tuple[int, str]]] = []
    for t_us, text in requests:
        if groups and t_us - groups[-1][0][0] < room_us:
            groups[-1].append((t_us, text))
        else:
            groups.append([(t_us, text)])
    return [(group[0][0], shortened(group[0][1]) + (f" +{len(group) - 1}" if len(group) > 1 else "")) for group in groups]


def shortened(text: str) -> str:
    return text if len(text) <= MOST_LETTERS else text[:MOST_LETTERS - 1].rstrip() + "…"
