#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_heave.py --bin DIR - the Python package: frames, recordings, timing, a real heaved, offline runs, what the judge finds, pictures. Runs on the Python of tools/lib/venv.sh, which has NumPy."""
import argparse
import contextlib
import importlib.util
import json
import math
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import types
from pathlib import Path

import kernel
import tap

import heave
from heave import judge, recording
from heave.configuration import ConfigError, Configuration, changed
from heave.plot import animation
from heave.plot.feedback import Feedback
from heave.plot.window import Window
from heave.trace import HEADER

FOLDER = tempfile.TemporaryDirectory(prefix="heave-python-")
WAIT_S = 60


@contextlib.contextmanager
def refused(kind, *words):
    """What has to be refused, in words that say where and what."""
    try:
        yield
    except kind as error:
        missing = [word for word in words if word not in str(error)]
        assert not missing, f"{missing} not in: {error}"
    else:
        raise AssertionError(f"not refused: {words}")


def write(name, text):
    path = Path(FOLDER.name) / name
    path.write_text(text, encoding="utf-8")
    return path


# ---- frames and recordings ----
def frames_are_as_the_protocol_has_them():
    for text, *arguments in (("@A3:1,2,3#", "A3", (1, 2, 3)), ("@A4:0,0,0,90.5#", "A4", (0, 0, 0, 90.5)), ("@A7:1,2,3,4,5,6,7#", "A7", range(1, 8)), ("@C3:1,2,3#", "C3", (1, 2, 3)),
                             ("@C6:1,2,3,4,5,6#", "C6", range(1, 7)), ("@C7:1,2,3,4,5,6,-7#", "C7", (1, 2, 3, 4, 5, 6, -7))):
        assert heave.frame(*arguments) == text, heave.frame(*arguments)
    assert heave.frame("A6", (5, 6, 0, 5.5, 3.0, 20), mask=0xF0) == "@A6:5,6,0,5.5,3,20,F0#"
    assert heave.frame("A6", (0, 0, 0, 0, 0, 20), time_ms=3_600_000) == "@A6T:0,0,0,0,0,20,3600000#"
    assert heave.frame("A3", (0, 0, 1e-7), mask=0) == "@A3:0,0,1e-07,0#"


def wrong_values_are_named():
    for words, arguments, options in ((("A9", "C7"), ("A9", (1,)), {}), (("A6", "6 values", "yaw", "not 5"), ("A6", (1, 2, 3, 4, 5)), {}), (("roll", "nan"), ("A3", (math.nan, 0, 0)), {}),
                                      (("z", "32768"), ("A3", (0, 0, 40000)), {}), (("pitch", "'5'"), ("A3", (0, "5", 0)), {}), (("mask", "65536"), ("A3", (0, 0, 0)), {"mask": 65536}),
                                      (("time_ms", "-1"), ("A3", (0, 0, 0)), {"time_ms": -1}), (("relays",), ("A3", (0, 0, 0)), {"time_ms": 1, "mask": 1})):
        with refused(heave.FrameError, *words):
            heave.frame(*arguments, **options)


def csv_becomes_frames():
    path = write("show.csv", "t_s,roll_deg,z_mm\n0,1,2\n0.02,1.5,2.5\n")
    assert recording.read(path) == [recording.Line(0, "@A3:1,0,2#"), recording.Line(20_000, "@A3:1.5,0,2.5#")]
    path = write("show.csv", "t_ms, x , mask, time_ms\n; a comment\n5.5,3,F0,\n7,4,,500\n")
    assert recording.read(path) == [recording.Line(5500, "@A6:0,0,0,3,0,0,F0#"), recording.Line(7000, "@A6T:0,0,0,4,0,0,500#")]
    assert recording.read(write("c.csv", "t,c1,c2,c3\n1,4,5,6\n"))[0] == recording.Line(1_000_000, "@C3:4,5,6#")
    assert recording.read_csv(write("a.csv", "t,z\n1,4\n"), "A7")[0].text == "@A7:0,0,0,0,0,4,0#"


