# SPDX-License-Identifier: MIT
"""sender_judge.py - says from a trace whether a platform went where it was sent. Shares nothing with heaved.

Every row counts, whatever its flags and its state say. Each measure returns Figures: a number, and the bar that it has to keep, if any.
Where a measure leaves time out, its own text says which.
"""
import math
from array import array
from dataclasses import dataclass
from itertools import islice
from operator import mul, sub

COLUMNS = 17
FIRST_POSE, FIRST_CYLINDER = 2, 9
ROUNDING = (0.0, 1e-9, 2e-9, 4e-9)  # what nine decimals are worth in a difference
FELT_MS = 25
LAGS_MS = range(-20, 1301)


@dataclass
class Figure:
    name: str
    value: float
    low: float = None
    high: float = None
    unit: str = ""

    @property
    def holds(self):
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)

    @property
    def is_judged(self):
        return self.low is not None or self.high is not None

    def __str__(self):
        low, high = ("" if bar is None else f"{bar:.4g}" for bar in (self.low, self.high))
        bar = "" if not self.is_judged else f" [{low}..{high}]" if self.low is not None and self.high is not None else f" [>={low}]" if low else f" [<={high}]"
        return f"{'' if self.holds else '! '}{self.name} {self.value:.4g}{self.unit}{bar}"


class Trace:
    """The rows from begin_ms on, one a millisecond: values[axis][i] at begin + i ms."""

    def __init__(self, text, platform, begin_ms, with_cylinders=False):
        lines = text.split("\n")
        assert lines[0].startswith("t_ms,state,roll_deg") and lines[0].count(",") == COLUMNS - 1, "that is no trace"
        first = float(lines[1].split(",", 1)[0])
        assert first == int(first), "the first row is not at a whole millisecond"
        at = 1 + int(begin_ms - first)
        assert 1 <= at < len(lines) - 100 and float(lines[at].split(",", 1)[0]) == begin_ms, f"no row at {begin_ms} ms, or rows of another cycle time"
        wanted = [FIRST_POSE + axis for axis in platform.free]
        kept = [line for line in islice(lines, at, None) if line]
        table = list(zip(*(line.split(",", -1 if with_cylinders else FIRST_POSE + 6) for line in kept)))
        self.values = [array("d", map(float, table[index])) for index in wanted]
        self.cylinders = [array("d", map(float, table[FIRST_CYLINDER + k])) for k in range(platform.count)] if with_cylinders else []
        self.states, self.flags = table[1], [line[line.rfind(",") + 1:] for line in kept]
        self.rows = len(self.flags)
        last = float(lines[-2 if not lines[-1] else -1].split(",", 1)[0])
        assert last == begin_ms + len(self.flags) - 1, "rows are missing"

    def share_of(self, flag, first, last):
        return sum(flag in flags for flags in self.flags[first:last]) / max(1, last - first)


def differences(values, order):
    """Of that order, of values one ms apart, in units per second^order."""
    scale = 1000.0 ** order
    for _ in range(order):
        values = list(map(sub, values[1:], values))
    return [v * scale for v in values]


def most(values):
    return max(max(values, default=0.0), -min(values, default=0.0))


def rms(values):
    return math.sqrt(sum(map(mul, values, values)) / max(1, len(values)))


# ---- the limits of the axes ----
def limits(trace, platform, windows, bar=1.0005, cylinders=False):
    """Speed, acceleration and jerk as a share of the limit of the axis (or cylinder) that is nearest to it. windows: [(words before the name, first
    row, end)]"""
    shares = {}
    for k, column in enumerate(trace.cylinders if cylinders else trace.values):
        rates = column
        for order, what in ((1, "speed"), (2, "accel"), (3, "jerk")):
            rates = list(map(sub, rates[1:], rates))
            limit = (platform.cylinder_limits[order - 1] if cylinders else platform.limits[order - 1][k]) / 1000.0 ** order
            for words, first, last in windows:
                name = f"{words}{what}/limit"
                shares[name] = max(shares.get(name, 0.0), (most(rates[first:last - order]) - ROUNDING[order]) / limit)
    return [Figure(name, share, high=bar) for name, share in shares.items()]


# ---- gain and direction ----
def gain(columns, middle, size, weights, first, last, slack=0.0, bar=1.05, side=0.03, over=None):
    """Made/asked along the direction `size` about middle, and what is made beside it, as a share of what was asked: all values scaled by weights.
    slack: what rounding of the values sent may add, in scaled units. over: how far the asked was beyond the limits, reported."""
    asked = math.sqrt(sum((s * w) ** 2 for s, w in zip(size, weights)))
    unit = [s * w / asked for s, w in zip(size, weights)]
    scaled = [[(v - m) * w for v in column[first:last]] for column, m, w in zip(columns, middle, weights)]
    along = [sum(u * v for u, v in zip(unit, row)) for row in zip(*scaled)]
    beside = math.sqrt(max((sum(v * v for v in row) - a * a for row, a in zip(zip(*scaled), along)), default=0.0))
    figures = [Figure("made/asked", most(along) / asked, high=bar + slack / asked), Figure("sideways", beside / asked, high=side + slack / asked)]
    return figures if over is None else [Figure("asked/limit", over), *figures]


