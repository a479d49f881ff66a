#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_commissioned.py BIN - a machine that nobody has seen rise, as it is configured, rises slowly: until somebody says that it was right, and again once what
is built has changed."""
import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import harness
import tap
import test_chinese

from heave import Heaved, Refused, Twin
from heave.configuration import changed

BIN = Path(sys.argv[1])
SPEED_MM_S = 100
QUICK_S = 10
SLOW_S = 60
MACHINE = """
[platform]
kind = hexapod
cycle_us = 2000
[geometry]
base_radius_mm = 1100
base_spread_deg = 16
plate_radius_mm = 900
plate_spread_deg = 18
retracted_length_mm = 1300
stroke_mm = 400
[pose]
settled_extension_mm = 100
[cylinders]
speed_mm_s = 200
accel_mm_s2 = 1000
jerk_mm_s3 = 20000
[engage]
speed_mm_s = {speed}
[drives]
driver = cia402
lead_mm = 10
counts_per_turn = 131072
[can]
interface = {bus}
[udp]
port = 9800
[cia402]
nodes = 1, 2, 3, 4, 5, 6
"""


@contextlib.contextmanager
def machine(**changes):
    """A configuration whose drives are there, and the folder that keeps what the machine has done."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bus = "vcan0" if harness.HAS_OWN_KERNEL else f"twin{os.getpid() % 1000000}"
        text = MACHINE.format(bus=bus, speed=SPEED_MM_S)
        (folder / "ride.ini").write_text(changed(text, {"platform.life_file": folder / "life", **changes}), encoding="utf-8")
        with Twin(folder / "ride.ini", ["--start", "100"], program=BIN / "heave-twin") as twin:
            yield folder, twin


def started(folder, **changes):
    return Heaved(folder / "ride.ini", changes={key.replace("__", "."): value for key, value in changes.items()}, program=BIN / "heaved")


@contextlib.contextmanager
def heaved(folder):
    with started(folder) as daemon:
        daemon.platform.wait_until(lambda status: all(leg["drive"] in ("disabled", "ready") for leg in status["cylinders"]), what="the drives are set up")
        yield daemon


def ask(daemon, *words, environment=None):
    return subprocess.run([BIN / "heavectl", "--socket", daemon.socket, *words], capture_output=True, text=True, check=False, timeout=60,
                          env=environment or {**os.environ, "LC_ALL": "C.UTF-8"})


def cycles_of(daemon, *states):
    rows = (line.split(",") for line in daemon.trace.read_text(encoding="utf-8").splitlines() if line[:1].isdigit())
    return sum(row[1] in states for row in rows)


def rise_s(daemon):
    """Engages, by heavectl; seconds on the machine's clock that it was rising, and what heavectl said beside its answer."""
    before = cycles_of(daemon, "RISING")
    said = ask(daemon, "engage")
    assert said.returncode == 0, said
    daemon.platform.wait_for("ENGAGED", timeout=120)
    harness.wait_for(lambda: cycles_of(daemon, "ENGAGED") > 0, "the trace is written")
    time.sleep(0.5)  # the rows of the rise are in the file before that
    return (cycles_of(daemon, "RISING") - before) * 0.002, said.stderr


def park(daemon):
    daemon.platform.park()
    daemon.platform.wait_for("SETTLED", timeout=60)


def configuration(daemon):
    return daemon.platform.status()["configuration"]


def expect_refused(daemon, words):
    try:
        daemon.platform.commissioned()
    except Refused as refused:
        assert words in str(refused), refused
    else:
        raise AssertionError("it was not refused")


def from_the_rise(trace):
    """States and set-points of each cycle from the first rise on; the times of a replay begin elsewhere."""
    rows = [line.split(",") for line in trace.read_text(encoding="utf-8").splitlines() if line[:1].isdigit()]
    first = next(n for n, row in enumerate(rows) if row[1] == "RISING")
    return [row[1:15] for row in rows[first:]]


def replay(daemon, folder):
    """The recording of a slow rise and a quick one plays back to the same set-points."""
    frames = folder / "frames"
    frames.write_text(daemon.frames.read_text(encoding="utf-8").rpartition("\n")[0] + "\n", encoding="utf-8")
    subprocess.run([BIN / "heaved", "--config", daemon.config, "--play", frames, "--trace", folder / "trace"], check=True, capture_output=True)
    lived, played = from_the_rise(daemon.trace), from_the_rise(folder / "trace")
    cycles = min(len(lived), len(played))
    assert cycles * 0.002 > QUICK_S and lived[:cycles - 1] == played[:cycles - 1], cycles


