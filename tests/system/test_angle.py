#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_angle.py BIN - the rotation motor in offline runs: as sent, limited, the shorter way; crossing 360 again and again, and in time with the rest."""
import json
import math
import random
import subprocess
import sys

import harness
import tap

T0 = 15000  # up and following by then
SPEED, ACCEL, JERK = 90, 180, 720  # of the demonstration platform
SHORTEST = {"angle__wrap": "shortest", "angle__min_deg": -32000, "angle__max_deg": 32000}


class Play:
    """A run of lines on the demonstration platform, patient with silent senders, within every limit; timed moves end in time."""

    def __init__(self, bench, lines, **changes):
        config = bench.write_config("angle.ini", udp__silence_hold_ms=0, **changes)
        frames = bench.file("frames.txt", "".join(f"{t} {what}\n" for t, what in sorted(lines, key=lambda line: line[0])))
        self.rows = harness.rows_of(bench.play(frames, config=config))
        bench.check_limits(config)
        if any("T:" in what for _, what in lines):
            self.check_timed_moves(bench, config, frames)

    @staticmethod
    def check_timed_moves(bench, config, frames):
        check = subprocess.run([sys.executable, harness.TOP / "tools/check_trace", "--json", "--frames", frames, config, bench.folder / "played.csv"],
                               stdout=subprocess.PIPE, text=True, check=False)
        assert check.returncode == 0, check.stdout
        assert json.loads(check.stdout)["violations"] == 0

    def row(self, t_ms):
        """After the end everything rests."""
        return self.rows[min(t_ms, len(self.rows) - 1)]

    def angle(self, t_ms):
        return float(self.row(t_ms)["angle_deg"])

    def end(self):
        return self.angle(len(self.rows))

    def angles(self):
        return [float(row["angle_deg"]) for row in self.rows]


def a4(angle, roll=0):
    return f"@A4:{roll},0,0,{angle:.4f},0#"


def near(value, wanted, by=1e-6):
    assert abs(value - wanted) <= by, f"{value}, wanted {wanted}"


def turns(angles):
    """Changes of direction; a ramp may end on a millionth of a degree to and fro."""
    count, way = 0, 0
    for before, after in zip(angles, angles[1:]):
        step = after - before
        if abs(step) > 1e-5:
            count += way * step < 0
            way = step
    return count


def as_sent(bench):
    run = Play(bench, [(T0, a4(359)), (T0 + 12000, a4(1)), (T0 + 24000, a4(-700)), (T0 + 50000, a4(900)), (T0 + 80000, a4(-32768))])
    for t, wanted in ((12000, 359), (24000, 1), (50000, -700), (80000, 720), (110000, -720)):
        near(run.angle(T0 + t - 10), wanted)
    assert "clamped" in run.row(T0 + 79000)["flags"] and "clamped" not in run.row(T0 + 49000)["flags"]


def as_sent_to_the_ends(bench):
    """The largest numbers that frames hold; at a speed that gets there."""
    fast = {"angle__min_deg": -32767, "angle__max_deg": 32767, "angle__speed_deg_s": 10000, "angle__accel_deg_s2": 30000, "angle__jerk_deg_s3": 2000000}
    run = Play(bench, [(T0, a4(32767)), (T0 + 9000, a4(-32767)), (T0 + 18000, a4(32767.9)), (T0 + 27000, a4(99999))], **fast)
    for t, wanted in ((9000, 32767), (18000, -32767), (27000, 32767)):
        near(run.angle(T0 + t - 10), wanted)
    near(run.end(), 32767)


def shorter_way(bench):
    steps = [(359, -1), (1, 1), (181, 181), (0, 360), (-90, 270), (-271, 89), (3600.5, 0.5), (-3599, 1), (180.25, -179.75), (0.5, 0.5)]
    run = Play(bench, [(T0 + 5000 * i, a4(sent)) for i, (sent, _) in enumerate(steps)], **SHORTEST)
    for i, (sent, wanted) in enumerate(steps):
        if sent != 181:  # half a turn exactly: either way
            near(run.angle(T0 + 5000 * (i + 1) - 10) % 360, wanted % 360)
    near(run.angle(T0 + 9990), 1)
    for i in range(1, len(steps)):
        moved = run.angle(T0 + 5000 * (i + 1) - 10) - run.angle(T0 + 5000 * i - 10)
        assert abs(moved) <= 180 + 1e-6, f"{steps[i]}: {moved}"


