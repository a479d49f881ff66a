# SPDX-License-Identifier: MIT
"""rules.py - the rules a trace of set-points has to keep, and what each of them found. See command.py.

Positions are integers of 1e-9 mm or deg, as printed; differences of them are integers too, so no limit check involves rounding of its own.
"""
from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from heave.trace import NANO

Numbers = list[int]  # of a row: positions, 1e-9
Row = tuple[int, str, Numbers, str, str]  # t_us, state, numbers, relays, flags
Summary = tuple[str, str, str, float, int | None, int]  # name, limit, worst value, share of the limit, when, rows checked
ORDER_NAME = ("position", "speed", "accel", "jerk")
ORDER_UNIT = ("", "/s", "/s^2", "/s^3")
# A printed number is within half a unit of the ninth decimal of the true one (one unit if it was cut off), so that a k-th difference
# is within 2^(k-1) units of the true one: 1, 2, 4. That is the whole tolerance.
ROUNDING = (1, 1, 2, 4)


@dataclass
class Violation:
    rule: str
    column: str
    t_us: int
    line: int
    value: str
    limit: str

    def __str__(self) -> str:
        return f"t = {self.t_us / 1000:.3f} ms (line {self.line}): {self.column} {self.rule}: {self.value}, limit {self.limit}"


class Findings:
    """All that was found wrong; only the first ones are kept, and the first of each rule."""

    def __init__(self, kept: int) -> None:
        self.kept, self.count = kept, 0
        self.first: list[Violation] = []
        self.by_rule: dict[str, int] = {}

    def add(self, rule: str, column: str, t_us: int, line: int, value: str, limit: str) -> None:
        self.count += 1
        is_new = rule not in self.by_rule
        self.by_rule[rule] = self.by_rule.get(rule, 0) + 1
        if is_new or len(self.first) < self.kept:
            self.first.append(Violation(rule, column, t_us, line, value, limit))


def _columns_of(rows: Sequence[Row]) -> tuple[tuple[int, ...], tuple[str, ...], tuple[Numbers, ...], tuple[str, ...], tuple[str, ...]]:
    times, states, numbers, relays, flags = zip(*rows)
    return times, states, numbers, relays, flags


class Block:
    """Some consecutive rows, column-wise, with the differences up to the third of every column of numbers."""

    def __init__(self, rows: Sequence[Row], tail: Sequence[Numbers], first_line: int) -> None:
        self.times, self.states, self.rows, self.relays, self.flags = _columns_of(rows)
        self.count, self.first_line = len(rows), first_line
        self.columns: list[tuple[int, ...]] = list(zip(*tail, *self.rows))  # the three rows before stand in front of each column
        self.zeros = [0] * self.count
        self.magnitudes = [self._magnitudes(column) for column in self.columns]

    def _magnitudes(self, column: Sequence[int]) -> list[list[int]]:
        """[nothing, |first|, |second|, |third| difference], aligned with the rows."""
        if column.count(column[0]) == len(column):
            return [[], *[self.zeros] * 3]
        result: list[list[int]] = [[]]
        skip = 2
        for _ in range(3):
            column = list(map(int.__sub__, column[1:], column))
            result.append(list(map(abs, column[skip:])))
            skip -= 1
        return result

    def peak(self, columns: Iterable[int], order: int) -> list[int]:
        """The largest magnitude among the columns, row by row."""
        lists = [self.magnitudes[column][order] for column in columns if self.magnitudes[column][order] is not self.zeros] or [self.zeros]
        return lists[0] if len(lists) == 1 else list(map(max, *lists))

    def value(self, column: int, i: int) -> int:
        return self.columns[column][i + 3]

    def at(self, i: int) -> tuple[int, int]:
        """(t_us, line in the file) of a row."""
        return self.times[i], self.first_line + i


class RateRule:
    """A limit on a difference of one or several columns."""

    def __init__(self, name: str, columns: Sequence[int], names: Mapping[int, str], order: int, limit: Fraction, unit: str, cycle_us: int) -> None:
        self.name, self.columns, self.names, self.order, self.unit = name, columns, names, order, unit
        self.stated = limit
        self.per_cycle = limit * NANO * cycle_us**order / 10 ** (6 * order)
        self.most = math.floor(self.per_cycle + ROUNDING[order])
        self.worst = self.rows = 0
        self.worst_t_us: int | None = None

    def check(self, block: Block, peak: list[int], start: int, stop: int, findings: Findings, times: int = 1) -> None:
        """times: that the limit counts; rows with more than one are not part of the summary."""
        if start >= stop:
            return
        top = max(peak[start:stop])
        self.rows += stop - start if times == 1 else 0
        if times == 1 and (top > self.worst or self.worst_t_us is None):
            self.worst, self.worst_t_us = top, block.times[peak.index(top, start, stop)]
        if top > self.most * times:
            for i in range(start, stop):
                if peak[i] > self.most * times:
                    self._report(block, i, findings, times)

    def _report(self, block: Block, i: int, findings: Findings, times: int) -> None:
        for column in self.columns:
            magnitude = block.magnitudes[column][self.order][i]
            if magnitude > self.most * times:
                findings.add(self.name, self.names[column], *block.at(i), self.text(magnitude), ("" if times == 1 else f"{times} x ") + self.limit_text())

    def text(self, magnitude: int) -> str:
        return f"{float(magnitude * self.stated / self.per_cycle):.6f} {self.unit}{ORDER_UNIT[self.order]}"

    def limit_text(self) -> str:
        return f"{float(self.stated):g} {self.unit}{ORDER_UNIT[self.order]}"

    def summary(self) -> Summary:
        """(name, limit, worst value, share of the limit, when, rows checked)"""
        return (self.name, self.limit_text(), self.text(self.worst), float(self.worst / self.per_cycle), self.worst_t_us, self.rows)


