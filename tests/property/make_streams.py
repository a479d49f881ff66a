#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""make_streams.py - writes FRAMES of senders that a platform should follow, with comments that say to the judge what may be taken for granted.

usage: make_streams.py CONFIG SEED RIDES [--odd]      to standard output

Streams of 10 to 1000 Hz with jitter, losses (up to 250 Hz, one or two in a row), T of their own period or of 0, one after the other with and without a pause, and
steps between them. --odd: also noise, streams that change their rate, and losses at any rate and in any number. These are not followed as they should be:
swings of up to 94 mm beyond the samples were found, as a way back to the curve that is planned anew with each sample swings out further each
time. The same arguments give the same bytes everywhere: only random() is used.
"""
import math
import random
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "lib"))
from mechanism import AXES, Mechanism  # noqa: E402  the path above has to be set first

RATES_HZ = (10, 15, 20, 25, 30, 45, 50, 60, 72, 90, 100, 120, 144, 165, 200, 240, 250, 300, 333, 500, 750, 1000)
LOSSES = (0, 0, 0.01, 0.02, 0.05)
SHARE = 0.2       # of each limit that a steady stream uses on an axis
REACH = 0.35      # of the range of an axis
STEADY_MS = 7000
PAUSE_MS, PAUSE_PERIODS = 5000, 32  # after which an ended stream rests: 2 s, or 24 periods, and the way there
UP_MS = 30000


class Writer:
    """Lines in the order of time, and a sender's chances."""

    def __init__(self, mechanism, seed, is_odd):
        self.is_odd = is_odd
        self.mechanism, self.chance = mechanism, random.Random(seed).random
        self.neutral = mechanism.extensions(mechanism.neutral)
        self.t_ms, self.lines = UP_MS, ["0 !engage"]

    def below(self, count):
        return int(self.chance() * count)

    def one_of(self, choices):
        return choices[self.below(len(choices))]

    def send(self, t_ms, space, values, time_ms=None):
        count = self.mechanism.count
        text = ",".join(f"{value:.{4 if space == 'A' else 3}f}" for value in values)
        self.lines.append(f"{t_ms:.3f} @{space}{count}{'' if time_ms is None else 'T'}:{text},{time_ms or 0}#")

    def rest(self, period_ms):
        """Nothing more is sent for a while; the last frame is reached."""
        pause_ms = max(PAUSE_MS, PAUSE_PERIODS * period_ms)
        self.lines.append(f"; rest {self.t_ms + pause_ms:.3f} {self.t_ms + pause_ms + 499:.3f}")  # the next frame may come at 500
        self.t_ms += pause_ms + 500

    # ---- signals ----
    def limit(self, space, which, what):
        if space == "A":
            return self.mechanism.limit(self.mechanism.free[which], what)
        return float(self.mechanism.ini["cylinders"][{"speed": "speed_mm_s", "accel": "accel_mm_s2", "jerk": "jerk_mm_s3"}[what]])

    def middle(self, space, which):
        return self.neutral[which] if space == "C" else 0.0

    def size_max(self, space, which):
        if space == "C":  # what any combination of extensions leaves the plate far from a singularity
            return 0.05 * self.mechanism.stroke[which]
        axis = self.mechanism.free[which]
        unit = "deg" if axis < 3 else "mm"
        section = self.mechanism.ini[AXES[axis]]
        return REACH * min(-float(section[f"min_{unit}"].split(";")[0]), float(section[f"max_{unit}"].split(";")[0]))

    def sways(self, space):
        """One sine for each value, most of them 0 where poses are sent."""
        waves = []
        for which in range(self.mechanism.count):
            size = self.size_max(space, which) * self.chance()
            rate = 2 * math.pi * (0.05 + 1.5 * self.chance() ** 2)
            size = min(size, *(SHARE * self.limit(space, which, what) / rate**order for order, what in ((1, "speed"), (2, "accel"), (3, "jerk"))))
            is_moved = space == "C" or self.chance() < 2.5 / self.mechanism.count
            waves.append((self.middle(space, which), size if is_moved else 0.0, rate, 2 * math.pi * self.chance()))
        return waves

    @staticmethod
    def at(waves, t_ms):
        return [middle + size * math.sin(rate * t_ms / 1000 + phase) for middle, size, rate, phase in waves]

    # ---- what senders do ----
    def stream(self, space, rate_hz, values_at, duration_ms, time_ms=None):
        """Frames with jitter and losses; the last one always arrives."""
        period_ms, loss = 1000 / rate_hz, self.one_of(LOSSES) if rate_hz <= 250 or self.is_odd else 0
        jitter_ms = self.one_of((0, 0.2, 0.5)) * period_ms
        count, before, lost = int(duration_ms / period_ms), 0.0, 0
        # lost in a row: more is a turn of what a slow stream says, or its end
        lost_most = count if self.is_odd else 2 if rate_hz >= 20 else 1
        for i in range(count + 1):
            before = max(before, self.t_ms + i * period_ms + jitter_ms * self.chance())
            lost = lost + 1 if self.chance() < loss else 0
            if 0 < lost <= lost_most and i < count:
                continue
            self.send(before, space, values_at(i * period_ms), time_ms)
        begin, self.t_ms = self.t_ms, before
        return begin

    def steady(self, space):
        rate_hz = self.one_of(RATES_HZ)
        period_ms = 1000 / rate_hz
        times = [None, None, None, 0 if rate_hz >= 60 else None, max(1, round(period_ms)), max(1, round(1.6 * period_ms))]
        waves = self.sways(space)
        time_ms = self.one_of(times)
        duration_ms = STEADY_MS + 40 * period_ms
        begin = len(self.lines)
        start_ms = self.stream(space, rate_hz, lambda t_ms: self.at(waves, t_ms), duration_ms, time_ms)
        self.lines.insert(begin, f"; steady {start_ms:.3f} {self.t_ms:.3f} {round(1000 * period_ms)}")
        return period_ms

    def noise(self, space):
        rate_hz = self.one_of(RATES_HZ)
        sizes = [0.3 * self.size_max(space, which) for which in range(self.mechanism.count)]
        self.stream(space, rate_hz, lambda _: [self.middle(space, i) + size * (2 * self.chance() - 1) for i, size in enumerate(sizes)],
                    500 + 2000 * self.chance())
        return 1000 / rate_hz

    def steps(self, space):
        for _ in range(2 + self.below(3)):
            self.send(self.t_ms, space, [self.middle(space, i) + self.size_max(space, i) * (2 * self.chance() - 1) for i in range(self.mechanism.count)])
            self.t_ms += 1200 + 2000 * self.chance()
        return 0.0

    def new_rate(self, space):
        """A stream that goes on at another rate."""
        waves, rates = self.sways(space), (self.one_of(RATES_HZ), self.one_of(RATES_HZ))
        begin_ms = self.t_ms
        for rate_hz in rates:
            offset_ms = self.t_ms - begin_ms
            self.stream(space, rate_hz, lambda t_ms, o=offset_ms: self.at(waves, t_ms + o), 3000)
            self.t_ms += 1000 / rate_hz
        return 1000 / min(rates)

    def ride(self, number):
        kinds = (self.steady, self.steady, self.steps, self.noise, self.new_rate)
        kind = kinds[number % (5 if self.is_odd else 3)]
        space = "C" if self.chance() < 0.3 else "A"
        period_ms = kind(space)
        if self.chance() < 0.6:
            self.rest(period_ms)
        else:
            self.t_ms += 1 + 200 * self.chance()


def main():
    config, seed, rides = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    writer = Writer(Mechanism(config), seed, "--odd" in sys.argv[4:])
    for number in range(rides):
        writer.ride(number)
    writer.rest(100)
    writer.lines.append(f"{writer.t_ms:.3f} !hold")
    print("\n".join(writer.lines))


if __name__ == "__main__":
    main()