def files_of_people_are_read_as_heaved_reads_them():
    """Marks of Windows editors, comments in GBK and a Windows code page, ends of lines of both kinds; UTF-16 is refused, in heaved's words."""
    heaved = Path(os.environ["HEAVE_BIN"]) / "heaved"
    ini = (Path(__file__).parents[2] / "config/demo-hexapod.ini").read_bytes()
    frames, csv = b"0 !engage\n3000 @A6:0,0,0,0,0,5#\n3500 !park\n", b"t_ms,z_mm\n0,1.5\n20,2.5\n"
    marks = {"plain": b"", "BOM": b"\xef\xbb\xbf", "GBK": b"; \xd6\xd0\xce\xc4\xa3\xbb=\n", "cp1252": b"; M\xfcnchen \x80\n"}
    for name, mark in marks.items():
        for end in (b"\n", b"\r\n"):
            config, show, table = (Path(FOLDER.name) / file for file in ("odd.ini", "odd.frames", "odd.csv"))
            config.write_bytes((mark + ini).replace(b"\n", end))
            show.write_bytes((mark + frames).replace(b"\n", end))
            table.write_bytes(((mark if name in ("plain", "BOM") else b"") + csv).replace(b"\n", end))
            assert Configuration(config).cylinders == 6, name
            assert [line.text for line in recording.read(show)] == ["!engage", "@A6:0,0,0,0,0,5#", "!park"], name
            assert [line.text for line in recording.read(table)] == ["@A3:0,0,1.5#", "@A3:0,0,2.5#"], name
            run = subprocess.run([heaved, "--config", config, "--play", show], capture_output=True, check=False)
            assert run.returncode == 0, (name, run.stderr)
    words = "the file is UTF-16; allowed: plain text (UTF-8)"
    for encoding in ("utf-16-le", "utf-16-be"):
        for name, data in (("wide.ini", ini), ("wide.frames", frames), ("wide.csv", csv)):
            path = Path(FOLDER.name) / name
            path.write_bytes(("\ufeff" + data.decode()).encode(encoding))
            with refused(heave.HeaveError, f"{path}:1: {words}"):
                (Configuration if name.endswith(".ini") else recording.read)(path)
        for arguments in (["--config", Path(FOLDER.name) / "wide.ini", "--check"], ["--config", config, "--play", Path(FOLDER.name) / "wide.frames"]):
            run = subprocess.run([heaved, *arguments], capture_output=True, text=True, check=False)
            assert run.returncode != 0 and f":1: {words}" in run.stderr, run
    assert recording.read(write("semicolons.csv", "t_ms;roll;z\n0;1,5;2\n20;;-0,25\n")) == [recording.Line(0, "@A3:1.5,0,2#"), recording.Line(20_000, "@A3:0,0,-0.25#")]
    with refused(ConfigError, "odd.ini:1: stray text 'kind'; allowed: key = value, [section], ; comment"):
        Configuration(write("odd.ini", "kind\n"))
    config = Path(FOLDER.name) / "colon.ini"
    config.write_bytes(ini.replace(b"kind = ", b"kind: ", 1))
    assert Configuration(config).kind == "hexapod"


def wrong_recordings_are_named_with_their_line():
    for name, text, *words in (("a.csv", "roll,z\n", ":1:", "time"), ("a.csv", "t_ms,state\n0,OFF\n", ":1:", "poses"), ("a.csv", "t_ms,roll\n0,1\n1,x\n", ":3:", "roll", "'x'"),
                               ("a.csv", "t_ms,roll\n0,1,2\n", ":2:", "3 values under 2"), ("a.csv", "t_ms,roll\n5,1\n4,1\n", ":3:", "before"), ("a.csv", "t_ms,roll\n0,99999\n", ":2:", "roll", "32768"),
                               ("a.csv", "t_ms,roll,mask\n0,1,xyz\n", ":2:", "mask"), ("a.csv", "t_ms,roll\n-1,1\n", ":2:", "t_ms"), ("a.frames", "10 @A3:0,0,0#\nsoon !park\n", ":2:", "soon"),
                               ("a.frames", "10\n", ":1:", "<t_ms> <text>")):
        with refused(recording.RecordingError, name, *words):
            recording.read(write(name, text))


# ---- timing ----
class Clock:
    """A clock that only sleeping moves, or what the test does."""

    def __init__(self):
        self.now = 1000.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds + 50e-6  # as late as a kernel is


class Link:
    def __init__(self, clock):
        self.clock, self.sent = clock, []

    def send(self, data):
        self.sent.append((self.clock.now - 1000.0, data.decode()))


@contextlib.contextmanager
def on_a_clock():
    clock = Clock()
    heave.sender.time, before = types.SimpleNamespace(monotonic=clock.monotonic, sleep=clock.sleep), heave.sender.time
    sender = heave.Sender("127.0.0.1", 9)
    sender.close()
    sender.link = Link(clock)
    try:
        yield clock, sender
    finally:
        heave.sender.time = before


