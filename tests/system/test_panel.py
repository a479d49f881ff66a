#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel.py BIN PICTURES [PART OF A NAME] - heave-panel in front of a heaved on simulated drives: what it serves, whom it lets in, what happens to a hand that is not there any
more, and its pages in Chromium. Pictures of the pages are kept in PICTURES, to be looked at."""
import contextlib
import gzip
import http.client
import json
import math
import os
import re
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import harness
import tap
import web_socket
from mechanism import turn
from web_socket import Page, Refused, WebSocket

BIN, PICTURES = Path(sys.argv[1]), Path(sys.argv[2])
STOP_S = 0.25 + 0.4  # without a beat, and the way to rest at jog speed
WWW = BIN.parent / "www"  # the pages, and their picture in WebGL
PASSWORD = "a long enough one"
TRIES = 8


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


class PanelBench(harness.Bench):
    """heaved and a panel for it, called ride."""

    def __init__(self, passwords=(), more=(), **changes):
        super().__init__(BIN, **{"platform__engage": "manual", **changes})
        self.state_folder = self.folder / "panel"
        self.state_folder.mkdir()
        self.kept = self.folder / "kept"  # what heaved writes: incidents, log of operators
        self.kept.mkdir()
        for role in passwords:
            run = subprocess.run([BIN / "heave-panel", "--state", self.state_folder, "passwd", role], input=f"{PASSWORD} {role}\n", text=True, capture_output=True, check=False)
            assert run.returncode == 0, run.stderr
        self.web, self.more, self.panel = free_port(), more, None

    def __exit__(self, *exception):
        self.end_panel()
        super().__exit__(*exception)

    def start_panel(self, *arguments, **options):
        self.panel_log = self.folder / "panel.log"
        options.setdefault("env", {**os.environ, "HEAVE_LOCALES": str(BIN.parent / "locale")})
        with open(self.panel_log, "wb") as log:
            self.panel = subprocess.Popen([self.bin / "heave-panel", "--listen", f"127.0.0.1:{self.web}", "--www", self.bin.parent / "www", "--state", self.state_folder, "--platform",
                                           f"ride={self.socket}", "--heaved", self.bin / "heaved", *self.more, *arguments], stdout=log, stderr=log, **options)
        harness.wait_for(lambda: "heave-panel: http" in self.panel_log.read_text(encoding="utf-8") or self.panel.poll() is not None, "the panel serves")
        assert self.panel.poll() is None, self.panel_log.read_text(encoding="utf-8")

    def end_panel(self, how=signal.SIGTERM):
        if self.panel is not None and self.panel.poll() is None:
            self.panel.send_signal(how)
            self.panel.wait(20)
        self.panel = None

    def open_programs(self):
        """Copies that any user may run, wherever the tree is."""
        place = self.folder / "build"
        shutil.copytree(WWW, place / "www")
        (place / "bin").mkdir()
        for name in ("heaved", "heavectl", "heave-panel"):
            shutil.copy(self.bin / name, place / "bin")
        self.bin, self.guard = place / "bin", self.guard and Path(shutil.copy(self.guard, place))

    def both(self):
        daemon = self.start(environment={"STATE_DIRECTORY": str(self.kept)})
        self.start_panel()
        harness.wait_for(lambda: self.status()["state"] in ("OFF", "SETTLED"), "heaved is up")
        return daemon

    def link(self, **options):
        return WebSocket("127.0.0.1", self.web, "/ws", protocol="heave-panel.1", **{"origin": f"http://127.0.0.1:{self.web}", **options})

    def get(self, path, method="GET", body=None, **headers):
        client = http.client.HTTPConnection("127.0.0.1", self.web, timeout=20)
        client.putrequest(method, path, skip_host="Host" in headers)
        for name, value in headers.items():
            client.putheader(name.replace("_", "-"), value)
        data = None if body is None else json.dumps(body).encode()
        if data is not None:
            client.putheader("Content-Length", str(len(data)))
        client.endheaders(data)
        answer = client.getresponse()
        try:
            text = answer.read()
        except http.client.IncompleteRead as cut:  # who is refused at once is not listened to any more
            text = cut.partial
        client.close()
        return answer.status, dict(answer.getheaders()), text

    def raw(self, line):
        """heaved's own answer, without heavectl and without the panel."""
        with harness.Line(self.socket) as link:
            return link.ask(line)

    def log_in(self, role, password=None):
        code, headers, text = self.get("/api/login", "POST", {"role": role, "password": password or f"{PASSWORD} {role}"}, Content_Type="application/json",
                                       Origin=f"http://127.0.0.1:{self.web}")
        return code, headers.get("set-cookie", "").split(";")[0], headers.get("set-cookie", ""), text


def request(link, line):
    return link.ask({"op": "request", "platform": "ride", "line": line})


def take(link):
    link.send({"op": "take", "platform": "ride", "id": 0})
    link.receive(lambda message: message.get("event") == "controls" and message["yours"])


@contextlib.contextmanager
def standing_still(daemon):
    """heaved answers nothing meanwhile, and everything afterwards."""
    daemon.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        daemon.send_signal(signal.SIGCONT)


# --- What it serves ---

def answers_as_heaved_does(bench):
    bench.both()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        status = link.receive(lambda message: message.get("event") == "status")["status"]
        assert status["state"] == "OFF" and len(status["cylinders"]) == 6, status["state"]
        for line in ("geometry", "incidents", "tick", "counts", "times", "nonsense"):
            mine = request(link, line)["answer"]
            other = bench.raw(line)
            assert set(mine) == set(other) and mine["ok"] == other["ok"] and mine.get("error") == other.get("error"), (line, mine, other)
        times, status = bench.raw("times"), bench.status()
        for kind in ("wake_latency", "cycle_time", "frame_latency"):
            assert len(times[kind]) == len(times["bounds_us"]) == 23 and times["bounds_us"][0] == 0 and sum(times[kind]) <= status[kind]["count"] < sum(times[kind]) + 5000, (kind, times, status[kind])
        assert request(link, "engage")["error"] == "take the controls first"
        take(link)
        assert request(link, "resume")["answer"]["error"] == bench.raw("resume")["error"]
        assert request(link, "engage")["answer"]["ok"] is True
        link.receive(lambda message: message.get("event") == "status" and message["status"]["state"] == "NEUTRAL" or message.get("status", {}).get("state") in ("ENGAGED", "HOLD"), 60)
        assert request(link, "hold")["answer"]["ok"] is True
        for line in ("watch", "by anna", "samples", "beat 1 1 1", "jog 1 1 1", "hold\nengage", "", "x" * 64):
            assert "error" in request(link, line), line
        for message in ({"op": "status"}, {"op": "explode", "platform": "ride"}, {"platform": "ride"}, {"op": "request", "platform": "none", "line": "hold"}):
            assert "error" in link.ask(message), message


def refuses_in_chinese(bench):
    """What is refused is told in both languages: by the panel itself, and by heaved, in the words of heavectl."""
    chinese = {"LC_ALL": "zh_CN.UTF-8", "HEAVE_LOCALES": str(BIN.parent / "locale")}
    bench.start(environment={"STATE_DIRECTORY": str(bench.kept)})
    bench.start_panel(env={**os.environ, "HEAVE_LOCALES": chinese["HEAVE_LOCALES"]})
    harness.wait_for(lambda: bench.status()["state"] in ("OFF", "SETTLED"), "heaved is up")
    with bench.link() as link:
        got = request(link, "engage")
        assert got["error"] == "take the controls first" and got["error_zh"] == "请先取得控制权", got
        take(link)
        for line in ("resume", "reset", "intensity 101", "torque 9 on", "nonsense"):
            got = request(link, line)
            said = bench.ctl(*line.split(), env={**os.environ, **chinese}).stderr.strip()
            assert got["answer"]["ok"] is False and re.search("[\u4e00-\u9fff]", got["error_zh"]), got
            assert line == "nonsense" or said.endswith(got["error_zh"]), (line, said, got)
        got = link.ask({"op": "request", "platform": "ride", "line": "engage", "seen": bench.raw("status")["time_unix_ms"] - 3000})
        assert got["error"] == "this came too late to be done: try again" and re.search("[\u4e00-\u9fff]", got["error_zh"]), got
        assert "error_zh" not in request(link, "status")
    if web_socket.browser() is None:
        return
    with Page(f"http://127.0.0.1:{bench.web}/", 390, 844) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        click(page, "[data-request=engage]")
        page.wait("document.getElementById('said').textContent.includes('somebody else has the controls') || document.getElementById('said').textContent.includes('take the controls first')", "a refusal says why")
        click(page, "#language")
        click(page, "[data-request=engage]")
        page.wait("/控制权/.test(document.getElementById('said').textContent) && !/[a-z]/.test(document.getElementById('said').textContent)", "in Chinese")


REQUESTS = ("engage", "hold", "resume", "park", "reset", "intensity 40", "intensity 100", "intensity 101", "intensity x", "seen", "incidents", "counts", "geometry", "status", "selftest", "selftest passed", "acknowledge", "service",
            "service-off", "torque 1 on", "torque 9 on", "torque all off", "nonsense", "engage now", "HOLD")
LEVELS = ("look", "operate", "service")
STATES = ("OFF", "HOMING", "SETTLED", "RISING", "ENGAGED", "HOLD", "SETTLING", "SERVICE", "FAULT")


def levels_of_document():
    """{first word of a request: its level} of docs/control-socket.md."""
    out = {}
    for names, level in re.findall(r"(?m)^\| (`[^|]*`[^|]*) \| (look|operate|service)", (harness.TOP / "docs/control-socket.md").read_text(encoding="utf-8")):
        out.update({name.split()[0]: level for name in re.findall(r"`([a-z-]+)[^`]*`", names)})
    return out


def state_of(bench):
    return bench.raw("status")["state"]


def until(bench, *states):
    end = time.monotonic() + 20
    while state_of(bench) not in states:
        assert time.monotonic() < end, f"{state_of(bench)} in place of {states}"
        time.sleep(0.01)


def reach(bench, state):
    """Brings it there by heaved's own socket."""
    for _ in range(8):
        now = state_of(bench)
        if now == state or state == "ENGAGED" and now == "NEUTRAL":
            return
        if now == "FAULT":
            bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("following_error_mm = 0.01\n", ""), encoding="utf-8")
            bench.running[-1].send_signal(signal.SIGHUP)
            time.sleep(0.3)
            bench.raw("reset")
        elif now == "SERVICE":
            bench.raw("service-off")
            until(bench, "OFF")
        elif state in ("OFF", "HOMING", "SERVICE") and now == "SETTLED":
            bench.raw("service")
        elif state in ("OFF", "HOMING", "SERVICE") and now == "OFF":
            bench.raw("park" if state == "HOMING" else "service")
        elif state in ("OFF", "HOMING", "SERVICE", "SETTLED"):
            bench.raw("park")
            until(bench, "SETTLED")
        elif state == "RISING" and now != "SETTLED":
            bench.raw("park")
            until(bench, "SETTLED")
        elif now in ("ENGAGED", "NEUTRAL") and state in ("HOLD", "SETTLING", "FAULT"):
            bench.raw("hold" if state == "HOLD" else "park")
            if state == "FAULT":
                bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[cylinders]\n", "[cylinders]\nfollowing_error_mm = 0.01\n"), encoding="utf-8")
                bench.running[-1].send_signal(signal.SIGHUP)
                until(bench, "FAULT")
        else:
            answer = bench.raw("engage")
            assert answer["ok"], (state, now, answer)
            if state != "RISING":
                until(bench, "ENGAGED", "NEUTRAL", *(("FAULT",) if state == "FAULT" else ()))  # the window may be narrow still
    raise AssertionError(f"{state} is not reached, but {state_of(bench)}")


def told(answer):
    """What an answer says, but for what is of one platform alone."""
    return sorted(answer), [answer.get(name) for name in ("ok", "error", "state")]


def answers_in_every_state(bench):
    """Every request in every state: by the panel as by heaved's own socket, on two platforms that are alike; by every role, as the table of the document says."""
    levels = levels_of_document()
    assert levels["engage"] == "operate" and levels["hold"] == "look" and levels["reset"] == "service", levels
    looked = 0
    with PanelBench() as other, contextlib.ExitStack() as stack:
        for one in (bench, other):
            one.both()
        link = {role: stack.enter_context(bench.link(cookie=bench.log_in(role)[1])) for role in LEVELS}
        for state in STATES:
            for line in REQUESTS:
                for role in LEVELS:
                    needed = levels.get(line.split()[0], "look")
                    if line.startswith("intensity"):
                        needed = "operate" if line == "intensity 40" else "service"
                    if line in ("selftest", "engage now"):  # the request without a result; one that is not known
                        needed = "look"
                    allowed = LEVELS.index(role) >= LEVELS.index(needed)
                    if allowed and role != "service":
                        continue  # what it may, it does as service does; tried once
                    if allowed:
                        for _ in range(5):  # a state that passes may be over for one of the two
                            for one in (bench, other):
                                assert one.raw("intensity 50")["ok"]
                            take(link[role])
                            for one in (bench, other):
                                reach(one, state)
                            theirs, mine = other.raw(line), request(link[role], line).get("answer", {})
                            if told(mine) == told(theirs):
                                break
                        assert told(mine) == told(theirs), (state, line, mine, theirs)
                    else:
                        answer = request(link[role], line)
                        assert answer.get("error") == f"{line[:20]}: not allowed; it takes the role {needed}", (state, line, role, answer)
                    looked += 1
    print(f"# figure {looked} answers compared: {len(STATES)} states, {len(REQUESTS)} requests", flush=True)


