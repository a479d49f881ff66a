#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel_configuration.py BIN PICTURES [PART OF A NAME] - another configuration in place of the one in force: over the control socket, by heavectl, by the panel and its pages in
Chromium; who may, when, and what is refused."""
import array
import contextlib
import fcntl
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import harness
import tap
import web_socket
from test_chinese import CHINESE
from test_panel import BIN, PanelBench, reach, state_of, take
from test_panel_pages import OVERFLOW, PICTURES, SMALL, UNNAMED, click
from web_socket import Page

SEALS = fcntl.F_SEAL_WRITE | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW
VIEWS = ("text", "sizes", "changes")


def memory(data, seals=SEALS):
    fd = os.memfd_create("test", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.write(fd, data)
    if seals:
        fcntl.fcntl(fd, fcntl.F_ADD_SEALS, seals)
    return fd


def configuration(bench):
    """(answer, text) of the request."""
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(bench.socket))
        link.sendall(b"configuration\n")
        line, controls, _, _ = link.recvmsg(4096, socket.CMSG_SPACE(4))
    answer = json.loads(line)
    if not controls:
        return answer, None
    fd = array.array("i", controls[0][2])[0]
    with os.fdopen(fd, "rb") as file:
        file.seek(0)
        return answer, file.read().decode()


def configure(bench, text, digest=None, fd=None):
    """heaved's answer to the text; fd in its place, -1: none."""
    mine = memory(text.encode()) if fd is None else fd
    line = f"configure {digest if digest is not None else configuration(bench)[0]['digest']}\n".encode()
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(str(bench.socket))
        link.settimeout(20)
        link.sendmsg([line], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [mine]))] if mine >= 0 else [])
        answer = json.loads(link.makefile("rb").readline())
    if mine >= 0:
        os.close(mine)
    return answer


def changed(text, key, value):
    out, count = re.subn(rf"(?m)^{key} = [^;\n]*", f"{key} = {value} ", text)
    assert count >= 1, key
    return out


def heavectl(bench, *arguments):
    return subprocess.run([BIN / "heavectl", "--socket", bench.socket, *map(str, arguments)], capture_output=True, text=True, check=False, timeout=30)


def quiet(bench):
    """heaved and a panel, SETTLED."""
    daemon = bench.both()
    reach(bench, "SETTLED")
    return daemon


def kept(bench):
    return bench.kept / "configuration.ini"


# --- heaved ---

def comes_into_force(bench):
    """What may change in operation does at once, the rest by a start anew of the same process; the file itself stays, older ones are kept."""
    daemon = quiet(bench)
    own = bench.config.read_text(encoding="utf-8")
    answer, text = configuration(bench)
    assert text == own and answer["file"] == str(bench.config) and answer["applied"] is None and answer["keeps"] is True, answer
    assert answer["digest"] == bench.status()["configuration"]["digest"]
    live = changed(text, "silence_hold_ms", "777") if "silence_hold_ms" in text else text.replace("[udp]\n", "[udp]\nsilence_hold_ms = 777\n")
    got = configure(bench, live)
    assert got["ok"] and got["restart"] is False and got["changed"] == 1 and got["hash"] == bench.status()["configuration"]["hash"], got
    assert configuration(bench)[1] == live and bench.config.read_text(encoding="utf-8") == own
    other = harness.free_port()
    got = configure(bench, changed(live, "port", str(other)))
    assert got["ok"] and got["restart"] is True and got["changed"] == 1, got
    harness.wait_for(lambda: hash_or_none(bench) == got["hash"], "with the new one")
    assert daemon.poll() is None, "the same process"
    answer, text = configuration(bench)
    assert answer["applied"] == str(kept(bench)) and text == changed(live, "port", str(other))
    assert Path(f"{kept(bench)}.1").read_text(encoding="utf-8").startswith(live)
    # an edit of the file itself counts again
    bench.config.write_text(own + "; edited\n", encoding="utf-8")
    assert "has changed meanwhile" in configure(bench, live)["error"]
    daemon.send_signal(signal.SIGHUP)
    harness.wait_for(lambda: configuration(bench)[1] == own + "; edited\n", "the file is read")
    assert configuration(bench)[0]["applied"] is None
    assert bench.stop(daemon) == 0


def hash_or_none(bench):
    """While it starts anew nobody answers."""
    with contextlib.suppress(OSError, ValueError):
        return bench.raw("status")["configuration"]["hash"]
    return None


