#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel_pages.py BIN PICTURES [PART OF A NAME] - the pages of heave-panel in Chromium, and what takes this machine's own users and processors. Pictures of the pages are
kept in PICTURES, to be looked at."""
import contextlib
import http.client
import json
import math
import os
import re
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
import time
from pathlib import Path

import harness
import tap
import web_socket
from mechanism import turn
from test_panel import (BIN, HTML, PASSWORD, STOP_S, WWW, FalseHeaved, PanelBench, enter_password, free_port, make_certificate, make_incident, moved, reach, request,
                        standing_still, state_of, take, trusting, until)
from web_socket import Page

PICTURES = Path(sys.argv[2])


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
        harness.wait_for(lambda: bench.raw("tick")["tick"] > 1100000, "heaved has run for a second")
        got = link.ask({"op": "request", "platform": "ride", "line": "engage", "tick": 0})
        assert got["answer"]["why"] == "stale" and re.search("[\u4e00-\u9fff]", got["error_zh"]), got
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
    certificate, key = make_certificate(bench.folder)
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
    with Page(f"{own}/", 820, 1180, more=trusting(certificate)) as page:
        enter_password(page)
        assert page.run("document.cookie") == "" and page.run("location.protocol") == "https:"
        assert page.problems == [], page.problems

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
    run = subprocess.run([bench.bin / "heave-panel", "--state", bench.state_folder, "passwd", "service"], input=f"{PASSWORD}\n", text=True, capture_output=True, check=False)  # as root
    assert run.returncode == 0, run
    bench.start_panel(user=PANEL_UID, group=PANEL_UID, extra_groups=[HEAVE_GID], umask=0o077)
    assert bench.log_in("service", PASSWORD)[0] == 200, "the service reads what root has set"
    bench.end_panel()
    (bench.state_folder / "passwords").unlink()
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
    assert got["peaks"] == [[0, 9, 0, 0], [-9, 2, -9, 2]] and got["gap"] == [[1, 1, 1, 1], None, None, [2, 2, 2, 2]], got


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


def storage_is_forbidden(bench):
    """A browser that keeps nothing: all is there, HOLD first of all, and the language changes until the page is closed."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    for how in ("throw new DOMException('denied', 'SecurityError')", "return { getItem() { return null; }, setItem() { throw new DOMException('full', 'QuotaExceededError'); }, removeItem() {} }", "return null"):
        with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
            page.do("Page.addScriptToEvaluateOnNewDocument", source=f"Object.defineProperty(window, 'localStorage', {{ get() {{ {how}; }} }}); window.isForbidden = true;")
            page.do("Page.reload")
            page.wait("window.isForbidden === true && document.getElementById('state') !== null && document.getElementById('state').textContent !== ''", "shown")
            click(page, "#language")
            page.wait("document.getElementById('hold').textContent.includes('暂停')", "in Chinese")
            reach(bench, "ENGAGED")
            page.run("document.getElementById('hold').click()")
            until(bench, "HOLD")
            assert bench.raw("resume")["ok"] and page.problems == [], page.problems


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
            return link.ask({"op": "request", "platform": "ride", "line": line, "tick": max(0, bench.raw("status")["tick"] - age_ms * 1000)})

        harness.wait_for(lambda: bench.raw("status")["tick"] > 2000000, "heaved has run for 2 s")
        for line in ("engage", "resume", "park", "reset", "service", "torque all on", "acknowledge", "selftest passed", "sdo 1 6065 5"):
            answer = ask(line, 1001)["answer"]
            assert answer["why"] == "stale" and "asked more than 1 s ago" in answer["error"], (line, answer)
        for line in ("hold", "torque all off", "geometry", "status"):
            assert "answer" in ask(line, 1e9), line
        assert state_of(bench) == "OFF" and ask("engage", 500)["answer"]["why"] == "held", "the page had not heard of that hold"
        held = bench.raw("tick")["tick"]
        harness.wait_for(lambda: bench.raw("tick")["tick"] > held + 600000, "half a second later")
        assert ask("engage", 500)["answer"]["ok"] is True
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
        page.wait("document.getElementById('said').textContent.includes('asked more than 1 s ago')", "it says why")
        assert state_of(bench) == "HOLD"
        page.run("restore()")
        click(page, "[data-request=resume]")
        until(bench, "RISING", "NEUTRAL", "ENGAGED")
        assert page.problems == [], page.problems


