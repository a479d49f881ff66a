#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel_edge.py BIN [PART OF A NAME] - the edge of heave-panel, on virtual time: where it listens, and what bytes of strangers do. Judged by what comes of
them, never by the first answer alone: every status line, every cookie, the log, the processor, and whoever is logged in."""
import contextlib
import re
import resource
import socket
import subprocess
import sys
import time
from pathlib import Path

import harness
import tap
from test_panel import BIN, PASSWORD, WWW, PanelBench, free_port, request, take
from web_socket import Refused

OTHER_V4, OTHER_V6, NOBODYS = "198.51.100.7", "2001:db8::7", "203.0.113.1"
IDLE, FLOODERS = 1500, 3
HOLD_S = 0.1


# --- Where it listens ---

def is_open(address, port):
    try:
        socket.create_connection((address, port), timeout=5).close()
    except OSError:
        return False
    return True


def status_of(address, port, host):
    with socket.create_connection((address, port), timeout=5) as link:
        link.sendall(f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode())
        return int(link.recv(4096).split()[1])


def refused(bench, *arguments):
    return subprocess.run([BIN / "heave-panel", "--state", bench.state_folder, "--www", WWW, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=False)


def listens_where_it_was_told(bench):
    everywhere = ("127.0.0.1", "127.9.9.9", "::1")
    rows = {"127.0.0.1": {"127.0.0.1"}, "127.9.9.9": {"127.9.9.9"}, "[::1]": {"::1"}, "0.0.0.0": {"127.0.0.1", "127.9.9.9"}, "[::]": {"::1"}}
    for address, wanted in rows.items():
        bench.start_panel("--listen", f"{address}:{bench.web}")
        assert {where for where in everywhere if is_open(where, bench.web)} == wanted, address
        if address in ("0.0.0.0", "[::]"):
            for where in wanted:  # by the address that it has there, and by no other
                literal = f"[{where}]" if ":" in where else where
                for host, code in ((f"{literal}:{bench.web}", 200), (literal, 200), ("127.8.8.8", 403), ("[fd00::1]", 403), (f"{literal}.evil.example", 403), (f"{literal}0", 403)):
                    assert status_of(where, bench.web, host) == code, (where, host)
        bench.end_panel()


def without_a_password(bench):
    """This machine alone, whatever a request says of itself; and nothing through a proxy."""
    for address in (OTHER_V4, f"[{OTHER_V6}]", "0.0.0.0", "[::]"):
        run = refused(bench, "--listen", f"{address}:{bench.web}")
        assert run.returncode == 78 and "only once there is a password" in run.stderr, run
    bench.start_panel()
    assert not is_open("127.9.9.9", bench.web) and not is_open("::1", bench.web) and bench.get("/api/me")[0] == 200
    for header in ("Forwarded", "X_Forwarded_For", "X_Forwarded_Host", "X_Forwarded_Proto", "X_Real_IP", "Via"):
        code, _, text = bench.get("/api/me", **{header: "203.0.113.9"})
        assert code == 403 and b"proxy" in text, (header, code, text)


def addresses_that_are_none(bench):
    for text in ("localhost:9801", "lo:9801", "::1:9801", "[::1]", "127.0.0.1", "127.0.0.1:", "127.0.0.1:0", "127.0.0.1:65536", "127.0.0.1:98x", "127.0.0.1:-1", ":9801", "[]:9801",
                 "[127.0.0.1]:9801", "[::ffff:127.0.0.1]:9801", "127.1:9801", "[::1:9801", "+127.0.0.1:80", "x" * 300 + ":80"):
        run = refused(bench, "--listen", text)
        assert run.returncode == 64 and "written as 127.0.0.1:9801 or [::1]:9801" in run.stderr, (text, run)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        for where, why in ((f"127.0.0.1:{taken.getsockname()[1]}", "in use"), (f"{NOBODYS}:{free_port()}", "assign")):
            run = refused(bench, "--listen", where)
            assert run.returncode == 69 and "cannot listen on" in run.stderr and why in run.stderr, run


# --- What strangers send ---

def raw(bench, data, seconds=1.0):
    """All that comes back until the connection ends, or for so long."""
    out = b""
    with socket.create_connection(("127.0.0.1", bench.web), timeout=seconds) as link, contextlib.suppress(TimeoutError, ConnectionError):
        link.sendall(data)
        end = time.monotonic() + 5 * seconds
        while time.monotonic() < end and len(out) < 1 << 20:
            more = link.recv(65536)
            if not more:
                return out, True
            out += more
    return out, False


def messages(bench):
    """{what: bytes of somebody who is not logged in}."""
    host, own = f"Host: 127.0.0.1:{bench.web}\r\n", f"Origin: http://127.0.0.1:{bench.web}\r\n"
    json = "Content-Type: application/json\r\n"
    body = f'{{"role":"service","password":"{PASSWORD} service"}}'

    def get(path="/api/me", head=host):
        return f"GET {path} HTTP/1.1\r\n{head}\r\n"

    def post(head, path="/api/login", text=body, length=None):
        return f"POST {path} HTTP/1.1\r\n{head}Content-Length: {len(text) if length is None else length}\r\n\r\n{text}"

    login = post(host + own + json)
    refused = {"a foreign origin": post(host + json + "Origin: http://evil.example\r\n"), "no origin": post(host + json), "no JSON": post(host + own),
               "a foreign host": post("Host: evil.example\r\n" + own + json), "no host": post(own + json), "an unknown path": post(host + own + json, "/api/none"),
               "nothing in it": post(host + own + json, text=""), "no login": post(host + own + json, "/api/check/ride")}
    rows = dict(refused)
    for name, text in {**refused, "a page": get("/"), "a page that is none": get("/none"), "me": get()}.items():
        rows[f"{name}, and a login in the same packet"] = text + login
        rows[f"{name}, and logins without a body"] = text + post(host + own + json, text="") * 50
        rows[f"{name}, and rubbish"] = text + "\x00\xff" * 2000
        rows[f"{name}, and lines"] = text + "\r\n" * 2000
    rows["a hundred requests in one packet"] = get() * 100
    rows["a thousand logins in one packet"] = login.replace("service", "servics") * 1000
    rows["a body that is longer than said"] = post(host + own + json, length=10)
    rows["a body that never comes"] = post(host + own + json, text="", length=100)
    rows["a body of no length that is one"] = post(host + own + json, length=-1)
    rows["a body without end"] = post(host + own + json, text="x" * 300000, length=2**31)
    rows["chunks"] = f"POST /api/login HTTP/1.1\r\n{host}{own}{json}Transfer-Encoding: chunked\r\n\r\n{len(body):x}\r\n{body}\r\n0\r\n\r\n" + login
    rows["two lengths"] = f"POST /api/login HTTP/1.1\r\n{host}{own}{json}Content-Length: 0\r\nContent-Length: {len(body)}\r\n\r\n{body}"
    rows["a page with a body"] = f"GET / HTTP/1.1\r\n{host}Content-Length: {len(login)}\r\n\r\n{login}"
    rows["a head without end"] = f"GET / HTTP/1.1\r\n{host}" + "X: y\r\n" * 20000
    rows["a line without end"] = "GET /" + "x" * 100000
    rows["HTTP/2"] = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + "\x00" * 5000
    rows["an upgrade to HTTP/2"] = f"GET / HTTP/1.1\r\n{host}Connection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\nHTTP2-Settings: AAMAAABkAAQAAP__\r\n\r\n" + "\x00" * 500
    rows["a WebSocket of nobody, and a login"] = get("/ws", f"{host}{own}Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                                                     "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Protocol: heave-panel.1\r\n") + login
    for method in ("PUT", "DELETE", "PATCH", "OPTIONS", "HEAD", "CONNECT", "TRACE"):
        rows[method] = f"{method} /api/login HTTP/1.1\r\n{host}{own}{json}Content-Length: {len(body)}\r\n\r\n{body}" + login
    return rows


def cpu_s(pid):
    with open(f"/proc/{pid}/stat", encoding="ascii") as file:
        fields = file.read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / 100


def one_answer_each(bench):
    """A request that is refused is not carried out, one answer is all that a connection gets, and no bytes keep a core busy or fill the log."""
    bench.both()
    code, cookie, *_ = bench.log_in("service")
    assert code == 200
    with bench.link(cookie=cookie) as link:
        for what, text in messages(bench).items():
            before_s, before_log = cpu_s(bench.panel.pid), bench.panel_log.stat().st_size
            out, _ = raw(bench, text.encode("latin-1"))
            codes = re.findall(rb"HTTP/1\.[01] (\d+)", out)
            assert len(codes) <= 1, (what, codes[:10], len(codes))
            assert b"set-cookie" not in out.lower(), (what, out)
            assert b"101" not in codes, (what, out)
            assert b"403" in codes or "foreign" not in what or "host" not in what or not codes, (what, codes)
            assert cpu_s(bench.panel.pid) - before_s < 0.3, (what, cpu_s(bench.panel.pid) - before_s)
            assert bench.panel_log.stat().st_size - before_log < 4096, what
            assert request(link, "times")["answer"]["ok"], what
        assert bench.get("/api/me", Cookie=cookie)[2].startswith(b'{"role":"service"'), "somebody else has logged it out"
    assert bench.log_in("service")[0] == 200


def refused_with_a_cookie(bench):
    """Of somebody who is logged in: what is refused leaves the session as it is."""
    bench.both()
    cookie = bench.log_in("service")[1]
    for what, text in messages(bench).items():
        if "login" not in what or "no login" in what:
            raw(bench, text.replace("\r\n\r\n", f"\r\nCookie: {cookie}\r\n\r\n", 1).replace("/api/login", "/api/logout").encode("latin-1"), 0.3)
            is_asked = what.startswith(("nothing in it", "a body that is longer", "two lengths"))  # these are right
            assert is_asked or bench.get("/api/me", Cookie=cookie)[2].startswith(b'{"role":"service"'), what
            if is_asked:
                cookie = bench.log_in("service")[1]


def nobody_is_locked_out(bench):
    """1,500 connections that say nothing, and three that ask without end: hold of a page is answered, and somebody new comes in."""
    bench.both()
    cookie = bench.log_in("operate")[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (IDLE + 200, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    idle = []
    try:
        with bench.link(cookie=cookie) as link:
            take(link)
            assert request(link, "engage")["answer"]["ok"]
            harness.wait_for(lambda: bench.status()["state"] == "RISING", "it rises")
            for _ in range(IDLE):
                idle.append(socket.create_connection(("127.0.0.1", bench.web), timeout=5))
            flood = [subprocess.Popen([sys.executable, "-c", FLOOD, str(bench.web)]) for _ in range(FLOODERS)]
            try:
                time.sleep(0.2)  # of virtual time, in which flooders never rest
                longest_s = 0
                for _ in range(50):
                    since = time.monotonic()
                    assert request(link, "hold")["answer"]["ok"]
                    longest_s = max(longest_s, time.monotonic() - since)
                    time.sleep(0.01)
                print(f"# hold beside them: at most {longest_s * 1000:.1f} ms")
                assert longest_s <= HOLD_S, longest_s
                assert bench.log_in("operate")[0] == 200 and bench.get("/", Cookie=cookie)[0] == 200
                with bench.link(cookie=cookie) as other:
                    assert request(other, "hold")["answer"]["ok"]
            finally:
                for process in flood:
                    process.kill()
                    process.wait()
        assert bench.panel_log.stat().st_size < 8192, "the log is filled by strangers"
    finally:
        for one in idle:
            one.close()


def pages_of_the_highest_role(bench):
    """Sixty-four pages are open: no more of that role come in, and nobody who may do more is kept out by them."""
    bench.both()
    cookie = {role: bench.log_in(role)[1] for role in ("look", "operate", "service")}

    def is_in(link):
        try:
            return "answer" in request(link, "times")
        except ConnectionError:
            return False

    with contextlib.ExitStack() as stack:
        pages = [stack.enter_context(bench.link(cookie=cookie["look"])) for _ in range(64)]
        assert all(is_in(link) for link in pages[:3])
        for _ in range(3):
            try:
                stack.enter_context(bench.link(cookie=cookie["look"]))
            except Refused:
                continue
            raise AssertionError("a 65th page of the same role")
        operator, mechanic = (stack.enter_context(bench.link(cookie=cookie[role])) for role in ("operate", "service"))
        take(operator)
        assert request(operator, "engage")["answer"]["ok"] and request(mechanic, "hold")["answer"]["ok"]
        assert not is_in(pages[0]) and not is_in(pages[1]) and is_in(pages[2]), "the oldest of them give way"
        assert is_in(operator), "service is let in for one that looks, not for operate"


def few_descriptors(bench):
    """A limit that the panel may raise is raised, one that it may not is said. Where none is left all the same, it waits, and pages that are there go on."""
    def started(soft, hard):
        return subprocess.run(["prlimit", f"--nofile={soft}:{hard}", BIN / "heave-panel", "--state", bench.state_folder, "--www", WWW, "--listen", f"127.0.0.1:{bench.web}"], stdin=subprocess.DEVNULL, capture_output=True,
                              text=True, timeout=30, check=False)
    run = started(100, 256)
    assert run.returncode == 69 and re.search(r"needs \d+ file descriptors, and may have 256", run.stderr), run
    bench.both()
    cookie = bench.log_in("operate")[1]
    with bench.link(cookie=cookie) as link:
        assert request(link, "times")["answer"]["ok"]
        used = max(int(one.name) for one in Path(f"/proc/{bench.panel.pid}/fd").iterdir()) + 1
        soft, hard = resource.prlimit(bench.panel.pid, resource.RLIMIT_NOFILE)
        waiting = []
        try:
            resource.prlimit(bench.panel.pid, resource.RLIMIT_NOFILE, (used + 2, hard))
            for _ in range(40):  # whatever places are left in between
                waiting.append(socket.create_connection(("127.0.0.1", bench.web), timeout=5))
            waiting[-1].sendall(f"GET /api/me HTTP/1.1\r\nHost: 127.0.0.1:{bench.web}\r\n\r\n".encode())
            before_s = cpu_s(bench.panel.pid)
            for _ in range(40):
                assert request(link, "times")["answer"]["ok"]
                time.sleep(0.05)
            spent_s = cpu_s(bench.panel.pid) - before_s
            assert spent_s < 0.3, f"{spent_s} s of a core in 2 s"
            waiting[-1].setblocking(False)
            with contextlib.suppress(BlockingIOError):
                raise AssertionError(f"there was a place for it: {waiting[-1].recv(100)}")
            waiting[-1].settimeout(20)
            resource.prlimit(bench.panel.pid, resource.RLIMIT_NOFILE, (soft, hard))
            assert b" 200 " in waiting[-1].recv(100), "it comes in once there is room"
        finally:
            resource.prlimit(bench.panel.pid, resource.RLIMIT_NOFILE, (soft, hard))
            for one in waiting:
                one.close()
        assert bench.log_in("operate")[0] == 200


FLOOD = """
import socket, sys
while True:
    try:
        with socket.create_connection(("127.0.0.1", int(sys.argv[1])), timeout=1) as link:
            link.sendall(b"GET / HTTP/1.1\\r\\nHost: 127.0.0.1:" + sys.argv[1].encode() + b"\\r\\n\\r\\n" * 20)
            link.recv(100)
    except OSError:
        pass