def reach(columns, low, high, weights, share=0.02, extra=0.0, first=0, last=None):
    """How far values go beyond low..high, as a share of the largest range (scaled by weights); bar: share of it, and extra in scaled units."""
    size = max((h - l) * w for l, h, w in zip(low, high, weights))
    worst = 0.0
    for column, l, h, w in zip(columns, low, high, weights):
        part = column[first:last]
        worst = max(worst, (max(part) - h) * w, (l - min(part)) * w)
    return Figure("beyond range", worst / size, high=share + extra / size)


# ---- error at the best constant lag ----
def best_lag(columns, truth, weights, first, last):
    """The lag in ms, fractions too, at which the weighted squared error of all axes is least."""
    used = [k for k, column in enumerate(truth) if max(column) > min(column)]
    low = max(LAGS_MS[0], last - len(truth[0]))
    step = max(1, (last - first) // 1500)

    def squares(lag, stride=1):
        return sum((weights[k] * math.dist(columns[k][first:last:stride], truth[k][first - lag:last - lag:stride])) ** 2 for k in used)

    lags = range(low, min(LAGS_MS[-1], first) + 1)
    coarse = min(lags[::3], key=lambda lag: squares(lag, step))
    best = min(range(max(lags[0], coarse - 3), min(lags[-1], coarse + 3) + 1), key=squares)
    if best in (lags[0], lags[-1]):
        return float(best)
    before, here, after = (squares(best + d) for d in (-1, 0, 1))
    bend = before - 2 * here + after
    return best + (0.5 * (before - after) / bend if bend > 0 else 0.0)


def errors(column, truth, lag, first, last):
    whole = math.floor(lag)
    part = lag - whole  # between the truth `whole` ms ago and one ms further back
    near, far = truth[first - whole:last - whole], truth[first - whole - 1:last - whole - 1]
    return [y - a - part * (b - a) for y, a, b in zip(column[first:last], near, far)]


def felt(error):
    """rms of an error's acceleration below some 20 Hz, in m/s^2: its second difference over steps of FELT_MS, which weighs what is faster less and less."""
    seconds = [c - 2 * b + a for a, b, c in zip(error, error[FELT_MS:], error[2 * FELT_MS:])]
    return rms(seconds) / 1000 / (FELT_MS / 1000) ** 2


def following(trace, truth, platform, first, last, weights, worst_mm=None, lag_ms=None, shape=None, jerk=None, accel=None, main=None):
    """Lag (one for all axes), error beside the truth of that lag, the acceleration of that error that a person feels, jerk over the truth's own. main:
    the axis that bars speak of, the others are reported as the largest. Times outside first..last are left out: settling at the start."""
    lag = best_lag(trace.values, truth, weights, first, last)
    used = [k for k, column in enumerate(truth) if max(column) > min(column)]
    main = used[0] if main is None else main
    worst, shapes, jerks, accels = {}, {}, {}, {}
    for k in used:
        error = errors(trace.values[k], truth[k], lag, first, last)
        worst[k], shapes[k], accels[k] = most(error), rms(error), felt(error) * weights[k]
        whole = round(lag)
        own = rms(differences(truth[k][first - whole:last - whole], 3))
        jerks[k] = rms(differences(trace.values[k][first:last], 3)) / own if own else 0.0
    figures = [Figure("lag", lag, high=lag_ms, unit=" ms"), Figure("worst", worst[main], high=worst_mm, unit=" mm"),
               Figure("shape", 1000 * shapes[main], high=shape, unit=" um"), Figure("jerk ratio", jerks[main], high=jerk),
               Figure("accel not asked for", max(accels.values()), high=accel, unit=" m/s^2")]
    if len(used) > 1:
        figures += [Figure("worst of all", max(worst[k] * weights[k] for k in used), high=worst_mm, unit=" mm"),
                    Figure("shape of all", 1000 * max(shapes.values()), high=shape), Figure("jerk ratio of all", max(jerks.values()))]
    return figures


# ---- ramps ----
def ramp_speed(column, speed, first, last, low, high, over_ms=10):
    """Least and largest speed over 10 ms as a share of the sender's."""
    part = column[first:last]
    speeds = [(b - a) * 1000 / over_ms / speed for a, b in zip(part, part[over_ms:])]
    wrong = sum(not 0.9 <= s <= 1.1 for s in speeds) / len(speeds)
    return [Figure("slowest", min(speeds), low=low), Figure("fastest", max(speeds), high=high), Figure("beyond 0.9-1.1", 100 * wrong, unit=" %")]


# ---- engaged into a stream that moves ----
def own_speeds(platform, truth, stride=10):
    """Of each cylinder, were the stream followed as it is."""
    rows = [platform.extensions(platform.whole(values)) for values in zip(*(column[::stride] for column in truth))]
    return [most(differences(column, 1)) / stride for column in zip(*rows)]


def engage_speed(trace, platform, own, first, last, share=1.1):
    """How much of engage speed + 1.1 x the stream's own is used by the cylinder that is nearest to it."""
    used, fastest = 0.0, 0.0
    for own_speed, made in zip(own, trace.cylinders):
        speed = most(differences(made[first:last], 1))
        fastest = max(fastest, speed)
        used = max(used, speed / (platform.engage_speed + share * own_speed + 0.5))
    return [Figure("cylinder speed/allowed", used, high=1.0), Figure("cylinder speed", fastest, unit=" mm/s")]


# ---- steps: the time optimum with limits of speed, acceleration and jerk ----
def _to_speed(v, a, goal, accel, jerk):
    """[(jerk, seconds)] that bring v to goal and acceleration to 0 in the least time."""
    # what v becomes if the acceleration goes to 0 at once
    settled = v + a * abs(a) / (2 * jerk)
    way = 1.0 if goal > settled else -1.0
    v, a, goal = way * v, way * a, way * goal
    peak = math.sqrt(max(0.0, jerk * (goal - v) + a * a / 2))
    if peak <= accel:
        parts = [(jerk, max(0.0, (peak - a) / jerk)), (-jerk, peak / jerk)]
    else:
        up = (accel - a) / jerk
        rest = goal - (v + (a + accel) / 2 * abs(up) + accel * accel / (2 * jerk))
        parts = [(jerk if up >= 0 else -jerk, abs(up)), (0.0, rest / accel), (-jerk, accel / jerk)]
    return [(way * j, seconds) for j, seconds in parts]


def _run(p, v, a, parts):
    for j, t in parts:
        p, v, a = p + v * t + a * t * t / 2 + j * t ** 3 / 6, v + a * t + j * t * t / 2, a + j * t
    return p, v, a


def stop_position(p, v, a, accel, jerk):
    """Where the quickest stop ends."""
    return _run(p, v, a, _to_speed(v, a, 0.0, accel, jerk))[0]


def optimal_time(p, v, a, target, speed, accel, jerk):
    """Least time from a state to rest at target: full jerk towards it, up to the limits of acceleration and speed, and from some moment on the
    quickest stop; where that ends grows with the moment."""
    way = 1.0 if target >= stop_position(p, v, a, accel, jerk) else -1.0
    p, v, a, target = way * p, way * v, way * a, way * target
    off = _to_speed(v, a, speed, accel, jerk)

    def end(moment):
        parts, left = [], moment
        for j, seconds in [*off, (0.0, math.inf)]:
            parts.append((j, min(seconds, left)))
            left -= parts[-1][1]
        there = _run(p, v, a, parts)
        stop = _to_speed(there[1], there[2], 0.0, accel, jerk)
        return _run(*there, stop)[0], moment + sum(t for _, t in stop)

    low, high = 0.0, 1e-3
    while end(high)[0] < target:
        low, high = high, 2 * high
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if end(middle)[0] < target else (low, middle)
    return end(high)[1]


def state(column, i):
    """Position, speed and acceleration at the end of a cycle."""
    accel = (column[i] - 2 * column[i - 1] + column[i - 2]) * 1e6
    return column[i], (column[i] - column[i - 1]) * 1e3 + accel * 0.5e-3, accel


def step(trace, platform, at_ms, end, target, tolerance=1e-3):
    """A lone step that comes while the one before is under way: time to settle over the least time of the axis that needs longest; how far it goes
    beyond where it is, its target and where the quickest stop from there ends, mm or deg."""
    i = math.ceil(at_ms)
    optimum, beyond, settled = 0.0, 0.0, 0
    for column, goal, speed, accel, jerk in zip(trace.values, target, *platform.limits):
        p, v, a = state(column, i)
        optimum = max(optimum, optimal_time(p, v, a, goal, speed, accel, jerk))
        # the frame is seen in this cycle or the next, and moves what comes one later
        stops = [p, goal, *(stop_position(*state(column, k), accel, jerk) for k in (i, i + 1, i + 2))]
        rest = column[i:end]
        beyond = max(beyond, max(rest) - max(stops), min(stops) - min(rest))
        settled = max(settled, next((k for k in range(len(rest) - 1, -1, -1) if abs(rest[k] - goal) > tolerance), 0) + 1)
    return optimum * 1e3, settled, beyond