def is_refused(bench):
    """By its text, by what it was made from, by how it comes, by the state; and nothing is kept of it."""
    quiet(bench)
    text = configuration(bench)[1]
    good = changed(text, "engage", "manual")
    for answer, words in ((configure(bench, changed(text, "cycle_us", "1")), "1 mistake, nothing has changed: configuration:"),
                          (configure(bench, text + "[platform]\n"), "given again"),
                          (configure(bench, good, digest="0123456789abcdef"), "another configuration is in force"),
                          (configure(bench, good, digest=""), "another configuration is in force"),
                          (configure(bench, good, digest="../../etc/passwd"), "another configuration is in force"),
                          (configure(bench, good, fd=-1), "sealed against writing"),
                          (configure(bench, good, fd=memory(good.encode(), 0)), "sealed against writing"),
                          (configure(bench, good, fd=memory(good.encode(), fcntl.F_SEAL_GROW)), "sealed against writing"),
                          (configure(bench, good, fd=os.open(bench.config, os.O_RDONLY)), "sealed against writing"),
                          (configure(bench, good, fd=os.pipe()[0]), "sealed against writing"),
                          (configure(bench, good, fd=memory(b"")), "no byte, or more"),
                          (configure(bench, good, fd=memory(b"; x\n" * 40000)), "no byte, or more"),
                          (configure(bench, good, fd=memory(os.urandom(20000))), "mistake")):
        assert not answer["ok"] and words in answer["error"], (words, answer)
    assert not kept(bench).exists()
    reach(bench, "ENGAGED")
    for one in (good, changed(text, "stroke_mm", "201")):
        answer = configure(bench, one)
        assert not answer["ok"] and "people may be on it" in answer["error"], answer
    reach(bench, "SERVICE")
    answer = configure(bench, changed(text, "stroke_mm", "201"))
    assert not answer["ok"] and "needs a restart" in answer["error"], answer
    assert configure(bench, good + "; in service\n")["ok"]
    log = (bench.kept / "operator.log").read_text(encoding="utf-8")
    assert '"request":"configure ' in log and "people may be on it" in log


def descriptors(daemon):
    """What each open file of heaved is, without its number."""
    found = []
    for one in Path(f"/proc/{daemon.pid}/fd").iterdir():
        with contextlib.suppress(OSError):
            found.append(re.sub(r"\[\d+\]", "", os.readlink(one)))
    return sorted(found)


def starts_anew(bench):
    """In OFF, whatever [platform] engage says; no descriptor and no thread is left of the run before."""
    daemon = quiet(bench)
    text = configuration(bench)[1]
    with socket.socket(socket.AF_UNIX) as link:  # a client that passes what nobody wants
        link.connect(str(bench.socket))
        for count in (1, 2, 20):
            link.sendmsg([b"tick\n"], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0] * count))])
            link.recv(4096)
        before = descriptors(daemon)
    harness.wait_for(lambda: len(descriptors(daemon)) == len(before) - 2, "the client's connection and the one descriptor that was taken are closed")
    before, threads = descriptors(daemon), len(os.listdir(f"/proc/{daemon.pid}/task"))
    for stroke in ("199", "198"):
        got = configure(bench, changed(changed(text, "stroke_mm", stroke), "engage", "auto"))
        assert got["ok"] and got["restart"] is True, got
        harness.wait_for(lambda: hash_or_none(bench) == got["hash"], "with the new one")
        harness.wait_for(lambda: descriptors(daemon) == before and len(os.listdir(f"/proc/{daemon.pid}/task")) == threads, f"as before: {before}")
        until_cycle = bench.raw("status")["cycle"] + 2000
        harness.wait_for(lambda: bench.raw("status")["cycle"] > until_cycle, "time passes")
        status = bench.raw("status")
        assert status["state"] == "OFF" and not any(one["drive"] == "enabled" for one in status["cylinders"]), status
    reach(bench, "SETTLED")
    assert bench.stop(daemon) == 0


