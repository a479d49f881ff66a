#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_setup.py BIN [PART] - heavectl setup as a person uses it, in a terminal, against heave-twin's drives on a machine that was put together wrongly."""
import contextlib
import hashlib
import json
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import harness
import tap
import test_chinese
from person import Eyes, Person, chord

from heave import Heaved, Twin
from heave.configuration import changed

BIN = Path(sys.argv[1])
BASE, BASE_SPREAD, PLATE, PLATE_SPREAD, RETRACTED, STROKE = 1100, 16, 900, 18, 1300, 400
WRONG = ("--swap", "2,5", "--reverse", "4", "--lead", "3=2.0", "--start", "120")
KILLS = 8
WATCH_S = 1.5
STILL_MM = 0.002
REST_S = 0.25 + 0.02 + 0.15  # the hand counts for 250 ms; 2 mm/s at 100 mm/s^2; the drive's own lag, and a busy machine
MENDED = 30  # a verdict may send all drives round again
TRUTH = f"""
[platform]
kind = hexapod
cycle_us = {{cycle_us}}
[geometry]
base_radius_mm = {BASE}
base_spread_deg = {BASE_SPREAD}
plate_radius_mm = {PLATE}
plate_spread_deg = {PLATE_SPREAD}
retracted_length_mm = {RETRACTED}
stroke_mm = {{stroke}}
[pose]
settled_extension_mm = 10
[cylinders]
speed_mm_s = 200
accel_mm_s2 = 1000
jerk_mm_s3 = 20000
[drives]
driver = cia402
lead_mm = 10
counts_per_turn = 131072
[can]
interface = {{bus}}
[udp]
port = {{port}}
[cia402]
nodes = 1, 2, 3, 4, 5, 6
"""


def dump(file):
    return subprocess.run([BIN / "heaved", "--config", file, "--dump-config"], check=True, capture_output=True, text=True).stdout


class Machine:
    """A twin, and what a person needs to talk to a setup of it."""

    def __init__(self, *wrong, cycle_us=1000, more="", stroke=STROKE):
        self.folder, self.stroke = tempfile.TemporaryDirectory(), stroke
        self.bus = "vcan0" if harness.HAS_OWN_KERNEL else f"twin{os.getpid() % 1000000}"
        self.truth = Path(self.folder.name) / "truth.ini"
        self.truth.write_text(TRUTH.format(bus=self.bus, port=harness.free_port(), cycle_us=cycle_us, stroke=stroke) + more, encoding="utf-8")
        self.file = Path(self.folder.name) / "mine.ini"
        self.twin = Twin(self.truth, wrong, program=BIN / "heave-twin")
        self.eyes = Eyes(self.twin, RETRACTED, self.zero_height())

    def zero_height(self):
        text = dump(self.truth)
        return float(re.search(r"^zero_height_mm = ([0-9.]+)", text, re.MULTILINE)[1])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.twin.close()
        self.folder.cleanup()

    def person(self, *rules, **more):
        usual = [(r"From what do you want to begin", "none"), (r"How many cylinders", "6"), (r"where the joints are", "s"),
                 (r"Lower joints: distance between the two of a pair", f"{chord(BASE, BASE_SPREAD):.2f}"),
                 (r"Lower joints: distance between neighbours", f"{chord(BASE, 120 - BASE_SPREAD):.2f}"),
                 (r"Upper joints: distance between the two of a pair", f"{chord(PLATE, PLATE_SPREAD):.2f}"),
                 (r"Upper joints: distance between neighbours", f"{chord(PLATE, 120 - PLATE_SPREAD):.2f}"),
                 (r"circle of [0-9.]+ mm radius", "y"), (r"that is fully in, from joint", str(RETRACTED)), (r"Stroke of a cylinder", str(self.stroke)),
                 (r"What drives has it", "c"), (r"CAN interface", self.bus), (r"drives answer", ""), (r"counts has one turn", "131072"), (r"Gear:", ""),
                 (r"Lead:", "10"), (r"How fast|How much of the stroke|How far are the cylinders out", ""), (r"Nobody is on the platform", "y"),
                 (r"How far is each cylinder from both", "y"), (r"moves? its own cylinder|can be set right", "y"), (r"know where they are", "a"),
                 (r"Limits of the axes", ""), (r"Relays for effects|Switches of the operator", "n"), (r"Write the configuration", "y"),
                 (r"Nothing tells heaved of the e-stop", "y"), (r"switch the supply of the drives off", "s"), (r"leans to the front and to the right", ""), (r"Enter tries again", "")]
        return Person([BIN / "heavectl", "setup", self.file], self.eyes, (*usual, *rules), **more)


