#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_limits.py - whatever is sent, the set-points keep every limit: hostile input through heaved --play, every cycle judged.

usage: test_limits.py --heaved PROGRAM --judge PROGRAM --config INI [--cycles N] [--seed N] [--seeds N] [--slowly ROWS] [--keep DIR]

Seeds are tried one after the other, from --seed on, until N cycles have been judged (or --seeds of them). What a seed is played on follows
from its number: the platform as it is, other cycle times, with and without a rotation motor, the other style of streams. tests/judge judges
each row of all seeds; tools/check_trace the first rows of the first ones again, until it has seen timed moves, and both have to count the same.

A longer hunt:   test_limits.py ... --seed 1000 --cycles 1000000000
One seed again:  test_limits.py ... --seed N --seeds 1 --keep DIR      leaves FRAMES, configuration and trace there, for tools/check_trace
"""
import argparse
import json
import re
import subprocess
import sys
import tempfile
from collections import Counter
from itertools import islice
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "python"))
from heave.configuration import Configuration  # noqa: E402  the path above has to be set first

DATAGRAMS = 3000
FAILURES_MAX = 3
SLOWLY_ROWS = 60_000  # of a seed, by check_trace: it takes twenty times as long as the judge
# what a run of many cycles has to come across, or the input does not test what it should
STATES = {"SETTLED", "RISING", "NEUTRAL", "ENGAGED", "HOLD", "SETTLING", "OFF", "HOMING", "ESTOP"}
FLAGS = {"clamped", "speed", "accel", "stretched", "takeover", "cylinders", "off-path", "estop", "silent"}
SILENCE_MS = 1000
MANY_CYCLES = 300_000
MOTOR = {"present": "yes", "wrap": "as-sent", "min_deg": "-540", "max_deg": "540", "speed_deg_s": "75", "accel_deg_s2": "150", "jerk_deg_s3": "900"}


class Unplayable(Exception):
    """heaved or a checker did not run to its end."""


def variants(platform):
    """What seeds are played on, in turn: {section: {key: value}}, None instead of a section that goes."""
    has_sim_drives = platform.ini.get("drives", {}).get("driver", "sim") == "sim"  # others name each drive, and a motor is one more
    wrap = {"angle": {"wrap": "as-sent" if platform.wrap == "shortest" else "shortest"}} if platform.has_angle else {}
    return [{},
            {"platform": {"cycle_us": "500"}},
            {"angle": None if platform.has_angle else MOTOR} if has_sim_drives else {},
            {"platform": {"cycle_us": "4000"}},
            {"udp": {"stream": "balanced"}, **wrap}]


def with_changes(text, changes):
    """A configuration with keys replaced, or added where they are missing, or sections left out."""
    for section, keys in changes.items():
        pattern = re.compile(rf"^\[{section}\]\n(?:(?!\[).*\n)*", re.MULTILINE)
        if keys is None:
            text = pattern.sub("", text)
            continue
        for key, value in keys.items():
            part = pattern.search(text)
            if not part:
                text += f"\n[{section}]\n{key} = {value}\n"
                continue
            body = re.sub(rf"^{key} *=.*\n", "", part[0], flags=re.MULTILINE)
            text = text[:part.start()] + body.rstrip("\n") + f"\n{key} = {value}\n\n" + text[part.end():]
    return text


def describe(changes):
    words = [f"{key} = {value}" for keys in changes.values() if keys for key, value in keys.items() if keys is not MOTOR]
    words += [{True: "without a motor", False: "with a motor"}[changes["angle"] is None]] if changes.get("angle", {}) in (None, MOTOR) else []
    return ", ".join(words) or "as it is"


def generator_options(platform):
    """What the generator has to know of the platform."""
    options = ["--kind", "hexapod" if platform.kind == "hexapod" else "tripod", "--stroke", str(float(max(platform.strokes))),
               "--centre", str(float(-platform.axes["z"].offset))]
    return options + (["--motor"] if platform.has_angle else [])


def expected_flags(platform):
    """Some platforms are patient with silent senders, more than the input is silent."""
    patience_ms = int(platform.ini.get("udp", {}).get("silence_hold_ms", "0"))
    return FLAGS if 0 < patience_ms <= SILENCE_MS else FLAGS - {"silent"}


class Verdict:
    """What the judge printed."""

    def __init__(self, text):
        self.rows = self.judged = self.pose = 0
        self.states, self.flags, self.broken, self.worst, self.found = Counter(), Counter(), Counter(), {}, []
        for line in text.splitlines():
            word, rest = line.split(" ", 1)
            value, _, name = rest.partition(" ")
            if word in ("rows", "judged", "pose"):
                setattr(self, word, int(value))
            elif word == "found":
                self.found.append(rest)
            elif word == "worst":
                self.worst[name] = float(value)
            else:
                {"state": self.states, "flag": self.flags, "broken": self.broken}[word][name] += int(value)


class Seed:
    """One seed, its files in a folder."""

    def __init__(self, programs, config, number, folder):
        self.heaved, self.judge, self.number = *programs, number
        self.frames, self.ini, self.trace = folder / "frames", folder / "platform.ini", folder / "trace.csv"
        changes = variants(Configuration(config))[(number - 1) % 5]
        self.ini.write_text(with_changes(config.read_text(encoding="utf-8"), changes), encoding="utf-8")
        with open(self.frames, "w", encoding="utf-8") as file:
            subprocess.run([sys.executable, TOP / "tests/property/make_frames.py", str(number), str(DATAGRAMS), *generator_options(Configuration(self.ini))],
                           stdout=file, check=True)

    def play_command(self, trace):
        return [self.heaved, "--config", self.ini, "--play", self.frames, "--trace", trace]

    def play_and_judge(self):
        """Row by row through a pipe, no file between."""
        with tempfile.TemporaryFile("w+") as log:
            with subprocess.Popen(self.play_command("-"), stdout=subprocess.PIPE, stderr=log) as heaved:
                judge = subprocess.run([self.judge, self.ini], stdin=heaved.stdout, capture_output=True, text=True, check=False)
                heaved.stdout.close()
            log.seek(0)
            if heaved.returncode != 0 or judge.returncode not in (0, 1):
                raise Unplayable(f"heaved ended with {heaved.returncode}, the judge with {judge.returncode}:\n{log.read()}{judge.stderr}")
        return Verdict(judge.stdout)

    def check_slowly(self, most):
        """The first rows by tools/check_trace, timed moves included, and what the judge says of the same rows."""
        subprocess.run(self.play_command(self.trace), stderr=subprocess.DEVNULL, check=True)
        part = self.trace.with_name("part.csv")
        with open(self.trace, encoding="ascii") as rows, open(part, "w", encoding="ascii") as first_rows:
            first_rows.writelines(islice(rows, 1 + most))
        with open(part, encoding="ascii") as rows:
            judge = subprocess.run([self.judge, self.ini], stdin=rows, capture_output=True, text=True, check=False)
        check = subprocess.run([sys.executable, TOP / "tools/check_trace", "--json", "--frames", self.frames, self.ini, part],
                               stdout=subprocess.PIPE, text=True, check=False)
        if check.returncode not in (0, 1):
            raise Unplayable("check_trace could not check")
        return json.loads(check.stdout), Verdict(judge.stdout)


class Hunt:
    """All seeds of a run."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.seeds = self.cycles = self.pose_cycles = self.timed_moves = 0
        self.states, self.flags = Counter(), Counter()

    def goes_on(self, suite):
        most = self.arguments.seeds
        return suite.failed < FAILURES_MAX and (self.seeds < most if most else self.cycles < self.arguments.cycles)

    def again(self, number):
        a = self.arguments
        return f"PYTHONPATH=tests/lib python3 tests/property/test_limits.py --heaved {a.heaved} --judge {a.judge} --config {a.config} --seed {number} --seeds 1 --keep DIR"

    def judge(self, seed):
        verdict = seed.play_and_judge()
        self.cycles += verdict.judged
        self.pose_cycles += verdict.pose
        self.states.update(verdict.states)
        self.flags.update(verdict.flags)
        assert verdict.rows > DATAGRAMS, f"only {verdict.rows} cycles"
        assert not verdict.broken, "\n".join([f"{dict(verdict.broken)}", *verdict.found, f"again: {self.again(seed.number)}"])
        return verdict

    def compare(self, seed):
        slow, verdict = seed.check_slowly(self.arguments.slowly)
        self.timed_moves += slow["timed_moves"]["checked"]
        first = "\n".join(f"t_us {v['t_us']}: {v['column']} {v['rule']}: {v['value']}, limit {v['limit']}" for v in slow["first"])
        assert not slow["violations"], f"{slow['by_rule']}\n{first}\nagain: {self.again(seed.number)}"
        counts = slow["rows"], slow["rows"] - slow["following_rows"], slow["pose_rows"]
        assert counts == (verdict.rows, verdict.judged, verdict.pose), f"rows, judged, of these poses: {counts}, the judge says {vars(verdict)}"

    def run_seed(self, suite, number, folder):
        a, name, verdict = self.arguments, self.arguments.config.stem, None
        what = describe(variants(Configuration(a.config))[(number - 1) % 5])
        with suite.case(f"{name}, {what}, seed {number}: no limit is exceeded in any cycle"):
            seed = Seed((a.heaved, a.judge), a.config, number, folder)
            verdict = self.judge(seed)
        if verdict and not self.timed_moves:
            with suite.case(f"{name}, seed {number}: check_trace judges the same first rows and finds nothing either"):
                self.compare(seed)
        self.seeds += 1

    def check_coverage(self, suite):
        platform, name = Configuration(self.arguments.config), self.arguments.config.stem
        with suite.case(f"{name}: the {self.cycles} cycles came across every state, every flag and timed moves"):
            assert STATES <= set(self.states), f"not seen: {STATES - set(self.states)}"
            assert expected_flags(platform) <= set(self.flags), f"not seen: {expected_flags(platform) - set(self.flags)}"
            assert self.timed_moves > 0
            assert self.seeds >= len(variants(platform)), f"only {self.seeds} seeds, not every variant"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--judge", required=True)
    parser.add_argument("--config", required=True, type=Path)
    parser.add_argument("--cycles", type=int, default=MANY_CYCLES, help="to be judged")
    parser.add_argument("--seed", type=int, default=1, help="the first")
    parser.add_argument("--seeds", type=int, help="so many, whatever the cycles")
    parser.add_argument("--slowly", type=int, default=SLOWLY_ROWS, metavar="ROWS", help="so many rows of a seed by check_trace")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="leave the last seed's files there")
    arguments = parser.parse_args()
    suite, hunt = tap.Suite(), Hunt(arguments)
    with tempfile.TemporaryDirectory() as name:
        folder = arguments.keep or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        while hunt.goes_on(suite):
            hunt.run_seed(suite, arguments.seed + hunt.seeds, folder)
    if not arguments.seeds and arguments.cycles >= MANY_CYCLES and not suite.failed:
        hunt.check_coverage(suite)
    print(f"# figure {hunt.cycles} cycles of hostile input judged through heaved --play\n"
          f"# figure {hunt.pose_cycles} of these also by the limits of the pose axes")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
