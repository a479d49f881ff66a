#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_envelope.py BIN - what --check and --envelope say of a geometry, against a mechanism in double precision that shares nothing with heaved."""
import csv
import io
import math
import random
import re
import resource
import signal
import sys

import harness
import mechanism
import tap

HEADER = "quantity,axis,other_axis,direction_deg,value,unit,cause,roll_deg,pitch_deg,yaw_deg,x_mm,y_mm,z_mm"
LEAST_MARGIN = 0.1
SAMPLES = 35
UNITS = ["deg"] * 3 + ["mm"] * 3

# a name, the ready-made platform, and what is changed
PLATFORMS = {
    "demo-hexapod": ("demo-hexapod.ini", {}),
    "hexapod-400": ("hexapod-400.ini", {}),
    "hexapod-435-300, turning about a head, up and off centre": ("hexapod-435-300.ini", {"geometry": {"mrp_mm": "40, -30, 600"}, "pose": {"neutral": "2, -3, 5, 20, -10, 30"}}),
    "tripod": ("tripod.ini", {}),
    "tripod-rotation": ("tripod-rotation.ini", {}),
    "tripod-rotation, turning about a head": ("tripod-rotation.ini", {"geometry": {"mrp_mm": "0, 0, 500"}}),
    "a hexapod with a long stroke that reaches a singularity": ("demo-hexapod.ini", {"geometry": {"stroke_mm": "900"}}),
}


def set_keys(text, changes):
    """Keys of an INI file set, in place or at the head of their section."""
    for section, keys in changes.items():
        for key, value in keys.items():
            line = rf"(?ms)(^\[{section}\]\n[^\[]*?^{key} *= *)[^;\n]*"
            text, count = re.subn(line, lambda match, value=value: f"{match[1]}{value} ", text, count=1)
            if not count:
                text = text.replace(f"[{section}]\n", f"[{section}]\n{key} = {value}\n", 1)
    return text