def a_page_says_how_old_it_is(bench):
    """While heaved or the panel stands still: large, from a second on; and a press that nobody answers is told."""
    daemon = bench.both()
    if web_socket.browser() is None:
        raise tap.Skip("no browser is there")
    with Page(f"http://127.0.0.1:{bench.web}/", 390, 844) as page:
        page.wait("document.getElementById('state').textContent === 'OFF'", "the state is shown")
        page.run("window.told = []; new MutationObserver(() => window.told.push(document.getElementById('said').textContent)).observe(document.getElementById('said'), { childList: true })")
        for process in (daemon, bench.panel):
            page.wait("document.getElementById('age').textContent === ''", "what is shown is new")
            with standing_still(process):
                page.wait("/^No news for [1-9][0-9]* s$/.test(document.getElementById('age').textContent)", "it is old")
                shown = page.run("(() => { const box = document.getElementById('age').getBoundingClientRect(); return [box.width, box.height, document.getElementById('state').textContent]; })()")
                assert shown[0] > 300 and shown[1] > 30 and shown[2] == "OFF", shown
                click(page, "#hold")
                page.wait("window.told.some((text) => text.startsWith('HOLD: no answer yet'))", "nobody answers")
                page.run("window.told.length = 0")
        page.wait("document.getElementById('age').textContent === ''", "it is new again")


def a_restarted_panel_asks_who_it_is(bench):
    """The page of somebody who was logged in shows the login, not for ever that its connection is lost."""
    bench.both()
    if web_socket.browser() is None:
        raise tap.Skip("no browser is there")
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('password') !== null", "the login")
        page.run("document.getElementById('role').value = 'service'")
        page.run(f"document.getElementById('password').value = '{PASSWORD} service'")
        page.run("document.querySelector('form.login button').click()")
        page.wait("document.getElementById('state').textContent === 'OFF'", "the state is shown")
        bench.end_panel()
        page.wait("document.getElementById('link').className === 'lost'", "the connection is lost")
        bench.start_panel()
        page.wait("document.getElementById('password') !== null", "the login, again")


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


def hold_until(page, spot, condition, press=None, let_go=None):
    """Presses and keeps pressing. A browser that hangs for a quarter of a second beside load has let go, which is right: then once more."""
    press, let_go = press or (lambda: mouse(page, spot, "mousePressed")), let_go or (lambda: mouse(page, spot, "mouseReleased"))
    for _ in range(12):
        press()
        end = time.monotonic() + 4
        while time.monotonic() < end:
            if condition():
                return
            time.sleep(0.05)
        let_go()
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
        page.wait("document.getElementById('state').textContent === 'HOLD'", "hold is shown: before that, what is pressed is not done")
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


