# SPDX-License-Identifier: MIT
"""senders.py - what senders want (signals), when they say it and when it arrives (senders), as FRAMES for heaved --play.

Shares nothing with heaved. Signals are functions of the sender's time, one value for each axis that the platform is free to move, or one for each
cylinder. A sender is a list of Sample: a value's time, its arrival, and what else the frame says. Times are s from the beginning of the stream.
"""
import cmath
import math
import random
from dataclasses import dataclass
from itertools import accumulate, repeat
from operator import add, mul
from pathlib import Path

from mechanism import AXES, Mechanism

UP_MS = 14000     # every ready-made platform has risen by then
NEVER_SILENT = {("platform", "engage"): "manual", ("udp", "silence_hold_ms"): "0", ("udp", "silence_neutral_ms"): "0", ("udp", "silence_settle_ms"): "0"}
TICK_S = 1 / 64   # of a clock of Windows: 15.625 ms


def configured(source, target, changes):
    """Writes a configuration with some keys changed or added."""
    changes, lines, section = dict(changes), [], ""
    text = Path(source).read_text(encoding="utf-8")
    for line in [*text.splitlines(), "[]"]:
        word = line.strip()
        if word.startswith("["):
            added = [f"{key} = {changes.pop((section, key))}" for where, key in list(changes) if where == section]
            lines += added
            section = word[1:].split("]")[0].strip()
        key = (section, line.split("=")[0].strip())
        lines.append(f"{key[1]} = {changes.pop(key)}" if key in changes else line)
    Path(target).write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")


class Platform(Mechanism):
    """A mechanism with its free axes as a vector: low, high, limits of each."""

    def __init__(self, path):
        super().__init__(path)
        self.path = path
        self.axes = [AXES[axis] for axis in self.free]
        # a frame's value is (pose - offset) / slope
        self.slope = [float(self.ini[name].get("sign", "1")) * float(self.ini[name].get("scale", "1")) for name in self.axes]
        self.offset = [float(self.ini[name].get("offset_deg", self.ini[name].get("offset_mm", "0"))) for name in self.axes]
        self.low, self.high = ([self.limit(axis, what) for axis in self.free] for what in ("min", "max"))
        self.limits = [[self.limit(axis, what) for axis in self.free] for what in ("speed", "accel", "jerk")]
        cylinders = self.ini["cylinders"]
        self.cylinder_limits = [float(cylinders[key]) for key in ("speed_mm_s", "accel_mm_s2", "jerk_mm_s3")]
        self.engage_speed = float(self.ini["engage"]["speed_mm_s"])
        self.home = [self.neutral[axis] for axis in self.free]
        self.neutral_extensions = self.extensions(self.neutral)

    def text(self, values, decimals, space="A"):
        """As frames say it."""
        if space == "A":
            values = [(value - offset) / slope for value, offset, slope in zip(values, self.offset, self.slope)]
        return ",".join(f"{value:.{decimals}f}" for value in values)

    def whole(self, values):
        """The complete pose of the free axes' values."""
        pose = [0.0] * 6
        for axis, value in zip(self.free, values):
            pose[axis] = value
        return pose

    def index(self, name):
        return self.axes.index(name)

    def fits(self, size, around=None):
        """The largest factor up to 1 by which values around + size * (-1..1) stay inside the axes and the strokes, with some room."""
        around = around or self.home
        factor = 1.0
        for value, middle, low, high in zip(size, around, self.low, self.high):
            if value:
                factor = min(factor, 0.9 * (high - middle) / abs(value), 0.9 * (middle - low) / abs(value))
        while factor > 1e-3 and not all(self.is_inside(self.whole([m + s * factor * way for m, s in zip(around, size)]), -3.0) for way in (-1, 1)):
            factor *= 0.9
        return factor


# ---- signals: at(t) -> values ----
class Signal:
    def at(self, t):
        raise NotImplementedError

    def table(self, count, step=1e-3):
        """Lists of values at 0, 1, 2 ... ms, one for each axis."""
        return [list(column) for column in zip(*(self.at(i * step) for i in range(count)))]


class Waves(Signal):
    """middle + size * sin(2 pi hz t + phase) on each axis, faded in over rise s (0: at once)."""

    def __init__(self, middle, size, hz, phase=0.0, rise=0.0):
        count = len(middle)
        spread = lambda value: list(value) if hasattr(value, "__len__") else [value] * count  # noqa: E731  one for all, or one for each
        self.middle, self.size, self.hz, self.phase, self.rise = list(middle), list(size), spread(hz), spread(phase), rise

    def at(self, t):
        fade = 1.0 if not self.rise else max(0.0, min(1.0, t / self.rise))
        return [m + (fade * s * math.sin(2 * math.pi * f * t + p) if s else 0.0) for m, s, f, p in zip(self.middle, self.size, self.hz, self.phase)]


