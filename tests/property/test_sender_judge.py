#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_sender_judge.py - each bar of the judge of senders can fail: wrong motion is planted, and what is right passes.

usage: test_sender_judge.py CONFIG
"""
import math
import random
import sys

import sender_judge as J
import senders as S
import tap

ROWS, FIRST, LAG = 20000, 6000, 40
BEGIN = 14000


class Made:
    """A trace that somebody made."""

    def __init__(self, columns, cylinders=()):
        self.values, self.cylinders, self.rows = columns, list(cylinders), len(columns[0])


def lagged(signal, lag_ms=LAG):
    return [list(column) for column in zip(*(signal.at((i - lag_ms) * 1e-3) for i in range(ROWS)))]


def broken(figures):
    return sorted(figure.name for figure in figures if not figure.holds)


def expect(figures, *names):
    assert broken(figures) == sorted(names), f"{broken(figures)} broken, {sorted(names)} expected: {', '.join(map(str, figures))}"


def csv(platform, columns, begin_ms=BEGIN):
    """The text of a trace."""
    lines = ["t_ms,state,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm,angle_deg,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm,relays,flags"]
    for i, values in enumerate(zip(*columns)):
        numbers = [f"{v:.9f}" for v in (*platform.whole(values), *[0.0] * 7)]
        lines.append(",".join([f"{begin_ms + i}.000", "ENGAGED", *numbers, "0000", "accel|off-path"]))
    return "\n".join(lines) + "\n"


def main():
    platform = S.Platform(sys.argv[1])
    suite = tap.Suite()
    z, count = platform.index("z"), len(platform.free)
    weights = [platform.limits[0][z] / speed for speed in platform.limits[0]]
    size = [8.0 / w * (0.5 + 0.1 * k) for k, w in enumerate(weights)]
    shake = S.Waves(platform.home, size, 2.0)
    sine = S.Waves(platform.home, [40.0 if k == z else 0.0 for k in range(count)], 0.4)
    truth = sine.table(ROWS)
    low, high = ([m + way * s for m, s in zip(platform.home, size)] for way in (-1, 1))

    with suite.case("gain and direction: what was asked passes, 6 % more and 4 % beside do not"):
        good = lagged(shake)
        judged = lambda columns: J.gain(columns, platform.home, size, weights, FIRST, ROWS)  # noqa: E731
        expect(judged(good))
        expect(judged([[m + 1.06 * (v - m) for v in column] for column, m in zip(good, platform.home)]), "made/asked")
        asked = math.sqrt(sum((s * w) ** 2 for s, w in zip(size, weights)))
        beside = [column[:] for column in good]
        # at right angles: one axis more, another less
        beside[0][9000] += 0.04 * asked / weights[0] * size[1] * weights[1] / math.hypot(size[0] * weights[0], size[1] * weights[1])
        beside[1][9000] -= 0.04 * asked / weights[1] * size[0] * weights[0] / math.hypot(size[0] * weights[0], size[1] * weights[1])
        expect(judged(beside), "sideways")
    with suite.case("range: 3 % of the largest range beyond it, in one row"):
        good = lagged(shake)
        expect([J.reach(good, low, high, weights)])
        good[z][100] = high[z] + 0.03 * max((h - l) * w for l, h, w in zip(low, high, weights)) / weights[z]
        expect([J.reach(good, low, high, weights)], "beyond range")
    with suite.case("following: lag to a hundredth of a ms; one row 2 mm off, a slow drift, a rough one, a late one"):
        bars = {"worst_mm": 1.5, "lag_ms": 41.0, "shape": 20.0, "jerk": 1.2, "accel": 0.05}
        judged = lambda columns, **change: J.following(Made(columns), truth, platform, FIRST, ROWS - 100, weights, main=z, **{**bars, **change})  # noqa: E731
        good = lagged(sine, 40.37)
        figures = judged(good)
        expect(figures)
        assert abs(figures[0].value - 40.37) < 0.01 and figures[2].value < 0.2, f"lag {figures[0]}, {figures[2]}"
        off = [column[:] for column in good]
        off[z][9000] += 2.0
        expect(judged(off, jerk=None, accel=None), "worst")
        wave = [column[:] for column in good]
        wave[z] = [v + 0.05 * math.sin(0.01 * i) for i, v in enumerate(wave[z])]
        expect(judged(wave), "shape")
        shaken = [column[:] for column in good]
        shaken[z] = [v + 0.025 * math.sin(2 * math.pi * 10 * 1e-3 * i) for i, v in enumerate(shaken[z])]  # 0.07 m/s^2
        expect(judged(shaken, jerk=None), "accel not asked for")
        rough = [column[:] for column in good]
        rough[z] = [v + (1e-5 if i % 7 == 0 else 0) for i, v in enumerate(rough[z])]
        expect(judged(rough), "jerk ratio")
        expect(judged(lagged(sine, 55)), "lag")
    with suite.case("ramps: a slow moment and a fast one"):
        column = [0.02 * i for i in range(ROWS)]
        expect(J.ramp_speed(column, 20.0, 1000, 9000, 0.5, 1.6))
        expect(J.ramp_speed([v - min(0.15, 0.015 * max(0, i - 5000)) for i, v in enumerate(column)], 20.0, 1000, 9000, 0.5, 1.6), "slowest")
        expect(J.ramp_speed([v + min(0.15, 0.015 * max(0, i - 5000)) for i, v in enumerate(column)], 20.0, 1000, 9000, 0.5, 1.6), "fastest")
    with suite.case("limits: half a percent above each of them, in one row"):
        for order, name in ((1, "speed/limit"), (2, "accel/limit"), (3, "jerk/limit")):
            limit = platform.limits[order - 1][z] / 1000 ** order
            for factor, names in ((0.999, ()), (1.005, (name,))):
                rate = [0.0] * 300 + [limit * factor] * (1 if order == 3 else 3) + [0.0] * 300
                column = rate
                for _ in range(order):
                    total, summed = 0.0, []
                    for v in column:
                        total += v
                        summed.append(total)
                    column = summed
                columns = [[0.0] * len(column) for _ in range(count)]
                columns[z] = column
                found = [figure for figure in J.limits(Made(columns), platform, [("", 0, len(column))]) if figure.name == name]
                expect(found, *names)
    with suite.case("taken over: a cylinder faster than engage speed and 1.1 x the stream's own"):
        own = [platform.extensions(platform.whole(values)) for values in zip(*(column[::4] for column in truth))]
        fastest = [J.most([(b - a) * 250 for a, b in zip(column, column[1:])]) for column in zip(*own)]
        assert all(abs(a - b) < 1e-3 * a for a, b in zip(fastest, J.own_speeds(platform, truth)))
        for factor, names in ((0.98, ()), (1.05, ("cylinder speed/allowed",))):
            cylinders = [[factor * (platform.engage_speed + 1.1 * speed + 0.5) * 1e-3 * i for i in range(3000)] for speed in fastest]
            expect(J.engage_speed(Made(truth, cylinders), platform, J.own_speeds(platform, truth), 0, 3000), *names)
    with suite.case("the least time to a rest: known ones, and no profile of random phases is faster"):
        for way in (1.0, 400.0):
            # far: speed reached, and acceleration reached
            v, a, j = 400.0, 3000.0, 40000.0
            if way == 400.0:
                known = way / v + v / a + a / j
            else:
                known = 4 * (way / (2 * j)) ** (1 / 3)
            assert abs(J.optimal_time(0, 0, 0, way, v, a, j) - known) < 1e-6, f"{J.optimal_time(0, 0, 0, way, v, a, j)} for {known}"
        chance, tried = random.Random(5), 0
        for _ in range(2000):
            v0, a0 = chance.uniform(-300, 300), chance.uniform(-2000, 2000)
            # random phases that keep the limits, brought to rest as quickly as can be: where they end, the optimum may not need longer
            p, v, a, t, fine = 0.0, v0, a0, 0.0, True
            for _ in range(chance.randrange(1, 5)):
                jerk, span = chance.choice((-4e4, 0, 4e4)), chance.uniform(0, 0.08)
                for _ in range(8):
                    p, v, a = J._run(p, v, a, [(jerk, span / 8)])
                    fine = fine and abs(a) <= 3000 and abs(v) <= 400 and abs(v + a * abs(a) / 8e4) <= 400  # the stop keeps them too
                t += span
            parts = J._to_speed(v, a, 0.0, 3000.0, 4e4)
            end = J._run(p, v, a, parts)
            assert abs(end[1]) < 1e-6 and abs(end[2]) < 1e-6, f"the stop from {v}, {a} ends with {end}"
            tried += fine
            if fine:
                need = J.optimal_time(0.0, v0, a0, end[0], 400.0, 3000.0, 4e4)
                assert need <= t + sum(s for _, s in parts) + 1e-6, f"{need} s where {t + sum(s for _, s in parts)} do, from {v0}, {a0} to {end[0]}"
        assert tried > 300, f"{tried} of 2000 profiles keep the limits"
    with suite.case("steps: one that takes 1.3 times as long, one that goes 1 mm too far"):
        goal = list(platform.home)
        goal[z] += 30.0
        need = J.optimal_time(0, 0, 0, 30.0, *(limits[z] for limits in platform.limits))
        for factor, extra in ((1.02, 0.0), (1.3, 0.0), (1.02, 1.0)):
            columns = [[home] * 3000 for home in platform.home]
            for i in range(3000):
                x = min(1.0, max(0.0, (i - 100) / (1000 * need * factor)))
                columns[z][i] += 30.0 * (10 * x ** 3 - 15 * x ** 4 + 6 * x ** 5) + (extra if 0.98 < x < 1 else 0)
            optimum, settled, beyond = J.step(Made(columns), platform, 100, 2900, goal)
            assert abs(optimum - 1000 * need) < 1e-3 and abs(settled / optimum - factor) < 0.06, f"{settled} of {optimum}"
            assert (beyond > 0.5) == (extra > 0), f"{beyond} too far"
    with suite.case("a trace is read whole, whatever its flags; missing rows and other files are refused"):
        text = csv(platform, [column[:500] for column in truth])
        trace = J.Trace(text, platform, BEGIN)
        assert trace.rows == 500 and abs(trace.values[z][333] - truth[z][333]) < 1e-8
        lines = text.split("\n")
        for wrong in ("\n".join(lines[:200] + lines[201:]), "x" + text):
            try:
                J.Trace(wrong, platform, BEGIN)
            except AssertionError:
                continue
            raise AssertionError("a trace with a missing row, or none, was taken")
    with suite.case("senders: what is sent when"):
        chance = S.chance_of(1)
        cue = S.Cue(chance, platform.home, size, 20.0)
        table = cue.table(20000)
        assert all(abs(column[i] - value) < 1e-8 for i in range(0, 20000, 37) for column, value in zip(table, cue.at(i * 1e-3)))
        assert [round(s.arrives, 6) for s in S.paused(S.even(10, 1), 0.5, 0.15, True)][4:7] == [0.4, 0.65, 0.75]
        assert [round(s.at, 6) for s in S.paused(S.even(10, 1), 0.5, 0.15, True)][4:7] == [0.4, 0.5, 0.6]
        assert [round(s.at, 6) for s in S.paused(S.even(10, 1), 0.5, 0.15, False)][4:7] == [0.4, 0.65, 0.75]
        ticks = S.ticks(100, 1)
        assert all(abs(s.arrives * 64 - round(s.arrives * 64)) < 1e-9 and s.arrives >= s.at for s in ticks)
        stalled = S.stalled(S.even(60, 2), [(1.0, 0.2)])
        assert not [s for s in stalled if 1.0 <= s.arrives < 1.2] and sum(1.2 <= s.arrives < 1.2005 for s in stalled) >= 12
        relays = S.with_relays(S.even(50, 1), 10, 0.008)
        again = [(a, b) for a, b in zip(relays, relays[1:]) if a.at == b.at]
        assert len(again) == 4 and all(abs(b.arrives - a.arrives - 0.008) < 1e-9 and a.mask != b.mask for a, b in again), again
        frames = S.frames(platform, sine, S.network(S.even(60, 2), chance, 0, 12e-3))
        assert all(b[0] >= a[0] for a, b in zip(frames, frames[1:]))
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
