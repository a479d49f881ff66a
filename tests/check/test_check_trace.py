#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_check_trace.py - tools/check_trace passes what keeps the limits, up to exactly on them, and finds each single thing that does not."""
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path[:0] = [str(TOP / "python"), str(HERE)]
import synthetic_trace as synthetic  # noqa: E402  the path above has to be set first
from heave.recording import Line, unescape  # noqa: E402
from heave.configuration import ConfigError, Configuration  # noqa: E402
from synthetic_trace import NANO, Trace, there_and_back  # noqa: E402
from heave.judge.timed import TimedWatcher  # noqa: E402
from heave.judge.checker import Checker  # noqa: E402
from heave.trace import COLUMNS  # noqa: E402

NANOMETRE = NANO // 10**6
FOLDER = tempfile.TemporaryDirectory()
CONFIG = Path(FOLDER.name) / "platform.ini"


def platform(**changes):
    CONFIG.write_text(synthetic.ini(**changes), encoding="utf-8")
    return Configuration(CONFIG)


def rules_broken(lines, on=None, **options):
    checker = Checker(on or platform(), **options)
    checker.read(lines)
    return checker.findings.by_rule


def expect(broken, *rules):
    """Exactly these rules and no other."""
    assert set(broken) == set(rules), f"found {broken}, expected {set(rules) or 'nothing'}"


def good_day(_made=[]):  # noqa: B006  made once, as it takes a while
    if not _made:
        _made.append(synthetic.whole_day())
    trace = Trace()
    trace.rows = [[t_us, name, numbers[:], mask, words] for t_us, name, numbers, mask, words in _made[0].rows]
    return trace


# ---- one fault each, put into a good trace of all states ----
def shift(name, amount, state="ENGAGED", which=1500):
    def change(trace):
        trace.rows[trace.index(state, which)][2][trace.column(name)] += amount
    return change


def relays(value, state="ENGAGED", which=1500):
    def change(trace):
        trace.rows[trace.index(state, which)][3] = value
    return change


def flags(text):
    def change(trace):
        trace.rows[trace.index("ENGAGED", 1500)][4] = text
    return change


def gap(trace):
    for row in trace.rows[trace.index("ENGAGED", 900):]:
        row[0] += 1000


def twice(trace):
    for row in trace.rows[trace.index("ENGAGED", 900):]:
        row[0] -= 1000


def uneven(trace):
    trace.rows[trace.index("ENGAGED", 900)][0] += 1


def state(name, of, which):
    def change(trace):
        trace.rows[trace.index(of, which)][1] = name
    return change


def all_rows(of, number_column, amount):
    def change(trace):
        for row in trace.rows:
            if row[1] == of:
                row[2][number_column] += amount
    return change


def still_moving_hold(trace):
    """The hold comes to rest and sets off again, slowly."""
    row, column = trace.rows[trace.index("HOLD", -1)], trace.column("angle_deg")
    row[2][column] += 1


def faster_rise(trace):
    """Every other row of it."""
    start = trace.index("RISING")
    del trace.rows[start + 1:start + 1800:2]
    for i, row in enumerate(trace.rows):
        row[0] = i * 1000


