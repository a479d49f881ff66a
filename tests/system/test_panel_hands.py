#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_panel_hands.py BIN [MOMENTS [SEED]] - a hand at the panel that goes in the middle of a jog, at random moments and in every way: a page closed, hidden, frozen or killed, a network that is pulled,
a panel that is killed or stands still. Judged from heaved's own samples: at rest within 250 ms and the stopping time, and whatever arrives later, in a burst, moves nothing."""
import contextlib
import json
import mmap
import os
import random
import re
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import traceback
import urllib.request
from pathlib import Path

import harness
import tap
import web_socket
from web_socket import Page

BIN = Path(sys.argv[1])
MOMENTS = int(sys.argv[2]) if len(sys.argv) > 2 else 52  # each way four times; tools/nightly: more
SEED = int(sys.argv[3]) if len(sys.argv) > 3 else 1
sys.argv[1:] = [str(BIN), "/nonexistent"]
from test_panel import PanelBench, request, take  # noqa: E402  it reads its arguments
from test_panel_pages import mouse  # noqa: E402  and so does this

LEG, SPEED, BENCHES, TRIES = 2, 5.0, 3, 40
HELD_S = 0.25
SPARE_S = 0.002  # a cycle to take note, one to begin
LOOK_S = 0.5  # afterwards
WAYS = ("released", "silent", "socket closed", "socket reset", "network pulled", "panel killed", "panel stopped")
PAGE_WAYS = ("tab closed", "tab hidden", "tab frozen", "browser stopped", "browser killed", "finger lifted")


class Motion:
    """What heaved has sent to the leg, cycle by cycle: out of the memory that it shares."""

    def __init__(self, path):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
            link.settimeout(harness.WAIT_S)
            link.connect(str(path))
            link.sendall(b"samples\n")
            _, fds, _, _ = socket.recv_fds(link, 4096, 1)
        self.memory = mmap.mmap(fds[0], os.fstat(fds[0]).st_size, mmap.MAP_SHARED, mmap.PROT_READ)
        os.close(fds[0])
        self.first, self.size, self.capacity, columns, row = struct.unpack_from("=5I", self.memory, 12)
        self.offset_s = 0.0
        self.at = {}
        for i in range(columns):
            name, _, kind, at, scale = struct.unpack_from("=32s12s4sI4xd", self.memory, 128 + i * row)
            self.at[name.split(b"\0")[0].decode()] = (at, {b"u4": "=I", b"u8": "=Q", b"i8": "=q"}.get(kind.split(b"\0")[0]), scale)

    def value(self, number, name):
        at, form, scale = self.at[name]
        return struct.unpack_from(form, self.memory, self.first + number % self.capacity * self.size + at)[0] * scale

    def mark(self):
        """Takes the clocks together: that of heaved stands still where a machine is so busy that cycles are left out."""
        written = struct.unpack_from("=Q", self.memory, 56)[0]
        self.offset_s = time.monotonic() - self.value(written - 1, "t_ms") / 1000

    def rows(self, since_s, is_marked=False):
        """(time on CLOCK_MONOTONIC, position of the leg) from a time on."""
        if not is_marked:
            self.mark()
        written = struct.unpack_from("=Q", self.memory, 56)[0]
        out = []
        for number in range(written - 1, max(0, written - self.capacity + 100), -1):
            at_s = self.offset_s + self.value(number, "t_ms") / 1000
            if at_s < since_s:
                break
            out.append((at_s, self.value(number, f"sent_c{LEG}_mm")))
        return out[::-1]