def cannot_start(bench):
    """One that is right but cannot be started: heaved is back with the one before, says why, keeps the other beside it, and nothing moves. Over the file, over one that was applied. heaved itself
    speaks Chinese at its terminal: what it keeps is English, and who shows it translates."""
    daemon = bench.start(environment={**CHINESE, "STATE_DIRECTORY": str(bench.kept)})
    bench.start_panel()
    reach(bench, "SETTLED")
    own = configuration(bench)[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("0.0.0.0", 0))
        port = taken.getsockname()[1]
        for before in (own, own + "; words\n", changed(own, "engage", "auto")):
            if before != own:
                got = configure(bench, before)
                assert got["ok"], got
                harness.wait_for(lambda got=got: (hash_or_none(bench), configuration_digest(bench)) == (got["hash"], got["digest"]), "in force")
                assert put_back(bench) == "", "it is told until another one is in force"
                assert "could not be started" not in bench.ctl("status").stdout
                reach(bench, "SETTLED")
            digest = configuration(bench)[0]["digest"]
            wrong = changed(before, "port", str(port))
            got = configure(bench, wrong)
            assert got["ok"] and got["restart"] is True, got
            harness.wait_for(lambda: (put_back(bench) or ""), "it is back and tells")
            assert f"port {port}" in put_back(bench) and "in use" in put_back(bench), put_back(bench)
            assert daemon.poll() is None, "the same process"
            told_in_both_languages(bench, put_back(bench))
            answer, text = configuration(bench)
            assert text == before and answer["digest"] == digest and (answer["applied"] is None) == (before == own), answer
            assert Path(f"{kept(bench)}.failed").read_text(encoding="utf-8").startswith(wrong)
            until_cycle = bench.raw("status")["cycle"] + 2000
            harness.wait_for(lambda: bench.raw("status")["cycle"] > until_cycle, "time passes")
            status = bench.raw("status")
            assert status["state"] == "OFF" and not any(one["drive"] == "enabled" for one in status["cylinders"]), status
            reach(bench, "SETTLED")
    assert "what was applied cannot be started" in daemon.log.read_text(encoding="utf-8")
    assert bench.stop(daemon) == 0


def told_in_both_languages(bench, why):
    """Why it was put back: by the panel beside the status, and by heavectl status."""
    assert re.fullmatch(r"[ -~]+", why), why
    with bench.link() as link:
        link.send({"op": "status", "platform": "ride", "hz": 10, "id": 0})
        got = link.receive(lambda message: message.get("event") == "status" and message["status"]["configuration"]["put_back"])
        assert got["status"]["configuration"]["put_back"] == why and re.search("[\u4e00-\u9fff]", got["put_back_zh"]) and "in use" not in got["put_back_zh"], got
    shown = " ".join(bench.ctl("status").stdout.split())
    assert f"config what was applied could not be started; the one before it is in force again: {why}" in shown, shown
    lines = bench.ctl("status", env={**os.environ, **CHINESE}).stdout
    assert f"应用的配置无法启动，已恢复之前的配置：{got['put_back_zh']}".replace(" ", "") in "".join(lines.split()), lines


def put_back(bench):
    with contextlib.suppress(OSError, ValueError):
        return bench.raw("status")["configuration"]["put_back"]
    return None


def configuration_digest(bench):
    with contextlib.suppress(OSError, ValueError):
        return bench.raw("status")["configuration"]["digest"]
    return None


def disk_takes_its_time(bench):
    """The state is looked at again once the disk has taken the text; who wants heaved to end gets that."""
    library = BIN.parent / "tests/system/libstalled_disk.so"
    if not library.exists():
        raise tap.Skip("no libstalled_disk.so (sanitizers)")
    stall = Path(f"{bench.kept}.stall")
    preload = {"LD_PRELOAD": str(library), "HEAVE_STALLED": str(bench.kept), "STATE_DIRECTORY": str(bench.kept)}

    def during(change, act):
        """What is answered where something happens while the disk stands; None: heaved has ended before it answered."""
        text = change(configuration(bench)[1])
        answers = []

        def ask():
            with contextlib.suppress(OSError, ValueError):
                answers.append(configure(bench, text))

        stall.touch()
        asking = threading.Thread(target=ask)
        asking.start()
        time.sleep(0.3)
        act()
        stall.unlink()
        asking.join()
        return answers[0] if answers else None

    def to_engaged():
        bench.raw("engage")
        harness.wait_for(lambda: state_of(bench) not in ("OFF", "SETTLED"), "it rises")

    daemon = bench.start(environment=preload)
    for change in (lambda text: text + "; more\n", lambda text: changed(text, "stroke_mm", "199")):
        reach(bench, "SETTLED")
        before = configuration(bench)
        answer = during(change, to_engaged)
        assert not answer["ok"] and "the state has changed meanwhile" in answer["error"], answer
        assert configuration(bench) == before and daemon.poll() is None
    for number, end in enumerate((lambda: daemon.send_signal(signal.SIGTERM), lambda: bench.raw("shutdown"))):
        reach(bench, "SETTLED")
        stroke = str(190 + number)
        during(lambda text, stroke=stroke: changed(text, "stroke_mm", stroke), end)
        assert daemon.wait(30) == 0, daemon.log.read_text(encoding="utf-8")
        daemon = bench.start(environment=preload)
        assert re.search(rf"(?m)^stroke_mm = {stroke}", configuration(bench)[1]), "what is kept comes into force at the next start"
    reach(bench, "OFF")
    assert bench.stop(daemon) == 0