def geometry_is_that_of_the_kinematics(bench):
    """Lengths from the joints and the pose, by code of the tests, are the extensions that heaved sends."""
    daemon = bench.both()
    with bench.link() as link:
        take(link)
        request(link, "engage")
        bench.wait_state("NEUTRAL", "ENGAGED", "HOLD")
        with bench.sender() as sender:
            sender.send("@A6T:3,-2,4,10,-5,12,1500#")
            time.sleep(4)
        geometry, status = request(link, "geometry")["answer"], bench.status()
    pose = status["pose_sent"]
    mrp = geometry["mrp_mm"]
    for k, cylinder in enumerate(status["cylinders"]):
        point = turn([p - m for p, m in zip(geometry["plate_mm"][k], mrp)], pose["roll_deg"], pose["pitch_deg"], pose["yaw_deg"])
        top = [m + pose[f"{axis}_mm"] + value + (geometry["zero_height_mm"] if axis == "z" else 0) for m, axis, value in zip(mrp, "xyz", point)]
        length = math.dist(top, geometry["base_mm"][k])
        assert abs(length - geometry["retracted_length_mm"][k] - cylinder["sent_mm"]) < 0.1, (k, length, cylinder)
    assert bench.stop(daemon) == 0


def rows_of(block):
    number, rows, first, lost, _ = struct.unpack_from("<IIQII", block)
    columns = [struct.unpack_from(f"<{rows}d", block, 24 + 8 * rows * c) for c in range((len(block) - 24) // (8 * rows))]
    return number, first, lost, columns


def samples_are_every_cycle(bench):
    bench.both()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 1, "id": 0})
        link.receive(lambda message: message.get("event") == "status")
        got = link.ask({"op": "samples", "platform": "ride", "columns": ["cycle", "t_ms"], "every": 1, "history_s": 0.5})
        assert [column["name"] for column in got["columns"]] == ["cycle", "t_ms"] and got["cycle_us"] == 1000, got
        end = time.monotonic() + 3
        while time.monotonic() < end:
            opcode, data = link.next()
            link.blocks += [data] if opcode == web_socket.BINARY else []
        parts = [rows_of(block) for block in link.blocks]
        cycles = [value for part in parts for value in part[3][0]]
        assert all(after[1] == before[1] + len(before[3][0]) for before, after in zip(parts, parts[1:])), "a record is missing"
        assert len(cycles) > 500 and all(b > a for a, b in zip(cycles, cycles[1:])), len(cycles)
        assert all(rows_of(block)[2] == 0 for block in link.blocks), "rows were lost"
        link.send({"op": "samples-end", "platform": "ride", "stream": got["stream"], "id": 0})
        got = link.ask({"op": "samples", "platform": "ride", "columns": ["sent_z_mm-actual_z_mm", "sent_z_mm", "actual_z_mm"], "every": 1, "history_s": 0.5})
        assert got["columns"][0] == {"name": "sent_z_mm-actual_z_mm", "unit": "mm"}, got
        link.blocks = []
        while not link.blocks or rows_of(link.blocks[0])[0] != got["stream"]:
            opcode, data = link.next()
            link.blocks = [data] if opcode == web_socket.BINARY else []
        off, sent, actual = rows_of(link.blocks[0])[3]
        assert len(off) > 0 and all(a == b - c for a, b, c in zip(off, sent, actual))
        link.send({"op": "samples-end", "platform": "ride", "stream": got["stream"], "id": 0})
        for wrong in (["nothing"], [], ["cycle"] * 33, [7], ["t_ms-sent_z_mm"], ["-"], ["sent_z_mm-"], ["-sent_z_mm"], ["sent_z_mm-actual_z_mm-sent_z_mm"]):
            assert "error" in link.ask({"op": "samples", "platform": "ride", "columns": wrong}), wrong
        link.blocks = []
        link.ask({"op": "samples", "platform": "ride", "columns": ["cycle"], "every": 100, "history_s": 2})
        while not link.blocks:
            opcode, data = link.next()
            link.blocks += [data] if opcode == web_socket.BINARY else []
        column = rows_of(link.blocks[0])[3][0]
        assert all(most >= least + 99 for least, most in zip(column[::2], column[1::2])), column[:6]


def comes_back(bench):
    """heaved ends and starts again, the panel dies and starts again: neither needs the other."""
    daemon = bench.both()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        link.receive(lambda message: message.get("event") == "status")
        assert bench.stop(daemon) == 0
        link.receive(lambda message: message.get("event") == "gone")
        assert request(link, "hold")["error"] == "heaved is not there"
        bench.start()
        link.receive(lambda message: message.get("event") == "status", 30)
        bench.end_panel(signal.SIGKILL)
    assert bench.status()["state"] == "OFF"
    bench.start_panel()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        link.receive(lambda message: message.get("event") == "status")


def gives_way_and_comes_back(bench):
    """More clients than heaved takes: the panel's connections are among those that give way, and it makes them anew."""
    bench.both()
    with bench.link() as link, contextlib.ExitStack() as others:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        link.receive(lambda message: message.get("event") == "status")
        for _ in range(12):
            one = others.enter_context(harness.Line(bench.socket))
            one.link.sendall(b"watch 10\n")
            time.sleep(0.1)
        others.close()
        for _ in range(5):
            status = link.receive(lambda message: message.get("event") == "status", 30)["status"]
            assert "cylinders" in status, status
        harness.wait_for(lambda: "answer" in request(link, "hold"), "requests go through again")


def motion_does_not_know_it(bench):
    """A ride with viewers of every cycle, a flood of messages, a panel that hangs, and one that is killed: played again in simulated time, where there is no panel, it is the same to the byte."""
    record, trace = bench.folder / "record.txt", bench.folder / "live.csv"
    daemon = bench.start("--record", record, "--trace", trace)
    bench.start_panel()
    harness.wait_for(lambda: bench.status()["state"] == "OFF", "heaved is up")
    assert bench.raw("engage")["ok"]
    bench.wait_state("NEUTRAL", "ENGAGED", "HOLD")
    stop = threading.Event()
    riding = threading.Thread(target=ride, args=(bench, stop))
    riding.start()
    columns = ["t_ms", *(f"{what}_{axis}" for what in ("sent", "actual", "asked") for axis in ("x_mm", "y_mm", "z_mm", "roll_deg", "pitch_deg", "yaw_deg"))]
    try:
        with contextlib.ExitStack() as stack:
            links = [stack.enter_context(bench.link()) for _ in range(10)]
            for link in links:  # nobody reads what comes
                link.send({"id": 0, "op": "samples", "platform": "ride", "columns": columns, "every": 1, "history_s": 30})
                link.send({"id": 0, "op": "status", "platform": "ride", "hz": 10})
            with contextlib.suppress(OSError):
                for i in range(3000):
                    links[i % 10].send({"id": i, "op": "request", "platform": "ride", "line": "tick" if i % 2 else "geometry"})
            bench.panel.send_signal(signal.SIGSTOP)
            time.sleep(2)
            bench.panel.send_signal(signal.SIGCONT)
            time.sleep(1)
            bench.end_panel(signal.SIGKILL)
            time.sleep(1)
        bench.start_panel()
        with bench.link() as link:
            assert request(link, "tick")["answer"]["ok"]
    finally:
        stop.set()
        riding.join()
    assert bench.stop(daemon) == 0
    live, played = harness.since_zero(trace.read_bytes()), bench.play(record, config=bench.config)
    length = min(len(live), len(played))
    assert live[:length] == played[:length] and live.count(b"ENGAGED") > 1000, (len(live), len(played), live.count(b"ENGAGED"))
    print(f"# figure {live.count(bytes([10]))} cycles of the trace are the same to the byte", flush=True)


def ride(bench, stop):
    with bench.sender() as sender:
        i = 0
        while not stop.is_set():
            i += 1
            sender.send(f"@A6:{2 * math.sin(i / 20):.3f},0,0,{8 * math.sin(i / 15):.3f},0,{5 * math.sin(i / 11):.3f}#")
            if i % 50 == 0 and bench.raw("status")["state"] == "HOLD":  # a busy machine
                bench.raw("resume")
            stop.wait(0.02)


# --- Whom it lets in ---