class Wire(threading.Thread):
    """A network between a page and the panel. It can be pulled: nothing passes, nothing is said; and put in again: all of it arrives at once."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.to, self.is_pulled, self.waiting, self.burst = port, False, 0, 0
        self.listening = socket.create_server(("127.0.0.1", 0))
        self.port = self.listening.getsockname()[1]
        self.start()

    def run(self):
        with contextlib.suppress(OSError):
            while True:
                near = self.listening.accept()[0]
                far = socket.create_connection(("127.0.0.1", self.to))
                for one, other in ((near, far), (far, near)):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    threading.Thread(target=self.pass_on, args=(one, other, one is near), daemon=True).start()

    def pass_on(self, one, other, is_up):
        kept = b""
        with contextlib.suppress(OSError, ValueError):
            while True:
                if select.select([one], [], [], 0.01)[0]:
                    data = one.recv(65536)
                    if not data:
                        break
                    kept += data
                    if is_up:
                        self.waiting = len(kept)
                if kept and not self.is_pulled:
                    if is_up:
                        self.burst = max(self.burst, len(kept))
                    other.sendall(kept)
                    kept = b""
        for end in (one, other):
            with contextlib.suppress(OSError):
                end.close()


class Beating:
    """A hand as a page has it: presses, beats every 50 ms with the newest tick that it has heard, until it is told to stop."""

    def __init__(self, bench, port):
        self.link = web_socket.WebSocket("127.0.0.1", port, "/ws", protocol="heave-panel.1", origin=f"http://127.0.0.1:{port}")
        self.sending, self.hearing = threading.Lock(), threading.Lock()  # the number of a closed descriptor is soon that of another one
        self.bench, self.tick, self.series, self.counter, self.is_beating = bench, 0, 0, 0, False
        take(self.link)
        for line in ("service", "torque all on"):
            with contextlib.suppress(KeyError):
                request(self.link, line)
        harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")

    def press(self, speed):
        """True once it is held."""
        tick = request(self.link, "tick")["answer"]["tick"]
        answer = self.link.ask({"op": "press", "platform": "ride", "line": f"jog {LEG} {speed}", "tick": tick}).get("answer", {})
        if not answer.get("ok"):
            return False
        self.series, self.tick, self.counter, self.is_beating = answer["series"], answer["tick"], 0, True
        for work in (self.beat, self.hear):
            threading.Thread(target=work, daemon=True).start()
        return True

    def beat(self):
        with contextlib.suppress(OSError):
            while self.is_beating:
                self.counter += 1
                with self.sending:
                    if self.is_beating:
                        self.link.send({"id": 0, "op": "beat", "platform": "ride", "series": self.series, "counter": self.counter, "tick": self.tick})
                time.sleep(0.05)

    def hear(self):
        with contextlib.suppress(OSError, ValueError):
            while self.is_beating:
                with self.hearing:
                    if self.is_beating and (self.link.waiting or select.select([self.link.socket], [], [], 0.01)[0]):
                        message = json.loads(self.link.next()[1])
                        if message.get("event") == "tick":
                            self.tick = message["tick"]["tick"]
                time.sleep(0.001)

    def close(self):
        self.is_beating = False
        with self.sending, self.hearing, contextlib.suppress(OSError):
            self.link.socket.close()


def value_of(text, section, key):
    return float(re.search(rf"(?ms)^\[{section}\]$.*?^{key} = ([\d.]+)$", text)[1])


def rows_told(rows):
    return f"{len(rows)}: {rows[:1]} to {rows[-1:]}"


def has_page(port):
    """Whether the browser has a tab, or is there at all."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=5) as answer:
            return any(one["type"] == "page" for one in json.load(answer))
    except OSError:
        return False


class NotHeld(AssertionError):
    """It was at rest before the hand went, as beats that are late beside load end a jog: the moment says nothing, and is tried again."""


