#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_judge.py - the fast judge finds each kind of fault to the last printed decimal, and judges whatever trace as tools/check_trace does.

usage: test_judge.py --judge PROGRAM --heaved PROGRAM [--mutations N]
"""
import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(TOP / "python"), str(TOP / "tests/check")]
import synthetic_trace as synthetic  # noqa: E402  the path above has to be set first
import test_check_trace as slow  # noqa: E402
from heave.configuration import Configuration  # noqa: E402
from synthetic_trace import NANO, Trace  # noqa: E402
from heave.judge.checker import Checker  # noqa: E402

FOLDER = tempfile.TemporaryDirectory()
CONFIG = Path(FOLDER.name) / "platform.ini"
NOT_JUDGED = {"relays", "flags", "state", "settled extension", "neutral pose"}  # check_trace's alone
SPEED, ACCEL, JERK = 300_000_000, 3_000_000, 50_000  # of a cylinder, 1e-9 mm per cycle, cycle^2, cycle^3
Z_JERK = 40_000
SLICE_ROWS = 1500
SHIFTS = (1, 2, 3, 4, 5, 7, 10, 50, 1000, 10**5, 10**7, 10**9, 10**11)
MORE_GOLDEN = ("timed-moves", "mode-changes", "tripod-out-of-reach", "vendor-tripod")


class Judge:
    def __init__(self, program):
        self.program = program

    def broken(self, lines, config=CONFIG):
        """{rule: count}, and (rows, judged, of these poses)."""
        run = subprocess.run([self.program, config], input="".join(lines), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        assert run.returncode in (0, 1), run.stderr
        words, counts = [line.split(" ", 2) for line in run.stdout.splitlines()], {}
        for _, value, name in [parts for parts in words if parts[0] == "broken"]:
            counts[name] = counts.get(name, 0) + int(value)
        assert (run.returncode == 1) == bool(counts), f"exit status {run.returncode}, {counts}"
        numbers = {word: int(value) for word, value, *_ in words if word in ("rows", "judged", "pose")}
        return counts, (numbers["rows"], numbers["judged"], numbers["pose"])


def by_check_trace(lines, platform):
    checker = Checker(platform, every=1)
    checker.read(lines)
    counts = {rule: count for rule, count in checker.findings.by_rule.items() if rule not in NOT_JUDGED}
    return counts, (checker.rows, checker.rows - checker.following_rows, checker.pose_rows)


def expect_same(judge, lines, config=CONFIG, platform=None):
    lines = list(lines)
    fast, reference = judge.broken(lines, config), by_check_trace(lines, platform or Configuration(config))
    assert fast == reference, f"the judge: {fast}\ncheck_trace: {reference}"
    return fast[0]


# ---- one cylinder along a profile that reaches a limit exactly ----
def pushes(order, excess):
    """Accelerations up to full speed and down again: the limit of one order is exceeded by so many 1e-9, once and for nothing else."""
    rise = [JERK * k for k in range(1, ACCEL // JERK + 1)]
    fall = rise[-2::-1] + [0]
    flat = [ACCEL] * (40 if order == 1 else 10)
    if order == 1:
        fall[-2] += excess  # full speed and as much more
    elif order == 2:
        flat = [ACCEL + excess, *flat]
    else:
        rise[9] += excess
    up = rise + flat + fall
    return up + [0] * 20 + [-a for a in up] + [0] * 10


def ride(accelerations):
    trace = synthetic_rest("ENGAGED", "cylinders|no-pose")
    numbers, column, speed = trace.rows[-1][2], trace.column("c3_mm"), 0
    for accel in accelerations:
        speed += accel
        numbers = [*numbers[:column], numbers[column] + speed, *numbers[column + 1:]]
        trace.add("ENGAGED", numbers, flags="cylinders|no-pose")
    return trace


def synthetic_rest(state, flags, pose=(0, 0, 0, 0, 0, 0), rows=10):
    trace = Trace()
    trace.pose(state, pose, flags=flags)
    trace.repeat(rows)
    return trace


def creep(start):
    """A cylinder that goes 1e-9 mm each cycle, from below the end of its stroke to that far beyond."""
    trace = synthetic_rest("ENGAGED", "cylinders|no-pose")
    for row in trace.rows:
        row[2][8] = start
    for _ in range(5):
        trace.repeat(1)
        trace.rows[-1][2][8] += 1
    return trace


def expect(judge, lines, **rules):
    wanted = {name.replace("_", " "): count for name, count in rules.items()}
    found = expect_same(judge, lines)
    assert found == wanted, f"found {found}, expected {wanted}"


def check_last_decimals(suite, judge):
    CONFIG.write_text(synthetic.ini(), encoding="utf-8")
    for order, name, rounding in ((1, "speed", 1), (2, "accel", 2), (3, "jerk", 4)):
        with suite.case(f"{name} at the limit and what nine decimals are worth passes, 0.000000001 mm per cycle more is found"):
            expect(judge, ride(pushes(order, 0)).lines())
            expect(judge, ride(pushes(order, rounding)).lines())
            broken, _ = judge.broken(ride(pushes(order, rounding + 1)).lines())
            assert set(broken) == {f"cylinder {name}"}, broken
            expect_same(judge, ride(pushes(order, rounding + 1)).lines())
    with suite.case("the last 0.000000001 mm of the stroke passes, one more is found"):
        end = 199 * NANO
        expect(judge, creep(end - 5).lines())
        assert judge.broken(creep(end - 4).lines())[0] == {"c2_mm stroke": 1}
        expect_same(judge, creep(end - 4).lines())
    with suite.case("a cylinder beside its pose by 0.9 nm passes, by 1.1 nm is found"):
        for amount, count in ((900, 0), (1100, 11)):
            trace = synthetic_rest("HOLD", "")
            for row in trace.rows:
                row[2][9] += amount
            assert judge.broken(trace.lines())[0].get("pose and cylinders agree", 0) == count
    with suite.case("a jump of 0.000000001 mm in NEUTRAL is found, and one of 1 um in motion"):
        trace = synthetic_rest("NEUTRAL", "")
        trace.rows[-1][2][7] += 1
        assert judge.broken(trace.lines())[0] == {"rest": 1}
        trace = ride(pushes(1, 0))
        trace.rows[60][2][9] += 1000 * slow.NANOMETRE
        assert "cylinder jerk" in judge.broken(trace.lines())[0]


def check_pulled_in(suite, judge):
    """An axis that cylinder frames led out of its bounds comes in and goes out again."""
    CONFIG.write_text(synthetic.ini(), encoding="utf-8")
    for text, end, found in (("clamped", 94.0, False), ("clamped", 95.001, True), ("", 94.0, True), ("off-path", 150.0, False)):
        with suite.case(f"z placed at 95 mm, in to 80 and out to {end} of 90 allowed, flags {text or 'none'}: {'found' if found else 'fine'}"):
            trace = Trace()
            slow.slide(trace, "ENGAGED", slow.extension_of(0), slow.extension_of(95))
            for start, stop in ((95, 80), (80, end)):
                for i in range(2001):
                    trace.pose("ENGAGED", (0, 0, 0, 0, 0, start + (stop - start) * synthetic.smooth(i / 2000)), flags=text)
            broken = expect_same(judge, trace.lines())
            assert ("z position" in broken) == found, broken


def check_flags(suite, judge):
    """Where a pose is followed its limits count, whatever the flags say: the more loosely where cylinders pull the axes."""
    CONFIG.write_text(synthetic.ini(), encoding="utf-8")
    exactly, loosely, not_at_all = (True, True, True), (False, True, True), (False, False, False)  # jerk 1.3 times as large as the limit, position, jerk 9 times
    for text, found in (("", exactly), ("takeover", exactly), ("speed|accel|stretched", exactly), ("clamped", loosely), ("takeover|clamped", loosely),
                        ("off-path", (False, False, True)), ("takeover|off-path|clamped|accel", (False, False, True)),
                        ("cylinders", not_at_all), ("no-pose", not_at_all), ("cylinders|takeover", not_at_all)):
        for (name, times, end), is_found in zip((("jerk", 1.3, 89), ("position", 0, 91), ("jerk", 9, 89)), found):
            with suite.case(f"flags {text or 'none'}: z beyond its {name}{f', {times} times,' if times else ''} is {'found' if is_found else 'fine'}"):
                trace = Trace()
                for i in range(4001):
                    trace.pose("ENGAGED", (0, 0, 0, 0, 0, end * synthetic.smooth(i / 4000)), flags=text)
                trace.rows[2000][2][5] += round(times * Z_JERK / 3)  # in one row; the cylinders stay
                broken = expect_same(judge, trace.lines())
                assert (f"z {name}" in broken) == is_found, broken
    for age, count in ((0, 0), (1, 0), (2, 1), (3, 2)):
        with suite.case(f"off-path {age} rows before z is beyond its jerk: of the two differences {count} are found, those that do not go back there"):
            trace = Trace()
            for i in range(4001):
                trace.pose("ENGAGED", (0, 0, 0, 0, 0, 89 * synthetic.smooth(i / 4000)), flags="off-path" if i == 2000 - age else "")
            trace.rows[2000][2][5] += round(1.3 * Z_JERK / 3)
            broken = expect_same(judge, trace.lines())
            assert broken.get("z jerk", 0) == count, broken


def check_synthetic(suite, judge):
    CONFIG.write_text(synthetic.ini(), encoding="utf-8")
    with suite.case("a trace of every state, all of it within the limits, passes"):
        expect(judge, slow.good_day().lines())
    for name, (change, _) in slow.FAULTS.items():
        if "flag" not in name:
            with suite.case(f"{name}: as check_trace"):
                trace = slow.good_day()
                change(trace)
                expect_same(judge, trace.lines())
    for name, change in slow.MALFORMED.items():
        with suite.case(f"format: {name} is found"):
            assert "format" in judge.broken(slow.with_line(change))[0]
    for mover, (limits_of, build) in slow.MOVERS.items():
        for order, (name, over) in slow.ORDERS.items():
            with suite.case(f"{mover} {name} at the limit passes, {over - 1:.0%} over it is found: as check_trace"):
                expect(judge, build(synthetic.there_and_back(limits_of, order, 1)).lines())
                assert f"{mover} {name}" in expect_same(judge, build(synthetic.there_and_back(limits_of, order, over)).lines())


# ---- real traces with something wrong ----
def mutate(rows, chance):
    """One fault of some kind, somewhere; rows as printed."""
    which = chance.randrange(len(rows))
    row = rows[which].split(",")
    kind = chance.randrange(10)
    if kind < 7:
        shift = chance.choice(SHIFTS) * chance.choice((-1, 1))
        columns = [chance.randrange(2, 15)]
        stop = len(rows) if kind == 0 else which + 1  # from here on, or this row alone
        for i in range(which, stop):
            row = rows[i].split(",")
            for column in columns:
                value = round(float(row[column]) * NANO) if abs(float(row[column])) < 1000 else int(row[column].replace(".", ""))
                value += shift
                row[column] = f"{'-' if value < 0 else ''}{abs(value) // NANO}.{abs(value) % NANO:09d}"
            rows[i] = ",".join(row)
    elif kind == 7:
        del rows[which:which + chance.choice((1, 2, 10))]
    elif kind == 8:
        row[1] = chance.choice(("HOLD", "ENGAGED", "RISING", "NEUTRAL", "OFF", "ESTOP", "FAULT"))
        rows[which] = ",".join(row)
    else:
        row[-1] = chance.choice(("\n", "cylinders\n", "clamped\n", "no-pose\n", "takeover|off-path\n"))
        rows[which] = ",".join(row)


def real_trace(heaved, topic):
    frames, trace = TOP / f"tests/golden/{topic}.frames", Path(FOLDER.name) / f"{topic}.csv"
    config = TOP / "config" / frames.read_text(encoding="utf-8").split("\n", 1)[0].split("config", 1)[1].strip()
    subprocess.run([heaved, "--config", config, "--play", frames, "--trace", trace], stderr=subprocess.DEVNULL, check=True)
    header, *rows = trace.read_text(encoding="ascii").splitlines(keepends=True)
    return config, header, rows


def check_real(suite, judge, heaved, mutations):
    for topic in MORE_GOLDEN:
        config, header, rows = real_trace(heaved, topic)
        platform, chance, broken = Configuration(config), random.Random(topic), 0
        with suite.case(f"{topic}: nothing is found in the trace itself"):
            assert expect_same(judge, [header, *rows], config, platform) == {}
        with suite.case(f"{topic}: {mutations} traces with a fault each, judged as by check_trace"):
            for number in range(mutations):
                start = chance.randrange(max(1, len(rows) - SLICE_ROWS))
                part = rows[start:start + SLICE_ROWS]
                mutate(part, chance)
                try:
                    broken += bool(expect_same(judge, [header, *part], config, platform))
                except AssertionError as error:
                    raise AssertionError(f"mutation {number} of rows {start} on: {error}") from None
            assert broken > mutations / 4, f"only {broken} of {mutations} faults were any"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--judge", required=True)
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--mutations", type=int, default=40, help="of each real trace")
    arguments = parser.parse_args()
    suite, judge = tap.Suite(), Judge(arguments.judge)
    check_last_decimals(suite, judge)
    check_pulled_in(suite, judge)
    check_flags(suite, judge)
    check_synthetic(suite, judge)
    check_real(suite, judge, arguments.heaved, arguments.mutations)
    with suite.case("a configuration that lacks a limit is refused, and the message names it"):
        CONFIG.write_text(synthetic.ini(cylinders__jerk_mm_s3=None), encoding="utf-8")
        run = subprocess.run([arguments.judge, CONFIG], input="", capture_output=True, text=True, check=False)
        assert run.returncode == 2 and "jerk_mm_s3" in run.stderr, run.stderr
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