def a_stream_does_not_drift():
    with on_a_clock() as (_, sender):
        sent = sender.stream(lambda t: f"{t:.6f}", 60, seconds=600)
        times = sender.link.sent
        assert sent.frames == len(times) == 36_000 and sent.skipped == 0, sent
        assert all(0 <= at - n / 60 < 101e-6 for n, (at, _) in enumerate(times)), "late, and later"
        assert all(text == f"{n / 60:.6f}" for n, (_, text) in enumerate(times)), "asked for another time than was due"


def a_stream_makes_up_for_nothing():
    with on_a_clock() as (clock, sender):
        def source(t):
            if abs(t - 1) < 1e-9:
                clock.now += 0.255  # this machine was held up
            return f"{t:.3f}"
        sent = sender.stream(source, 100, seconds=2)
        times = [at for at, _ in sender.link.sent]
        assert (sent.frames, sent.skipped) == (175, 25), sent
        assert min(b - a for a, b in zip(times, times[1:])) > 0.004, "a burst"
        assert abs(times[-1] - 1.99) < 0.001, "everything after it is later"


def a_stream_of_values_ends_with_them():
    with on_a_clock() as (_, sender):
        sent = sender.stream(["a", "b", "c"], 50)
        assert [text for _, text in sender.link.sent] == ["a", "b", "c"] and sent.frames == 3
    for rate, seconds, word in ((0, 1, "rate_hz"), (2000, 1, "rate_hz"), (math.nan, 1, "rate_hz"), (50, None, "seconds")):
        with on_a_clock() as (_, sender), refused(heave.FrameError, word):
            sender.stream(lambda t: "", rate, seconds)


def a_recording_keeps_its_times():
    lines = [recording.Line(t_us, str(t_us)) for t_us in (0, 0, 10_000, 500_000, 500_000, 510_000)]
    lines.insert(3, recording.Line(10_000, "!hold"))
    with on_a_clock() as (clock, sender):
        asked = []
        platform = types.SimpleNamespace(request=lambda text: (asked.append(text), setattr(clock, "now", clock.now + 0.7)))
        sent = sender.play(lines, platform=platform)
        times = [round(at, 3) for at, _ in sender.link.sent]
        assert asked == ["hold"] and (sent.frames, sent.requests) == (6, 1), sent
        assert times == [0, 0, 0.01, 0.71, 0.71, 0.72] and 200 < sent.held_ms < 220, (times, sent)
    with on_a_clock() as (_, sender):
        sent = sender.play(lines, speed=2)
        assert (sent.passed_over, round(sender.link.sent[-1][0], 3)) == (1, 0.255), sent


# ---- the control socket ----
@contextlib.contextmanager
def answering(*answers):
    """A heaved that gives these answers, whatever it is asked, a list for each connection; yields its socket and what it was asked."""
    path, asked = Path(FOLDER.name) / "fake.sock", []
    with contextlib.suppress(FileNotFoundError):
        path.unlink()
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))
        server.listen(8)

        def serve():
            for each in answers:
                with contextlib.suppress(OSError):
                    client, _ = server.accept()
                    with client:
                        for line, answer in zip(client.makefile(), each):
                            asked.append(line.strip())
                            client.sendall(answer.encode())
        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield path, asked


def status_of(state, **more):
    return json.dumps({"ok": True, "state": state, "goal": state, "fault": {"code": 0}, "cylinders": [], **more}) + "\n"


def requests_say_who_asks():
    with answering(['{"ok":true,"state":"OFF"}\n'] * 2) as (path, asked):
        assert heave.Platform(path, by="anna").park() == {"ok": True, "state": "OFF"}
        assert asked == ["by anna", "park"], asked


def refusals_are_in_heaveds_words():
    with answering(['{"ok":false,"error":"park: not in FAULT","state":"FAULT"}\n']) as (path, _):
        try:
            heave.Platform(path).park()
        except heave.Refused as error:
            assert (str(error), error.state, error.request) == ("park: not in FAULT", "FAULT", "park")
        else:
            raise AssertionError("not refused")


def waiting_ends_where_it_is_in_vain():
    fault = {"code": 5, "name": "drive-offline", "axis": 3, "text": "a drive is silent", "remedy": "look at its cable"}
    with answering([status_of("RISING")], [status_of("FAULT", fault=fault)]) as (path, _), refused(heave.PlatformFault, "ENGAGED", "FAULT", "drive-offline of axis 3", "look at its cable"):
        heave.Platform(path).wait_for("ENGAGED", timeout=WAIT_S)
    with answering([status_of("FAULT", fault=fault)]) as (path, _):
        assert heave.Platform(path).wait_for("FAULT", timeout=WAIT_S)["fault"]["axis"] == 3
    homing = status_of("HOMING", goal="ENGAGED", cylinders=[{"number": 1, "drive": "enabled"}, {"number": 2, "drive": "homing"}])
    with answering(*[[homing]] * 99) as (path, _), refused(heave.WaitTimeout, "not within 0.2 s", "HOMING", "on its way to ENGAGED", "drive 2 is homing"):
        heave.Platform(path).wait_for("ENGAGED", timeout=0.2)
    with answering([status_of("ENGAGED", pose_sent={"z_mm": 1.0})]) as (path, _), refused(heave.HeaveError, "'heave'", "z_mm"):
        heave.Platform(path).wait_for_pose(heave=3)


