#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_live.py BIN [--guard LIB] - the daemon at work on the loopback interface: frames, operators, recordings, signals, trouble.

--guard LIB: malloc_guard.c as a shared library; without it (instrumented builds) the cases about it are skipped.
"""
import argparse
import collections
import fcntl
import grp
import json
import math
import mmap
import os
import pty
import random
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import termios
import threading
import time
import zlib
from pathlib import Path

import harness
import tap

from heave import Twin

COMMANDS = ["engage", "hold", "resume", "park", "reset", "shutdown"]
MANUAL = {"platform__engage": "manual"}
ELSEWHERE = {"platform__engage": "manual", "sim__start_extension_mm": "61.7", "sim__homed": "no"}


def wave(t):
    return f"@A6:{6 * math.sin(2 * t):.3f},{5 * math.sin(1.7 * t):.3f},0,0,0,{20 * math.sin(1.3 * t):.3f},{int(10 * t) % 4096:X}#"


# --- The platform follows, operators are answered ---

def follows_frames(bench):
    daemon = bench.start()
    status = bench.wait_state("ENGAGED")
    assert len(status["cylinders"]) == 6 and status["relays"]["count"] == 12 and status["rotation"] is not None
    with bench.sender() as sender:
        sender.send("@A7:4,-3,2,10,-20,30,45,0A05#")
        harness.wait_for(lambda: abs(bench.status()["pose_sent"]["z_mm"] - 30) < 1e-6, "the pose is reached")
        harness.wait_for(lambda: abs(bench.status()["rotation"]["sent_deg"] - 45) < 1e-6, "the angle is reached")
        status = harness.wait_for(lambda: (lambda s: s if s["speed_actual"] and abs(s["speed_actual"]["z_mm_s"]) < 0.1 else None)(bench.status()), "at rest")
        sender.send("@A7:1#")
        sender.send("@A3T:1,1,1,100#")
        counters = harness.wait_for(lambda: (lambda c: c if c["accepted"]["A3"] else None)(bench.status()["counters"]), "A3 is accepted")
    expected = {"roll_deg": 4, "pitch_deg": -3, "yaw_deg": 2, "x_mm": 10, "y_mm": -20, "z_mm": 30}
    assert all(abs(status["pose_sent"][name] - value) < 1e-6 for name, value in expected.items()), status["pose_sent"]
    assert list(status["speed_actual"]) == [f"{name}_s" for name in expected] and list(status["accel_actual"]) == [f"{name}_s2" for name in expected], status
    assert status["relays"]["mask"] == "0A05" and status["relays"]["on"] == [1, 3, 10, 12], status["relays"]
    assert counters["accepted"]["A7"] == 1 and counters["accepted_timed"] == 1 and counters["rejected"]["count"] == 1, counters
    assert bench.stop(daemon) == 0


def every_command_answers(bench):
    daemon = bench.start(config=bench.write_config("manual.ini", **MANUAL))
    status = bench.status()
    assert status["state"] == "OFF" and status["goal"] == "SETTLED", status["state"]
    for request in ("hold", "resume", "reset"):
        answer, code = bench.ask(request)
        assert code == 1 and answer["ok"] is False and answer["state"] == "OFF" and answer["error"].startswith(request + ": "), answer
        assert "possible: engage, park" in answer["error"], answer
    for request, state, then in (("engage", "HOMING", "ENGAGED"), ("hold", "HOLD", "HOLD"), ("resume", "ENGAGED", "ENGAGED"),
                                 ("park", "SETTLING", "SETTLED"), ("shutdown", "OFF", None)):
        answer, code = bench.ask(request)
        assert code == 0 and answer == {"ok": True, "state": state}, answer
        if then:
            bench.wait_state(then)
    assert daemon.wait(timeout=harness.WAIT_S) == 0
    assert not bench.socket.exists()


def waits_for_the_end(bench):
    """--wait: what was asked for is done when it returns, or somebody is told why not."""
    daemon = bench.start(config=bench.write_config("manual.ini", **MANUAL))

    def wait(*arguments):
        run = bench.ctl(*arguments)
        return run.returncode, run.stdout, run.stderr

    assert wait("--wait", "engage") == (0, "engage: ENGAGED, waiting for a sender\n", "")
    code, out, error = wait("--wait", "resume")
    assert code == 1 and not out and "nothing to resume" in error, error
    assert wait("--wait", "hold")[0] == 64 and wait("--wait", "status")[0] == 64
    harness.wait_for(lambda: bench.status()["held_by_silence"], "the silence")
    assert bench.status()["hold_reason"] == "the sender is silent", bench.status()["hold_reason"]
    status = bench.status()
    assert status["waiting_for_sender"] is True and status["pose_received"] is None and status["stream"]["period_ms"] is None, status
    assert abs(status["time_unix_ms"] / 1000 - time.time()) < 60, status["time_unix_ms"]
    assert "waiting for a sender" in bench.ctl("status").stdout and "SENDER SILENT" not in bench.ctl("status").stdout
    with bench.sender() as sender:
        sender.send("@A6:90,0,0,0,0,0,0#")
        harness.wait_for(lambda: bench.status()["pose_received"] is not None, "a frame")
        status = bench.status()
        assert status["pose_received"]["roll_deg"] == 90 and status["pose_asked"]["roll_deg"] < 90, status["pose_asked"]
        assert status["waiting_for_sender"] is False
    code, out, error = wait("--wait", "--for", "0.05", "park")
    assert code == 1 and not out and error == "heavectl: park: not done in time; it goes on\n", error
    assert wait("--wait", "park") == (0, "park: SETTLED\n", "")
    assert bench.status()["state"] == "SETTLED"
    code, out, _ = wait("--json", "--wait", "engage")
    assert code == 0 and json.loads(out)["state"] == "ENGAGED", out
    assert wait("--wait", "shutdown") == (0, "", "")
    assert daemon.wait(timeout=harness.WAIT_S) == 0


def waits_and_is_held(bench):
    daemon = bench.start(config=bench.write_config("manual.ini", **MANUAL))
    with subprocess.Popen([bench.bin / "heavectl", "--socket", str(bench.socket), "--wait", "engage"], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True) as waiting:
        bench.wait_state("HOMING", "RISING")
        assert bench.ctl("hold").returncode == 0
        out, error = waiting.communicate(timeout=harness.WAIT_S)
    assert waiting.returncode == 1 and not out and "the platform was put on hold: a hold was asked for; heavectl resume goes on" in error, error
    assert bench.stop(daemon) == 0


def plain_answers_are_lines(bench):
    daemon = bench.start(config=bench.write_config("manual.ini", **MANUAL))
    run = bench.ctl("engage")
    assert (run.returncode, run.stdout, run.stderr) == (0, "engage: HOMING\n", ""), run
    run = bench.ctl("reset")
    assert run.returncode == 1 and run.stdout == "" and re.fullmatch(r"heavectl: reset: there is nothing to reset in [^\n]*\n", run.stderr), run
    fault = json.loads(bench.ctl("--json", "status").stdout)["fault"]
    assert (fault["text"], fault["text_zh"]) == ("none", "\u65e0"), fault
    table = bench.ctl("status", env={**os.environ, "LC_ALL": "C"}).stdout
    assert all(len(line) <= 80 for line in table.splitlines()) and table.isascii() and "cylinder" in table, table
    table = bench.ctl("status", env={**os.environ, "LC_ALL": "C.UTF-8"}).stdout
    assert not table.isascii() and all(len(line) <= 80 for line in table.splitlines()), table
    assert bench.stop(daemon) == 0


def a_bus_that_does_not_work_says_why(bench):
    text = (harness.TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8").replace("can0", "nosuch0").replace("port = 9800", f"port = {bench.port}")
    text += f"\n[control]\nsocket = {bench.socket}\n"
    daemon = bench.start(config=bench.file("bus.ini", text))
    bus = harness.wait_for(lambda: bench.status()["bus"], "the bus is in the status")
    assert bus["trouble"].startswith("can: nosuch0: ") and bus["trouble"] == bus["last_trouble"], bus
    assert all(cylinder["actual_mm"] is None for cylinder in bench.status()["cylinders"])
    table = bench.ctl("status", env={**os.environ, "LC_ALL": "C"}).stdout
    assert all(len(line) <= 80 for line in table.splitlines()), table
    assert bus["trouble"].replace(" ", "") in re.sub(r"\s", "", table), "words of the bus are cut: " + table
    assert len(re.findall(r"^ [1-6] .* - offline$", table, re.MULTILINE)) == 6, table
    assert bench.stop(daemon) == 0


def names_of(value):
    """Of all members, at any depth."""
    if isinstance(value, dict):
        return set(value) | set().union(*map(names_of, value.values()))
    return set().union(*map(names_of, value)) if isinstance(value, list) else set()


def every_member_is_documented(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    status = bench.status()
    for counts in ("accepted", "rejected"):
        status["counters"][counts] = None  # members are commands and reasons there
    rows = re.findall(r"^\|.*$", (harness.TOP / "docs/status-json.md").read_text(encoding="utf-8"), re.MULTILINE)
    known = {word for row in rows for piece in re.findall(r"`([^`]+)`", row) for word in re.split(r"[.\[\]]+", piece)}
    promised = {re.split(r"[.\[]", piece)[0] for row in rows for piece in re.findall(r"`([^`]+)`", row.split("|")[1]) if piece[0] != "."}
    assert not names_of(status) - known, f"not in docs/status-json.md: {sorted(names_of(status) - known)}"
    assert not promised - set(status), f"documented and not there: {sorted(promised - set(status))}"
    assert bench.stop(daemon) == 0


def without_a_daemon(bench):
    for command in COMMANDS + ["status", "watch"]:
        run = bench.ctl(command)
        assert run.returncode == 69 and re.fullmatch(r"heavectl: heaved is not running at [^\n]*--config FILE[^\n]*\n", run.stderr), run
    for arguments in (["status", "now"], ["fly"], [], ["--for", "x", "watch"], ["--hz", "0", "watch"], ["--frobnicate", "status"]):
        assert bench.ctl(*arguments).returncode == 64, arguments
    assert subprocess.run([bench.bin / "heavectl", "--help"], stdout=subprocess.DEVNULL, check=False).returncode == 0


# --- Watching ---

def watches_by_line(bench):
    daemon = bench.start()

    def watch(least, *options):
        """As many lines as a busy machine brings only after some tries; and how long the last one took."""
        started_s = time.monotonic()
        run = bench.ctl(*options, "watch")
        assert run.returncode == 0, run
        return (run.stdout.splitlines(), time.monotonic() - started_s) if run.stdout.count("\n") >= least else None

    lines, took_s = harness.wait_for(lambda: watch(1, "--for", "1.2"), "a line")
    assert took_s >= 1.2 and len(lines) <= took_s + 2 and "\x1b" not in "".join(lines), (took_s, lines)
    lines, _ = harness.wait_for(lambda: watch(6, "--json", "--for", "1", "--hz", "50"), "more than one a second")
    cycles = [json.loads(line)["cycle"] for line in lines]
    assert cycles == sorted(cycles), cycles
    assert bench.stop(daemon) == 0


def ctl_on_terminal(bench, *arguments, **environment):
    """heavectl as a person starts it: process and terminal."""
    try:
        for end in os.openpty():
            os.close(end)
    except OSError as error:
        raise tap.Skip(f"no terminal to be had here: {error}") from error
    pid, terminal = pty.fork()
    if pid == 0:
        os.environ.update({"LC_ALL": "C.UTF-8", "TERM": "xterm", "NO_COLOR": "", **environment})
        os.execv(bench.bin / "heavectl", ["heavectl", "--socket", str(bench.socket), *arguments])
    return pid, terminal


def shown_on_terminal(bench, *arguments, **environment):
    """All that it shows until it ends by itself."""
    pid, terminal = ctl_on_terminal(bench, *arguments, **environment)
    seen = b""
    try:
        while part := os.read(terminal, 65536):
            seen += part
    except OSError:
        pass  # the terminal's other end is closed
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0, seen
    os.close(terminal)
    return seen


def has_colours_on_a_terminal_only(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    plain = bench.ctl("status").stdout
    assert plain.startswith("ENGAGED ") and "\x1b" not in plain, plain[:80]
    shown = shown_on_terminal(bench, "status")
    assert shown.startswith(b"\x1b[1;32mENGAGED  \x1b[0m goal"), shown[:80]
    for environment in ({"NO_COLOR": "1"}, {"TERM": "dumb"}):
        assert b"\x1b" not in shown_on_terminal(bench, "status", **environment), environment
    assert b"\x1b" not in shown_on_terminal(bench, "--json", "status")
    assert bench.stop(daemon) == 0


def shows_every_cycle(bench):
    """heavectl scope: consecutive cycles, chosen columns; a stopped reader holds nobody up; a ninth client's rules do not matter to a mapped memory."""
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    shown = bench.folder / "shown.csv"
    with open(shown, "wb") as file, subprocess.Popen([bench.bin / "heavectl", "--socket", str(bench.socket), "scope"], stdout=file) as stopped:
        harness.wait_for(lambda: shown.stat().st_size > 0, "the first rows")
        stopped.send_signal(signal.SIGSTOP)
        with bench.sender() as sender:
            sender.stream(0.3, wave)
            run = bench.ctl("--for", "1", "scope")
            assert run.returncode == 0 and run.stderr == "", run.stderr
            lines = run.stdout.splitlines()
            names = lines[0].split(",")
            rows = [dict(zip(names, map(float, line.split(",")))) for line in lines[1:]]
            assert len(rows) > 200, len(rows)
            assert all(after["cycle"] == before["cycle"] + 1 for before, after in zip(rows, rows[1:]))
            assert {row["state"] for row in rows} <= {5.0, 6.0}, rows[0]
            late = bench.status()
            assert rows[-1]["cycle"] <= late["cycle"] and rows[0]["sent_c1_mm"] > 0, rows[-1]
        stopped.send_signal(signal.SIGCONT)
        stopped.send_signal(signal.SIGINT)
        assert stopped.wait(timeout=harness.WAIT_S) == 0
    lines = bench.ctl("--for", "0.2", "scope", "t_ms,drive1,sent_z_mm").stdout.splitlines()
    assert lines[0] == "t_ms,drive1,sent_z_mm" and re.fullmatch(r"\d+\.000,3,-?\d+\.\d{9}", lines[1]), lines[:2]
    run = bench.ctl("scope", "t_ms,colour")
    assert run.returncode == 64 and "colour is no column" in run.stderr, run.stderr
    with socket.socket(socket.AF_UNIX) as client:
        client.connect(str(bench.socket))
        client.sendall(b"samples\n")
        answer, (fd,), _, _ = socket.recv_fds(client, 4096, 4)
        assert json.loads(answer) == {"ok": True, "seconds": 30}, answer
        try:
            mmap.mmap(fd, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE)
            raise AssertionError("a reader may write")
        except PermissionError:
            pass
        with mmap.mmap(fd, 0, prot=mmap.PROT_READ) as memory:
            assert memory[:8] == b"HEAVESMP" and struct.unpack_from("<I", memory, 32)[0] == status_cycle_us(bench)
        os.close(fd)
    assert bench.stop(daemon) == 0


