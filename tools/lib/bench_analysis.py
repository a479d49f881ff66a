# SPDX-License-Identifier: MIT
"""bench_analysis.py - how well set-points follow a signal: lag, shape, jerk, what is left of the sender's rate. Plain Python, no library.

A record is a list of positions, one per cycle of CYCLE_S, starting at t = 0.
"""
import math
from operator import mul, sub

CYCLE_S = 0.001
LAG_MIN, LAG_MAX = -50, 600  # cycles
COARSE = 8                   # cycles between the lags that are tried first
SEGMENT = 2000               # cycles per spectrum: lines 0.5 Hz apart
SETTLED_MM = 0.001


def differences(values, order):
    for _ in range(order):
        values = list(map(sub, values[1:], values))
    return values


def rms(values):
    return math.sqrt(sum(map(mul, values, values)) / len(values))


def rates(record, order):
    """Speed, acceleration or jerk of a record, per second."""
    return [value / CYCLE_S**order for value in differences(record, order)]


def _mean_square(record, signal, start, lag, stride=1):
    errors = list(map(sub, record[start::stride], signal[start - lag:len(record) - lag:stride]))
    return sum(map(mul, errors, errors)) / len(errors)


def lag_and_shape(record, signal_at):
    """(lag in s, RMS of what remains without it): the lag at which a record fits signal_at(t) best, in least squares, to a part of a cycle.
    The first LAG_MAX cycles of the record only give the signal its past."""
    start, end = LAG_MAX, len(record) + LAG_MIN
    record = record[:end]
    signal = [signal_at(k * CYCLE_S) for k in range(end - LAG_MIN)]
    # coarse, over fewer samples; then every lag about the best one
    error = lambda lag, stride: _mean_square(record, signal, start, lag, stride)  # noqa: E731  a shorter name for what follows
    coarse = min(range(LAG_MIN, LAG_MAX + 1, COARSE), key=lambda lag: error(lag, COARSE))
    low, high = max(LAG_MIN, coarse - COARSE), min(LAG_MAX, coarse + COARSE)
    fine = {lag: error(lag, 1) for lag in range(low, high + 1)}
    best = min(fine, key=fine.get)
    lag = best * CYCLE_S
    if low < best < high:  # the parabola through the three least
        before, at, after = fine[best - 1], fine[best], fine[best + 1]
        bend = before - 2 * at + after
        lag += CYCLE_S * (before - after) / (2 * bend) if bend > 0 else 0.0
    return lag, rms([record[k] - signal_at(k * CYCLE_S - lag) for k in range(start, end)])


def band_power(values, low_hz, high_hz):
    """Mean square of the part of values, one per cycle, between two frequencies: mean of Hann-windowed spectra of 2 s, half overlapping."""
    window = [0.5 - 0.5 * math.cos(2 * math.pi * k / SEGMENT) for k in range(SEGMENT)]
    lines = range(math.ceil(low_hz * SEGMENT * CYCLE_S), math.floor(high_hz * SEGMENT * CYCLE_S) + 1)
    waves = [[w * f(2 * math.pi * line * k / SEGMENT) for k, w in enumerate(window)] for line in lines for f in (math.cos, math.sin)]
    total, count = 0.0, 0
    for first in range(0, len(values) - SEGMENT + 1, SEGMENT // 2):
        part = values[first:first + SEGMENT]
        total += sum(sum(map(mul, part, wave))**2 for wave in waves)
        count += 1
    if not count:
        raise ValueError(f"at least {SEGMENT} values are needed")
    return 2 * total / count / (SEGMENT * sum(map(mul, window, window)))


def decibel(power, reference):
    if power <= 0 or reference <= 0:
        return -math.inf
    return 10 * math.log10(power / reference)


def time_optimum(way, speed, accel, jerk):
    """Shortest time from rest to rest over a way within three limits, s."""
    way = abs(way)
    if accel * accel > speed * jerk:
        accel = math.sqrt(speed * jerk)  # cannot be reached
    to_speed = speed / accel + accel / jerk
    if way >= speed * to_speed:
        return way / speed + to_speed
    if way >= 2 * accel**3 / jerk**2:
        return accel / jerk + math.sqrt((accel / jerk)**2 + 4 * way / accel)
    return 4 * (way / (2 * jerk))**(1 / 3)


def time_optimum_within(way, speed, accel, jerk, within=SETTLED_MM):
    """The same until it is so near its end: the last piece is one of full jerk."""
    return time_optimum(way, speed, accel, jerk) - (6 * within / jerk)**(1 / 3)


def settling(record, start, end, target):
    """(cycles until the record stays within SETTLED_MM of target, or None; overshoot in mm) of a step seen first in cycle start.
    The set-point of that cycle is one cycle old already."""
    way = target - record[start - 1]
    last = max((k for k in range(start - 1, end) if abs(record[k] - target) > SETTLED_MM), default=start - 1)
    beyond = max((record[k] - target) * math.copysign(1, way) for k in range(start, end))
    return None if last == end - 1 else last + 1 - (start - 1), max(0.0, beyond)