def never_commissioned():
    """Slowly until somebody has looked and said so; then quick, also after a restart; senders and limits change nothing of that, the scale does."""
    with machine() as (folder, _):
        with heaved(folder) as daemon:
            told = configuration(daemon)
            assert told["slow_rise"] is True and told["commissioned_day"] is None and len(told["machine"]) == 16, told
            assert "not commissioned: the platform rises at a tenth" in daemon.log, daemon.log
            assert "not commissioned as it is now" in ask(daemon, "status").stdout
            expect_refused(daemon, "has not risen yet since heaved started")
            slow_s, said = rise_s(daemon)
            assert "nobody has seen this machine rise as it is configured now" in said and "heavectl commissioned" in said, said
            assert ask(daemon, "commissioned").returncode == 0
            harness.wait_for(lambda: configuration(daemon)["slow_rise"] is False, "it is taken")
            assert configuration(daemon)["commissioned_day"] > 20260000
            harness.wait_for(lambda: "commissioned by user" in daemon.log, "it is logged")
            expect_refused(daemon, "nothing waits for it")
            park(daemon)
            quick_s, said = rise_s(daemon)
            assert said == "" and quick_s < QUICK_S < slow_s < SLOW_S and 5 < slow_s / quick_s < 10.5, (quick_s, slow_s, said)
            assert "not commissioned" not in ask(daemon, "status").stdout
            park(daemon)
            harness.wait_for(lambda: " !rise 100\n" in daemon.frames.read_text(encoding="utf-8"), "it is recorded")
            assert " !rise 10\n" in daemon.frames.read_text(encoding="utf-8")
            replay(daemon, folder)
        for changes in ({}, {"udp__silence_hold_ms": 900, "z__max_mm": 50, "pose__neutral": "0, 0, 0, 0, 0, 5"}):
            with started(folder, **changes) as daemon:
                assert configuration(daemon)["slow_rise"] is False, changes
        with started(folder, drives__lead_mm=20) as daemon:
            told = configuration(daemon)
            assert told["slow_rise"] is True and told["commissioned_day"] > 20260000, told
            assert "the machine's keys have changed since it was commissioned (20" in daemon.log, daemon.log
            assert told["changed"] == "[cia402] counts_per_mm was 65536/5 and is 32768/5", told
            assert f"`heavectl commissioned`: {told['changed']}" in daemon.log, daemon.log
            assert told["changed"] in re.sub(r"\s+", " ", ask(daemon, "status").stdout)
            assert "由 65536/5 变为 32768/5" in re.sub(r"\s+", " ", ask(daemon, "status", environment=test_chinese.CHINESE).stdout)


def nothing_to_ask():
    """Where nothing is kept nobody could remember the answer, and simulated drives need no look."""
    for changes in ({"platform.life_file": "none"}, {"drives.driver": "sim"}):
        with machine() as (folder, _), Heaved(folder / "ride.ini", changes=changes, program=BIN / "heaved") as daemon:
            assert configuration(daemon)["slow_rise"] is False, changes
            assert "not commissioned" not in daemon.log, daemon.log
            expect_refused(daemon, "nothing waits for it")


def in_chinese():
    with machine() as (folder, _), heaved(folder) as daemon:
        said = ask(daemon, "engage", environment=test_chinese.CHINESE)
        shown = ask(daemon, "status", environment=test_chinese.CHINESE)
        assert said.returncode == 0 and "十分之一" in said.stderr and "heavectl commissioned" in said.stderr, said
        assert "十分之一" in shown.stdout, shown.stdout


def replays():
    """A replay rises as slowly as the recording says, and a percentage that cannot be is refused by its line."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = {}
        for kind, lines in (("quick", "5 !engage\n60000 !park\n"), ("slow", "4 !rise 10\n5 !engage\n60000 !park\n"), ("zero", "4 !rise 0\n5 !engage\n60000 !park\n")):
            (folder / "frames").write_text(lines, encoding="utf-8")
            (folder / "ride.ini").write_text(changed(MACHINE.format(bus="twin0", speed=SPEED_MM_S), {"drives.driver": "sim"}), encoding="utf-8")
            run = subprocess.run([BIN / "heaved", "--config", folder / "ride.ini", "--play", folder / "frames", "--trace", folder / "trace"], capture_output=True, text=True, check=False)
            assert run.returncode == 0 and ("not 1 to 100" in run.stderr) == (kind == "zero"), run
            states = [line.split(",")[1] for line in (folder / "trace").read_text(encoding="utf-8").splitlines() if line[:1].isdigit()]
            rows[kind] = [states.count(state) for state in ("RISING", "SETTLING")]
        assert rows["zero"] == rows["quick"] and 5 < rows["slow"][0] / rows["quick"][0] < 10.5, rows
        assert rows["slow"][1] == rows["quick"][1], rows  # the way down is not slowed


CASES = (("a machine that was never commissioned rises slowly until somebody has looked", never_commissioned),
         ("nothing is asked where nothing is kept, nor of simulated drives", nothing_to_ask),
         ("it is said in Chinese", in_chinese),
         ("a recording holds how it rises", replays))


def main():
    suite = tap.Suite()
    for name, case in CASES:
        with suite.case(name):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
