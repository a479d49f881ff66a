# SPDX-License-Identifier: MIT
"""bench_senders.py - the subcommand senders of tools/bench: rides of six axes from senders as they are, through heaved and through what one would use
instead, judged alike by the judge of the property tests."""
import json
import math
import re
import statistics
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

from bench_rivals import NoRuckig, Ruckig, two_limits

TOP = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(TOP / "tests/property"), str(TOP / "tests/lib")]
import sender_judge as judge  # noqa: E402  the path above has to be set first
import senders  # noqa: E402
import test_senders  # noqa: E402

RIDES = r"^(recorded: six axes|near the limits: six axes|no sample: .*, 60 Hz|slow: ride, . Hz, network 2-7 ms$)"
STYLES = ("smooth", "balanced")
CYCLE_S = 1e-3
POLES_HZ = 6.0
FIGURES = {"lag": "lag_ms", "worst of all": "worst_mm", "accel not asked for": "not_asked_m_s2", "jerk ratio of all": "jerk_of_true"}


class SendersError(Exception):
    """heaved did not do what the comparison needs, or there is no such ride."""


class Made(judge.Trace):
    """What another method makes, as the judge reads it."""

    def __init__(self, values):  # pylint: disable=super-init-not-called  there is no text of a trace
        self.values, self.cylinders, self.rows = values, [], len(values[0])
        self.flags, self.states = [""] * self.rows, ["ENGAGED"] * self.rows


# ---- the others: the newest value of each cycle, and what they make of it ----
def held(arrivals, axis, cycles):
    """The newest value in each cycle; before the first one, that one."""
    values, newest = [], 0
    for cycle in range(cycles):
        while newest + 1 < len(arrivals) and arrivals[newest + 1][0] <= cycle:
            newest += 1
        values.append(arrivals[newest][1][axis])
    return values


def low_pass(values):
    """Two poles."""
    share, first, second, result = 1 - math.exp(-2 * math.pi * POLES_HZ * CYCLE_S), values[0], values[0], []
    for value in values:
        first += share * (value - first)
        second += share * (first - second)
        result.append(second)
    return result


def interpolated(arrivals, axis, cycles):
    """From where it is to each new value, in a straight line, in the time that usually passes between two."""
    period = statistics.median(b[0] - a[0] for a, b in pairwise(arrivals))
    begin, newest, result = arrivals[0][1][axis], 0, []

    def at(t_ms):
        return begin + min(1.0, (t_ms - arrivals[newest][0]) / period) * (arrivals[newest][1][axis] - begin)

    for cycle in range(cycles):
        while newest + 1 < len(arrivals) and arrivals[newest + 1][0] <= cycle:
            begin = at(arrivals[newest + 1][0])
            newest += 1
        result.append(at(cycle))
    return result


def arrivals_of(ride, platform):
    """[(cycle, values of the axes)] of the frames of a ride."""
    texts = ((t_ms - senders.UP_MS, re.match(r"@A\d+T?:([^#]*)#", text)) for t_ms, text in ride.lines)
    said = ((t_ms, map(float, found[1].split(",")[:len(platform.axes)])) for t_ms, found in texts if found)
    return [(t_ms, [value * slope + offset for value, slope, offset in zip(values, platform.slope, platform.offset)]) for t_ms, values in said]


def peers(arrivals, platform, cycles, ruckig):
    """{method: values of each axis}"""
    axes = range(len(platform.axes))
    steps = [held(arrivals, axis, cycles) for axis in axes]
    limits = list(zip(*platform.limits))
    made = {"low-pass": [low_pass(values) for values in steps],
            "line, low-pass": [low_pass(interpolated(arrivals, axis, cycles)) for axis in axes],
            "two limits": [two_limits(values, speed, accel, CYCLE_S) for values, (speed, accel, _) in zip(steps, limits)]}
    if ruckig:
        made["Ruckig"] = [ruckig.follow(values, *limit, CYCLE_S) for values, limit in zip(steps, limits)]
    return made