"""


def out_at_once(bench):
    """Who has logged out on another page does not even say one more word on this one."""
    bench.both()
    cookie = bench.log_in("operate")[1]
    with bench.link(cookie=cookie) as link:
        take(link)
        assert request(link, "times")["answer"]["ok"]
        assert bench.get("/api/logout", "POST", {}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", Cookie=cookie)[0] == 200
        with contextlib.suppress(ConnectionError):
            answer = request(link, "engage")
            raise AssertionError(f"answered after the end of its session: {answer}")
    assert bench.status()["state"] in ("OFF", "SETTLED")


def out_without_reading(bench):
    """A page that reads nothing, and has more to read than its link holds, is closed too."""
    bench.both()
    cookie = bench.log_in("operate")[1]
    folder = Path(f"/proc/{bench.panel.pid}/fd")
    harness.wait_for(lambda: bench.status()["tick"] > 1000000, "samples to send")
    before = len(list(folder.iterdir()))
    with bench.link(cookie=cookie) as link:
        link.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        for number in range(4):
            link.send({"op": "samples", "platform": "ride", "columns": ["t_ms"] * 32, "history_s": 30, "id": number})
        time.sleep(10)  # 1 MB a second
        assert len(list(folder.iterdir())) > before
        assert bench.get("/api/logout", "POST", {}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", Cookie=cookie)[0] == 200
        harness.wait_for(lambda: len(list(folder.iterdir())) <= before, "its connection is closed", 3)


def cookies_of_others(bench):
    """Other programs of this host have cookies, too."""
    bench.both()
    cookie = bench.log_in("operate")[1]
    for others in ("; ".join(f"other{i}={'x' * 60}" for i in range(40)), "heav=1; xheave=2; heave2=3"):
        for text in (f"{others}; {cookie}", f"{cookie}; {others}"):
            assert bench.get("/api/me", Cookie=text)[2].startswith(b'{"role":"operate"'), text[:80]


def from_a_build(bench):
    """As docs/panel.md has it, where nothing is installed: its pages, and the heaved that checks configurations, are those beside it."""
    bench.open_programs()
    bench.start(environment={"STATE_DIRECTORY": str(bench.kept)})
    log = bench.folder / "built.log"
    with open(log, "wb") as out:
        bench.panel = subprocess.Popen([bench.bin / "heave-panel", "--state", bench.state_folder, "--platform", f"ride={bench.socket}", "--listen", f"127.0.0.1:{bench.web}"], stdout=out, stderr=out)
    harness.wait_for(lambda: "heave-panel: http" in log.read_text(encoding="utf-8") or bench.panel.poll() is not None, "it serves")
    assert bench.panel.poll() is None, log.read_text(encoding="utf-8")
    bench.panel_log = log
    assert b"<html" in bench.get("/")[2] and bench.get("/api/keys")[0] == 200


CASES = [
    ("it listens where it was told, and nowhere else", listens_where_it_was_told, {"passwords": ("service",)}),
    ("without a password this machine alone", without_a_password, {}),
    ("addresses that are none", addresses_that_are_none, {"passwords": ("service",)}),
    ("one answer to each connection", one_answer_each, {"passwords": ("service",)}),
    ("what is refused leaves a session alone", refused_with_a_cookie, {"passwords": ("service",)}),
    ("nobody is locked out by connections", nobody_is_locked_out, {"passwords": ("operate",)}),
    ("pages of the highest role", pages_of_the_highest_role, {"passwords": ("look", "operate", "service")}),
    ("few descriptors", few_descriptors, {"passwords": ("operate",)}),
    ("out is out at once", out_at_once, {"passwords": ("operate",)}),
    ("out without reading", out_without_reading, {"passwords": ("operate",)}),
    ("pages of a build", from_a_build, {}),
    ("cookies of other programs", cookies_of_others, {"passwords": ("operate",)}),
]


def main():
    suite = tap.Suite()
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case, options in CASES:
        if only in name:
            with suite.case(name), PanelBench(**options) as bench:
                case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