def random_steps(bench):
    """Against arithmetic of its own: every step at most half a turn, and the angle sent modulo a turn."""
    rng = random.Random(7)
    sent = [round(rng.uniform(-2000, 2000), 3) for _ in range(60)]
    run = Play(bench, [(T0 + 4500 * i, a4(angle)) for i, angle in enumerate(sent)], **SHORTEST)
    at = 0.0
    for i, angle in enumerate(sent):
        at += math.remainder(angle - at, 360)
        near(run.angle(T0 + 4500 * (i + 1) - 10), at, 1e-4)  # of 60 roundings to Q16.16


def repeated_on_the_way(bench):
    """More than half a turn behind, and told the same again and again: it must not turn back."""
    lines = [(T0 + 300 * i, a4(angle)) for i, angle in enumerate((170, 340, 150, 320))]  # 170, 340, 510, 680
    lines += [(T0 + 1200 + 200 * i, a4(320)) for i in range(50)]
    run = Play(bench, lines, **SHORTEST)
    assert turns(run.angles()) == 0
    near(run.end(), 680)


def stream_over_360(bench):
    """A steady turn, sent modulo 360: as smooth as the same turn sent unwrapped."""
    rate, period = 80, 20
    angle = [rate * period / 1000 * i for i in range(2000)]
    wrapped = Play(bench, [(T0 + period * i, a4(value % 360, 2)) for i, value in enumerate(angle)], **SHORTEST)
    plain = Play(bench, [(T0 + period * i, a4(value, 2)) for i, value in enumerate(angle)], **{**SHORTEST, "angle__wrap": "as-sent"})
    for t in range(T0, T0 + 40000):
        near(wrapped.angle(t), plain.angle(t), 2e-4)
    speed = [wrapped.angle(t + 1) - wrapped.angle(t) for t in range(T0 + 4000, T0 + 39000)]
    assert max(speed) - min(speed) < 1e-3 * rate / 10, f"{min(speed)} to {max(speed)} deg a cycle"
    near(wrapped.end(), angle[-1], 2e-4)


def stream_to_and_fro_over_360(bench):
    rng = random.Random(3)
    phase = [rng.uniform(0.02, 0.06) for _ in range(3)]
    angle = [25 * math.sin(phase[0] * i) + 12 * math.sin(phase[1] * i) + 5 * math.sin(phase[2] * i) for i in range(900)]
    wrapped = Play(bench, [(T0 + 20 * i, a4(value % 360)) for i, value in enumerate(angle)], **SHORTEST)
    plain = Play(bench, [(T0 + 20 * i, a4(value)) for i, value in enumerate(angle)], **SHORTEST)
    for t in range(T0, T0 + 18000):
        near(wrapped.angle(t), plain.angle(t), 2e-4)


def faster_than_the_motor(bench):
    """A turn that the motor cannot keep up with, and fall further behind than half a turn: one direction all the time."""
    run = Play(bench, [(T0 + 20 * i, a4(3 * i % 360)) for i in range(400)], **SHORTEST)
    assert turns(run.angles()) == 0
    near(run.end(), 3 * 399, 1e-3)


def into_the_limits(bench):
    """The same angle on the other side where the shorter way would end beyond a limit; clamped where no turn helps."""
    limits = {"angle__wrap": "shortest", "angle__min_deg": -200, "angle__max_deg": 200}
    run = Play(bench, [(T0, a4(150)), (T0 + 6000, a4(190)), (T0 + 12000, a4(215)), (T0 + 24000, a4(205)), (T0 + 30000, a4(150))], **limits)
    for t, wanted in ((6000, 150), (12000, 190), (24000, -145), (30000, -155), (40000, -210 + 360)):
        near(run.angle(T0 + t - 10), wanted)
    assert not any("clamped" in row["flags"] for row in run.rows)
    narrow = {"angle__wrap": "shortest", "angle__min_deg": -60, "angle__max_deg": 90}
    run = Play(bench, [(T0, a4(100)), (T0 + 5000, a4(-30)), (T0 + 10000, a4(300.5)), (T0 + 15000, a4(260))], **narrow)
    for t, wanted in ((5000, 90), (10000, -30), (15000, -59.5), (20000, -60)):
        near(run.angle(T0 + t - 10), wanted)
    assert "clamped" in run.row(T0 + 4000)["flags"] and "clamped" in run.row(T0 + 19000)["flags"]


