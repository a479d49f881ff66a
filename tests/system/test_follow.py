#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_follow.py BIN - a platform does not only keep its limits, it goes where it is sent: senders of odd rates, jitter and times, and back
from beyond an axis' range."""
import math
import random
import sys

import harness
import tap

T0 = 15000  # ms: up and ready by then
PATIENT = {"udp__silence_hold_ms": 0}
SETTLED_MS = 2500  # a stream is followed as it should be so long after its start
LAG_MAX_MS = 150


def height(t_ms):
    return 20 * math.sin(math.pi * t_ms / 1000)


def arrivals(rate_hz, jitter_ms=0.0, seconds=7.0):
    """(arrival, time of the sample), in ms from the start of the stream."""
    dice = random.Random(5)
    at = 0.0
    for i in range(int(seconds * rate_hz)):
        at = max(at, 1000 * i / rate_hz + jitter_ms * dice.random())
        yield at, 1000 * i / rate_hz


def play(bench, lines, config=None):
    frames = bench.file("frames.txt", "".join(f"{t:.3f} {text}\n" for t, text in lines))
    return harness.rows_of(bench.play(frames, config=config))


def worst_error(rows, end_ms):
    """Largest distance to the signal, at the delay that suits best."""
    judged = [(float(row["t_ms"]) - T0, float(row["z_mm"])) for row in rows]
    judged = [(t, z) for t, z in judged if SETTLED_MS <= t < end_ms][::7]
    assert len(judged) > 500
    return min(max(abs(z - height(t - lag)) for t, z in judged) for lag in range(0, LAG_MAX_MS, 2))


def follows(bench, rate_hz, most_mm, jitter_ms=0.0, timed=None):
    head, tail = ("A6", 0) if timed is None else ("A6T", timed)
    lines = [(T0 + at, f"@{head}:0,0,0,0,0,{height(t):.3f},{tail}#") for at, t in arrivals(rate_hz, jitter_ms)]
    error = worst_error(play(bench, lines), lines[-1][0] - T0)
    assert error <= most_mm, f"{rate_hz} Hz, jitter {jitter_ms} ms, T {timed}: {error:.2f} mm"


def coarse_values(bench):
    """Whole millimetres, as some games send, ask for more than the axis can do at every step: the motion that was rounded comes out."""
    for rate, step_mm, most_mm in ((60, 1, 0.4), (30, 1, 0.5), (100, 1, 0.5), (100, 0.1, 0.4)):
        lines = [(T0 + at, f"@A6:0,0,0,0,0,{step_mm * round(height(t) / step_mm):.1f},0#") for at, t in arrivals(rate, 3)]
        rows = play(bench, [(0, "!engage"), *lines], harness.TOP / "config/hexapod-400.ini")
        error = worst_error(rows, lines[-1][0] - T0)
        assert error <= most_mm, f"{rate} Hz, steps of {step_mm} mm: {error:.2f} mm"


def beyond_an_end(bench, rate, speed, style, stands):
    """How far a ramp that ends is overshot, in mm; and how far what comes back goes beyond the last sample again."""
    text = (harness.TOP / "config/hexapod-400.ini").read_text(encoding="utf-8")
    config = bench.file("ends.ini", text.replace("stream = smooth", f"stream = {style}").replace("silence_hold_ms = 500", "silence_hold_ms = 0"))
    count = int(min(1.2 * rate + 2, 100 * rate / speed))
    heights = [speed * min(i, count - 1) / rate for i in range(count + (rate if stands else 0))]
    lines = [(0, "!engage"), (T0 - 3000, "@A6:0,0,0,0,0,0,0#")] + [(T0 + 1000 * i / rate, f"@A6:0,0,0,0,0,{z:.3f},0#") for i, z in enumerate(heights)]
    rows = play(bench, lines + [(lines[-1][0] + 3000, "!hold")], config)
    course = [float(row["z_mm"]) - round(heights[-1], 3) for row in rows if float(row["t_ms"]) >= T0]
    top = course.index(max(course))
    assert abs(course[-1]) < 1e-4, (rate, speed, style, stands, course[-1])
    return course[top], -min(course[top:])


