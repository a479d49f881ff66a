#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_senders.py - everyday senders: a platform never makes more than was asked, and goes where it is sent, at any time and with any flag.

usage: test_senders.py --heaved PROGRAM [--filter REGEX] [--styles smooth,balanced,fast] [--jobs N] [--seed N] [--all] [--mixtures N] [--only-mixtures]
                       [--verbose | --tap] [--list] [--configs DIR] [--keep DIR]

senders.py says what is sent and when it arrives, sender_judge.py judges the trace. Judged from SETTLED_S after the first frame on, unless a
scenario says otherwise; before that the range (2 %), speed and acceleration are. A stream is judged until its last frame arrives: how far silence
lets a platform go on is tests/judge's to say.
"""
import argparse
import math
import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent / "lib"):
    sys.path.insert(0, str(folder))
import senders as S  # noqa: E402  the paths above have to be set first
import sender_judge as J  # noqa: E402

SETTLED_S = 6.0  # from the first frame: fading in
STYLES = ("smooth", "balanced", "fast")
CONFIGS = next((folder for folder in (HERE.parents[1] / "config", HERE / "config") if folder.is_dir()), None)


@dataclass
class Ride:
    """What is sent, and who judges what comes of it."""
    lines: list               # [(t_ms, text)]
    judge: object             # judge(trace, style) -> [Figure]
    end_ms: float
    begin_ms: int = S.UP_MS   # the first row that is judged
    with_cylinders: bool = False
    engage_ms: int = 0


@dataclass
class Scenario:
    name: str
    config: str
    make: object              # make(platform, chance) -> Ride
    is_extra: bool = False    # more of the same, for --all


def rows(seconds):
    return int(round(seconds * 1000))


def scaled_weights(platform):
    """mm stay, degrees count as many mm as their limits of speed say."""
    z = platform.limits[0][platform.index("z")]
    return [z / speed for speed in platform.limits[0]]


def along(platform, **parts):
    """A vector of the free axes."""
    return [parts.get(name, 0.0) for name in platform.axes]


# ---- shakes: gain, direction, range ----
def shake(hz, over, limit, rate_hz, direction="z", space="A", decimals=6, seconds=14.0, rise=0.0, phase=0.0, net=(3e-4, 8e-4), make_sender=None):
    """A sine of which the axis nearest to its limit asks for `over` times that limit; what does not fit into the platform is sent smaller."""
    def make(platform, chance):
        if space == "C":
            limits, middle = [[value] * platform.count for value in platform.cylinder_limits], platform.neutral_extensions
            weights, count = [1.0] * platform.count, platform.count
        else:
            limits, middle = platform.limits, platform.home
            weights, count = scaled_weights(platform), len(platform.free)
        if direction in S.AXES:
            way = [platform.limits[0][platform.index(direction)] if name == direction else 0.0 for name in platform.axes]
        else:
            way = [limit_of_axis * chance.choice((-1, 1)) * chance.uniform(0.2, 1.0) for limit_of_axis in limits[0]]
        orders = {"speed": 1, "accel": 2, "jerk": 3}
        rate = 2 * math.pi * hz
        size = [w * over / max(abs(v) * rate ** orders[limit] / lim for v, lim in zip(way, limits[orders[limit] - 1])) for w in way]
        if space == "C":
            factor = min(1.0, *(0.06 * platform.stroke[k] / abs(v) for k, v in enumerate(size) if v))
        else:
            factor = platform.fits(size)
        size = [v * factor for v in size]
        asked = max(abs(v) * rate ** order / lim for order in (1, 2, 3) for v, lim in zip(size, limits[order - 1]))
        signal = S.Waves(middle, size, hz, phase, rise)
        samples = make_sender(chance, rate_hz, seconds) if make_sender else S.network(S.even(rate_hz, seconds), chance, *net)
        rounding = math.sqrt(count) * 10.0 ** -decimals * max(weights)

        def judge(trace, style):
            columns = trace.cylinders if space == "C" else trace.values
            first, last = rows(SETTLED_S), rows(samples[-1].arrives)
            low, high = ([m + way * abs(s) for m, s in zip(middle, size)] for way in (-1, 1))
            return [*J.gain(columns, middle, size, weights, first, last, rounding, over=asked),
                    J.reach(columns, low, high, weights, 0.025, 0.1 + rounding, 0, last), *J.limits(trace, platform, [("", first, last)], cylinders=space == "C")]
        return Ride(S.frames(platform, signal, samples, space, decimals), judge, S.UP_MS + 1000 * seconds, with_cylinders=space == "C")
    return make


# ---- streams: error at the best lag ----
def limits(trace, platform, last, jerk=None):
    """The limits of the axes, while fading in and then. jerk: another bar where cylinders that cannot follow lead an axis beyond its jerk."""
    figures = J.limits(trace, platform, [("fade-in ", 0, rows(SETTLED_S)), ("", rows(SETTLED_S), last)])
    for figure in figures:
        if figure.name == "fade-in jerk/limit":
            figure.high = None  # judged where fading in is what is tested
        elif figure.name == "jerk/limit" and jerk:
            figure.high = jerk
    return figures


def settle_range(trace, platform, truth, weights, last):
    """From the first frame on: between neutral and what is sent."""
    low, high = ([extreme(home, extreme(column)) for home, column in zip(platform.home, truth)] for extreme in (min, max))
    return J.reach(trace.values, low, high, weights, 0.02, 0.05, 0, last)


def track(make_samples, worst_mm=1.5, size=40.0, hz=0.4, axis="z", decimals=3, seconds=30.0, bars=None, coarse=None, jerk=None):
    """One sine, judged by its error at the best constant lag. bars: {style: {name of a bar: number}}"""
    def make(platform, chance):
        middle = platform.home
        signal = S.Waves(middle, along(platform, **{axis: size}), hz, chance.uniform(0, 6.28))
        said = S.Rounded(signal, coarse) if coarse else signal
        samples = make_samples(chance, seconds)
        truth = signal.table(rows(seconds) + 30)
        weights = scaled_weights(platform)

        def judge(trace, style):
            given = {"worst_mm": worst_mm, "jerk": jerk, **(bars or {}).get(style, {})}
            first, last = rows(SETTLED_S), rows(min(seconds, samples[-1].arrives))
            return [*J.following(trace, truth, platform, first, last, weights, main=platform.index(axis), **given),
                    settle_range(trace, platform, truth, weights, last), *limits(trace, platform, last)]
        return Ride(S.frames(platform, said, samples, "A", decimals), judge, S.UP_MS + 1000 * seconds)
    return make


def cue(make_samples, sizes, bars=None, seconds=40.0, decimals=3, top_hz=6.0, knee_hz=0.35, steep=2.0, of_limits=None, accel_share=None, most_jerk=None):
    """A motion cue on several axes. of_limits: scaled so that it uses this much of the limits. most_jerk: see limits()."""
    def make(platform, chance):
        size = along(platform, **sizes)
        signal = S.Cue(chance, platform.home, size, seconds, top_hz, knee_hz=knee_hz, steep=steep)
        if of_limits:
            table = signal.table(rows(seconds), 1e-3)
            use = max(J.most(J.differences(column, order)) / limit for order in (1, 2, 3) for column, limit in zip(table, platform.limits[order - 1]))
            signal.scaled(of_limits / use)
        truth = signal.table(rows(seconds) + 30)
        samples = make_samples(chance, seconds)
        weights = scaled_weights(platform)

        def judge(trace, style):
            first, last = rows(SETTLED_S), rows(min(seconds, samples[-1].arrives))
            figures = J.following(trace, truth, platform, first, last, weights, main=platform.index("z"), **(bars or {}).get(style, {}))
            return [*figures, Fig("flag accel", 100 * trace.share_of("accel", first, last), high=accel_share, unit=" %"),
                    settle_range(trace, platform, truth, weights, last), *limits(trace, platform, last, most_jerk)]
        return Ride(S.frames(platform, signal, samples, "A", decimals), judge, S.UP_MS + 1000 * seconds)
    return make


Fig = J.Figure


# ---- ramps: the share of the sender's speed ----
RAMP_BEGIN_S, RAMP_FROM_S = 7.0, 1.2  # judged from 1.2 s after the sender starts to move, to 0.1 s before it stops


def ramp(change, hz, low=0.5, high=1.6, speed=20.0, reach=80.0, axis="z", decimals=3, accel=None, make_samples=None, from_s=RAMP_FROM_S):
    """A constant speed; change(samples, chance, times of the events) is what happens to the sender meanwhile. from_s: after its begin, judged from then on."""
    def make(platform, chance):
        span = platform.fits(along(platform, **{axis: reach})) * reach
        move_s = 2 * span / speed
        seconds = RAMP_BEGIN_S + move_s + 2.0
        signal = S.Ramp(along(platform, **{axis: -span}), along(platform, **{axis: speed}), RAMP_BEGIN_S, move_s)
        events = [RAMP_BEGIN_S + share * move_s + chance.random() / hz for share in (0.35, 0.65)]
        base = make_samples(chance, seconds) if make_samples else S.network(S.even(hz, seconds), chance, 3e-4, 8e-4)
        samples = change(base, chance, events)

        def judge(trace, style):
            column, first, last = trace.values[platform.index(axis)], rows(RAMP_BEGIN_S + from_s), rows(RAMP_BEGIN_S + move_s - 0.1)
            accels = J.most(J.differences(column[first:last], 2))
            sides = [-span, span]
            return [*J.ramp_speed(column, speed, first, last, low, high), Fig("acceleration", accels, high=accel, unit=" mm/s^2"),
                    J.reach([column], [min(sides)], [max(sides)], [1.0], 0.02, 0.0), *limits(trace, platform, last)]
        return Ride(S.frames(platform, signal, samples, "A", decimals), judge, S.UP_MS + 1000 * seconds)
    return make


# ---- taken over while the sender moves ----
def followed(trace, first, last):
    """(first row, end) of each time in which a pose is followed. A stop for a hold is one of the cylinders, whose limits alone hold then."""
    windows, begin = [], None
    for i in range(first, last + 1):
        is_followed = i < last and trace.states[i] == "ENGAGED"
        if is_followed and begin is None:
            begin = i
        elif not is_followed and begin is not None:
            windows.append((begin, i))
            begin = None
    return windows


def engaged(size, hz, how="rising", rate_hz=60, shift_s=0.0, axes=("z",), decimals=3):
    """how the platform comes to follow a stream that moves:
    rising   the stream runs while it rises; from the first row that is ENGAGED on
    start    it waits at neutral, and the first frame comes from the midst of a motion
    resume   it holds for a while, and resumes
    gap      nothing arrives for 1.7 s
    owner    its sender falls silent, and another one, which is elsewhere in the same motion, takes over
    intensity  it makes less of it for a while
    All rows from there on are judged, by the limits of the axes where a pose is followed."""
    def make(platform, chance):
        if len(axes) == 1:
            sizes, rate, phase = along(platform, **{axes[0]: size}), hz, 0.0
        else:
            sizes = [size / weight * chance.uniform(0.3, 1) / 2 for weight in scaled_weights(platform)]
            rate, phase = [hz * chance.uniform(0.6, 1.2) for _ in sizes], [chance.uniform(0, 6.28) for _ in sizes]
        factor = platform.fits(sizes)
        sizes = [v * factor for v in sizes]
        signal = S.Waves(platform.home, sizes, rate, phase)
        seconds = 26.0 + shift_s
        samples = S.network(S.even(rate_hz, seconds), chance, 1e-3, 3e-3)
        begin, requests = S.UP_MS, []
        if how == "rising":
            begin = S.UP_MS - 12000
        elif how == "start":
            samples = [s for s in samples if s.arrives >= shift_s]
        elif how == "resume":
            requests = [(begin + 1000 * (9 + shift_s), "!hold"), (begin + 1000 * (12 + 1.7 * shift_s), "!resume")]
        elif how == "intensity":
            requests = [(begin + 1000 * (9 + shift_s), "!intensity 30"), (begin + 1000 * (13 + 1.7 * shift_s), "!intensity 100")]
        elif how == "owner":
            requests = [(begin + 1000 * (12 + shift_s), "!from 127.0.0.2")]
            samples = [S.Sample(s.at + (0.4 / hz if s.arrives > 12 + shift_s else 0), s.arrives) for s in samples
                       if not 9 + shift_s <= s.arrives < 12.01 + shift_s]
        else:
            samples = [s for s in samples if not 9 + shift_s <= s.arrives < 10.7 + shift_s]
        own = J.own_speeds(platform, signal.table(rows(8.0) if len(axes) == 1 else rows(seconds)))

        def judge(trace, style):
            at = next((i for i, state in enumerate(trace.states) if state == "ENGAGED"), None)
            if at is None:
                return [Fig("engaged", 0, low=1)]
            last = rows(samples[-1].arrives)
            weights = scaled_weights(platform)
            low, high = ([m + way * abs(s) for m, s in zip(platform.home, sizes)] for way in (-1, 1))
            return [J.reach(trace.values, low, high, weights, 0.02, 0.05, at, last), *J.engage_speed(trace, platform, own, at, last),
                    *J.limits(trace, platform, [("", *window) for window in followed(trace, at, last)]),
                    *J.limits(trace, platform, [("cylinder ", at, last)], cylinders=True)]
        lines = [*((t + begin - S.UP_MS, text) for t, text in S.frames(platform, signal, samples, "A", decimals)), *requests]
        return Ride(lines, judge, begin + 1000 * seconds, begin_ms=begin, with_cylinders=True, engage_ms=int(begin + 1000 * shift_s) if how == "rising" else 0)
    return make


# ---- steps ----
def settle_frame(platform):
    """The first frame of all: the platform is taken over where it is."""
    return S.UP_MS + 100, f"@A{platform.count}:{platform.text(platform.home, 3)},0#"


def steps(kind, pairs=20, gap_s=2.6):
    """Lone steps, each interrupted by another one 0.03-0.15 s later; kind: how the two lie to each other. `six`: one axis needs longest, the others
    move less, so that the limits of the cylinders do not count."""
    def make(platform, chance):
        lines, events, t = [settle_frame(platform)], [], SETTLED_S
        names = platform.axes
        for k in range(pairs):
            name = "z" if kind != "six" else names[k % len(names)]
            weights = scaled_weights(platform)

            def target(distance, way, name=name, weights=weights):
                out = list(platform.home)
                for i, other in enumerate(names):
                    if other == name:
                        out[i] += way * distance / weights[i]
                    elif kind == "six":
                        out[i] += chance.uniform(-0.08, 0.08) * distance / weights[i]
                return out
            most = 60.0
            way = chance.choice((-1, 1))
            first = target(chance.uniform(0.3, 1) * most, way)
            again = {"opposite": -way, "same": way}.get(kind, chance.choice((-1, 1)))
            second = target(chance.uniform(0.1, 1) * most, again)
            wait = (0.03, 0.05, 0.08, 0.11, 0.15)[k % 5] + chance.uniform(-0.004, 0.004) if kind != "lone" else None
            for when, values in ((t, first), (t + wait, second)) if wait else ((t, first),):
                lines.append((S.UP_MS + 1000 * when, f"@A{platform.count}:{platform.text(values, 3)},0#"))
            goal = [round(v, 3) for v in (second if wait else first)]
            events.append((1000 * (t + (wait or 0)), goal))
            t += gap_s + chance.random() * 0.3
        end = t

        def judge(trace, style):
            ratios, beyond = [], 0.0
            for at, goal in events:
                optimum, settled, far = J.step(trace, platform, at, rows(at / 1000 + gap_s - 0.25), goal)
                ratios.append(settled / optimum)
                beyond = max(beyond, far)
            ratios.sort()
            return [Fig("median of the optimum", ratios[len(ratios) // 2], high=1.1), Fig("95 %", ratios[int(0.95 * (len(ratios) - 1))], high=1.3),
                    Fig("worst", ratios[-1]), Fig("too far", beyond, high=0.1, unit=" mm"), *limits(trace, platform, rows(end))]
        return Ride(lines, judge, S.UP_MS + 1000 * end)
    return make


def timed_moves(count=8):
    """Moves with T, one after the other has ended: there at T, to the cycle, and at rest exactly on the target."""
    def make(platform, chance):
        lines, events, t = [settle_frame(platform)], [], SETTLED_S
        for _ in range(count):
            size = [chance.uniform(-1, 1) * 30 / weight for weight in scaled_weights(platform)]
            size = [round(v * platform.fits(size), 3) for v in size]
            seconds = chance.choice((1.2, 1.5, 2.0, 3.0))
            lines.append((S.UP_MS + 1000 * t, f"@A{platform.count}T:{platform.text(size, 3)},{int(1000 * seconds)}#"))
            events.append((1000 * t, 1000 * seconds, size))
            t += seconds + 1.0 + 0.3 * chance.random()

        def judge(trace, style):
            late, off = [], 0.0
            for at, need, goal in events:
                i = math.ceil(at)
                stop = i + int(need) + 900
                off = max(off, max(abs(column[stop] - v) for column, v in zip(trace.values, goal)))
                moving = max(next((k for k in range(stop, i, -1) if abs(column[k] - column[stop]) > 2e-9), i) for column in trace.values)
                late.append(moving + 1 - i - need)
            return [Fig("at rest late, cycles", max(late), high=2), Fig("at rest early, cycles", -min(late), high=3),
                    Fig("off the target", off, high=2e-5, unit=" mm"), *limits(trace, platform, rows(t))]
        return Ride(lines, judge, S.UP_MS + 1000 * t)
    return make


# ---- the table ----
LARGE, DEMO, TRIPOD, OTHER, TRIPOD_R = "hexapod-400", "demo-hexapod", "tripod", "hexapod-435-300", "tripod-rotation"


def via(low_ms, high_ms, samples_of):
    """samples_of(chance, seconds), by way of a network."""
    return lambda chance, seconds: S.network(samples_of(chance, seconds), chance, low_ms * 1e-3, high_ms * 1e-3)


def wired(samples_of):
    return via(0.3, 0.8, samples_of)


def even(hz):
    return lambda chance, seconds: S.even(hz, seconds)


def frame_times(hz, sigma_ms):
    return wired(lambda chance, seconds: S.frame_times(chance, hz, sigma_ms * 1e-3, seconds))


def ticks(hz, tick=S.TICK_S):
    return via(0, 0.3, lambda chance, seconds: S.ticks(hz, seconds, tick))


def games(steps_hz, frames_hz, sigma_ms=0.0):
    return via(0, 0.5, lambda chance, seconds: S.game_steps(chance, steps_hz, frames_hz, seconds, sigma_ms * 1e-3))


def gaussian(hz, sigma_ms):
    return lambda chance, seconds: S.gaussian(S.even(hz, seconds), chance, sigma_ms * 1e-3)


def dropping(hz, share):
    return via(2, 6, lambda chance, seconds: S.dropped(S.even(hz, seconds), chance, share))


def changing(*parts):
    return wired(lambda chance, seconds: S.rates(parts))


def table(seed):
    add = []

    def put(name, config, make, is_extra=False):
        add.append(Scenario(name, config, make, is_extra))

    # more than the limits allow
    put("shake: z 5 Hz, 2 x jerk", LARGE, shake(5, 2, "jerk", 60))
    put("shake: six axes 7.1 Hz, 2.2 x jerk, 90 Hz", LARGE, shake(7.1, 2.2, "jerk", 90, "six"))
    put("shake: z 6 Hz, 0.9 x jerk", LARGE, shake(6, 0.9, "jerk", 60))
    put("shake: z 8 Hz, 0.7 x jerk", LARGE, shake(8, 0.7, "jerk", 60))
    put("shake: C6 5 Hz, 2 x jerk", LARGE, shake(5, 2, "jerk", 60, "six", "C"))
    chance = S.chance_of(seed, "shakes")
    for k in range(30):
        config = (LARGE, DEMO, TRIPOD, OTHER, LARGE, DEMO)[k % 6]
        hz = 0.5 * 24 ** chance.random()
        over = 0.3 * (5 / 0.3) ** chance.random()
        limit = ("jerk", "accel", "speed")[k % 3]
        space = "C" if k % 5 == 4 else "A"
        rate = chance.choice([r for r in (30, 45, 60, 72, 90, 120, 144, 200, 250) if r > 3.5 * hz])
        axes = ("roll", "pitch", "z") if config == TRIPOD else ("roll", "pitch", "yaw", "x", "y", "z")
        direction = "six" if space == "C" or k % 2 else chance.choice(axes)
        put(f"shake {k}: {config} {direction}{' C' if space == 'C' else ''} {hz:.1f} Hz, {over:.2f} x {limit}, {rate} Hz", config,
            shake(round(hz, 2), round(over, 3), limit, rate, direction, space, rise=chance.choice((0, 2.0)), phase=chance.choice((0.0, 1.57))))

    # the same through a network that loses some: what is guessed swings no further, either
    for hz, over, limit in ((6.0, 3.3, "accel"), (3.6, 0.85, "jerk"), (4.7, 0.8, "jerk"), (5.3, 1.5, "jerk"), (2.3, 1.0, "accel"), (1.1, 1.3, "speed")):
        put(f"lossy shake: z {hz} Hz, {over} x {limit}", LARGE,
            shake(hz, over, limit, 60, seconds=30.0, make_sender=lambda c, r, s: via(2, 7, lambda c, s: S.dropped(S.even(60, s), c, 0.01))(c, s)))

    # senders as they are: 40 mm at 0.4 Hz
    for sigma_ms, bar in ((0.5, 0.5), (1, 0.5), (2, 0.8)):
        put(f"frame time 16.7 +- {sigma_ms} ms", LARGE, track(frame_times(60, sigma_ms), bar))
    put("frame time 11.1 +- 0.8 ms", DEMO, track(frame_times(90, 0.8), 0.5))
    put("frame time 33 +- 3 ms", LARGE, track(frame_times(30, 3), 1.5))
    for hz in (60, 100, 50, 120):
        put(f"ticks of 15.6 ms, {hz} Hz", LARGE, track(ticks(hz)))
    put("ticks of 15.6 ms, 100 Hz, 35 mm", LARGE, track(ticks(100), size=35.0))
    put("ticks of 10 ms, 72 Hz", DEMO, track(ticks(72, 0.010)))
    pictures = ((50, 45), (60, 60), (60, 59.6), (120, 60), (120, 60.4), (50, 72), (50, 144), (100, 90))
    for steps_hz, picture_hz in pictures:
        put(f"game steps {steps_hz} Hz at {picture_hz} frames/s", LARGE, track(games(steps_hz, picture_hz)))
    put("game steps 60 Hz at 60 frames/s +- 1 ms", LARGE, track(games(60, 60, 1)))
    put("game steps 50 Hz at 60 frames/s +- 1 ms", DEMO, track(games(50, 60, 1)))
    put("lateness 0-12 ms", LARGE, track(via(0, 12, even(60))))
    put("lateness 0-9 ms, 100 Hz", DEMO, track(via(0, 9, even(100))))
    for sigma_ms in (3, 4):
        put(f"lateness gaussian {sigma_ms} ms", LARGE, track(gaussian(60, sigma_ms)))
    for share in (0.10, 0.12, 0.15):
        put(f"{100 * share:.0f} % dropped, network 2-6 ms", LARGE, track(dropping(60, share)))
    put("rates 60/30/60 Hz", LARGE, track(changing((60, 9), (30, 9), (60, 12)), 1.0))
    put("rates 60/120/60 Hz", LARGE, track(changing((60, 9), (120, 9), (60, 12)), 1.0))
    put("rates 100/50/100 Hz", DEMO, track(changing((100, 9), (50, 9), (100, 12)), 1.0))

    # ramps: one thing that goes wrong
    def trouble(name, hz, change, low=0.5, high=1.6, config=LARGE, is_extra=False, **arguments):
        put(f"ramp: {name}", config, ramp(change, hz, low, high, **arguments), is_extra)

    for period_ms in (10, 16.667, 20):
        hz = 1000 / period_ms
        for shift in (0.5, 0.9, 1.0, 1.3, 1.5, 1.7, 2.0, 2.2, 2.7, 3.0):
            # a sender that itself stands still for longer: then the platform may nearly do so
            low, pause_s = 0.5 if shift <= 1.5 else 0.2, shift * period_ms * 1e-3
            name = f"{period_ms:.3g} ms, one interval longer by {shift} periods"
            trouble(f"{name}, shifted", hz, lambda s, c, e, p=pause_s: S.paused(s, e[0], p, True), low,
                    is_extra=period_ms != 16.667 and shift not in (1.0, 1.5, 2.7))
            trouble(f"{name}, lost", hz, lambda s, c, e, p=pause_s: S.paused(s, e[0], p, False), is_extra=shift not in (1.0, 1.5, 3.0))
    for period_ms, late_ms in ((50, 5), (100, 12), (16.667, 6), (20, 9), (10, 4)):
        trouble(f"{period_ms:.3g} ms, one frame late by {late_ms} ms", 1000 / period_ms,
                lambda s, c, e, w=1e-3 * late_ms: S.late_once(S.late_once(s, e[0], w), e[1], w), 0.8, 1.2)
    for every in (30, 10):
        for after_ms in (1, 3, 8):
            trouble(f"relay frames, every {every}th again after {after_ms} ms", 60,
                    lambda s, c, e, n=every, a=1e-3 * after_ms: S.with_relays(s, n, a), 0.9, 1.1)
    trouble("relay frames, 50 Hz, every 7th again after 5 ms", 50, lambda s, c, e: S.with_relays(s, 7, 5e-3), 0.9, 1.1, DEMO)
    for name, make_samples in (
            *((f"game steps {a} Hz at {b} frames/s", games(a, b)) for a, b in pictures), *((f"ticks of 15.6 ms, {hz} Hz", ticks(hz)) for hz in (60, 100)),
            *((f"frame time 16.7 +- {sigma_ms} ms", frame_times(60, sigma_ms)) for sigma_ms in (1, 2)), ("lateness 0-12 ms", via(0, 12, even(60))),
            ("lateness gaussian 4 ms", gaussian(60, 4)), ("12 % dropped, network 2-6 ms", dropping(60, 0.12))):
        trouble(name, 60, lambda s, c, e: s, make_samples=make_samples)
    for hz in (20, 30, 60):
        for times in (0.3, 0.8, 1.0, 1.6, 2.0, 2.5, 3.0, 4.0):
            trouble(f"A6T {hz} Hz, T of {times} periods", hz, lambda s, c, e, t=round(1000 * times / hz): S.timed(s, t),
                    is_extra=hz != 60 and times in (0.3, 1.6, 2.0, 4.0))
    for times in (1.0, 2.5, 3.0):
        put(f"A6T 50 Hz, T of {times} periods", LARGE, track(lambda c, s, t=round(20 * times): S.timed(wired(even(50))(c, s), t)))
    # T in any mixture: the sender does not wait for it
    mixed = {"0 and 20 by turns": (60, lambda i, c: (0, 20)[i % 2]), "20, then 60": (60, lambda i, c: 20 if i < 900 else 60), "100": (50, lambda i, c: 100),
             "random, 10 to 100": (60, lambda i, c: c.randint(10, 100)), "400": (60, lambda i, c: 400), "0": (60, lambda i, c: 0)}
    for name, (hz, time_ms) in mixed.items():
        def make(chance, seconds, hz=hz, time_ms=time_ms):
            samples = wired(even(hz))(chance, seconds)
            for i, s in enumerate(samples):
                s.time_ms = time_ms(i, chance)
            return samples
        put(f"T of {name}, {hz} Hz", LARGE, track(make, 1.5, bars={style: {"lag_ms": 50} for style in STYLES}))
    for stall_s in (0.1, 0.2, 0.3):
        # a soft stop is right, a way back is not; at most twice the speed, at most that from standing within 67 ms
        trouble(f"Wi-Fi stall of {1000 * stall_s:.0f} ms", 60, lambda s, c, e, d=stall_s: S.stalled(s, [(when, d) for when in e]), -0.05, 2.0, accel=600)
    trouble("Wi-Fi stall of 150 ms, 60 mm/s", 60, lambda s, c, e: S.stalled(s, [(e[0], .15)]), -0.05, 2.0, speed=60.0, accel=1800)

    # engaged into a stream that moves
    chance = S.chance_of(seed, "engaged")
    for k in range(12):
        config, hz = (LARGE, DEMO)[k % 2], chance.uniform(0.25, 0.6)
        for how in ("rising", "start", *(("resume", "gap", "owner", "intensity") if k < 4 else ())):
            put(f"engaged {k}: {config} z, {how}", config, engaged(chance.uniform(20, 60), hz, how, shift_s=2 + k / 12 / hz))
    for k in range(12):
        how, config = ("rising", "start", "resume", "gap", "owner", "intensity")[k // 2], (LARGE, DEMO)[k % 2]
        put(f"engaged six {k}: {config}, {how}", config,
            engaged(chance.uniform(20, 60), chance.uniform(0.25, 0.5), how, shift_s=2 + chance.random() * 4, axes=("six",) * 6))
    for how in ("rising", "start", "resume"):
        put(f"engaged x: {how}", DEMO, engaged(60.0, 0.6, how, shift_s=3.1, axes=("x",)))
        put(f"engaged tripod: {how}", TRIPOD, engaged(40.0, 0.5, how, shift_s=2.6))

    # lone steps
    for kind in ("same", "opposite", "six", "any"):
        put(f"steps: interrupted, {kind}", LARGE, steps(kind))
    put("steps: interrupted, any, demo", DEMO, steps("any"))
    put("steps: lone", LARGE, steps("lone", 10))

    # cues
    sender = via(2, 7, lambda c, s: S.dropped(S.even(60, s), c, 0.01))
    # of other seeds losses that come together make more: up to 35 um
    bars = {"smooth": {"lag_ms": 41.5, "shape": 24.0 if seed == 1 else 40.0, "jerk": 1.2}, "balanced": {"lag_ms": 30.0, "shape": 50.0, "jerk": 1.3}}
    put("cue: z 60 mm, 60 Hz, 2-7 ms, 1 % lost", LARGE, cue(sender, {"z": 60}, bars, 100.0))
    put("cue: six axes, 60 Hz, 2-7 ms, 1 % lost", LARGE, cue(sender, {"x": 30, "y": 30, "z": 60, "roll": 2.5, "pitch": 2.5, "yaw": 2.5}, bars, 60.0))
    recorded = {style: {"shape": 60.0} for style in STYLES}
    six = {"x": 60, "y": 60, "z": 60, "roll": 5, "pitch": 5, "yaw": 5}
    for hz, top_hz, share in ((120, 12.0, 0.7), (60, 6.0, 0.5)):
        put(f"recorded: six axes, {hz} Hz, three decimals", LARGE, cue(wired(even(hz)), six, recorded, 24.0, top_hz=top_hz, of_limits=share, accel_share=5))
    # a ride that is bound by speed: near the limits as inside them; beyond them late by what the speed does not allow, and no more
    for share, lag_ms, worst_mm in ((0.6, 40, 1), (0.9, 45, 3), (1.3, 60, 20)):
        bars = {style: {"lag_ms": lag_ms, "worst_mm": worst_mm} for style in STYLES}
        put(f"near the limits: six axes, {share} of them", LARGE,
            cue(via(1, 3, even(60)), {"x": 80, "y": 80, "z": 60, "roll": 4, "pitch": 4, "yaw": 6}, bars, 30.0, knee_hz=0.75, steep=2.3, of_limits=share))

    # frames that are no samples: repeated, frozen, old. Late by what a loss costs at most
    for name, hz, lag_ms, change in (
            ("values freeze for 1 to 3 frames, 4 %", 60, 70, lambda s, c: S.frozen(s, c, 0.04)),
            ("values freeze for 1 to 3 frames, 4 %", 100, 50, lambda s, c: S.frozen(s, c, 0.04)),
            ("3 % come again after 18 to 60 ms", 60, 45, lambda s, c: S.coming_again(s, c, 0.03, 0.018, 0.060)),
            ("3 % come again after 18 to 60 ms", 100, 35, lambda s, c: S.coming_again(s, c, 0.03, 0.018, 0.060)),
            ("2 % come 20 ms late", 60, 50, lambda s, c: S.overtaken(s, c, 0.02, 0.020)),
            ("2 % come 20 ms late", 100, 40, lambda s, c: S.overtaken(s, c, 0.02, 0.020)),
            ("10 % come again with other relays after 7 to 15 ms", 60, 45, lambda s, c: S.coming_again(s, c, 0.1, 0.007, 0.015)),
            ("all come again with other relays after 7 to 15 ms", 60, 45, lambda s, c: S.coming_again(s, c, 1.0, 0.007, 0.015))):
        bars = {style: {"lag_ms": lag_ms, "worst_mm": 3.0, "accel": 0.15} for style in STYLES}
        put(f"no sample: {name}, {hz} Hz", LARGE,
            cue(lambda c, s, hz=hz, f=change: f(via(1, 3, even(hz))(c, s), c), {"x": 80, "y": 80, "z": 60, "roll": 4, "pitch": 4, "yaw": 6}, bars, 30.0,
                knee_hz=0.75, steep=2.3, of_limits=0.5, most_jerk=3.0))
        if hz == 60:
            trouble(f"no sample: {name}", 60, lambda s, c, e, f=change: f(s, c), *((0.9, 1.1) if "come again" in name else (0.5, 1.6)))

    # slow senders: 2 1/8 periods late
    for hz in (2, 3, 5, 7):
        bars = {style: {"lag_ms": 2250 / hz, "worst_mm": 4.0, "accel": 0.15} for style in STYLES}
        for name, make_samples in (("network 2-7 ms", even(hz)), ("network 2-7 ms, 2 % lost", lambda c, s, hz=hz: S.dropped(S.even(hz, s), c, 0.02)),
                                   ("ticks of 15.6 ms, network 2-7 ms", lambda c, s, hz=hz: S.ticks(hz, s))):
            put(f"slow: ride, {hz} Hz, {name}", LARGE,
                cue(via(2, 7, make_samples), {"x": 60, "y": 60, "z": 40, "roll": 3, "pitch": 3, "yaw": 4}, bars, 60.0, top_hz=hz / 5, knee_hz=hz / 20, steep=2.3))
            put(f"slow: ramp, {hz} Hz, {name}", LARGE, ramp(lambda s, c, e: s, hz, make_samples=via(2, 7, make_samples), from_s=RAMP_FROM_S + 2.25 / hz))

    # what is right today
    put("timed moves", LARGE, timed_moves())
    put("timed moves, demo", DEMO, timed_moves())
    plain = lambda hz: wired(even(hz))  # noqa: E731  a shorter name for what follows
    for name, config, make_samples, arguments, lags, worsts, jerks in (
            ("coarse: 1 mm, 60 Hz", LARGE, plain(60), {"decimals": 0, "coarse": 1.0}, (115, 121), (0.5, 0.5), (12, 30)),
            ("coarse: 0.1 mm, 60 Hz", LARGE, plain(60), {"decimals": 1, "coarse": 0.1}, (64, 50), (0.2, 0.2), (19, 33)),
            ("coarse: 1 mm, 100 Hz, slow", DEMO, plain(100), {"decimals": 0, "coarse": 1.0, "hz": 0.15}, (99, 103), (0.23, 0.23), (240, 580)),
            ("repeats: each value twice, 100 Hz over 50", LARGE, wired(lambda c, s: S.repeated(S.even(50, s), 0.01, 2)), {},
             (43.5, 21.5), (.08, .08), (1.1, 5.2)),
            ("slow: 10 Hz", LARGE, plain(10), {"hz": 0.2}, (204, 94), (0.11, 0.08), (1.05, 7.5)),
            ("slow: 6.7 Hz", LARGE, plain(6.7), {"hz": 0.15}, (303, 139), (0.14, 0.1), (1.05, 9.6)),
            ("slow: 5 Hz", LARGE, plain(5), {"hz": 0.1}, (430, 200), (0.12, 0.12), (1.1, 1.1)),
            ("slow: 3 Hz", LARGE, plain(3), {"hz": 0.06}, (715, 340), (0.2, 0.2), (1.5, 1.5)),
            ("slow: 2 Hz", LARGE, plain(2), {"hz": 0.05}, (1075, 510), (0.45, 0.45), (2.1, 2.1)),
            ("plain: 30 Hz", LARGE, plain(30), {}, (70, 33.5), (.055, .045), (1.05, 4.7)),
            ("plain: 60 Hz", LARGE, plain(60), {}, (36.6, 18.3), (.035, .035), (1.35, 7.8)),
            ("plain: 100 Hz", LARGE, plain(100), {}, (23.2, 12.2), (.007, .006), (3.3, 21)),
            ("plain: 250 Hz", LARGE, plain(250), {}, (11.2, 6.8), (.003, .05), (44, 70)),
            ("plain: 1000 Hz", LARGE, plain(1000), {}, (11.2, 6.8), (.003, .05), (44, 70))):
        # smooth and fast: as heaved was before it looked at evidence; balanced between them
        bars = {style: {"lag_ms": lags[k], "worst_mm": worsts[k], "jerk": jerks[k]} for k, style in enumerate(("smooth", "fast"))}
        bars["balanced"] = {"lag_ms": lags[0], "worst_mm": 3 * max(worsts), "jerk": max(jerks)}
        put(name, config, track(make_samples, bars=bars, **arguments))
    return add


# ---- random mixtures ----
def mixed_samples(chance, seconds, is_even=False):
    """A sender with a network and, often, a trouble of its own: (words, how to make samples, share of the bars)."""
    hz = chance.choice((30, 45, 50, 60, 60, 72, 90, 100, 120, 144, 200, 250))
    kind = chance.choice(("even", "even", "even") if is_even else ("even", "frames", "ticks", "steps", "even"))
    words, troubles = [f"{hz} Hz"], 0
    sigma = chance.uniform(0.02, 0.12) / hz
    tick = chance.choice((S.TICK_S, 0.010))
    picture = chance.choice((45, 60, 72, 90, 120, 144))
    if kind == "frames":
        words.append(f"frame time +-{1e3 * sigma:.1f} ms")
    elif kind == "ticks":
        words.append(f"ticks of {1e3 * tick:.1f} ms")
    elif kind == "steps":
        hz = chance.choice((50, 60, 100, 120))
        words = [f"steps of {hz} Hz at {picture} frames/s"]
    networks = [(0.0003, 0.0008), (0.0003, 0.0008), (0.001, 0.003), (0.002, 0.007), (0.0, 0.010), "gaussian"]
    net_kind = networks[0 if kind == "frames" else int(chance.random() * len(networks))]
    spread = chance.uniform(1, 3.5) * 1e-3
    words.append(f"gaussian {1e3 * spread:.1f} ms" if net_kind == "gaussian" else f"network {1e3 * net_kind[0]:.1f}-{1e3 * net_kind[1]:.1f} ms")
    trouble = chance.choice(("none", "none", "drops", "drops", "relays", "T", "late"))
    share, every, times = chance.uniform(0.005, 0.10), int(chance.uniform(7, 40)), chance.uniform(0.3, 4)
    after, late = chance.uniform(0.05, 0.6) / hz, chance.uniform(0.1, 0.6) / hz
    if trouble != "none":
        words.append({"drops": f"{100 * share:.0f} % lost", "relays": f"relays every {every}th after {1e3 * after:.1f} ms", "T": f"T of {times:.1f} periods",
                      "late": f"each 50th late by {1e3 * late:.1f} ms"}[trouble])
    troubles = (kind != "even") + (net_kind != networks[0] and net_kind != (0.001, 0.003)) + (trouble != "none")

    def make():
        samples = {"even": lambda: S.even(hz, seconds), "frames": lambda: S.frame_times(chance, hz, sigma, seconds),
                   "ticks": lambda: S.ticks(hz, seconds, tick), "steps": lambda: S.game_steps(chance, hz, picture, seconds)}[kind]()
        if trouble == "drops":
            samples = S.dropped(samples, chance, share)
        samples = S.gaussian(samples, chance, spread) if net_kind == "gaussian" else S.network(samples, chance, *net_kind)
        if trouble == "late":
            for k in range(25, len(samples), 50):
                samples[k].arrives += late
            samples = S.ordered(samples)
        if trouble == "relays":
            samples = S.with_relays(samples, every, after)
        return S.timed(samples, max(1, round(1000 * times / hz))) if trouble == "T" else samples
    return ", ".join(words), make, troubles, hz, trouble


def mixtures(seed, count):
    """Random combinations; each depends on its own number and the seed alone."""
    add = []
    for number in range(count):
        chance = S.chance_of(seed, "mixture", number)
        kind = ("shake", "sine", "six", "shake", "ramp")[number % 5]
        config = chance.choice((LARGE, LARGE, DEMO, OTHER, TRIPOD if kind != "ramp" else LARGE))
        if kind == "shake":
            words, make_samples, troubles, rate, _ = mixed_samples(chance, 14.0)
            hz, over = min(0.5 * 24 ** chance.random(), rate / 3.5), 0.3 * (5 / 0.3) ** chance.random()
            limit = chance.choice(("speed", "accel", "jerk"))
            space, direction = chance.choice("AAAC"), chance.choice(("six", "six", "z", "roll"))
            make = shake(hz, over, limit, rate, direction if space == "A" else "six", space, chance.choice((3, 4, 6)),
                         make_sender=lambda c, r, s, m=make_samples: m())
            words = f"{'C ' if space == 'C' else ''}{direction} {hz:.1f} Hz {over:.2f} x {limit}, {words}"
        elif kind == "ramp":
            words, make_samples, troubles, rate, trouble = mixed_samples(chance, RAMP_BEGIN_S + 12.0, True)
            # what the sender itself says late, or not at all, may bend the speed; relays and T may not
            bars = (0.85, 1.15) if troubles == 0 or trouble in ("relays",) and troubles == 1 else (0.5, 1.6)
            make = ramp(lambda s, c, e: s, rate, *bars, speed=chance.uniform(15, 25), make_samples=lambda c, s, m=make_samples: m())
        else:
            words, make_samples, troubles, rate, _ = mixed_samples(chance, 26.0)
            hz, size = chance.uniform(0.15, 0.6), chance.uniform(15, 40)
            # 15 ms of time error for one trouble, 25 for several together, 8 for none
            bar = (0.008, 0.015, 0.025, 0.025)[troubles] * 2 * math.pi * hz * size + 0.1
            make = mixed_sine(make_samples, hz, size, bar, kind == "six")
            words = f"{size:.0f} mm {hz:.2f} Hz{' six axes' if kind == 'six' else ''}, {words}"
        add.append(Scenario(f"mixture {number}: {kind} {config} {words}", config, make))
    return add


def mixed_sine(make_samples, hz, size, bar, is_six, seconds=26.0):
    def make(platform, chance):
        weights = scaled_weights(platform)
        sizes = [size / w * chance.uniform(0.2, 1) / 2 for w in weights] if is_six else along(platform, z=size)
        factor = platform.fits(sizes)
        sizes = [v * factor for v in sizes]
        signal = S.Waves(platform.home, sizes, [hz * (chance.uniform(0.5, 1.5) if is_six else 1) for _ in sizes], [chance.uniform(0, 6.28) for _ in sizes])
        truth = signal.table(rows(seconds) + 30)
        samples = make_samples()

        def judge(trace, style):
            first, last = rows(SETTLED_S), rows(min(seconds, samples[-1].arrives))
            return [*J.following(trace, truth, platform, first, last, weights, worst_mm=bar, main=platform.index("z")),
                    settle_range(trace, platform, truth, weights, last), *limits(trace, platform, last)]
        return Ride(S.frames(platform, signal, samples, "A", 3), judge, S.UP_MS + 1000 * seconds)
    return make


# ---- running ----
def run(task):
    """One scenario in all styles: [(name, style, figures or None, error)]"""
    index, arguments = task
    scenario = SCENARIOS[index]
    results = []
    source = Path(arguments.configs) / f"{scenario.config}.ini"
    with tempfile.TemporaryDirectory(prefix="heave-") as temporary:
        folder = Path(arguments.keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        word = re.sub(r"[^A-Za-z0-9.+-]+", "_", scenario.name)
        config = folder / f"{word}.ini"
        S.configured(source, config, S.NEVER_SILENT)
        platform = S.Platform(config)
        ride = scenario.make(platform, S.chance_of(arguments.seed, scenario.name))
        lines = sorted([(ride.engage_ms, "!engage"), *ride.lines, (ride.end_ms + 100, "!end")], key=lambda line: line[0])
        frames = folder / f"{word}.frames"
        frames.write_text("".join(f"{t:.3f} {text}\n" for t, text in lines), encoding="ascii")
        for style in arguments.styles:
            try:
                S.configured(source, config, {**S.NEVER_SILENT, ("udp", "stream"): style})
                trace = folder / f"{word}.{style}.csv" if arguments.keep else "-"
                done = subprocess.run([arguments.heaved, "--config", config, "--play", frames, "--trace", trace], capture_output=True, check=False)
                assert done.returncode == 0, f"heaved ended with {done.returncode}: {done.stderr.decode()[-300:]}"
                text = trace.read_text(encoding="ascii") if arguments.keep else done.stdout.decode("ascii")
                figures = ride.judge(J.Trace(text, platform, ride.begin_ms, ride.with_cylinders), style)
                results.append((scenario.name, style, figures, None))
            except Exception as error:  # a scenario that cannot be judged has failed, the others go on
                results.append((scenario.name, style, [], f"{type(error).__name__}: {error}"))
    return results


def known_styles(arguments):
    """Those that the program takes."""
    known = []
    with tempfile.TemporaryDirectory(prefix="heave-") as folder:
        for style in arguments.styles:
            config = Path(folder) / "style.ini"
            S.configured(Path(arguments.configs) / f"{LARGE}.ini", config, {("udp", "stream"): style})
            done = subprocess.run([arguments.heaved, "--config", config, "--check"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False, text=True)
            if done.returncode == 0:
                known.append(style)
            else:
                print(f"# style {style} is not there: {done.stderr.strip().splitlines()[-1] if done.stderr.strip() else done.returncode}")
    return known


def main():
    global SCENARIOS
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--filter", default="")
    parser.add_argument("--styles", type=lambda text: text.split(","), default=list(STYLES))
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--all", action="store_true", help="more of the same, too: shifts, losses, T")
    parser.add_argument("--mixtures", type=int, default=40, help="how many random ones")
    parser.add_argument("--only-mixtures", action="store_true")
    parser.add_argument("--verbose", action="store_true", help="a line per scenario with all figures; otherwise those that fail")
    parser.add_argument("--tap", action="store_true", help="one case for each scenario and style, for tools/test")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--configs", default=CONFIGS, help="where the ready-made configurations are")
    parser.add_argument("--keep", metavar="DIR", help="leave frames, configurations and traces there")
    a = parser.parse_args()
    SCENARIOS = [scenario for scenario in [*([] if a.only_mixtures else table(a.seed)), *mixtures(a.seed, a.mixtures)]
                 if (a.all or not scenario.is_extra) and re.search(a.filter, scenario.name)]
    if a.list:
        print("\n".join(f"{scenario.name} ({scenario.config})" for scenario in SCENARIOS))
        return 0
    a.heaved = str(Path(a.heaved).resolve())
    a.styles = known_styles(a)
    passed = failed = 0
    start = time.monotonic()
    with multiprocessing.get_context("fork").Pool(a.jobs) as pool:
        for results in pool.imap(run, [(index, a) for index in range(len(SCENARIOS))]):
            for name, style, figures, error in results:
                good = error is None and all(figure.holds for figure in figures)
                passed, failed = passed + good, failed + (not good)
                report(a, passed + failed, (name, style), good, error or ", ".join(str(figure) for figure in figures if a.verbose or not figure.holds))
    if a.tap:
        print(f"1..{passed + failed}")
        print(f"# figure {passed + failed} senders and mixtures of them judged, in {len(a.styles)} styles")
    else:
        print(f"{len(SCENARIOS)} scenarios in {', '.join(a.styles) or 'no style'}, {time.monotonic() - start:.0f} s")
        print(f"{passed} passed, {failed} failed")
    return 0 if failed == 0 and passed else 1


def report(arguments, number, what, good, text):
    name, style = what
    if arguments.tap:
        again = (f"# again: python3 tests/property/test_senders.py --heaved {arguments.heaved} --seed {arguments.seed} --mixtures {arguments.mixtures} --all "
                 f"--styles {style} --filter '^{re.escape(name)}$' --verbose --keep DIR")
        print(f"{'ok' if good else 'not ok'} {number} - {name} [{style}]", *([] if good else [f"# {text}", again]), sep="\n", flush=True)
    elif arguments.verbose or not good:
        print(f"{'ok  ' if good else 'FAIL'} {name} [{style}]: {text}", flush=True)


SCENARIOS = []
if __name__ == "__main__":
    sys.exit(main())