def by_heavectl(bench):
    """The same with heavectl, in the same words as at the panel."""
    quiet(bench)
    text = configuration(bench)[1]
    assert heavectl(bench, "config").stdout == text
    bad = bench.file("bad.ini", changed(text, "cycle_us", "1"))
    run = heavectl(bench, "config", bad)
    with bench.link() as link:
        take(link)
        code, answer = check(bench, changed(text, "cycle_us", "1"))
        assert code == 200 and answer["check"]["ok"] is False
        error = link.ask({"op": "configure", "platform": "ride", "base": configuration(bench)[0]["digest"], "staged": answer["staged"]})["answer"]["error"]
    assert run.returncode == 1 and run.stderr.strip() == f"heavectl: {error}", (run.stderr, error)
    assert heavectl(bench, "config", bench.folder / "none.ini").returncode == 66
    run = heavectl(bench, "--json", "config", bench.file("good.ini", text + "; said\n"))
    assert run.returncode == 0 and json.loads(run.stdout)["restart"] is False, run
    assert heavectl(bench, "config").stdout == text + "; said\n"


# --- The panel ---

def check(bench, text, cookie="", path="/api/check/ride", **headers):
    sent = {"Content_Type": "application/json", "Origin": f"http://127.0.0.1:{bench.web}", **({"Cookie": cookie} if cookie else {}), **headers}
    code, _, body = bench.get(path, "POST", {"text": text} if isinstance(text, str) else text, **sent)
    with contextlib.suppress(ValueError):
        return code, json.loads(body)
    return code, {}


def attacks(bench):
    """Who may not, what is too much, what is no text, and what was said before: nothing changes."""
    quiet(bench)
    cookie = {role: bench.log_in(role)[1] for role in ("look", "operate", "service")}
    before = configuration(bench)
    text = before[1]
    assert check(bench, text)[0] == 401 and check(bench, text, cookie="heave=" + "0" * 64)[0] == 401
    assert check(bench, text, cookie["look"]) == (403, {"error": "not allowed; it takes the role service"}) and check(bench, text, cookie["operate"])[0] == 403
    assert check(bench, text, cookie["service"], Origin="http://evil.example")[0] == 403 and check(bench, text, cookie["service"], Host="evil.example")[0] == 403
    for form in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        assert check(bench, text, cookie["service"], Content_Type=form)[0] == 404, form
    for path in ("/api/check/", "/api/check/none", "/api/check/ride/../../x", "/api/check/ride/x", "/api/check/..%2f..%2fetc"):
        assert check(bench, text, cookie["service"], path=path)[0] in (400, 403, 404), path
    for path in ("/api/config/", "/api/config/ride/x", "/api/config/..", "/api/config/..%2f..%2fetc%2fpasswd", "/api/config/../../../etc/passwd", "/api/keys/../config"):
        code, _, body = bench.get(path, Cookie=cookie["service"])
        assert code in (400, 403, 404) and b"root:" not in body, (path, code)
    assert bench.get("/api/config/ride")[0] == 401 and bench.get("/api/keys")[0] == 401
    for broken in ({"text": 7}, {"text": ""}, {"text": None}, {}, [], "x", {"text": "x" * 131073}):
        assert check(bench, broken if not isinstance(broken, str) else {"tex": broken}, cookie["service"])[0] in (400, 503), broken
    with contextlib.suppress(OSError, AssertionError, ValueError):  # the panel ends that connection
        assert check(bench, "x" * 2_000_000, cookie["service"])[0] >= 400
    nested = check(bench, "[" * 20000, cookie["service"])
    assert nested[0] == 200 and nested[1]["check"]["ok"] is False, nested
    html = check(bench, text + "<img src=x onerror=alert(1)> = 1\n", cookie["service"])[1]["check"]["errors"]
    assert html and all(set(one) == {"line", "text"} for one in html), html
    staged = check(bench, text + "; mine\n", cookie["service"])[1]["staged"]
    message = {"op": "configure", "platform": "ride", "base": before[0]["digest"], "staged": staged}
    for role in ("look", "operate"):
        with bench.link(cookie=cookie[role]) as link:
            assert link.ask(message)["error"] == "configure %s: not allowed; it takes the role service" % before[0]["digest"][:10], role
    with bench.link(cookie=cookie["service"]) as link:
        assert link.ask(message)["error"] == "take the controls first"
        for line in (f"configure {before[0]['digest']}", "configuration"):
            assert "error" in link.ask({"op": "request", "platform": "ride", "line": line}), line
        take(link)
        for more in ({"staged": "0" * 16}, {"staged": ""}, {"staged": "../passwords"}, {"staged": 7}):
            assert "not what was checked last" in link.ask(message | more)["error"], more
        for more in ({"base": "x" * 90}, {"base": "a\nshutdown"}, {"base": ""}, {"base": 7}):
            answer = link.ask(message | more)
            assert "error" in answer or not answer["answer"]["ok"], (more, answer)
        assert configuration(bench) == before
        assert link.ask(message)["answer"]["ok"] is True
        assert "another configuration is in force" in link.ask(message)["answer"]["error"], "said again"
    assert configuration(bench)[1] == text + "; mine\n"
    flood = [threading.Thread(target=lambda: check(bench, text, cookie["service"])) for _ in range(20)]
    for one in flood:
        one.start()
    for one in flood:
        one.join()
    assert check(bench, text, cookie["service"])[0] == 200
    left = [one.name for one in bench.state_folder.iterdir()]
    assert sorted(left) == ["passwords", "staged-ride.ini"], left


