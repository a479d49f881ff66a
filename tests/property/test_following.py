#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_following.py - platforms go where they are sent: streams of every rate with jitter, losses and T, steps, changes of space.

usage: test_following.py --heaved PROGRAM --judge PROGRAM [--rides N] [--seed N] [--seeds N] [--odd] [--keep DIR]

make_streams.py sends, tests/judge judges: range, steady streams, rest on the last frame. The limits are judged along the way.
"""
import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
CONFIGS = ("demo-hexapod", "hexapod-400", "tripod")
PATIENT = {"engage": "manual", "silence_hold_ms": "0", "silence_neutral_ms": "0", "silence_settle_ms": "0"}
RIDES = 14


def make_config(name, folder):
    lines = []
    for line in (TOP / f"config/{name}.ini").read_text(encoding="utf-8").splitlines():
        key = line.split("=")[0].strip()
        lines.append(f"{key} = {PATIENT[key]}" if key in PATIENT else line)
    path = folder / f"{name}.ini"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


class Ride:
    """One seed on one platform."""

    def __init__(self, arguments, name, seed, folder):
        self.config, self.frames = make_config(name, folder), folder / f"{name}-{seed}.frames"
        self.heaved, self.judge = arguments.heaved, arguments.judge
        with open(self.frames, "w", encoding="ascii") as file:
            subprocess.run([sys.executable, TOP / "tests/property/make_streams.py", self.config, str(seed), str(arguments.rides), *(["--odd"] if arguments.odd else [])],
                           stdout=file, check=True)

    def judged(self):
        """What the judge prints."""
        with tempfile.TemporaryFile("w+") as log:
            with subprocess.Popen([self.heaved, "--config", self.config, "--play", self.frames, "--trace", "-"], stdout=subprocess.PIPE,
                                  stderr=log) as heaved:
                judge = subprocess.run([self.judge, self.config, self.frames], stdin=heaved.stdout, stdout=subprocess.PIPE, text=True, check=False)
                heaved.stdout.close()
            log.seek(0)
            assert heaved.returncode == 0 and judge.returncode in (0, 1), f"heaved ended with {heaved.returncode}, the judge with {judge.returncode}: {log.read()}"
        return judge.stdout.splitlines()


def figures(lines, word):
    """{rule: number}"""
    parts = [line.split(" ", 2) for line in lines if line.startswith(f"{word} ")]
    return {name: float(number) for _, number, name in parts}


def check(ride, again, totals):
    lines = ride.judged()
    for rule, number in figures(lines, "followed").items():
        assert number > 0, f"{rule}: nothing to judge"
        totals[rule] = totals.get(rule, 0) + int(number)
    broken = figures(lines, "broken")
    assert not broken, "\n".join([f"{broken}, farthest {figures(lines, 'beyond')}", *[line for line in lines if line.startswith("found ")], again])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--judge", required=True)
    parser.add_argument("--rides", type=int, default=RIDES)
    parser.add_argument("--seed", type=int, default=1, help="the first")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--odd", action="store_true", help="also what is known not to be followed, see make_streams.py")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave frames and configurations there")
    a = parser.parse_args()
    suite, totals = tap.Suite(), {}
    with tempfile.TemporaryDirectory(prefix="heave-") as temporary:
        folder = a.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for seed in range(a.seed, a.seed + a.seeds):
            for name in CONFIGS:
                again = (f"again: PYTHONPATH=tests/lib python3 tests/property/test_following.py --heaved {a.heaved} --judge {a.judge} "
                         f"--rides {a.rides} --seed {seed} --keep DIR")
                with suite.case(f"{name}, seed {seed}: it goes where {a.rides} senders send it"):
                    check(Ride(a, name, seed, folder), again, totals)
    for rule, number in totals.items():
        print(f"# figure {number} values of set-points judged by where frames send them: {rule}")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