# ---- one ride through everything ----
def play(heaved, folder, ride, source, style, platform):
    config, frames = folder / f"{style}.ini", folder / "ride.frames"
    senders.configured(source, config, {**senders.NEVER_SILENT, ("udp", "stream"): style})
    lines = sorted([(ride.engage_ms, "!engage"), *ride.lines, (ride.end_ms + 100, "!end")], key=lambda line: line[0])
    frames.write_text("".join(f"{t:.3f} {text}\n" for t, text in lines), encoding="ascii")
    done = subprocess.run([heaved, "--config", config, "--play", frames, "--trace", "-"], capture_output=True, check=False)
    if done.returncode != 0:
        raise SendersError(f"heaved ended with status {done.returncode}: {done.stderr.decode().strip()}")
    return judge.Trace(done.stdout.decode("ascii"), platform, ride.begin_ms)


def compare(heaved, scenario, seed, ruckig):
    """{method: {figure: value}}"""
    source = TOP / "config" / f"{scenario.config}.ini"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        platform = senders.Platform(source)
        ride = scenario.make(platform, senders.chance_of(seed, scenario.name))
        traces = {f"heaved {style}": play(heaved, folder, ride, source, style, platform) for style in STYLES}
    cycles = min(trace.rows for trace in traces.values())
    traces |= {method: Made(values) for method, values in peers(arrivals_of(ride, platform), platform, cycles, ruckig).items()}
    return {method: {FIGURES[figure.name]: figure.value for figure in ride.judge(trace, "smooth") if figure.name in FIGURES}
            for method, trace in traces.items()}


EXPLANATION = f"""
lag: ms from the sender's sampling, network included, at which the error of all axes is least. worst: the largest error beside that lag, mm; degrees
count as many mm as the limits of speed say. not asked: RMS acceleration of that error below some 20 Hz, m/s^2. jerk: RMS against that of the ride
itself, of the worst axis. low-pass: two poles at {POLES_HZ:g} Hz behind the newest value. line, low-pass: a straight line to each new value in the
usual time between two, then the same poles. two limits: speed and acceleration alone, as LinuxCNC's limit3. Ruckig: each value as a target at rest.
Of the others, each axis goes for itself, and none knows the cylinders. Simulated time."""


def run(heaved, rides, seed, with_ruckig, as_json, say, out=sys.stdout):
    scenarios = [scenario for scenario in test_senders.table(seed) if re.search(rides or RIDES, scenario.name)]
    if not scenarios:
        raise SendersError(f"no ride matches {rides!r}; python3 tests/property/test_senders.py --heaved {heaved} --list names all")
    ruckig = None
    if with_ruckig:
        try:
            ruckig = Ruckig(say)
        except NoRuckig as error:
            say(f"without Ruckig: {error}")
    result = {}
    for scenario in scenarios:
        say(scenario.name)
        figures = result[scenario.name] = compare(heaved, scenario, seed, ruckig)
        if set(figures["heaved smooth"]) != set(FIGURES.values()):
            say(f"left out, as other figures than these are judged in it: {scenario.name}")
            del result[scenario.name]
            continue
        if as_json:
            continue
        print(f"\n{scenario.name}\n{'':16}{'lag':>9}{'worst':>9}{'not asked':>11}{'jerk':>9}\n{'':16}{'ms':>9}{'mm':>9}{'m/s^2':>11}{'x true':>9}", file=out)
        for method, row in figures.items():
            print(f"{method:16}{row['lag_ms']:9.1f}{row['worst_mm']:9.2f}{row['not_asked_m_s2']:11.3f}{row['jerk_of_true']:9.1f}", file=out, flush=True)
    if as_json:
        json.dump(result, out, indent=1)
        print(file=out)
    else:
        print(EXPLANATION, file=out)
