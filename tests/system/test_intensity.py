#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_intensity.py BIN - how much of a sender's motion is made, in offline runs: exact amplitudes, smooth changes (judged by tests/judge), the cap."""
import math
import re
import sys

import harness
import tap

T0 = 15000  # up and following by then
AXES = ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")
POSE = (5, -4, 3, 10, -12, 20)
PATIENT = {"udp__silence_hold_ms": 0}  # a lone pose stays
LAST_DIGITS = 3e-9  # of a trace's nine decimals


def frame(pose, time=None):
    values = ",".join(f"{value:.4f}" for value in pose)
    return f"@A6T:{values},{time}#" if time is not None else f"@A6:{values},0#"


def wave(i):
    return (6 * math.sin(i * .05), 4 * math.cos(i * .05), 2 * math.sin(i * .07), 15 * math.sin(i * .03), 9 * math.cos(i * .02), 20 * math.sin(i * .04))


def stream(seconds=12, period_ms=16, pose=wave):
    return [(T0 + i * period_ms, frame(pose(i))) for i in range(int(seconds * 1000 / period_ms))]


class Play:
    """A run that keeps every limit."""

    def __init__(self, bench, lines, config=None):
        text = "".join(f"{t} {what}\n" for t, what in sorted(lines, key=lambda line: line[0]))
        frames = bench.file("frames.txt", text)
        self.bytes = bench.play(frames, config=config)
        self.rows = harness.rows_of(self.bytes)
        bench.check_limits(config)

    def row(self, t_ms):
        """After the end everything rests."""
        return self.rows[min(t_ms, len(self.rows) - 1)]

    def pose(self, t_ms):
        return [float(self.row(t_ms)[name]) for name in AXES]

    def cylinders(self, t_ms):
        return [float(self.row(t_ms)[f"c{i}_mm"]) for i in range(1, 7)]


def near(values, wanted, by=LAST_DIGITS):
    assert all(abs(a - b) <= by for a, b in zip(values, wanted)), f"{values}, wanted {wanted}"


def scaled(percent, pose=POSE):
    return [value * percent / 100 for value in pose]


def lone_pose(bench):
    run = Play(bench, [(T0, frame(POSE)), (T0 + 4000, "!intensity 50"), (T0 + 8000, "!intensity 0"), (T0 + 12000, "!intensity 33")])
    near(run.pose(T0 + 3990), POSE)
    near(run.pose(T0 + 7990), scaled(50))
    assert run.pose(T0 + 11990) == [0] * 6
    near(run.pose(T0 + 15990), scaled(33))
    assert run.pose(T0 + 4010) != run.pose(T0 + 3990), "begins at once"
    near(run.pose(T0 + 4100), POSE, 0.02)  # and softly


def streamed(bench):
    full, half = Play(bench, stream()), Play(bench, [(5, "!intensity 50"), *stream()])
    for t in range(T0 + 3000, T0 + 11000, 7):
        near(half.pose(t), scaled(50, full.pose(t)), 1e-5)  # of the soft grip's boundary layer
    assert max(abs(full.pose(t)[0]) for t in range(T0 + 3000, T0 + 11000)) > 5.5


def hundred_is_nothing(bench):
    lines = [*stream(6), (T0 + 8000, frame(POSE, 1500)), (T0 + 10000, frame((80, 0, 0, 0, 0, 500))), (T0 + 13000, "@C6:60,70,60,60,60,60,0#")]
    assert Play(bench, [(0, "!intensity 100"), (T0 + 3000, "!intensity 100"), *lines]).bytes == Play(bench, lines).bytes


def zero_stays_at_neutral(bench):
    run = Play(bench, [(5, "!intensity 0"), *stream(6), (T0 + 7000, frame(POSE, 1000)), (T0 + 9000, "@C6:60,70,60,60,60,60,0#")])
    neutral = run.cylinders(T0 - 100)
    for t in range(T0, T0 + 12000, 5):
        assert run.cylinders(t) == neutral and run.pose(t) == run.pose(T0 - 100), t


def changes_in_a_stream(bench):
    changes = [(T0 + 5000, 40), (T0 + 7500, 90), (T0 + 7900, 0), (T0 + 11000, 100), (T0 + 11003, 99), (T0 + 11300, 70)]
    run = Play(bench, [*stream(15), *((t, f"!intensity {n}") for t, n in changes)])
    full = Play(bench, stream(15))
    near(run.pose(T0 + 7400), scaled(40, full.pose(T0 + 7400)), 1e-5)
    near(run.pose(T0 + 10990), [0] * 6, 1e-5)
    near(run.pose(T0 + 14500), scaled(70, full.pose(T0 + 14500)), 1e-5)


def timed_moves(bench):
    run = Play(bench, [(T0, frame(POSE, 3000)), (T0 + 4000, "!intensity 40"), (T0 + 7000, frame((-5, 4, 0, 10, 0, -20), 3000)),
                       (T0 + 8000, "!intensity 100"), (T0 + 11000, frame((6, 4, 0, 10, 0, -20), 800)), (T0 + 11300, "!intensity 50"),
                       (T0 + 12000, frame((-6, 4, 0, 10, 0, 20), 1500)), (T0 + 12500, frame((6, 4, 0, 10, 0, 20), 3500))])
    near(run.pose(T0 + 6990), scaled(40))
    near(run.pose(T0 + 10001), (-5, 4, 0, 10, 0, -20), 1e-6)
    near(run.pose(T0 + 16001), scaled(50, (6, 4, 0, 10, 0, 20)), 1e-6)