def one_check_each(bench):
    """Bytes behind the body of a request begin no further check."""
    bench.both()
    slow = bench.folder / "slow-heaved"
    slow.write_text("#!/bin/sh\nexec /bin/sleep 5\n", encoding="ascii")
    slow.chmod(0o755)
    bench.end_panel()
    bench.start_panel("--heaved", slow)
    body = json.dumps({"text": "[platform]\n"}).encode()
    head = f"POST /api/check/ride HTTP/1.1\r\nHost: 127.0.0.1:{bench.web}\r\nOrigin: http://127.0.0.1:{bench.web}\r\nContent-Type: application/json\r\nContent-Length: {len(body)}\r\n\r\n"
    children = Path(f"/proc/{bench.panel.pid}/task/{bench.panel.pid}/children")
    with socket.create_connection(("127.0.0.1", bench.web), timeout=10) as link:
        link.sendall(head.encode() + body)
        harness.wait_for(lambda: children.read_text(encoding="ascii").split(), "it is being checked")
        for _ in range(6):
            time.sleep(0.1)
            with contextlib.suppress(OSError):
                link.sendall(b"x")
        time.sleep(0.3)
        assert len(children.read_text(encoding="ascii").split()) <= 1, "one request has several checks"
    assert check(bench, "[platform]\n", path="/api/check/none")[0] == 404 and bench.panel.poll() is None


def without_heaved(bench):
    """The program is not there, hangs, or says nonsense: the page is told, and the panel goes on."""
    bench.both()
    text = configuration(bench)[1]
    for program in ("#!/bin/sh\nexec sleep 60\n", "#!/bin/sh\nhead -c 5000000 /dev/zero\n", "#!/bin/sh\nkill -9 $$\n", None):
        path = bench.folder / "program"
        path.unlink(missing_ok=True)
        if program is not None:
            path.write_text(program, encoding="ascii")
            path.chmod(0o755)
        bench.end_panel()
        bench.more = ("--heaved", path)
        bench.start_panel()
        began = time.monotonic()
        code, answer = check(bench, text)
        assert code == 503 and "has not come to an end" in answer["error"] and time.monotonic() - began < 18, (program, code, answer)
        assert bench.get("/api/me")[0] == 200


# --- Pages ---

def type_in(page, old, new):
    page.run(f"(() => {{ const a = document.getElementById('config-text'); a.value = a.value.replace({old}, {json.dumps(new)}); a.dispatchEvent(new Event('input')); }})()")


def open_editor(page):
    click(page, "[data-tab=configuration]")
    page.wait("document.getElementById('config-verdict') !== null && !/…/.test(document.getElementById('config-verdict').textContent)", "it was checked", 40)


def verdict(page, text):
    page.wait(f"document.getElementById('config-verdict')?.textContent === {json.dumps(text)}", text, 40)