def joints(file):
    text = dump(file)
    return {name: [float(number) for number in values.split(",")] for name, values in re.findall(r"^((?:base|plate)\d_mm) = ([^;\n]*)", text, re.MULTILINE)}


def judge(machine):
    """The configuration that was written agrees with the machine, in every joint and, live, in every cylinder and the pose."""
    real, mine = joints(machine.truth), joints(machine.file)
    assert len(real) == 12 and max(abs(a - b) for name in real for a, b in zip(real[name], mine[name])) < 0.1, (real, mine)
    with Heaved(machine.file, changes={"udp.port": harness.free_port()}, program=BIN / "heaved") as heaved:
        end = time.monotonic() + 30
        status = heaved.platform.status()
        while status["pose_actual"] is None and time.monotonic() < end:
            time.sleep(0.2)
            status = heaved.platform.status()
        seen = machine.eyes.cylinders()
        off = [abs(one["actual_mm"] - seen[one["number"]]) for one in status["cylinders"]]
        assert max(off) < 0.1, (off, status["cylinders"], seen)
        pose = [status["pose_actual"][name] for name in ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")]
        assert max(abs(a - b) for a, b in zip(pose, machine.twin.pose.values())) < 0.1, (pose, machine.twin.pose)


def wrong_machine():
    """Drives 2 and 5 exchanged, 4 reversed, the lead of 3 wrong by two: each is named, and the file that is written is right."""
    with Machine(*WRONG) as machine:
        code, screen = machine.person().run()
        assert code == 0 and "Done." in screen, screen
        for words in ("Drives 2 and 5 have changed places", "Drive 4 runs backwards", "Drive 3 moves cylinder 3 by 2 times"):
            assert words in re.sub(r"\s+", " ", screen), (words, screen)
        judge(machine)
        report = (machine.folder.name + "/mine.ini.report.txt")
        assert "Drives 2 and 5 have changed places" in Path(report).read_text(encoding="utf-8")


def from_a_file():
    """The same machine, begun from a file that has its joints and drives as they were meant. In heave-lab on vcan, with a cycle that costs less there."""
    with Machine(*WRONG, cycle_us=4000) as machine:
        begun = Path(machine.folder.name) / "begun.ini"
        begun.write_text(machine.truth.read_text(encoding="utf-8"), encoding="utf-8")
        code, screen = machine.person((r"From what do you want to begin", str(begun)), (r"where the joints are", "k"), (r"Lead:|counts has one turn", ""),
                                      (r"Limits of the axes", "y"), seconds=800).run()
        said = re.sub(r"\s+", " ", screen)
        assert code == 0 and "Drives 2 and 5 have changed places" in said and "Drive 4 runs backwards" in said and "by 2 times the asked way" in said, screen
        judge(machine)


def drives_that_home():
    """The same machine with drives that count from where they were switched on, and home to a switch: the reversed one to the other end."""
    with Machine(*WRONG, "--start", "30", cycle_us=4000, more="homing_method = 17\n") as machine:
        begun = Path(machine.folder.name) / "begun.ini"
        begun.write_text(machine.truth.read_text(encoding="utf-8").replace("homing_method = 17\n", ""), encoding="utf-8")
        code, screen = machine.person((r"From what do you want to begin", str(begun)), (r"where the joints are", "k"), (r"Lead:|counts has one turn", ""),
                                      (r"Limits of the axes", "y"), (r"know where they are", "h"), (r"Homing method", "17"), seconds=800).run()
        assert code == 0 and "Drive 4 runs backwards" in re.sub(r"\s+", " ", screen), screen
        assert "homing_method = 17, 17, 17, 18, 17, 17" in machine.file.read_text(encoding="utf-8"), machine.file.read_text(encoding="utf-8")
        judge(machine)


def in_chinese():
    """The same for somebody who reads Chinese: nothing on the screen is English but names, no line is too wide, and the file is as right."""
    with Machine(*WRONG, cycle_us=4000) as machine:
        begun = Path(machine.folder.name) / "begun.ini"
        begun.write_text(machine.truth.read_text(encoding="utf-8"), encoding="utf-8")
        (begun.parent / "presets").mkdir()
        code, screen = machine.person((r"From what do you want to begin", str(begun)), (r"where the joints are", "k"), (r"Lead:|counts has one turn", ""),
                                      (r"Limits of the axes", "y"), language="zh_CN", environment={**test_chinese.CHINESE, "HEAVE_PRESETS": begun.parent / "presets"}).run()
        report = Path(f"{machine.file}.report.txt").read_text(encoding="utf-8")
        for text in (re.sub(r"\s+", "", screen), re.sub(r"\s+", "", report)):
            assert code == 0 and "驱动器2和5互换了" in text and "驱动器4方向相反" in text and "驱动器3使缸3移动了要求距离的2倍" in text, screen + report
        words = test_chinese.table_words()
        lines = re.sub(r"\x1b\[K", "\n", screen)
        left = test_chinese.left_in_english(lines, words | {"back", "quit", "help", "none", machine.bus})
        wide = [line for line in lines.splitlines() if test_chinese.columns(line) > 80 and machine.folder.name not in line]
        assert not left and not wide, "\n".join(left + wide)
        judge(machine)


def until_rest(machine):
    """Seconds after which no cylinder moves any more, as eyes see it."""
    begin, last, moved = time.monotonic(), machine.eyes.cylinders(), 0.0
    while time.monotonic() < begin + WATCH_S:
        now = machine.eyes.cylinders()
        if max(abs(now[leg] - last[leg]) for leg in now) > STILL_MM:
            moved = time.monotonic() - begin
        last = now
        time.sleep(0.01)
    return moved


def interrupt(person, machine, is_stopped):
    """The client is killed, or stands still for a while: seconds until rest, and mm that anything moves when it goes on without a key."""
    if not is_stopped:
        person.kill()
        return until_rest(machine), 0.0
    person.process.send_signal(signal.SIGSTOP)
    rest, before = until_rest(machine), machine.eyes.cylinders()
    person.process.send_signal(signal.SIGCONT)
    until_rest(machine)
    moved = max(abs(now - before[leg]) for leg, now in machine.eyes.cylinders().items())
    person.kill()
    return rest, moved


def killed():
    """SIGKILL or SIGSTOP at any moment, also while it moves: everything rests soon, its heaved ends, no answer is lost, and it goes on to the right end."""
    chance = random.Random(int(sys.argv[3]) if len(sys.argv) > 3 else 5)
    with Machine(*WRONG) as machine:
        rests, in_motion, answers, person = [], 0, 0, None
        for n in range(KILLS):
            last, person = person, machine.person()
            if last:
                person.remember(last)
            is_moving = n % 2 == 0
            until = time.monotonic() + (60 if is_moving else chance.uniform(0.5, 6))
            begun = 0.0
            while person.look() and time.monotonic() < until:
                if is_moving and "goes on while" in person.text[person.text.rfind(" by "):] and person.is_held:
                    begun = begun or time.monotonic() + chance.uniform(0, 2)
                    if time.monotonic() > begun:
                        break
            in_motion += person.is_held
            rest, moved = interrupt(person, machine, is_stopped=n % 4 == 2)
            assert moved < STILL_MM, f"{moved} mm when it went on"
            rests.append(rest)
            harness.wait_for(lambda: not own_heaved(machine), "its heaved ends")
            kept = len(json.loads(Path(f"{machine.file}.setup").read_text(encoding="utf-8"))["answers"]) if Path(f"{machine.file}.setup").exists() else 0
            assert kept >= answers - MENDED, "answers are lost"
            answers = kept
        assert in_motion >= KILLS // 3, f"{in_motion} of {KILLS} in motion"
        assert max(rests) <= REST_S, rests
        print(f"# {KILLS} kills and stops, {in_motion} in motion: at rest after {max(rests) * 1000:.0f} ms at most")
        code, screen = machine.person().remember(person).run()
        assert code == 0 and "Going on with" in screen, screen
        judge(machine)


def own_heaved(machine):
    """Whether a heaved runs on the machine's bus."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_bytes().split(b"\0")
            if words[0].endswith(b"heaved") and machine.bus.encode() in Path(words[words.index(b"--config") + 1].decode()).read_bytes():
                return True
        except (OSError, ValueError, IndexError):
            continue
    return False


def alone(folder, *rules):
    """Somebody without drives."""
    usual = [(r"From what do you want to begin", "none"), (r"How many cylinders", ""), (r"that is fully in, from joint", str(RETRACTED)),
             (r"Stroke of a cylinder", str(STROKE)), (r"What drives has it", "s"), (r"How fast|How much of the stroke|How far are the cylinders out", ""),
             (r"Limits of the axes", ""), (r"Relays for effects|Switches of the operator", ""), (r"first moves", "s"), (r"Write the configuration", "y")]
    return Person([BIN / "heavectl", "setup", folder / "alone.ini"], None, (*usual, *rules), seconds=60)


def regular():
    """Joints of the machine, as a drawing has them: {base1_mm: [x, y, z]}."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "truth.ini"
        file.write_text(TRUTH.format(bus="twin0", port=9800, cycle_us=1000, stroke=STROKE), encoding="utf-8")
        return joints(file)


def on_modbus():
    """Drives on Modbus TCP, from a file that has their registers: two exchanged and one reversed."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hosts = ", ".join(f"127.0.0.1:{port}" for port in tcp_ports(6))
        text = (harness.TOP / "config/modbus-tcp-hexapod.ini").read_text(encoding="utf-8")
        (folder / "truth.ini").write_text(changed(text, {"modbus-tcp.hosts": hosts, "udp.port": harness.free_port(), "udp.bind": "127.0.0.1"}), encoding="utf-8")
        retracted = float(re.search(r"^retracted_length_mm = ([0-9.]+)", dump(folder / "truth.ini"), re.MULTILINE)[1])
        zero = float(re.search(r"^zero_height_mm = ([0-9.]+)", dump(folder / "truth.ini"), re.MULTILINE)[1])
        with Twin(folder / "truth.ini", ["--swap", "2,5", "--reverse", "4", "--start", "60"], program=BIN / "heave-twin") as twin:
            machine = SimpleNamespace(twin=twin, eyes=Eyes(twin, retracted, zero), truth=folder / "truth.ini", file=folder / "mine.ini")
            person = Person([BIN / "heavectl", "setup", machine.file], machine.eyes,
                            [(r"From what do you want to begin", str(machine.truth)), (r"where the joints are", "k"), (r"Addresses of the drives", ""),
                             (r"counts has one turn|Gear:|Lead:", ""), (r"Nobody is on the platform", "y"), (r"How far is each cylinder from both", "y"),
                             (r"moves? its own cylinder|can be set right", "y"), (r"know where they are", "a"), (r"Limits of the axes", "k"),
                             (r"Relays for effects|Switches of the operator", "n"), (r"Write the configuration", "y"),
                             (r"Nothing tells heaved of the e-stop", "y"), (r"switch the supply of the drives off", "s"), (r"leans to the front and to the right", ""), (r"Enter tries again", "")])
            code, screen = person.run()
            assert code == 0 and "Drives 2 and 5 have changed places" in screen and "Drive 4 runs backwards" in screen, screen
            judge(machine)


def tcp_ports(count):
    """Ports of this machine that nobody has, all open at once so that they differ."""
    with contextlib.ExitStack() as stack:
        servers = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(count)]
        return [server.getsockname()[1] for server in servers]


def exchanged_joints():
    """Two plate joints exchanged in the drawing: named, and mended by one answer."""
    real = regular()
    said = {**real, "plate1_mm": real["plate2_mm"], "plate2_mm": real["plate1_mm"]}
    with tempfile.TemporaryDirectory() as folder:
        code, screen = alone(Path(folder), (r"where the joints are", "j"),
                             (r"(Lower|Upper) joint (\d)", lambda asked: "{0[0]:.3f}, {0[1]:.3f}".format(said[f"{'base' if asked[1] == 'Lower' else 'plate'}{asked[2]}_mm"])),
                             (r"look exchanged", "x")).run()
        assert code == 0 and "plate1 and plate2 look exchanged" in screen, screen
        mine = joints(Path(folder) / "alone.ini")
        assert max(abs(a - b) for name in real for a, b in zip(real[name], mine[name])) < 0.01, mine
        mended = "Joints plate1 and plate2 were exchanged."
        for ending in ("txt", "html"):
            assert mended in (Path(folder) / f"alone.ini.report.{ending}").read_text(encoding="utf-8"), ending
        report = json.loads((Path(folder) / "alone.ini.report.json").read_text(encoding="utf-8"))
        assert report["found"] == [mended] and report["answers"]["kind"] == "hexapod" and report["answers"]["stroke"] == str(STROKE), report


def misread_distance():
    """All distances with a tape, one of them misread by 20 mm: named, and mended by one answer."""
    real, chance = regular(), random.Random(3)

    def distance(asked):
        one, other = (real[f"{'base' if asked[1] == 'lower' else 'plate'}{asked[n]}_mm"] for n in (2, 3))
        off = 20 if asked[0].endswith("upper joints 2-5") else chance.uniform(-1, 1)
        return f"{math.dist(one, other) + off:.1f}"

    with tempfile.TemporaryDirectory() as folder:
        code, screen = alone(Path(folder), (r"where the joints are", "t"), (r"Distance of the (lower|upper) joints (\d)-(\d)", distance),
                             (r"go together", "y"), (r"does not go with the others", "t")).run()
        assert code == 0 and re.search(r"The distance 2-5 of the upper joints does not go with the others", re.sub(r"\s+", " ", screen)), screen
        mine = joints(Path(folder) / "alone.ini")
        assert max(math.dist(real[name], mine[name]) for name in real) < 2, mine


def relays_and_switches():
    """On simulated GPIO lines: each relay as it is held, the e-stop and the key as they are worked; simulated drives make the first rise."""
    if not harness.HAS_OWN_KERNEL:
        raise tap.Skip("takes gpio-sim: runs in heave-lab")
    real = regular()
    desk = "\n[relays]\ndriver = gpio\nlines = LIGHT, FAN\n[inputs]\ndriver = gpio\nestop = STOP\nenable = KEY\nreset = RESET\n"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth = re.sub(r"\[drives\].*?\[udp\]", "[drives]\ndriver = sim\n[udp]", TRUTH.format(bus="", port=harness.free_port(), cycle_us=1000, stroke=STROKE), flags=re.DOTALL)
        (folder / "truth.ini").write_text(truth + desk, encoding="utf-8")
        with Twin(folder / "truth.ini", program=BIN / "heave-twin") as twin:

            def work(switch):
                twin.switch(switch, closed=False)
                time.sleep(1)
                twin.switch(switch, closed=True)

            def release(_):
                twin.switch("estop", closed=True)
                return ""

            def of_key(_):
                named = next(key)
                twin.switch("estop", closed=named == "none")  # somebody has pressed it when it is named rightly
                return named

            estop, key = iter(["KEY", "STOP"]), iter(["none", "KEY"])  # the first time the e-stop is on the key's line
            person = alone(folder, (r"where the joints are", "j"),
                           (r"(Lower|Upper) joint (\d)", lambda asked: "{0[0]:.3f}, {0[1]:.3f}".format(real[f"{'base' if asked[1] == 'Lower' else 'plate'}{asked[2]}_mm"])),
                           (r"Relays for effects|Switches of the operator", "g"), (r"Lines of relay", "LIGHT, FAN"), (r"Line of the e-stop", lambda _: next(estop)),
                           (r"Line of the enable key", of_key), (r"has not seen the switch estop", "l"), (r"Line of the reset", "RESET"), (r"Line of the contact", ""), (r"Relay \d: try it", "y"),
                           (r"the e-stop is pressed.*Enter tries again", release))
            is_unseen = iter([True, False])

            def press():
                work("estop")
                if next(is_unseen):
                    os.write(person.master, b"s\n")
            person.eyes, person.works = Eyes(twin, RETRACTED), {"Press the e-stop": press, "Turn the enable key": lambda: work("enable")}
            code, screen = person.run()
        report = (folder / "alone.ini.report.txt").read_text(encoding="utf-8")
        assert "the e-stop is pressed: release it first" in re.sub(r"\s+", " ", screen), screen
        assert code == 0 and report.count("did not") == 1 and "heaved did not see the switch estop." in report and len(re.findall(r"\bseen$", report, re.MULTILINE)) == 2, (screen, report)
        assert "estop = STOP" in (folder / "alone.ini").read_text(encoding="utf-8")


def refusals():
    """Bad input, by name; nothing is written or lost."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        setup = [BIN / "heavectl", "setup"]
        result = subprocess.run([*setup, folder / "mine.ini"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
        assert result.returncode == 64 and "takes a terminal" in result.stderr, result
        (folder / "old.ini").write_text("[platform]\n", encoding="utf-8")
        (folder / "bad.ini.setup").write_text("{ no", encoding="utf-8")
        for file, code, words in (("old.ini", 64, "is there already"), ("bad.ini", 65, "not a state of setup, or damaged"), ("missing/x.ini", 73, "No such file")):
            assert_code, screen = Person([*setup, folder / file], None, seconds=20).run()
            assert assert_code == code and words in screen, screen
        assert (folder / "old.ini").read_text(encoding="utf-8") == "[platform]\n" and (folder / "bad.ini.setup").read_text(encoding="utf-8") == "{ no"
        given = iter(["p", "s"])
        near = iter(["306,2", "0.306", "three", "99999", "help", "306.2"])
        code, screen = alone(folder, (r"where the joints are", lambda _: next(given)), (r"joints: distance between the two", lambda _: next(near)), (r"distance between neighbours", "quit")).run()
        screen = re.sub(r"\s+", " ", screen)
        for words in ('"p" is none of the answers', "a decimal point, not a comma", "In mm, not in metres", '"three" is no number of mm', "allowed are 10 to 4000 mm"):
            assert words in screen, (words, screen)
        assert code == 1 and "goes on here" in screen, screen
        assert sorted(path.name for path in folder.iterdir()) == ["alone.ini.setup", "bad.ini.setup", "old.ini"], list(folder.iterdir())
        (folder / "alone.ini").write_text("[platform]\n", encoding="utf-8")  # somebody else's
        kept = (folder / "alone.ini.setup").read_bytes()
        code, screen = alone(folder).run()
        assert code == 64 and "has come meanwhile" in screen, screen
        assert (folder / "alone.ini").read_text(encoding="utf-8") == "[platform]\n" and (folder / "alone.ini.setup").read_bytes() == kept


def second_master():
    """A heaved that has the bus already is named, and nothing is started beside it."""
    with Machine() as machine, Heaved(machine.truth, program=BIN / "heaved"):
        asked = iter(["quit"])
        code, screen = machine.person((r"Enter tries again", lambda _: next(asked))).run()
        screen = re.sub(r"\s+", " ", screen)
        assert code == 1 and "heaved is running on this bus already" in screen and "Two masters on one bus must not be" in screen, screen


def applied_master():
    """So is a heaved whose own file has no bus, but what was applied over it has."""
    with Machine() as machine:
        folder = Path(machine.folder.name)
        own = re.sub(r"driver = cia402", "driver = sim", machine.truth.read_text(encoding="utf-8"))
        (folder / "own.ini").write_text(own, encoding="utf-8")
        applied = f"{machine.truth.read_text(encoding='utf-8')}; heaved: applied over {hashlib.sha256(own.encode()).hexdigest()[:16]}\n"
        (folder / "configuration.ini").write_text(applied, encoding="utf-8")
        heaved = subprocess.Popen([BIN / "heaved", "--config", folder / "own.ini", "--socket", folder / "own.sock"], env={**os.environ, "STATE_DIRECTORY": str(folder)},
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            harness.wait_for((folder / "own.sock").exists, "it runs")
            code, screen = machine.person((r"Enter tries again", "quit")).run()
        finally:
            heaved.terminate()
            heaved.wait(timeout=30)
        assert code == 1 and "heaved is running on this bus already" in re.sub(r"\s+", " ", screen), screen


CASES = (("a machine that was put together wrongly", wrong_machine),
         ("begun from a file", from_a_file),
         ("drives that home", drives_that_home),
         ("in Chinese", in_chinese),
         ("killed at any moment, it goes on, and nothing moves", killed),
         ("drives on Modbus TCP", on_modbus),
         ("exchanged joints are named and mended", exchanged_joints),
         ("a misread distance is named and mended", misread_distance),
         ("relays and switches one by one", relays_and_switches),
         ("bad input is refused by name", refusals),
         ("a second master is refused by name", second_master),
         ("a second master by an applied configuration is refused by name", applied_master))


def main():
    suite = tap.Suite()
    for name, case in CASES:
        if len(sys.argv) < 3 or sys.argv[2] in name:
            with suite.case(name):
                case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