class Platform:
    def __init__(self, bench, source, changes):
        text = set_keys((harness.TOP / "config" / source).read_text(encoding="utf-8"), changes)
        self.bench = bench
        self.path = bench.file("envelope.ini", text)
        self.model = mechanism.Mechanism(self.path)
        run = bench.heaved("--config", self.path, "--envelope", "-")
        assert run.returncode == 0 and run.stderr == "", run.stderr
        assert run.stdout.startswith(HEADER + "\n")
        self.rows = list(csv.DictReader(io.StringIO(run.stdout)))
        self.limits = {axis: [self.model.limit(axis, what) for what in ("min", "max")] for axis in self.model.free}
        self.reach = {axis: [self.value("reach_min", axis), self.value("reach_max", axis)] for axis in self.model.free}

    def row(self, quantity, axis=None):
        name = "" if axis is None else mechanism.AXES[axis]
        found = [row for row in self.rows if row["quantity"] == quantity and row["axis"] == name]
        assert len(found) == 1, f"{quantity} of {name}: {len(found)} rows"
        return found[0]

    def value(self, quantity, axis=None):
        return float(self.row(quantity, axis)["value"])

    @staticmethod
    def pose(row):
        return [float(row[f"{name}_{unit}"]) for name, unit in zip(mechanism.AXES, UNITS)]

    def is_good(self, pose, slack=0.0):
        return self.model.is_inside(pose, slack) and self.model.singularity_margin(pose) > LEAST_MARGIN - slack

    def check_end(self, way, cause):
        """Along a way from neutral everything is within reach up to its end, nothing just beyond, and the cause is true."""
        def at(part):
            return [n + part * w for n, w in zip(self.model.neutral, way)]
        for part in range(7):
            assert self.model.is_inside(at(part / 6), 1e-3), f"at {part}/6 of the way to {at(1)} out of the stroke"
        assert self.is_good(at(1), 1e-3), f"{at(1)} is near a singularity"
        beyond = at(1 + 1e-3)
        if cause == "range":
            return
        assert not self.is_good(beyond), f"{beyond} is within reach"
        if cause == "singularity":
            assert abs(self.model.singularity_margin(at(1)) - LEAST_MARGIN) < 1e-3
        else:
            cylinder = int(cause.split()[1]) - 1
            extension = self.model.extensions(at(1))[cylinder]
            ends = [self.model.margin, self.model.stroke[cylinder] - self.model.margin]
            assert min(abs(extension - end) for end in ends) < 1e-3, f"{cause} is at {extension} mm"

    def check_reach(self):
        for axis in self.model.free:
            for quantity in ("reach_min", "reach_max"):
                row = self.row(quantity, axis)
                pose = self.model.neutral[:]
                pose[axis] = float(row["value"])
                assert max(abs(a - b) for a, b in zip(self.model.complete(pose), self.pose(row))) < 2e-3, row
                assert row["unit"] == UNITS[axis]
                self.check_end([p - n for p, n in zip(pose, self.model.neutral)], row["cause"])

    def check_pairs(self):
        pairs = [row for row in self.rows if row["quantity"] == "reach_pair"]
        free = self.model.free
        assert len(pairs) == 24 * len(free) * (len(free) - 1) / 2
        for row in pairs[::5 if len(free) == 6 else 1]:  # 5: every direction has its turn
            axes = [mechanism.AXES.index(row[name]) for name in ("axis", "other_axis")]
            angle = math.radians(float(row["direction_deg"]))
            way = [0.0] * 6
            for axis, part in zip(axes, (math.cos(angle), math.sin(angle))):
                way[axis] = abs(part) * (self.reach[axis][part > 0] - self.model.neutral[axis]) * float(row["value"])
            pose = self.model.complete([n + w for n, w in zip(self.model.neutral, way)])
            assert max(abs(a - b) for a, b in zip(pose, self.pose(row))) < 2e-3, row
            self.check_end(way, row["cause"])

    def samples(self, box, seed):
        """Poses of a box, uniform and at its faces; those outside are pulled in towards neutral."""
        rng = random.Random(seed)
        for _ in range(SAMPLES):
            way = [0.0] * 6
            for axis, (low, high) in box.items():
                target = rng.choice((low, high)) if rng.random() < 0.4 else rng.uniform(low, high)
                way[axis] = target - self.model.neutral[axis]
            inside, outside = 0.0, 1.0
            pose = [n + w for n, w in zip(self.model.neutral, way)]
            for _ in range(0 if self.model.is_inside(pose) else 12):
                middle = (inside + outside) / 2
                pose = [n + middle * w for n, w in zip(self.model.neutral, way)]
                inside, outside = (middle, outside) if self.model.is_inside(pose) else (inside, middle)
                pose = [n + inside * w for n, w in zip(self.model.neutral, way)]
            yield pose

    def check_figures_at_their_poses(self):
        """Each figure is what the model has at the pose that the row names."""
        for axis in self.model.free:
            for quantity in ("cylinder_per_axis_neutral", "cylinder_per_axis_worst_limits", "cylinder_per_axis_worst_reach"):
                row = self.row(quantity, axis)
                rates = [abs(rate) for rate in self.model.rates(self.pose(row), axis)]
                assert abs(max(rates) - float(row["value"])) < 1e-4, f"{row}: {rates}"
                assert abs(rates[int(row["cause"].split()[1]) - 1] - max(rates)) < 1e-4, f"{row}: {rates}"
                assert row["unit"] == f"mm/{UNITS[axis]}"
        for quantity in ("singularity_margin_neutral", "singularity_margin_least_limits", "singularity_margin_least_reach"):
            row = self.row(quantity)
            assert abs(self.model.singularity_margin(self.pose(row)) - float(row["value"])) < 1e-3, row
        row = self.row("cylinder_speed_all_axes_limits")
        sums = [sum(abs(rate) * self.model.limit(axis, "speed") for axis, rate in zip(self.model.free, rates)) for rates in
                zip(*(self.model.rates(self.pose(row), axis) for axis in self.model.free))]
        assert abs(max(sums) - float(row["value"])) < 0.05, f"{row}: {sums}"

    def check_worst(self):
        """No pose of a sample is worse, but for a little, than what is called the worst."""
        limits = {axis: [max(a[0], b[0]), min(a[1], b[1])] for axis, a, b in ((k, self.limits[k], self.reach[k]) for k in self.model.free)}
        for name, box in (("limits", limits), ("reach", self.reach)):
            worst = {axis: self.value(f"cylinder_per_axis_worst_{name}", axis) for axis in self.model.free}
            least = self.value(f"singularity_margin_least_{name}")
            for pose in self.samples(box, name):
                for axis in self.model.free:
                    most = max(abs(rate) for rate in self.model.rates(pose, axis))
                    assert most < 1.03 * worst[axis], f"{name}, {mechanism.AXES[axis]} at {pose}: {most} mm per unit"
                margin = self.model.singularity_margin(pose)
                assert margin > least - 0.02, f"{name}: a margin of {margin} at {pose}"

    def check_suggested_demand(self):
        """An axis alone at its suggested limits asks no cylinder for more than it has, anywhere within reach."""
        cylinders = self.model.ini["cylinders"]
        most = [float(cylinders[key]) for key in ("speed_mm_s", "accel_mm_s2", "jerk_mm_s3")]
        for pose in self.samples(self.reach, "suggested"):
            for axis in self.model.free:
                v, a, j = (self.value(f"suggested_{what}", axis) for what in ("speed", "accel", "jerk"))
                here = self.model.extensions(pose)
                steps = []
                for k in (-2, -1, 1, 2):
                    moved = pose[:]
                    moved[axis] += k
                    steps.append(self.model.extensions(moved))
                for low2, low, mid, high, high2 in zip(steps[0], steps[1], here, steps[2], steps[3]):
                    slope, bend, twist = abs(high - low) / 2, abs(high + low - 2 * mid), abs(high2 - 2 * high + 2 * low - low2) / 2
                    asked = (slope * v, slope * a + bend * v * v, slope * j + 3 * bend * v * a + twist * v ** 3)
                    assert all(x <= y for x, y in zip(asked, most)), f"{mechanism.AXES[axis]} at {pose} asks for {asked} of {most}"

    def suggested(self):
        """Changes to the configuration that make it what is suggested."""
        changes = {}
        for axis in self.model.free:
            unit = UNITS[axis]
            keys = {"min": f"min_{unit}", "max": f"max_{unit}", "speed": f"speed_{unit}_s", "accel": f"accel_{unit}_s2", "jerk": f"jerk_{unit}_s3"}
            changes[mechanism.AXES[axis]] = {key: f"{self.value(f'suggested_{what}', axis):g}" for what, key in keys.items()}
        return changes

    def check(self, changes):
        """The warnings of --check, and all of it."""
        path = self.bench.file("changed.ini", set_keys(self.path.read_text(encoding="utf-8"), changes))
        run = self.bench.heaved("--config", path, "--check")
        assert run.returncode == 0, run.stderr
        return re.findall(r"(?m)^warning: (.*)$", run.stdout), run.stdout

    def check_text(self):
        """--check prints the figures of the CSV."""
        text = self.check({})[1]
        for axis in self.model.free:
            row = re.search(rf"(?m)^  {mechanism.AXES[axis]} +(-?[\d.]+) to +(-?[\d.]+) .* ends at (.*) and (.*); ([\d.]+) mm", text)
            wanted = [f"{edge:.3f}" for edge in self.reach[axis]] + [self.row(f"reach_{end}", axis)["cause"] for end in ("min", "max")]
            assert list(row.groups()) == wanted + [f"{self.value('cylinder_per_axis_worst_limits', axis):.3f}"], row[0]
        assert re.search(r"singularity margin +([\d.]+) at neutral; ([\d.]+) at least", text).groups() == (
            f"{self.value('singularity_margin_neutral'):.3f}", f"{self.value('singularity_margin_least_limits'):.3f}")