class RangeRule:
    """Bounds of one column. A position may begin outside of them, where it was placed: then it may not go further out, but for slack,
    which is the noise of a pose that was solved from extensions. One that is placed while it moves may take its stopping distance."""

    def __init__(self, name: str, column: int, label: str, low: Fraction, high: Fraction, unit: str, slack: int = 0) -> None:
        self.name, self.column, self.label, self.unit, self.slack = name, column, label, unit, slack
        self.low_stated, self.high_stated = low, high
        self.low, self.high = math.floor(low * NANO), math.ceil(high * NANO)
        self.least: int | Fraction = self.low  # allowed now
        self.most: int | Fraction = self.high
        self.stopping_rows = 0  # as long as least and most hold whatever happens
        self.seen: tuple[int, int] | None = None  # least and greatest
        self.worst_t_us: int | None = None
        self.rows = 0

    def place(self, block: Block, i: int, accel: Fraction | None = None, jerk: Fraction | None = None, keeps: bool = False) -> None:
        """The rows up to i were not checked. accel and jerk, per cycle, are those it can stop with if it moves. keeps: what was allowed before
        still is."""
        value, before = block.value(self.column, i), (self.least, self.most)
        self.least, self.most, self.stopping_rows = min(self.low, value), max(self.high, value), 0
        if accel and jerk:
            push = block.magnitudes[self.column][2][i]
            speed = block.magnitudes[self.column][1][i] + push * push / (2 * jerk)
            self.stopping_rows = math.ceil(speed / accel + 2 * max(accel, Fraction(push)) / jerk) if speed else 0
            self.least, self.most = self.least - speed * self.stopping_rows, self.most + speed * self.stopping_rows
        if keeps:
            self.least, self.most = min(self.least, before[0]), max(self.most, before[1])

    def check(self, block: Block, start: int, stop: int, findings: Findings, keeps: bool = False) -> None:
        """keeps: whatever was allowed at first still is at the end."""
        if start >= stop:
            return
        values = block.columns[self.column][start + 3:stop + 3]
        low, high = min(values), max(values)
        self.rows += len(values)
        self._remember(block, values, low, high, start)
        if low >= self.low and high <= self.high:
            self.stopping_rows -= min(self.stopping_rows, len(values))
            if not self.stopping_rows and not keeps:
                self.least, self.most = self.low, self.high
            return
        for i, value in enumerate(values, start):
            if not self.low <= value <= self.high and not self.least - self.slack <= value <= self.most + self.slack:
                findings.add(self.name, self.label, *block.at(i), self.text(value), self.limit_text())
            if self.stopping_rows:
                self.stopping_rows -= 1
            elif not keeps:
                self.least, self.most = min(self.low, max(value, self.least)), max(self.high, min(value, self.most))

    def _remember(self, block: Block, values: Sequence[int], low: int, high: int, start: int) -> None:
        before = self.seen
        self.seen = seen = (low, high) if before is None else (min(low, before[0]), max(high, before[1]))
        if before is None or self._room(seen) < self._room(before):
            extreme = low if seen[0] - self.low <= self.high - seen[1] else high
            self.worst_t_us = block.times[start + values.index(extreme)]

    def _room(self, seen: tuple[int, int]) -> int:
        return min(seen[0] - self.low, self.high - seen[1])

    def text(self, value: int) -> str:
        return f"{value / NANO:.9f} {self.unit}"

    def limit_text(self) -> str:
        return f"{float(self.low_stated):g}..{float(self.high_stated):g} {self.unit}"

    def summary(self) -> Summary:
        if self.seen is None:
            return (self.name, self.limit_text(), "", 0.0, None, 0)
        middle, half = (self.low + self.high) / 2, max(1, (self.high - self.low) / 2)
        low, high = self.seen
        share = max(high - middle, middle - low) / half
        return (self.name, self.limit_text(), f"{low / NANO:.3f}..{high / NANO:.3f} {self.unit}", share,
                self.worst_t_us, self.rows)


class ErrorRule:
    """A deviation that must stay below a tolerance."""

    def __init__(self, name: str, tolerance: float, unit: str) -> None:
        self.name, self.tolerance, self.unit = name, tolerance, unit
        self.worst, self.rows = 0.0, 0
        self.worst_t_us: int | None = None

    def check(self, block: Block, i: int, label: str, error: float, findings: Findings) -> None:
        self.rows += 1
        if error > self.worst or self.worst_t_us is None:
            self.worst, self.worst_t_us = error, block.times[i]
        if not error <= self.tolerance:
            findings.add(self.name, label, *block.at(i), f"{error:.3g} {self.unit}", f"{self.tolerance:g} {self.unit}")

    def summary(self) -> Summary:
        return (self.name, f"{self.tolerance:g} {self.unit}", f"{self.worst:.3g} {self.unit}", self.worst / self.tolerance,
                self.worst_t_us, self.rows)
