# SPDX-License-Identifier: MIT
"""bench_motion.py - the subcommand motion of tools/bench: one axis, then six at once, the same arrivals through heaved and through others, side by
side."""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import bench_analysis as analysis
import bench_signal as signals
from bench_rivals import NoRuckig, Ruckig, two_limits
from heave.configuration import Configuration, read_ini
from heave.trace import COLUMNS, NANO, POSE_COLUMNS

CONFIG = Path(__file__).resolve().parents[2] / "tests" / "bench" / "z_axis.ini"
START_US = 2_500_000  # heaved has risen to z = 0 by then
TAKEOVER_US = 500_000  # the sender's first pose, at rest, is taken over
SKIPPED_S = 4.0        # of a record: the fade-in of the signal, and what the period of the stream is found from
END_S = 2.0
BAND_HZ = 4.0
WAYS_MM = (1.0, 10.0, 100.0)
FIRST_POSE = COLUMNS.index(POSE_COLUMNS[0]) + 2
Z = POSE_COLUMNS.index("z_mm")
STYLES = ("smooth", "balanced")
HELD, LIMITED, RUCKIG = "held, no limits", "two limits", "Ruckig"


class MotionError(Exception):
    """heaved did not do what the comparison needs."""


class Bench:
    def __init__(self, heaved, folder, with_ruckig, say):
        self.heaved, self.folder, self.say = heaved, Path(folder), say
        axes = Configuration(CONFIG).axes
        self.cycle_us = int(read_ini(CONFIG)["platform"]["cycle_us"])
        self.axis_limits = [[float(limit) for limit in (axis.speed, axis.accel, axis.jerk)]
                            for axis in (axes[column.split("_")[0]] for column in POSE_COLUMNS)]
        self.limits = self.axis_limits[Z]
        self.styles = [style for style in STYLES if self.knows(style)] or STYLES[:1]  # one that knows none says why when it plays
        self.ruckig, self.without = None, "left out, as asked"
        if with_ruckig:
            try:
                self.ruckig = Ruckig(say)
            except NoRuckig as error:
                self.without = str(error)
                say(f"without Ruckig: {error}")

    def configure(self, name, style):
        config = self.folder / f"{name}-{style}.ini"
        config.write_text(CONFIG.read_text(encoding="ascii").replace("stream = smooth", f"stream = {style}"), encoding="ascii")
        return config

    def knows(self, style):
        return subprocess.run([str(self.heaved), "--config", str(self.configure("style", style)), "--check"], capture_output=True, check=False).returncode == 0

    # ---- one list of arrivals through everything ----
    def play(self, name, style, arrivals):
        """What heaved makes of the arrivals: (z in mm, flags) of each cycle from the first arrival's time zero on."""
        axes, flags = self.play_axes(name, style, arrivals)
        return axes[Z], flags

    def play_axes(self, name, style, arrivals):
        """The same of all six axes."""
        config, (frames, trace) = self.configure(name, style), (self.folder / f"{name}-{style}.{end}" for end in ("frames", "csv"))
        rest = [(0, arrivals[0][1])]
        signals.write_frames(frames, rest + [(t_us + TAKEOVER_US, text) for t_us, text in arrivals], START_US - TAKEOVER_US)
        result = subprocess.run([str(self.heaved), "--config", str(config), "--play", str(frames), "--trace", str(trace)],
                                capture_output=True, text=True, check=False)
        if result.returncode != 0:
            raise MotionError(f"heaved ended with status {result.returncode}: {result.stderr.strip()}")
        record, flags = [], []
        with open(trace, encoding="ascii") as file:
            next(file)
            for line in file:
                fields = line.rstrip("\n").split(",")
                t_us = int(fields[0].replace(".", ""))
                if t_us >= START_US:
                    if fields[1] != "ENGAGED":
                        raise MotionError(f"heaved is {fields[1]} at {fields[0]} ms of {trace}")
                    record.append([int(field.replace(".", "")) / NANO for field in fields[FIRST_POSE:FIRST_POSE + len(POSE_COLUMNS)]])
                    flags.append(fields[-1])
        return list(zip(*record)), flags

    def records(self, name, arrivals):
        """{method: record}, all of the same length, and {method: flags} of heaved's."""
        flags = {}
        result = {HELD: None}
        for style in self.styles:
            result[f"heaved {style}"], flags[f"heaved {style}"] = self.play(name, style, arrivals)
        cycles = min(len(result[method]) for method in flags)
        targets = result[HELD] = signals.held(arrivals, cycles, self.cycle_us)
        result[LIMITED] = two_limits(targets, *self.limits[:2], analysis.CYCLE_S)
        if self.ruckig:
            try:
                result[RUCKIG] = self.ruckig.follow(targets, *self.limits, analysis.CYCLE_S)
            except NoRuckig as error:
                self.without = str(error)
                self.say(f"{name}: without Ruckig: {error}")
        return {method: record[:cycles] for method, record in result.items()}, flags

    # ---- streams ----
    def stream(self, rate_hz, seconds, seed):
        signal = signals.Cue(seconds, seed)
        arrivals, lost = signals.stream(signal, rate_hz, seconds, seed)
        records, flags = self.records(f"{rate_hz}hz", arrivals)
        first, last = round(SKIPPED_S / analysis.CYCLE_S), round((seconds - END_S) / analysis.CYCLE_S)
        # the judged cycles, and before them the ones that a lag reaches back to
        past, future = analysis.LAG_MAX, -analysis.LAG_MIN
        signal_at = lambda t: signal.at(t + (first - past) * analysis.CYCLE_S)  # noqa: E731  a shorter name for what follows
        truth = [signal.at(k * analysis.CYCLE_S) for k in range(first, last)]
        true_jerk = analysis.rms(analysis.rates(truth, 3))
        band = max(0.5, rate_hz - BAND_HZ), rate_hz + BAND_HZ
        rows, held_power = {}, None
        for method, record in records.items():
            lag, shape = analysis.lag_and_shape(record[first - past:last + future], signal_at)
            record = record[first:last]
            acceleration = analysis.rates(record, 2)
            jerk = analysis.rates(record, 3)
            power = analysis.band_power(acceleration, *band)
            held_power = held_power or power
            rows[method] = {"lag_ms": 1000 * lag, "shape_um": 1000 * shape, "jerk_rms_mm_s3": analysis.rms(jerk),
                            "jerk_rms_of_true": analysis.rms(jerk) / true_jerk, "jerk_peak_mm_s3": max(map(abs, jerk)),
                            "accel_peak_mm_s2": max(map(abs, acceleration)), "speed_peak_mm_s": max(map(abs, analysis.rates(record, 1))),
                            "line_db": analysis.decibel(power, held_power)}
            if method in flags:
                words = [text for text in flags[method][first:last] if text]
                rows[method]["flagged_cycles"] = len(words)
                rows[method]["flags"] = sorted({word for text in words for word in text.split("|")})
        return {"rate_hz": rate_hz, "seconds": seconds, "seed": seed, "frames": len(arrivals), "lost": lost, "cycles_judged": last - first,
                "line_hz": band, "true": {"jerk_rms_mm_s3": true_jerk, "jerk_peak_mm_s3": max(map(abs, analysis.rates(truth, 3))),
                                          "accel_peak_mm_s2": max(map(abs, analysis.rates(truth, 2))),
                                          "speed_peak_mm_s": max(map(abs, analysis.rates(truth, 1)))},
                "methods": rows}

    # ---- six axes at once ----
    def six(self, rate_hz, seconds, seed):
        """Of each method, z as above and the worst of all axes. The others move each axis for itself: they know of no others."""
        axes = signals.six_axes(seconds, seed)
        arrivals, lost = signals.stream(axes, rate_hz, seconds, seed)
        records, flags = {}, {}
        for style in self.styles:
            records[f"heaved {style}"], flags[f"heaved {style}"] = self.play_axes(f"six-{rate_hz}hz", style, arrivals)
        cycles = min(len(record[Z]) for record in records.values())
        held = [signals.held(arrivals, cycles, self.cycle_us, k) for k in range(len(axes))]
        records[LIMITED] = [two_limits(targets, *limits[:2], analysis.CYCLE_S) for targets, limits in zip(held, self.axis_limits)]
        if self.ruckig:
            try:
                records[RUCKIG] = [self.ruckig.follow(targets, *limits, analysis.CYCLE_S) for targets, limits in zip(held, self.axis_limits)]
            except NoRuckig as error:
                self.say(f"six axes, {rate_hz} Hz: without Ruckig: {error}")
        first, last = round(SKIPPED_S / analysis.CYCLE_S), round((seconds - END_S) / analysis.CYCLE_S)
        rows = {}
        for method, record in records.items():
            figures = [self.one_of_six(column, axis, first, last) for column, axis in zip(record, axes)]
            # of the amplitude, so that degrees and mm can be compared
            shares = [shape / half for (_, shape, _), half in zip(figures, signals.AXES_HALF)]
            rows[method] = {"lag_ms": 1000 * figures[Z][0], "shape_um": 1000 * figures[Z][1], "jerk_rms_of_true": figures[Z][2],
                            "lag_ms_worst": 1000 * max(lag for lag, _, _ in figures), "shape_permille_worst": 1000 * max(shares),
                            "jerk_rms_of_true_worst": max(jerk for _, _, jerk in figures)}
            if method in flags:
                words = [text for text in flags[method][first:last] if text]
                rows[method]["flagged_cycles"] = len(words)
                rows[method]["flags"] = sorted({word for text in words for word in text.split("|")})
        return {"rate_hz": rate_hz, "seconds": seconds, "seed": seed, "frames": len(arrivals), "lost": lost, "cycles_judged": last - first, "methods": rows}

    @staticmethod
    def one_of_six(record, signal, first, last):
        """Lag in s, shape, jerk in those of the signal."""
        past, future = analysis.LAG_MAX, -analysis.LAG_MIN
        lag, shape = analysis.lag_and_shape(record[first - past:last + future], lambda t: signal.at(t + (first - past) * analysis.CYCLE_S))
        truth = analysis.rms(analysis.rates([signal.at(k * analysis.CYCLE_S) for k in range(first, last)], 3))
        return lag, shape, analysis.rms(analysis.rates(record[first:last], 3)) / truth

    # ---- steps ----
    def steps(self):
        arrivals, moves = signals.steps(WAYS_MM)
        # one more frame behind the last, so that the record is as long for all
        arrivals.append((arrivals[-1][0] + signals.STEP_REST_US, arrivals[-1][1]))
        records, _ = self.records("steps", arrivals)
        result = []
        for t_us, start, end in moves:
            first, last = t_us // self.cycle_us, (t_us + signals.STEP_REST_US) // self.cycle_us
            optimum = analysis.time_optimum(end - start, *self.limits)
            near = analysis.time_optimum_within(end - start, *self.limits)
            rows = {}
            for method, record in records.items():
                if method == HELD or method in [f"heaved {style}" for style in STYLES[1:]]:  # no limits; a step is the same in all styles
                    continue
                cycles, beyond = analysis.settling(record, first, min(last, len(record)), end)
                moved = record[first - 4:last]
                rows[method] = {"settled_ms": cycles, "of_optimum": cycles * analysis.CYCLE_S / near if cycles else None,
                                "overshoot_um": 1000 * beyond, "jerk_peak_mm_s3": max(map(abs, analysis.rates(moved, 3)))}
            result.append({"from_mm": start, "to_mm": end, "optimum_ms": 1000 * optimum, "optimum_within_ms": 1000 * near, "methods": rows})
        return result