def run_platforms(suite, bench):
    for name, (source, changes) in PLATFORMS.items():
        with suite.case(f"{name}: --envelope writes"):
            platform = Platform(bench, source, changes)
            for case, check in (("reach of each axis ends where a cylinder does", platform.check_reach),
                                ("reach of pairs of axes", platform.check_pairs),
                                ("figures hold at the poses they name", platform.check_figures_at_their_poses),
                                ("no pose is worse than the worst", platform.check_worst),
                                ("cylinders can serve what is suggested", platform.check_suggested_demand),
                                ("--check says the same", platform.check_text)):
                with suite.case(f"{name}: {case}"):
                    check()
            with suite.case(f"{name}: what is suggested needs no warning"):
                warnings = [line for line in platform.check(platform.suggested())[0] if "singularity" not in line and "is not level" not in line]
                assert not warnings, warnings


def applied(warnings):
    """What warnings say to set, as changes."""
    changes = {}
    for line in warnings:
        section = re.match(r"\[(\w+)\]", line)[1]
        changes.setdefault(section, {}).update(re.findall(r"(\w+) = (-?[\d.e+]+)", line))
    return changes


def run_warnings(suite, bench):
    demo = Platform(bench, "demo-hexapod.ini", {})
    with suite.case("limits beyond the reach: the warning names cylinder, reach and what to set; set, it is gone"):
        wide = {"roll": {"min_deg": -60, "max_deg": 60}, "x": {"max_mm": 300}}
        warnings = demo.check(wide)[0]
        assert [line.split()[0] for line in warnings] == ["[roll]", "[x]"], warnings
        assert all(re.search(r"cylinder \d ends it at -?[\d.]+, set", line) for line in warnings), warnings
        assert f"ends it at {demo.reach[0][0]:.3f}" in warnings[0] and f"ends it at {demo.reach[3][1]:.3f}" in warnings[1], warnings
        assert "min_mm" not in warnings[1], "an end within reach stays"
        for section, keys in applied(warnings).items():
            wide[section].update(keys)
        assert demo.check(wide)[0] == []
    with suite.case("limits that the cylinders cannot serve: speed, acceleration and jerk are named with numbers; set, the warning is gone"):
        fast = {"roll": {"speed_deg_s": 90}, "pitch": {"accel_deg_s2": 700, "jerk_deg_s3": 20000}, "z": {"jerk_mm_s3": 60000}}
        warnings = demo.check(fast)[0]
        asked = [re.findall(r"its (\w+) alone asks a cylinder for ([\d.]+) (\S+), above (\w+) of \[cylinders\], ([\d.]+)", line) for line in warnings]
        assert [[words[0] for words in line] for line in asked][:1] == [["speed"]], warnings
        assert [words[0] for words in asked[1]] == ["acceleration", "jerk"] and [words[0] for words in asked[2]] == ["jerk"], warnings
        worst = demo.value("cylinder_per_axis_worst_limits", 0)
        assert abs(float(asked[0][0][1]) - 90 * worst) < 0.1 and asked[0][0][2:] == ("mm/s", "speed_mm_s", "300.0"), warnings
        for section, keys in applied(warnings).items():
            fast[section].update(keys)
        assert demo.check(fast)[0] == [], demo.check(fast)[0]
    with suite.case("poses near a singularity within the limits are warned of"):
        long = Platform(bench, *PLATFORMS["a hexapod with a long stroke that reaches a singularity"])
        assert any(row["cause"] == "singularity" for row in long.rows), "nothing ends at a singularity"
        warnings = long.check({"yaw": {"min_deg": -170, "max_deg": 170}})[0]
        assert any("near a singularity" in line for line in warnings) and any("[yaw]" in line for line in warnings), warnings


