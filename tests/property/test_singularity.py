# SPDX-License-Identifier: MIT
"""Extensions given one by one: wherever a sender leads the cylinders, the platform stays in assemblies that they hold.

Strokes are made so long that most combinations of extensions belong to no pose, or to one near a singularity; random steps, timed moves
and streams of C frames follow each other. Every row of the trace is judged by kinematics in double precision that share nothing with
the core: the pose told belongs to the extensions, and its singularity margin is not below what a platform may have.
"""
import argparse
import random
import subprocess
import sys
import tempfile
from pathlib import Path

import tap
from mechanism import Mechanism

TOP = Path(__file__).resolve().parents[2]
LEAST = 0.1     # see KIN_MARGIN_LEAST_Q32
SLACK = 0.001   # of the jerk of the cycle in which a stop begins
EVERY_ROWS = 40
PLATFORMS = {
    "hexapod": ("demo-hexapod.ini", {"stroke_mm": "520", "retracted_length_mm": "330"}),
    "tripod": ("tripod.ini", {"stroke_mm": "900", "retracted_length_mm": "160"}),
    "tripod-3rps": ("tripod-rotation.ini", {"stroke_mm": "900", "retracted_length_mm": "160"}),
}


def make_platform(folder, source, changes):
    changes = {**changes, "silence_hold_ms": "0", "silence_neutral_ms": "0", "silence_settle_ms": "0"}
    lines = []
    for line in (TOP / "config" / source).read_text(encoding="utf-8").splitlines():
        key = line.split("=")[0].strip()
        lines.append(f"{key} = {changes[key]}" if key in changes else line)
    path = Path(folder) / source
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


class Run:
    """One run of heaved --play: its rows, and how often it said what."""

    def __init__(self, heaved, config, lines, wanted=lambda time: True):
        """Rows at other times than `wanted` are not read."""
        frames, trace = config.with_suffix(".frames"), config.with_suffix(".csv")
        frames.write_text("\n".join(lines) + "\n", encoding="ascii")
        run = subprocess.run([heaved, "--config", config, "--play", frames, "--trace", trace], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                             text=True, timeout=250, check=False)
        assert run.returncode == 0, run.stdout
        with open(trace, encoding="ascii") as file:
            names = file.readline().strip().split(",")
            self.rows = [dict(zip(names, line.strip().split(","))) for line in file if wanted(line[:line.index(",")])]
        self.text = run.stdout


def extensions(row, count):
    return [float(row[f"c{i + 1}_mm"]) for i in range(count)]


