#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel_proxy.py BIN [PART OF A NAME] - heave-panel behind nginx, with TLS and below a path, by the configuration that docs/panel.md prints."""
import http.client
import json
import re
import shutil
import socket
import ssl
import subprocess
import sys

import harness
import tap
import web_socket
from test_panel import BIN, PASSWORD, PanelBench, enter_password, free_port, make_certificate, request, take, trusting
from web_socket import Page, WebSocket

NGINX = subprocess.run([harness.TOP / "tools/lib/nginx.sh", "--cached"], capture_output=True, text=True, check=False).stdout.strip()
HERE, THERE = "127.0.0.5", "127.0.0.6"  # of browsers
UP = ("HOMING", "RISING", "NEUTRAL", "ENGAGED")


def documented():
    text = (harness.TOP / "docs/panel.md").read_text(encoding="utf-8")
    return re.search(r"```nginx\n(.*?)```", text, re.DOTALL)[1]


class Proxy:
    """nginx as it is documented, on ports and with files of our own; `changes`: other texts in its configuration."""

    def __init__(self, bench, **changes):
        self.bench, self.port = bench, free_port()
        self.certificate, self.key = make_certificate(bench.folder)
        text = documented()
        for before, after in {"hall.example": "127.0.0.1", "/etc/ssl/hall.crt": str(self.certificate), "/etc/ssl/hall.key": str(self.key), "listen 443": f"listen 127.0.0.1:{self.port}",
                              "127.0.0.1:9801": f"127.0.0.1:{bench.web}", **changes}.items():
            assert before in text, before
            text = text.replace(before, after)
        places = "".join(f"{what}_temp_path {bench.folder}/nginx-{what};\n" for what in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi"))
        path = bench.file("nginx.conf", f"pid {bench.folder}/nginx.pid;\nerror_log {bench.folder}/nginx.log;\nevents {{ }}\nhttp {{\naccess_log off;\n{places}{text}\n}}\n")
        self.process = subprocess.Popen([NGINX, "-c", path, "-p", bench.folder, "-g", "daemon off; master_process off;"], stdin=subprocess.DEVNULL)

    def __enter__(self):
        harness.wait_for(lambda: self.process.poll() is not None or self.is_open(), "nginx serves")
        assert self.process.poll() is None, (self.bench.folder / "nginx.log").read_text(encoding="utf-8")
        return self

    def __exit__(self, *exception):
        self.process.terminate()
        self.process.wait(20)

    def is_open(self):
        try:
            socket.create_connection(("127.0.0.1", self.port), timeout=5).close()
        except OSError:
            return False
        return True

    @property
    def origin(self):
        return f"https://127.0.0.1:{self.port}"

    def context(self):
        return ssl.create_default_context(cafile=str(self.certificate))

    def ask(self, path, method="GET", body=None, source=HERE, **headers):
        """(code, set-cookie, text)"""
        client = http.client.HTTPSConnection("127.0.0.1", self.port, timeout=20, context=self.context(), source_address=(source, 0))
        client.request(method, f"/ride{path}", None if body is None else json.dumps(body), {name.replace("_", "-"): value for name, value in headers.items()})
        answer = client.getresponse()
        out = answer.status, answer.getheader("set-cookie"), answer.read()
        client.close()
        return out

    def log_in(self, password, source=HERE, **headers):
        return self.ask("/api/login", "POST", {"role": "operate", "password": password}, source, Content_Type="application/json", Origin=self.origin, **headers)


def as_documented(bench):
    """Login, cookies, files, WebSocket, and the operator log names the browser."""
    bench.more = ("--proxy", "127.0.0.1", "--allow-host", "127.0.0.1")
    bench.both()
    with Proxy(bench) as proxy:
        assert proxy.ask("/")[0] == 200 and proxy.ask("/app.js")[0] == 200
        assert proxy.ask("/api/log/ride")[0] == 401
        code, cookie, _ = proxy.log_in(f"{PASSWORD} operate")
        assert code == 200 and {"Secure", "HttpOnly", "SameSite=Strict", "Path=/ride/"} <= set(cookie.split("; ")), cookie
        token = cookie.split(";")[0]
        assert json.loads(proxy.ask("/api/me", Cookie=token)[2])["role"] == "operate"
        with WebSocket("127.0.0.1", proxy.port, "/ride/ws", protocol="heave-panel.1", origin=proxy.origin, context=proxy.context(), cookie=token, source=HERE) as link:
            take(link)
            assert request(link, "engage")["answer"]["ok"]
            bench.wait_state(*UP)
            assert request(link, "hold")["answer"]["ok"]
        harness.wait_for(lambda: f"operate@{HERE}".encode() in proxy.ask("/api/log/ride", Cookie=token)[2], "the log names the browser")
        for origin in (f"http://127.0.0.1:{bench.web}", f"http://127.0.0.1:{proxy.port}", "https://evil.example", "null"):
            code, cookie, _ = proxy.ask("/api/login", "POST", {"role": "operate", "password": f"{PASSWORD} operate"}, Content_Type="application/json", Origin=origin)
            assert code == 403 and cookie is None, (origin, code)


def each_browser_has_its_limits(bench):
    """Wrong passwords of one browser are its own, whatever it says of itself."""
    bench.more = ("--proxy", "127.0.0.1", "--allow-host", "127.0.0.1")
    bench.both()
    with Proxy(bench) as proxy:
        codes = [proxy.log_in("wrong", X_Forwarded_For=f"10.0.0.{i}", X_Real_IP=f"10.0.1.{i}")[0] for i in range(8)]
        assert codes[:5] == [401] * 5 and 429 in codes[5:], codes
        assert proxy.log_in(f"{PASSWORD} operate", THERE)[0] == 200
    log = bench.panel_log.read_text(encoding="utf-8")
    assert f"login from {HERE}: wrong" in log and "10.0" not in log, log


def only_the_proxy_is_believed(bench):
    """What somebody else says of himself changes nothing; neither does it without --proxy."""
    for more in ((), ("--proxy", "127.0.0.9"), ("--proxy", "::1")):
        bench.more = more
        bench.start_panel()
        for text in ("10.0.0.1", "10.0.0.2, 10.0.0.3", "::1"):
            code, headers, _ = bench.get("/api/login", "POST", {"role": "operate", "password": f"{PASSWORD} operate"}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", X_Forwarded_For=text,
                                         X_Forwarded_Proto="https")
            assert code == 200 and "Secure" not in headers["set-cookie"], (code, headers)
        assert bench.get("/api/login", "POST", {"role": "operate", "password": "wrong"}, Content_Type="application/json", Origin=f"http://127.0.0.1:{bench.web}", X_Forwarded_For="10.0.0.1")[0] == 401
        assert "login from 127.0.0.1: wrong" in bench.panel_log.read_text(encoding="utf-8")
        bench.end_panel()
    for text in ("localhost", "127.1", "127.0.0.1:80", "[::1]", "", "10.0.0.0/8", "::ffff:127.0.0.1"):
        run = subprocess.run([BIN / "heave-panel", "--state", bench.state_folder, "--proxy", text], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=False)
        assert run.returncode == 64 and "--proxy: an address" in run.stderr, (text, run)
    for arguments, code, why in ((("--proxy", "::1", "--proxy", "::1"), 64, "--proxy: once"), (("--state", bench.folder / "empty", "--proxy", "::1"), 78, "--proxy: only once there is a password")):
        run = subprocess.run([BIN / "heave-panel", "--state", bench.state_folder, *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=False)
        assert run.returncode == code and why in run.stderr, run


def pages_below_a_path(bench):
    """Chromium: the pages with all that they load, the controls, HOLD, files and the check of a configuration."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.more = ("--proxy", "127.0.0.1", "--allow-host", "127.0.0.1")
    bench.both()
    with Proxy(bench) as proxy:
        with Page(f"{proxy.origin}/ride", 820, 1180, more=trusting(proxy.certificate)) as page:
            enter_password(page)
            for tab in page.run("[...document.querySelectorAll('[data-tab]')].map((one) => one.dataset.tab)"):
                page.run(f"document.querySelector('[data-tab={tab}]').click()")
                page.wait("document.querySelector('main').innerText.length > 20", f"the page {tab}")
            page.run("document.querySelector('[data-tab=operate]').click()")
            page.wait("document.querySelector('[data-request=engage]') !== null", "its buttons")
            page.run("document.querySelector('[data-op=take]').click()")
            page.wait("document.querySelector('[data-op=drop]') !== null", "it has the controls")
            page.run("document.querySelector('[data-request=engage]').click()")
            bench.wait_state(*UP)
            page.run("document.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }))")
            bench.wait_state("HOLD")
            assert page.problems == [], page.problems


CASES = [
    ("as docs/panel.md has it", as_documented, {"passwords": ("operate",)}),
    ("each browser has its limits", each_browser_has_its_limits, {"passwords": ("operate",)}),
    ("only the proxy is believed", only_the_proxy_is_believed, {"passwords": ("operate",)}),
    ("pages below a path", pages_below_a_path, {"passwords": ("service",)}),
]


def main():
    suite = tap.Suite()
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case, options in CASES:
        if only in name:
            with suite.case(name), PanelBench(**options) as bench:
                if case is not only_the_proxy_is_believed and NGINX == "" or shutil.which("openssl") is None:
                    raise tap.Skip("it takes nginx and openssl")
                case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
