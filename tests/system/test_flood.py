#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_flood.py BIN - useless datagrams as fast as a process can send them, beside a good stream: the stream is followed within the limits, and what
is useless is kept from the program until it is over."""
import argparse
import contextlib
import math
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import harness
import tap

# Sends blocks until it has sent enough and its standard input is closed; then says how many that were.
FLOOD = """
import select, socket, sys
source, port, least = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
payloads = [bytes.fromhex(text) for text in sys.argv[4:]]
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.bind((source, 0))
link.connect(("127.0.0.1", port))
sent = 0
while sent < least or not select.select([sys.stdin], [], [], 0)[0]:
    for _ in range(1000 // len(payloads)):
        for payload in payloads:
            link.send(payload)
            sent += 1
print(sent)
"""
PER_CYCLE = 64  # datagrams that a cycle takes, GATEWAY_DATAGRAMS_PER_CYCLE
GARBAGE = [b"\x80\x21" * 30, b"hello", bytes(range(1, 9)), b"{\"speed\": 1}", b"@A6:1" * 200]
LOOKS_LIKE_FRAMES = [b"@@@@@@@@@@@@", b"@Axyz:1,2,3,0#", b"@B6:1,2,3,4,5,6,0#", b"@A9:1,2,3,4,5,6,0#", b"@A6;1,2,3,4,5,6,0#", b"@A6:1#"]
RUBBISH = [b"@A6:1,rubbish", b"@A6:1,2,3,4,5,6,7,8,9#", b"@A6:nan,2,3,4,5,6,0#"]
STRANGER = [b"@A6:9,9,9,50,50,50,FFF#", b"@A6T:9,9,9,50,50,50,0#"]


def wave(t):
    return f"@A6:{3 * math.sin(t):.3f},{2 * math.sin(1.3 * t):.3f},0,0,0,{10 * math.sin(0.7 * t):.3f},0#"


class Stream(threading.Thread):
    """The good sender, at 50 Hz until the end."""

    def __init__(self, bench):
        super().__init__()
        self.sender = bench.sender()
        self.sent = 0
        self.is_over = threading.Event()

    def run(self):
        while not self.is_over.is_set():
            self.sender.send(wave(0.02 * self.sent))
            self.sent += 1
            time.sleep(0.02)

    def end(self):
        if self.is_alive():
            self.is_over.set()
            self.join()
        self.sender.link.close()


@contextlib.contextmanager
def streaming(bench):
    stream = Stream(bench)
    stream.start()
    try:
        yield stream
    finally:
        stream.end()


@contextlib.contextmanager
def flooding(bench, source, at_least, payloads):
    command = [sys.executable, "-c", FLOOD, source, str(bench.port), str(at_least), *(payload.hex() for payload in payloads)]
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield child
    finally:
        child.kill()
        child.communicate()


def counted(counters):
    """(followed frames, useless datagrams that the program has seen)"""
    followed = sum(counters["accepted"].values())
    return followed, counters["datagrams"] - followed + counters["refused_senders"]


def settled(bench):
    """The counters, once nothing useless comes through any more."""
    def look():
        before = bench.status()
        now = harness.wait_for(lambda: (lambda status: status if status["cycle"] > before["cycle"] + 200 else None)(bench.status()), "it has looked often")
        return now["counters"] if counted(now["counters"])[1] == counted(before["counters"])[1] else None
    return harness.wait_for(look, "the program sees no more of the flood")


def lost_on_the_way():
    """What the kernel has lost before it came to any socket."""
    return [line.split()[1] for line in Path("/proc/net/softnet_stat").read_text(encoding="ascii").splitlines()]


def is_kept_out(bench, source, at_least, payloads, **changes):
    config, trace = bench.write_config("flood.ini", **changes), bench.folder / "live.csv"
    daemon = bench.start("--trace", trace, config=config)
    bench.wait_state("ENGAGED")
    with streaming(bench) as stream:
        harness.wait_for(lambda: counted(bench.status()["counters"])[0] > 10, "the stream is followed")
        assert bench.status()["flood"] is False
        on_the_way = lost_on_the_way()
        with flooding(bench, source, at_least, payloads) as child:
            harness.wait_for(lambda: bench.status()["flood"], "the flood is noticed")
            first, sent = settled(bench), stream.sent
            harness.wait_for(lambda: stream.sent >= sent + 100, "the stream goes on in the flood")
            useless = int(child.communicate(input="")[0])
        last = settled(bench)
        was_kept_out = "is over" not in daemon.log.read_text()
        stream.end()
        is_all_there = on_the_way == lost_on_the_way()
        if was_kept_out and is_all_there:  # the queue was the stream's alone
            harness.wait_for(lambda: counted(bench.status()["counters"])[0] - counted(first)[0] >= stream.sent - sent - 1, "every frame sent since then")
        end = bench.status()["counters"]
        followed, seen = counted(end)
        assert followed <= stream.sent and useless >= at_least, (useless, stream.sent, end)
        assert seen + followed + end["lost_in_kernel"] <= useless + stream.sent, (useless, stream.sent, end)
        assert end["lost_in_kernel"] > at_least / 2 or not is_all_there, (useless, end)
        assert not was_kept_out or counted(first)[1] == counted(last)[1], (first, last)  # else the flood paused for seconds
        harness.wait_for(lambda: "a flood of useless datagrams" in daemon.log.read_text(), "the flood is told")
    is_told_again(bench, daemon)
    assert bench.stop(daemon) == 0
    harness.check_trace(config, trace)


def driver_has_a_share(bench, source):
    """What looks like a frame, from an address that is allowed: hardly a frame of the sender that drives is lost, from the first one of the flood on."""
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with streaming(bench) as stream:
        harness.wait_for(lambda: counted(bench.status()["counters"])[0] > 10, "the stream is followed")
        on_the_way, sent, followed = lost_on_the_way(), stream.sent, counted(bench.status()["counters"])[0]
        with flooding(bench, source, 400_000, RUBBISH) as child:
            harness.wait_for(lambda: bench.status()["flood"], "the flood is noticed")
            harness.wait_for(lambda: stream.sent >= sent + 500, "the stream goes on in the flood")
            useless = int(child.communicate(input="")[0])
        stream.end()
        harness.wait_for(lambda: not bench.status()["flood"], "it is over")
        share = (counted(bench.status()["counters"])[0] - followed) / (stream.sent - sent)
        print(f"# {100 * share:.2f} % of {stream.sent - sent} frames followed beside {useless} others")
        assert share >= 0.99 or on_the_way != lost_on_the_way(), share
    assert bench.stop(daemon) == 0


def is_told_again(bench, daemon):
    """Single wrong frames are, once it is over."""
    harness.wait_for(lambda: not bench.status()["flood"], "it is over")
    harness.wait_for(lambda: "the flood is over" in daemon.log.read_text(), "it is said")  # by another thread, a little later
    if bench.status()["counters"]["refused_senders"] > 0:
        return  # to all but this one
    before = bench.status()["counters"]["rejected"]["no_head"]
    with bench.sender() as sender:
        sender.send("nonsense")
        harness.wait_for(lambda: bench.status()["counters"]["rejected"]["no_head"] == before + 1, "a wrong frame is counted by its reason")


# Sends frames that tell by their height when they were sent, at two rates, one after the other; says how many that were.
TIMED = """
import socket, sys, time
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.connect(("127.0.0.1", int(sys.argv[1])))
sent = 0
for rate, seconds in ((500, 1), (90000, 3)):
    begin, count = time.monotonic(), 0
    while (passed := time.monotonic() - begin) < seconds:
        if count < passed * rate:
            link.send(b"@A6:0,0,0,0,0,%.4f#" % (time.monotonic() % 30 * 1000))
            count += 1
    sent += count
print(sent)
"""


def ages_of(record):
    """Of the newest frame of each cycle, in ms, in order: against the youngest one of all."""
    late, newest = 0, {}
    for line in record.read_text(encoding="utf-8").splitlines():
        at, _, text = line.partition(" ")
        if text.startswith("!late "):
            late += int(text.split()[1])
        elif text.startswith("@A6:0,0,0,0,0,"):
            newest[math.ceil(float(at)) + late] = float(text[:-1].rsplit(",", 1)[1])  # of the cycle that it came for
    ages = [(at - sent) % 30000 for at, sent in newest.items()]
    youngest = min(ages)
    return [age - youngest for age in ages[600:]]


def flood_of_driver(bench, record):
    """Ages, in order of their size, of what is followed in a flood of the sender that drives."""
    daemon = bench.start("--record", record)
    bench.wait_state("ENGAGED")
    sent = int(subprocess.run([sys.executable, "-c", TIMED, str(bench.port)], stdout=subprocess.PIPE, check=True).stdout)
    # the kernel is asked ten times a second
    harness.wait_for(lambda: (lambda all: all["accepted"]["A6"] + all["lost_in_kernel"] == sent)(bench.status()["counters"]), "every frame is followed or counted as lost")
    assert bench.stop(daemon) == 0
    ages = sorted(ages_of(record))
    assert len(ages) > 1000, len(ages)
    return ages


def driver_floods(bench):
    """What is followed is new all the same: half of the cycles have a frame of the last two ms."""
    ages = flood_of_driver(bench, bench.folder / "record.txt")
    print("# figure " + ", ".join(f"{share * 100:.0f} % up to {ages[int(len(ages) * share)]:.2f} ms" for share in (0.5, 0.9, 0.99)) + " old in a flood of the driver's")
    assert ages[len(ages) // 2] < 2, f"half of what is followed is older than {ages[len(ages) // 2]:.2f} ms"


def queue_is_short(bench):
    """What came while heaved could not run is not followed for cycles: the queue has room for one cycle's frames, and not for three."""
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        for _ in range(1000):
            sender.send("@A6:0,0,0,0,0,1#")
        before = lost_on_the_way()
        daemon.send_signal(signal.SIGCONT)
        counters = harness.wait_for(lambda: (lambda all: all if all["datagrams"] + all["lost_in_kernel"] == 1000 else None)(bench.status()["counters"]), "what waits is taken")
        assert 20 <= counters["datagrams"] <= 3 * PER_CYCLE or before != lost_on_the_way(), counters
    assert bench.stop(daemon) == 0


CASES = {
    "a flood of valid frames from the sender that drives: what is followed is new": driver_floods,
    "what came while heaved could not run is little": queue_is_short,
    "a flood beside a good stream is kept from the program": lambda bench: is_kept_out(bench, "127.0.0.1", 200_000, GARBAGE),
    "a flood of what begins as a frame does beside a good stream": lambda bench: is_kept_out(bench, "127.0.0.1", 200_000, LOOKS_LIKE_FRAMES),
    "a flood of rubbish with a head, of another program on the PC of the sender": lambda bench: driver_has_a_share(bench, "127.0.0.1"),
    "a flood of rubbish with a head, from another address": lambda bench: driver_has_a_share(bench, "127.0.0.2"),
    "a flood of valid frames from a sender that is not allowed": lambda bench: is_kept_out(bench, "127.0.0.2", 50_000, STRANGER, udp__allow="127.0.0.1"),
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin")
    parser.add_argument("--only", default="", help="run the cases whose name contains this")
    arguments = parser.parse_args()
    suite = tap.Suite()
    for name, check in CASES.items():
        if arguments.only in name:
            with harness.Bench(arguments.bin) as bench, suite.case(name):
                check(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