def pose(row):
    return [float(row[name]) for name in ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")]


def frame(mechanism, values, time_ms=None):
    name = f"C{mechanism.count}{'T' if time_ms else ''}"
    return f"@{name}:{','.join(f'{v:.3f}' for v in values)},{time_ms or 0}#"


def random_extensions(mechanism, rng):
    """A corner of the strokes, or anything between."""
    return [rng.choice([m, s - m, rng.uniform(m, s - m)]) for m, s in ((mechanism.margin + 1, stroke) for stroke in mechanism.stroke)]


def hostile_lines(mechanism, rng, seconds):
    lines, t, neutral = ["0 !engage"], 30000, mechanism.extensions(mechanism.neutral)
    while t < 30000 + seconds * 1000:
        kind = rng.choice([0, 1, 2, 2, 2, 3])
        if kind == 0:
            lines.append(f"{t} {frame(mechanism, random_extensions(mechanism, rng))}")
            t += rng.randrange(50, 3000)
        elif kind == 1:
            lines.append(f"{t} {frame(mechanism, random_extensions(mechanism, rng), rng.randrange(100, 3000))}")
            t += rng.randrange(50, 3000)
        elif kind == 2:
            start = neutral if rng.random() < 0.7 else random_extensions(mechanism, rng)
            end = random_extensions(mechanism, rng)
            steps = rng.randrange(10, 300)
            for n in range(steps):
                lines.append(f"{t} {frame(mechanism, [a + (b - a) * n / steps for a, b in zip(start, end)])}")
                t += 20
        else:
            lines.append(f"{t} {frame(mechanism, neutral)}")
            t += rng.randrange(500, 3000)
    return lines


def check_rows(mechanism, rows):
    """The smallest margin of the judged rows."""
    least = 1.0
    for row in rows[::EVERY_ROWS]:
        if row["state"] != "ENGAGED":
            continue
        assert "no-pose" not in row["flags"], f"{row['t_ms']}: no pose"
        at = pose(row)
        worst = max(abs(a - b) for a, b in zip(mechanism.extensions(at), extensions(row, mechanism.count)))
        assert worst < 1e-3, f"{row['t_ms']}: pose and extensions differ by {worst} mm"
        margin = mechanism.singularity_margin(at)
        assert margin > LEAST - SLACK, f"{row['t_ms']}: margin {margin:.4f}"
        least = min(least, margin)
    return least


def count_stops(rows):
    """How often the platform stopped by itself: it then takes over anew, which it does only once for a sender."""
    flags = [row["state"] == "ENGAGED" and "takeover" in row["flags"] for row in rows]
    return sum(now and not before for before, now in zip(flags, flags[1:])) - 1


def least_on_the_way(mechanism, target):
    """The smallest margin on the straight way of the cylinders from neutral; 0 where it is left by every pose."""
    start, pose, least = mechanism.extensions(mechanism.neutral), mechanism.neutral, 1.0
    for n in range(1, 61):
        pose = mechanism.forward([a + (b - a) * n / 60 for a, b in zip(start, target)], pose)
        if pose is None:
            return 0.0
        least = min(least, mechanism.singularity_margin(pose))
        if least < 0.05:
            return least
    return least


def single_targets(mechanism, rng, count):
    """From rest at neutral, one target at a time, and back. (time, target, margin on the way), and the lines."""
    neutral = [round(v, 3) for v in mechanism.extensions(mechanism.neutral)]
    targets, lines, t = [], ["0 !engage", f"25000 {frame(mechanism, neutral)}"], 35000
    while len(targets) < count:
        share = rng.choice([0.2, 0.5, 1.0])
        target = [round(a + share * (b - a), 3) for a, b in zip(neutral, random_extensions(mechanism, rng))]
        margin = least_on_the_way(mechanism, target)
        if not LEAST - 0.02 < margin < LEAST + 0.02:
            targets.append((t, target, margin))
            lines += [f"{t} {frame(mechanism, target)}", f"{t + 5500} {frame(mechanism, neutral)}"]
            t += 11000
    return targets, lines


def check_single_targets(mechanism, run, targets):
    """Those whose way is held are gone to exactly; the others never."""
    rows = {float(row["t_ms"]): row for row in run.rows}
    neutral, gone = mechanism.extensions(mechanism.neutral), 0
    for t, target, margin in targets:
        start, end = (extensions(rows[t + after], mechanism.count) for after in (0.0, 5400.0))
        if max(abs(a - b) for a, b in zip(start, neutral)) > 0.01:
            continue  # the way back led astray
        off = max(abs(a - b) for a, b in zip(end, target))
        if margin > LEAST:
            assert off < 1e-3, f"{t} ms: {target} with margin {margin:.3f} is not gone to, {off} mm are left"
            gone += 1
        else:
            assert off > 1.0, f"{t} ms: {target} is gone to, with margin {margin:.3f} on the way"
    return gone


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    parser.add_argument("--seconds", type=int, default=120)
    arguments = parser.parse_args()
    suite = tap.Suite()
    for name, (source, changes) in PLATFORMS.items():
        with tempfile.TemporaryDirectory(prefix="heave-") as folder:
            config = make_platform(folder, source, changes)
            mechanism = Mechanism(config)
            rng = random.Random(name)
            with suite.case(f"{name}: no row of a hostile sender is nearer to a singularity than allowed"):
                run = Run(arguments.heaved, config, hostile_lines(mechanism, rng, arguments.seconds))
                least = check_rows(mechanism, run.rows)
                stops = count_stops(run.rows)
                assert stops > 0, "no way led near a singularity: the test tests nothing"
                print(f"# {name}: {len(run.rows)} rows, {stops} stops, least margin {least:.4f}")
            with suite.case(f"{name}: targets whose way is held are gone to, others are not"):
                targets, lines = single_targets(mechanism, rng, 40)
                gone = check_single_targets(mechanism, Run(arguments.heaved, config, lines, wanted=lambda time: time.endswith("00.000")), targets)
                assert 5 < gone < len(targets) - 2, f"{gone} of {len(targets)} were gone to"
                print(f"# {name}: {gone} of {len(targets)} targets gone to")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