# ---- what is printed ----
def print_stream(entry, out):
    true = entry["true"]
    low, high = entry["line_hz"]
    print(f"\n{entry['rate_hz']} Hz: {entry['frames']} frames in {entry['seconds']:g} s, {entry['lost']} lost; "
          f"{entry['cycles_judged']} cycles judged. The signal itself: jerk {true['jerk_rms_mm_s3']:.0f} mm/s^3 RMS, "
          f"peaks {true['speed_peak_mm_s']:.0f} mm/s, {true['accel_peak_mm_s2']:.0f} mm/s^2, {true['jerk_peak_mm_s3']:.0f} mm/s^3", file=out)
    print(f"{'':16}{'lag':>9}{'shape':>10}{'jerk RMS':>14}{'':>9}{'peak jerk':>14}{'peak accel':>12}{f'{low:g}-{high:g} Hz':>12}", file=out)
    print(f"{'':16}{'ms':>9}{'um RMS':>10}{'mm/s^3':>14}{'x true':>9}{'mm/s^3':>14}{'mm/s^2':>12}{'dB':>12}", file=out)
    for method, row in entry["methods"].items():
        print(f"{method:16}{row['lag_ms']:9.2f}{row['shape_um']:10.1f}{row['jerk_rms_mm_s3']:14.0f}{number(row['jerk_rms_of_true']):>9}"
              f"{row['jerk_peak_mm_s3']:14.0f}{row['accel_peak_mm_s2']:12.0f}{row['line_db']:12.1f}", file=out)
        if row.get("flagged_cycles"):
            print(f"{'':16}flags in {row['flagged_cycles']} cycles: {', '.join(row['flags'])}", file=out)