def status_cycle_us(bench):
    return bench.status()["cycle_us"]


def has_no_samples(bench):
    text = bench.config.read_text(encoding="utf-8") + "\n[samples]\nseconds = 0\n"
    daemon = bench.start(config=bench.file("none.ini", text))
    run = bench.ctl("scope")
    assert run.returncode == 1 and "samples: there are none" in run.stderr, run.stderr
    assert bench.stop(daemon) == 0


def watches_on_a_small_terminal(bench):
    """24 lines of 80 columns: the line with the state stays, with a fault the fault does too, each drive, bus and sender, and no word is broken."""
    text = (harness.TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8").replace("can0", f"twin{os.getpid() % 1000000}").replace("port = 9800", f"port = {bench.port}")
    config = bench.file("bus.ini", text + f"\n[control]\nsocket = {bench.socket}\n")
    with Twin(config, program=bench.bin / "heave-twin"):
        daemon = bench.start(config=config)
        assert bench.ctl("engage").returncode == 0
    bench.wait_state("FAULT")  # all drives are gone
    pid, terminal = ctl_on_terminal(bench, "--for", "0.5", "watch")
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    seen = b""
    try:
        while part := os.read(terminal, 65536):
            seen += part
    except OSError:
        pass  # the terminal's other end is closed
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0
    screen = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", seen.decode().split("\x1b[H")[-1].split("\x1b[?25h")[0])
    lines = screen.replace("\r", "").split("\n")
    assert 22 <= len(lines) <= 24 and all(len(line) <= 80 for line in lines), lines
    begins = [line.split()[0] for line in lines if line]
    assert all(begins.count(word) == 1 for word in (*"123456", "bus", "sender", "cause", "remedy")), begins
    assert re.match(r"\d+ lines more in a higher window", lines[-1]), lines
    assert lines[0].startswith("FAULT") and lines[1].startswith("fault "), lines[:2]
    words = set(bench.status()["fault"]["remedy"].split())
    shown = set(" ".join(lines).split())
    assert words <= shown, words - shown
    assert bench.stop(daemon) == 0


def watches_on_a_terminal(bench):
    daemon = bench.start()
    pid, terminal = ctl_on_terminal(bench, "watch")
    seen = b""
    end = time.monotonic() + harness.WAIT_S
    while seen.count(b"\x1b[H") < 5 and time.monotonic() < end:
        if select.select([terminal], [], [], 0.5)[0]:
            seen += os.read(terminal, 65536)
    os.write(terminal, b"\x03")  # Ctrl-C
    try:
        while part := os.read(terminal, 65536):
            seen += part
    except OSError:
        pass  # the terminal's other end is closed
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    assert code == 0, code
    assert seen.startswith(b"\x1b[?1049h") and seen.rstrip().endswith(b"\x1b[?25h\x1b[?1049l"), seen[-200:]
    assert "█".encode() in seen and b"fault" in seen
    assert bench.stop(daemon) == 0


# --- Recordings ---

def session(bench, daemon):
    """Frames, operators, rejects, a stopped process."""
    with bench.sender() as sender:
        assert bench.ctl("intensity", 80).returncode == 0
        sender.stream(1.2, wave)
        bench.ctl("engage")
        bench.wait_state("ENGAGED")
        sender.stream(1.0, wave)
        bench.ctl("hold")
        sender.send("nonsense \\ \"\n\x00\xff;")
        sender.send(b"!engage")
        sender.stream(0.3, wave)
        bench.ctl("resume")
        sender.send("")
        sender.send("@A6:1,2,3,4,5,6,F0#" * 60)  # longer than a datagram may be
        sender.stream(0.7, wave)
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(0.05)
        daemon.send_signal(signal.SIGCONT)
        sender.stream(0.5, wave)
        sender.send("@A6T:0,5,0,0,0,0,400#")
        time.sleep(0.6)
        assert bench.ctl("intensity", 20).stdout == "intensity: 20 %\n"
        assert bench.ctl("intensity", 101).returncode == 1
        bench.ctl("resume")
        bench.ctl("park")
        sender.stream(0.5, wave)
        bench.ctl("engage")
        sender.stream(0.5, wave)


def replays_to_the_same_bytes(bench, **changes):
    config = bench.write_config("recorded.ini", **changes)
    record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
    daemon = bench.start("--record", record, "--trace", trace, config=config)
    session(bench, daemon)
    assert bench.stop(daemon) == 0
    live, log, text = harness.since_zero(trace.read_bytes()), daemon.log.read_text(), record.read_text()
    assert "missing" not in log, log
    played = bench.play(record, config=config)
    assert len(live.splitlines()) > 3000, "a live run worth the name"
    length = min(len(live), len(played))
    if live[:length] != played[:length]:
        for ours, theirs in zip(live.splitlines(), played.splitlines()):
            assert ours == theirs, f"live:   {ours}\nplayed: {theirs}"
    states = {row["state"] for row in harness.rows_of(live)}
    assert {"SETTLED", "RISING", "ENGAGED", "HOLD", "SETTLING", "OFF"} <= states, states
    assert any("late" in row["flags"] for row in harness.rows_of(live)) and " !late " in text
    assert text.startswith("; heaved ") and "!shutdown" in text and "!intensity 20" in text and "\\x21engage" in text, text[:200]
    assert bench.play(record, config=config) == played


def a_late_cycle_holds(bench):
    config = bench.write_config("punctual.ini", platform__late_hold_cycles=40)
    record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
    daemon = bench.start("--record", record, "--trace", trace, config=config)

    def is_engaged():  # a busy machine may hold it before: that is what is tried here
        state = bench.status()["state"]
        if state == "HOLD":
            bench.ctl("resume")
        return state == "ENGAGED"

    harness.wait_for(is_engaged, "ENGAGED")
    with bench.sender() as sender:
        sender.stream(0.5, wave)
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(0.2)
        daemon.send_signal(signal.SIGCONT)
        sender.stream(0.5, wave)
        held = bench.wait_state("HOLD")  # not for its silence: frames do not release it
        assert re.fullmatch(r"\d+ cycles were late", held["hold_reason"]), held["hold_reason"]
        assert "cycles late: holding" in daemon.log.read_text()
        bench.ctl("resume")
        sender.stream(0.3, wave)
        status = bench.status()
    assert status["late_cycles"] > 40 and status["wake_latency"]["max_us"] > 40000, status
    assert status["wake_latency"]["count"] >= status["cycle"] - 100 and status["cycle_time"]["p50_us"] <= status["cycle_time"]["max_us"]
    assert bench.stop(daemon) == 0
    live = harness.since_zero(trace.read_bytes())
    assert bench.play(record, config=config)[:len(live)] == live, "a late cycle replays"


def with_black_box(bench):
    """A configuration with a black box, and its directory."""
    directory = bench.folder / "incidents"
    config = bench.write_config("boxed.ini")
    config.write_text(f"{config.read_text()}\n[black-box]\ndirectory = {directory}\nseconds = 10\n")
    return config, directory


def dumps_the_black_box(bench):
    config, directory = with_black_box(bench)
    daemon = bench.start(config=config)
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(1.0, wave)
        run = bench.ctl("dump")
        assert run.returncode == 0 and run.stdout.startswith(f"dump: {directory}/incident-000001-"), run
        sender.stream(0.3, wave)
    answer, code = bench.ask("dump")
    assert code == 0 and answer == {"ok": True, "folder": answer["folder"]}, answer
    names = [Path(run.stdout[len("dump: "):].strip()).name, Path(answer["folder"]).name]
    assert all(name.endswith("-dump") for name in names), names
    assert bench.ctl("incidents").stdout == f"{names[0]}: new\n{names[1]}: new\n"
    listed, code = bench.ask("seen")
    assert code == 0 and listed == {"ok": True, "incidents": [{"name": name, "dump": True, "seen": True} for name in names]}, listed
    harness.wait_for(lambda: (directory / ".seen").exists() and (directory / ".seen").read_text() == "000002\n", "that is kept")
    assert bench.stop(daemon) == 0
    folders = sorted(path for path in directory.iterdir() if path.is_dir())
    assert [str(folder) for folder in folders] == [run.stdout[len("dump: "):].strip(), answer["folder"]], folders
    for folder in folders:
        trace = harness.since_zero((folder / "trace.csv").read_bytes())
        assert len(trace.splitlines()) > 1000
        played = bench.play(folder / "frames", config=folder / "platform.ini")
        assert played == trace, f"{folder.name} plays back otherwise"


def replays_a_forged_state_in_a_cage(bench):
    """With its check sum right. A state that nothing can be made of ends the run; whatever one does, nothing but the trace is written, and it ends."""
    config, directory = with_black_box(bench)
    daemon = bench.start(config=config)
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(27, wave)  # more than is kept: the incident begins with a state
    assert bench.ask("dump")[1] == 0
    harness.wait_for(lambda: list(directory.glob("*/frames")), "the incident")
    assert bench.stop(daemon) == 0
    text = min(directory.glob("*/frames")).read_text(encoding="utf-8")
    head, about, _, digits = re.search(r"(?m)^(\S+ !state )(\S+ [0-9a-f]{16} )([0-9A-F]{8}) ([0-9A-F]+)$", text).groups()
    state = bytes.fromhex(digits)
    end = f"{float(head.split()[0]) + 1000:.3f} !end\n"
    trace = bench.folder / "forged.csv"

    def play(forged, about=about):
        frames = bench.file("forged.txt", f"{head}{about}{zlib.crc32(forged):08X} {forged.hex().upper()}\n{end}")
        return bench.heaved("--config", config, "--play", frames, "--trace", trace)

    def files():
        return {path: path.stat().st_mtime_ns for path in bench.folder.rglob("*") if path.is_file() and path.name not in ("forged.csv", "forged.txt")}

    run = play(state)
    assert run.returncode == 0 and len(trace.read_bytes().splitlines()) > 1000, run.stderr
    run = play(state, about[:-2] + ("0 " if about[-2] != "0" else "1 "))
    assert run.returncode == 65 and "line 1: the !state is of another configuration; play it with the platform.ini beside it" in run.stderr, run.stderr
    trace.unlink()
    before = files()
    codes = collections.Counter()
    chance = random.Random(5)
    for i in range(60):
        forged = bytearray(state)
        for _ in range(i % 4 + 1 if i > 0 else 2000):
            at = chance.randrange(len(forged) - 8)
            forged[at:at + 8] = chance.choice([bytes(8), b"\xff" * 8, b"\xff" * 7 + b"\x7f", chance.randbytes(8)])
        run = play(bytes(forged))
        codes[run.returncode] += 1
        assert run.returncode == 0 or (run.returncode == 65 and "line 1: the replay from this !state crashed or did not end, and was stopped" in run.stderr), (i, run.returncode, run.stderr)
    assert codes[65] > 0, codes  # the first at least
    assert files() == before, "a replay has written something else"


def replays_a_following_error(bench):
    """Simulated drives lag; a window that a reload makes too narrow for that finds a fault that no drive reports."""
    config, directory = with_black_box(bench)
    daemon = bench.start(config=config)
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(0.5, wave)
        config.write_text(config.read_text().replace("[cylinders]\n", "[cylinders]\nfollowing_error_mm = 0.01\n"))
        daemon.send_signal(signal.SIGHUP)
        harness.wait_for(lambda: sender.stream(0.5, wave) or bench.status()["state"] == "FAULT", "FAULT")
    fault = bench.status()["fault"]
    assert fault["name"] == "following-error" and fault["found_by"] == "heaved" and fault["device_code"] == 0, fault
    assert abs(fault["allowed_mm"] - 0.01) < 1e-4 and 0.01 < fault["off_mm"] < 100 and fault["off_deg"] is None and fault["allowed_deg"] is None, fault
    assert f"  found  by heaved: {fault['off_mm']:.2f} mm off, allowed 0.01 mm\n" in bench.ctl("status").stdout, bench.ctl("status").stdout
    chinese = bench.ctl("status", env={**os.environ, "LC_ALL": "zh_CN.UTF-8", "HEAVE_LOCALES": str(bench.bin.resolve().parent / "locale")}).stdout
    assert f"由 heaved 发现：偏差 {fault['off_mm']:.2f} mm，允许 0.01 mm" in chinese, chinese
    assert re.search(rf"axis {fault['axis']}: found by heaved, \d+\.\d\d mm off, allowed 0\.01 mm", daemon.log.read_text())
    assert bench.stop(daemon) == 0
    folder, = directory.glob("incident-*")
    assert " !fault following-error " in (folder / "frames").read_text()
    trace = harness.since_zero((folder / "trace.csv").read_bytes())
    states = [row["state"] for row in harness.rows_of(trace)]
    assert "ENGAGED" in states and states[-1] == "FAULT", set(states)
    played = bench.play(folder / "frames", config=folder / "platform.ini")
    end = trace.index(b"\n", trace.index(b",FAULT,")) + 1
    assert played[:end] == trace[:end], "the fault comes otherwise"
    assert played == trace, "what comes after it does"


def dumps_nothing(bench):
    daemon = bench.start()
    answer, code = bench.ask("dump")
    assert code == 1 and "[black-box] directory" in answer["error"], answer
    answer, code = bench.ask("incidents")
    assert code == 1 and "[black-box] directory" in answer["error"], answer
    assert bench.stop(daemon) == 0


def tells_the_service_manager(bench):
    path = str(bench.folder / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(path)
        manager.settimeout(harness.WAIT_S)
        heard = []

        def hear_until(text):
            while not heard or text not in heard[-1]:
                heard.append(manager.recv(500).decode())

        daemon = bench.start(environment={"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "500000"})  # ten fit into the socket, where a busy machine leaves them
        hear_until("READY=1")
        if "STATUS=ENGAGED" not in heard:
            hear_until("STATUS=ENGAGED")
        for _ in range(3):
            hear_until("WATCHDOG=1")
        daemon.send_signal(signal.SIGTERM)
        hear_until("STOPPING=1\nEXTEND_TIMEOUT_USEC=")
        within_s = int(heard[-1].rpartition("=")[2]) / 1e6
        assert 200 / 50 < within_s < 30, f"{within_s} s for a stroke of 200 mm at 50 mm/s"
        hear_until("STATUS=OFF")
        assert daemon.wait(timeout=harness.WAIT_S) == 0


# --- The end ---

def signal_settles(bench, number):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    assert bench.stop(daemon, number) == 0
    log = daemon.log.read_text()
    for change in ("ENGAGED -> SETTLING", "SETTLING -> SETTLED", "SETTLED -> OFF"):
        assert change in log, log
    assert not bench.socket.exists()


def second_signal_ends_at_once(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    daemon.send_signal(signal.SIGINT)
    harness.wait_for(lambda: "-> SETTLING" in daemon.log.read_text(), "it settles")
    code, log = bench.stop(daemon, signal.SIGINT), daemon.log.read_text()
    assert not bench.socket.exists()
    assert code == 1 and "second signal" in log, log


def hangup_reads_the_configuration_again(bench):
    daemon = bench.start()
    text = bench.config.read_text()
    said = lambda words: harness.wait_for(lambda: words in daemon.log.read_text(), words)  # noqa: E731
    bench.wait_state("ENGAGED")
    # in motion: silence shortened, a stroke that would need a restart
    bench.config.write_text(re.sub(r"(?m)^(silence_hold_ms *= *)\S+", r"\g<1>700", text.replace("stroke_mm = 200", "stroke_mm = 199")))
    with bench.sender() as sender:
        sender.stream(0.3, wave)
        daemon.send_signal(signal.SIGHUP)
        said("has been read again")
        harness.wait_for(lambda: sender.stream(0.3, wave) or bench.status()["state"] == "ENGAGED", "ENGAGED as long as there are frames")
    log = daemon.log.read_text()
    assert re.search(r"platform.ini:\d+: \[geometry\] stroke_mm: 199 needs a restart; 200 stays", log), log
    assert re.search(r"platform.ini:\d+: \[udp\] silence_hold_ms: 700 from now on", log), log
    bench.wait_state("HOLD")  # 700 ms later
    # a wrong file changes nothing
    bench.config.write_text(text.replace("stroke_mm = 200", "stroke_mm = many"))
    daemon.send_signal(signal.SIGHUP)
    said("nothing has changed")
    assert re.search(r"platform.ini:\d+: \[geometry\] stroke_mm: ", daemon.log.read_text())
    bench.config.write_text(text.replace("[platform]\n", "[platform]\nfrobnicate = 1\n" * 200))
    daemon.send_signal(signal.SIGHUP)
    said("platform.ini: this is not all there is to say")
    bench.config.unlink()
    daemon.send_signal(signal.SIGHUP)
    harness.wait_for(lambda: daemon.log.read_text().count("nothing has changed") == 3, "a missing file changes nothing")
    assert bench.status()["ok"] and bench.stop(daemon) == 0


# --- Trouble ---

def refused(bench, *arguments, config=None):
    return bench.heaved("--config", config or bench.config, *arguments)


def port_in_use(bench):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", bench.port))
        run = refused(bench)
    assert run.returncode == 69 and re.fullmatch(rf"heaved: [^\n]*port {bench.port}: Address already in use; [^\n]*ss -lunp[^\n]*\n", run.stderr), run
    assert not bench.socket.exists()


def socket_of_a_running_daemon(bench):
    trace = bench.file("kept.csv", "kept")
    daemon = bench.start()
    run = refused(bench, "--trace", trace, config=bench.write_config("second.ini", udp__port=harness.free_port()))
    assert run.returncode == 69 and "another heaved is running" in run.stderr and run.stderr.count("\n") == 1, run
    assert trace.read_text() == "kept", "a refused start must not empty files"
    assert bench.status()["ok"], "the first one still answers"
    assert bench.stop(daemon) == 0


def files_of_a_running_daemon(bench):
    """Two platforms on one file each: the second one does not start, and starts once the first one has ended, however it has."""
    def config(name, key, path):
        text = (bench.config if name == "first" else bench.write_config("base.ini", udp__port=harness.free_port())).read_text(encoding="utf-8")
        section, key = key
        text = text.replace(f"[{section}]\n", f"[{section}]\n{key} = {path}\n") if f"[{section}]\n" in text else f"{text}\n[{section}]\n{key} = {path}\n"
        return bench.file(f"{name}.ini", text)

    places = {("platform", "life_file"): bench.folder / "life", ("control", "operator_log"): bench.folder / "log.jsonl",
              ("black-box", "directory"): bench.folder / "box", ("control", "metrics"): bench.folder / "heave.prom"}
    other = bench.folder / "other.sock"
    for number, (key, path) in enumerate(places.items()):
        daemon = bench.start(config=config("first", key, path))
        second = config("second", key, path)
        run = bench.heaved("--config", second, "--socket", other)
        assert run.returncode == 69 and f"[{key[0]}] {key[1]} {path}: another heaved writes it" in run.stderr and run.stderr.count("\n") == 1, run
        assert bench.status()["ok"] and not other.exists(), key
        if number % 2:
            daemon.kill()
            daemon.wait()
        else:
            assert bench.stop(daemon) == 0
        daemon = bench.spawn("--socket", other, config=second)
        harness.wait_for(other.exists, "the second one starts now")
        assert bench.stop(daemon) == 0
        bench.socket.unlink(missing_ok=True)


def socket_of_a_dead_daemon(bench):
    daemon = bench.start()
    daemon.kill()
    daemon.wait()
    assert bench.socket.exists()
    run = bench.ctl("status")
    assert run.returncode == 69 and "not running" in run.stderr, run
    assert bench.stop(bench.start()) == 0


def path_of_something_else(bench):
    bench.file("heaved.sock", "precious")
    run = refused(bench)
    assert run.returncode == 73 and "something else" in run.stderr, run
    assert bench.socket.read_text() == "precious"


def directory_of_a_service_manager(bench):
    """What is not set is in the directory of the service; what is set stays where it is."""
    directory = bench.folder / "run"
    directory.mkdir()
    own = bench.socket
    bench.socket = directory / "heaved.sock"
    daemon = bench.start(config=bench.write_config("unset.ini", control__socket="/run/heave/heaved.sock"), environment={"RUNTIME_DIRECTORY": directory})
    assert bench.status()["ok"]
    assert bench.stop(daemon) == 0 and not bench.socket.exists()
    bench.socket = own
    daemon = bench.start(environment={"RUNTIME_DIRECTORY": directory})
    assert own.exists() and not list(directory.iterdir())
    assert bench.stop(daemon) == 0


def platform_by_its_name(bench):
    def ctl(*arguments):
        run = subprocess.run([bench.bin / "heavectl", *arguments, "status"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        assert run.stderr.count("\n") == 1, run
        return run.returncode, run.stderr
    code, text = ctl("--platform", "nobody-has-this-one")
    assert code == 69 and "/run/heave/nobody-has-this-one/heaved.sock" in text, text
    for name in ("", "..", "a/b", "/run", "n" * 200):
        code, text = ctl("--platform", name)
        assert code == 64 and "--platform needs the NAME of a service" in text, text
    code, text = ctl("--platform", "ride", "--socket", str(bench.socket))
    assert code == 64 and "not both" in text, text


def files_that_cannot_be_created(bench):
    for option in ("--trace", "--record"):
        run = refused(bench, option, "/nonexistent/file")
        assert run.returncode == 73 and run.stderr.count("\n") == 1, run
        assert not bench.socket.exists()
    run = refused(bench, "--socket", "/proc/heaved.sock")
    assert run.returncode == 73 and "--socket PATH" in run.stderr, run


def full_disk(bench):
    daemon = bench.start("--trace", "/dev/full")
    bench.wait_state("ENGAGED")
    for arguments in (["status"], ["--json", "status"], ["--help"]):
        with open("/dev/full", "w", encoding="ascii") as full:
            run = subprocess.run([bench.bin / "heavectl", "--socket", str(bench.socket), *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
        assert run.returncode == 74 and run.stderr == "heavectl: standard output: No space left on device\n", run
    said = "heaved: /dev/full: No space left on device: nothing more is written to it"
    harness.wait_for(lambda: said in daemon.log.read_text(), "it is said at once")
    lost = harness.wait_for(lambda: bench.status()["lost"]["trace_rows"], "counted")
    harness.wait_for(lambda: bench.status()["lost"]["trace_rows"] > lost, "more are lost")
    assert bench.stop(daemon) == 74
    assert daemon.log.read_text().count(said) == 1 and "/dev/full: No space left" in daemon.log.read_text().rsplit(said, 1)[1]
    daemon = bench.start("--record", "/dev/full")
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(0.5, wave)
    harness.wait_for(lambda: bench.status()["lost"]["record_lines"], "counted")
    assert bench.stop(daemon) == 74
    with open("/dev/full", "w", encoding="ascii") as full:  # the log
        daemon = bench.spawn(stderr=full)
        harness.wait_for(lambda: bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
        assert bench.stop(daemon) == 74
    metrics = bench.folder / "folder"
    (metrics / "in-the-way").mkdir(parents=True)
    text = bench.config.read_text(encoding="utf-8")
    daemon = bench.start(config=bench.file("metrics.ini", text.replace("[control]\n", f"[control]\nmetrics = {metrics}\n")))
    harness.wait_for(lambda: f"metrics {metrics}: Is a directory; tried again every second" in daemon.log.read_text(), "it is said")
    assert bench.stop(daemon) == 74


def strangers_are_refused(bench):
    daemon = bench.start(config=bench.write_config("allow.ini", udp__allow="10.0.0.0/8, 192.168.7.1"))
    with bench.sender() as sender:
        for i in range(10):
            sender.send(wave(i * 0.02))
    counters = harness.wait_for(lambda: (lambda c: c if c["refused_senders"] >= 10 else None)(bench.status()["counters"]), "counted")
    assert counters["datagrams"] == 0 and counters["refused_senders"] == 10, counters
    assert bench.stop(daemon) == 0


NOBODY = 65534


def ask_as(path, groups, *requests):
    """What heaved answers to somebody who is in these groups only; who cannot be somebody else asks as who this is."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.geteuid() == 0:
                os.setgroups(groups)
                os.setgid(NOBODY)
                os.setuid(NOBODY)
            with socket.socket(socket.AF_UNIX) as link:
                link.connect(str(path))
                said = link.makefile("r")
                for request in requests:
                    link.sendall(request.encode() + b"\n")
                    os.write(writer, said.readline().encode())
        finally:
            os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as answers:
        lines = answers.read().splitlines()
    os.waitpid(child, 0)
    assert len(lines) == len(requests), (requests, lines)
    return [json.loads(line) for line in lines]


def levels_and_their_log(bench):
    """Somebody in no group looks and holds, an operator operates, and every one of them is in the log."""
    log, look = bench.folder / "operators", bench.folder / "look.sock"
    operators, mechanics = (grp.getgrnam(name).gr_gid for name in ("games", "users"))
    control = f"[control]\nlook_socket = {look}\noperate_group = games\nservice_group = users\noperator_log = {log}\n"
    bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[control]\n", control), encoding="utf-8")
    daemon = bench.start()
    os.chmod(bench.folder, 0o755)
    os.chmod(bench.socket, 0o666)
    bench.wait_state("ENGAGED")
    for path in (bench.socket, look):
        status, park, hold = ask_as(path, [], "status", "park", "hold")
        assert status["ok"] and not park["ok"] and "it takes the level operate (members of group games)" in park["error"] and hold["ok"], (park, hold)
    if os.geteuid() == 0:
        resume, reset, down, up = ask_as(bench.socket, [operators], "resume", "reset", "intensity 40", "intensity 50")
        assert resume["ok"] and not reset["ok"] and "level service (members of group users)" in reset["error"] and down["ok"] and not up["ok"], (resume, reset, down, up)
        named, up, reset = ask_as(bench.socket, [mechanics], "by anna", "intensity 50", "reset")
        assert named["ok"] and up["ok"] and not reset["ok"] and "there is nothing to reset" in reset["error"], (named, up, reset)
        assert not ask_as(look, [mechanics], "resume")[0]["ok"], "not by that socket"
    assert bench.stop(daemon) == 0
    entries = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    park, hold = entries[0], entries[1]
    assert park["request"] == "park" and not park["ok"] and park["before"] == park["after"] == "ENGAGED", park
    assert hold["request"] == "hold" and hold["ok"] and (hold["before"], hold["after"]) == ("ENGAGED", "HOLD") and hold["pid"] > 1, hold
    assert hold["uid"] == (NOBODY if os.geteuid() == 0 else os.getuid()), hold
    if os.geteuid() == 0:
        assert [entry["request"] for entry in entries if entry["by"] == "anna"] == ["intensity 50", "reset"], entries
        assert entries[-1]["request"] == "SIGTERM" and entries[-1]["pid"] == os.getpid() and entries[-1]["uid"] == 0, entries[-1]
    assert all(re.fullmatch(r"20\d\d-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z", entry["time"]) for entry in entries), entries


def keeps_the_life_of_the_machine(bench):
    """Over an end, a kill in motion, and a file that was lost; shown by the status."""
    life = bench.folder / "life"
    bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[platform]\n", f"[platform]\nlife_file = {life}\n", 1), encoding="utf-8")
    travel_mm, rides = 0, 0
    for number in (signal.SIGTERM, signal.SIGKILL, signal.SIGTERM):
        daemon = bench.start()
        bench.wait_state("ENGAGED")
        rides += 1
        with bench.sender() as sender:
            sender.stream(1.0, wave)
        now = bench.status()["life"]
        assert now["rides"] == rides and len(now["axes"]) == 7 and now["faults"] == 0, now
        assert all(axis["travel_mm"] > travel_mm + 10 for axis in now["axes"][:6]) and "travel_deg" in now["axes"][6], (travel_mm, now)
        assert all(axis["cycles"] >= 0 and axis["energized_s"] >= rides for axis in now["axes"]), now
        travel_mm = now["axes"][0]["travel_mm"] if number == signal.SIGTERM else travel_mm
        rides -= number == signal.SIGKILL  # what was not written yet is lost: a minute at most
        assert bench.stop(daemon, number) == (0 if number == signal.SIGTERM else -number)
        bench.socket.unlink(missing_ok=True)
        (life if number == signal.SIGKILL else Path(f"{life}.2")).unlink(missing_ok=True)
    for path in (life, Path(f"{life}.2")):
        path.write_text("heave life 1\nsequence 9\n", encoding="utf-8")
    run = bench.heaved("--config", bench.config)
    assert run.returncode == 65 and "neither is right" in run.stderr and "move them away to begin at zero" in run.stderr, run


def what_is_wrong_with_levels_and_log(bench):
    text = bench.config.read_text(encoding="utf-8")
    for line, code, said in (("operate_group = no-such-group", 69, "[control] operate_group: there is no group no-such-group on this machine"),
                             ("operator_log = /dev/null", 73, "operator log /dev/null: not a file"),
                             (f"operator_log = {bench.folder}/no/log", 73, "No such file or directory")):
        bench.config.write_text(text.replace("[control]\n", f"[control]\n{line}\n"), encoding="utf-8")
        run = bench.heaved("--config", bench.config)
        assert run.returncode == code and said in run.stderr, (line, run)


def moves_what_was_approved(bench):
    """Another configuration than the approved one moves once somebody has said that it shall; the identity is wherever somebody looks later."""
    config = bench.write_config("manual.ini", **MANUAL)
    text = config.read_text(encoding="utf-8")
    identity = re.search(r"(?m)^configuration +([0-9a-f]{16})$", bench.heaved("--config", config, "--check").stdout)[1]
    config.write_text(text.replace("[platform]\n", "[platform]\napproved = 0123456789abcdef\n", 1), encoding="utf-8")
    assert "warning: [platform] approved: another" in bench.heaved("--config", config, "--check").stdout
    record = bench.folder / "record.txt"
    daemon = bench.start("--record", record, config=config)
    for request in ("engage", "park"):
        answer, code = bench.ask(request)
        assert code == 1 and answer["state"] == "OFF" and f"the configuration {identity} is not the one that was approved (0123456789abcdef)" in answer["error"], answer
    status = bench.status()
    told = dict(status["configuration"])
    assert re.fullmatch("[0-9a-f]{16}", told.pop("machine")), told
    assert re.fullmatch("[0-9a-f]{16}", told.pop("digest")), told
    assert told == {"hash": identity, "approved": "0123456789abcdef", "barred": True, "slow_rise": False, "commissioned_day": None, "changed": "", "put_back": ""}, told
    assert bench.ask("acknowledge") == ({"ok": True, "state": "OFF"}, 0)
    answer, code = bench.ask("acknowledge")
    assert code == 1 and "there is nothing to acknowledge" in answer["error"], answer
    assert bench.ask("engage")[1] == 0 and bench.status()["configuration"]["barred"] is False
    bench.wait_state("ENGAGED")
    assert bench.stop(daemon) == 0
    said = daemon.log.read_text(encoding="utf-8")
    build = re.search(rf"build ([0-9a-f]{{40}}), configuration {identity}\n", said)[1]
    assert "nothing moves until" in said and f"configuration {identity}: acknowledged by user {os.getuid()}, process" in said, said
    assert status["build"] == build and build.encode("ascii") == build_id_of(bench.bin / "heaved"), status["build"]
    assert f"build {build}, configuration {config}, {identity}, " in record.read_text(encoding="utf-8").splitlines()[0]
    config.write_text(text.replace("[platform]\n", f"[platform]\napproved = {identity}\n", 1), encoding="utf-8")
    daemon = bench.start(config=config)
    assert bench.ask("engage")[1] == 0, "the approved one asks nobody"
    config.write_text(config.read_text(encoding="utf-8").replace("silence_hold_ms", "silence_hold_ms = 777 ;", 1), encoding="utf-8")
    daemon.send_signal(signal.SIGHUP)
    harness.wait_for(lambda: f"[platform] approved: {identity} is not this configuration" in daemon.log.read_text(encoding="utf-8"), "refused")
    assert bench.status()["configuration"]["hash"] == identity
    assert bench.stop(daemon) == 0


def build_id_of(program):
    """As another program reads it."""
    notes = subprocess.run(["readelf", "-n", program], stdout=subprocess.PIPE, check=True).stdout
    return re.search(rb"Build ID: ([0-9a-f]+)", notes)[1]


def nobody_reads_standard_error(bench):
    """Log lines into a full pipe must not keep the daemon from ending."""
    daemon = bench.spawn(stderr=subprocess.PIPE)
    harness.wait_for(lambda: bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
    with open(f"/proc/{daemon.pid}/fd/2", "wb", buffering=0, opener=lambda path, flags: os.open(path, flags | os.O_NONBLOCK)) as pipe:
        while pipe.write(b"x" * 4096):
            pass  # None: it is full
    assert bench.status()["ok"]
    assert bench.stop(daemon) == 0
    daemon.stderr.close()


# --- Clients that misbehave ---

class Client:
    def __init__(self, bench):
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.link.settimeout(harness.WAIT_S)
        self.link.connect(str(bench.socket))
        self.file = self.link.makefile("r")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        self.link.close()

    def ask(self, text):
        self.link.sendall(text.encode())
        return json.loads(self.file.readline())


def odd_requests(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with Client(bench) as client:
        for text in ("fly\n", "\n", "STATUS\n", "watch 0\n", "watch 51\n", "watch x\n", "watcher\n", "\x00\xff\n"):
            assert client.ask(text)["ok"] is False, text
        assert client.ask("status\r\n")["ok"] is True
        client.link.sendall(b"hold\nresume\nstatus\n")  # one after the other, each after the last one's answer
        assert [json.loads(client.file.readline())["state"] for _ in range(3)] == ["HOLD", "ENGAGED", "ENGAGED"]
        client.link.sendall(b"sta")
        time.sleep(0.05)
        assert client.ask("tus\n")["ok"] is True
        assert client.ask("x" * 96)["error"] == "request too long"
        assert client.file.readline() == "", "then it is closed"
    with Client(bench) as client:
        client.link.sendall(b"hold\n")
        client.link.shutdown(socket.SHUT_WR)
        assert json.loads(client.file.readline())["state"] == "HOLD"
        assert client.file.readline() == ""
    assert bench.stop(daemon) == 0


def idle_clients_keep_nobody_out(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    assert bench.socket.stat().st_mode & 0o777 == 0o660, "its user and its group, nobody else"
    clients = [Client(bench) for _ in range(8)]
    for request, state in (("hold", "HOLD"), ("resume", "ENGAGED"), ("park", "SETTLING")):
        answer, code = bench.ask(request)
        assert code == 0 and answer == {"ok": True, "state": state}, (answer, code)
    told = json.loads(clients[0].file.readline())
    assert told["ok"] is False and "too many clients" in told["error"] and clients[0].file.readline() == "", told
    assert clients[7].ask("status\n")["ok"], "one place was enough"
    for client in clients:
        client.__exit__()
    assert bench.stop(daemon) == 0


def watchers_keep_nobody_out(bench, *options):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with subprocess.Popen([bench.bin / "heavectl", "--socket", bench.socket, *options, "--for", str(harness.WAIT_S), "watch"],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as oldest:
        assert oldest.stdout.readline()
        clients = [Client(bench) for _ in range(7)]
        assert all(client.ask("watch 1\n")["ok"] for client in clients)  # so rarely that they need not be read soon
        answer, code = bench.ask("hold")
        assert code == 0 and answer == {"ok": True, "state": "HOLD"}, (answer, code)
        out, said = oldest.communicate(timeout=harness.WAIT_S)
        assert oldest.returncode == 1 and re.fullmatch(r"heavectl: too many clients: [^\n]*\n", said), (oldest.returncode, said)
        assert (json.loads(out.splitlines()[-1])["ok"] is False) if options else "too many" not in out, out
    assert all(json.loads(client.file.readline())["ok"] for client in clients), "the others go on"
    for client in clients:
        client.__exit__()
    assert bench.stop(daemon) == 0


def a_client_that_does_not_read(bench):
    daemon = bench.start()
    with Client(bench) as client:
        client.link.sendall(b"watch 50\n")
        poll = select.poll()
        poll.register(client.link, select.POLLHUP | select.POLLRDHUP)
        harness.wait_for(lambda: poll.poll(100), "the client is dropped")
        assert bench.status()["ok"], "others are served"
    assert bench.stop(daemon) == 0


# --- Memory ---

def busy_session(bench):
    """Everything that may happen to it, with everything that it writes; the last status."""
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)  # what is said to it must not allocate either
    manager.bind(str(bench.folder / "notify"))
    threading.Thread(target=lambda: [None for _ in iter(lambda: manager.recv(500), b"")], daemon=True).start()
    metrics = bench.folder / "heave.prom"
    config, _ = with_black_box(bench)
    config.write_text(config.read_text(encoding="utf-8").replace("[control]\n", f"[control]\nmetrics = {metrics}\n"))
    daemon = bench.start("--record", bench.folder / "r.txt", "--trace", bench.folder / "t.csv", config=config,
                         environment={"NOTIFY_SOCKET": manager.getsockname(), "WATCHDOG_USEC": "100000"})
    with bench.sender() as sender, Client(bench) as watcher:
        watcher.link.sendall(b"watch 20\n")
        sender.stream(0.3, wave)
        bench.wait_state("ENGAGED")
        for command in COMMANDS[:-1] + ["status", "dump", "engage"]:
            bench.ctl(command)
            sender.stream(0.2, wave)
        sender.send("nonsense")
        sender.send("@A6T:0,5,0,0,0,0,400#")
        sender.stream(0.5, wave)
        bench.wait_state("ENGAGED")
        harness.wait_for(lambda: (sender.send(wave(0)), bench.status()["frame_latency"]["count"] > 0)[1], "frames are measured")
        bench.ctl("park")
        status = bench.wait_state("SETTLED")
        watcher.file.readline()
    harness.wait_for(metrics.exists, "metrics are written")
    daemon.send_signal(signal.SIGHUP)
    harness.wait_for(lambda: "has been read again" in daemon.log.read_text(), "the configuration is read again")
    assert bench.stop(daemon) == 0  # and says what the guard has found
    return status


def may_lock_memory():
    """CAP_IPC_LOCK; see capabilities(7)."""
    return int(re.search(r"(?m)^CapEff:\s*(\w+)", Path("/proc/self/status").read_text(encoding="ascii"))[1], 16) >> 14 & 1


def faults_no_pages_and_allocates_nothing(bench, guard):
    if guard is None:
        raise tap.Skip("instrumented build")
    assert Path(guard).samefile(bench.guard), f"heaved runs under {bench.guard}"
    moved = harness.pages_moved()
    status = busy_session(bench)
    latency = status["frame_latency"]
    assert 0 < latency["p50_us"] <= latency["p99_us"] <= latency["max_us"] and latency["count"] <= sum(status["counters"]["accepted"].values()), latency
    if not status["memory_locked"] and not may_lock_memory():
        raise tap.Skip("memory cannot be locked here")
    assert status["memory_locked"]
    assert harness.Guard.cycles[True] > 1000 and (status["page_faults"] == 0 or harness.pages_moved() != moved), (harness.Guard.cycles, status["page_faults"])


def guard_ends_a_program(bench, guard):
    """That it says so is what all other tests rely on."""
    if guard is None:
        raise tap.Skip("instrumented build")
    lines = {"": "", "libc.mlockall(1)": "malloc guard: .*, after the start, in an ordinary thread ",
             "libc.pthread_setschedparam(libc.pthread_self(), 1, bytes(8))": "malloc guard: .*, after the start, in a real-time thread "}
    for line, said in lines.items():
        program = f"import ctypes; libc = ctypes.CDLL(None); libc.pthread_self.restype = ctypes.c_void_p\nlibc.pthread_setschedparam.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p]\n{line}\nx = bytearray(100000)"
        run = subprocess.run([sys.executable, "-c", program], env={**os.environ, "LD_PRELOAD": guard}, stderr=subprocess.PIPE, text=True, check=False)
        assert run.returncode == (-signal.SIGABRT if line else 0) and re.match(said, run.stderr), (line, run)


CASES = {
    "it follows frames and counts them": follows_frames,
    "every command of heavectl has its answer": every_command_answers,
    "answers for people are lines and an 80-column table": plain_answers_are_lines,
    "a bus that does not work says why in the status": a_bus_that_does_not_work_says_why,
    "every member of the status is documented": every_member_is_documented,
    "heavectl without a daemon, or wrongly called": without_a_daemon,
    "watch, not on a terminal": watches_by_line,
    "--wait returns when it is done, or says why it is not": waits_for_the_end,
    "--wait and a hold": waits_and_is_held,
    "scope shows every cycle, and a stopped reader holds nobody up": shows_every_cycle,
    "without samples, scope says so": has_no_samples,
    "watch on 80 x 24 keeps the state, the fault and whole words": watches_on_a_small_terminal,
    "watch on a terminal puts it back on Ctrl-C": watches_on_a_terminal,
    "status has colours on a terminal only, and not with NO_COLOR": has_colours_on_a_terminal_only,
    "a recording plays back to the same bytes, engage = auto": replays_to_the_same_bytes,
    "a recording plays back to the same bytes, engage = manual, homed from elsewhere": lambda bench: replays_to_the_same_bytes(bench, **ELSEWHERE),
    "a cycle that is very late holds the platform, and replays": a_late_cycle_holds,
    "the black box is written on request, and replays": dumps_the_black_box,
    "a forged state replays in a cage": replays_a_forged_state_in_a_cage,
    "a fault that heaved finds itself replays in its cycle": replays_a_following_error,
    "without a directory there is no black box": dumps_nothing,
    "the service manager is told": tells_the_service_manager,
    "SIGTERM settles, switches off and ends with 0": lambda bench: signal_settles(bench, signal.SIGTERM),
    "Ctrl-C does the same": lambda bench: signal_settles(bench, signal.SIGINT),
    "a second signal ends at once": second_signal_ends_at_once,
    "SIGHUP reads the configuration again": hangup_reads_the_configuration_again,
    "the port is in use": port_in_use,
    "the socket belongs to a running daemon": socket_of_a_running_daemon,
    "files of a running heaved are locked": files_of_a_running_daemon,
    "the socket of a dead daemon is replaced": socket_of_a_dead_daemon,
    "something else has the socket's name": path_of_something_else,
    "a service manager's directory takes the socket that is not set": directory_of_a_service_manager,
    "heavectl --platform: where a service listens; no other names": platform_by_its_name,
    "files that cannot be created": files_that_cannot_be_created,
    "a full disk is told at the end": full_disk,
    "senders that are not allowed are refused and counted": strangers_are_refused,
    "levels by group and by socket, hold for all, and a log of who did what": levels_and_their_log,
    "hours, way and cycles of each axis are kept over ends, kills and a lost file": keeps_the_life_of_the_machine,
    "a group or an operator log that cannot be is refused at the start": what_is_wrong_with_levels_and_log,
    "a configuration that was not approved moves nothing until somebody has said so, and all say which one it is": moves_what_was_approved,
    "nobody reads standard error": nobody_reads_standard_error,
    "odd requests": odd_requests,
    "eight clients that ask nothing do not keep an operator out": idle_clients_keep_nobody_out,
    "eight that watch do not either, and the oldest ends and says why": watchers_keep_nobody_out,
    "eight that watch do not either, --json": lambda bench: watchers_keep_nobody_out(bench, "--json"),
    "a client that does not read is dropped": a_client_that_does_not_read,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin")
    parser.add_argument("--guard")
    parser.add_argument("--here", action="store_true", help="only what takes the memory of this kernel, not of one of User Mode Linux")
    parser.add_argument("--only", default="", help="run the cases whose name contains this")
    arguments = parser.parse_args()
    cases = {**({} if arguments.here else CASES), "the guard against allocation ends a program, and says where": lambda bench: guard_ends_a_program(bench, arguments.guard),
             **({} if harness.Guard.has_own_faults else
                {"nothing is allocated after the start, and no page fault in the motion thread once memory is locked":
                 lambda bench: faults_no_pages_and_allocates_nothing(bench, arguments.guard)})}
    suite = tap.Suite()
    for name, check in cases.items():
        if arguments.only in name:
            with harness.Bench(arguments.bin) as bench, suite.case(name):
                check(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