class Ramp(Signal):
    """Stands at start, moves from `begin` s on with a constant speed to end, stands there."""

    def __init__(self, start, speed, begin, seconds):
        self.start, self.speed, self.begin, self.seconds = list(start), list(speed), begin, seconds

    def at(self, t):
        run = max(0.0, min(self.seconds, t - self.begin))
        return [s + v * run for s, v in zip(self.start, self.speed)]


class Cue(Signal):
    """A motion cue: sway, small movements, bursts of shakes up to top_hz; the largest value of each axis is its size."""

    def __init__(self, chance, middle, size, seconds, top_hz=6.0, waves=32, knee_hz=0.35, steep=2.0):
        self.middle, self.axes = list(middle), []
        for most in size:
            parts = []
            for k in range(waves if most else 0):
                hz = 0.08 * (top_hz / 0.08) ** (k / (waves - 1))
                parts.append((chance.gauss(0, 1) / (1 + (hz / knee_hz) ** steep), 2 * math.pi * hz * chance.uniform(.97, 1.03), chance.uniform(0, 6.28)))
            bursts = []
            for _ in range(max(2, int(seconds / 8)) if most and top_hz >= 2.5 else 0):
                hz = chance.uniform(2.5, top_hz)
                bursts.append((chance.uniform(0, seconds), chance.uniform(.15, .6), hz, 0.012 * 3 / hz))
            peak = max((abs(sum(a * math.sin(w * t + p) for a, w, p in parts)) for t in (i * 0.05 for i in range(int(seconds / 0.05)))), default=1.0) or 1.0
            scale = most / peak if most else 0.0
            self.axes.append(([(a * scale, w, p) for a, w, p in parts], [(c, w, hz, a * most) for c, w, hz, a in bursts]))

    def at(self, t):
        out = []
        for middle, (parts, bursts) in zip(self.middle, self.axes):
            y = middle
            for a, w, p in parts:
                y += a * math.sin(w * t + p)
            for c, w, hz, a in bursts:
                if abs(t - c) < 4 * w:
                    y += a * math.exp(-((t - c) / w) ** 2) * math.sin(2 * math.pi * hz * (t - c))
            out.append(y)
        return out

    def table(self, count, step=1e-3):
        """The same, by turning phasors: a tenth of the time, and within 1e-9."""
        out = []
        for middle, (parts, bursts) in zip(self.middle, self.axes):
            total = [complex(0.0, middle)] * count
            for a, w, p in parts:
                total = list(map(add, total, accumulate(repeat(cmath.rect(1.0, w * step), count - 1), mul, initial=cmath.rect(a, p))))
            column = [value.imag for value in total]
            for c, w, hz, a in bursts:
                for i in range(max(0, math.ceil((c - 4 * w) / step)), min(count, math.floor((c + 4 * w) / step) + 1)):
                    x = i * step - c
                    column[i] += a * math.exp(-(x / w) ** 2) * math.sin(2 * math.pi * hz * x)
            out.append(column)
        return out

    def scaled(self, factor):
        self.axes = [([(a * factor, w, p) for a, w, p in parts], [(c, w, hz, a * factor) for c, w, hz, a in bursts]) for parts, bursts in self.axes]


class Rounded(Signal):
    """What a sender with coarse numbers says."""

    def __init__(self, signal, step):
        self.signal, self.step = signal, step

    def at(self, t):
        return [round(value / self.step) * self.step for value in self.signal.at(t)]


# ---- senders: [Sample] ----
@dataclass
class Sample:
    at: float       # the time of the values, s
    arrives: float
    time_ms: int = None  # of a T frame
    mask: int = 0


def ordered(samples):
    """Frames do not overtake each other."""
    last = -1e9
    for sample in samples:
        last = sample.arrives = max(sample.arrives, last)
    return samples


def even(hz, seconds):
    """Values and frames at even times."""
    return [Sample(k / hz, k / hz) for k in range(int(seconds * hz + 1e-9))]


def frame_times(chance, hz, sigma_s, seconds):
    """A program whose frame time varies, and that samples when it sends."""
    samples, t = [], 0.0
    while t < seconds:
        samples.append(Sample(t, t))
        t += max(0.36 / hz, chance.gauss(1 / hz, sigma_s))
    return samples


def ticks(hz, seconds, tick=TICK_S):
    """Even values, sent by a timer that wakes up on ticks."""
    return [Sample(s.at, math.ceil(s.at / tick - 1e-9) * tick) for s in even(hz, seconds)]