def nobody_there_is_said():
    with refused(heave.NotRunning, "/nowhere/heaved.sock", "No such file"):
        heave.Platform("/nowhere/heaved.sock").status()
    with answering(["not JSON\n"]) as (path, _), refused(heave.NotRunning, "has gone"):
        heave.Platform(path).status()
    with refused(heave.HeaveError, "one line"):
        heave.Platform("/nowhere").request("park\nengage")


# ---- a real one ----
def a_heaved_of_ones_own():
    with heave.Heaved() as heaved, heave.Heaved(changes={"intensity.max_percent": 80}) as other:
        assert heaved.port != other.port and heaved.socket != other.socket
        heaved.platform.wait_for("ENGAGED", timeout=WAIT_S)
        with refused(heave.Refused, "reset", "nothing to reset"):
            heaved.platform.reset()
        with refused(heave.Refused, "intensity 90", "80"):
            other.platform.intensity(90)
        heaved.sender.a6(z=10, time_ms=300)
        assert heaved.platform.wait_for_pose(z_mm=10, actual=True, timeout=WAIT_S)["counters"]["accepted_timed"] == 1
        heaved.sender.c7(60, 70, 80, 90, 80, 70, 15, time_ms=500)
        heaved.platform.wait_until(lambda status: abs(status["rotation"]["sent_deg"] - 15) < 0.01 and abs(status["cylinders"][3]["sent_mm"] - 90) < 0.01, WAIT_S, "C7 has arrived")
        assert heaved.platform.hold()["state"] and heaved.platform.wait_for("HOLD", timeout=WAIT_S)
        assert next(heaved.platform.watch(50))["state"] == "HOLD"
        heaved.platform.resume()
        with refused(heave.Refused, "there is no black box"):
            heaved.platform.incidents()
        heaved.platform.park()
        heaved.platform.wait_for("SETTLED", timeout=WAIT_S)
        folder = heaved.folder
        assert heaved.stop(WAIT_S) == 0
        verdict = judge.check(heaved.config, heaved.trace, frames=heaved.frames)
        assert verdict and verdict.rows > 1000, verdict
        with refused(heave.NotRunning, str(heaved.socket)):
            heaved.platform.status()
    assert not folder.exists() and other.process.poll() is not None, "left behind"


def a_recording_is_sent_to_it():
    path = write("ride.csv", "t_ms,z\n" + "".join(f"{10 * n},{n / 20}\n" for n in range(100)))
    with heave.Heaved() as heaved:
        heaved.platform.wait_for("ENGAGED", timeout=WAIT_S)
        assert heaved.sender.play(path, platform=heaved.platform).frames == 100
        status = heaved.platform.wait_until(lambda status: sum(status["counters"]["accepted"].values()) == 100, WAIT_S, "100 frames")
        assert sum(status["counters"]["rejected"].values()) == 0, status["counters"]


def a_heaved_that_cannot_start_says_why():
    with refused(heave.NotRunning, "exit code 78", "stroke_mm"):
        heave.Heaved(changes={"geometry.stroke_mm": "much"})
    with refused(ConfigError, "udp.port"):
        heave.Heaved(changes={"port": 1})
    with refused(heave.NotInstalled, "HEAVE_BIN", "/nowhere"):
        before, os.environ["HEAVE_BIN"] = os.environ["HEAVE_BIN"], "/nowhere"
        try:
            heave.Heaved()
        finally:
            os.environ["HEAVE_BIN"] = before
    with refused(FileNotFoundError, "nothing.ini"):
        heave.Heaved("nothing.ini")


def configurations_are_changed():
    text = "; a.b = 1\n[a]\nb = 2 ; of c\n; c = 3\n[d]\ne = 4\n"
    assert changed(text, {"a.b": 5, "a.c": 6, "d.e": 7, "f.g": 8}) == "; a.b = 1\n[a]\nc = 6\nb = 5\n; c = 3\n[d]\ne = 7\n\n[f]\ng = 8\n"
    with refused(ConfigError, "one line"):
        changed(text, {"a.b": "1\n[x]"})


