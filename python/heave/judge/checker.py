# SPDX-License-Identifier: MIT
"""checker.py - walks through a trace row by row, in blocks, and applies the rules. See command.py.

Which rules hold depends on the state: in OFF, HOMING and ESTOP, and in FAULT after the stop, the set-points follow the actual positions and
are nobody's plan. Everything else is limited.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from fractions import Fraction
from itertools import groupby
from typing import Protocol

from heave.configuration import POSE_AXES, Configuration, Limits
from heave.judge.rules import ORDER_NAME, Block, ErrorRule, Findings, Numbers, RangeRule, RateRule, Row, Summary
from heave.trace import ANGLE, BEFORE_ZERO, COLUMNS, FIRST_CYLINDER, FLAGS, HEADER, NANO, ROW, STATES

LOOSE = "SERVICE, loose"                             # rows of SERVICE in which a drive has no torque, or moves by itself
FOLLOWING = {"OFF", "HOMING", LOOSE, "FAULT", "ESTOP"}  # the set-points follow the actual positions ...
STOPS_FIRST = {"OFF", "FAULT"}                       # ... in these once what still moves has come to rest
SWITCHED = {"ENGAGED", "SERVICE", LOOSE}              # relays are what the sender, or a hand, wants them to be
RESTING = {"SETTLED", "NEUTRAL"}
MOVING_GENTLY = {"RISING", "SETTLING"}
NOT_BEFORE_ENGAGED = {"OFF", "HOMING", "SETTLED", "SERVICE", LOOSE, "FAULT", "ESTOP"}
LATCHED = {"FAULT": {"FAULT", "ESTOP", "OFF"}, "ESTOP": {"ESTOP", "FAULT", "OFF"}}

NO_POSE = {"cylinders", "no-pose"}  # no pose is followed; the axes take over where such a row ends
PULLED = {"clamped", "off-path"}    # the axes are where the cylinders can be ...
PULLED_TIMES = {1: 4, 2: 4, 3: 8}   # ... and may move with so many times their limits: near singular poses a little of a cylinder is much of an axis

BLOCK_ROWS = 8192
REST_ROWS = 20  # as many equal rows are taken for rest, not for the slow start of a move
KINEMATICS_TOLERANCE_MM = 1e-6
POSE_NOISE = 10  # a pose at rest may be solved anew from the same extensions, in 1e-9


FlagFacts = tuple[bool, bool, bool, bool, bool, bool]


class Watcher(Protocol):
    """Looks at each block of rows when it has been checked."""

    def look(self, block: Block, checker: Checker) -> None: ...


class FlagTable(dict[str, FlagFacts]):
    """flags as printed -> (a pose is followed, pose bounds hold, has a pose, is well-formed, pose axes are pulled, is clamped); filled when asked."""

    def __missing__(self, text: str) -> FlagFacts:
        words = text.split("|") if text else []
        known = set(words)
        fine = known <= FLAGS and len(known) == len(words)
        is_followed = not known & NO_POSE
        self[text] = result = (is_followed, is_followed and "off-path" not in known, "no-pose" not in known, fine, known & PULLED != set(),
                               "clamped" in known)
        return result


class Checker:
    def __init__(self, platform: Configuration, every: int = 10, kept: int = 20, watchers: Sequence[Watcher] = (), block_rows: int = BLOCK_ROWS) -> None:
        self.platform, self.every, self.watchers, self.block_rows = platform, every, watchers, block_rows
        self.findings = Findings(kept)
        self.flag_table = FlagTable()
        self.rows = self.following_rows = self.pose_rows = 0
        self.state_rows: Counter[str] = Counter()
        self.flag_rows: Counter[str] = Counter()
        self.blocks_tail: list[Numbers] | None = None
        self.last_good: tuple[str, tuple[str, Numbers, str, str]] | None = None  # the last row, where it was good: its text behind the time, and what that says
        self.last_t_us: int | None = None
        self._make_rules(platform)

        self.state: str | None = None  # of the last row
        self.is_limited = False      # whether limits held in the last row
        self.age = 0                 # rows before the next one that limits held in, without a break
        self.pose_age = 0            # the same of the limits of the pose axes
        self.free_age = 0            # rows since one in which cylinders pulled the pose axes
        self.was_still = False       # the last row is the third equal one, or the first of all
        self.has_rested = False      # in this stay in the state, everything came to rest
        self.still_rows = 0
        self.is_stopping_anew = False  # RISING or SETTLING: in another controlled stop than the first
        self.last_speed = 0  # of the fastest cylinder in the last row
        self.is_placed_anew = False  # the next row is the first after set-points that followed the actual positions
        self.state_since_us: int | None = None

    # ---- set-up ----
    def _make_rules(self, platform: Configuration) -> None:
        names = dict(enumerate(COLUMNS))
        used = range(FIRST_CYLINDER, FIRST_CYLINDER + platform.cylinders)
        self.cylinders = list(used)
        self.movers = self.cylinders + ([ANGLE] if platform.has_angle else [])
        self.constant_zero = [i for i in range(ANGLE, len(COLUMNS)) if i not in self.movers]

        def rate(name: str, columns: list[int], order: int, limit: Fraction, unit: str) -> RateRule:
            return RateRule(name, columns, names, order, limit, unit, platform.cycle_us)

        def rates(label: str, columns: list[int], limits: Limits) -> list[RateRule]:
            stated = (limits.speed, limits.accel, limits.jerk)
            return [rate(f"{label} {ORDER_NAME[order]}", columns, order, limit, limits.unit) for order, limit in enumerate(stated, 1)]

        self.strokes = [RangeRule(f"{COLUMNS[c]} stroke", c, COLUMNS[c], platform.margin, stroke - platform.margin, "mm")
                        for c, stroke in zip(self.cylinders, platform.strokes)]
        self.cylinder_rates = rates("cylinder", self.cylinders, platform.limits)
        self.engage_rates = [rate("engage speed", self.cylinders, 1, platform.engage_speed, "mm"),
                             rate("engage accel", self.cylinders, 2, platform.engage_accel, "mm")]
        self.angle_rates: list[RateRule] = []
        self.angle_range: RangeRule | None = None
        self.pose_rates: list[list[RateRule]] = []
        self.pose_ranges: list[RangeRule] = []
        for name, axis in platform.axes.items():
            column = COLUMNS.index(f"{name}_{axis.unit}")
            slack = 0 if name == "angle" else int(KINEMATICS_TOLERANCE_MM * NANO)
            bounds = RangeRule(f"{name} position", column, COLUMNS[column], axis.low, axis.high, axis.unit, slack)
            if name == "angle":
                self.angle_rates, self.angle_range = rates(name, [column], axis), bounds
            else:
                self.pose_rates.append(rates(name, [column], axis))
                self.pose_ranges.append(bounds)
        self.kinematics = ErrorRule("pose and cylinders agree", KINEMATICS_TOLERANCE_MM, "mm")
        self.guide = ErrorRule("pose is one the guides allow", KINEMATICS_TOLERANCE_MM, "mm or deg")
        slowest = max((limits.speed / limits.accel + limits.accel / limits.jerk) for limits in (platform.limits, *platform.axes.values()))
        self.rest_within_us = int(3 * slowest * 10**6) + 1_000_000

    # ---- reading ----
    def read(self, file: Iterable[str]) -> None:
        """Checks a whole trace; file yields its lines."""
        lines = iter(file)
        header = next(lines, "")
        if header != HEADER + "\n":
            self.findings.add("format", "header", 0, 1, header.strip()[:60], HEADER[:60] + "...")
        rows: list[Row] = []
        first_line = 2
        for number, line in enumerate(lines, 2):
            if line.endswith(BEFORE_ZERO):
                first_line = number + 1
                continue
            row = self._parse(line, number)
            if row:
                rows.append(row)
            if not row or len(rows) == self.block_rows:
                self._block(rows, first_line)
                rows, first_line = [], number + 1
        self._block(rows, first_line)
        if not self.rows:
            self.findings.add("format", "trace", 0, 1, "no row", "at least one")

    def _parse(self, line: str, number: int) -> Row | None:
        time, _, rest = line.partition(",")
        if self.last_good and rest == self.last_good[0] and time.isascii() and time.isdecimal():  # most rows of most traces are like the one before
            return int(time) * 1000, *self.last_good[1]
        self.last_good = None
        match = ROW.fullmatch(line)
        if not match or "-0.000000000" in match[4] or match[3] not in STATES:
            self.findings.add("format", "row", self.last_t_us or 0, number, line.rstrip("\n")[:80], "the header's columns, nine decimals each")
            return None
        whole, part, state, numbers, relays, flags = match.groups()
        t_us = int(whole) * 1000 + (int(part.ljust(3, "0")) if part else 0)
        state = LOOSE if state == "SERVICE" and "loose" in flags.split("|") else state
        parsed = (state, list(map(int, numbers[:-1].replace(".", "").split(","))), relays, flags)
        self.last_good = rest, parsed
        return t_us, *parsed

    # ---- one block ----
    def _block(self, rows: list[Row], first_line: int) -> None:
        if not rows:
            return
        block = Block(rows, self.blocks_tail or [rows[0][2]] * 3, first_line)
        self._check_time(block)
        self._check_constant_zero(block)
        self.flag_facts = [self.flag_table[text] for text in block.flags]
        for i, facts in enumerate(self.flag_facts):
            if not facts[3]:
                self.findings.add("flags", "flags", *block.at(i), block.flags[i], "known words, each once")
        self.peaks: list[list[int]] = [[], *(block.peak(self.cylinders, order) for order in (1, 2, 3))]
        self.movement = block.peak(self.movers, 1)
        self.pose_movement = block.peak(range(ANGLE), 1)
        self.restless = list(map(max, self.movement, block.peak(self.movers, 2)))

        start = 0
        for state, group in groupby(block.states):
            stop = start + sum(1 for _ in group)
            self._check_run(block, state, start, stop)
            start = stop
        self._check_kinematics(block)
        self.state_rows.update(block.states)
        for text, count in Counter(block.flags).items():
            self.flag_rows.update({word: count for word in text.split("|") if word})
        for watcher in self.watchers:
            watcher.look(block, self)
        self.rows += block.count
        self.blocks_tail = ([*(self.blocks_tail or [rows[0][2]] * 3), *block.rows])[-3:]
        self.last_t_us, self.last_speed = block.times[-1], self.peaks[1][-1]

    def _check_time(self, block: Block) -> None:
        times = block.times if self.last_t_us is None else (self.last_t_us, *block.times)
        steps = list(map(int.__sub__, times[1:], times))
        if set(steps) - {self.platform.cycle_us}:
            shift = block.count - len(steps)
            for i, step in enumerate(steps):
                skipped_some = "late" in block.flags[i + shift].split("|") and step > 0 and step % self.platform.cycle_us == 0
                if step != self.platform.cycle_us and not skipped_some:
                    self.findings.add("time", "t_ms", *block.at(i + shift), f"{step} us after the row before", f"{self.platform.cycle_us} us")

    def _check_constant_zero(self, block: Block) -> None:
        for column in self.constant_zero:
            for i, value in enumerate(block.columns[column][3:]):
                if value:
                    self.findings.add("format", COLUMNS[column], *block.at(i), f"{value / NANO:.9f}", "0, the platform has none")

    # ---- a run of rows in the same state ----
    def _check_run(self, block: Block, state: str, start: int, stop: int) -> None:
        if state != self.state:
            self._enter(block, state, start)
        limited_until = self._limited_until(block, state, start, stop)
        self._check_limits(block, start, limited_until)
        self._check_pose(block, start, limited_until)
        if limited_until < stop:
            self._follow(block, stop)
            self.following_rows += stop - limited_until
        self._check_rest(block, state, start, stop)
        self._check_relays(block, state, start, stop)
        self.is_placed_anew = False
        self.was_still = self.restless[stop - 1] == 0

    def _enter(self, block: Block, state: str, i: int) -> None:
        before, self.state = self.state, state
        if before is None:
            self.was_still = True
        if before in LATCHED and state not in LATCHED[before]:
            self.findings.add("state", "state", *block.at(i), f"{before} -> {state}", "latched until OFF")
        if state == "ENGAGED" and before in NOT_BEFORE_ENGAGED:
            self.findings.add("state", "state", *block.at(i), f"{before} -> {state}", "by way of RISING")
        if state not in FOLLOWING:
            self.is_limited = True
        elif state not in STOPS_FIRST:
            self.is_limited = False
        self.state_since_us = block.times[i]
        self.has_rested, self.still_rows, self.is_stopping_anew = False, 0, False
        self.is_placed_anew = before in FOLLOWING
        self._check_place(block, state, i)

    def _check_place(self, block: Block, state: str, i: int) -> None:
        """In the resting states the platform is where the configuration says, in full width."""
        if state == "SETTLED":
            for column in self.cylinders:
                error = abs(block.value(column, i) - self.platform.settled * NANO)
                if error > 1:
                    self.findings.add("settled extension", COLUMNS[column], *block.at(i), f"{block.value(column, i) / NANO:.9f} mm",
                                      f"{float(self.platform.settled):.9f} mm")
        if state == "NEUTRAL":
            for name in self.platform.free_axes:
                column = POSE_AXES.index(name)
                value = block.value(column, i) / NANO
                if abs(value - float(self.platform.neutral[column])) > KINEMATICS_TOLERANCE_MM:
                    self.findings.add("neutral pose", COLUMNS[column], *block.at(i), f"{value:.9f}", f"{float(self.platform.neutral[column]):.9f}")

    def _limited_until(self, block: Block, state: str, start: int, stop: int) -> int:
        """The row from which on set-points follow the actual positions."""
        if not self.is_limited:
            return start
        if state in STOPS_FIRST:
            i = self._first_still(start, stop)
            if i is not None:
                self.is_limited = False
                return i + 1
            self._check_rest_comes(block, stop - 1)
        return stop

    def _first_still(self, start: int, stop: int) -> int | None:
        try:
            return self.restless.index(0, start, stop)
        except ValueError:
            return None

    def _check_rest_comes(self, block: Block, i: int) -> None:
        if self.state_since_us is not None and block.times[i] - self.state_since_us > self.rest_within_us:
            self.findings.add("rest", "state", *block.at(i), f"{block.states[i]}: no rest since {self.state_since_us / 1000:.3f} ms",
                              f"{self.rest_within_us / 1000:.0f} ms")
            self.state_since_us = None

    def _check_limits(self, block: Block, start: int, stop: int) -> None:
        if start >= stop:
            return
        if self.age == 0:
            for rule in self._position_rules():
                rule.place(block, start)
        # a speed needs one row before it, placed or not; higher differences need rows that limits held in
        for order, rows_needed in ((1, 0), (2, 2), (3, 3)):
            first = start + max(0, rows_needed - self.age)
            self.cylinder_rates[order - 1].check(block, self.peaks[order], first, stop, self.findings)
            for angle_rule in self.angle_rates[order - 1:order]:
                angle_rule.check(block, block.magnitudes[ANGLE][order], first, stop, self.findings)
        for rule in self._position_rules():
            rule.check(block, start, stop, self.findings)
        self.age += stop - start

    def _position_rules(self) -> list[RangeRule]:
        return self.strokes + ([self.angle_range] if self.angle_range else [])

    def _check_pose(self, block: Block, start: int, stop: int) -> None:
        """Limits and bounds of the pose axes, over the rows whose flags say that they hold. An axis that came in from outside its bounds may
        be pulled in further with the others (clamped), and then go back out to where it would have been."""
        i = start
        for facts, group in groupby(self.flag_facts[start:stop]):
            end = i + sum(1 for _ in group)
            if facts[1]:
                for rule in self.pose_ranges:
                    rule.check(block, i, end, self.findings, keeps=facts[5])
            else:
                self._place_pose(block, end - 1, keeps=facts[0])
            if facts[0]:
                self._check_pose_rates(block, i, end, facts[4])
            else:
                self.pose_age = 0
            self.free_age = 0 if facts[4] else self.free_age + end - i
            i = end

    def _check_pose_rates(self, block: Block, start: int, stop: int, is_pulled: bool) -> None:
        self.pose_rows += stop - start
        for axis in self.pose_rates:
            for rule in axis:
                first = start + max(0, rule.order - self.pose_age)
                free = stop if is_pulled else min(stop, max(first, start + max(0, rule.order - self.free_age)))
                magnitudes = block.magnitudes[rule.columns[0]][rule.order]
                rule.check(block, magnitudes, first, free, self.findings, PULLED_TIMES[rule.order])
                rule.check(block, magnitudes, free, stop, self.findings)
        self.pose_age += stop - start

    def _follow(self, block: Block, stop: int) -> None:
        self.age = self.pose_age = 0
        self._place_pose(block, stop - 1)

    def _place_pose(self, block: Block, i: int, keeps: bool = False) -> None:
        for rule, rates in zip(self.pose_ranges, self.pose_rates):
            rule.place(block, i, rates[1].per_cycle, rates[2].per_cycle, keeps)

    # ---- rest, engage speed, relays ----
    def _check_rest(self, block: Block, state: str, start: int, stop: int) -> None:
        if state in RESTING:
            self._expect_no_movement(block, start + self.is_placed_anew, stop)
        elif state == "HOLD":
            self._check_hold(block, start, stop)
        elif state in MOVING_GENTLY:
            self._check_gentle(block, start, stop)

    def _expect_no_movement(self, block: Block, start: int, stop: int) -> None:
        for label, movement, most in ((" cylinders or angle", self.movement, 0), (" pose", self.pose_movement, POSE_NOISE)):
            if start < stop and max(movement[start:stop]) > most:
                for i in range(start, stop):
                    if movement[i] > most:
                        self.findings.add("rest", block.states[i] + label, *block.at(i), f"{movement[i]}e-9 in a cycle", "at rest")

    def _check_hold(self, block: Block, start: int, stop: int) -> None:
        i = start
        while i < stop and not self.has_rested:
            self.still_rows = 0 if self.restless[i] else self.still_rows + 1
            self.has_rested = self.still_rows >= REST_ROWS
            i += 1
        if self.has_rested:
            self._expect_no_movement(block, i, stop)
        else:
            self._check_rest_comes(block, stop - 1)

    def _check_gentle(self, block: Block, start: int, stop: int) -> None:
        first = start
        if not self.has_rested:
            self.has_rested = self.was_still
            if not self.has_rested:
                still = self._first_still(start, stop)
                if still is None:
                    self._check_rest_comes(block, stop - 1)
                    return
                self.has_rested, first = True, still + 1
        speed, accel = self.engage_rates
        speed.check(block, self.peaks[1], first, stop, self.findings)
        if not self.is_stopping_anew and (first >= stop or max(self.peaks[2][first:stop]) <= accel.most):
            accel.check(block, self.peaks[2], first, stop, self.findings)
        else:
            for i in range(first, stop):
                self._check_gentle_accel(block, i, accel)

    def _check_gentle_accel(self, block: Block, i: int, rule: RateRule) -> None:
        """A hold and a park in the same cycle leave no HOLD to be seen, but a controlled stop: slowing down may be harder, until rest."""
        if self.peaks[2][i] > rule.most and self.peaks[1][i] < (self.peaks[1][i - 1] if i else self.last_speed):
            self.is_stopping_anew = True
        if not self.is_stopping_anew:
            rule.check(block, self.peaks[2], i, i + 1, self.findings)
        elif self.restless[i] == 0:
            self.is_stopping_anew = False

    def _check_relays(self, block: Block, state: str, start: int, stop: int) -> None:
        platform = self.platform
        for text in set(block.relays[start:stop]):
            value = int(text, 16)
            is_free = state in SWITCHED
            if value & ~platform.relay_mask if is_free else value != platform.safe_mask:
                limit = f"within {platform.relay_mask:04X}" if is_free else f"{platform.safe_mask:04X} in {state}"
                for i in range(start, stop):
                    if block.relays[i] == text:
                        self.findings.add("relays", "relays", *block.at(i), text, limit)

    # ---- kinematics ----
    def _check_kinematics(self, block: Block) -> None:
        sampled = set(range(-self.rows % self.every, block.count, self.every))
        changes = [i for i in range(1, block.count) if block.flags[i] is not block.flags[i - 1] and block.flags[i] != block.flags[i - 1]]
        sampled.update(changes)
        for i in sorted(sampled):
            if self.flag_facts[i][2]:
                self._check_pose_of_row(block, i)

    def _check_pose_of_row(self, block: Block, i: int) -> None:
        row = block.rows[i]
        pose = [value / NANO for value in row[:len(POSE_AXES)]]
        errors = [abs(expected - row[column] / NANO) for column, expected in zip(self.cylinders, self.platform.extensions(pose))]
        worst = max(errors)
        self.kinematics.check(block, i, COLUMNS[self.cylinders[errors.index(worst)]], worst, self.findings)
        if self.platform.kind != "hexapod":
            self.guide.check(block, i, "pose", self.platform.guide_error(pose), self.findings)

    # ---- result ----
    def summaries(self) -> list[Summary]:
        rules: list[RangeRule | RateRule | ErrorRule] = [*self.strokes, *self.cylinder_rates, *self.engage_rates]
        if self.angle_range:
            rules += [self.angle_range, *self.angle_rates]
        for bounds, rates in zip(self.pose_ranges, self.pose_rates):
            rules += [bounds, *rates]
        rules.append(self.kinematics)
        if self.platform.kind != "hexapod":
            rules.append(self.guide)
        return [rule.summary() for rule in rules]