def game_steps(chance, steps_hz, frames_hz, seconds, sigma_s=0.0):
    """Physics in even steps; all steps that are due are done, and sent, in the next frame of the picture."""
    pictures, t = [], 0.0007
    while t < seconds + 1:
        pictures.append(t)
        t += max(0.4 / frames_hz, chance.gauss(1 / frames_hz, sigma_s) if sigma_s else 1 / frames_hz)
    samples, k = [], 0
    for s in even(steps_hz, seconds):
        while pictures[k] < s.at:
            k += 1
        samples.append(Sample(s.at, pictures[k]))
    return samples


def rates(parts):
    """[(hz, seconds)] one after the other."""
    samples, t = [], 0.0
    for hz, seconds in parts:
        samples += [Sample(t + s.at, t + s.arrives) for s in even(hz, seconds)]
        t += len(even(hz, seconds)) / hz
    return samples


# ---- what may happen to a sender ----
def network(samples, chance, low_s, high_s):
    for s in samples:
        s.arrives += chance.uniform(low_s, high_s)
    return ordered(samples)


def gaussian(samples, chance, sigma_s):
    for s in samples:
        s.arrives += abs(chance.gauss(0, sigma_s))
    return ordered(samples)


def dropped(samples, chance, share):
    """The first and the last always arrive."""
    return [s for i, s in enumerate(samples) if i in (0, len(samples) - 1) or chance.random() >= share]


def paused(samples, when_s, pause_s, is_shift):
    """From when_s on everything is later by pause_s. A shift: the sender goes on from where it was. Otherwise with the clock, and what lies between is
    never said."""
    if is_shift:
        return [Sample(s.at, s.arrives + (pause_s if s.arrives >= when_s else 0.0), s.time_ms, s.mask) for s in samples]
    return [Sample(s.at + (pause_s if s.arrives >= when_s else 0.0), s.arrives + (pause_s if s.arrives >= when_s else 0.0), s.time_ms, s.mask) for s in samples]


def late_once(samples, when_s, late_s):
    for s in samples:
        if s.arrives >= when_s:
            s.arrives += late_s
            break
    return ordered(samples)


def stalled(samples, stalls):
    """[(when, seconds)]: what should arrive within a stall arrives together after it."""
    for s in samples:
        for when, seconds in stalls:
            if when <= s.arrives < when + seconds:
                s.arrives = when + seconds + 0.0002 * (s.at - when) / seconds
    return ordered(samples)


def with_relays(samples, every, after_s):
    """Every so many frames the last pose again a little later, with another relay mask."""
    out, mask, again = [], 0, None
    for i, s in enumerate(samples):
        if again is not None and s.arrives > again:
            mask ^= 0x11
            out.append(Sample(out[-1].at, again, None, mask))
            again = None
        s.mask = mask
        out.append(s)
        if i % every == every - 1:
            again = s.arrives + after_s
    return out


def repeated(samples, period_s, times):
    """Each value sent several times in a row."""
    return [Sample(s.at, s.arrives + k * period_s) for s in samples for k in range(times)]


def frozen(samples, chance, share):
    """Values that stand for one to three frames now and then: a program that sends on while the one that makes its values is late."""
    i = 1
    while i < len(samples):
        if chance.random() < share:
            for s in samples[i:i + chance.randint(1, 3)]:
                s.at = samples[i - 1].at
            i += 4
        else:
            i += 1
    return samples


def coming_again(samples, chance, share, low_s, high_s):
    """Some frames come a second time, when others have come meanwhile."""
    again = [Sample(s.at, s.arrives + chance.uniform(low_s, high_s), s.time_ms, s.mask) for s in samples if chance.random() < share]
    return sorted(samples + again, key=lambda s: s.arrives)


def overtaken(samples, chance, share, late_s):
    """Some frames come later than those behind them."""
    for s in samples:
        s.arrives += late_s if chance.random() < share else 0.0
    return sorted(samples, key=lambda s: s.arrives)


def timed(samples, time_ms):
    for s in samples:
        s.time_ms = time_ms
    return samples


def frames(platform, signal, samples, space="A", decimals=3, begin_ms=UP_MS):
    """[(t_ms, text)] for heaved --play."""
    count = platform.count
    out = []
    for s in samples:
        text = platform.text(signal.at(s.at), decimals, space)
        end = f"{s.mask:X}" if s.time_ms is None else f"{s.time_ms}"
        out.append((begin_ms + 1000 * s.arrives, f"@{space}{count}{'' if s.time_ms is None else 'T'}:{text},{end}#"))
    return out


def chance_of(*words):
    """Chances that depend on these words alone."""
    return random.Random("/".join(map(str, words)))