def ends(bench):
    """Not beyond the last sample by more than the axis takes to stop; where no sample comes, three periods are bridged, 50 to 62 ms. `balanced`: its lead more, and to and fro by it."""
    for style, stands in (("smooth", False), ("smooth", True), ("balanced", True), ("balanced", False)):
        for rate in (10, 60, 200):
            for speed in (5, 150):
                stop_mm = speed * math.sqrt(speed / 40000)  # up to 3000 * 3000 / 40000 mm/s
                lead_mm = {"smooth": 0, "balanced": 0.4 * speed / rate}[style]
                bridged_s = min(max({"smooth": 3, "balanced": 3.7}[style] / rate, 0.050), 0.062)
                most_mm = max(1.04 * stop_mm, 0 if stands else bridged_s * speed) + lead_mm + 0.01
                over, back = beyond_an_end(bench, rate, speed, style, stands)
                assert over <= most_mm, f"{style}, {rate} Hz, {speed} mm/s, {stands}: {over:.3f} mm, not {most_mm:.3f}"
                most_back_mm = {"smooth": 0.05, "balanced": 0.05 + 0.26 * speed / rate}[style]
                assert back < most_back_mm, f"{style}, {rate} Hz, {speed} mm/s, {stands}: {back:.3f} mm back"


def usual_rates(bench):
    for rate in (20, 60, 200):
        follows(bench, rate, 0.7)


def rates_beyond_what_is_followed(bench):
    for rate in (251, 270, 333, 500, 600, 800, 1000, 2000):
        follows(bench, rate, 1)


def jitter_of_most_of_a_period(bench):
    for rate, jitter_ms in ((60, 11), (60, 13), (60, 16), (100, 9)):
        follows(bench, rate, 3.5, jitter_ms=jitter_ms)


def times_too_short_to_mean_any(bench):
    for rate, timed in ((200, 0), (333, 0), (1000, 0), (200, 1), (1000, 4)):
        follows(bench, rate, 1, timed=timed)
    follows(bench, 60, 1, jitter_ms=8, timed=0)  # gaps of more than 20 ms among shorter ones


def back_from_beyond_an_axis(bench):
    """Cylinders may lead where no pose axis is allowed to go; the next stream of poses leads back."""
    lines = [(0, "!engage"), (T0, "@C6:200,200,200,200,200,200,0#")]
    lines += [(T0 + 400 * i, "@C6:10,10,390,390,390,390,0#") for i in range(1, 11)]
    lines += [(T0 + 4400 + 1000 * i / 60, "@A6:0,0,0,0,0,0,0#") for i in range(1200)]
    rows = [row for row in play(bench, lines, harness.TOP / "config/hexapod-400.ini") if float(row["t_ms"]) <= lines[-1][0]]
    assert max(float(row["x_mm"]) for row in rows) > 305, "the cylinders did not lead beyond the range"
    assert all(float(rows[-1][axis]) == 0 for axis in ("roll_deg", "pitch_deg", "x_mm", "z_mm")), rows[-1]


def extensions_at_a_new_rate(bench):
    """Where gentle extensions go over from 750 Hz, which jitters, to 1 kHz, the way back to them is planned anew with every frame: it must
    not swing out further and further."""
    text = (harness.TOP / "config/tripod.ini").read_text(encoding="utf-8")
    config = bench.file("new-rate.ini", text.replace("silence_hold_ms = 1000", "silence_hold_ms = 0"))
    dice = random.Random(1)
    at, lines = 0.0, [(0, "!engage"), (T0 - 4000, "@C3:120,105,105,0#")]
    for i in range(2250 + 1800):
        t = i / 0.75 if i < 2250 else 3000 + i - 2249
        at = max(at, t + 1.2 * dice.random()) if i < 2250 else at + 1
        height_mm = [110 + 12 * math.sin(t * 0.0018850), 105 - 2 * math.cos(t * 0.0015), 105 + 4 * math.sin(t * 0.0012)]
        lines.append((T0 + at, "@C3:{:.3f},{:.3f},{:.3f},0#".format(*height_mm)))
    rows = [row for row in play(bench, [*lines, (T0 + at + 500, "!hold")], config) if T0 + 1000 < float(row["t_ms"]) < T0 + at]
    assert len(rows) > 3500
    for name, low, high in (("c1_mm", 98, 122), ("c2_mm", 103, 107), ("c3_mm", 101, 109)):
        beyond = max(max(low - float(row[name]), float(row[name]) - high) for row in rows)
        assert beyond < 5, f"{name}: {beyond:.2f} mm beyond where it is sent"


CASES = {
    "streams of usual rates": usual_rates,
    "extensions that go over to a new rate": extensions_at_a_new_rate,
    "values in coarse steps": coarse_values,
    "ends are not overshot by more than the axis takes to stop": ends,
    "streams faster than what is followed": rates_beyond_what_is_followed,
    "jitter of most of a period": jitter_of_most_of_a_period,
    "streams of frames whose time is too short to mean any": times_too_short_to_mean_any,
    "poses after cylinders led beyond an axis' range": back_from_beyond_an_axis,
}


def main():
    suite = tap.Suite()
    for name, case in CASES.items():
        with suite.case(name), harness.Bench(sys.argv[1], **PATIENT) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
