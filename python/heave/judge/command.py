# SPDX-License-Identifier: MIT
"""command.py - proves row by row that a trace of set-points kept every limit of its configuration. Shares nothing with the core.

usage: heave check [--json] [--frames FRAMES] [--every N] CONFIG TRACE        (TRACE may be -)

CONFIG is what heaved ran with, TRACE what its --trace wrote. Numbers are read as integers of 1e-9, so that limit checks involve no rounding
of their own. The only tolerance is that of the nine printed decimals: 1, 1, 2 and 4 units of the last one for position, first, second and
third difference. Checked are:
  format       header, nine decimals, known states and flags; columns the platform does not have are zero
  time         every row one cycle after the one before; whole cycles may be missing before a row flagged late
  stroke       of each cylinder, margins included; where the platform was placed outside, it may not go further out
  rates        speed, acceleration and jerk of each cylinder and of the rotation motor, as finite differences
  pose axes    bounds, speed, acceleration and jerk, in all rows in which a pose is followed (without the flags cylinders and no-pose); in rows
               with off-path or clamped, where cylinders pull the axes, four times speed and acceleration, eight times jerk, and with off-path
               no bounds; an axis that comes from such rows outside its bounds, or moving, may take its stopping distance and go no further out
  rest         SETTLED and NEUTRAL do not move and are where the configuration says; HOLD, FAULT and OFF come to rest; a HOLD then stays
  engage       RISING and SETTLING: after the stop they begin with, engage speed and acceleration
  relays       the safe mask unless ENGAGED; never a line that the platform lacks
  kinematics   pose and cylinders agree by a solution in double precision (every Nth row, --every), and the guides allow the pose
  timed moves  with --frames: an isolated T frame in ENGAGED, from rest, arrives within a cycle of its time, unless flagged
In OFF, HOMING, ESTOP, and FAULT after the stop, set-points follow the actual positions: limits do not apply, the rows are counted.

Exit status: 0 no violation, 1 violations (the first 20 are named), 2 files that cannot be read or a setting that is not stated.
"""
from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from heave.configuration import ConfigError, Configuration
from heave.judge.checker import Checker
from heave.judge.timed import TimedWatcher
from heave.recording import read_frames
from heave.trace import COLUMNS, NANO


def parse_arguments(words: Sequence[str] | None, program: str | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=program, description="Checks every row of a trace against the limits of its configuration.")
    parser.add_argument("config", help="what heaved ran with")
    parser.add_argument("trace", help="what its --trace wrote, - for standard input")
    parser.add_argument("--frames", help="what it played: timed moves are checked too")
    parser.add_argument("--every", type=int, default=10, metavar="N", help="kinematics of every Nth row (default 10; 1 = all)")
    parser.add_argument("--json", action="store_true", help="the result as one JSON object")
    arguments = parser.parse_args(words)
    if arguments.every < 1:
        parser.error("--every must be 1 or more")
    return arguments


def check(arguments: argparse.Namespace) -> tuple[Checker, TimedWatcher | None]:
    platform = Configuration(arguments.config)
    timed = TimedWatcher(read_frames(arguments.frames), platform, COLUMNS) if arguments.frames else None
    checker = Checker(platform, every=arguments.every, watchers=[timed] if timed else [])
    if arguments.trace == "-":
        checker.read(sys.stdin)
    else:
        with open(arguments.trace, encoding="ascii", errors="replace", newline="\n") as file:
            checker.read(file)
    return checker, timed


def as_json(checker: Checker, timed: TimedWatcher | None) -> str:
    rules = [dict(zip(("rule", "limit", "worst", "share", "t_us", "rows"), summary)) for summary in checker.summaries()]
    result = {"rows": checker.rows, "following_rows": checker.following_rows, "pose_rows": checker.pose_rows,
              "states": checker.state_rows, "flags": checker.flag_rows,
              "violations": checker.findings.count, "by_rule": checker.findings.by_rule,
              "first": [vars(violation) for violation in checker.findings.first], "rules": rules}
    if timed:
        result["timed_moves"] = {"checked": timed.checked, "excused": timed.excused, "worst_error": timed.worst / NANO}
    return json.dumps(result, indent=1)


def print_report(checker: Checker, timed: TimedWatcher | None) -> None:
    print(f"{'rule':28} {'limit':>20} {'worst':>26} {'share':>9} {'at ms':>13} {'rows':>9}")
    for name, limit, worst, share, t_us, rows in checker.summaries():
        at = f"{t_us / 1000:.3f}" if t_us is not None else ""
        print(f"{name:28} {limit:>20} {worst:>26} {share:9.4%} {at:>13} {rows:9}")
    if timed:
        print(f"timed moves: {timed.checked} checked, worst error at the end {timed.worst / NANO:.9f}; {timed.excused} not expected to be in time")
    print(f"{checker.following_rows} rows in which set-points follow the actual positions: no limits there; "
          f"{checker.pose_rows} rows with limits of the pose axes")
    for violation in checker.findings.first:
        print(violation)
    if checker.findings.count > len(checker.findings.first):
        print(f"... and {checker.findings.count - len(checker.findings.first)} more: {checker.findings.by_rule}")
    print(f"{checker.rows} rows, {checker.findings.count} violations")


def main(words: Sequence[str] | None = None, program: str | None = None) -> int:
    arguments = parse_arguments(words, program)
    try:
        checker, timed = check(arguments)
    except (ConfigError, OSError, UnicodeError) as error:
        print(f"{program or 'check_trace'}: {error}", file=sys.stderr)
        return 2
    print(as_json(checker, timed)) if arguments.json else print_report(checker, timed)
    return 1 if checker.findings.count else 0
