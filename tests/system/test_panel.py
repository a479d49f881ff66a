#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel.py BIN PICTURES [PART OF A NAME] - heave-panel in front of a heaved on simulated drives: what it serves, whom it lets in, what happens to a hand that is not there any
more, and its pages in Chromium. Pictures of the pages are kept in PICTURES, to be looked at."""
import contextlib
import http.client
import json
import math
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import harness
import tap
import web_socket
from mechanism import turn
from web_socket import Page, Refused, WebSocket

BIN, PICTURES = Path(sys.argv[1]), Path(sys.argv[2])
STOP_S = 0.25 + 0.4  # without a beat, and the way to rest at jog speed
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
        for role in passwords:
            run = subprocess.run([BIN / "heave-panel", "--state", self.state_folder, "passwd", role], input=f"{PASSWORD} {role}\n", text=True, capture_output=True, check=False)
            assert run.returncode == 0, run.stderr
        self.web, self.more, self.panel = free_port(), more, None

    def __exit__(self, *exception):
        self.end_panel()
        super().__exit__(*exception)

    def start_panel(self, *arguments):
        self.panel_log = self.folder / "panel.log"
        with open(self.panel_log, "wb") as log:
            self.panel = subprocess.Popen([BIN / "heave-panel", "--listen", f"127.0.0.1:{self.web}", "--www", harness.TOP / "panel", "--state", self.state_folder, "--platform",
                                           f"ride={self.socket}", *self.more, *arguments], stdout=log, stderr=log)
        harness.wait_for(lambda: "heave-panel: http" in self.panel_log.read_text(encoding="utf-8") or self.panel.poll() is not None, "the panel serves")
        assert self.panel.poll() is None, self.panel_log.read_text(encoding="utf-8")

    def end_panel(self, how=signal.SIGTERM):
        if self.panel is not None and self.panel.poll() is None:
            self.panel.send_signal(how)
            self.panel.wait(20)
        self.panel = None

    def both(self):
        daemon = self.start()
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
        text = answer.read()
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


# --- What it serves ---

def answers_as_heaved_does(bench):
    bench.both()
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        status = link.receive(lambda message: message.get("event") == "status")["status"]
        assert status["state"] == "OFF" and len(status["cylinders"]) == 6, status["state"]
        for line in ("geometry", "incidents", "tick", "counts", "nonsense"):
            mine = request(link, line)["answer"]
            other = bench.raw(line)
            assert set(mine) == set(other) and mine["ok"] == other["ok"] and mine.get("error") == other.get("error"), (line, mine, other)
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
        for wrong in (["nothing"], [], ["cycle"] * 33, [7]):
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


def bad_use(bench):
    def refused(code, words, *arguments, stdin=""):
        run = subprocess.run([BIN / "heave-panel", "--state", bench.state_folder, *arguments], input=stdin, capture_output=True, text=True, check=False, timeout=30)
        assert run.returncode == code and words in run.stderr, (arguments, run)

    refused(78, "only once there is a password", "--listen", "0.0.0.0:9801", "--www", harness.TOP / "panel")
    refused(78, "No such file", "--www", "/nonexistent")
    refused(64, "127.0.0.1:9801", "--listen", "here")
    refused(64, "NAME=SOCKET", "--platform", "ride")
    refused(64, "letters", "--platform", 'a"b=/tmp/x', "--www", harness.TOP / "panel")
    refused(64, "only together", "--tls-cert", "x")
    refused(64, "look, operate and service", "passwd", "boss")
    refused(78, "at least 8", "passwd", "look", stdin="short\n")
    (bench.state_folder / "passwords").write_text("nonsense\n", encoding="ascii")
    refused(78, "passwords:1:", "--www", harness.TOP / "panel")


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


# --- Pages ---

PAGES = ("operate", "live", "service", "incidents")
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

    def click(page, selector):
        page.wait(f"document.querySelector({json.dumps(selector)}) !== null", selector)
        page.run(f"document.querySelector({json.dumps(selector)}).click()")

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


def ripple_is_found(bench):
    """A ripple of 37 Hz in samples, by the spectrum that the page shows."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 900) as page:
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        script = """import('/curves.js').then((c) => { const v = []; for (let i = 0; i < 4000; i++) v.push(20 * i / 4000 + 0.05 * Math.sin(2 * Math.PI * 37 * i / 1000) + 0.02 * Math.sin(2 * Math.PI * 60 * i / 1000));
                    const s = c.spectrum(v, 1000).filter(([hz]) => hz > 5); return c.strongest(s); })"""
        hz, amplitude = page.run(script)
        assert abs(hz - 37) < 0.5 and 0.04 < amplitude < 0.06, (hz, amplitude)
        lengths = page.run("""import('/space.js').then((space) => space.extensions({mrp_mm: [0, 0, 50], zero_height_mm: 500, base_mm: [[400, -60, 0]], plate_mm: [[190, -230, -10]], retracted_length_mm: [520]},
                              {roll_deg: 5, pitch_deg: -4, yaw_deg: 10, x_mm: 7, y_mm: -3, z_mm: 20}))""")
        point = turn((190, -230, -60), 5, -4, 10)
        expected = math.dist((point[0] + 7, point[1] - 3, point[2] + 50 + 520), (400, -60, 0)) - 520
        assert abs(lengths[0] - expected) < 1e-9, (lengths, expected)


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
    total = sum(path.stat().st_size for path in (harness.TOP / "panel").iterdir())
    assert total < 60000, f"{total} bytes before compression"


CASES = [("a request is answered as heaved answers it", answers_as_heaved_does, {}), ("geometry is that of the kinematics", geometry_is_that_of_the_kinematics, {}),
         ("samples are every cycle, or least and most of so many", samples_are_every_cycle, {}), ("heaved and panel come and go", comes_back, {}),
         ("the panel gives way to other clients and comes back", gives_way_and_comes_back, {}),
         ("strangers, foreign pages and broken messages", strangers, {}), ("passwords, roles and sessions", passwords_and_roles, {"passwords": ("look", "operate", "service")}),
         ("wrong use is named", bad_use, {}), ("a hand that is gone moves nothing", a_hand_that_is_gone, {}), ("every text has two languages, and all of it is small", every_text_has_two_languages, {}),
         ("pages in a browser: three widths, two languages", pages_in_a_browser, {}), ("buttons in a browser", buttons_in_a_browser, {}),
         ("several platforms on a wall", several_platforms, {"more": ("--platform", "other=/nonexistent/heaved.sock")}), ("the spectrum finds a ripple; joints are where they are", ripple_is_found, {})]


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
