#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_axes.py BIN - reference point, signs, scales and offsets from the frame to the cylinders: properties of whole offline runs.

Where the plate is follows from the cylinders of the trace alone, by a mechanism in double precision that shares nothing with heaved.
"""
import math
import sys

import harness
import mechanism
import tap
from test_envelope import set_keys

FLAGS_OF_NO_STREAM = {"takeover", "clamped", "off-path"}
STILL_MM = 0.01
FADE_FRAMES = 110  # of 20 ms: the sender is faded in meanwhile, which takes 2 s
UNITS = ["deg"] * 3 + ["mm"] * 3

# a name, the ready-made platform, and what is changed
PLATFORMS = {
    "demo-hexapod": ("demo-hexapod.ini", {}),
    "demo-hexapod, turning about a head": ("demo-hexapod.ini", {"geometry": {"mrp_mm": "60, -40, 450"}}),
    "hexapod-400, turning below the plate": ("hexapod-400.ini", {"geometry": {"mrp_mm": "-120, 0, -300"}}),
    "tripod": ("tripod.ini", {}),
    "tripod-rotation, turning about a head": ("tripod-rotation.ini", {"geometry": {"mrp_mm": "0, 0, 300"}}),
}


class Platform:
    def __init__(self, bench, source, changes):
        self.bench = bench
        self.text = set_keys((harness.TOP / "config" / source).read_text(encoding="utf-8").replace("engage = manual", "engage = auto"), changes)
        self.model = mechanism.Mechanism(bench.file("axes.ini", self.text))
        self.start_ms = 12000  # up and engaged by then

    def frames(self, values):
        """A stream of values, one list of six for each 20 ms; its first one while it is faded in, and its last one for a while."""
        lines = []
        for index, value in enumerate(values[:1] * FADE_FRAMES + values + values[-1:] * 60):
            six = self.model.kind == "hexapod"
            sent = value if six else [value[0], value[1], value[5]]
            lines.append(f"{self.start_ms + 20 * index} @{'A6' if six else 'A3'}:{','.join(f'{number:.6f}' for number in sent)},0#\n")
        return "".join(lines)

    def play(self, values, changes=None):
        config = self.bench.file("axes.ini", set_keys(self.text, changes or {}))
        return self.bench.play(self.bench.file("axes.txt", self.frames(values)), config=config)

    def poses(self, trace, every=90):
        """The plate of some rows, from their cylinders."""
        guess = self.model.neutral
        rows = [row for row in harness.rows_of(trace) if float(row["t_ms"]) > self.start_ms + 20 * FADE_FRAMES and row["state"] == "ENGAGED"]
        assert not any(FLAGS_OF_NO_STREAM & set(row["flags"].split("|")) for row in rows), "the stream is not followed"
        found = []
        for row in rows[::every] + rows[-1:]:
            guess = self.model.forward([float(row[f"c{i + 1}_mm"]) for i in range(self.model.count)], guess)
            assert guess is not None, row
            found.append(guess)
        return found


def stream(axis, value_of, frames=150):
    """A single axis in motion, the others at 0. Multiples of 1/64, exact in binary and in six decimals."""
    return [[round(64 * value_of(index)) / 64 if k == axis else 0.0 for k in range(6)] for index in range(frames)]


def swing(size):
    return lambda index: size * math.sin(2 * math.pi * index / 150) * (1 - math.cos(math.pi * min(1, index / 75))) / 2


def turns_about_the_reference_point(platform):
    """A pure roll, pitch or yaw leaves the reference point where it is; on hinges as far as they let it: its height."""
    model = platform.model
    for axis in [k for k in model.free if k < 3]:
        poses = platform.poses(platform.play(stream(axis, swing(8))))
        still = model.point(model.complete(model.neutral), model.mrp)
        assert max(abs(pose[axis]) for pose in poses) > 7, "it does not turn"
        for pose in poses:
            at = model.point(pose, model.mrp)
            checked = (2,) if model.kind == "tripod-3rps" else (0, 1, 2)
            off = max(abs(at[k] - still[k]) for k in checked)
            assert off < STILL_MM, f"{mechanism.AXES[axis]} moves it by {off} mm at {pose}"
            others = [pose[k] for k in model.free if k != axis]
            assert max(map(abs, others)) < 1e-3, f"{mechanism.AXES[axis]} is not pure: {pose}"


def ends_where_it_was_sent(platform):
    """Every axis by itself, from the cylinders: its sense, its size, nothing else."""
    model = platform.model
    for axis in model.free:
        size = 5.0 if axis < 3 else 30.0
        pose = platform.poses(platform.play(stream(axis, lambda index, size=size: size * min(1, index / 50))), 10000)[-1]
        wanted = model.complete([size if k == axis else 0.0 for k in range(6)])
        off = [abs(a - b) for a, b in zip(pose, wanted)]
        assert max(off[:3]) < 1e-4 and max(off[3:]) < 1e-3, f"{mechanism.AXES[axis]}: {pose}, wanted {wanted}"


def together(platform, share=1.0):
    """All axes in motion at once, each in its own way."""
    sizes = [3, 2, 4, 10, 8, 12]
    return [[share * (round(64 * swing(sizes[k])(index + 7 * k)) / 64 if k in platform.model.free else 0.0) for k in range(6)] for index in range(200)]


def signs_mirror(platform):
    """sign = -1 gives to the byte what the negative values do, each axis for itself; and the mirrored motion."""
    model, values = platform.model, together(platform, 0.2)
    for turned in ({k for k in model.free if k % 2 == 0}, {k for k in model.free if k % 3 == 0}):
        mirrored = platform.play(values, {mechanism.AXES[k]: {"sign": -1} for k in turned})
        assert mirrored == platform.play([[-value if k in turned else value for k, value in enumerate(row)] for row in values]), turned
        pairs = list(zip(harness.rows_of(platform.play(values)), harness.rows_of(mirrored)))
        assert sum(not a["flags"] and not b["flags"] for a, b in pairs) > 2000
        for k in model.free:
            column = f"{mechanism.AXES[k]}_{UNITS[k]}"
            assert max(abs(float(row[column])) for row, _ in pairs) > 0.25
            # what goes before is the take-over, which leads each cylinder; limits of cylinders are no mirror images
            off = max(abs(float(a[column]) - (-1 if k in turned else 1) * float(b[column])) for a, b in pairs
                      if float(a["t_ms"]) > platform.start_ms + 20 * FADE_FRAMES and not a["flags"] and not b["flags"])
            assert off < 1e-5, f"{column}: off its mirror image by {off}"


def scale_and_offset(platform):
    """They give to the byte what scaled and shifted values do, each axis for itself: asked = sign * scale * sent + offset."""
    values = together(platform)
    factors = [(1, 0.5, 2), (-1, 1.25, -1.5), (1, 0, 3), (-1, 0.25, -2), (1, 0.75, 0.5), (-1, 1.5, 4)]
    changes = {mechanism.AXES[k]: {"sign": factors[k][0], "scale": factors[k][1], f"offset_{UNITS[k]}": factors[k][2]} for k in platform.model.free}
    wanted = [[factors[k][0] * factors[k][1] * row[k] + factors[k][2] if k in platform.model.free else 0.0 for k in range(6)] for row in values]
    assert platform.play(values, changes) == platform.play(wanted)


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1]) as bench:
        for name, (source, changes) in PLATFORMS.items():
            platform = Platform(bench, source, changes)
            for check in (turns_about_the_reference_point, ends_where_it_was_sent, signs_mirror, scale_and_offset):
                with suite.case(f"{name}: {check.__name__.replace('_', ' ')}"):
                    check(platform)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
