#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_limits.py - whatever is sent, the set-points keep every limit: hostile input through heaved --play, every row of the trace checked.

usage: test_limits.py --heaved PROGRAM --config INI [--cycles N] [--first-seed N]

Seeds are tried one after the other until N cycles have been checked. A failing seed can be looked at with
  tests/property/make_frames.py SEED 3000 ... >frames;  heaved --config INI --play frames --trace out.csv;  tools/check_trace INI out.csv
"""
import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
from platform_ini import Platform  # noqa: E402  the path above has to be set first

DATAGRAMS = 3000
# what a run of many cycles has to come across, or the input does not test what it should
STATES = {"SETTLED", "RISING", "NEUTRAL", "ENGAGED", "HOLD", "SETTLING", "OFF", "HOMING", "ESTOP"}
FLAGS = {"clamped", "speed", "accel", "stretched", "takeover", "cylinders", "off-path", "estop", "silent"}
SILENCE_MS = 1000
MANY_CYCLES = 300_000


def generator_options(platform):
    """What the generator has to know of the platform."""
    options = ["--kind", "hexapod" if platform.kind == "hexapod" else "tripod", "--stroke", str(float(max(platform.strokes))),
               "--centre", str(float(-platform.axes["z"].offset))]
    return options + (["--motor"] if platform.has_angle else [])


def expected_flags(platform):
    """Some platforms are patient with silent senders, more than the input is silent."""
    patience_ms = int(platform.ini.get("udp", {}).get("silence_hold_ms", "0"))
    return FLAGS if 0 < patience_ms <= SILENCE_MS else FLAGS - {"silent"}


def play(heaved, config, options, seed, folder):
    """Runs one seed; the checker's result."""
    frames, trace = folder / "frames", folder / "trace.csv"
    with open(frames, "w", encoding="utf-8") as file:
        subprocess.run([sys.executable, TOP / "tests/property/make_frames.py", str(seed), str(DATAGRAMS), *options], stdout=file, check=True)
    run = subprocess.run([heaved, "--config", config, "--play", frames, "--trace", trace], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                         text=True, check=False)
    assert run.returncode == 0, f"heaved ended with {run.returncode}:\n{run.stderr}"
    check = subprocess.run([sys.executable, TOP / "tools/check_trace", "--json", "--frames", frames, config, trace], stdout=subprocess.PIPE,
                           text=True, check=False)
    assert check.returncode in (0, 1), "check_trace could not check"
    return json.loads(check.stdout)


def describe(result):
    first = "\n".join(f"t_us {v['t_us']}: {v['column']} {v['rule']}: {v['value']}, limit {v['limit']}" for v in result["first"])
    return f"{result['violations']} violations: {result['by_rule']}\n{first}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--config", required=True, type=Path)
    parser.add_argument("--cycles", type=int, default=MANY_CYCLES)
    parser.add_argument("--first-seed", type=int, default=1)
    arguments = parser.parse_args()
    platform = Platform(arguments.config)
    options = generator_options(platform)
    suite, seed, cycles, timed_moves = tap.Suite(), arguments.first_seed, 0, 0
    states, flags = Counter(), Counter()
    with tempfile.TemporaryDirectory() as folder:
        while cycles < arguments.cycles and suite.failed < 3:
            with suite.case(f"{arguments.config.stem}, seed {seed}: no limit is exceeded in any cycle"):
                result = play(arguments.heaved, arguments.config, options, seed, Path(folder))
                assert result["rows"] > DATAGRAMS, f"only {result['rows']} cycles"
                cycles += result["rows"]
                timed_moves += result["timed_moves"]["checked"]
                states.update(result["states"])
                flags.update(result["flags"])
                assert not result["violations"], describe(result)
            seed += 1
    if arguments.cycles >= MANY_CYCLES and not suite.failed:
        with suite.case(f"{arguments.config.stem}: the {cycles} cycles came across every state, every flag and timed moves"):
            assert STATES <= set(states), f"not seen: {STATES - set(states)}"
            assert expected_flags(platform) <= set(flags), f"not seen: {expected_flags(platform) - set(flags)}"
            assert timed_moves > 0
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