# ---- offline, and the judge ----
def show(seconds=6):
    return [(3000 + 10 * n, heave.frame("A6", (5 * math.sin(n / 16), 0, 0, 0, 0, 10 * math.sin(n / 25)))) for n in range(100 * seconds)]


def needs_numpy():
    if importlib.util.find_spec("numpy") is None:
        raise tap.Skip("NumPy is not there")


def offline_runs_are_arrays():
    needs_numpy()
    run = heave.play(heave.demo_config(), [*show(), (10_000, "!park")])
    assert run.pose.shape == (len(run), 6) and run.cylinders.shape == (len(run), 6) and len(run.t_s) == len(run.states), run.pose.shape
    assert {"ENGAGED", "SETTLED"} < set(run.states) and abs(run["roll"].max() - 5) < 0.01 and abs(run["c1"] - run.cylinders[:, 0]).max() == 0
    speed = run.rates("z", 1)
    assert abs(max(speed[1:]) - max((run["z"][1:] - run["z"][:-1]) * 1000)) < 1e-6
    with refused(KeyError, "heave", "roll"):
        run["heave"]
    assert (run.pose == heave.play(heave.demo_config(), [*show(), (10_000, "!park")]).pose).all(), "another run, other set-points"


def offline_runs_that_fail_say_why():
    with refused(heave.PlayFailed, "demo-hexapod.ini", "stroke_mm"):
        heave.play(heave.demo_config(), [], changes={"geometry.stroke_mm": "much"})
    with refused(recording.RecordingError, "bad.frames:1"):
        heave.play(heave.demo_config(), write("bad.frames", "nonsense\n"))


def the_judge_finds_what_is_wrong():
    run = heave.play(heave.demo_config(), show())
    verdict = judge.check(heave.demo_config(), run, frames=run.frames)
    assert verdict and verdict.violations == 0 and 0.1 < verdict.rule("roll speed").share < 1, verdict.rules
    lines = run.text.splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if ",ENGAGED," in line) + 2000
    cells = lines[at].split(",")
    cells[9] = f"{float(cells[9]) + 0.5:.9f}"  # c1: half a millimetre aside for one cycle
    verdict = judge.check(heave.demo_config(), [*lines[:at], ",".join(cells), *lines[at + 1:]])
    assert not verdict and {"cylinder jerk", "cylinder accel"} <= set(verdict.by_rule) and f"line {at + 1}" in str(verdict), verdict
    assert not judge.check(heave.demo_config(), [HEADER + "\n"]), "no row at all"
    tight = write("tight.ini", changed(heave.demo_config().read_text(encoding="utf-8"), {"roll.speed_deg_s": 5}))
    assert "roll speed" in judge.check(tight, run).by_rule


def what_a_configuration_leaves_out_is_filled_in():
    text = re.sub(r"(?m)^margin_mm.*$", "", heave.demo_config().read_text(encoding="utf-8"))
    short = write("short.ini", text)
    run = heave.play(short, show(1))
    assert judge.check(short, run), judge.check(short, run)
    with refused(ConfigError, "short.ini", "speed_mm_s"):
        judge.check(write("short.ini", re.sub(r"(?m)^speed_mm_s.*$", "speed_mm_s = fast", text)), run)


def lag_and_gain_are_found():
    needs_numpy()
    times = [n / 1000 for n in range(12_000)]
    asked = [math.sin(2 * math.pi * 0.7 * t) + 0.4 * math.sin(2 * math.pi * 1.9 * t) for t in times]
    for lag, gain in ((0.0, 1.0), (0.0372, 0.8), (0.5, 1.2)):
        made = [gain * (math.sin(2 * math.pi * 0.7 * (t - lag)) + 0.4 * math.sin(2 * math.pi * 1.9 * (t - lag))) + 3 for t in times]
        found = judge.following(times, asked, times, made)
        assert abs(found.lag_ms - lag * 1000) < 0.3 and abs(found.gain - gain) < 1e-3 and found.error_rms < 2e-3 and found.share > 0.999, (lag, gain, found)
    run = heave.play(heave.demo_config(), show(12))
    found = judge.follow(run, "roll", heave.demo_config())
    assert 0 < found.lag_ms < 60 and abs(found.gain - 1) < 0.01, found
    for axis, word in (("x", "too little"), ("c1", "asked")):
        with refused(heave.HeaveError, word if axis == "x" else "0 times"):
            judge.follow(run, axis)


