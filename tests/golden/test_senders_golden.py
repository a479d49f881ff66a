#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_senders_golden.py - everyday senders give the same set-points, bit for bit: a change of following that one of them shows changes its line.

usage: test_senders_golden.py --heaved PROGRAM [--update]

senders.expected has a line for each ride: the SHA-256 of its trace, and its name. --update writes it anew, which is right only where a change of the motion
is meant: tests/property/test_senders.py says then whether it is a good one.
"""
import argparse
import hashlib
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path[:0] = [str(TOP / "tests/lib"), str(TOP / "tests/property")]
import senders as S  # noqa: E402  the path above has to be set first: --update is called by hand
import tap  # noqa: E402

EXPECTED = HERE / "senders.expected"
SECONDS = 9.0


class Chance:
    """Chances from random() alone, whose sequence is the same in every version of Python."""

    def __init__(self, seed):
        self.random = random.Random(seed).random

    def uniform(self, low, high):
        return low + (high - low) * self.random()

    def gauss(self, middle, sigma):
        return middle + sigma * math.sqrt(-2 * math.log(1 - self.random())) * math.cos(2 * math.pi * self.random())

    def randint(self, low, high):
        return low + int((high - low + 1) * self.random())


def senders():
    """(name, samples of a chance)"""
    even = S.even
    return (
        ("even 60 Hz", lambda c: even(60, SECONDS)),
        ("even 20 Hz", lambda c: even(20, SECONDS)),
        ("even 10 Hz, late", lambda c: S.gaussian(even(10, SECONDS), c, 0.012)),
        ("even 4 Hz", lambda c: even(4, SECONDS)),
        ("even 250 Hz, late", lambda c: S.network(even(250, SECONDS), c, 0, 0.003)),
        ("even 1000 Hz", lambda c: even(1000, SECONDS)),
        ("50 Hz over a network", lambda c: S.network(even(50, SECONDS), c, 0.0003, 0.012)),
        ("60 Hz, a tenth lost", lambda c: S.dropped(S.gaussian(even(60, SECONDS), c, 0.002), c, 0.1)),
        ("60 Hz, a third lost", lambda c: S.dropped(even(60, SECONDS), c, 0.33)),
        ("frame time varies", lambda c: S.frame_times(c, 72, 0.003, SECONDS)),
        ("a timer of 15.6 ms", lambda c: S.ticks(50, SECONDS)),
        ("a game at 144 Hz, physics at 50", lambda c: S.game_steps(c, 50, 144, SECONDS, 0.001)),
        ("other rates", lambda c: S.rates(((60, 3), (30, 3), (100, 3)))),
        ("stalls", lambda c: S.stalled(S.gaussian(even(60, SECONDS), c, 0.001), ((2.0, 0.12), (4.0, 0.4), (6.5, 0.06)))),
        ("pauses and goes on with the clock", lambda c: S.paused(even(60, SECONDS), 3.0, 0.8, False)),
        ("pauses and goes on where it was", lambda c: S.paused(even(60, SECONDS), 3.0, 1.6, True)),
        ("values four times", lambda c: S.repeated(even(25, SECONDS), 0.01, 4)),
        ("values freeze", lambda c: S.frozen(even(60, SECONDS), c, 0.04)),
        ("frames come again", lambda c: S.coming_again(even(60, SECONDS), c, 0.05, 0.005, 0.08)),
        ("frames overtake", lambda c: S.overtaken(even(60, SECONDS), c, 0.05, 0.025)),
        ("T of the period", lambda c: S.timed(S.gaussian(even(20, SECONDS), c, 0.004), 50)),
        ("T not meant", lambda c: S.timed(even(30, SECONDS), 300)),
        ("values three times, with T", lambda c: S.timed(S.repeated(even(10, SECONDS), 0.033, 3), 33)),
        ("relays between", lambda c: S.with_relays(even(50, SECONDS), 7, 0.004)),
    )


class Jumps(S.Signal):
    """A signal that is elsewhere from each of these times on."""

    def __init__(self, signal, size, times):
        self.signal, self.size, self.times = signal, size, times

    def at(self, t):
        side = sum(t >= when for when in self.times) % 2
        return [value + side * size for value, size in zip(self.signal.at(t), self.size)]


def signals(platform, chance):
    """(name, decimals, signal): within the limits, beyond them, in coarse numbers, one that jumps, and shakes near what axes can do."""
    spread = [0.5 * (h - l) / 2 for l, h in zip(platform.low, platform.high)]
    ride = S.Waves(platform.home, [0.25 * v for v in spread], [0.3 + 0.13 * i for i in range(len(spread))], [1.1 * i for i in range(len(spread))], 1.0)
    cue = S.Cue(chance, platform.home, [0.7 * v for v in spread], SECONDS)
    coarse = S.Rounded(S.Waves(platform.home, [0.2 * v for v in spread], 0.4, rise=1.0), 0.5)
    jumps = Jumps(S.Waves(platform.home, [0.1 * v for v in spread], 0.5), [0.4 * v for v in spread], (2.5, 4.1, 4.7, 7.3))
    hz = [2.0 + 0.7 * i for i in range(len(spread))]
    can = [0.6 * accel / (2 * math.pi * f) ** 2 for accel, f in zip(platform.limits[1], hz)]
    shakes = S.Waves(platform.home, [min(a, 0.2 * v) for a, v in zip(can, spread)], hz, rise=1.0)
    return ("ride", 3, ride), ("cue beyond the limits", 4, cue), ("coarse", 1, coarse), ("jumps", 3, jumps), ("shakes", 4, shakes)


def rides(folder):
    """(name, configuration, frames)"""
    for name in ("demo-hexapod", "tripod"):
        base = folder / f"{name}.ini"
        S.configured(TOP / "config" / f"{name}.ini", base, S.NEVER_SILENT)
        platform = S.Platform(base)
        for index, (what, make) in enumerate(senders()):
            for which, (how, decimals, signal) in enumerate(signals(platform, Chance(f"{what}/signal"))):
                if name == "tripod" and (index + which) % 5:
                    continue
                samples = make(Chance(f"{what}/{how}"))
                space = "C" if name == "demo-hexapod" and (index + which) % 7 == 6 and how == "ride" else "A"
                if space == "C":
                    signal = S.Waves(platform.neutral_extensions, [25.0] * platform.count, 0.4, [0.3 * i for i in range(platform.count)], 1.0)
                style = ("smooth", "balanced")[(index + which) % 2]
                yield f"{name}, {style}: {what}, {how}{', extensions' if space == 'C' else ''}", base, style, S.frames(platform, signal, samples, space, decimals)


def play(heaved, folder, base, style, lines):
    config, frames = folder / "ride.ini", folder / "ride.frames"
    S.configured(base, config, {**S.NEVER_SILENT, ("udp", "stream"): style})
    every = sorted([(0, "!engage"), *lines, (S.UP_MS + 1000 * (SECONDS + 2.5), "!end")], key=lambda line: line[0])
    frames.write_text("".join(f"{t:.3f} {text}\n" for t, text in every), encoding="ascii")
    done = subprocess.run([heaved, "--config", config, "--play", frames, "--trace", "-"], capture_output=True, check=False)
    assert done.returncode == 0, f"heaved ended with {done.returncode}: {done.stderr.decode()[-300:]}"
    return hashlib.sha256(done.stdout).hexdigest()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--update", action="store_true", help="write senders.expected anew")
    arguments = parser.parse_args()
    suite = tap.Suite()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        got = {what: play(arguments.heaved, folder, base, style, lines) for what, base, style, lines in rides(folder)}
    if arguments.update:
        EXPECTED.write_text("".join(f"{digest}  {what}\n" for what, digest in got.items()), encoding="ascii")
    expected = dict(reversed(line.split("  ", 1)) for line in EXPECTED.read_text(encoding="ascii").splitlines())
    with suite.case("the rides are those of senders.expected"):
        assert list(expected) == list(got)
    for what, digest in got.items():
        with suite.case(f"{what}: the trace is the expected one"):
            assert digest == expected.get(what), "the set-points are others; if the change is meant: test_senders_golden.py --heaved PROGRAM --update"
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
