# SPDX-License-Identifier: MIT
"""bench_signal.py - the streams that tools/bench sends: a motion-cue-like signal on a 100 mm axis or on six axes, and steps. The same seed gives
the same.

Only random(), whose sequence is documented to stay, is used. Times are integer microseconds, values are text with three decimals.
"""
import math
import random

HALF_RANGE_MM = 50.0
FADE_IN_S, FADE_OUT_S = 3.0, 2.0
NETWORK_US, JITTER_US = 2000, 5000  # least delay, and what chance adds to it
LOSS = 0.01
STEP_REST_US = 2_000_000
AXES_HALF = (2.0, 2.0, 2.0, 20.0, 20.0, HALF_RANGE_MM)  # of six axes at once: roll, pitch, yaw in deg; x, y, z in mm


class Cue:
    """Slow sway, faster small movements and short shakes, as motion cueing sends them; at rest at 0 before and after."""

    def __init__(self, seconds, seed, half=HALF_RANGE_MM):
        chance = random.Random(seed).random
        self.seconds, self.shake_gain = seconds, half / HALF_RANGE_MM
        # sway: the faster the smaller
        self.waves = []
        for i in range(12):
            hertz = 0.1 * 30 ** ((i + 0.8 * chance()) / 12)
            self.waves.append((2 * math.pi * hertz, 2 * math.pi * chance(), hertz**-1.0))
        # a shake now and then: one or two periods of 3 to 6 Hz
        self.shakes = []
        t = FADE_IN_S
        while t < seconds:
            self.shakes.append((t, 0.08 + 0.12 * chance(), 2 * math.pi * (3 + 3 * chance()), 0.1 + 0.2 * chance()))
            t += 1 + 3 * chance()
        self.gain = 1.0
        self.gain = half / max(abs(self._sway(i / 100)) for i in range(int(100 * seconds) + 1))

    def _sway(self, t):
        return self.gain * sum(size * math.sin(rate * t + phase) for rate, phase, size in self.waves)

    def _shake(self, t):
        total = 0.0
        for middle, width, rate, size in self.shakes:
            x = (t - middle) / width
            if -6 < x < 6:
                total += size * math.exp(-x * x / 2) * math.sin(rate * (t - middle))
        return self.shake_gain * total

    def at(self, t):
        """mm (or deg) at t s."""
        return self._fade(t) * (self._sway(t) + self._shake(t))

    def _fade(self, t):
        return smooth(t / FADE_IN_S) * smooth((self.seconds - t) / FADE_OUT_S)


def smooth(x):
    """From 0 to 1 with three continuous derivatives."""
    x = min(1.0, max(0.0, x))
    return x**4 * (35 - 84 * x + 70 * x * x - 20 * x**3)


def six_axes(seconds, seed):
    """A signal for each axis of a pose; z has the one that a single axis has."""
    return [Cue(seconds, seed if k == len(AXES_HALF) - 1 else f"{seed}/{k}", half) for k, half in enumerate(AXES_HALF)]


def stream(signal, rate_hz, seconds, seed):
    """(arrivals, frames lost): arrivals as (t_us, text) of what a sender samples at rate_hz and the network delivers. signal: of z, or a list of
    six; then a text is all six values."""
    sampled = signal if isinstance(signal, list) else [signal]
    chance = random.Random(seed * 1000 + rate_hz).random
    arrivals, lost = [], 0
    for n in range(int(seconds * rate_hz) + 1):
        late_us = NETWORK_US + round(JITTER_US * chance())
        if chance() < LOSS:
            lost += 1
        else:
            arrivals.append((round(n * 1e6 / rate_hz) + late_us, ",".join(f"{axis.at(n / rate_hz):.3f}" for axis in sampled)))
    return sorted(arrivals, key=lambda arrival: arrival[0]), lost


def steps(ways_mm):
    """(arrivals, [(t_us, from, to)]): from rest to rest, each way alone, with time to come to rest; centred for long ways."""
    arrivals, moves, t_us = [], [], 0
    for way in ways_mm:
        start = -way / 2 if way > HALF_RANGE_MM else 0.0
        arrivals += [(t_us, f"{start:.3f}"), (t_us + STEP_REST_US, f"{start + way:.3f}")]
        moves.append((t_us + STEP_REST_US, start, start + way))
        t_us += 2 * STEP_REST_US
    return arrivals, moves


def write_frames(path, arrivals, start_us):
    """FRAMES for heaved --play: the values as z of poses, or as all six."""
    with open(path, "w", encoding="ascii", newline="\n") as file:
        for t_us, text in arrivals:
            t_us += start_us
            file.write(f"{t_us // 1000}.{t_us % 1000:03} @A6:{text if ',' in text else f'0,0,0,0,0,{text}'},0#\n")


def held(arrivals, cycles, cycle_us=1000, axis=-1):
    """The newest value known in each cycle, as floats: a zero-order hold; before the first arrival, that. axis: of several values, this one."""
    result, i = [], 0
    value = float(arrivals[0][1].split(",")[axis])
    for k in range(cycles):
        while i < len(arrivals) and arrivals[i][0] <= k * cycle_us:
            value = float(arrivals[i][1].split(",")[axis])
            i += 1
        result.append(value)
    return result