# ---- pictures ----
def the_animation_is_one_page():
    run = heave.play(heave.demo_config(), [(3000, "@A6T:5,6,10,0,0,20,1000#"), (5000, "!park")])
    page = animation.page(Window(run.text.splitlines(keepends=True), name="a <ride>"), Configuration(heave.demo_config()))
    assert "<title>a &lt;ride&gt;</title>" in page and "default-src 'none'" in page
    assert not re.search(r"https?://|//\w|src=|@import|url\(", page.partition("<script id")[0] + page.rpartition('<script>')[2].replace("// Left-handed", "")), "a request to somewhere"
    data = json.loads(re.search(r'<script id="run" type="application/json">(.*?)</script>', page)[1])
    assert len(data["t"]) == len(data["plate"]) == len(data["extensions"]) == len(data["nose"]) and abs(len(data["t"]) - 25 * data["t"][-1]) < 3, len(data["t"])
    i = max(range(len(data["pose"])), key=lambda n: data["pose"][n][5])
    for base, plate, out, retracted in zip(data["base"], data["plate"][i], data["extensions"][i], data["retracted"]):
        assert abs(math.dist(base, plate) - retracted - out) < 0.2, "the legs do not have the lengths of the cylinders"


def limits_used_are_shares():
    try:
        from heave.plot.shares import shares_of, spectrum_of
    except ImportError as error:
        raise tap.Skip(f"{error}") from error
    run = heave.play(heave.demo_config(), show())
    verdict, shares = judge.check(heave.demo_config(), run), shares_of(run.window, Configuration(heave.demo_config()))
    assert abs(shares["roll"][1] - verdict.rule("roll speed").share) < 1e-9 and abs(max(shares[f"c{i}"][2] for i in range(1, 7)) - verdict.rule("cylinder accel").share) < 1e-9
    frequencies, density = spectrum_of(run.window, "roll")
    peak = frequencies[density.argmax()]
    assert abs(peak - 100 / 16 / 2 / math.pi) < 0.3, peak
    no_pose = heave.play(heave.demo_config(), [(2000, "@C6:100,100,100,100,100,100#")])
    shares = shares_of(no_pose.window, Configuration(heave.demo_config()))
    assert shares["roll"] == [None] * 4 and shares["c1"][1] > 0, "cylinder by cylinder no limit of a pose axis applies"


def frequency_responses_are_read():
    from heave.plot import bode
    from heave.plot.window import TraceError
    lag = [(f, 1 / math.hypot(1, f / 8), -math.degrees(math.atan(f / 8))) for f in (0.5, 1, 2, 4, 6, 10, 20, 40)]
    text = "axis,frequency_hz,gain,phase_deg\n" + "".join(f"{axis},{f},{gain},{phase}\n" for axis in ("roll", "z") for f, gain, phase in reversed(lag))
    response = bode.read_response(text.splitlines(), "r.csv")
    assert list(response) == ["roll", "z"] and [point[0] for point in response["z"]] == [point[0] for point in lag]
    assert abs(bode.bandwidth_hz(response["z"]) - 8) < 0.3 and bode.bandwidth_hz(response["z"][:3]) is None
    assert bode.unwrapped([-170, 175, 160]) == [-170, -185, -200]
    for wrong, words in (("frequency_hz,gain\n1,1\n", "no column phase_deg"), ("frequency_hz,gain,phase_deg\n", "no row behind"), ("frequency_hz,gain,phase_deg\n1,x,0\n", "line 2 is no row"),
                         ("frequency_hz,gain,phase_deg\n1,1,0\n2,0,0\n", "line 3: frequency and gain"), ("", "no column frequency_hz")):
        with refused(TraceError, "r.csv", words):
            bode.read_response(wrong.splitlines(), "r.csv")
    run = command_run("plot", str(write("r.csv", text)), "--what", "bode", "-o", str(Path(FOLDER.name) / "r.svg"))
    if "needs matplotlib" in run.stderr:
        return
    picture = (Path(FOLDER.name) / "r.svg").read_text(encoding="utf-8")
    assert run.returncode == 0 and picture.count("<path") > 20, run.stderr


def labels_of_requests_do_not_cover_each_other():
    from heave.plot.window import labels_of
    assert labels_of([], 100) == [] and labels_of([(0, "!hold"), (100, "!resume")], 100) == [(0, "!hold"), (100, "!resume")]
    assert labels_of([(0, "!hold"), (60, "!resume"), (99, "!park"), (160, "!drive 3 fault 00008611")], 100) == [(0, "!hold +2"), (160, "!drive 3 faul…")]


