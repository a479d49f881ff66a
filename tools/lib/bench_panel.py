# SPDX-License-Identifier: MIT
"""bench_panel.py - the subcommand panel of tools/bench: what heave-panel costs with many viewers of every cycle, and whether heaved's cycles notice them.

heaved drives a simulated hexapod that follows a stream. First turn by turn, nobody and ten viewers: wake-up and work of each cycle, from heaved's own samples. Then twenty viewers, for minutes: processor time and memory of
the panel, and rows that were lost. Viewers are connections that read every byte, in a process of their own.
"""
import contextlib
import json
import math
import multiprocessing
import os
import re
import selectors
import socket
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(TOP / "tests/lib"), str(TOP / "python")]
from web_socket import BINARY, WebSocket  # noqa: E402  the path above has to be set first

AXES = ("roll_deg", "pitch_deg", "yaw_deg", "x_mm", "y_mm", "z_mm")
COLUMNS = ["t_ms", *(f"{what}_{axis}" for what in ("asked", "sent", "actual") for axis in AXES), "frame_age_ms"]
PAIRED, CROWD = 10, 20
SECONDS = 10  # of each turn


class PanelError(Exception):
    """heaved or the panel could not be run."""


def percentile(values, share):
    return sorted(values)[max(0, math.ceil(len(values) * share / 100) - 1)]


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def wait_for(condition, what, seconds=30):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with contextlib.suppress(OSError, ValueError):
            if condition():
                return
        time.sleep(0.1)
    raise PanelError(f"{what}: not within {seconds} s")


def ask(path, line):
    with socket.socket(socket.AF_UNIX) as link:
        link.settimeout(10)
        link.connect(str(path))
        link.sendall(line.encode() + b"\n")
        with link.makefile("rb") as answers:
            return json.loads(answers.readline())


def has_message(waiting):
    """Whether a whole frame of a server stands in what was read."""
    if len(waiting) < 10:
        return False
    length, head = waiting[1] & 0x7F, 2
    if length == 126:
        length, head = struct.unpack_from(">H", waiting, 2)[0], 4
    elif length == 127:
        length, head = struct.unpack_from(">Q", waiting, 2)[0], 10
    return len(waiting) >= head + length


def look(port, viewers, pipe):
    """Viewers of every cycle until something comes through the pipe; then rows and lost rows are told."""
    links, rows, lost = [], 0, 0
    watched = selectors.DefaultSelector()
    following = {}
    for _ in range(viewers):
        link = WebSocket("127.0.0.1", port, "/ws", protocol="heave-panel.1", origin=f"http://127.0.0.1:{port}")
        link.send({"id": 1, "op": "samples", "platform": "bench", "columns": COLUMNS, "every": 1, "history_s": 0})
        link.send({"id": 0, "op": "status", "platform": "bench", "hz": 10})
        links.append(link)
        watched.register(link.socket, selectors.EVENT_READ, link)
    pipe.send("ready")
    while not pipe.poll():
        for key, _ in watched.select(0.2):
            link = key.data
            opcode, data = link.next()
            while True:
                if opcode == BINARY:
                    _, count, first, missed, _ = struct.unpack_from("<IIQII", data)
                    lost += missed + max(0, first - following.get(link, first))
                    rows += count
                    following[link] = first + count
                if not has_message(link.waiting):
                    break
                opcode, data = link.next()
    pipe.send((rows, lost))
    for link in links:
        link.socket.close()


class Viewers:
    def __init__(self, port, viewers):
        self.mine, other = multiprocessing.Pipe()
        self.process = multiprocessing.Process(target=look, args=(port, viewers, other), daemon=True)
        self.process.start()
        if not self.mine.poll(30) or self.mine.recv() != "ready":
            raise PanelError("the viewers are not let in")

    def end(self):
        self.mine.send("end")
        if not self.mine.poll(30):
            raise PanelError("the viewers do not end")
        found = self.mine.recv()
        self.process.join(10)
        return found