def print_six(entry, out):
    print(f"\nsix axes at once, {entry['rate_hz']} Hz: {entry['frames']} frames in {entry['seconds']:g} s, {entry['lost']} lost; "
          f"{entry['cycles_judged']} cycles judged\n"
          f"{'':16}{'z: lag':>9}{'shape':>10}{'jerk RMS':>10}{'worst axis: lag':>18}{'shape':>10}{'jerk RMS':>10}{'flags in':>10}\n"
          f"{'':16}{'ms':>9}{'um RMS':>10}{'x true':>10}{'ms':>18}{'1/1000':>10}{'x true':>10}{'% cycles':>10}", file=out)
    for method, row in entry["methods"].items():
        flagged = f"{100 * row['flagged_cycles'] / entry['cycles_judged']:10.1f} {', '.join(row['flags'])}" if "flags" in row else ""
        print(f"{method:16}{row['lag_ms']:9.2f}{row['shape_um']:10.1f}{number(row['jerk_rms_of_true']):>10}{row['lag_ms_worst']:18.2f}"
              f"{row['shape_permille_worst']:10.2f}{number(row['jerk_rms_of_true_worst']):>10}{flagged}", file=out)


def number(value):
    return f"{value:.2f}" if value < 100 else f"{value:.0f}"


def print_steps(moves, out):
    print(f"\nsteps from rest to rest, from the cycle in which the frame is seen until within 1 um for good; {len(moves)} moves, each once\n"
          f"{'':16}{'way':>8}{'settled':>10}{'optimum':>10}{'ratio':>8}{'overshoot':>11}{'peak jerk':>13}\n"
          f"{'':16}{'mm':>8}{'ms':>10}{'ms':>10}{'':>8}{'um':>11}{'mm/s^3':>13}", file=out)
    for move in moves:
        for method, row in move["methods"].items():
            settled, ratio = ("never", "") if row["settled_ms"] is None else (str(row["settled_ms"]), f"{row['of_optimum']:.3f}")
            print(f"{method:16}{move['to_mm'] - move['from_mm']:8g}{settled:>10}{move['optimum_within_ms']:10.1f}{ratio:>8}"
                  f"{row['overshoot_um']:11.3f}{row['jerk_peak_mm_s3']:13.0f}", file=out)


