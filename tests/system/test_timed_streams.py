#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_timed_streams.py BIN - T frames whose T is their period, in offline runs: constant speed, the end on the last sample; and T frames by themselves."""
import json
import random
import subprocess
import sys

import harness
import tap

T0 = 15000  # up and following by then
TIMES_MS = (10, 16, 33, 100, 200, 400, 500)
SPEED = {True: 20, False: 8}  # mm/s: of quick streams, of slow ones


def frame(z, time_ms):
    return f"@A6T:0,0,0,0,0,{z:.4f},{time_ms}#"


def play(bench, lines):
    """Heights per ms from T0 on, with the take-over of a first pose long before; every limit kept."""
    lines = [(T0 - 3000, "@A6:0,0,0,0,0,0#"), *lines]
    frames = bench.file("frames.txt", "".join(f"{t:.3f} {text}\n" for t, text in lines))
    rows = harness.rows_of(bench.play(frames))
    check = subprocess.run([sys.executable, harness.TOP / "tools/check_trace", "--json", "--frames", frames, bench.config, bench.folder / "played.csv"],
                           stdout=subprocess.PIPE, text=True, check=False)
    assert check.returncode == 0 and json.loads(check.stdout)["violations"] == 0, check.stdout
    return [float(row["z_mm"]) for row in rows[T0:]]


def ramp(time_ms, jitter_ms, seed):
    dice = random.Random(seed)
    frames = max(16, 2000 // time_ms)
    speed = SPEED[time_ms <= 100]
    at = 0.0
    for i in range(frames):
        at = max(at, T0 + i * time_ms + jitter_ms * dice.random())
        yield at, frame(speed * i * time_ms / 1000, time_ms)


def speeds(heights, time_ms):
    return [(b - a) * 1000 / SPEED[time_ms <= 100] for a, b in zip(heights, heights[1:])]


def constant_rate(bench):
    for time_ms in TIMES_MS:
        for jitter_ms in (0, 5):
            lines = list(ramp(time_ms, jitter_ms, time_ms))
            heights = play(bench, lines)
            course = speeds(heights, time_ms)[: len(lines) * time_ms]
            reached = next(t for t, speed in enumerate(course) if speed >= 0.9)
            assert reached < 5 * time_ms + 200, (time_ms, jitter_ms, reached)
            assert min(course[reached:]) >= 0.8, (time_ms, jitter_ms, min(course[reached:]))
            last = float(lines[-1][1].split(",")[5])
            assert abs(heights[-1] - last) < 1e-4 and heights[-1] == heights[-2], (time_ms, jitter_ms, heights[-1], last)


def one_frame_late(bench):
    for time_ms in TIMES_MS:
        lines = list(ramp(time_ms, 0, 1))
        late = len(lines) * 2 // 3
        lines[late] = (lines[late][0] + time_ms, lines[late][1])
        course = speeds(play(bench, sorted(lines, key=lambda line: line[0])), time_ms)[6 * time_ms + 200 : len(lines) * time_ms]
        assert min(course) > (0.33 if time_ms > 50 else 0.7), (time_ms, min(course))


def by_itself(bench):
    for time_ms in (300, 400, 500):
        heights = play(bench, [(T0, frame(-5, 1000)), (T0 + 4000, frame(0, time_ms)), (T0 + 8000, frame(4, time_ms))])
        for start, z in ((4000, 0), (8000, 4)):
            assert abs(heights[start + time_ms - 4] - z) > 1e-9 and abs(heights[start + time_ms] - z) < 1e-4, (time_ms, heights[start + time_ms])
            assert heights[start + time_ms] == heights[start + time_ms + 100]


CASES = {
    "a constant rate is a constant speed, at T of 10 to 500 ms": constant_rate,
    "a frame that is late by a period does not stop it": one_frame_late,
    "a T frame by itself arrives at T": by_itself,
}


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1], udp__silence_hold_ms=0) as bench:
        for name, case in CASES.items():
            with suite.case(name):
                case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