def strangers(bench):
    bench.both()
    own = f"http://127.0.0.1:{bench.web}"
    for options in ({"origin": "http://evil.example"}, {"origin": None}, {"origin": "http://evil.example", "host_header": "evil.example"},
                    {"host_header": f"evil.example:{bench.web}"}, {"origin": f"http://127.0.0.1:{bench.web + 1}"}, {"origin": "null"}):
        try:
            bench.link(**{"origin": own, **options})
        except Refused:
            continue
        raise AssertionError(f"let in: {options}")
    for protocol in ("heaved", "child", "http", "other", None):  # a client names its protocol: the panel's own ones are nobody's WebSocket
        for path in ("/ws", "/"):
            try:
                WebSocket("127.0.0.1", bench.web, path, protocol=protocol, origin=own, timeout=10).socket.close()
            except (Refused, TimeoutError):
                continue
            raise AssertionError(f"let in as {protocol} at {path}")
    assert bench.get("/", Host="evil.example")[0] == 403
    assert bench.get("/", Host=f"localhost:{bench.web}")[0] == 200
    for path in ("/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "//etc/passwd", "/api", "/style.css%00", "/" + "x" * 4000):
        with contextlib.suppress(http.client.RemoteDisconnected):  # no answer at all is one, too
            code, _, text = bench.get(path)
            assert code >= 400 and b"root:" not in text, path
    assert bench.get("/api/login", "POST", {"role": "service", "password": "x"}, Content_Type="text/plain", Origin=own)[0] == 404, "a form of another page could say that"
    assert bench.get("/api/login", "POST", {"role": "service", "password": "x"}, Content_Type="application/json", Origin="http://evil.example")[0] == 403
    assert bench.get("/api/login", "POST", {"role": "service", "password": "x"}, Content_Type="application/json")[0] == 403
    headers = bench.get("/")[1]
    assert "default-src 'self'" in headers["content-security-policy"] and "unsafe" not in headers["content-security-policy"] and headers["x-content-type-options"] == "nosniff"
    for data in (b"\x00", b"{", b"[]", b"[" * 1900, b'{"id":1e99}', b'{"id":-1,"op":"request"}', b'{"op":"request","platform":"ride","line":7}', b"\xff\xfe"):
        with bench.link() as link:
            link.frame(web_socket.TEXT, data)
            with contextlib.suppress(ConnectionError):
                assert "error" in link.receive(lambda message: "error" in message), data
    for data, opcode in ((b"x" * 5000, web_socket.TEXT), (b"x" * 100, web_socket.BINARY)):
        with bench.link() as link, contextlib.suppress(ConnectionError, OSError):
            link.frame(opcode, data)
            link.receive(lambda message: False, 3)
    assert bench.panel.poll() is None and bench.get("/")[0] == 200 and bench.status()["state"] == "OFF"


def nobody_keeps_hold_away(bench):
    """A page that may only look asks without end while heaved does not answer: hold of everybody else still has a place."""
    daemon = bench.both()
    cookie = bench.log_in("look")[1]
    with bench.link(cookie=cookie) as flood, bench.link(cookie=cookie) as other:
        for line in ("geometry", "counts", "times"):
            with standing_still(daemon):
                for number in range(80):  # more than there are places, and no more answers than a page may leave lying
                    flood.send({"op": "request", "platform": "ride", "line": line, "id": 1000 + number})
                refused = flood.receive(lambda message: "error" in message)
                assert refused["error"] == "too many requests wait for heaved: try again", refused
                other.send({"op": "request", "platform": "ride", "line": "hold", "id": 1})
                time.sleep(0.3)
            got = other.receive(lambda message: message.get("id") == 1)
            assert "answer" in got, (line, got)
            harness.wait_for(lambda: "answer" in request(other, "geometry"), "requests go through again")


def nobody_keeps_ticks_away(bench):
    """A page that may only look says the same without end: others hear nothing of it, and it is listened to a little at a time. A login costs a process of its own, and that thread nothing."""
    bench.both()
    look, operate = bench.log_in("look")[1], bench.log_in("operate")[1]
    with bench.link(cookie=look) as flood, bench.link(cookie=operate) as holder:
        take(holder)
        for message in ({"op": "status", "platform": "ride", "hz": 10}, {"op": "drop", "platform": "ride"}, {"op": "request", "platform": "ride", "line": "engage"}):
            began, count = time.monotonic(), 300
            for number in range(count):
                flood.send({**message, "id": 5000 + number})
            flood.ask({"op": "request", "platform": "ride", "line": "engage"})
            took_s = time.monotonic() - began
            assert took_s > 0.9 * (count // 16 - 1) * 0.033, f"{message}: {count} messages in {took_s} s"
        heard, number = [], 9000
        holder.send({"op": "request", "platform": "ride", "line": "tick", "id": number})
        holder.receive(lambda answer: heard.append(answer.get("event")) or answer.get("id") == number)
        assert "controls" not in heard, heard
        assert request(holder, "hold")["answer"]["ok"] in (True, False)
    before = cpu_s(bench.panel.pid)
    codes = [bench.log_in("operate")[0] for _ in range(12)]
    own_s, of_others_s = (now - then for now, then in zip(cpu_s(bench.panel.pid), before))
    assert codes == [200] * 12 and own_s < of_others_s / 2, (codes, own_s, of_others_s)


def cpu_s(pid):
    """Of a process itself, and of those of its processes that have ended."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return [(int(fields[i]) + int(fields[i + 1])) / os.sysconf("SC_CLK_TCK") for i in (11, 13)]


IDENTIFY = {"op": "identify", "platform": "ride", "axis": "z", "tick": 1}


def nobody_keeps_test_signals_away(bench):
    """Whoever wanted a test signal has gone before it began, or it could not be asked for: the next one may have one."""
    daemon = bench.both()

    def is_free(link):
        return "test signal is being made" not in link.ask(IDENTIFY).get("error", "")

    with bench.link() as link:
        take(link)
        with standing_still(daemon):
            for number in range(100):
                link.send({"op": "request", "platform": "ride", "line": "hold", "id": 1000 + number})
            assert link.ask(IDENTIFY)["error"] == "too many requests wait for heaved: try again"
        harness.wait_for(lambda: "answer" in request(link, "hold"), "requests go through again")
        assert is_free(link), "that could not be asked for"
    with standing_still(daemon):
        with bench.link() as link:
            take(link)
            link.send({**IDENTIFY, "id": 7})
            time.sleep(0.3)
        time.sleep(0.3)
    with bench.link() as link:
        take(link)
        assert request(link, "hold")["answer"] is not None
        assert is_free(link), "of a page that has gone"


def passwords_and_roles(bench):
    bench.both()
    assert json.loads(bench.get("/api/me")[2])["role"] is None
    try:
        bench.link()
    except Refused:
        pass
    else:
        raise AssertionError("a WebSocket without a login")
    assert bench.log_in("look", "wrong")[0] == 401
    code, cookie, whole, _ = bench.log_in("look")
    assert code == 200 and "HttpOnly" in whole and "SameSite=Strict" in whole, whole
    assert json.loads(bench.get("/api/me", Cookie=cookie)[2])["role"] == "look"
    forged = cookie[:-1] + ("0" if cookie[-1] != "0" else "1")
    for wrong in (forged, "heave=", "heave=" + "a" * 500, "other=1"):
        assert json.loads(bench.get("/api/me", Cookie=wrong)[2])["role"] is None, wrong
    with bench.link(cookie=cookie) as link:
        assert request(link, "hold")["answer"]["ok"] in (True, False), "everybody may hold"
        assert "not allowed" in request(link, "engage")["error"] and "not allowed" in link.ask({"op": "take", "platform": "ride"})["error"]
    own = f"http://127.0.0.1:{bench.web}"
    for path, headers, refused in (("/api/logout", {"Origin": "http://evil.example"}, 403), ("/api/logout", {}, 403), ("/api/logout", {"Origin": own, "Host": "evil.example"}, 403),
                                   ("/api/logout", {"Origin": own, "Content_Type": "text/plain"}, 404), ("/api/other", {"Origin": own}, 404)):
        code = bench.get(path, "POST", {}, Cookie=cookie, **{"Content_Type": "application/json", **headers})[0]
        assert code == refused and json.loads(bench.get("/api/me", Cookie=cookie)[2])["role"] == "look", (path, headers, code, "a refused request has ended a session")
    bench.get("/api/me", "GET", {}, Cookie=cookie)
    assert json.loads(bench.get("/api/me", Cookie=cookie)[2])["role"] == "look", "a body that nobody asked for has ended a session"
    for _ in range(12):
        assert bench.get("/api/login", "POST", {"role": "look", "password": "wrong"}, Content_Type="application/json", Origin="http://evil.example")[0] == 403
    assert bench.log_in("look")[0] == 200, "refused requests have used up the tries"
    operate = bench.log_in("operate")[1]
    with bench.link(cookie=operate) as one, bench.link(cookie=operate) as two:
        take(one)
        assert "not allowed" in request(one, "service")["error"] and "not allowed" in one.ask({"op": "press", "platform": "ride", "line": "jog 1 1", "tick": 1})["error"]
        assert "somebody else has the controls" in request(two, "engage")["error"]
        take(two)
        assert "somebody else" in request(one, "engage")["error"]
    out = bench.get("/api/logout", "POST", {}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", Cookie=operate)
    assert out[0] == 200 and json.loads(bench.get("/api/me", Cookie=operate)[2])["role"] is None, "a session that was ended is replayed"
    codes = [bench.log_in("service", f"guess {i}")[0] for i in range(40)]
    assert codes.count(401) <= 20 and codes.count(429) >= 20 and 200 not in codes, codes
    text = bench.panel_log.read_text(encoding="utf-8")
    assert PASSWORD not in text and cookie.split("=")[1] not in text, "a secret is in the log"
    stored = (bench.state_folder / "passwords")
    assert stored.stat().st_mode & 0o077 == 0 and "$y$" in stored.read_text(encoding="ascii")


def sessions_over_a_web_socket(bench):
    """A cookie of nobody, a forged one, one that was logged out, one of another panel: no WebSocket. One that is open ends with its session."""
    bench.both()
    cookie = bench.log_in("service")[1]
    bench.log_in("service")
    with bench.link(cookie=cookie) as link:
        take(link)
        assert request(link, "tick")["answer"]["ok"]
        for wrong in (None, "heave=", cookie[:-1], cookie + "0", cookie.upper(), "heave=" + "0" * 64, cookie[:-2] + "ff", f"x{cookie}", "heave=%00", "heave=\x01\x02"):
            if wrong != cookie:
                try:
                    bench.link(cookie=wrong)
                except Refused:
                    continue
                raise AssertionError(f"let in with {wrong}")
        for options in ({"origin": "http://evil.example"}, {"host_header": "evil.example"}, {"origin": None}):
            try:
                bench.link(cookie=cookie, **options)
            except Refused:
                continue
            raise AssertionError(f"a page of somebody else has the cookie, and is let in: {options}")
        assert bench.get("/api/logout", "POST", {}, Content_Type="application/json", Origin="http://evil.example", Cookie=cookie)[0] == 403, "somebody else's page logs out"
        assert request(link, "tick")["answer"]["ok"]
        assert bench.get("/api/logout", "POST", {}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", Cookie=cookie)[0] == 200
        try:
            link.receive(lambda message: False, 5)
        except (ConnectionError, OSError):
            pass
        else:
            raise AssertionError("the WebSocket goes on without its session")
    try:
        bench.link(cookie=cookie)
    except Refused:
        pass
    else:
        raise AssertionError("a cookie is replayed")
    bench.end_panel()
    bench.start_panel()
    try:
        bench.link(cookie=cookie)
    except Refused:
        return
    raise AssertionError("a session outlives the panel")


def resident_kb(pid):
    return int(re.search(r"(?m)^VmRSS:\s*(\d+) kB", Path(f"/proc/{pid}/status").read_text(encoding="ascii"))[1])


def ten_thousand_logins(bench):
    """From one address, wrong and right: 429 nearly always, no session more than there is room for, no memory, and who is in goes on. And no way in by trying."""
    bench.both()
    own = f"http://127.0.0.1:{bench.web}"
    with bench.link(cookie=bench.log_in("operate")[1]) as link:
        bench.log_in("operate")
        before, codes, longest = resident_kb(bench.panel.pid), [], 0.0
        client = http.client.HTTPConnection("127.0.0.1", bench.web, timeout=20)
        for i in range(10000):
            body = json.dumps({"role": "service", "password": f"{PASSWORD} service" if i % 2 == 0 and i > 5000 else f"guess {i}"})
            client.request("POST", "/api/login", body, {"Content-Type": "application/json", "Origin": own})
            answer = client.getresponse()
            answer.read()
            codes.append(answer.status)
            if i % 500 == 0:
                began = time.monotonic()
                assert request(link, "hold")["answer"]["ok"] in (True, False)
                longest = max(longest, time.monotonic() - began)
        client.close()
        assert set(codes) <= {200, 401, 429} and codes.count(429) > 9000 and codes[:5000].count(200) == 0, {code: codes.count(code) for code in set(codes)}
        assert resident_kb(bench.panel.pid) < before + 2048, (before, resident_kb(bench.panel.pid))
        assert longest < 2, longest
        print(f"# figure {codes.count(401) + codes.count(200)} of 10000 logins were looked at; who was in had its answer within {1000 * longest:.0f} ms", flush=True)
    assert bench.status()["state"] == "OFF"


def broken_messages(bench):
    """What is no HTTP, no WebSocket frame, or too much of it: the connection ends, and nobody else notices."""
    bench.both()
    with bench.link() as witness:
        host = f"Host: 127.0.0.1:{bench.web}\r\n"
        for data in (b"", b"\x00" * 4000, b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", f"GET / HTTP/1.1\r\n{host}Cookie: {'a' * 60000}\r\n\r\n".encode(),
                     f"GET / HTTP/1.1\r\n{host}{'X: y' * 1}\r\n".encode() * 2000, f"POST /api/login HTTP/1.1\r\n{host}Content-Length: 999999999\r\nContent-Type: application/json\r\nOrigin: http://127.0.0.1:{bench.web}\r\n\r\n".encode() + b"x" * 100000,
                     f"POST /api/login HTTP/1.1\r\n{host}Content-Length: -1\r\n\r\n".encode(), f"POST /api/login HTTP/1.1\r\n{host}Transfer-Encoding: chunked\r\nContent-Type: application/json\r\n\r\nzz\r\n".encode(),
                     f"BREW / HTTP/1.1\r\n{host}\r\n".encode(), f"GET /{'%41' * 5000} HTTP/1.1\r\n{host}\r\n".encode(), b"\x16\x03\x01\x02\x00" + os.urandom(500), b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"):
            with socket.create_connection(("127.0.0.1", bench.web), timeout=3) as link, contextlib.suppress(OSError):
                link.sendall(data)
                link.settimeout(0.3)
                while text := link.recv(65536):
                    assert b"root:" not in text and b"HEAVE" not in text, (data[:60], text[:100])
        for frames in (((web_socket.TEXT, b"{", False), (web_socket.TEXT, b"}", True)), ((0, b"x", True),), ((3, b"x", True),), ((web_socket.PING, b"x" * 126, True),), ((web_socket.CLOSE, b"\x00", True),),
                       *((((web_socket.TEXT, b"x" * 1000, False), *((0, b"x" * 1000, False),) * 2000)),), ((web_socket.TEXT, b"x" * 10000000, True),), ((web_socket.TEXT, b'{"id":1,"op":"request","platform":"ride","line":"hold\\u0000engage"}', True),),
                       ((web_socket.TEXT, b'{"id":1,"op":"samples","platform":"ride","columns":["t_ms"],"every":1e308,"history_s":1e308}', True),), ((web_socket.TEXT, b'{"id":1,"op":"press","platform":"ride","line":"jog 1 1","tick":1e300}', True),)):
            with bench.link() as link, contextlib.suppress(ConnectionError, OSError):
                for opcode, data, final in frames:
                    link.frame(opcode, data, final)
                link.socket.settimeout(0.3)
                link.next()
        with bench.link() as link, contextlib.suppress(ConnectionError, OSError):
            link.socket.sendall(b"\x81\x02{}")  # not masked, as a client has to
            link.socket.settimeout(0.5)
            link.next()
        with contextlib.ExitStack() as idle:  # somebody who holds connections and says nothing
            for _ in range(300):
                idle.enter_context(socket.create_connection(("127.0.0.1", bench.web), timeout=3)).sendall(b"GET / HTTP/1.1\r\nX-")
            assert bench.get("/")[0] == 200 and request(witness, "hold")["answer"]["ok"] in (True, False)
        assert request(witness, "tick")["answer"]["ok"] and bench.panel.poll() is None and bench.status()["state"] == "OFF"
        assert resident_kb(bench.panel.pid) < 40000, resident_kb(bench.panel.pid)


HTML = "<img src=x onerror=\"window.hacked=1\"><script>window.hacked=1</script>"


class FalseHeaved(threading.Thread):
    """A heaved whose every word is HTML. The shape of its answers is that of a real one."""

    def __init__(self, path, status, geometry):
        super().__init__(daemon=True)
        self.listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listening.bind(str(path))
        self.listening.listen(16)
        self.status, self.geometry = status, geometry

    def run(self):
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=self.serve, args=(self.listening.accept()[0],), daemon=True).start()

    def serve(self, link):
        with contextlib.suppress(OSError), link, link.makefile("rb") as lines:
            for line in lines:
                word = line.decode().split()[0]
                answers = {"geometry": self.geometry, "incidents": {"ok": True, "incidents": [{"name": f"incident-000001-{HTML}", "dump": False, "seen": False}]}}
                answer = answers.get(word, {"ok": False, "error": HTML})
                while word == "watch":
                    link.sendall(json.dumps(self.status, separators=(",", ":")).encode() + b"\n")
                    time.sleep(0.1)
                link.sendall(json.dumps(answer, separators=(",", ":")).encode() + b"\n")


class SlowDisk(FalseHeaved):
    """A heaved that does not come to an end with what goes to a disk or a bus, and answers the requests of a connection one after the other."""

    def serve(self, link):
        with contextlib.suppress(OSError), link, link.makefile("rb") as lines:
            for line in lines:
                word = line.decode().split()[0]
                while word == "watch":
                    link.sendall(json.dumps(self.status, separators=(",", ":")).encode() + b"\n")
                    time.sleep(0.1)
                if word in ("dump", "sdo"):
                    time.sleep(3600)
                link.sendall(b'{"ok":true}\n')


def nothing_waits_for_a_disk(bench):
    """While heaved writes an incident or asks a bus, everything else is answered."""
    daemon = bench.both()
    status, geometry = bench.raw("status"), bench.raw("geometry")
    bench.end_panel()
    bench.stop(daemon)
    with contextlib.suppress(FileNotFoundError):
        bench.socket.unlink()
    SlowDisk(bench.socket, status, geometry).start()
    bench.start_panel()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 1, "id": 0})
        link.receive(lambda message: message.get("event") == "status")
        take(link)
        for number, line in enumerate(("dump", "sdo read 1 1000 0")):
            link.send({"op": "request", "platform": "ride", "line": line, "id": 1000 + number})
        for line in ("engage", "park", "torque all off", "hold", "geometry"):
            link.send({"op": "request", "platform": "ride", "line": line, "id": 1})
            assert link.receive(lambda message: message.get("id") in (1, 1000, 1001), 10) == {"id": 1, "answer": {"ok": True}}, line


def poisoned(value):
    """The same shape, with HTML in every text but those that the page has to know."""
    if isinstance(value, dict):
        return {name: one if name in ("state", "kind", "ok") else poisoned(one) for name, one in value.items()}
    if isinstance(value, list):
        return [poisoned(one) for one in value]
    return HTML if isinstance(value, str) else value


def html_is_text(bench):
    """An address of a sender, a fault, a label, a name of an incident, a refusal, a file: what looks like HTML is shown as it is, and does nothing."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    daemon = bench.both()
    status = bench.raw("status")
    geometry = bench.raw("geometry")
    status["fault"].update({"code": 7, "axis": 1, "device_text": "x"})
    status["sender"] = {**(status["sender"] or {}), "address": "x"}
    status["stream"]["sender"] = "x"
    for one in status["cylinders"]:
        one.update({"drive": "x", "report": {"trouble": "x"}})
    status["bus"] = {"trouble": "x", "last_trouble": "x"}
    bench.end_panel()
    bench.stop(daemon)
    with contextlib.suppress(FileNotFoundError):
        bench.socket.unlink()
    FalseHeaved(bench.socket, poisoned(status), geometry).start()
    bench.start_panel()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent !== ''", "the state is shown")
        page.wait("document.getElementById('page').innerText.includes('<img src=x')", "it is shown as text")
        for name in PAGES:
            click(page, f"[data-tab={name}]")
            time.sleep(0.5)
            for selector in ("#hold", "[data-request=engage]", "[data-op]", "[data-request=dump]", "[data-incident]"):
                page.run(f"document.querySelector({json.dumps(selector)})?.click()")
                time.sleep(0.1)
            assert page.run("document.querySelectorAll('img, #page script, iframe').length") == 0 and page.run("window.hacked") is None, name
        page.wait("document.getElementById('said').textContent.includes('<img')", "a refusal is shown as text")
        rows = "JSON.stringify({time: '2026-01-01T00:00:00Z', uid: 1, by: '<img src=x onerror=window.hacked=1>', request: '<img src=x>', ok: false, answer: '<img src=x>', before: 'OFF', after: '<img src=x>'})"
        page.run(f"window.fetch = async (path) => ({{ ok: true, text: async () => path.includes('/log/') ? {rows} : path.includes('trace') ? 't_ms,state,x_mm,y_mm,z_mm,relays,flags\\n1,<img src=x onerror=window.hacked=1>,1,2,3,<img src=x>,<img src=x>\\n2,OFF,1,2,3,0,\\n' : '; <img src=x>\\n; <img src=x>\\n1 !from <img src=x onerror=window.hacked=1>\\n2 @A6\\n3 !fault <img src=x>\\n' }})")
        click(page, "[data-tab=log]")
        page.wait("document.querySelector('main table') !== null && document.querySelector('main table').innerText.includes('<img src=x')", "the log is text")
        click(page, "[data-tab=incidents]")
        click(page, "[data-incident]")
        page.wait("document.getElementById('time-line') !== null && document.getElementById('time-line').innerText.includes('<img src=x')", "an incident is text")
        assert page.run("document.querySelectorAll('img').length") == 0 and page.run("window.hacked") is None
        assert all("404" in one for one in page.problems), page.problems  # files that this heaved has not


def over_tls(bench):
    """openssl and a browser: TLS 1.2 and later, the cookie for TLS alone, WebSocket too; plain HTTP gets nothing."""
    if shutil.which("openssl") is None:
        raise tap.Skip("openssl is not there")
    certificate, key = bench.folder / "cert.pem", bench.folder / "key.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj", "/CN=ride", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out",
                    certificate], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    bench.more = ("--tls-cert", certificate, "--tls-key", key)
    bench.both()

    def handshake(*options):
        run = subprocess.run(["openssl", "s_client", "-connect", f"127.0.0.1:{bench.web}", "-CAfile", certificate, "-verify_return_error", *options], input=b"", capture_output=True, timeout=30, check=False)
        return run.returncode == 0, run.stdout.decode(errors="replace")

    for option, is_taken in (("-tls1_3", True), ("-tls1_2", True), ("-tls1_1", False), ("-tls1", False)):
        taken, text = handshake(option)
        assert taken == is_taken, (option, text[-400:])
    for weak in ("NULL", "aNULL", "RC4", "3DES", "EXPORT"):
        taken, text = handshake("-tls1_2", "-cipher", f"{weak}:@SECLEVEL=0")
        assert not taken, (weak, text[-300:])
    context = ssl.create_default_context(cafile=str(certificate))
    own = f"https://127.0.0.1:{bench.web}"
    client = http.client.HTTPSConnection("127.0.0.1", bench.web, timeout=20, context=context)
    client.request("POST", "/api/login", json.dumps({"role": "service", "password": f"{PASSWORD} service"}), {"Content-Type": "application/json", "Origin": own})
    answer = client.getresponse()
    cookie = answer.getheader("set-cookie")
    assert answer.status == 200 and "; Secure" in cookie and "HttpOnly" in cookie and "SameSite=Strict" in cookie, cookie
    answer.read()
    with bench.link(context=context, origin=own, cookie=cookie.split(";")[0]) as link:
        assert request(link, "tick")["answer"]["ok"]
    with socket.create_connection(("127.0.0.1", bench.web), timeout=5) as plain, contextlib.suppress(OSError):
        plain.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{bench.web}\r\n\r\n".encode())
        assert b"200" not in plain.recv(100), "it answers without TLS"
    run = subprocess.run([BIN / "heave-panel", "--tls-cert", key, "--tls-key", key, "--state", bench.state_folder, "--www", WWW, "--listen", f"127.0.0.1:{free_port()}"], capture_output=True, text=True, timeout=30, check=False)
    assert run.returncode == 69, run
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here; openssl was tried")
    public = subprocess.run(f"openssl x509 -in {certificate} -pubkey -noout | openssl pkey -pubin -outform der | openssl dgst -sha256 -binary | base64", shell=True, capture_output=True, text=True, check=True).stdout.strip()
    with Page(f"{own}/", 820, 1180, more=(f"--ignore-certificate-errors-spki-list={public}",)) as page:
        page.wait("document.getElementById('password') !== null", "it asks who it is")
        page.run("document.getElementById('role').value = 'service'")
        page.run(f"document.getElementById('password').value = '{PASSWORD} service'")
        page.run("document.querySelector('form button').click()")
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        assert page.run("document.cookie") == "" and page.run("location.protocol") == "https:"
        assert page.problems == [], page.problems


def bad_use(bench):
    def refused(code, words, *arguments, stdin=""):
        run = subprocess.run([BIN / "heave-panel", "--state", bench.state_folder, *arguments], input=stdin, capture_output=True, text=True, check=False, timeout=30)
        assert run.returncode == code and words in run.stderr, (arguments, run)

    refused(78, "only once there is a password", "--listen", "0.0.0.0:9801", "--www", WWW)
    refused(78, "No such file", "--www", "/nonexistent")
    refused(64, "127.0.0.1:9801", "--listen", "here")
    refused(64, "NAME=SOCKET", "--platform", "ride")
    refused(64, "letters", "--platform", 'a"b=/tmp/x', "--www", WWW)
    refused(64, "only together", "--tls-cert", "x")
    refused(64, "look, operate and service", "passwd", "boss")
    refused(78, "at least 8", "passwd", "look", stdin="short\n")
    (bench.state_folder / "passwords").write_text("nonsense\n", encoding="ascii")
    refused(78, "passwords:1:", "--www", WWW)


# --- Hands ---

def serve(bench, link):
    take(link)
    assert request(link, "service")["answer"]["ok"], "service"
    assert request(link, "torque all on")["answer"]["ok"]
    harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")


def jog(link, seconds, speed=3):
    """Presses and beats for so long, with the newest tick. Returns the series and the last tick."""
    tick = request(link, "tick")["answer"]["tick"]
    got = link.ask({"op": "press", "platform": "ride", "line": f"jog 2 {speed}", "tick": tick})
    answer = got["answer"]
    if not answer["ok"]:  # beside load the tick is too old, or it has not come to rest yet
        time.sleep(0.3)
        return 0, 0, tick
    tick, end, counter = answer["tick"], time.monotonic() + seconds, 0
    while time.monotonic() < end:
        counter += 1
        link.send({"id": 0, "op": "beat", "platform": "ride", "series": answer["series"], "counter": counter, "tick": tick})
        until = time.monotonic() + 0.05
        while time.monotonic() < until:
            tick = link.receive(lambda message: message.get("event") == "tick")["tick"]["tick"]
    return answer["series"], counter, tick


def moved(bench, seconds):
    """How far leg 2 goes in that time."""
    before = bench.status()["cylinders"][1]["sent_mm"]
    time.sleep(seconds)
    return abs(bench.status()["cylinders"][1]["sent_mm"] - before)


def a_hand_that_is_gone(bench):
    """The page goes, the panel is killed, stopped, or the link stands still: at rest, and what comes afterwards moves nothing."""
    bench.both()
    ways = ("released", "closed", "silent", "killed", "stopped")
    for way in ways:
        with bench.link() as link:
            serve(bench, link)
            start = bench.status()["cylinders"][1]["sent_mm"]
            for _ in range(TRIES):  # beats that come late beside load end it, which is right
                series, counter, tick = jog(link, 0.6, 3 if start < 60 else -3)
                if abs(bench.status()["cylinders"][1]["sent_mm"] - start) > 0.3:
                    break
            else:
                raise AssertionError(f"{way}: it has not moved")
            if way == "released":
                link.send({"id": 0, "op": "release", "platform": "ride"})
            elif way == "closed":
                link.socket.close()
            elif way == "killed":
                bench.end_panel(signal.SIGKILL)
            elif way == "stopped":
                bench.panel.send_signal(signal.SIGSTOP)
                for late in range(40):  # a stalled link delivers them at once, later
                    link.send({"id": 0, "op": "beat", "platform": "ride", "series": series, "counter": counter + 1 + late, "tick": tick})
            time.sleep(STOP_S)
            assert moved(bench, 0.4) < 1e-6, f"{way}: it moves"
            if way == "stopped":
                bench.panel.send_signal(signal.SIGCONT)
                assert moved(bench, 0.8) < 1e-6, "beats of before move it"
        if way == "killed":
            bench.start_panel()
        assert bench.raw("tick")["held"] is False, way
        bench.raw("service-off")
        bench.wait_state("OFF")


# --- What was written ---

def passed_folder(path, line):
    """The answer to a request that hands a folder over, and the folder."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(harness.WAIT_S)
        link.connect(str(path))
        link.sendall(line.encode() + b"\n")
        data, fds, _, _ = socket.recv_fds(link, 4096, 4)
    return json.loads(data), fds


def make_incident(bench):
    """A ride with a sender that ends in a fault, and a dump after it. The names of their folders."""
    bench.both()
    with bench.link() as link:
        take(link)
        assert request(link, "engage")["answer"]["ok"]
        bench.wait_state("NEUTRAL", "ENGAGED", "HOLD")
        with bench.sender() as sender:
            for i in range(100):
                sender.send(f"@A6T:{2 * math.sin(i / 10):.3f},0,0,{8 * math.sin(i / 8):.3f},0,0,20#")
                time.sleep(0.02)
            bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[cylinders]\n", "[cylinders]\nfollowing_error_mm = 0.01\n"), encoding="utf-8")
            bench.running[-1].send_signal(signal.SIGHUP)
            for i in range(3000):
                sender.send(f"@A6T:0,0,0,{8 * math.sin(i / 8):.3f},0,0,20#")
                time.sleep(0.02)
                if i % 10 == 0 and bench.status()["state"] == "FAULT":
                    break
        harness.wait_for(lambda: request(link, "incidents")["answer"]["incidents"], "the incident is written")
        folder = request(link, "dump")["answer"]["folder"]
        names = [one["name"] for one in request(link, "incidents")["answer"]["incidents"]]
        assert len(names) == 2 and names[1] == Path(folder).name and request(link, "seen")["answer"]["ok"]
    return names


def incidents_are_handed_over(bench):
    """heaved gives the places; the panel serves whole files, and nothing else that stands there."""
    names = make_incident(bench)
    answer, fds = passed_folder(bench.socket, "incident-folder")
    assert answer == {"ok": True} and len(fds) == 1 and {*names, "operator.log"} <= set(os.listdir(f"/proc/self/fd/{fds[0]}"))
    for use in (lambda: os.read(fds[0], 1), lambda: os.fchmod(fds[0], 0)):
        try:
            use()
        except OSError:
            continue
        raise AssertionError("it is more than a place to look from")
    os.close(fds[0])
    answer, fds = passed_folder(bench.socket, "operator-log")
    assert answer == {"ok": True, "file": "operator.log"} and len(fds) == 1
    os.close(fds[0])
    for name in names:
        for file in ("trace.csv", "feedback.csv", "frames", "platform.ini"):
            code, headers, text = bench.get(f"/api/incident/ride/{name}/{file}")
            assert code == 200 and text == (bench.kept / name / file).read_bytes(), (name, file)
            assert headers["content-disposition"] == f'attachment; filename="ride-{name}-{file}"', headers
    harness.wait_for(lambda: b'"request":"seen"' in bench.get("/api/log/ride")[2], "the log is written, a little later")
    code, _, text = bench.get("/api/log/ride")
    rows = [json.loads(line) for line in text.splitlines()]
    assert code == 200 and [row["request"] for row in rows] == ["engage", "SIGHUP", "dump", "seen"] and rows[0]["by"] == "service@127.0.0.1", rows
    (bench.kept / names[0] / "frames").unlink()
    (bench.kept / names[0] / "frames").symlink_to("/etc/passwd")
    (bench.kept / "incident-000009-20260101T000000Z").symlink_to("/etc")
    for path in (f"{names[0]}/frames", "incident-000009-20260101T000000Z/frames", f"{names[0]}/../operator.log", f"{names[0]}/%2e%2e/operator.log", f"{names[0]}/operator.log", f"{names[0]}/",
                 f"{names[0]}", "../kept/life", "incident-/trace.csv", "incident-1/../../etc/passwd", "/etc/passwd", "incident-" + "1" * 300 + "/frames", ""):
        code, _, text = bench.get(f"/api/incident/ride/{path}")
        assert code == 404 and b"root:" not in text and b"engage" not in text, (path, code, text[:80])
    assert bench.get(f"/api/incident/other/{names[0]}/trace.csv")[0] == 404 and bench.get("/api/log/other")[0] == 404
    assert bench.get(f"/api/incident/ride/{names[0]}/trace.csv", Host="evil.example")[0] == 403
    with bench.link() as link:  # somebody who goes away in the middle of a large file, and who stays and reads nothing
        for _ in range(20):
            with socket.create_connection(("127.0.0.1", bench.web)) as half:
                half.sendall(f"GET /api/incident/ride/{names[1]}/trace.csv HTTP/1.1\r\nHost: 127.0.0.1:{bench.web}\r\n\r\n".encode())
                half.recv(1000)
        assert "answer" in request(link, "tick")
    assert len(os.listdir(f"/proc/{bench.panel.pid}/fd")) < 40, "files are left open"


def files_by_role(bench):
    names = make_incident_as(bench)
    for path, roles in ((f"/api/incident/ride/{names[0]}/frames", {"look", "operate", "service"}), ("/api/log/ride", {"operate", "service"})):
        assert bench.get(path)[0] == 401, path
        for role in ("look", "operate", "service"):
            code = bench.get(path, Cookie=bench.log_in(role)[1])[0]
            assert code == (200 if role in roles else 403), (path, role, code)


def make_incident_as(bench):
    """A dump, by somebody who is logged in."""
    bench.both()
    with bench.link(cookie=bench.log_in("service")[1]) as link:
        take(link)
        assert request(link, "dump")["answer"]["ok"]
        return [one["name"] for one in request(link, "incidents")["answer"]["incidents"]]


HEAVED_UID, PANEL_UID, STRANGER_UID, HEAVE_GID = 61184, 61185, 61187, 61186  # users as systemd would make them, and the group heave


def rights_are_as_in_the_units(bench):
    """heaved and the panel are two users of one group, with the umask of the unit. Who is not of the group gets a place, and nothing in it."""
    if os.geteuid() != 0:
        raise tap.Skip("it takes root to be two users")
    umask = int(re.search(r"(?m)^UMask=(\d+)$", (harness.TOP / "packaging/heave@.service.in").read_text(encoding="utf-8"))[1], 8)
    for path, mode in ((bench.folder, 0o755), (bench.kept, 0o750)):
        os.chown(path, HEAVED_UID, HEAVE_GID)
        path.chmod(mode)
    bench.config.chmod(0o644)
    bench.open_programs()
    os.chown(bench.state_folder, PANEL_UID, HEAVE_GID)
    bench.start(environment={"STATE_DIRECTORY": str(bench.kept)}, user=HEAVED_UID, group=HEAVE_GID, extra_groups=[], umask=umask)
    bench.start_panel(user=PANEL_UID, group=PANEL_UID, extra_groups=[HEAVE_GID], umask=0o077)
    harness.wait_for(lambda: bench.status()["state"] == "OFF", "heaved is up")
    with bench.link() as link:
        take(link)
        answer = request(link, "dump")["answer"]
        assert answer["ok"], answer
    name = Path(answer["folder"]).name
    assert (bench.kept / name).stat().st_uid == HEAVED_UID and (bench.kept / name / "frames").stat().st_mode & 0o777 == 0o640
    assert bench.get(f"/api/incident/ride/{name}/frames")[::2] == (200, (bench.kept / name / "frames").read_bytes())
    harness.wait_for(lambda: b'"request":"dump"' in bench.get("/api/log/ride")[2], "the log is written, a little later")
    bench.end_panel()
    bench.socket.chmod(0o666)  # as a socket to look in
    bench.web = free_port()
    os.chown(bench.state_folder, STRANGER_UID, STRANGER_UID)
    bench.start_panel(user=STRANGER_UID, group=STRANGER_UID, extra_groups=[])
    harness.wait_for(lambda: b"Permission denied" in bench.get(f"/api/incident/ride/{name}/frames")[2], "not of the group")
    assert bench.get("/api/log/ride")[0] == 404


def click(page, selector):
    page.wait(f"document.querySelector({json.dumps(selector)}) !== null", selector)
    page.run(f"document.querySelector({json.dumps(selector)}).click()")


def open_incident(page, name):
    click(page, "[data-tab=incidents]")
    click(page, f"[data-incident='{name}']")
    page.wait("document.getElementById('time-line') !== null", "the incident is open")


def incidents_in_a_browser(bench):
    """Time line, curves, picture at any speed, in three widths and two languages; what is shown is what the files say."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    names = make_incident(bench)
    trace = [line.split(",") for line in (bench.kept / names[0] / "trace.csv").read_text(encoding="ascii").splitlines()]
    fault_row = next(row for row in trace if row[1] == "FAULT")
    for width, height in ((390, 844), (820, 1180), (1920, 1080)):
        with Page(f"http://127.0.0.1:{bench.web}/", width, height) as page:
            page.wait("document.getElementById('state').textContent === 'FAULT'", "the state is shown")
            for language in ("en", "zh"):
                if language == "zh":
                    click(page, "#language")
                open_incident(page, names[0])
                time.sleep(0.3)
                for what, script in (("overflows", OVERFLOW), ("has no name", UNNAMED), ("is too small for a glove", SMALL)):
                    assert page.run(script) == [], (width, language, what, page.run(script))
                assert page.run("document.documentElement.scrollWidth") <= width
                page.picture(PICTURES / f"incident-{width}-{language}.png")
                page.run("document.getElementById('time-line').scrollIntoView()")
                page.picture(PICTURES / f"timeline-{width}-{language}.png")
            if width == 820:
                line = page.run("document.getElementById('time-line').innerText")
                for word in ("故障", "发送端", "127.0.0.1", "请求", "engage", "following-error"):
                    assert word in line, (word, line)
                at = page.run("Number(document.getElementById('replay-time').value)")
                assert abs(at - float(fault_row[0])) < 0.01, (at, fault_row[0])  # it opens where it went wrong
                shown = [float(value) for value in re.findall(r"■ \S+ (-?[\d.]+)", page.run("document.getElementById('replay-readings').innerText"))]
                assert any(abs(value - float(fault_row[5])) <= 0.00051 for value in shown), ("the values of that row", shown, fault_row)
                page.run("(() => { const s = document.getElementById('replay-time'); s.value = s.min; s.dispatchEvent(new Event('input')); })()")
                page.run("(() => { const s = [...document.querySelectorAll('select')].at(-1); s.value = '50'; s.dispatchEvent(new Event('change')); })()")
                click(page, "#replay-play")
                page.wait("document.getElementById('replay-time').value === document.getElementById('replay-time').max && document.getElementById('replay-play').textContent !== '暂停'", "it plays to its end")
                page.run("(() => { const s = document.querySelector('select'); s.value = 'cylinders'; s.dispatchEvent(new Event('change')); })()")
                page.wait("document.getElementById('replay-readings').innerText.includes('c6_actual_mm')", "what the drives told")
                click(page, "[data-tab=log]")
                page.wait("document.querySelector('main table') !== null && document.querySelector('main table').innerText.includes('dump')", "the log")
                page.run("(() => { const s = document.getElementById('log-find'); s.value = 'HOMING'; s.dispatchEvent(new Event('input')); })()")
                page.wait("document.querySelectorAll('main tbody tr').length === 1", "one row has that word")
            assert page.problems == [], page.problems


READ_INCIDENT = r"""import('/incident.js').then((incident) => {
  const trace = incident.readTable('t_ms,state,x_mm,flags\n1,OFF,0,before-zero\n2,HOMING,0,before-zero\n0,SETTLED,1,\n1,SETTLED,-7,\n2,FAULT,3,fault\n');
  const frames = incident.readFrames('; heaved 1, build b, configuration /x, 0123456789abcdef, incident-000001-20260101T000000Z\n; bus lost, axis 2, at 2 ms\n; 1.000 !engage\n; time zero: SETTLED\n0.5 !from 10.0.0.7\n0.6 @A6:1,2#\n0.7 @A6:1,2#\n1.000 !park\n2.000 !fault bus-lost\n3.0 !end\n', trace.before);
  const geometry = incident.readGeometry('[platform]\nkind = tripod\n[geometry]\nbase1_mm = 1, 2, 3\nbase2_mm = 4, 5, 6\nbase3_mm = 7, 8, 9\nplate1_mm = 1, 1, 1\nplate2_mm = 2, 2, 2\nplate3_mm = 3, 3, 3\nretracted_length_mm = 500\nstroke_mm = 100\nzero_height_mm = 540\nmrp_mm = 0, 0, 5\nas_measured = no\n');
  return { t: [...trace.t], states: incident.statesOf(trace), events: frames.events, hash: frames.hash, frames: frames.frames, cause: frames.head[1], geometry, none: incident.readGeometry('[platform]\nkind = hexapod\n'),
    rows: [-5, 0, 1.5, 99].map((t) => incident.rowAt(trace.t, t)), peaks: incident.envelope([0, 1, 2, 3, 4, 5], [0, 9, 0, -9, 1, 2], 0, 5, 2), gap: incident.envelope([0, 4], [1, 2], 0, 4, 4) };
})"""


def files_are_read_right(bench):
    """The front end's reading of an incident, from texts whose meaning is known."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 900) as page:
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        got = page.run(READ_INCIDENT)
    assert got["t"] == [-1, 0, 0, 1, 2] and got["rows"] == [0, 2, 3, 4], got
    assert [(run["state"], run["t"], run["until"]) for run in got["states"]] == [("OFF", -1, -1), ("HOMING", 0, 0), ("SETTLED", 0, 1), ("FAULT", 2, 2)], got["states"]
    assert [(one["t"], one["kind"], one["text"]) for one in got["events"]] == [(-1, "wasRequest", "engage"), (0.6, "fromSender", "10.0.0.7"), (1, "wasRequest", "park"), (2, "wasFault", "fault bus-lost")], got["events"]
    assert got["hash"] == "0123456789abcdef" and got["frames"] == 2 and got["cause"].startswith("bus lost, axis 2")
    assert got["geometry"]["base_mm"][2] == [7, 8, 9] and got["geometry"]["retracted_length_mm"] == [500] * 3 and got["none"] is None, got["geometry"]
    assert got["peaks"] == [[0, 9], [-9, 2]] and got["gap"] == [[1, 1], None, None, [2, 2]], got


def recorder_keeps_every_cycle(bench):
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    saved = bench.folder / "saved"
    saved.mkdir()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.do("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(saved))
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "shown")
        click(page, "[data-tab=live]")
        click(page, "#record")
        page.wait("document.getElementById('record').textContent.startsWith('Stop and save')", "it records")
        click(page, "[data-tab=operate]")  # and goes on while other pages are looked at
        time.sleep(2)
        click(page, "[data-tab=live]")
        click(page, "#record")
        harness.wait_for(lambda: [one for one in saved.iterdir() if one.suffix == ".csv"], "a file")
    text = next(saved.iterdir()).read_text(encoding="ascii").splitlines()
    names = text[0].split(",")
    cycles = [int(line.split(",")[0]) for line in text[1:]]
    assert len(names) == 32 and {"sent_z_mm", "actual_c6_mm", "state"} <= set(names) and all(len(line.split(",")) == 32 for line in text), names
    skipped = sum(after - before - 1 for before, after in zip(cycles, cycles[1:]))
    assert len(cycles) > 1500 and skipped < 500 and min(after - before for before, after in zip(cycles, cycles[1:])) >= 1, (len(cycles), skipped)


# --- Pages ---

PAGES = ("operate", "live", "service", "incidents", "log")
OVERFLOW = """[...document.querySelectorAll('button, h2, p, dd, td, th')].filter((one) => one.scrollWidth > one.clientWidth + 2 && one.clientWidth > 0 && getComputedStyle(one).display !== 'inline'
               && !one.closest('.scroll')).map((one) => one.textContent.slice(0, 40))"""
UNNAMED = "[...document.querySelectorAll('button, input, select, canvas')].filter((one) => !(one.textContent.trim() || one.ariaLabel || one.getAttribute('aria-label') || one.labels?.length)).map((one) => one.outerHTML)"
SMALL = "[...document.querySelectorAll('main button, footer button')].filter((one) => one.offsetHeight < 56 || one.offsetWidth < 56).map((one) => one.textContent)"


def pages_in_a_browser(bench):
    """Each page at three widths in both languages: nothing overflows, everything has a name, no error; then the buttons."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    bench.both()
    for width, height in ((390, 844), (820, 1180), (1920, 1080)):
        with Page(f"http://127.0.0.1:{bench.web}/", width, height) as page:
            page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
            for language in ("en", "zh"):
                if language == "zh":
                    page.run("document.getElementById('language').click()")
                    page.wait("document.getElementById('state').textContent === '关闭'", "in Chinese")
                for name in PAGES:
                    page.run(f"document.querySelector('[data-tab={name}]').click()")
                    page.wait(f"document.querySelector('[data-tab={name}]').getAttribute('aria-selected') === 'true' && document.querySelector('main section') !== null", name)
                    time.sleep(0.4)
                    for what, script in (("overflows", OVERFLOW), ("has no name", UNNAMED), ("is too small for a glove", SMALL)):
                        assert page.run(script) == [], (width, language, name, what, page.run(script))
                    assert page.run("document.documentElement.scrollWidth") <= width, (width, language, name, "is wider than the screen")
                    page.picture(PICTURES / f"{name}-{width}-{language}.png")
            assert page.problems == [], page.problems


EVERY_PAGE = (*PAGES, "configuration", "commission")
# [what is at its middle and corners but itself, the largest other button, itself: in square pixels, whether all of it is on the screen, whether it can be focused]
HOLD = """(() => { const h = document.getElementById('hold'), b = h.getBoundingClientRect(), area = (one) => { const r = one.getBoundingClientRect(); return r.width * r.height; };
  const spots = [[b.x + b.width / 2, b.y + b.height / 2], ...[12, b.width - 12].flatMap((x) => [12, b.height - 12].map((y) => [b.x + x, b.y + y]))];
  return { covered: spots.map(([x, y]) => document.elementFromPoint(x, y)).filter((one) => one !== h).map((one) => one?.outerHTML.slice(0, 80) ?? 'nothing'),
    largest: Math.max(...[...document.querySelectorAll('button, a.button')].filter((one) => one !== h).map(area)), own: area(h), high: b.height, isSeen: b.top >= 0 && b.left >= 0 && b.bottom <= innerHeight && b.right <= innerWidth, isReached: h.tabIndex === 0 && !h.disabled }; })()"""


def hold_is_there(bench):
    """Hold is the largest button, on every page and at every width, wherever the page is scrolled to and whatever it says; and the key holds from everywhere, out of fields too."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    looked = 0
    for width, height in ((390, 844), (820, 1180), (1920, 1080), (844, 390)):
        with Page(f"http://127.0.0.1:{bench.web}/", width, height) as page:
            page.wait("document.getElementById('state').textContent !== ''", "shown")
            for name in EVERY_PAGE:
                click(page, f"[data-tab={name}]")
                page.wait("document.querySelector('main section') !== null", name)
                for share in (0, 0.5, 1):
                    page.run(f"(() => {{ window.scrollTo(0, {share} * document.documentElement.scrollHeight); document.getElementById('said').classList.add('shown'); document.getElementById('said').textContent = 'a long sentence '.repeat(40); }})()")
                    found = page.run(HOLD)
                    assert found["covered"] == [] and found["isSeen"] and found["isReached"] and found["own"] > found["largest"] and found["high"] >= 92, (width, name, share, found)
                    looked += 1
                page.run("document.getElementById('said').classList.remove('shown')")
            assert page.problems == [], page.problems
    print(f"# figure Hold looked at {looked} times", flush=True)
    fields = {"operate": "#intensity", "live": "#level", "log": "#log-find", "configuration": "#config-text", "commission": "[data-step=signals]"}
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        for name in EVERY_PAGE:
            reach(bench, "ENGAGED")
            click(page, f"[data-tab={name}]")
            page.wait("document.querySelector('main section') !== null", name)
            if name in fields:
                page.wait(f"document.querySelector({json.dumps(fields[name])}) !== null", f"the field of {name}", 40)
                page.run(f"document.querySelector({json.dumps(fields[name])}).focus()")
            page.do("Input.dispatchKeyEvent", type="keyDown", key="Escape", code="Escape", windowsVirtualKeyCode=27)
            page.do("Input.dispatchKeyEvent", type="keyUp", key="Escape", code="Escape", windowsVirtualKeyCode=27)
            until(bench, "HOLD")
            assert bench.raw("resume")["ok"], name


COUNT_HOLDS = "(() => { const own = WebSocket.prototype.send; window.holds = 0; WebSocket.prototype.send = function (message) { window.holds += typeof message === 'string' && JSON.parse(message).line === 'hold'; own.call(this, message); }; })()"


def hold_acts_when_it_is_touched(bench):
    """A press, however it ends, is one hold, made when it begins: a finger that stays or slips, a mouse, keys, and the click of a screen reader."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.do("Emulation.setTouchEmulationEnabled", enabled=True)
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        page.run(COUNT_HOLDS)
        spot = page.run("(() => { const b = document.getElementById('hold').getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()")

        def touch(what, *points):
            return lambda: page.do("Input.dispatchTouchEvent", type=what, touchPoints=[{"x": x, "y": y} for x, y in points])

        def key(what, name, code, text):
            return lambda: page.do("Input.dispatchKeyEvent", type=what, key=name, code=name.strip() or "Space", windowsVirtualKeyCode=code, **({"text": text} if what == "keyDown" else {}))

        def slip():
            for step in range(1, 9):
                touch("touchMove", (spot[0], spot[1] - 40 * step))()
            touch("touchEnd")()

        tap_begins = touch("touchStart", spot)
        ways = {"a finger that is lifted": (tap_begins, touch("touchEnd"), 1), "a finger that slips": (tap_begins, slip, 1), "a finger that stays": (tap_begins, lambda: (time.sleep(2), touch("touchEnd")()), 1),
                "a touch that is taken away": (tap_begins, touch("touchCancel"), 1), "a mouse": (lambda: mouse(page, spot, "mousePressed"), lambda: mouse(page, spot, "mouseReleased"), 1),
                "the key Enter": (lambda: (page.run("document.getElementById('hold').focus()"), key("keyDown", "Enter", 13, "\r")()), key("keyUp", "Enter", 13, ""), 1),
                "the space bar": (lambda: (page.run("document.getElementById('hold').focus()"), key("keyDown", " ", 32, " ")()), key("keyUp", " ", 32, ""), 0),
                "a screen reader": (lambda: page.run("document.getElementById('hold').click()"), lambda: None, 1)}
        for way, (begin, end, at_once) in ways.items():
            reach(bench, "ENGAGED")
            page.run("window.holds = 0")
            begin()
            if at_once:
                until(bench, "HOLD")
            assert page.run("window.holds") == at_once, (way, page.run("window.holds"))
            end()
            until(bench, "HOLD")
            time.sleep(0.6)
            assert page.run("window.holds") == 1, (way, page.run("window.holds"))
            assert bench.raw("resume")["ok"], way
        assert page.problems == [], page.problems


def what_comes_late_is_not_done(bench):
    """A press that a stalled network delivers late starts nothing; what stops is never late."""
    bench.both()
    with bench.link() as link:
        take(link)

        def ask(line, age_ms):
            return link.ask({"op": "request", "platform": "ride", "line": line, "seen": bench.raw("status")["time_unix_ms"] - age_ms})

        for line in ("engage", "resume", "park", "reset", "service", "torque all on", "intensity 100"):
            assert ask(line, 3000)["error"] == "this came too late to be done: try again", line
        for line in ("hold", "torque all off", "geometry", "status"):
            assert "answer" in ask(line, 1e9), line
        assert state_of(bench) == "OFF" and ask("engage", 1000)["answer"]["ok"] is True
        until(bench, "NEUTRAL", "ENGAGED", "HOLD")
        assert ask("hold", 1e9)["answer"]["ok"] is True
        until(bench, "HOLD")
    if web_socket.browser() is None:
        return
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent === 'HOLD'", "the state is shown")
        click(page, "[data-op=take]")
        page.wait("document.querySelector('[data-op=drop]') !== null", "has the controls")
        page.run("(() => { const own = WebSocket.prototype.send; window.restore = () => { WebSocket.prototype.send = own; }; WebSocket.prototype.send = function (message) { setTimeout(() => own.call(this, message), 4000); }; })()")
        click(page, "[data-request=resume]")
        page.wait("document.getElementById('said').textContent.includes('too late')", "it says why")
        assert state_of(bench) == "HOLD"
        page.run("restore()")
        click(page, "[data-request=resume]")
        until(bench, "RISING", "NEUTRAL", "ENGAGED")
        assert page.problems == [], page.problems


def a_page_stays_that_one(bench):
    """Who goes on to another page before heaved has answered the first one stays there."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    daemon = bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "shown")
        page.run("import('/commission.js')")
        page.run("(() => { const own = WebSocket.prototype.send; window.lines = []; WebSocket.prototype.send = function (message) { window.lines.push(JSON.parse(message).line); own.call(this, message); }; })()")
        with standing_still(daemon):
            click(page, "[data-tab=commission]")
            page.wait("window.lines.includes('selftest')", "it asks", 10)
            click(page, "[data-tab=service]")
        page.wait("document.querySelector('.jog') !== null", "the page Service")
        time.sleep(1)
        assert page.run("document.querySelector('.jog') !== null && document.querySelector('[data-step]') === null"), "Commission has replaced it"
        assert page.problems == [], page.problems


def mouse(page, spot, what):
    page.do("Input.dispatchMouseEvent", type=what, x=spot[0], y=spot[1], button="left", clickCount=1)


def hold_until(page, spot, condition):
    """Presses and keeps pressing. A browser that hangs for a quarter of a second beside load has let go, which is right: then once more."""
    for _ in range(12):
        mouse(page, spot, "mousePressed")
        end = time.monotonic() + 4
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.05)
        mouse(page, spot, "mouseReleased")
        time.sleep(0.5)
    raise AssertionError("the held button does nothing")


def buttons_in_a_browser(bench):
    """A person takes the controls, starts, holds by the button and by the key, sees a fault with its remedy; jogs by a held button, and the tab goes away."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        click(page, "[data-request=engage]")
        page.wait("document.getElementById('said').textContent.includes('take the controls first')", "a refusal says why")
        click(page, "[data-op=take]")
        page.wait("document.querySelector('[data-op=drop]') !== null", "has the controls")
        click(page, "[data-request=engage]")
        bench.wait_state("HOMING", "RISING")
        click(page, "#hold")
        bench.wait_state("HOLD")
        click(page, "[data-request=resume]")
        bench.wait_state("RISING", "NEUTRAL", "ENGAGED")
        page.do("Input.dispatchKeyEvent", type="keyDown", key="Escape", code="Escape", windowsVirtualKeyCode=27)
        bench.wait_state("HOLD")
        page.wait("document.getElementById('state').textContent === 'HOLD'", "hold is shown")
        click(page, "[data-request=park]")
        bench.wait_state("SETTLED")
        joints = page.run("import('/space.js').then(async (space) => { const link = await (await fetch('/api/me')).json(); return link.platforms.length; })")
        assert joints == 1
        click(page, "[data-tab=service]")
        click(page, "[data-request='service']")
        bench.wait_state("SERVICE")
        click(page, "[data-request='torque all on']")
        harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")
        spot = page.run("(() => { const r = document.querySelector('[aria-label=\"2 +\"]'); r.scrollIntoView({block: 'center'}); const b = r.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        before = bench.status()["cylinders"][1]["sent_mm"]
        hold_until(page, spot, lambda: bench.status()["cylinders"][1]["sent_mm"] > before + 0.5)
        mouse(page, spot, "mouseReleased")
        time.sleep(STOP_S)
        assert moved(bench, 0.4) < 1e-6, "let go"
        hold_until(page, spot, lambda: bench.raw("tick")["held"])
        page.kill(signal.SIGSTOP)
        time.sleep(STOP_S + 0.3)
        assert moved(bench, 0.4) < 1e-6, "the browser stands still in the middle of a jog"
        page.kill(signal.SIGCONT)
        assert moved(bench, 0.6) < 1e-6, "what it did late moves it"
        mouse(page, spot, "mouseReleased")
        hold_until(page, spot, lambda: bench.raw("tick")["held"])
        page.kill()
        time.sleep(STOP_S + 0.3)
        assert moved(bench, 0.4) < 1e-6, "the browser died in the middle of a jog"


def more_buttons_in_a_browser(bench):
    """Those that a ride needs less often: intensity, reset, home all, torque off, leave service."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        click(page, "[data-op=take]")
        page.wait("document.querySelector('[data-op=drop]') !== null", "has the controls")
        page.run("(() => { const i = document.getElementById('intensity'); i.focus(); i.value = '40'; i.nextElementSibling.click(); })()")
        harness.wait_for(lambda: bench.raw("status")["intensity"]["percent"] == 40, "the intensity is set")
        reach(bench, "FAULT")
        page.wait("document.querySelector('.fault')?.textContent.includes('does not follow') ?? false", "the fault is shown with its remedy")
        bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("following_error_mm = 0.01\n", ""), encoding="utf-8")
        bench.running[-1].send_signal(signal.SIGHUP)
        harness.wait_for(lambda: click(page, "[data-request=reset]") or bench.raw("status")["fault"]["code"] == 0, "the fault is reset")
        page.wait("document.querySelector('.fault') === null", "and is not shown any more")
        click(page, "[data-tab=service]")
        click(page, "[data-request='service']")
        bench.wait_state("SERVICE")
        click(page, "[data-request='torque all on']")
        harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")
        spot = page.run("(() => { const all = [...document.querySelectorAll('#page button')].find((one) => one.getAttribute('aria-label')?.startsWith('Home all')); all.scrollIntoView({block: 'center'}); const b = all.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        hold_until(page, spot, lambda: bench.raw("tick")["held"])
        mouse(page, spot, "mouseReleased")
        harness.wait_for(lambda: bench.raw("status")["service"]["doing"] == "nothing", "homing has ended")
        click(page, "[data-request='torque all off']")
        harness.wait_for(lambda: not any(one["torque"] for one in bench.raw("counts")["drives"]), "no torque")
        click(page, "[data-request='service-off']")
        bench.wait_state("OFF")


def several_platforms(bench):
    """One heaved is there, the other is not: both are on the wall, and one is chosen after the other."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 1920, 1080) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the first is shown")
        page.run("document.querySelector('[data-tab=wall]').click()")
        page.wait("document.getElementById('page').innerText.includes('ride') && document.getElementById('page').innerText.includes('heaved is not running')", "both are on the wall")
        PICTURES.mkdir(parents=True, exist_ok=True)
        page.picture(PICTURES / "wall-1920-en.png")
        page.run("document.querySelector('[data-tab=operate]').click()")
        page.run("document.querySelector('[data-platform=other]').click()")
        page.wait("document.getElementById('state').textContent === 'heaved is not running'", "the other is shown")
        page.run("document.querySelector('[data-platform=ride]').click()")
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the first is shown again")
        assert page.problems == [], page.problems


def nobody_is_left_out(bench):
    """axe-core, on every page, an open incident and the login, in both languages, light and dark: no serious fault."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    found = subprocess.run([harness.TOP / "tools/lib/axe.sh"], capture_output=True, text=True, check=False)
    if found.returncode != 0:
        raise tap.Skip(found.stderr.strip())
    axe = Path(found.stdout.strip()).read_text(encoding="utf-8")
    names = make_incident(bench)
    faults = []

    def look(page, what):
        time.sleep(0.3)
        page.run("(async () => { await Promise.all(document.getAnimations().map((one) => one.finished)); })()")
        for one in page.run("axe.run(document, {resultTypes: ['violations']}).then((r) => r.violations.filter((v) => ['serious', 'critical'].includes(v.impact)).map((v) => [v.id, v.nodes.map((n) => n.html.slice(0, 120) + ' ' + (n.any[0]?.message ?? '')).slice(0, 3)]))"):
            faults.append((what, one))

    for width, scheme in ((390, "light"), (1920, "dark")):
        with Page(f"http://127.0.0.1:{bench.web}/", width, 1080) as page:
            page.do("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            page.wait("document.getElementById('state').textContent !== ''", "shown")
            page.run(axe + "; true")
            for language in ("en", "zh"):
                if language == "zh":
                    click(page, "#language")
                for name in PAGES:
                    click(page, f"[data-tab={name}]")
                    page.wait("document.querySelector('main section') !== null", name)
                    look(page, (width, scheme, language, name))
                open_incident(page, names[0])
                look(page, (width, scheme, language, "an incident"))
    assert not faults, "\n".join(map(str, faults))


def ripple_is_found(bench):
    """A ripple of 37 Hz in samples, by the spectrum that the page shows."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 900) as page:
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        script = """import('/curves.js').then((c) => { const v = []; for (let i = 0; i < 4000; i++) v.push(20 * i / 4000 + 0.05 * Math.sin(2 * Math.PI * 37 * i / 1000) + 0.02 * Math.sin(2 * Math.PI * 60 * i / 1000));
                    const s = c.spectrum(v, 1000).filter(([hz]) => hz > 5); return c.strongest(s); })"""
        assert page.run(TRIGGER) == [True, 1234, 1734, 300, 1]
        hz, amplitude = page.run(script)
        assert abs(hz - 37) < 0.5 and 0.04 < amplitude < 0.06, (hz, amplitude)
        lengths = page.run("""import('/space.js').then((space) => space.extensions({mrp_mm: [0, 0, 50], zero_height_mm: 500, base_mm: [[400, -60, 0]], plate_mm: [[190, -230, -10]], retracted_length_mm: [520]},
                              {roll_deg: 5, pitch_deg: -4, yaw_deg: 10, x_mm: 7, y_mm: -3, z_mm: 20}))""")
        point = turn((190, -230, -60), 5, -4, 10)
        expected = math.dist((point[0] + 7, point[1] - 3, point[2] + 50 + 520), (400, -60, 0)) - 520
        assert abs(lengths[0] - expected) < 1e-9, (lengths, expected)


def ripple_of_the_machine(bench):
    """A ripple of 37 Hz that heaved makes, in the samples of a running machine: the page names it; the trigger finds a level; two marks measure a period."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    bench.both()
    reach(bench, "SETTLED")
    bench.raw("engage")
    until(bench, "ENGAGED", "NEUTRAL")
    bench.raw("park")
    until(bench, "SETTLED")
    bench.raw("service")
    until(bench, "SERVICE")
    bench.raw("torque all on")
    stop = threading.Event()
    with harness.Line(bench.socket) as line, Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent.startsWith('SERVICE')", "shown")
        click(page, "[data-tab=live]")
        answer = line.ask(f"jog z 4 40 {line.ask('tick')['tick']}")  # away from the ends
        assert answer["ok"], answer
        counter = 0
        while line.ask("tick")["held"]:
            counter += 1
            answer = line.ask(f"beat {answer['series']} {counter} {line.ask('tick')['tick']}") | {"series": answer["series"]}
            time.sleep(0.05)

        def hold():
            """On a machine that is busy a beat may come too late; heaved lets go then, and this hand presses again."""
            answer, counter = {}, 0
            while not stop.is_set():
                tick = line.ask("tick")
                if tick["held"] and answer.get("ok"):
                    counter += 1
                    line.ask(f"beat {answer['series']} {counter} {tick['tick']}")
                    time.sleep(0.05)
                else:
                    answer, counter = line.ask(f"signal x sine 0.03 37 40 {tick['tick']}"), 0

        holding = threading.Thread(target=hold)
        holding.start()
        try:
            page.wait("Math.abs(parseFloat((/([0-9.]+) Hz/.exec(document.getElementById('peak').textContent) || [])[1]) - 37) < 0.5", "a line of the spectrum at 37 Hz", 60)
            hz = float(re.search(r"([0-9.]+) Hz", page.run("document.getElementById('peak').textContent"))[1])
            for _ in range(2):
                click(page, "#zoom-in")  # 10 s, 5 s, 2.5 s
            amplitude = float(re.search(r"Hz, ([0-9.]+)", page.run("document.getElementById('peak').textContent"))[1])
            page.run(f"document.getElementById('level').value = {amplitude / 2}")
            click(page, "#trigger")
            page.wait("document.getElementById('pause').getAttribute('aria-pressed') === 'true'", "it was triggered")
            for share in (0.4, 0.8):
                spot = page.run(f"(() => {{ const c = document.querySelector('canvas'); c.scrollIntoView({{block: 'center'}}); const b = c.getBoundingClientRect(); return [b.x + b.width * {share}, b.y + 60]; }})()")
                mouse(page, spot, "mousePressed")
                mouse(page, spot, "mouseReleased")
            page.wait("document.getElementById('between') !== null", "two marks measure")
            ms = float(re.search(r"([0-9.]+) ms", page.run("document.getElementById('between').textContent"))[1])
            width = page.run("document.querySelector('canvas').clientWidth")
            assert abs(ms - 2500 * 0.4 * width / (width - 62)) < 20, ms
            for _ in range(6):
                click(page, "#zoom-in")
            page.wait("document.getElementById('page').innerText.includes('39 ms')", "what stands still is looked at closely")
            assert page.run("document.querySelector('#page canvas').clientWidth") == width
            page.picture(PICTURES / "zoomed-820-en.png")
            for _ in range(6):
                click(page, "#zoom-out")
            page.picture(PICTURES / "scope-820-en.png")
            print(f"# figure a ripple of 37 Hz of {amplitude} mm is named {hz} Hz", flush=True)
        finally:
            stop.set()
            holding.join()
        assert page.problems == [], page.problems


TRIGGER = """import('/curves.js').then(({ Curves }) => {
  const canvas = document.createElement('canvas'), c = new Curves(canvas);
  c.spanS = 1; c.begin([{name: 't_ms', unit: 'ms'}, {name: 'x', unit: 'mm'}], 1000); c.arm(0.5);
  for (let k = 0; k < 40; k++) c.take({ lost: 0, rows: 100, columns: [Float64Array.from({length: 100}, (_, i) => 100 * k + i), Float64Array.from({length: 100}, (_, i) => 100 * k + i >= 1234 ? 1 : 0)] });
  c.mark(1000); c.mark(1300);
  return [c.isPaused, c.metAt, c.newest, c.between().ms, c.between().values[0]];
})"""


SEEN = "document.querySelector('.view').view"
CORNERS = """(() => { const view = document.querySelector('.view').view, gl = view.canvas.getContext('webgl2'); view.paint(); const w = gl.drawingBufferWidth, h = gl.drawingBufferHeight, p = new Uint8Array(4 * w * h);
  gl.readPixels(0, 0, w, h, gl.RGBA, gl.UNSIGNED_BYTE, p); const n = new Map(); for (let i = 0; i < p.length; i += 4) { const k = (p[i] >> 4) * 256 + (p[i + 1] >> 4) * 16 + (p[i + 2] >> 4); n.set(k, (n.get(k) ?? 0) + 1); }
  return [n.size, Math.max(...n.values()) / (w * h)]; })()"""


def run_steadily(page, script):
    """What a page says; beside load it may have lost its connection, and comes back with a new picture."""
    for _ in range(5):
        page.wait(f"(() => {{ document.querySelector('.view .in-3d')?.click(); return true; }})() && document.querySelector('.view') !== null && {SEEN}.drawer.joints !== undefined && {SEEN}.drawn > 0", "the picture in WebGL", 180)
        with contextlib.suppress(AssertionError):
            return page.run(script)
    return page.run(script)


def go_on(bench, frame, stop):
    """Holds a pose: a sender that goes on, and an operator who resumes where a busy machine was held."""
    with bench.sender() as sender:
        while not stop.is_set():
            if bench.raw("status")["state"] == "HOLD":
                bench.raw("resume")
            sender.send(frame)
            stop.wait(0.1)


def is_at_rest(bench):
    before = bench.status()["pose_actual"]
    time.sleep(0.5)
    return all(abs(value - before[axis]) < 1e-3 for axis, value in bench.status()["pose_actual"].items())


def scene_is_that_of_the_kinematics(bench):
    """In WebGL: joints where heaved's own extensions and the tests' own mathematics have them, on each kind of mechanism; the picture is no empty one; it waits while a button is held."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    if not (WWW / "scene.js").exists():
        raise tap.Skip("built without its 3D part: npm is not there")
    PICTURES.mkdir(parents=True, exist_ok=True)
    worst = 0.0
    for kind, base, frame in (("hexapod", None, "@A6:3,-2,4,10,-5,12#"), ("tripod", "tripod.ini", "@A3:3,-2,12#"), ("3rps", "tripod-rotation.ini", "@A3:6,-5,20#")):
        with PanelBench() as one, contextlib.ExitStack() as stack:
            if base is not None:
                text = re.sub(r"(?m)^port = \d+", f"port = {one.port}", (harness.TOP / "config" / base).read_text(encoding="utf-8"))
                one.config.write_text(f"{text}\n[control]\nsocket = {one.socket}\n", encoding="utf-8")
            daemon = one.both()
            assert one.raw("engage")["ok"]
            one.wait_state("NEUTRAL", "ENGAGED", "HOLD")
            stop = threading.Event()
            going = threading.Thread(target=go_on, args=(one, frame, stop))
            going.start()
            stack.callback(going.join)
            stack.callback(stop.set)
            harness.wait_for(lambda one=one: max(abs(value) for value in one.status()["pose_actual"].values()) > 2 and is_at_rest(one), f"{kind} stands in the pose")
            geometry, status = one.raw("geometry"), one.status()
            with Page(f"http://127.0.0.1:{one.web}/", 820, 1180) as page:
                joints, extensions = run_steadily(page, f"(() => {{ const view = {SEEN}; view.paint(); return [view.drawer.joints(), view.drawer.extensions()]; }})()")
                pose = status["pose_actual"] or status["pose_sent"]
                mrp = geometry["mrp_mm"]
                assert max(abs(value) for value in pose.values()) > 2, pose
                for k, cylinder in enumerate(status["cylinders"]):
                    point = turn([p - m for p, m in zip(geometry["plate_mm"][k], mrp)], pose["roll_deg"], pose["pitch_deg"], pose["yaw_deg"])
                    place = [m + pose[f"{axis}_mm"] + value + (geometry["zero_height_mm"] if axis == "z" else 0) for m, axis, value in zip(mrp, "xyz", point)]
                    off = max(math.dist(place, joints[k]), abs(extensions[k] - cylinder["actual_mm"]))
                    assert off < 0.1, (kind, k, place, joints[k], extensions[k], cylinder)
                    worst = max(worst, off)
                shades, emptiest = run_steadily(page, CORNERS)
                assert shades > 20 and 0.3 < emptiest < 0.97, (shades, emptiest)
                page.picture(PICTURES / f"scene-{kind}-820.png")
                if kind == "hexapod":
                    waits = f"(() => {{ const view = {SEEN}, own = window.setTimeout; let asked; window.setTimeout = (act, ms) => {{ asked = ms; return own(act, ms); }}; clearTimeout(view.timer); view.timer = null; view.drawn = performance.now(); view.later(); window.setTimeout = own; return asked; }})()"
                    free = run_steadily(page, waits)
                    page.run("(async () => { const { Hand } = await import('/hand.js'); window.held = new Hand({ ask: async () => ({ answer: { ok: true, series: 1, tick: 1 } }), send() {} }, 'x', () => {}); await held.press('jog'); })()")
                    held = run_steadily(page, waits)
                    page.run("held.end()")
                    assert free < 260 and held > 400, (free, held)
                    run_steadily(page, SEEN + ".drawer.renderer.forceContextLoss()")
                    page.wait(f"{SEEN}.drawer.joints === undefined && document.querySelector('.view p').textContent.includes('WebGL')", "a flat picture when the graphics are lost")
                assert page.problems == [], page.problems
            stop.set()
            going.join()
            assert one.stop(daemon) == 0
    print(f"# figure joints in the scene are at most {worst:.6f} mm away", flush=True)


def without_webgl(bench):
    """A browser that has none, and a panel that was built without npm: a flat picture, one sentence, and everything else as ever."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    drawn = "(() => { const c = document.querySelector('.view canvas'), p = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let n = 0; for (let i = 3; i < p.length; i += 4) n += p[i] > 0; return n; })()"

    def look(page, words):
        page.wait("document.querySelector('.view p') !== null && !document.querySelector('.view p').hidden", "it says why")
        assert words in page.run("document.querySelector('.view p').textContent")
        time.sleep(0.5)
        assert page.run(drawn) > 1000, "the flat picture is empty"
        page.run("document.querySelector('[data-tab=live]').click()")
        page.wait("document.querySelector('svg.states') !== null && document.querySelectorAll('.chip').length === 6", "curves and states are there")
        return page.problems

    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180, more=("--disable-3d-apis",)) as page:
        assert look(page, "no WebGL") == []
    bench.end_panel()
    bare = bench.folder / "bare"
    shutil.copytree(WWW, bare, ignore=shutil.ignore_patterns("scene.js"))
    bench.start_panel("--www", bare)
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        assert all("404" in one for one in look(page, "without its 3D part"))
        assert page.run("document.querySelector('.view .in-3d')") is None, "a button that leads nowhere"


def every_text_has_two_languages(bench):
    texts = (harness.TOP / "panel/text.js").read_text(encoding="utf-8")
    known = dict(re.findall(r"(\w+): \[(\"(?:[^\"\\]|\\.)*\", \"(?:[^\"\\]|\\.)*\")\]", texts))
    used = set()
    for path in (harness.TOP / "panel").glob("*.js"):
        used |= set(re.findall(r"\bt\(\"(\w+)\"\)", path.read_text(encoding="utf-8")))
    assert used and used <= set(known), used - set(known)
    for name, pair in known.items():
        english, chinese = json.loads(f"[{pair}]")
        assert english and chinese and english != chinese and (name == "language" or re.search(r"[\u4e00-\u9fff]", chinese)), name


def first_page_is_small(bench):
    """What the first page loads, as it goes over the network; what a browser asks for, and what it asks for only later."""
    bench.both()
    wanted, total = ["/", "/style.css", "/icon.svg"], 0
    for path in wanted:
        code, headers, text = bench.get(path, Accept_Encoding="br, gzip;q=0.8")
        assert code == 200 and headers.get("vary") == "accept-encoding" and len(text) == int(headers["content-length"]), (path, headers)
        total += len(text)
        if headers.get("content-encoding") == "gzip":
            text = gzip.decompress(text)
        assert text == bench.get(path)[2] and "content-encoding" not in bench.get(path)[1], path
        assert "content-encoding" not in bench.get(path, Accept_Encoding="gzip;q=0, br")[1], path
        wanted += [one for one in re.findall(r'(?:from|src=)\s*"(/[\w.]+)"', text.decode()) if one not in wanted]
    assert "/app.js" in wanted and "/incidents.js" not in wanted, wanted
    print(f"# figure {total} bytes of the first page, compressed: {len(wanted)} files", flush=True)
    assert total < 60000, total


CASES = [("a request is answered as heaved answers it", answers_as_heaved_does, {}), ("a refusal is told in both languages", refuses_in_chinese, {}), ("every request in every state by every role", answers_in_every_state, {"passwords": LEVELS}), ("geometry is that of the kinematics", geometry_is_that_of_the_kinematics, {}),
         ("samples are every cycle, or least and most of so many", samples_are_every_cycle, {}), ("heaved and panel come and go", comes_back, {}),
         ("the panel gives way to other clients and comes back", gives_way_and_comes_back, {}),
         ("motion is the same to the byte with a panel that hangs, dies or is flooded", motion_does_not_know_it, {}),
         ("strangers, foreign pages and broken messages", strangers, {}), ("passwords, roles and sessions", passwords_and_roles, {"passwords": ("look", "operate", "service")}),
         ("nobody keeps hold away", nobody_keeps_hold_away, {"passwords": ("look",)}), ("nobody keeps ticks away", nobody_keeps_ticks_away, {"passwords": ("look", "operate")}),
         ("nobody keeps test signals away", nobody_keeps_test_signals_away, {}),
         ("a session over a WebSocket", sessions_over_a_web_socket, {"passwords": ("look", "service")}), ("ten thousand logins", ten_thousand_logins, {"passwords": ("operate", "service")}),
         ("broken and huge messages", broken_messages, {}), ("HTML is text", html_is_text, {}), ("nothing waits for a disk", nothing_waits_for_a_disk, {}), ("over TLS", over_tls, {"passwords": ("service",)}),
         ("wrong use is named", bad_use, {}), ("a hand that is gone moves nothing", a_hand_that_is_gone, {}), ("every text has two languages", every_text_has_two_languages, {}), ("the first page is small", first_page_is_small, {}),
         ("incidents and the log of operators are handed over, and nothing else", incidents_are_handed_over, {}),
         ("users and groups as in the units", rights_are_as_in_the_units, {}), ("who may read what was written", files_by_role, {"passwords": ("look", "operate", "service")}), ("an incident in a browser", incidents_in_a_browser, {}),
         ("the files of an incident are read right", files_are_read_right, {}), ("the recorder keeps every cycle", recorder_keeps_every_cycle, {}),
         ("pages in a browser: three widths, two languages", pages_in_a_browser, {}), ("Hold is the largest, and always there", hold_is_there, {}), ("Hold acts when it is touched", hold_acts_when_it_is_touched, {}), ("what comes late is not done", what_comes_late_is_not_done, {}), ("a page stays that one", a_page_stays_that_one, {}), ("buttons in a browser", buttons_in_a_browser, {}), ("more buttons in a browser", more_buttons_in_a_browser, {}),
         ("axe-core finds no serious fault", nobody_is_left_out, {}), ("several platforms on a wall", several_platforms, {"more": ("--platform", "other=/nonexistent/heaved.sock")}), ("the spectrum finds a ripple; joints are where they are", ripple_is_found, {}),
         ("the platform in WebGL", scene_is_that_of_the_kinematics, {}), ("without WebGL: a flat picture", without_webgl, {}),
         ("the scope finds a ripple of the machine", ripple_of_the_machine, {})]


def main():
    suite = tap.Suite()
    for name, case, options in CASES:
        if len(sys.argv) > 3 and not re.search(sys.argv[3], name):
            continue
        with suite.case(name), PanelBench(**options) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