RIGHT, SAME = "No mistakes. Nothing changes before it is applied.", "This is the configuration in force."


def editor_in_a_browser(bench):
    """A person changes a value, makes a mistake, sees it at its line, mends it, looks at the difference, applies; another editor is told; a dead panel and a closed page lose nothing."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    quiet(bench)
    own = configuration(bench)[1]
    with Page(f"http://127.0.0.1:{bench.web}/", 1280, 900) as page, Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as second:
        for one in (page, second):
            one.wait("document.getElementById('state').textContent.startsWith('SETTLED')", "shown")
            open_editor(one)
            assert one.run("document.getElementById('config-text').value") == own
        type_in(second, "/$/", "; the other one\n")
        verdict(second, RIGHT)
        line = own[:own.index("stroke_mm")].count("\n") + 1
        type_in(page, "/stroke_mm = .*/", "stroke_mm = -3<b>")
        page.wait("document.querySelector('.mistake') !== null", "the mistake", 40)
        run = bench.heaved("--config", bench.file("wrong.ini", re.sub("stroke_mm = .*", "stroke_mm = -3<b>", own)), "--check")
        said = run.stderr.strip().split(f"wrong.ini:{line}: ", 1)[1]
        assert page.run("document.querySelector('.mistake').textContent") == f"line {line}: {said}", said
        assert said in page.run("document.querySelector('.marks .wrong .beside').textContent") and page.run("document.querySelector('.numbers .wrong').textContent") == f"✖ {line}\n"
        click(page, ".mistake")
        assert "extension from end to end" in page.run("document.getElementById('config-help').textContent")
        page.picture(PICTURES / "configuration-mistake-1280-en.png")
        click(page, "[data-view=changes]")
        assert page.run("document.getElementById('config-apply').disabled") is True
        click(page, "[data-view=text]")
        type_in(page, "/stroke_mm = .*/", re.search("stroke_mm = .*", own)[0])
        verdict(page, SAME)
        type_in(page, "/following_error_mm = .*|\\[cylinders\\]\\n/", "[cylinders]\nfollowing_error_mm = 17\n" if "following_error_mm" not in own else "following_error_mm = 17")
        verdict(page, RIGHT)
        bench.end_panel(signal.SIGKILL)  # the network is gone, and the page is built anew
        page.wait("document.getElementById('link').className === 'lost'", "lost")
        bench.start_panel()
        page.wait("document.getElementById('link').className === ''", "back")
        open_editor(page)
        assert "following_error_mm = 17" in page.run("document.getElementById('config-text').value")
        page.run("location.reload()")
        page.wait("document.getElementById('state').textContent.startsWith('SETTLED')", "shown")
        open_editor(page)
        assert "is here again" in page.run("document.getElementById('config-notices').textContent")
        click(page, "[data-act=take]")
        click(page, "[data-view=changes]")
        assert "[cylinders] following_error_mm" in page.run("document.getElementById('config-changes').textContent") and "at once" in page.run("document.getElementById('config-changes').textContent")
        assert "+ following_error_mm = 17" in page.run("document.querySelector('.diff').innerText")
        page.wait("!document.getElementById('config-apply').disabled", "it may be applied")
        page.picture(PICTURES / "configuration-changes-1280-en.png")
        click(page, "#config-apply")
        harness.wait_for(lambda: "following_error_mm = 17" in configuration(bench)[1], "it is in force")
        verdict(page, SAME)
        second.wait("document.getElementById('config-notices').textContent.includes('Somebody else')", "the second editor is told", 40)
        second.wait("document.getElementById('config-text') === null || document.getElementById('config-text').value.endsWith('; the other one\\n')", "and keeps the text", 40)
        second.picture(PICTURES / "configuration-stale-820-en.png")
        click(second, "[data-act=take]")
        click(second, "[data-view=changes]")
        assert second.run("document.getElementById('config-apply').disabled") is True
        click(second, "[data-act=rebase]")
        second.wait("document.querySelector('.diff')?.innerText.includes('- following_error_mm = 17')", "the difference to the one in force", 40)
        page.run("localStorage.clear()")
        assert page.problems == [] or all("WebSocket" in one or "ERR_CONNECTION" in one or "Failed to load" in one for one in page.problems), page.problems


def cannot_start_in_a_browser(bench):
    """A person applies one that cannot be started: both pages say that the one before is in force again, and why; the text is there again, to be mended and applied."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    quiet(bench)
    own = configuration(bench)[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken, Page(f"http://127.0.0.1:{bench.web}/", 820, 1180) as page:
        taken.bind(("0.0.0.0", 0))
        port = taken.getsockname()[1]
        page.wait("document.getElementById('state').textContent.startsWith('SETTLED')", "shown")
        open_editor(page)
        type_in(page, "/port = \\d+/", f"port = {port}")
        verdict(page, RIGHT)
        click(page, "[data-act=take]")
        click(page, "[data-view=changes]")
        page.wait("!document.getElementById('config-apply').disabled", "it may be applied")
        click(page, "#config-apply")
        page.wait(f"document.getElementById('config-put-back')?.textContent.includes('port {port}')", "the page tells", 60)
        open_editor(page)
        assert f"port = {port}" in page.run("document.getElementById('config-text').value") and configuration(bench)[1] == own
        assert "is here again" in page.run("document.getElementById('config-notices').textContent")
        page.picture(PICTURES / "configuration-put-back-820-en.png")
        click(page, "#language")
        page.wait(f"/端口 {port}：.*占用/.test(document.getElementById('config-put-back')?.textContent)", "in Chinese")
        assert "in use" not in page.run("document.getElementById('config-put-back').textContent")
        click(page, "#language")
        page.wait("document.getElementById('config-put-back')?.textContent.includes('in use')", "and in English again")
        click(page, "[data-tab=operate]")
        page.wait("document.querySelector('.notice.bad')?.textContent.includes('could not be started')", "operators see it too")
        other = harness.free_port()
        open_editor(page)
        type_in(page, "/port = \\d+/", f"port = {other}")
        verdict(page, RIGHT)
        click(page, "[data-view=changes]")
        page.wait("!document.getElementById('config-apply').disabled", "mended, it may be applied")
        click(page, "#config-apply")
        harness.wait_for(lambda: put_back(bench) == "" and f"port = {other}" in configuration(bench)[1], "it is in force")
        page.wait("document.getElementById('state').textContent.startsWith('OFF')", "heaved is there again", 60)
        open_editor(page)
        verdict(page, SAME)
        assert page.run("localStorage.getItem('heave-draft-ride')") is None


def sizes_in_a_browser(bench):
    """Joints as they stand, by sizes: the same joints; a size that cannot be is told at its field in the words of --check, the picture follows one that can."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    quiet(bench)
    before = bench.raw("geometry")
    with Page(f"http://127.0.0.1:{bench.web}/", 1280, 900) as page:
        page.wait("document.getElementById('state').textContent.startsWith('SETTLED')", "shown")
        open_editor(page)
        click(page, "[data-view=sizes]")
        page.wait("document.querySelectorAll('.plan .joint').length === 12", "the plan")
        click(page, "[data-mode=sizes]")
        page.wait("document.getElementById('size-base_radius_mm')?.value === '420'", "the circle of the joints", 20)
        verdict(page, RIGHT)
        page.run("(() => { const a = document.getElementById('size-base_radius_mm'); a.focus(); a.value = '5000'; a.dispatchEvent(new Event('input')); })()")
        page.wait("document.getElementById('size-base_radius_mm-wrong').textContent.includes('out of range; allowed:')", "the field says what is wrong", 40)
        page.run("(() => { const a = document.getElementById('size-base_radius_mm'); a.value = '430'; a.dispatchEvent(new Event('input')); })()")
        verdict(page, RIGHT)
        assert page.run("document.querySelector('.plan .value').textContent") == "430.0 mm"
        page.picture(PICTURES / "configuration-sizes-1280-en.png")
        text = page.run("JSON.parse(localStorage.getItem('heave-draft-ride')).text")
        page.run("localStorage.clear()")
        assert page.problems == [], page.problems
    run = bench.heaved("--config", bench.file("sizes.ini", changed(text, "base_radius_mm", "420")), "--check", "--json")
    after = json.loads(run.stdout)["geometry"]
    for what in ("base_mm", "plate_mm"):
        assert all(abs(a - b) < 0.01 for p, q in zip(before[what], after[what]) for a, b in zip(p, q)), (what, before[what], after[what])


DRAFT = """import('/draft.js').then((d) => {
  const text = '; head\\n[a]\\nx = 1 ; why\\n; y = 2\\n\\n[b]\\nx = 3\\n';
  const parts = d.difference('a\\nb\\nc\\nd', 'a\\nc\\nx\\nd').map(([s, l]) => s + l);
  return { entries: d.entriesOf(text).map((e) => [e.section, e.key, e.value, e.line]), changed: d.withValue(text, 'a', 'x', '7'), added: d.withValue(text, 'a', 'z', '8'), gone: d.withValue(text, 'b', 'x', null),
           fresh: d.withValue(text, 'c', 'q', '9'), parts, same: d.difference(text, text).every(([s]) => s === ' '), long: d.difference(Array(3000).fill('p').join('\\n'), Array(3000).fill('q').join('\\n')).length };
})"""


def drafts(bench):
    """The parts of the front end that edit and compare texts."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    bench.both()
    with Page(f"http://127.0.0.1:{bench.web}/", 820, 900) as page:
        page.wait("document.getElementById('state').textContent !== ''", "shown")
        got = page.run(DRAFT)
    assert got["entries"] == [["a", "x", "1", 3], ["b", "x", "3", 7]], got["entries"]
    assert got["changed"] == "; head\n[a]\nx = 7 ; why\n; y = 2\n\n[b]\nx = 3\n" and got["added"] == "; head\n[a]\nx = 1 ; why\nz = 8\n; y = 2\n\n[b]\nx = 3\n", got
    assert got["gone"] == "; head\n[a]\nx = 1 ; why\n; y = 2\n\n[b]\n" and got["fresh"].endswith("[b]\nx = 3\n\n[c]\nq = 9\n"), got
    assert got["parts"] == [" a", "-b", " c", "+x", " d"] and got["same"] and got["long"] == 6000, got["parts"]


def looks_right(bench):
    """Each view at three widths in both languages: nothing overflows, all has a name and is large enough; axe-core finds no serious fault."""
    if web_socket.browser() is None:
        raise tap.Skip("no Chromium here")
    PICTURES.mkdir(parents=True, exist_ok=True)
    found = subprocess.run([harness.TOP / "tools/lib/axe.sh"], capture_output=True, text=True, check=False)
    axe = Path(found.stdout.strip()).read_text(encoding="utf-8") if found.returncode == 0 else None
    quiet(bench)
    for width, height in ((390, 844), (820, 1180), (1920, 1080)):
        with Page(f"http://127.0.0.1:{bench.web}/", width, height) as page:
            page.wait("document.getElementById('state').textContent.startsWith('SETTLED')", "shown")
            if axe:
                page.run(axe + "; true")
            for language in ("en", "zh"):
                if language == "zh":
                    click(page, "#language")
                open_editor(page)
                type_in(page, "/stroke_mm = .*/", "stroke_mm = -3")
                page.wait("document.querySelector('.mistake') !== null", "a mistake", 40)
                for view in VIEWS:
                    click(page, f"[data-view={view}]")
                    time.sleep(0.4)
                    for what, script in (("overflows", OVERFLOW), ("has no name", UNNAMED), ("is too small for a glove", SMALL)):
                        assert page.run(script) == [], (width, language, view, what, page.run(script))
                    assert page.run("document.documentElement.scrollWidth") <= width, (width, language, view, "is wider than the screen")
                    page.picture(PICTURES / f"configuration-{view}-{width}-{language}.png")
                    if axe:
                        faults = page.run("axe.run(document, {resultTypes: ['violations']}).then((r) => r.violations.filter((v) => ['serious', 'critical'].includes(v.impact)).map((v) => [v.id, v.nodes.map((n) => n.html.slice(0, 120) + ' ' + (n.any[0]?.message ?? '')).slice(0, 3)]))")
                        assert faults == [], (width, language, view, faults)
                page.run("localStorage.removeItem('heave-draft-ride')")
            assert page.problems == [], page.problems


CASES = [("another configuration comes into force", comes_into_force, {}), ("what is refused", is_refused, {}), ("it starts anew in OFF, and leaves nothing behind", starts_anew, {}),
         ("one that cannot be started makes way for the one before", cannot_start, {}), ("a disk that takes its time", disk_takes_its_time, {}), ("by heavectl, in the same words", by_heavectl, {}),
         ("attacks on the editor", attacks, {"passwords": ("look", "operate", "service")}), ("a heaved that does not check", without_heaved, {}), ("one check each", one_check_each, {}), ("texts are edited and compared", drafts, {}),
         ("the editor in a browser", editor_in_a_browser, {}), ("one that cannot be started, in a browser", cannot_start_in_a_browser, {}), ("sizes in a browser", sizes_in_a_browser, {}), ("three widths, two languages, axe-core", looks_right, {})]


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