class Stand:
    """heaved, a panel, and moments of jogs on it."""

    def __init__(self, seed):
        self.random, self.problems, self.worst_s, self.done, self.unheld = random.Random(seed), [], 0.0, {}, 0
        self.bench = PanelBench()

    def run(self, moments):
        """moments: the way of each."""
        with self.bench as bench:
            bench.both()
            dump = subprocess.run([BIN / "heaved", "--config", bench.config, "--dump-config"], capture_output=True, text=True, check=True).stdout
            accel, jerk = value_of(dump, "engage", "accel_mm_s2"), value_of(dump, "cylinders", "jerk_mm_s3")
            self.stop_s = SPEED / accel + accel / jerk
            self.motion = Motion(bench.socket)
            for way in moments:
                try:
                    self.moment(way)
                except (AssertionError, OSError, TimeoutError, ConnectionError) as error:
                    where = traceback.extract_tb(error.__traceback__)
                    self.problems.append(f"{way}: {type(error).__name__}: {error} (lines {', '.join(str(frame.lineno) for frame in where)}; the panel {'is there' if bench.panel and bench.panel.poll() is None else 'is gone'})")
                self.done[way] = self.done.get(way, 0) + 1

    def moment(self, way):
        for left in reversed(range(TRIES)):
            try:
                return (self.by_page if way in PAGE_WAYS else self.by_link)(way)
            except NotHeld:
                self.unheld += 1
                if left == 0:
                    raise

    def speed(self):
        """Back and forth about where the legs still are of one plate."""
        return SPEED if self.bench.status()["cylinders"][LEG - 1]["sent_mm"] < 20 else -SPEED

    def wait_moving(self, since_s, timeout_s=1.5):
        """Whether it moves, steadily, as somebody holds it."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            rows = self.motion.rows(since_s)
            if len(rows) > 60 and abs(rows[-1][1] - rows[-51][1]) > 0.1:
                return True
            time.sleep(0.02)
        return False

    def judge(self, went_s, afterwards=lambda: None, began_s=None):
        """From the moment on when the hand was gone. began_s: when it began to go; it was held up to then."""
        self.motion.mark()
        time.sleep(HELD_S + self.stop_s + 0.1)
        afterwards()
        time.sleep(LOOK_S)
        rows = self.motion.rows((began_s or went_s) - 0.1, is_marked=True)
        moving = [at for (at, here), (_, before) in zip(rows[1:], rows) if here != before]
        assert len(rows) > 500, f"{len(rows)} rows"
        if not moving or moving[0] >= (began_s or went_s):
            raise NotHeld(f"{TRIES} times it did not move when the hand went")
        took = moving[-1] - went_s
        self.worst_s = max(self.worst_s, took)
        assert took <= HELD_S + self.stop_s + SPARE_S, f"it moved until {1000 * took:.1f} ms after the hand had gone; {1000 * (HELD_S + self.stop_s):.1f} ms are allowed"
        assert self.bench.raw("tick")["held"] is False, "something is held"

    def by_link(self, way):
        bench = self.bench
        wire = Wire(bench.web)
        hand = Beating(bench, wire.port if way == "network pulled" else bench.web)
        try:
            for _ in range(TRIES):  # beats that come late beside load end it, which is right
                began = time.monotonic()
                if hand.press(self.speed()) and self.wait_moving(began):
                    time.sleep(self.random.uniform(0, 0.4))
                    rows = self.motion.rows(time.monotonic() - 0.03)
                    if len(rows) > 5 and rows[-1][1] != rows[-5][1]:
                        break
                self.unheld += 1
                hand.is_beating = False
                with hand.sending, hand.hearing:
                    time.sleep(0.4)
            else:
                raise AssertionError("it cannot be held")
            getattr(self, way.replace(" ", "_"))(hand, wire)
        finally:
            hand.close()

    def released(self, hand, _):
        hand.is_beating = False
        hand.link.send({"id": 0, "op": "release", "platform": "ride"})
        self.judge(time.monotonic())

    def silent(self, hand, _):
        hand.is_beating = False
        self.judge(time.monotonic())

    def socket_closed(self, hand, _):
        hand.close()
        self.judge(time.monotonic())

    def socket_reset(self, hand, _):
        hand.link.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        hand.close()
        self.judge(time.monotonic())

    def network_pulled(self, _, wire):
        wire.is_pulled = True
        went_s = time.monotonic()
        wire.burst = 0

        def put_in():
            harness.wait_for(lambda: wire.waiting > 300, "beats on their way")
            wire.is_pulled = False  # what the page has sent meanwhile arrives at once
            end = time.monotonic() + 2
            while wire.burst <= 300 and time.monotonic() < end:
                time.sleep(0.01)
            assert wire.burst > 300, f"{wire.burst} bytes: no burst"

        self.judge(went_s, put_in)

    def panel_killed(self, *_):
        began_s = time.monotonic()
        self.bench.panel.send_signal(signal.SIGKILL)  # from here on it sends nothing; waiting for its end may take longer than the stop
        try:
            self.judge(time.monotonic(), began_s=began_s)
        finally:
            self.bench.end_panel(signal.SIGKILL)
            self.bench.start_panel()

    def panel_stopped(self, *_):
        self.bench.panel.send_signal(signal.SIGSTOP)
        went_s = time.monotonic()
        self.judge(went_s, lambda: self.bench.panel.send_signal(signal.SIGCONT))

    # --- A page in a browser ---

    def by_page(self, way):
        bench = self.bench
        with Page(f"http://127.0.0.1:{bench.web}/", 820, 1400) as page:
            page.link.socket.settimeout(15)
            page.wait("document.getElementById('state').textContent.length > 1 && document.querySelector('[data-tab=service]') !== null", "shown")
            page.run("document.querySelector('[data-tab=service]').click()")
            page.wait("document.querySelector('[data-op]') !== null", "the service page")
            page.run("document.querySelector('[data-op=take]').click()")
            page.wait("document.querySelector('[data-op=drop]') !== null", "has the controls")
            if bench.status()["state"] != "SERVICE":
                page.run("document.querySelector(\"[data-request='service']\").click()")
                bench.wait_state("SERVICE")
            page.run("document.querySelector(\"[data-request='torque all on']\").click()")
            harness.wait_for(lambda: all(one["torque"] for one in bench.raw("counts")["drives"]), "torque")
            page.run(f"(() => {{ const s = document.querySelector('input[type=number]'); s.value = {SPEED}; }})()")
            find = lambda speed: page.run(f"(() => {{ const r = document.querySelector('[aria-label=\"{LEG} {'+' if speed > 0 else '−'}\"]'); r.scrollIntoView({{block: 'center'}}); const b = r.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; }})()")
            for _ in range(TRIES):
                began = time.monotonic()
                spot = find(self.speed())
                mouse(page, spot, "mousePressed")
                if self.wait_moving(began):
                    time.sleep(self.random.uniform(0, 0.4))
                    rows = self.motion.rows(time.monotonic() - 0.03)
                    if len(rows) > 5 and rows[-1][1] != rows[-5][1]:
                        break
                self.unheld += 1
                mouse(page, spot, "mouseReleased")
                time.sleep(0.5)
            else:
                raise AssertionError(f"it cannot be held: {page.run('document.body.innerText')[-300:]!r}, {bench.raw('counts')}, rows {rows_told(self.motion.rows(began))}")
            self.end_page(way, page, spot)

    def end_page(self, way, page, spot):
        if way == "finger lifted":
            began_s = time.monotonic()
            mouse(page, spot, "mouseReleased")
            self.judge(time.monotonic(), began_s=began_s)
        elif way == "tab closed":
            began_s = time.monotonic()
            page.link.send({"id": 0, "method": "Page.close"})  # whether it is answered is not known
            harness.wait_for(lambda: not has_page(page.port), "the tab is gone", 0.002)
            self.judge(time.monotonic(), began_s=began_s)
        elif way == "tab hidden":
            began_s = time.monotonic()
            page.run("(() => { Object.defineProperty(document, 'visibilityState', {value: 'hidden'}); document.dispatchEvent(new Event('visibilitychange')); })()")
            self.judge(time.monotonic(), began_s=began_s)
        elif way == "tab frozen":
            began_s = time.monotonic()
            page.do("Page.setWebLifecycleState", state="frozen")
            self.judge(time.monotonic(), lambda: page.do("Page.setWebLifecycleState", state="active"), began_s)
        elif way == "browser stopped":
            began_s = time.monotonic()
            page.kill(signal.SIGSTOP)
            self.judge(time.monotonic(), lambda: page.kill(signal.SIGCONT), began_s)
        else:
            began_s = time.monotonic()
            page.kill()
            self.judge(time.monotonic(), began_s=began_s)


def main():
    harness.go_first()
    suite = tap.Suite()
    stands = [Stand(SEED + i) for i in range(BENCHES)]
    ways = WAYS + (PAGE_WAYS if web_socket.browser() is not None else ())
    moments = [ways[i % len(ways)] for i in range(MOMENTS)]
    random.Random(SEED).shuffle(moments)
    threads = [threading.Thread(target=stand.run, args=(moments[i::BENCHES],)) for i, stand in enumerate(stands)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    done = {way: sum(stand.done.get(way, 0) for stand in stands) for way in WAYS + PAGE_WAYS}
    print(f"# figure seed {SEED}: {', '.join(f'{count} {way}' for way, count in done.items())}; let go by itself {sum(stand.unheld for stand in stands)} times", flush=True)
    print(f"# figure at rest {1000 * max(stand.worst_s for stand in stands):.1f} ms after the hand had gone, at most; {1000 * (HELD_S + stands[0].stop_s):.1f} ms are allowed", flush=True)
    with suite.case(f"{MOMENTS} moments of a jog: at rest in time, and nothing moves afterwards"):
        assert sum(done.values()) == MOMENTS, done
        problems = [problem for stand in stands for problem in stand.problems]
        assert not problems, "\n".join(problems)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