def feedback_of_an_incident_is_read():
    from heave.plot.window import TraceError
    head = "t_ms,c1_state,c1_actual_mm,c1_code,c1_error,c2_state,c2_actual_mm,c2_code,c2_error,fault"
    text = f"{head}\n1,enabled,10.5,0,0,enabled,11,0,0,\n2,enabled,10.6,0,0,offline,11,0,0,drive-offline\n3,fault,10.6,7,0,offline,11,0,0,drive-offline\n"
    feedback = Feedback(text.splitlines())
    assert feedback.actual == {"c1": [10.5, 10.6, 10.6], "c2": [11, None, None]} and feedback.times_us == [1000, 2000, 3000], feedback.actual
    assert feedback.faults == [(2000, "2 drive-offline")]
    assert Feedback(text.splitlines(), 2000, 2000).times_us == [2000]
    before_zero = f"{head}\n1,disabled,5,0,0,disabled,5,0,0,drive-offline\n2,enabled,5,0,0,enabled,5,0,0,\n1,enabled,7,0,0,enabled,8,0,0,\n"
    feedback = Feedback(before_zero.splitlines())
    assert (feedback.times_us, feedback.actual, feedback.faults) == ([1000], {"c1": [7], "c2": [8]}, []), "what was before time zero is drawn over what came after"
    for wrong, words in (("a,b", "line 1 is not the header"), (f"{head}\n1,enabled,x,0,0,enabled,11,0,0,", "line 2 is no row"), (f"{head}\n1,enabled", "line 2 is no row"), ("", "line 1")):
        with refused(TraceError, "feedback.csv", words):
            Feedback(wrong.splitlines())


def faults_are_marked_with_number_and_name():
    """In curves and animations: those of an incident, one after another, and those that FRAMES bring."""
    from heave.faults import NAMES, fault_text
    told = re.findall(r"(?m)^\| (\d+) \| `([a-z-]+)` \|", (Path(__file__).resolve().parents[2] / "docs/faults.md").read_text(encoding="utf-8"))
    assert {(int(number), name) for number, name in told} == set(enumerate(NAMES[1:], 1)), "faults.py is another table than that of heaved"
    assert [fault_text(6), fault_text("6", "3"), fault_text("bus-lost"), fault_text("fire", 2), fault_text(99)] == ["6 following-error", "6 following-error, axis 3", "5 bus-lost", "fire, axis 2", "99"]
    head = "t_ms,c1_state,c1_actual_mm,c1_code,c1_error,fault"
    rows = ["1,enabled,1,0,0,", "2,fault,1,7,0,drive-fault", "3,fault,1,7,0,drive-fault", "4,enabled,1,0,0,", "5,offline,1,0,0,drive-offline"]
    assert Feedback([head, *rows]).faults == [(2000, "1 drive-fault"), (5000, "2 drive-offline")]
    assert Feedback([head, rows[1], *rows[:2]]).faults == [(2000, "1 drive-fault")], "what was before time zero"
    run = heave.play(heave.demo_config(), [(3000, "!fault following-error 3"), (6000, "!end")])
    trace, frames = write("faulty.csv", run.text), write("faulty.frames", "3000 !fault following-error 3\n3500 !hold\n")
    states = animation.told_states(Window(run.text.splitlines(keepends=True)), [(3_000_000, "6 following-error, axis 3")])
    assert states[-1] == "FAULT 6 following-error, axis 3" and "FAULT" not in states[0], (states[0], states[-1])
    page = trace.with_suffix(".html")
    assert command_run("plot", str(trace), "--config", str(heave.demo_config()), "--frames", str(frames), "-o", str(page)).returncode == 0 and states[-1] in page.read_text(encoding="utf-8")
    ran = command_run("plot", str(trace), "--frames", str(frames), "-o", str(trace.with_suffix(".svg")))
    if "needs matplotlib" not in ran.stderr:
        drawn = trace.with_suffix(".svg").read_text(encoding="utf-8")
        assert "<!-- 6 following-error, axis 3 -->" in drawn and "!hold" in drawn and "!fault" not in drawn, ran.stderr


