#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_service_mode.py BIN JUDGE [MOMENTS [SEED]] - SERVICE as its users meet it: requests of the control socket, heavectl in a terminal whose key is
held, and what becomes of a jog whose client is killed, stopped or cut off, or whose link delivers late, at random moments.

All of it is judged by what heaved itself has written: its trace keeps every limit (tests/judge), its recording says which proofs of the hand it has
taken, and the platform rests 250 ms and a stop after the last of them.
"""
import fcntl
import json
import math
import os
import pty
import random
import re
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path

import harness
import tap

BIN, JUDGE = Path(sys.argv[1]), Path(sys.argv[2])
MOMENTS = int(sys.argv[3]) if len(sys.argv) > 3 else 20
SEED = int(sys.argv[4]) if len(sys.argv) > 4 else 1
HOLD_MS = 250
STOP_MS = 120      # 5 mm/s at the acceleration of [engage] and the jerk of [cylinders], with much to spare
KEY_S = 1 / 30     # a keyboard's repeat
READS_S = 0.3      # what the screen asks for, before the key
CONFIG = {"platform__engage": "manual"}


class Hand(threading.Thread):
    """heavectl in a terminal of its own, with a key that is held from when it is asked for until let_go(). is_early: it is down before that."""

    def __init__(self, bench, *arguments, path=None, is_early=False):
        super().__init__(daemon=True)
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen([BIN / "heavectl", "--socket", str(path or bench.socket), *arguments], stdin=slave, stdout=slave, stderr=slave,
                                        start_new_session=True)
        os.close(slave)
        self.is_held, self.is_over, self.text, self.is_asked = True, False, b"", is_early
        self.start()

    def run(self):
        next_key = time.monotonic()
        while not self.is_over:
            try:
                if select.select([self.master], [], [], 0.005)[0]:
                    self.text += os.read(self.master, 4096)
                    if not self.is_asked and b"hold a key, the space bar" in self.text:
                        self.is_asked, next_key = True, time.monotonic() + READS_S
                if self.is_held and self.is_asked and time.monotonic() >= next_key:
                    next_key += KEY_S
                    os.write(self.master, b" ")
            except OSError:
                return

    def let_go(self):
        self.is_held = False

    def hold_until(self, condition, what):
        """As a person would: a busy machine may miss the key for a moment, and then it has to be let go and held again."""
        for _ in range(int(harness.WAIT_S / 3)):
            self.is_held = True
            end = time.monotonic() + 3
            while time.monotonic() < end:
                value = condition()
                if value or self.process.poll() is not None:
                    return value
                time.sleep(0.01)
            self.let_go()
            time.sleep(0.4)
        raise AssertionError(f"{what}: not within {harness.WAIT_S} s: {self.text}")

    def hold_to_end(self):
        """Until the program ends by itself."""
        end, asked = time.monotonic() + 3 * harness.WAIT_S, 0
        while self.process.poll() is None:
            assert time.monotonic() < end, f"it does not end: {self.text}"
            if self.text.count(b"let go") > asked:  # the machine missed the key, and the program says so
                asked = self.text.count(b"let go")
                self.let_go()
                time.sleep(0.4)
            self.is_held = b"there: let go" not in self.text
            time.sleep(0.02)
        self.let_go()
        self.join(timeout=10)  # until the terminal has nothing more to say

    def key(self, byte):
        os.write(self.master, byte)

    def end(self):
        self.is_over = True
        if self.process.poll() is None:
            self.process.kill()
            self.process.send_signal(signal.SIGCONT)
        self.process.wait()
        self.join()
        os.close(self.master)


class Between(threading.Thread):
    """A link that can be cut, or that keeps what the client says and delivers it all at once."""

    def __init__(self, bench, name):
        super().__init__(daemon=True)
        self.path = bench.folder / name
        self.door = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.door.bind(str(self.path))
        self.door.listen(1)
        self.target, self.is_stalled, self.is_over, self.kept = bench.socket, False, False, b""
        self.near = self.far = None
        self.start()

    def run(self):
        self.near, _ = self.door.accept()
        self.far = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.far.connect(str(self.target))
        try:
            while not self.is_over:
                for link in select.select([self.near, self.far], [], [], 0.005)[0]:
                    data = link.recv(65536)
                    if not data:
                        return
                    if link is self.far:
                        self.near.sendall(data)
                    elif self.is_stalled:
                        self.kept += data
                    else:
                        self.far.sendall(data)
                if not self.is_stalled and self.kept:
                    self.far.sendall(self.kept)
                    self.kept = b""
        except OSError:
            pass

    def end(self):
        self.is_over = True
        self.join()
        for link in (self.near, self.far, self.door):
            if link is not None:
                link.close()


# --- What heaved has written ---

HELD = re.compile(r"^([0-9.]+) !(jog|home|relay|signal|beat) (.*)$")
RELEASED = re.compile(r"^([0-9.]+) !(release|hold|service-off)\b")


def hands_of(record):
    """(from, until) in ms of each hand: the recording has what was taken, and how old the tick was that it echoed."""
    hands = []
    for line in record.read_text().splitlines():
        held, released = HELD.match(line), RELEASED.match(line)
        if held:
            t, age_ms = float(held[1]), int(held[3].split()[-1]) / 1000
            assert age_ms < HOLD_MS, f"a stale proof was taken: {line}"
            if held[2] != "beat":
                hands.append([t, t - age_ms + HOLD_MS])
            else:
                assert hands and t <= hands[-1][1], f"a beat was taken after its end: {line}"
                hands[-1][1] = max(hands[-1][1], t - age_ms + HOLD_MS)
        elif released and hands:
            hands[-1][1] = min(hands[-1][1], float(released[1]))
    return hands


def judge(bench, trace, record):
    """Every limit, and rest wherever there is no hand; the hands."""
    harness.judge_trace(JUDGE, bench.config, trace)
    harness.check_trace(bench.config, trace)
    hands = hands_of(record)
    last, allowed, moved = None, iter(hands), 0
    hand = next(allowed, None)
    for row in harness.rows_of(trace.read_bytes()):
        t = float(row["t_ms"])
        here = [row[f"c{i}_mm"] for i in range(1, 7)]
        while hand and t > hand[1] + STOP_MS:
            hand = next(allowed, None)
        if last is not None and here != last and row["state"] == "SERVICE":
            moved += 1
            assert hand and t >= hand[0], f"moves at {t} ms, where no hand is; hands: {hands}"
        last = here
    return hands, moved


def serve(bench, name):
    """heaved in SERVICE, from SETTLED; its trace and its recording."""
    trace, record = bench.folder / f"{name}.csv", bench.folder / f"{name}.frames"
    daemon = bench.start("--trace", trace, "--record", record)
    assert bench.ctl("park").returncode == 0
    bench.wait_state("SETTLED")
    run = bench.ctl("service")
    assert run.returncode == 0 and run.stdout.strip() == "service: SERVICE", run
    return daemon, trace, record


def end(bench, daemon):
    assert bench.ctl("service-off").returncode == 0
    bench.wait_state("OFF")
    assert bench.stop(daemon) == 0, daemon.log.read_text()


# --- Cases ---

def requests():
    with harness.Bench(BIN, **CONFIG) as bench:
        daemon = bench.start()
        with harness.Line(bench.socket) as line:
            assert line.refused("jog 1 5 1", "in SERVICE only")["why"] == "not-serving"
            assert line.good("service")["state"] == "SERVICE"
            assert line.good("status")["service"]["doing"] == "nothing"
            line.refused("engage", "possible: torque, jog, home, relay, hold, service-off")
            tick = harness.wait_for(lambda: (lambda t: t if t > 10**6 else None)(line.good("tick")["tick"]), "a second has passed")
            line.refused(f"jog 1 5 {tick}", "no torque")
            for wrong, text in (("jog 1", "jog: `jog N SPEED TICK`"), ("jog w 5 1", "jog:"), ("jog 1 x 1", "jog:"), ("jog 1 0 1", "jog:"), ("jog 9 5 1 1 1", "jog:"),
                                ("jog 1 5 -1", "jog:"), ("torque", "torque:"), ("torque 1 up", "torque:"), ("torque 9 on", "no such drive"), ("home", "home:"),
                                ("relay all 1", "relay:"), ("beat 1 0 1", "beat:"), ("release", "release:"), ("beat 1 1 1", "press again"),
                                (f"relay 13 {line.good('tick')['tick']}", "no such"), (f"jog z 5 {tick + 10**9}", "older than 250 ms"), ("jog 1 5 1", "older than 250 ms")):
                line.refused(wrong, text)
            line.good("torque 2 on")
            harness.wait_for(lambda: line.good("counts")["drives"][1]["torque"], "drive 2 has torque")
            drives = line.good("counts")["drives"]
            assert [drive["torque"] for drive in drives].count(True) == 1 and len(drives) == 7, drives
            assert all(isinstance(drive["counts"], int) for drive in drives), drives
            before = drives[1]["counts"]
            answer = line.press("jog 2 5")
            assert answer["held"] and answer["doing"] == "jog" and answer["axis"] == 2, answer
            series, counter = answer["series"], 0
            for counter in range(1, 12):
                time.sleep(0.05)
                answer = line.ask(f"beat {series} {counter} {answer['tick']}")
                assert answer["ok"] or "press again" in answer["error"], answer
            line.good(f"release {series}")
            assert line.good("counts")["drives"][1]["counts"] > before
            line.refused(f"beat {series} {counter + 1} {answer['tick']}", "press again")
            harness.wait_for(lambda: line.ask("torque all on")["ok"], "it has come to rest")
            harness.wait_for(lambda: all(drive["torque"] for drive in line.good("counts")["drives"]), "all have torque")
            line.good("hold")
            assert line.good("service-off")["state"] == "OFF"
        run = bench.ctl("counts")
        assert run.returncode == 0 and len(run.stdout.splitlines()) == 7 and "counts" in run.stdout, run
        run = bench.ctl("jog", "1", "5mm/s", stdin=subprocess.DEVNULL)
        assert run.returncode == 64 and "takes a terminal" in run.stderr, run
        assert bench.ctl("jog", "1").returncode == 64
        for wrong, words in (("3 5deg/s", "jog 3: this axis moves in mm, not in degrees"), ("z 5deg/s", "moves in mm"), ("roll 2mm/s", "turns in degrees, not in mm"), ("3 5mm/s 2deg", "moves in mm")):
            run = bench.ctl("jog", *wrong.split())
            assert run.returncode == 64 and words in run.stderr, run
        assert bench.stop(daemon) == 0
        log = daemon.log.read_text()
        assert "OFF -> SERVICE (service)" in log and "SERVICE -> OFF (service-off)" in log, log


def in_a_terminal():
    """A key that is down already, a tap and Enter move nothing; a key that is held moves, until it is let go or q is pressed; a refusal ends with its reason."""
    with harness.Bench(BIN, **CONFIG) as bench:
        daemon, trace, record = serve(bench, "terminal")
        tap_hand = Hand(bench, "jog", "3", "5mm/s", is_early=True)
        harness.wait_for(lambda: b"let go of the key first" in tap_hand.text, "the screen says what to do")
        time.sleep(1)
        assert bench.status()["service"]["series"] == 0, "a key that was down already has begun something"
        tap_hand.let_go()
        time.sleep(0.6)
        tap_hand.key(b" ")
        time.sleep(0.6)
        assert bench.status()["service"]["series"] == 0, "a tap has begun something"
        told = tap_hand.text.count(b"let go of the key first")
        for _ in range(30):
            tap_hand.key(b"\r")
            time.sleep(KEY_S)
        assert bench.status()["service"]["series"] == 0, "Enter has begun something"
        assert tap_hand.text.count(b"let go of the key first") > told, tap_hand.text
        time.sleep(0.6)
        tap_hand.hold_until(lambda: bench.status()["service"]["held"], "the key is held")
        time.sleep(0.5)
        tap_hand.let_go()
        harness.wait_for(lambda: not bench.status()["service"]["held"], "let go")
        tap_hand.key(b"q")
        assert tap_hand.process.wait(timeout=harness.WAIT_S) == 0, tap_hand.text
        assert not termios.tcgetattr(tap_hand.master)[3] & termios.ICANON == 0, "the terminal stays raw"
        tap_hand.end()
        hand = Hand(bench, "jog", "z", "-2")
        hand.hold_until(lambda: bench.status()["service"]["held"], "z goes down")
        hand.end()
        hand = Hand(bench, "relay", "12")
        hand.hold_until(lambda: bench.status()["service"]["doing"] == "relay", "the relay is held")
        hand.let_go()
        hand.end()
        hand = Hand(bench, "jog", "11", "5")
        assert hand.process.wait(timeout=harness.WAIT_S) == 1, hand.text
        hand.end()
        assert b"no such drive" in hand.text, hand.text
        end(bench, daemon)
        hands, moved = judge(bench, trace, record)
        assert len(hands) >= 2 and moved > 400, (hands, moved)


def lift(line, mm):
    """z up by so much, with a hand at the socket."""
    answer = line.press("jog z 5")
    for counter in range(1, int(mm / 5 / 0.05)):
        time.sleep(0.05)
        answer = line.ask(f"beat {answer['series']} {counter} {answer['tick']}")
    line.good(f"release {answer['series']}")
    harness.wait_for(lambda: line.good("tick")["doing"] == "nothing", "rests")
    time.sleep(0.3)


def identify():
    """Lag and gain of simulated drives that are known; a hand that lets go leaves nothing known; all of it within every limit."""
    for lag_ms in (12, 40):
        with harness.Bench(BIN, sim__lag_ms=lag_ms, **CONFIG) as bench:
            daemon, trace, record = serve(bench, "identify")
            with harness.Line(bench.socket) as line:
                line.refused(f"signal z sine 2 1 6 {line.good('tick')['tick']}", "way to both sides")
                lift(line, 15)
                for wrong, why in (("signal z sine 20 1 6", "signal_mm"), ("signal z sine 2 1 5", "six periods"), ("signal z saw 2 1 6", "signal:"), ("signal 9 sine 2 1 6", "no such")):
                    line.refused(f"{wrong} {line.good('tick')['tick']}", why)
            hand = Hand(bench, "signal", "z", "sine", "2", "1", "6")
            hand.hold_to_end()
            hand.end()
            assert hand.process.returncode == 0 and b"there" in hand.text, hand.text
            cut = Hand(bench, "identify", "z")
            cut.hold_until(lambda: bench.status()["service"]["doing"] == "signal", "the chirp goes on")
            cut.let_go()
            harness.wait_for(lambda: bench.status()["service"]["doing"] == "nothing", "let go")
            cut.key(b"q")
            assert cut.process.wait(timeout=harness.WAIT_S) == 1, cut.text
            cut.join(timeout=10)
            assert b"ended before" in cut.text, cut.text
            cut.end()
            file = bench.folder / "z.csv"
            hand = Hand(bench, "--json", "--band", "0.5-20", "--for", "24", "identify", "z", str(file))
            hand.hold_to_end()
            hand.end()
            assert hand.process.returncode == 0, hand.text
            found = json.loads(hand.text[hand.text.index(b'{"ok"'):])
            assert len(found["channels"]) == 7, found
            for channel in found["channels"]:
                assert abs(channel["lag_ms"] - lag_ms - 0.5) < 0.05 * lag_ms + 0.5, (lag_ms, channel)  # a cycle of the daemon is in it, too
                assert abs(channel["gain"] - 1) < 0.05 and channel["hysteresis"] < 0.02, channel
                corner_hz = 1000 / (2 * math.pi * lag_ms)
                assert channel["gain_3db_hz"] is not None and abs(channel["gain_3db_hz"] / corner_hz - 1) < 0.05, (corner_hz, channel)
                assert all(point["coherence"] > 0.95 for point in channel["response"]), channel
            assert len(file.read_text().splitlines()) == 2 + 7 * 25
            plot = subprocess.run([sys.executable, harness.TOP / "tools/plot", file, "--what", "bode", "-o", bench.folder / "z.png"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            assert plot.returncode == 0 or "matplotlib" in plot.stdout, plot.stdout
            end(bench, daemon)
            hands, moved = judge(bench, trace, record)
            assert len(hands) >= 4 and moved > 20000, (hands, moved)


def moments(bench, index, rng):
    """One jog and what happens to its client."""
    what = ("killed", "stopped", "cut", "stalled")[index % 4]
    between = Between(bench, f"between{index}") if what in ("cut", "stalled") else None
    axis, speed = rng.choice((("2", 5), ("z", 4), ("5", -5), ("roll", 1), ("1", 5), ("z", -4)))
    hand = Hand(bench, "jog", axis, str(speed * rng.choice((1, -1))), path=between.path if between else None)
    before = bench.status()["service"]["series"]
    with harness.Line(bench.socket) as line:
        hand.hold_until(lambda: line.good("tick")["series"] != before, "pressed")
        hand.is_held = True
        time.sleep(rng.uniform(0, 0.7))
        if what == "killed":
            hand.process.kill()
        elif what == "stopped":
            hand.process.send_signal(signal.SIGSTOP)
        elif what == "cut":
            between.is_over = True
            between.join()
            between.near.shutdown(socket.SHUT_RDWR)
            between.far.shutdown(socket.SHUT_RDWR)
        else:
            between.is_stalled = True
        harness.wait_for(lambda: not line.good("tick")["held"], f"{what}: let go", 0.01)
        series = line.good("tick")["series"]
        time.sleep(rng.uniform(0, 0.5))
        if what == "stopped":
            hand.process.send_signal(signal.SIGCONT)
        elif what == "stalled":
            between.is_stalled = False
        time.sleep(0.3)
        answer = line.good("tick")
        assert answer["series"] == series and not answer["held"], f"{what}: begun again without the key let go: {answer}, {hand.text}"
        harness.wait_for(lambda: line.good("tick")["doing"] == "nothing", "rests")
    hand.end()
    if between:
        between.end()
    return what


def client_gone():
    with harness.Bench(BIN, **CONFIG) as bench:
        daemon, trace, record = serve(bench, "gone")
        rng = random.Random(SEED)
        seen = [moments(bench, i, rng) for i in range(MOMENTS)]
        end(bench, daemon)
        hands, moved = judge(bench, trace, record)
        assert len(hands) >= MOMENTS * 3 // 4 and moved > MOMENTS * 50, (len(hands), moved)
        print(f"# figure {len(seen)} clients gone in a jog: at rest {HOLD_MS} ms and a stop later, {moved} cycles of motion within all limits", flush=True)


def plays_back():
    """A recording of a jog, from a client of its own, plays back to the same bytes."""
    with harness.Bench(BIN, **CONFIG) as bench:
        daemon, trace, record = serve(bench, "played-live")
        with harness.Line(bench.socket) as line:
            for request in ("jog 3 5", "jog z -3", "relay 2", "jog pitch 1.5", "home 4", "jog 1 -2.125"):
                answer = line.press(request)
                series = answer["series"]
                for counter in range(1, 8):
                    time.sleep(0.05)
                    answer = line.ask(f"beat {series} {counter} {answer['tick']}")
                line.good(f"release {series}")
                harness.wait_for(lambda: line.good("tick")["doing"] == "nothing", "rests")
                time.sleep(0.3)
                if request == "home 4":
                    harness.wait_for(lambda: line.ask("torque 4 on")["ok"], "torque again")
                    harness.wait_for(lambda: line.good("counts")["drives"][3]["torque"], "has torque")
        end(bench, daemon)
        live = harness.since_zero(trace.read_bytes())
        played = harness.since_zero(bench.play(record))
        same = min(len(live), len(played))
        assert same > 100000 and live[:same] == played[:same], "the replay differs"


def black_box():
    """An incident in a jog begins with what heaved knew at some time, and has the requests behind it."""
    with harness.Bench(BIN, **CONFIG) as bench:
        bench.config.write_text(bench.config.read_text() + f"\n[black-box]\ndirectory = {bench.folder}\nseconds = 10\n")
        daemon, _, _ = serve(bench, "box")
        time.sleep(9)  # so that time zero is forgotten
        with harness.Line(bench.socket) as line:
            answer = line.press("jog 3 5")
            for counter in range(1, 140):
                time.sleep(0.05)
                answer = line.ask(f"beat {answer['series']} {counter} {answer['tick']}")
            dumped, code = bench.ask("dump")
        assert code == 0, dumped
        folder = Path(dumped["folder"])
        held = (folder / "frames").read_text()
        assert " !state " in held and " !beat " in held and " !jog " in held, held[:300]
        live = (folder / "trace.csv").read_bytes().splitlines()
        played = bench.play(folder / "frames").splitlines()[1:]
        at = live.index(played[0])
        same = min(len(played), len(live) - at)
        assert same > 5000 and live[at:at + same] == played[:same], "the replay of the incident differs"
        end(bench, daemon)


def main():
    suite = tap.Suite()
    for name, case in (("requests are taken, or refused by name", requests),
                       ("heavectl in a terminal: while the key is held", in_a_terminal),
                       ("identify: lag, gain and corner of drives that are known", identify),
                       ("a client killed, stopped, cut off or late: at rest 250 ms and a stop later", client_gone),
                       ("a recording of service plays back to the same bytes", plays_back),
                       ("a black box in a jog plays back to the same bytes", black_box)):
        with suite.case(name):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
