#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel.py BIN [PART OF A NAME] - heave-panel in front of a heaved on simulated drives, on virtual time: what it serves, whom it lets in, what happens to a hand that is
not there any more. Its pages: test_panel_pages.py."""
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
from web_socket import Refused, WebSocket

BIN = Path(sys.argv[1])
STOP_S = 0.25 + 0.4  # without a beat, and the way to rest at jog speed
WWW = BIN.parent / "www"  # the pages, and their picture in WebGL
PASSWORD = "a long enough one"


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def make_certificate(folder):
    """(certificate, key) of 127.0.0.1, by openssl."""
    certificate, key = folder / "cert.pem", folder / "key.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj", "/CN=ride", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout", key, "-out",
                    certificate], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return certificate, key


def trusting(certificate):
    """More arguments of a Page: Chromium takes this certificate."""
    public = subprocess.run(f"openssl x509 -in {certificate} -pubkey -noout | openssl pkey -pubin -outform der | openssl dgst -sha256 -binary | base64", shell=True, capture_output=True, text=True, check=True).stdout.strip()
    return (f"--ignore-certificate-errors-spki-list={public}",)


def enter_password(page):
    page.wait("document.getElementById('password') !== null", "it asks who it is")
    page.run("document.getElementById('role').value = 'service'")
    page.run(f"document.getElementById('password').value = '{PASSWORD} service'")
    page.run("document.querySelector('form button').click()")
    page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")


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
        if self.panel is not None:
            if self.panel.poll() is None:
                self.panel.send_signal(how)
            if -self.panel.wait(20) in harness.CRASHES:
                raise tap.Fault(f"heave-panel has crashed, exit code {self.panel.returncode}: {self.panel_log.read_text(errors='replace')}")
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
        for line in ("watch", "by anna", "samples", "beat 1 1 1", "jog 1 1 1", "hold\nengage", "", "x" * 64, "heard 1 status", "heard 1 engage", " engage", " watch", " heard 1 watch"):
            assert "error" in request(link, line), line
        for message in ({"op": "status"}, {"op": "explode", "platform": "ride"}, {"platform": "ride"}, {"op": "request", "platform": "none", "line": "hold"}):
            assert "error" in link.ask(message), message


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


def nothing_old_goes_through(bench):
    """What a page asked while the panel or heaved stood still is not done later, and what only makes it safer is."""
    daemon = bench.both()
    with bench.link() as link:
        take(link)

        def in_a_stop(process, line, seconds, **more):
            with standing_still(process):
                link.send({"op": "request", "platform": "ride", "line": line, "id": 77, **more})
                time.sleep(seconds)
            return link.receive(lambda message: message.get("id") == 77)["answer"]

        harness.wait_for(lambda: bench.raw("tick")["tick"] > 2000000, "heaved has run for 2 s")
        for seconds in (1.1, 20):
            for line in ("engage", "service"):
                answer = in_a_stop(bench.panel, line, seconds, tick=bench.raw("tick")["tick"])
                assert answer.get("why") == "stale", ("panel", line, seconds, answer)
                for more in ({}, {"tick": bench.raw("tick")["tick"]}):
                    answer = in_a_stop(daemon, line, seconds, **more)
                    assert answer.get("why") == "stale", ("heaved", line, seconds, more, answer)
            assert in_a_stop(bench.panel, "hold", seconds, tick=0)["ok"] is not None
        assert state_of(bench) == "OFF"
        assert in_a_stop(bench.panel, "engage", 0.5, tick=bench.raw("tick")["tick"])["ok"] is True
        until(bench, "RISING", "NEUTRAL", "ENGAGED")
        assert in_a_stop(daemon, "hold", 20, tick=0)["ok"] is True
        until(bench, "HOLD")


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
                word = line.decode().split()[2 if line.startswith(b"heard ") else 0]
                answers = {"geometry": self.geometry, "incidents": {"ok": True, "incidents": [{"name": f"incident-000001-{HTML}", "dump": False, "seen": False}]}}
                answer = answers.get(word, {"ok": False, "error": HTML})
                while word == "watch":
                    link.sendall(json.dumps(self.status, separators=(",", ":")).encode() + b"\n")
                    time.sleep(0.1)
                link.sendall(json.dumps(answer, separators=(",", ":")).encode() + b"\n")


class SlowDisk(FalseHeaved):
    """A heaved that does not come to an end with what goes to a disk, to a bus or to drives that lead back, and answers the requests of a connection one after the other."""

    def serve(self, link):
        with contextlib.suppress(OSError), link, link.makefile("rb") as lines:
            for line in lines:
                word = line.decode().split()[0]
                while word == "watch":
                    link.sendall(json.dumps(self.status, separators=(",", ":")).encode() + b"\n")
                    time.sleep(0.1)
                if word in ("dump", "sdo", "reset"):
                    time.sleep(3600)
                link.sendall(b'{"ok":true}\n')


def nothing_waits_for_a_disk(bench):
    """While heaved writes an incident, asks a bus or resets, everything else is answered."""
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
        for number, line in enumerate(("dump", "sdo read 1 1000 0", "reset")):
            link.send({"op": "request", "platform": "ride", "line": line, "id": 1000 + number})
        for line in ("engage", "park", "torque all off", "hold", "geometry"):
            link.send({"op": "request", "platform": "ride", "line": line, "id": 1})
            assert link.receive(lambda message: message.get("id") in (1, 1000, 1001, 1002), 10) == {"id": 1, "answer": {"ok": True}}, line


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
    answer = link.ask({"op": "press", "platform": "ride", "line": f"jog 2 {speed}", "tick": tick})["answer"]
    assert answer["ok"], answer
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
            series, counter, tick = jog(link, 0.6, 3 if start < 60 else -3)
            assert abs(bench.status()["cylinders"][1]["sent_mm"] - start) > 0.3, f"{way}: it has not moved"
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
    for path, roles in ((f"/api/incident/ride/{names[0]}/frames", {"look", "operate", "service"}), (f"/api/incident/ride/{names[0]}/platform.ini", {"look", "operate", "service"}),
                        ("/api/config/ride", {"look", "operate", "service"}), ("/api/log/ride", {"operate", "service"})):
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
        wanted += [f"/{one}" for one in re.findall(r'(?:from|src=)\s*"(?:\./)?([\w.]+)"', text.decode()) if f"/{one}" not in wanted]
    assert "/app.js" in wanted and "/incidents.js" not in wanted, wanted
    print(f"# figure {total} bytes of the first page, compressed: {len(wanted)} files", flush=True)
    assert total < 60000, total


CASES = [
    ("a request is answered as heaved answers it", answers_as_heaved_does, {}),
    ("every request in every state by every role", answers_in_every_state, {"passwords": LEVELS}),
    ("geometry is that of the kinematics", geometry_is_that_of_the_kinematics, {}),
    ("samples are every cycle, or least and most of so many", samples_are_every_cycle, {}),
    ("heaved and panel come and go", comes_back, {}),
    ("the panel gives way to other clients and comes back", gives_way_and_comes_back, {}),
    ("motion is the same to the byte with a panel that hangs, dies or is flooded", motion_does_not_know_it, {}),
    ("strangers, foreign pages and broken messages", strangers, {}),
    ("passwords, roles and sessions", passwords_and_roles, {"passwords": ("look", "operate", "service")}),
    ("nobody keeps hold away", nobody_keeps_hold_away, {"passwords": ("look",)}),
    ("nothing old goes through", nothing_old_goes_through, {}),
    ("nobody keeps test signals away", nobody_keeps_test_signals_away, {}),
    ("a session over a WebSocket", sessions_over_a_web_socket, {"passwords": ("look", "service")}),
    ("ten thousand logins", ten_thousand_logins, {"passwords": ("operate", "service")}),
    ("broken and huge messages", broken_messages, {}),
    ("nothing waits for a disk", nothing_waits_for_a_disk, {}),
    ("wrong use is named", bad_use, {}),
    ("a hand that is gone moves nothing", a_hand_that_is_gone, {}),
    ("every text has two languages", every_text_has_two_languages, {}),
    ("the first page is small", first_page_is_small, {}),
    ("incidents and the log of operators are handed over, and nothing else", incidents_are_handed_over, {}),
    ("who may read what was written", files_by_role, {"passwords": ("look", "operate", "service")}),
]


def main():
    suite = tap.Suite()
    for name, case, options in CASES:
        if len(sys.argv) > 2 and not re.search(sys.argv[2], name):
            continue
        with suite.case(name), PanelBench(**options) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