def samples_are_drawn_as_the_trace_of_the_same_ride():
    from heave.plot.sampled import Sampled, is_sampled
    from heave.plot.window import TraceError
    with heave.Heaved() as heaved:
        heaved.platform.wait_for("ENGAGED", timeout=WAIT_S)
        command = [Path(os.environ["HEAVE_BIN"]) / "heavectl", "--socket", heaved.socket, "--for", "2", "scope"]
        with subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, text=True) as scope:
            heaved.sender.a6(z=20, roll=3, time_ms=1000)
            text = scope.communicate(timeout=WAIT_S)[0]
        assert heaved.stop() == 0
        trace = Window(heaved.trace.read_text(encoding="ascii").splitlines(keepends=True))
    lines = text.splitlines(keepends=True)
    assert is_sampled(lines[0]) and not is_sampled(HEADER) and not is_sampled("frequency_hz,gain,phase_deg")
    samples = Sampled(lines)
    window = Window(samples.trace)
    feedback = Feedback(samples.feedback)
    assert len(window.rows) > 500 and max(window.column("z")) > 15e9, len(window.rows)
    rows = {tuple(round(value / 10) for value in row): state for row, state in zip(trace.rows, trace.states)}  # the last of nine decimals is rounded
    found = [rows.get(tuple(round(value / 10) for value in row)) for row in window.rows]
    assert sum(state == own for state, own in zip(found, window.states)) > 0.99 * len(found), "other rows than those of the trace"
    assert abs(feedback.actual["z"][-1] - 20) < 0.1 and abs(feedback.actual["c1"][-1] - window.column("c1")[-1] / 1e9) < 0.1, feedback.actual["z"][-1]
    names = lines[0].rstrip().split(",")
    few = ["t_ms", "sent_z_mm", "actual_z_mm", "fault_axis", "fault"]
    chosen = [",".join(line.rstrip().split(",")[names.index(name)] for name in few) + "\n" for line in lines]
    chosen[-1] = chosen[-1].rsplit(",", 2)[0] + ",2,4\n"
    some = Sampled(chosen)
    assert Window(some.trace).column("z") == window.column("z") and set(Window(some.trace).states) == {"ENGAGED"} and Feedback(some.feedback).faults[0][1] == "4 drive-timeout, axis 2"
    for wrong, words in ((["t_ms,actual_z_mm\n", "1,2\n"], "sent_"), (["t_ms,sent_z_mm\n", "1,2\n", "1\n"], "line 3 is no row"), (["t_ms,state,sent_z_mm\n", "1,99,2\n"], "line 2 is no row")):
        with refused(TraceError, "ride.csv", words):
            Sampled(wrong, "ride.csv")
    page = Path(FOLDER.name) / "samples.html"
    run = command_run("plot", str(write("samples.csv", text)), "--config", str(heave.demo_config()), "-o", str(page))
    assert run.returncode == 0 and "<script>" in page.read_text(encoding="utf-8"), run.stderr
    run = command_run("plot", str(write("samples.csv", text)), "-o", str(page.with_suffix(".svg")))
    assert "needs matplotlib" in run.stderr or run.returncode == 0 and page.with_suffix(".svg").read_text(encoding="utf-8").count("<path") > 20, run.stderr


def command_run(*words):
    return subprocess.run([sys.executable, "-m", "heave", *words], capture_output=True, text=True, check=False, timeout=WAIT_S)


def python_with_numpy():
    """This script again, with NumPy where that is to be had."""
    if importlib.util.find_spec("numpy") is None and "HEAVE_TEST_AGAIN" not in os.environ:
        with contextlib.suppress(tap.Skip):
            os.environ["HEAVE_TEST_AGAIN"] = "1"
            os.execv(python := kernel.find("venv.sh"), [python, *sys.argv])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options = parser.parse_args()
    python_with_numpy()
    os.environ["HEAVE_BIN"] = options.bin
    suite = tap.Suite()
    for case in (frames_are_as_the_protocol_has_them, wrong_values_are_named, csv_becomes_frames, files_of_people_are_read_as_heaved_reads_them, wrong_recordings_are_named_with_their_line, a_stream_does_not_drift, a_stream_makes_up_for_nothing,
                 a_stream_of_values_ends_with_them, a_recording_keeps_its_times, requests_say_who_asks, refusals_are_in_heaveds_words, waiting_ends_where_it_is_in_vain, nobody_there_is_said,
                 a_heaved_of_ones_own, a_recording_is_sent_to_it, a_heaved_that_cannot_start_says_why, configurations_are_changed, offline_runs_are_arrays, offline_runs_that_fail_say_why,
                 the_judge_finds_what_is_wrong, what_a_configuration_leaves_out_is_filled_in, lag_and_gain_are_found, the_animation_is_one_page, limits_used_are_shares, faults_are_marked_with_number_and_name, frequency_responses_are_read,
                 labels_of_requests_do_not_cover_each_other, feedback_of_an_incident_is_read, samples_are_drawn_as_the_trace_of_the_same_ride):
        with suite.case(case.__name__.replace("_", " ")):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