def arrival(values, after):
    """Last change of a value, ms."""
    return max((i for i in range(after, len(values)) if abs(values[i] - values[i - 1]) > 2e-9), default=after)


def together(bench):
    """Timed moves: pose, cylinders and motor begin and end together, and so they do where the motor needs longer than asked."""
    for name, frame, time in (("A7T", "@A7T:5,4,3,10,5,20,100,{}#", 4000), ("A4T", "@A4T:5,4,20,-80,{}#", 3000), ("C7T", "@C7T:60,70,65,60,60,66,90,{}#", 3500),
                              ("A7T stretched", "@A7T:5,4,3,10,5,20,400,{}#", 2000), ("C7T stretched", "@C7T:60,70,65,60,60,66,300,{}#", 1500)):
        first = "@C7:55,55,55,55,55,55,0,0#" if name.startswith("C7") else a4(0)
        run = Play(bench, [(T0, first), (T0 + 5000, frame.format(time))])
        motor = arrival(run.angles(), T0 + 5000)
        rest = max(arrival([float(row[f"c{i}_mm"]) for row in run.rows], T0 + 5000) for i in range(1, 7))
        assert abs(motor - rest) <= 12 + time / 200, f"{name}: motor {motor - T0 - 5000} ms, cylinders {rest - T0 - 5000} ms"
        if "stretched" in name:
            assert motor > T0 + 5000 + time and any("stretched" in row["flags"] for row in run.rows), name
        else:
            assert abs(motor - T0 - 5000 - time) <= 12 + time / 200, f"{name}: {motor - T0 - 5000} ms"


def no_overshoot(bench):
    """Moves that take longer than asked use every limit: the ramp has to stay on their way all the same."""
    for angle in (20, 50, 100, 300, 500, 700):
        run = Play(bench, [(T0, a4(0)), (T0 + 5000, f"@A4T:5,4,20,{angle},100#")])
        assert turns(run.angles()) == 0 and max(run.angles()) < angle + 1e-3, f"{angle}: {max(run.angles())}"


def timed_shorter_way(bench):
    run = Play(bench, [(T0, a4(350)), (T0 + 3000, "@A7T:5,4,3,10,5,20,20,2000#"), (T0 + 6000, "@A7T:0,0,0,0,0,0,350,1500#")], **SHORTEST)
    near(run.angle(T0 + 5001), 20)
    near(run.angle(T0 + 7501), -10)
    assert turns(run.angles()) == 2, "back, forth, back"


def stays_where_a_stop_ended(bench):
    """A hold in the middle of a turn: a frame without an angle leaves the motor there, one with an angle takes the shorter way from there."""
    run = Play(bench, [(T0, a4(170)), (T0 + 1000, "!hold"), (T0 + 5000, "!resume"), (T0 + 5100, "@A6:1,0,0,0,0,0,0#"), (T0 + 9000, a4(-150))], **SHORTEST)
    held = run.angle(T0 + 4900)
    assert 5 < held < 100, held
    near(run.angle(T0 + 8900), held)
    near(run.end(), -150 if held < 30 else 210)


CASES = {
    "as sent: several turns, within min and max": as_sent,
    "as sent: the largest numbers that frames hold": as_sent_to_the_ends,
    "the shorter way, over many turns and negative angles": shorter_way,
    "the shorter way, random steps": random_steps,
    "the same angle again and again on the way to it does not turn the motor back": repeated_on_the_way,
    "a stream that crosses 360 is as smooth as one that does not": stream_over_360,
    "a stream to and fro over 360": stream_to_and_fro_over_360,
    "a stream faster than the motor turns it one way": faster_than_the_motor,
    "angles beyond a limit": into_the_limits,
    "A7T, A4T and C7T: everything arrives together": together,
    "moves as quick as the limits allow do not overshoot": no_overshoot,
    "timed moves take the shorter way": timed_shorter_way,
    "a stop on the way": stays_where_a_stop_ended,
}


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1]) as bench:
        for name, test in CASES.items():
            with suite.case(name):
                test(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