def run_files(suite, bench):
    wanted = bench.heaved("--config", bench.config, "--envelope", "-").stdout
    folder = bench.folder / "out"
    folder.mkdir()
    out = folder / "envelope.csv"

    def write(path=out, **options):
        return bench.heaved("--config", bench.config, "--envelope", path, **options)

    with suite.case("a new file is the same bytes as standard output, nothing else is left in the folder"):
        assert write().returncode == 0 and out.read_text() == wanted and list(folder.iterdir()) == [out]
    with suite.case("an old file is replaced as a whole and keeps its permissions; a link stays a link"):
        link = bench.folder / "link.csv"
        link.symlink_to(out)
        out.write_text("old")
        out.chmod(0o640)
        before = out.stat().st_ino
        assert write(link).returncode == 0 and link.is_symlink() and out.read_text() == wanted
        assert out.stat().st_mode & 0o777 == 0o640 and out.stat().st_ino != before
    with suite.case("a disk that takes only a part: exit 74, the old file is untouched, nothing is left over"):
        def small():
            resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        out.write_text("old")
        run = write(preexec_fn=small)
        assert run.returncode == 74 and f"{out}: File too large" in run.stderr, run.stderr
        assert out.read_text() == "old" and list(folder.iterdir()) == [out]
    for name, path, code, part in (("a folder that is not there", "/nonexistent/e.csv", 73, "No such file"), ("a folder", folder, 73, "Is a directory"),
                                   ("a full device", "/dev/full", 74, "No space left")):
        with suite.case(f"{name}: exit {code}, and the message says which and why"):
            run = write(path)
            assert run.returncode == code and re.fullmatch(rf"heaved: {path}: {part}[^\n]*\n", run.stderr), (run.returncode, run.stderr)
    with suite.case("a device is written to, not replaced"):
        assert write("/dev/null").returncode == 0 and harness.Path("/dev/null").is_char_device()
    with suite.case("it excludes the other modes, and needs a name"):
        assert bench.heaved("--config", bench.config, "--envelope", out, "--check").returncode == 64
        assert bench.heaved("--config", bench.config, "--envelope").returncode == 64
        assert bench.heaved("--config", bench.config, "--envelope", out, "--trace", "x").returncode == 64


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1]) as bench:
        run_platforms(suite, bench)
        run_warnings(suite, bench)
        run_files(suite, bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