def used(pid):
    """(processor seconds, most memory in MB) of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(") ", 1)[1].split()
    peak = re.search(r"VmHWM:\s*(\d+)", Path(f"/proc/{pid}/status").read_text(encoding="ascii"))
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), int(peak[1]) / 1024


def drive(port, stop):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        begin = time.monotonic()
        while not stop.wait(1 / 60):
            t = time.monotonic() - begin
            out.sendto(f"@A6:{3 * math.sin(t):.3f},{2 * math.sin(1.3 * t):.3f},0,{10 * math.sin(0.9 * t):.3f},0,{12 * math.sin(1.1 * t):.3f}#".encode(), ("127.0.0.1", port))


@contextlib.contextmanager
def machine(heaved, panel):
    """A hexapod that follows a stream, and its panel: (control socket, port of the panel, the panel's process)."""
    with tempfile.TemporaryDirectory(prefix="heave-bench-") as folder:
        path, udp, web = Path(folder) / "heaved.sock", free_port(), free_port()
        text = (TOP / "config/demo-hexapod.ini").read_text(encoding="utf-8")
        for key, value in (("port", udp), ("socket", path), ("engage", "auto")):
            text = re.sub(rf"(?m)^{key} *= *[^;\n]*", f"{key} = {value} ", text, count=1)
        (Path(folder) / "bench.ini").write_text(text, encoding="utf-8")
        (Path(folder) / "state").mkdir()
        stop = threading.Event()
        sending = threading.Thread(target=drive, args=(udp, stop))
        programs = [subprocess.Popen([heaved, "--config", f"{folder}/bench.ini"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)]
        try:
            wait_for(lambda: ask(path, "tick")["ok"], "heaved answers")
            programs.append(subprocess.Popen([panel, "--www", panel.parent.parent / "www", "--state", f"{folder}/state", "--platform", f"bench={path}", "--listen", f"127.0.0.1:{web}"], stdout=subprocess.DEVNULL))
            sending.start()
            wait_for(lambda: ask(path, "status")["state"] == "ENGAGED", "the platform follows", 60)
            yield path, web, programs[1]
        finally:
            stop.set()
            for program in reversed(programs):
                program.kill()
                program.wait()
            if sending.ident:
                sending.join()


def cycles_of(heaved, path, seconds):
    """wake_us and work_us of the cycles of so many seconds from now."""
    run = subprocess.run([heaved.parent / "heavectl", "--socket", path, "--for", str(seconds), "scope", "wake_us,work_us"], capture_output=True, text=True, check=False)
    rows = [tuple(map(float, line.split(","))) for line in run.stdout.splitlines()[1:]]
    if run.returncode != 0 or len(rows) < seconds * 100:
        raise PanelError(f"heavectl scope: {run.stderr.strip()[-200:]}")
    return [wake for wake, _ in rows], [work for _, work in rows]


def paired(heaved, path, web, rounds, seconds, say):
    found = {"none": ([], []), "ten": ([], [])}
    for number in range(rounds):
        say(f"round {number + 1} of {rounds}: {seconds} s with nobody, {seconds} s with {PAIRED} viewers")
        for name in ("none", "ten") if number % 2 == 0 else ("ten", "none"):
            viewers = Viewers(web, PAIRED) if name == "ten" else None
            time.sleep(1)
            for into, values in zip(found[name], cycles_of(heaved, path, seconds)):
                into.append(values)
            if viewers:
                viewers.end()
    out = {}
    for at, what in enumerate(("wake_us", "work_us")):
        for share in (50, 99, 99.9):
            ours, theirs = ([percentile(one, share) for one in found[name][at]] for name in ("none", "ten"))
            out[f"{what} p{share:g}"] = {"none": statistics.median(ours), "ten": statistics.median(theirs), "difference": statistics.median(b - a for a, b in zip(ours, theirs))}
    return out


def crowd(web, panel, seconds):
    viewers = Viewers(web, CROWD)
    time.sleep(2)
    before, begin = used(panel.pid)[0], time.monotonic()
    time.sleep(seconds)
    after, most_mb = used(panel.pid)
    share = 100 * (after - before) / (time.monotonic() - begin)
    rows, lost = viewers.end()
    return {"viewers": CROWD, "seconds": seconds, "columns": len(COLUMNS), "rows": rows, "lost": lost, "percent_of_a_core": share, "most_mb": most_mb}


def run(heaved, panel, minutes, rounds, is_json, say):
    with machine(heaved, panel) as (path, web, process):
        figures = {"paired": paired(heaved, path, web, rounds, SECONDS, say)}
        say(f"{CROWD} viewers, {minutes} minutes")
        figures["crowd"] = crowd(web, process, 60 * minutes)
    if is_json:
        print(json.dumps(figures, indent=2))
        return
    print(f"us                  nobody  {PAIRED} viewers  difference (median of {rounds} rounds)")
    for name, row in figures["paired"].items():
        print(f"{name:18}{row['none']:8.0f}{row['ten']:12.0f}{row['difference']:12.0f}")
    one = figures["crowd"]
    print(f"{one['viewers']} viewers of {one['columns']} columns for {one['seconds']} s: {one['percent_of_a_core']:.1f} % of a core, {one['most_mb']:.1f} MB, {one['rows']} rows, {one['lost']} lost")
