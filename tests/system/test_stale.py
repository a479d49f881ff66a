#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_stale.py BIN [STOPS [SEED [PART OF A NAME]]] - what was asked or sent while heaved stood still moves nothing later. In virtual time, inside
kernel.py --virtual-time. STOPS is how many stops of 0 to 30 s are tried, and twice the number of
orders of requests."""
import json
import random
import signal
import socket
import subprocess
import sys
import time

import harness
import tap

CYCLE_US = 2000
FRESH_S = 1.0
UNSURE_S = 0.03  # heaved counts from its last look before it stood still, and in cycles
STOPS, SEED = 200, 1
EXIT_UNAVAILABLE = 69
EXIT_REFUSED = 1


class Stopped:
    """heaved stands still for the time of this block, and at least for the given time."""

    def __init__(self, daemon, seconds):
        self.daemon, self.until = daemon, time.monotonic() + seconds

    def __enter__(self):
        self.daemon.send_signal(signal.SIGSTOP)
        return self

    def __exit__(self, *_):
        time.sleep(max(0.0, self.until - time.monotonic()))
        self.daemon.send_signal(signal.SIGCONT)


def bench_of(bin_dir, **changes):
    return harness.Bench(bin_dir, **{"platform__cycle_us": CYCLE_US, "platform__engage": "manual", "platform__late_hold_cycles": 3, **changes})


def frame(t):
    return f"@A6:{2 + t % 1:.3f},1,0,0,0,{5 + t % 1:.3f},0#"


# --- Requests ---

class Client:
    """Somebody who asks once. `is_there`: it still waits when heaved goes on."""

    def __init__(self, bench, way, request, chance, left_s):
        self.way, self.process, self.link = way, None, None
        if way == "heavectl":
            self.process = subprocess.Popen([bench.bin / "heavectl", "--socket", bench.socket, request], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.is_there = left_s < 5
            return
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.link.connect(str(bench.socket))
        self.link.sendall(f"{request}\n".encode())
        self.is_there = way != "gives up"
        if way == "says no more":
            self.link.shutdown(socket.SHUT_WR)
        elif not self.is_there:
            time.sleep(chance.uniform(0, left_s))
            self.link.close()

    def outcome(self):
        """What it was told: True: done; False: too late; None: nothing."""
        if self.process:
            _, error = self.process.communicate()
            assert self.process.returncode in (0, EXIT_REFUSED, EXIT_UNAVAILABLE), error
            assert self.process.returncode != EXIT_REFUSED or "asked more than 1 s ago" in error, error
            return {0: True, EXIT_REFUSED: False, EXIT_UNAVAILABLE: None}[self.process.returncode]
        if not self.is_there:
            return None
        with self.link, self.link.makefile("rb") as file:
            answer = json.loads(file.readline())
        assert answer["ok"] or answer["why"] in ("stale", "held"), answer  # held: heaved was late, too
        return answer["ok"]


WAYS = ("heavectl", "waits", "says no more", "gives up")


def requests_in_a_stop(bench, chance, stops):
    daemon = bench.start()
    assert bench.ctl("park").returncode == 0
    for i in range(stops):
        way, request = WAYS[i % len(WAYS)], chance.choice(("engage", "service"))
        stop_s = chance.choice((chance.uniform(0, FRESH_S - UNSURE_S), chance.uniform(FRESH_S + UNSURE_S, 30)))
        bench.wait_state("SETTLED")
        with Stopped(daemon, stop_s) as stop:
            time.sleep(chance.uniform(0, stop_s))
            client = Client(bench, way, request, chance, stop.until - time.monotonic())
        told = client.outcome()
        time.sleep(0.5)
        state = bench.status()["state"]
        what = f"{request} in a stop of {stop_s:.3f} s, by {way}: told {told}, then {state}"
        if stop_s < FRESH_S and client.is_there:
            assert told is True and state == {"engage": "RISING", "service": "SERVICE"}[request], what
        else:
            assert not told and state == "SETTLED", what
        if state == "RISING":
            assert bench.ctl("park").returncode == 0
        elif state == "SERVICE":
            assert bench.ctl("service-off").returncode == 0
            bench.wait_state("OFF")
            assert bench.ctl("park").returncode == 0
    print(f"# figure {stops} stops of heaved, each with a request in it")
    assert bench.stop(daemon) == 0


def safer_requests_in_a_stop(bench, _chance, _stops):
    """What only makes it safer counts however old it is, and whoever asked."""
    daemon = bench.start()
    assert bench.ctl("engage").returncode == 0
    bench.wait_state("NEUTRAL", "ENGAGED")
    with harness.Line(bench.socket) as line:
        assert line.good("status")["state"] in ("NEUTRAL", "ENGAGED")
        with Stopped(daemon, 20):
            with harness.Line(bench.socket) as gone:
                gone.link.sendall(b"hold\n")
        time.sleep(0.2)
        assert line.good("status")["state"] == "HOLD"
        line.refused("heard 0 resume", "a hold came after it was asked")
        assert line.good(f"heard {line.good('tick')['tick']} resume")["ok"]
    with Stopped(daemon, 20):
        daemon.signal_sent = signal.SIGTERM
        daemon.send_signal(signal.SIGTERM)
        waiting = Client(bench, "waits", "engage", None, 0)
    assert waiting.outcome() is False and daemon.wait(timeout=harness.WAIT_S) == 0, daemon.log.read_text()


# --- Orders of requests ---

MOVING = ("HOMING", "RISING", "NEUTRAL", "ENGAGED", "SETTLING")


def start_state(bench, chance):
    """In which an order begins."""
    wanted = chance.choice(("SETTLED", "HOLD", "RISING"))
    with harness.Line(bench.socket) as line:
        state = line.good("status")["state"]
        if state == "OFF" or (wanted == "SETTLED" and state != "SETTLED"):
            line.good("park")
            bench.wait_state("SETTLED")
        if wanted != "SETTLED":
            line.ask("engage")
            time.sleep(chance.uniform(0.05, 1.5))
        if wanted == "HOLD":
            line.good("hold")
    return wanted


def orders_before_a_hold(bench, chance, stops):
    """Nothing that was asked before HOLD runs after it, whatever waits for what, over whichever connections."""
    config = bench.file("boxed.ini", f"{bench.config.read_text(encoding='utf-8')}\n[black-box]\ndirectory = {bench.folder}/box\nseconds = 10\n")
    daemon = bench.start(config=config)
    refused = 0
    for _ in range(orders := stops // 2):
        begin, said = start_state(bench, chance), []
        lines = [harness.Line(bench.socket) for _ in range(3)]
        asked = [0] * len(lines)

        def ask(which, request, asked=asked, lines=lines, said=said):
            lines[which].link.sendall(f"{request}\n".encode())
            asked[which] += 1
            said.append(f"{which}: {request}")

        def ask_some(ask=ask, lines=lines):
            for _ in range(chance.randint(0, 4)):
                ask(chance.randrange(len(lines)), chance.choice(("dump", "dump", "reset", "engage", "engage", "park", "resume")))
                time.sleep(chance.choice((0, 0, 0.001, 0.01)))

        ask_some()
        with Stopped(daemon, chance.choice((0, 0.02, chance.uniform(0, 0.9)))):
            ask_some()
            ask(chance.randrange(len(lines)), "hold")
        for line, count in zip(lines, asked):
            with line:
                answers = [json.loads(line.file.readline()) for _ in range(count)]
                refused += sum(answer.get("why") == "held" for answer in answers)
        time.sleep(1)
        state = bench.status()["state"]
        assert state not in MOVING, f"from {begin}: {'; '.join(said)}: {state}\n{daemon.log.read_text()[-1500:]}"
    print(f"# figure {orders} orders of requests with a hold at their end, {refused} requests void")
    assert refused > orders / 10, refused
    assert bench.stop(daemon) == 0


def by_hand_before_a_hold(bench, _chance, _stops):
    """A press whose page had not heard of the hold begins nothing; nor does a request that waited and raises the intensity."""
    daemon = bench.start()
    with harness.Line(bench.socket) as hand, harness.Line(bench.socket) as other:
        hand.good("service")
        hand.good("torque all on")
        time.sleep(1)
        tick = hand.good("tick")["tick"]
        other.good("hold")
        for press in ("jog 1 2", "home 1", "relay 1"):
            hand.refused(f"{press} {tick}", "a hold came after it was asked")
        assert hand.press("jog 1 2")["held"]
        hand.good("service-off")
        hand.good("intensity 80")
        with Stopped(daemon, 3):
            hand.link.sendall(b"intensity 20\n")
            time.sleep(0.1)
            other.link.sendall(b"intensity 60\n")
        assert json.loads(hand.file.readline())["ok"]
        late = json.loads(other.file.readline())
        assert late.get("why") == "stale" or late["intensity_percent"] == 20, late
        assert hand.good("status")["intensity"]["percent"] == 20
    assert bench.stop(daemon) == 0


# --- Frames ---

def frames_in_a_stop(bench, _chance, _stops):
    """What waits in the socket is not followed when heaved goes on; what has waited for less than a second is."""
    daemon = bench.start()
    assert bench.ctl("engage").returncode == 0
    bench.wait_state("NEUTRAL", "ENGAGED", "HOLD")
    with bench.sender() as sender:
        for stop_s, is_followed, sent in ((5, False, 20), (0.5, True, 20), (25, False, 20), (90, False, 20), (63, False, 200), (3, False, 200)):
            bench.ctl("resume")
            sender.stream(0.5, frame)
            before = bench.status()
            assert before["state"] == "ENGAGED", before["state"]
            with Stopped(daemon, stop_s):
                for i in range(sent):
                    sender.send(frame(i / sent))
            time.sleep(0.2)
            after = bench.status()
            accepted, stale = (after["counters"]["accepted"]["A6"] - before["counters"]["accepted"]["A6"]), after["counters"]["stale"] - before["counters"]["stale"]
            lost = after["counters"]["lost_in_kernel"] - before["counters"]["lost_in_kernel"]  # of a full queue
            assert (accepted, stale + lost) == ((sent, 0) if is_followed else (0, sent)) and (lost == 0 or stale > 64), (stop_s, accepted, stale, lost)
            assert after["state"] == "HOLD", (stop_s, after["state"], "so late, it holds")
    assert bench.stop(daemon) == 0


def frames_bring_nothing_up(bench, _chance, _stops):
    """Of a sender that has gone, frames that waited do not count for engage = auto."""
    daemon = bench.start()
    with bench.sender() as sender:
        with Stopped(daemon, 3):
            for i in range(30):
                sender.send(frame(i / 30))
        time.sleep(3)
        status = bench.status()
        assert status["state"] in ("OFF", "SETTLED") and status["counters"]["stale"] == 30, (status["state"], status["counters"])
        sender.stream(1, frame)
        assert bench.status()["state"] in ("HOMING", "RISING"), bench.status()["state"]
    assert bench.stop(daemon) == 0


CASES = {
    "requests in stops of 0 to 30 s: now, for who is still there, or never": (requests_in_a_stop, {}),
    "orders of requests with HOLD at their end: nothing runs after it": (orders_before_a_hold, {}),
    "hold and SIGTERM count however old they are": (safer_requests_in_a_stop, {}),
    "hands that had not heard of a hold": (by_hand_before_a_hold, {}),
    "frames that waited for more than a second are not followed": (frames_in_a_stop, {}),
    "frames that waited bring nothing up": (frames_bring_nothing_up, {"platform__engage": "auto\nauto_frames = 10"}),
}


def main():
    suite = tap.Suite()
    stops = int(sys.argv[2]) if len(sys.argv) > 2 else STOPS
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else SEED
    wanted = sys.argv[4] if len(sys.argv) > 4 else ""
    print(f"# seed {seed}")
    for name, (check, changes) in CASES.items():
        if wanted in name:
            with bench_of(sys.argv[1], **changes) as bench, suite.case(name):
                check(bench, random.Random(f"{seed} {name}"), stops)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
