#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_sandbox.py BIN - heaved and heave-panel with the system calls that their units allow, and no others: a call that systemd would end the service for ends
the program here, too. What else systemd does to a service is tried in an emulated machine (tools/nightly --only service)."""
import contextlib
import json
import signal
import socket
import subprocess
import sys
from pathlib import Path

import harness
import tap
import unit_filter
from test_panel import BIN, PASSWORD, PanelBench, request, take

KEYS = """
[service]
jog_mm_s = 50
selftest = daily
"""
CHANGES = (("speed_mm_s = 50", "speed_mm_s = 51"), ("cycle_us = 1000", "cycle_us = 2000"))  # at once, and by a new start of itself


def unit(name):
    return (harness.TOP / "packaging" / name).read_text(encoding="utf-8")


def what_is_not_allowed(_bench):
    """The filter is one: adjtimex ends a program, and what is allowed does not."""
    inside = unit_filter.within(unit("heave@.service.in"))
    for text, code in (("import os; os.getpid()", 0), ("import ctypes; ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(256))", -signal.SIGSYS), ("import os; os.chown('/', 0, 0)", -signal.SIGSYS)):
        run = subprocess.run([sys.executable, "-c", text], preexec_fn=inside, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False)
        assert run.returncode == code, (text, run)


def send(bench, text):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.sendto(text.encode(), ("127.0.0.1", bench.port))


def accepted(bench):
    return sum(bench.status()["counters"]["accepted"].values())


def configuration(bench):
    """None while it starts anew, at whatever moment of the question."""
    with contextlib.suppress(OSError, ValueError):
        return bench.status()["configuration"]["hash"]
    return None


def a_day_of_heaved(bench):
    """Self-test, ride, incident, SERVICE, another configuration, a new start by itself, SIGHUP, end; with all that it keeps."""
    text = bench.config.read_text(encoding="utf-8").replace("[control]\n", f"[control]\nmetrics = {bench.folder}/heave.prom\n", 1)
    bench.config.write_text(text + KEYS, encoding="utf-8")
    environment = {"STATE_DIRECTORY": str(bench.kept), "HEAVE_BOOT_ID": "0123456789abcdef" * 2}
    inside = unit_filter.within(unit("heave@.service.in"))
    daemon = bench.start(environment=environment, preexec_fn=inside)
    assert bench.raw("selftest passed")["ok"]
    assert bench.raw("engage")["ok"]
    bench.wait_state("ENGAGED")
    for i in range(20):
        before = accepted(bench)
        send(bench, f"@A6:{i / 10},0,0,1,1,1,F0#")
        harness.wait_for(lambda before=before: accepted(bench) > before, "the frame has come")
    for line in ("status", "times", "geometry", "incidents", "counts", "dump", "intensity 50", "hold", "resume", "park"):
        assert bench.raw(line)["ok"], line
    bench.wait_state("SETTLED")
    assert bench.raw("service")["ok"] and bench.raw("torque all on")["ok"] and bench.raw("service-off")["ok"]
    harness.wait_for(lambda: (bench.folder / "heave.prom").exists() and (bench.kept / "life").exists() and (bench.kept / "operator.log").exists(), "what it keeps")
    daemon.send_signal(signal.SIGHUP)
    harness.wait_for(lambda: "has been read again" in daemon.log.read_text(encoding="utf-8"), "it is read again")
    text = bench.config.read_text(encoding="utf-8")
    for change in CHANGES:
        assert change[0] in text, change
        text = text.replace(*change, 1)
        before = bench.status()["configuration"]["hash"]
        run = bench.ctl("config", bench.file("other.ini", text))
        assert run.returncode == 0, run
        harness.wait_for(lambda before=before: configuration(bench) not in (None, before), "it is in force")
    bench.wait_state("OFF", "SETTLED")
    assert bench.stop(daemon) == 0
    daemon = bench.start(environment={**environment, "HEAVE_BOOT_ID": "fedcba9876543210" * 2}, preexec_fn=inside)
    assert bench.status()["selftest"]["passed"] is True
    assert bench.stop(daemon) == 0


def a_day_of_the_panel(bench):
    """Login, pages, files, the controls, a check by a program of its own, samples, logout, end."""
    bench.start(environment={"STATE_DIRECTORY": str(bench.kept)})
    bench.start_panel(preexec_fn=unit_filter.within(unit("heave-panel.service.in")))
    harness.wait_for(lambda: bench.status()["state"] in ("OFF", "SETTLED"), "heaved is up")
    code, cookie, *_ = bench.log_in("service")
    assert code == 200 and bench.log_in("service", "wrong")[0] == 401
    with bench.link(cookie=cookie) as link:
        take(link)
        for line in ("engage", "hold", "status"):
            assert request(link, line)["answer"]["ok"], line
        incident = Path(request(link, "dump")["answer"]["folder"]).name
        link.ask({"op": "samples", "platform": "ride", "columns": ["t_ms"], "every": 1})
        link.ask({"op": "identify", "platform": "ride", "axis": "z", "tick": 1})
    for path in ("/", "/api/me", "/api/log/ride", "/api/config/ride", "/api/keys", "/api/keys/zh"):
        assert bench.get(path, Cookie=cookie)[0] == 200, path
    text = json.loads(bench.get("/api/config/ride", Cookie=cookie)[2])["text"]
    own = {"Content_Type": "application/json", "Origin": f"http://127.0.0.1:{bench.web}", "Cookie": cookie}
    assert json.loads(bench.get("/api/check/ride", "POST", {"text": text}, **own)[2])["check"]["ok"] is True
    assert bench.get(f"/api/incident/ride/{incident}/frames", Cookie=cookie)[0] == 200
    assert bench.get("/api/logout", "POST", {}, **own)[0] == 200
    process = bench.panel
    bench.end_panel()
    assert process.returncode == 0, (process.returncode, bench.panel_log.read_text(encoding="utf-8"))


CASES = [
    ("a call that is not allowed", what_is_not_allowed, {}),
    ("a day of heaved", a_day_of_heaved, {}),
    ("a day of heave-panel", a_day_of_the_panel, {"passwords": ("service",)}),
]


def main():
    suite = tap.Suite()
    for name, case, options in CASES:
        if case is a_day_of_the_panel and not (BIN / "heave-panel").exists():
            continue
        with suite.case(name), PanelBench(**options) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