def beyond_the_workspace(bench):
    """What is out of reach at 100 % is in reach at 25 %: nothing may be pulled in before it is scaled."""
    far = (0, 0, 0, 0, 0, 200)
    run = Play(bench, [(5, "!intensity 25"), (T0, frame(far)), (T0 + 6000, frame(far)), (T0 + 6100, "!intensity 100"),
                       (T0 + 12000, frame(far)), (T0 + 16000, "!intensity 25"), (T0 + 20000, frame(far))])
    near(run.pose(T0 + 5900), (0, 0, 0, 0, 0, 50))
    assert "clamped" not in run.rows[T0 + 5900]["flags"]
    assert run.pose(T0 + 11900)[5] < 105.001 and "clamped" in run.rows[T0 + 11900]["flags"], run.rows[T0 + 11900]
    near(run.pose(T0 + 24000), (0, 0, 0, 0, 0, 50))


def cylinder_frames(bench):
    run = Play(bench, [(T0, "@C6:60,70,65,60,60,60,0#"), (T0 + 5000, "!intensity 50")])
    neutral = run.cylinders(T0 - 100)
    near(run.cylinders(T0 + 4900), (60, 70, 65, 60, 60, 60))
    near(run.cylinders(T0 + 9000), [n + (c - n) / 2 for n, c in zip(neutral, (60, 70, 65, 60, 60, 60))])


def survives_a_hold(bench):
    run = Play(bench, [(T0, frame(POSE)), (T0 + 4000, "!intensity 60"), (T0 + 8000, "!hold"), (T0 + 10000, "!intensity 20"),
                       (T0 + 13000, "!resume"), (T0 + 13100, frame(POSE)), (T0 + 20000, "!park"), (T0 + 40000, "!engage"), (T0 + 60000, frame(POSE))])
    near(run.pose(T0 + 7990), scaled(60))
    held = run.cylinders(T0 + 9900)
    assert all(run.cylinders(t) == held for t in range(T0 + 9900, T0 + 13000)), "nothing moves in HOLD"
    near(run.pose(T0 + 19000), scaled(20))
    near(run.pose(len(run.rows) - 1), scaled(20))


def changed_on_the_way(bench):
    """A hold in the middle of a change: it is complete when the platform goes on."""
    run = Play(bench, [(T0, frame(POSE)), (T0 + 4000, "!intensity 0"), (T0 + 4800, "!hold"), (T0 + 7000, "!resume"), (T0 + 7100, frame(POSE))])
    assert run.rows[T0 + 6900]["state"] == "HOLD" and run.pose(T0 + 6900)[0] > 0.1
    near(run.pose(len(run.rows) - 1), [0] * 6)


def capped(bench):
    config = bench.write_config("capped.ini", **PATIENT)
    config.write_text(config.read_text() + "\n[intensity]\nmax_percent = 60\n")
    run = Play(bench, [(T0, frame(POSE)), (T0 + 3000, "!intensity 61"), (T0 + 6000, "!intensity 30")], config)
    near(run.pose(T0 + 2900), scaled(60))
    near(run.pose(T0 + 5900), scaled(60))
    near(run.pose(T0 + 9000), scaled(30))
    refused = bench.heaved("--config", config, "--play", bench.file("r.txt", "5 !intensity 61\n6 !intensity 60\n"))
    assert "1 requests refused" in refused.stderr, refused.stderr


def start_above_the_cap(bench):
    config = bench.write_config("wrong.ini")
    config.write_text(config.read_text() + "\n[intensity]\nstart_percent = 61\nmax_percent = 60\n")
    run = bench.heaved("--config", config, "--check")
    assert run.returncode == 78 and "allowed: 0 to 60, or max" in run.stderr, run.stderr


def quick_changes_on_every_platform(bench):
    for source in sorted((harness.TOP / "config").glob("*.ini")):
        text = re.sub(r"(?m)^engage = manual", "engage = auto", source.read_text(encoding="utf-8"))
        config = bench.file("any.ini", text + "\n[intensity]\nramp_ms = 500\n")
        found = re.search(r"(?ms)^\[z\][^\[]*?^offset_mm *= *(-?[\d.]+)", text)
        offset = float(found[1]) if found else 0
        lines = [(20000 + 20 * i, f"@A3:{8 * math.sin(i * .06):.3f},{6 * math.cos(i * .06):.3f},{30 * math.sin(i * .05) - offset:.3f},0#") for i in range(500)]
        lines += [(20500 + 311 * i, f"!intensity {37 * i * i % 101}") for i in range(30)]
        run = Play(bench, lines, config)
        assert any(row["state"] == "ENGAGED" for row in run.rows)


CASES = {
    "a lone pose follows changes while its sender is silent": lone_pose,
    "a stream at 50 % has exactly half the amplitude": streamed,
    "100 % is the same bytes as no intensity at all": hundred_is_nothing,
    "0 % stays at neutral exactly": zero_stays_at_neutral,
    "changes in a stream, and changes of changes, keep every limit": changes_in_a_stream,
    "timed moves arrive scaled and in time, whatever is changed on their way": timed_moves,
    "a pose is scaled before it is pulled in": beyond_the_workspace,
    "cylinder frames are scaled about the neutral extensions": cylinder_frames,
    "it stays over hold, resume, park and engage; in HOLD nothing moves": survives_a_hold,
    "a hold in the middle of a change": changed_on_the_way,
    "more than max_percent is refused and changes nothing": capped,
    "a start above the cap is an error of the configuration": start_above_the_cap,
    "quick changes keep every limit on every ready-made platform": quick_changes_on_every_platform,
}


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1], **PATIENT) as bench:
        for name, test in CASES.items():
            with suite.case(name):
                test(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