EXPLANATION = f"""
lag: from the sender's sampling to the set-point, the network's {signals.NETWORK_US / 1000 + signals.JITTER_US / 2000:g} ms (mean) included;
least-squares fit to the true signal. shape: what remains beside the lag; of six axes in 1/1000 of the
axis' amplitude. x true: against the jerk of the true signal sampled at the same
cycles. dB: power of the acceleration in the band about the sender's rate, against the held targets. optimum: shortest possible with all
three limits until within 1 um; "two limits" knows no jerk limit, so it may be faster. Peaks and RMS are finite differences of 1 ms
set-points; nine printed decimals make up to 4 mm/s^3 of jerk."""


def run(heaved, rates, seconds, seed, with_ruckig, keep, as_json, say, out=sys.stdout):
    with tempfile.TemporaryDirectory() as folder:
        if keep:
            Path(keep).mkdir(parents=True, exist_ok=True)
        bench = Bench(heaved, keep or folder, with_ruckig, say)
        speed, accel, jerk = bench.limits
        if not as_json:
            print(f"one axis, {2 * signals.HALF_RANGE_MM:g} mm, limits {speed:g} mm/s, {accel:g} mm/s^2, {jerk:g} mm/s^3; cycle {bench.cycle_us} us; "
                  f"arrivals {signals.NETWORK_US / 1000:g} ms late + 0 to {signals.JITTER_US / 1000:g} ms of jitter, {signals.LOSS:.0%} lost, "
                  f"3 decimals; seed {seed}\n"
                  f"heaved: {', '.join(bench.styles)} ([udp] stream); {LIMITED}: speed and acceleration alone, as LinuxCNC's limit3; "
                  f"{RUCKIG}: {'version ' + bench.ruckig.version if bench.ruckig else bench.without}, each target at rest", file=out)
        result = {"limits": {"speed_mm_s": speed, "accel_mm_s2": accel, "jerk_mm_s3": jerk}, "ruckig": bench.ruckig.version if bench.ruckig else None,
                  "streams": []}
        for rate_hz in rates:
            entry = bench.stream(rate_hz, seconds, seed)
            result["streams"].append(entry)
            if not as_json:
                print_stream(entry, out)
        result["six"] = []
        for rate_hz in rates:
            entry = bench.six(rate_hz, seconds, seed)
            result["six"].append(entry)
            if not as_json:
                print_six(entry, out)
        result["steps"] = bench.steps()
        if as_json:
            json.dump(result, out, indent=1)
            print(file=out)
        else:
            print_steps(result["steps"], out)
            print(EXPLANATION, file=out)