def a_swipe_moves_the_page(bench):
    """A phone: a finger that swipes over the buttons of service scrolls and moves no leg; one that rests there moves it, also if it slips a little, until it leaves the button."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 390, 844) as page:
        page.do("Emulation.setTouchEmulationEnabled", enabled=True)
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        for selector in ("[data-op=take]", "[data-tab=service]", "[data-request='service']"):
            click(page, selector)
        bench.wait_state("SERVICE")
        click(page, "[data-request='torque all on']")
        harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")

        def spot():
            """Where the button is, once nothing scrolls any more."""
            page.run("document.querySelector('[aria-label=\"3 +\"]').scrollIntoView({block: 'center', behavior: 'instant'})")
            page.wait("(async () => { const at = () => document.scrollingElement.scrollTop, one = at(); await new Promise((done) => setTimeout(done, 200)); return at() === one; })()", "it has come to rest")
            return page.run("(() => { const b = document.querySelector('[aria-label=\"3 +\"]').getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2, b.height]; })()")

        def touch(what, *points):
            """Is not waited for: a finger does not, either."""
            page.count += 1
            page.link.send({"id": page.count, "method": "Input.dispatchTouchEvent", "params": {"type": what, "touchPoints": [{"x": x, "y": y} for x, y in points]}})

        def sent():
            return bench.status()["cylinders"][2]["sent_mm"]

        before = sent()
        for way in (-1, 1):
            x, y, _ = spot()
            at = page.run("document.scrollingElement.scrollTop")
            touch("touchStart", (x, y))
            for step in range(1, 13):
                touch("touchMove", (x, y + way * 20 * step))
            touch("touchEnd")
            page.wait(f"document.scrollingElement.scrollTop !== {at}", "it scrolls")
            assert moved(bench, 0.4) < 1e-6 and sent() == before, (way, sent() - before)
        x, y, height = spot()

        def press():
            """Rests, and slips a little then."""
            touch("touchStart", (x, y))
            page.run("new Promise((done) => setTimeout(done, 400))")
            touch("touchMove", (x, y + height / 4))
            page.run("0")

        hold_until(page, None, lambda: sent() > before + 5, press, lambda: touch("touchEnd"))
        at = sent()
        touch("touchMove", (x, y + height))
        harness.wait_for(lambda: moved(bench, 0.4) < 1e-6, "the finger has left the button")
        assert sent() - at < 8, sent() - at
        touch("touchEnd")


def more_buttons_in_a_browser(bench):
    """Those that a ride needs less often: intensity, reset, home all, torque off, leave service."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    daemon = bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "the state is shown")
        click(page, "[data-op=take]")
        page.wait("document.querySelector('[data-op=drop]') !== null", "has the controls")
        page.run("(() => { const i = document.getElementById('intensity'); i.focus(); i.value = '40'; i.nextElementSibling.click(); })()")
        harness.wait_for(lambda: bench.raw("status")["intensity"]["percent"] == 40, "the intensity is set")
        for text in ("", "-1", "101", "12.5", "e"):
            page.run(f"(() => {{ const i = document.getElementById('intensity'); i.focus(); i.value = '{text}'; i.nextElementSibling.click(); }})()")
        page.run("(() => { const i = document.getElementById('intensity'); i.focus(); i.value = '41'; i.nextElementSibling.click(); })()")
        harness.wait_for(lambda: bench.raw("status")["intensity"]["percent"] == 41, "a right one behind them")
        said = lambda: re.findall(r"intensity (\d+) %", daemon.log.read_text(encoding="utf-8"))  # noqa: E731
        harness.wait_for(lambda: said()[-1:] == ["41"], "the log is written, a little later")
        assert said() == ["40", "41"], f"what is no intensity was asked for: {said()}"
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
        teeth = page.run("""import('/band.js').then(({ drawBand, widened }) => { const worst = []; for (const way of [-1, 1]) { const places = Array(100).fill(null), path = [];
                         for (let i = 0; i < 3000; i++) places[Math.floor(i / 30)] = widened(places[Math.floor(i / 30)], way * i);
                         const note = (x, y) => path.push([x, y]); drawBand({ beginPath() {}, stroke() {}, moveTo: note, lineTo: note }, places, (at) => at, (value) => value);
                         worst.push(Math.max(...path.slice(1).map(([x, y], i) => (x === path[i][0] ? 0 : Math.abs(y - path[i][1])))), path.length); } return worst; })""")
        assert teeth == [1, 400, 1, 400], f"from place to place of a flank it is one value: {teeth}"
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


CASES = [
    ("a refusal is told in both languages", refuses_in_chinese, {}),
    ("nobody keeps ticks away", nobody_keeps_ticks_away, {"passwords": ("look", "operate")}),
    ("HTML is text", html_is_text, {}),
    ("over TLS", over_tls, {"passwords": ("service",)}),
    ("users and groups as in the units", rights_are_as_in_the_units, {}),
    ("an incident in a browser", incidents_in_a_browser, {}),
    ("the files of an incident are read right", files_are_read_right, {}),
    ("the recorder keeps every cycle", recorder_keeps_every_cycle, {}),
    ("pages in a browser: three widths, two languages", pages_in_a_browser, {}),
    ("Hold is the largest, and always there", hold_is_there, {}),
    ("a browser that forbids storage", storage_is_forbidden, {}),
    ("Hold acts when it is touched", hold_acts_when_it_is_touched, {}),
    ("what comes late is not done", what_comes_late_is_not_done, {}),
    ("a page says how old it is", a_page_says_how_old_it_is, {}),
    ("a restarted panel asks who it is", a_restarted_panel_asks_who_it_is, {"passwords": ("service",)}),
    ("a page stays that one", a_page_stays_that_one, {}),
    ("buttons in a browser", buttons_in_a_browser, {}),
    ("a swipe moves the page", a_swipe_moves_the_page, {}),
    ("more buttons in a browser", more_buttons_in_a_browser, {}),
    ("axe-core finds no serious fault", nobody_is_left_out, {}),
    ("several platforms on a wall", several_platforms, {"more": ("--platform", "other=/nonexistent/heaved.sock")}),
    ("the spectrum finds a ripple; joints are where they are", ripple_is_found, {}),
    ("the platform in WebGL", scene_is_that_of_the_kinematics, {}),
    ("without WebGL: a flat picture", without_webgl, {}),
    ("the scope finds a ripple of the machine", ripple_of_the_machine, {}),
]


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