FAULTS = {
    # name: (change, rules that must be broken and no others)
    "a jump of 1 um of a cylinder": (shift("c3_mm", 1000 * NANOMETRE), {"cylinder jerk", "pose and cylinders agree"}),
    "a jump of 1 um of the pose": (shift("x_mm", 1000 * NANOMETRE), {"x jerk", "pose and cylinders agree"}),
    "a jump of 0.001 deg of the rotation motor": (shift("angle_deg", NANO // 1000), {"angle jerk"}),
    "a jump of 1 um at rest": (shift("c1_mm", 1000 * NANOMETRE, "SETTLED", 30), {"rest", "pose and cylinders agree"}),
    "the smallest move at rest": (shift("c1_mm", 1, "SETTLED", 30), {"rest"}),
    "the smallest move in NEUTRAL": (shift("angle_deg", 1, "NEUTRAL", 10), {"rest"}),
    "a hold that sets off again": (still_moving_hold, {"rest"}),
    "a cylinder that does not fit the pose by 2 nm": (all_rows("SETTLED", 9, 2 * NANOMETRE), {"settled extension", "pose and cylinders agree"}),
    "a relay outside ENGAGED": (relays(1, "HOLD", 100), {"relays"}),
    "a relay in the first row of HOLD": (relays(0x10, "HOLD", 0), {"relays"}),
    "a relay in the e-stop": (relays(0x10, "ESTOP", 0), {"relays"}),
    "a relay that the platform lacks": (relays(0x1F0), {"relays"}),
    "a row that is missing": (gap, {"time"}),
    "a time that stands twice": (twice, {"time"}),
    "a time that is 1 us late": (uneven, {"time"}),
    "an unknown flag": (flags("clamped|odd"), {"flags"}),
    "a flag that stands twice": (flags("clamped|clamped"), {"flags"}),
    "ENGAGED straight from SETTLED": (state("ENGAGED", "SETTLED", 50), {"state"}),
    "an e-stop that ends by itself": (state("HOLD", "ESTOP", -1), {"state"}),
    "a fault that ends by itself": (state("FAULT", "NEUTRAL", 3), {"state"}),
    "rising too fast": (faster_rise, {"engage speed"}),
}


def with_line(change):
    """The good trace as lines, one of them changed."""
    lines = list(good_day().lines())
    lines[3000] = change(lines[3000])
    return lines


def skipped(flag_text):
    """Three cycles are left out."""
    def change(trace):
        at = trace.index("ENGAGED", 900)
        for row in trace.rows[at:]:
            row[0] += 3000
        trace.rows[at][4] = flag_text
    return change


MALFORMED = {
    "a missing column": lambda line: line.replace(",", "", 1),
    "eight decimals": lambda line: line.replace(".000000000,", ".00000000,", 1) if ".000000000," in line else line[:-8] + line[-7:],
    "an exponent": lambda line: line.replace(",ENGAGED,", ",ENGAGED,1e-9,", 1),
    "a negative zero": lambda line: ",".join(["-0.000000000" if i == 2 else part for i, part in enumerate(line.split(","))]),
    "an unknown state": lambda line: line.replace("ENGAGED", "ENGAGING"),
    "CRLF": lambda line: line.replace("\n", "\r\n"),
    "an empty line": lambda line: "\n",
    "a blank": lambda line: line.replace(",", ", ", 1),
}


# ---- limits, exactly kept and just exceeded ----
def moving_cylinder(profile):
    """Cylinder 1 alone moves; no pose belongs to it."""
    trace = at_neutral()
    start = trace.rows[-1][2]
    for p in profile:
        numbers = list(start)
        numbers[7] += p
        trace.add("ENGAGED", numbers, flags="cylinders|no-pose")
    return trace


def moving_axis(axis):
    def build(profile):
        trace = at_neutral()
        start, column = trace.rows[-1][2], {"roll": 0, "x": 3}[axis]
        for p in profile:
            pose = [0.0] * 6
            pose[column] = p / NANO
            trace.add("ENGAGED", [*start[:column], p, *start[column + 1:7], *(round(v * NANO) for v in synthetic.extensions(pose))])
        return trace
    return build


def moving_angle(profile):
    trace = at_neutral()
    start = trace.rows[-1][2]
    for p in profile:
        trace.add("ENGAGED", [*start[:6], p, *start[7:]])
    return trace


def at_neutral():
    trace = Trace()
    trace.pose("NEUTRAL", (0, 0, 0, 0, 0, 0))
    trace.repeat(5)
    trace.repeat(5, state="ENGAGED")
    return trace


MOVERS = {"cylinder": ("c", moving_cylinder), "angle": ("angle", moving_angle), "roll": ("roll", moving_axis("roll")), "x": ("x", moving_axis("x"))}
ORDERS = {1: ("speed", 1.01), 2: ("accel", 1.01), 3: ("jerk", 1.02)}


def check_limits(suite):
    for mover, (limits_of, build) in MOVERS.items():
        for order, (name, over) in ORDERS.items():
            with suite.case(f"{mover} {name} exactly at the limit passes"):
                expect(rules_broken(build(there_and_back(limits_of, order, 1)).lines()))
            with suite.case(f"{mover} {name} {over - 1:.0%} over the limit is found"):
                expect(rules_broken(build(there_and_back(limits_of, order, over)).lines()), f"{mover} {name}")
    for text, broken in (("takeover", ["roll speed"]), ("speed|accel|stretched", ["roll speed"]),
                         ("clamped", []), ("off-path|speed", []), ("cylinders", []), ("accel|no-pose", [])):
        with suite.case(f"speed of a pose axis 1% over the limit is {'found' if broken else 'fine'} in rows with {text}"):
            trace = moving_axis("roll")(there_and_back("roll", 1, 1.01))
            for row in trace.rows[10:]:
                row[4] = text
            expect(rules_broken(trace.lines()), *broken)
    with suite.case("... but those of the cylinders do"):
        trace = moving_cylinder(there_and_back("c", 1, 1.01))
        for row in trace.rows[10:]:
            row[4] = "clamped|cylinders|takeover|off-path|no-pose|speed|accel|stretched|late|fault|estop|silent"
        expect(rules_broken(trace.lines()), "cylinder speed")
    with suite.case("a fault is found on either side of a block's end, and across it"):
        trace = moving_cylinder(there_and_back("c", 3, 1.02))
        for rows in range(1, len(trace.rows)):
            expect(rules_broken(trace.lines(), block_rows=rows), "cylinder jerk")
    with suite.case("the result does not depend on where blocks end"):
        trace = good_day()
        shift("c3_mm", 1000 * NANOMETRE)(trace)
        results = [rules_broken(trace.lines(), block_rows=rows) for rows in (1, 7, 1000, 100000)]
        assert all(result == results[0] for result in results), results


def steady(state_name, pose, rows=30):
    trace = Trace()
    trace.pose(state_name, pose, flags="cylinders")
    trace.repeat(rows)
    return trace


def z_of(extension):
    return math.sqrt((synthetic.RETRACTED + extension)**2 - synthetic.LEAN**2) - synthetic.ZERO_HEIGHT


def extension_of(z):
    return synthetic.extensions((0, 0, 0, 0, 0, z))[0]


def slide(trace, state_name, start, end, cycles=2000):
    """All cylinders from one extension to another."""
    for i in range(cycles + 1):
        trace.pose(state_name, (0, 0, 0, 0, 0, z_of(start + (end - start) * synthetic.smooth(i / cycles))), flags="cylinders")


STROKES = [f"c{i}_mm stroke" for i in range(1, 7)]


def check_stroke(suite):
    for end in (1.0, 199.0):
        with suite.case(f"extending to {end} mm, which is the margin, passes"):
            trace = Trace()
            slide(trace, "ENGAGED", 100, end)
            expect(rules_broken(trace.lines()))
        with suite.case(f"0.001 mm beyond {end} mm is found"):
            trace = Trace()
            slide(trace, "ENGAGED", 100, end + math.copysign(0.001, end - 100))
            expect(rules_broken(trace.lines()), *STROKES)
    with suite.case("a platform placed outside the margins may come in"):
        trace = Trace()
        slide(trace, "ENGAGED", 0.2, 100)
        expect(rules_broken(trace.lines()))
    with suite.case("... but not go further out"):
        trace = Trace()
        slide(trace, "ENGAGED", 0.2, 0.199)
        expect(rules_broken(trace.lines()), *STROKES)
    with suite.case("... nor out again"):
        trace = Trace()
        slide(trace, "ENGAGED", 0.2, 0.5)
        slide(trace, "ENGAGED", 0.5, 0.4)
        expect(rules_broken(trace.lines()), *STROKES)
    for text, end, rules in (("clamped", 94.0, set()), ("clamped", 95.001, {"z position"}), ("", 94.0, {"z position"})):
        with suite.case(f"an axis placed at 95 mm, bounds of 90, in to 80 and out to {end} is {'found' if rules else 'fine'}, flags {text or 'none'}"):
            trace = Trace()
            slide(trace, "ENGAGED", extension_of(0), extension_of(95))
            for start, stop in ((95, 80), (80, end)):
                for i in range(1001):
                    trace.pose("ENGAGED", (0, 0, 0, 0, 0, start + (stop - start) * synthetic.smooth(i / 1000)), flags=text)
            trace.pose("ENGAGED", (0, 0, 0, 0, 0, end), flags=text)
            expect(rules_broken(trace.lines()), *rules)
    with suite.case("bounds of a pose axis: 0.001 mm beyond is found, unless in cylinder space"):
        for text, rules in (("", {"z position"}), ("clamped", {"z position"}), ("cylinders", set())):
            trace = Trace()
            for i in range(1001):
                trace.pose("ENGAGED", (0, 0, 0, 0, 0, 90.001 * synthetic.smooth(i / 1000)), flags=text)
            expect(rules_broken(trace.lines()), *rules)


def check_states(suite):
    with suite.case("a FAULT keeps the limits until it rests, not after"):
        profile = there_and_back("c", 1, 1)
        trace = moving_cylinder(profile)
        for row in trace.rows[200:]:
            row[1] = "FAULT"
        expect(rules_broken(trace.lines()))
        for row in trace.rows[200:]:
            row[2][8] += NANO // 1000
        expect(rules_broken(trace.lines()), "cylinder jerk")
        trace = moving_cylinder(profile)
        trace.repeat(10, state="FAULT")
        trace.repeat(10)
        trace.rows[-1][2][8] += 10 * NANO
        expect(rules_broken(trace.lines()))
    with suite.case("a HOLD, FAULT or shutdown that never rests is found"):
        for name in ("HOLD", "FAULT", "OFF", "SETTLING"):
            trace = at_neutral()
            start = trace.rows[-1][2]
            push = [720] * 10 + [-720] * 10
            angle, speed, accel = start[6], 0, 0
            for i in range(6000):
                accel += push[i] if i < len(push) else 0
                speed += accel
                angle += speed
                trace.add("ENGAGED" if i < 30 else name, [*start[:6], angle, *start[7:]])
            expect(rules_broken(trace.lines()), "rest")
    with suite.case("NEUTRAL somewhere else is found"):
        expect(rules_broken(steady("NEUTRAL", (0, 0, 0, 0, 0, 0.01)).lines()), "neutral pose")
    with suite.case("SETTLED somewhere else is found"):
        expect(rules_broken(steady("SETTLED", (0, 0, 0, 0, 0, z_of(synthetic.SETTLED + 1e-6))).lines()), "settled extension")


def tripod_text(kind):
    """Joints on circles of 380 and 340 mm; the third axis of a hinge lies in the plane of its cylinder."""
    text = synthetic.ini(kind=kind)
    for name, radius in (("base", 380), ("plate", 340)):
        for i in range(3):
            turn = math.radians(120 * i)
            old = next(line for line in text.splitlines() if line.startswith(f"{name}{i + 1}_mm"))
            text = text.replace(old, f"{name}{i + 1}_mm = {radius * math.cos(turn):.4f}, {radius * math.sin(turn):.4f}, 0")
    return text


def tripod_rows(kind, roll, pitch, twist=0.0):
    """A trace of one resting pose of a tripod, with the parasitic motion of hinges where it has them; twist is added to the yaw."""
    yaw = x = y = 0.0
    r, p = math.radians(roll), math.radians(pitch)
    if kind == "tripod-3rps":
        yaw = math.degrees(math.atan2(math.sin(p) * math.sin(r), math.cos(p) + math.cos(r)))
        w = math.radians(yaw)
        r11, r21 = math.cos(w) * math.cos(p), math.sin(w) * math.cos(p)
        r22 = math.sin(w) * math.sin(p) * math.sin(r) + math.cos(w) * math.cos(r)
        x, y = 170 * (r11 - r22), -340 * r21
    pose, lengths = (roll, pitch, yaw + twist, x, y, 40.0), []
    for i in range(3):
        turn = math.radians(120 * i)
        at = (340 * math.cos(turn), 340 * math.sin(turn), 0.0)
        for angle, rotate in zip(pose[:3], (synthetic.turn_x, synthetic.turn_y, synthetic.turn_z)):
            at = rotate(*at, math.radians(angle))
        feet = (380 * math.cos(turn), 380 * math.sin(turn), 0.0)
        lengths.append(math.dist((at[0] + x, at[1] + y, at[2] + 40 + synthetic.ZERO_HEIGHT), feet) - synthetic.RETRACTED)
    trace = Trace()
    trace.add("HOLD", [round(v * NANO) for v in (*pose, 0, *lengths, 0, 0, 0)])
    trace.repeat(30)
    return trace


def check_tripods(suite):
    for kind in ("tripod", "tripod-3rps"):
        CONFIG.write_text(tripod_text(kind).replace("stroke_mm = 200", "stroke_mm = 400"), encoding="utf-8")
        mechanism = Configuration(CONFIG)
        # joints are given with four decimals: as far as that may be seen
        exact = [round(v * 10**4) / 10**4 for v in (340 * math.cos(math.radians(120)), 340 * math.sin(math.radians(120)))]
        assert math.dist(mechanism.plate[1][:2], exact) < 2e-5
        mechanism.plate, mechanism.arms = [[340 * math.cos(math.radians(120 * i)), 340 * math.sin(math.radians(120 * i)), 0] for i in range(3)], None
        mechanism.arms = mechanism.plate
        mechanism.base = [[380 * math.cos(math.radians(120 * i)), 380 * math.sin(math.radians(120 * i)), 0] for i in range(3)]
        with suite.case(f"{kind}: poses that its guides allow pass"):
            for roll, pitch in ((0, 0), (8, 0), (0, -7), (5, 6), (-9, 3)):
                expect(rules_broken(tripod_rows(kind, roll, pitch).lines(), on=mechanism))
        with suite.case(f"{kind}: a yaw of 0.0001 degrees too much is found"):
            expect(rules_broken(tripod_rows(kind, 5, 6, 0.0001).lines(), on=mechanism), "pose is one the guides allow")
        with suite.case(f"{kind}: a fourth cylinder is found"):
            trace = tripod_rows(kind, 5, 6)
            for row in trace.rows:
                row[2][10] = 1
            expect(rules_broken(trace.lines(), on=mechanism), "format")


# ---- timed moves ----
def timed_trace(way_ms, flags_text=""):
    """At rest for 1 s, then 20 mm along x in way_ms, then rest."""
    trace = at_neutral()
    trace.repeat(990)
    for i in range(1, way_ms + 1):
        trace.pose("ENGAGED", (0, 0, 0, 20 * synthetic.smooth(i / way_ms), 0, 0), flags=flags_text)
    trace.repeat(1000)
    return trace


def timed_moves(trace, texts):
    lines = [Line(t * 1000, text) for t, text in texts]
    watcher = TimedWatcher(lines, platform(), COLUMNS)
    return rules_broken(trace.lines(), watchers=[watcher]), watcher


def check_timed(suite):
    move = [(0, "!engage"), (1000, "@A6T:0,0,0,20,0,0,800#")]
    with suite.case("a timed move that arrives in time passes"):
        broken, watcher = timed_moves(timed_trace(800), move)
        expect(broken)
        assert watcher.checked == 1, f"{watcher.checked} moves checked"
    with suite.case("one that arrives late is found"):
        expect(timed_moves(timed_trace(900), move)[0], "timed move is late")
    with suite.case("one that arrives early is found"):
        expect(timed_moves(timed_trace(600), move)[0], "timed move is early")
    with suite.case("one that is flagged as stretched is not expected to be in time"):
        broken, watcher = timed_moves(timed_trace(900, "stretched"), move)
        expect(broken)
        assert (watcher.checked, watcher.excused) == (0, 1)
    with suite.case("a frame that has others beside it is not taken for a timed move"):
        for other in ((900, "@A6:0,0,0,0,0,0,0#"), (1400, "@A6:0,0,0,0,0,0,0#"), (1400, "!hold")):
            _, watcher = timed_moves(timed_trace(900), sorted([*move, other]))
            assert watcher.checked + watcher.excused == 0, f"with {other}: {watcher.checked} checked"
    with suite.case("escapes of FRAMES"):
        assert unescape(r"a\n\x00\\n\x23") == "a\n\0\\n#"


# ---- the program ----
def run_tool(*arguments):
    return subprocess.run([sys.executable, TOP / "tools/check_trace", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False)


def check_program(suite):
    platform()
    good, bad = Path(FOLDER.name) / "good.csv", Path(FOLDER.name) / "bad.csv"
    trace = good_day()
    good.write_text("".join(trace.lines()), encoding="ascii")
    for row in trace.rows[100:140]:
        row[3] = 1
    bad.write_text("".join(trace.lines()), encoding="ascii")
    with suite.case("exit status 0 and a last line with the count"):
        run = run_tool(CONFIG, good)
        assert run.returncode == 0 and run.stdout.splitlines()[-1] == f"{len(trace.rows)} rows, 0 violations", run.stdout + run.stderr
    with suite.case("exit status 1, the first 20 violations with time, column, value and limit"):
        run = run_tool(CONFIG, bad)
        named = [line for line in run.stdout.splitlines() if line.startswith("t = ")]
        assert run.returncode == 1 and len(named) == 20 and run.stdout.endswith("40 violations\n"), run.stdout + run.stderr
        assert named[0] == "t = 100.000 ms (line 102): relays relays: 0001, limit 0000 in RISING", named[0]
    with suite.case("--json"):
        run = run_tool("--json", CONFIG, bad)
        answer = json.loads(run.stdout)
        assert (answer["rows"], answer["violations"], answer["by_rule"]) == (len(trace.rows), 40, {"relays": 40}), run.stdout
        assert answer["first"][0]["line"] == 102 and run.returncode == 1
    with suite.case("an empty trace, one without a row and one with another header are violations"):
        for text in ("", synthetic.HEADER, good.read_text(encoding="ascii").replace("c6_mm", "c7_mm", 1)):
            bad.write_text(text, encoding="ascii")
            assert run_tool(CONFIG, bad).returncode == 1
    with suite.case("a trace cut off in the middle of a row is a violation"):
        bad.write_text(good.read_text(encoding="ascii")[:-20], encoding="ascii")
        assert run_tool(CONFIG, bad).returncode == 1
    with suite.case("commands end without a word where nobody reads what they print"):
        for command in ([TOP / "tools/check_trace", CONFIG, good], [sys.executable, "-m", "heave", "check", CONFIG, good], [sys.executable, "-m", "heave", "--help"], [TOP / "tools/plot", "--help"]):
            out, into = os.pipe()
            os.close(out)
            run = subprocess.run(list(map(str, command)), stdout=into, stderr=subprocess.PIPE, text=True, check=False, env={**os.environ, "PYTHONPATH": str(TOP / "python")})
            os.close(into)
            assert run.returncode == -signal.SIGPIPE and run.stderr == "", (command, run)
    with suite.case("exit status 2 where a limit is not stated, and the message names it"):
        CONFIG.write_text(synthetic.ini(cylinders__jerk_mm_s3=None), encoding="utf-8")
        run = run_tool(CONFIG, good)
        assert run.returncode == 2 and "jerk_mm_s3" in run.stderr, run.stderr
    with suite.case("exit status 2 for files that do not exist"):
        platform()
        assert run_tool(CONFIG, "/nonexistent").returncode == 2
        assert run_tool("/nonexistent", good).returncode == 2


def main():
    suite = tap.Suite()
    with suite.case("a trace of every state, all of it within the limits, passes"):
        expect(rules_broken(good_day().lines(), every=1))
    for name, (change, rules) in FAULTS.items():
        with suite.case(f"{name} is found"):
            trace = good_day()
            change(trace)
            broken = rules_broken(trace.lines(), every=1)
            assert rules <= set(broken), f"found {broken}, expected {rules}"
    with suite.case("cycles that are flagged as late may be missing, others not"):
        for text, rules in (("late", ()), ("speed", ("time",))):
            trace = good_day()
            skipped(text)(trace)
            expect(rules_broken(trace.lines()), *rules)
    for name, change in MALFORMED.items():
        with suite.case(f"format: {name} is found"):
            assert "format" in rules_broken(with_line(change))
    check_limits(suite)
    check_stroke(suite)
    check_states(suite)
    check_tripods(suite)
    check_timed(suite)
    with suite.case("a configuration with a line that is none is refused"):
        CONFIG.write_text("[platform]\nnonsense\n", encoding="utf-8")
        try:
            Configuration(CONFIG)
        except ConfigError as error:
            assert ":2:" in str(error)
        else:
            raise AssertionError("taken")
    check_program(suite)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
