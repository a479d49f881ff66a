# SPDX-License-Identifier: MIT
"""timed.py - do isolated timed moves arrive when they were asked to? A watcher of checker.Checker.

Only moves that leave no doubt are looked at: a single well-formed T frame, the platform ENGAGED and at rest, no other line near it. A move
that the trace flags as stretched, clamped or taken over is not expected to be in time.
"""
from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from heave.configuration import POSE_AXES, UNIT, Configuration
from heave.judge.rules import Block, Numbers
from heave.recording import Line
from heave.trace import NANO

if TYPE_CHECKING:
    from heave.judge.checker import Checker

Candidate = tuple[int, int, dict[str, int]]  # t_us, T_us, {column name: target in 1e-9}
FRAME = re.compile(r"@([AC])([3467])T:([-+0-9.,]+),(\d+)#[\r\n\0 ]*")
EXCUSES = {"stretched", "takeover", "clamped"}
QUIET_US = 300_000          # before the frame: so that it cannot pass for a sample of a stream
AFTER_US = 20_000           # after the move: nothing may end it early
TOLERANCE = NANO // 10_000  # 0.1 um or 0.0001 deg at the end
EARLY_SHARE = 0.9           # at this share of the time ...
EARLY_LEFT = 1e-4           # ... at least this much of the way is left
WORTH_CHECKING = NANO // 10


def candidates(lines: Sequence[Line], platform: Configuration) -> list[Candidate]:
    """(t_us, T_us, {column name: target in 1e-9}) of each isolated timed frame."""
    found: list[Candidate] = []
    line_us: int | None = None
    frame_us: int | None = None
    for i, line in enumerate(lines):
        quiet = QUIET_US if line_us is None else line.t_us - line_us
        period = None if frame_us is None else line.t_us - frame_us
        line_us, frame_us = line.t_us, frame_us if line.is_request else line.t_us
        match = FRAME.fullmatch(line.text)
        if not match:
            continue
        move_us = int(match[4]) * 1000
        after = lines[i + 1].t_us - line.t_us if i + 1 < len(lines) else None
        # a time near the period of arrival makes it a sample of a stream
        is_alone = quiet >= QUIET_US and (period is None or not period / 2 <= move_us <= period * 2)
        if move_us and is_alone and (after is None or after > move_us + AFTER_US):
            target = targets(match, platform)
            if target:
                found.append((line.t_us, move_us, target))
    return found


def targets(match: re.Match[str], platform: Configuration) -> dict[str, int] | None:
    """{column name: target}, or None where the frame is not for this platform."""
    space, number, text, _ = match.groups()
    try:
        values = [Fraction(part) for part in text.split(",")]
    except ValueError:
        return None
    names = {("A", "3"): ["roll", "pitch", "z"], ("A", "4"): ["roll", "pitch", "z", "angle"], ("A", "6"): list(POSE_AXES),
             ("A", "7"): [*POSE_AXES, "angle"]}.get((space, number), [f"c{i + 1}" for i in range(min(int(number), 6))])
    if (space, number) == ("C", "7"):
        names = [*names, "angle"]
    cylinders = {"C3": 3, "C6": 6, "C7": 6, "A6": 6, "A7": 6}.get(space + number, platform.cylinders)
    if cylinders != platform.cylinders or len(values) != len(names) or ("angle" in names and not platform.has_angle):
        return None
    if space == "A":
        given = dict(zip(names, values))
        complete = [*platform.free_axes, *(["angle"] if "angle" in given else [])]
        return {f"{name}_{UNIT[name]}": axis_target(name, given.get(name, Fraction(0)), platform)
                for name in complete if name != "angle" or platform.wrap == "as-sent"}
    low, high = platform.margin, min(platform.strokes) - platform.margin
    result = {f"{name}_mm": int(min(max(value, low), high) * NANO) for name, value in zip(names, values) if name != "angle"}
    if "angle" in names and platform.wrap == "as-sent":
        result["angle_deg"] = axis_target("angle", values[-1], platform)
    return result


def axis_target(name: str, sent: Fraction, platform: Configuration) -> int:
    axis = platform.axes[name]
    asked = axis.sign * axis.scale * sent + axis.offset
    return int(min(max(asked, axis.low), axis.high) * NANO)


class TimedWatcher:
    """Follows the candidates through the blocks; what it needs of a row is taken when it passes."""

    def __init__(self, lines: Sequence[Line], platform: Configuration, columns: Sequence[str]) -> None:
        self.platform, self.columns = platform, columns
        self.waiting = candidates(lines, platform)
        self.open: list[Move] = []
        self.checked = self.excused = 0
        self.worst = 0
        self.worst_t_us: int | None = None

    def look(self, block: Block, checker: Checker) -> None:
        t0, cycle = block.times[0], self.platform.cycle_us
        end = block.times[-1] + cycle
        while self.waiting and self.waiting[0][0] < end:
            self.open.append(Move(*self.waiting.pop(0)))

        def index(t_us: int) -> int:
            """The first row at or after a time."""
            return -(-(t_us - t0) // cycle)

        for move in self.open:
            move.look(block, index, checker, self)
        self.open = [move for move in self.open if not move.is_over]

    def judge(self, move: Move, block: Block, i: int, checker: Checker) -> None:
        if not move.is_clean or not move.is_at_rest or move.words & EXCUSES:
            self.excused += 1
            return
        self.checked += 1
        for name, target in move.target.items():
            column = self.columns.index(name)
            error = abs(block.value(column, i) - target)
            if error > self.worst or self.worst_t_us is None:
                self.worst, self.worst_t_us = error, block.times[i]
            if error > TOLERANCE:
                checker.findings.add("timed move is late", name, *block.at(i), f"{error / NANO:.6f} short", f"{TOLERANCE / NANO:g} at its end")
            if move.at_start is None or move.at_early is None:  # rows are missing
                continue
            way, left = abs(target - move.at_start[column]), abs(target - move.at_early[column])
            if way > WORTH_CHECKING and left < EARLY_LEFT * way:
                checker.findings.add("timed move is early", name, *block.at(i), f"{left / NANO:.6f} left",
                                     f"at least {EARLY_LEFT * way / NANO:.6f} at {EARLY_SHARE:.0%} of the time")


class Move:
    def __init__(self, t_us: int, move_us: int, target: dict[str, int]) -> None:
        self.t_us, self.move_us, self.target = t_us, move_us, target
        self.words: set[str] = set()
        self.is_clean, self.is_at_rest, self.is_over = True, False, False
        self.at_start: Numbers | None = None
        self.at_early: Numbers | None = None

    def look(self, block: Block, index: Callable[[int], int], checker: Checker, watcher: TimedWatcher) -> None:
        start, early = index(self.t_us), index(self.t_us + int(EARLY_SHARE * self.move_us))
        last = index(self.t_us + self.move_us) + 1
        low, high = max(0, start), min(block.count, last + 1)
        self.is_clean = self.is_clean and set(block.states[low:high]) <= {"ENGAGED"}
        for text in set(block.flags[low:high]):
            self.words.update(text.split("|"))
        if 0 <= start < block.count:
            self.at_start = block.rows[start]
            # of the row before the frame's own: that one may move already
            self.is_at_rest = start > 0 and checker.restless[start - 1] == 0
        if 0 <= early < block.count:
            self.at_early = block.rows[early]
        if last < block.count:
            self.is_over = True
            watcher.judge(self, block, last, checker)
