#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_trouble.py BIN JUDGE [PART OF A NAME [SEED]] - the daemon on a machine that stalls, steps its clock, has no disk left or nobody who reads, and
told to end at any moment. In virtual time, inside kernel.py --virtual-time: nothing is late there but what is made late. JUDGE is tests/judge's."""
import contextlib
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import time

import harness
import tap

CLOCK_READ_US = 1  # virtual time passes only where the clock is read, a fraction of this each time
CYCLE_US = 2000
LATE_HOLD_CYCLES = 3
SETTLE_MOST_S = 20
SEED = 1
EXIT_REFUSED, EXIT_IO = 1, 74


def wave(t):
    return f"@A6:{6 * math.sin(2 * t):.3f},{5 * math.sin(1.7 * t):.3f},0,0,0,{20 * math.sin(1.3 * t):.3f},{int(10 * t) % 4096:X}#"


class TroubleBench(harness.Bench):
    def __init__(self, bin_dir, **changes):
        super().__init__(bin_dir, **{"platform__cycle_us": CYCLE_US, "platform__late_hold_cycles": LATE_HOLD_CYCLES, **changes})
        self.trace, self.record = self.folder / "live.csv", self.folder / "record.txt"

    def traced(self, **options):
        return self.start("--trace", self.trace, "--record", self.record, **options)

    def engaged(self, seconds=0.5):
        """Engages and follows for a while."""
        self.wait_state("ENGAGED")
        with self.sender() as sender:
            sender.stream(seconds, wave)

    def add(self, section, line):
        text = self.config.read_text(encoding="utf-8")
        assert f"[{section}]\n" not in text or text.count(f"[{section}]\n") == 1
        text = text.replace(f"[{section}]\n", f"[{section}]\n{line}\n") if f"[{section}]\n" in text else f"{text}\n[{section}]\n{line}\n"
        self.config.write_text(text, encoding="utf-8")

    def wait_state(self, *states):
        """Asks seldom: a question is a process."""
        for _ in range(10 * harness.WAIT_S):
            status = self.status()
            if status["state"] in states:
                return status
            time.sleep(0.1)
        raise AssertionError(f"state {' or '.join(states)}: not within {harness.WAIT_S} s")


def judge(bench):
    """Every limit in every cycle, up to where the trace ends; the rows."""
    trace = bench.trace.read_bytes()
    trace = trace[:trace.rindex(b"\n") + 1]
    run = subprocess.run([sys.argv[2], bench.config], input=trace, stdout=subprocess.PIPE, check=False)
    assert run.returncode == 0, run.stdout.decode()
    return harness.rows_of(trace)


def replays(bench):
    live = harness.since_zero(bench.trace.read_bytes())
    played = bench.play(bench.record)
    assert played[:len(live)] == live, "the recording plays back otherwise"


# --- A machine that stalls, and its clock ---

def stopped_for_some_ms(bench, source):
    """Cycles that could not be in time are skipped, never caught up; where they are too many, a controlled stop."""
    daemon = bench.traced()
    bench.engaged()
    lates = []
    for ms in [1, 2, 5, 7, 11, 20, 35, 50, *(source.randint(2, 50) for _ in range(4))]:
        before, since = bench.status(), time.monotonic()
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(ms / 1000)
        daemon.send_signal(signal.SIGCONT)
        with bench.sender() as sender:
            sender.stream(0.2, wave)
        after, took_s = bench.status(), time.monotonic() - since
        late, done = after["late_cycles"] - before["late_cycles"], after["cycle"] - before["cycle"]
        lates.append(late)
        assert ms * 1000 / CYCLE_US - 2 < late <= ms * 1000 / CYCLE_US, f"{ms} ms: {late} cycles late"
        assert done + late <= took_s * 1e6 / CYCLE_US + 2, f"{ms} ms: {done} cycles and {late} late ones in {took_s} s"
        assert (after["state"] == "HOLD") == (late > LATE_HOLD_CYCLES), f"{ms} ms, {late} late: {after['state']}"
        if after["state"] == "HOLD":
            assert bench.ctl("resume").returncode == 0
            bench.engaged(0.2)
    assert max(lates) > LATE_HOLD_CYCLES >= min(lates), lates
    assert bench.stop(daemon) == 0
    log = daemon.log.read_text()
    assert log.count("cycles late: holding") == sum(late > LATE_HOLD_CYCLES for late in lates), log
    rows = judge(bench)
    assert all(round(float(row["t_ms"]) * 1000) == i * CYCLE_US for i, row in enumerate(rows)), "a cycle more, or less"
    assert sum("late" in row["flags"] for row in rows) == sum(late > 0 for late in lates)
    replays(bench)


def clock_steps(bench, _):
    """A day ahead, two days back, and a second: nothing happens."""
    if os.environ.get("HEAVE_OWN_KERNEL") is None:
        raise tap.Skip("the clock of this machine is not ours")
    daemon = bench.traced()
    bench.engaged()
    before = bench.status()
    for step_s in (86400, -2 * 86400, 86401, -1):
        time.clock_settime(time.CLOCK_REALTIME, time.time() + step_s)
        with bench.sender() as sender:
            sender.stream(0.3, wave)
    after = bench.status()
    assert after["state"] == "ENGAGED" and after["late_cycles"] == before["late_cycles"] and after["counters"]["faults"] == 0, after
    assert after["frame_latency"]["max_us"] <= 2 * CYCLE_US and after["wake_latency"]["max_us"] <= before["wake_latency"]["max_us"] + CLOCK_READ_US, after
    assert bench.stop(daemon) == 0
    judge(bench)
    replays(bench)


# --- Nobody who reads, no disk ---

def say_much(bench):
    """Changes of state, each of which is a line."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.connect(str(bench.socket))
        for request in ["hold", "resume"] * 20:
            link.sendall(f"{request}\n".encode())
            assert b'"ok":true' in link.recv(4096).replace(b" ", b""), request


def standard_error_is_full(bench, _):
    """Log lines are lost and counted; frames, operators, reloads of wrong files and the end go on as ever."""
    good = bench.config.read_text(encoding="utf-8")
    daemon = bench.spawn("--trace", bench.trace, stderr=subprocess.PIPE)
    with open(f"/proc/{daemon.pid}/fd/2", "wb", buffering=0, opener=lambda path, flags: os.open(path, flags | os.O_NONBLOCK)) as pipe:
        while pipe.write(b"x" * 4096):
            pass  # None: it is full
    harness.wait_for(lambda: bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
    bench.engaged()
    with bench.sender() as sender:
        for _ in range(10):
            say_much(bench)
            sender.send(wave(0))
            sender.send("@A6:1,2,3#")
            sender.send("@A9:nonsense#")
            time.sleep(0.05)
    bench.config.write_text(good.replace("[platform]\n", "[platform]\nfrobnicate = 1\n" * 40), encoding="utf-8")
    daemon.send_signal(signal.SIGHUP)
    time.sleep(1)
    status = bench.status()
    bench.config.write_text(good, encoding="utf-8")
    assert status["state"] == "ENGAGED" and status["late_cycles"] == 0, status
    assert status["lost"]["log_lines"] > 0, "nothing was lost: the pipe was not full"
    assert bench.stop(daemon) == 0
    daemon.stderr.close()
    judge(bench)


def disk_is_full(bench, _):
    """Recording, trace, metrics and black box on a disk of 64 KB: it is said, and the ride goes on."""
    disk = bench.folder / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", disk], check=False).returncode != 0:
        raise tap.Skip("cannot mount a small disk here")
    try:
        bench.add("control", f"metrics = {disk}/heave.prom")
        bench.add("black-box", f"directory = {disk}/incidents\nseconds = 10")
        daemon = bench.start("--trace", disk / "trace.csv", "--record", disk / "record.txt")
        bench.engaged(3)
        answer, code = bench.ask("dump")
        assert code == 1 and "No space left" in answer["error"], answer
        status = bench.status()
        assert status["state"] == "ENGAGED" and status["late_cycles"] == 0, status
        code = bench.stop(daemon)
        log = daemon.log.read_text()
        assert code == EXIT_IO, log
        for what in ("trace.csv: No space left", "heave.prom", "black box"):
            assert what in log, log
    finally:
        subprocess.run(["umount", disk], check=True)


# --- The end ---

PHASES = [("OFF", 0.4), ("RISING", 1.5), ("ENGAGED", 1.0)]  # the last state seen before, and how long after it the signal comes at most


def ends_at_any_moment(bench, source):
    """SIGTERM at any moment: settles within its limits and a bounded time, off, exit 0."""
    for state, most_s in PHASES * 2:
        daemon = bench.traced(config=bench.write_config("unhomed.ini", platform__cycle_us=CYCLE_US, sim__start_extension_mm="61.7", sim__homed="no")
                              if state == "OFF" else None)
        if state != "OFF":
            bench.wait_state(state)
        with bench.sender() as sender:
            sender.stream(source.uniform(0, most_s), wave, 0.01)
        since = time.monotonic()
        code = bench.stop(daemon)
        took_s = time.monotonic() - since
        log = daemon.log.read_text()
        print(f"# SIGTERM after {state}: {took_s:.2f} s", flush=True)
        assert code == 0 and took_s < SETTLE_MOST_S, f"after {state}: exit {code} after {took_s} s\n{log}"
        rows = judge(bench) if "-> SETTLED" in log else []  # what is led begins there
        if state != "OFF":
            assert rows[-1]["state"] == "OFF" and re.search(r"SETTLED -> OFF", log), log


def a_hold_delays_the_end(bench, _):
    """By ten seconds, and a minute in all however often somebody holds: then it settles, and ends with torque off."""
    for holds, pause_s, least_s, most_s, ends in ((1, 2, 10, 10 + SETTLE_MOST_S, "shutdown"), *(row + ("SIGTERM",) for row in ((1, 2, 10, 10 + SETTLE_MOST_S), (60, 2, 60, 60 + SETTLE_MOST_S), (100000, 0.05, 60, 60 + SETTLE_MOST_S)))):
        daemon = bench.traced()
        bench.engaged(0.5)
        since, held = time.monotonic(), 0
        daemon.signal_sent = signal.SIGTERM
        if ends == "SIGTERM":
            daemon.send_signal(signal.SIGTERM)
        else:
            bench.ask("shutdown")
        time.sleep(0.2)
        while held < holds and daemon.poll() is None:
            with contextlib.suppress(OSError, ValueError), harness.Line(bench.socket) as line:
                answer = line.ask("hold")
                assert answer["state"] in ("HOLD", "SETTLING", "SETTLED", "OFF") and (answer["ok"] or time.monotonic() - since > least_s), answer
            held += 1
            time.sleep(pause_s)
        code = daemon.wait(timeout=harness.WAIT_S)
        took_s = time.monotonic() - since
        log = daemon.log.read_text()
        print(f"# SIGTERM and {held} holds: {took_s:.2f} s", flush=True)
        assert code == 0 and least_s < took_s < most_s, f"exit {code} after {took_s} s\n{log}"
        assert "on hold in the middle of the end: it goes on in 10 s, and after 60 s however often somebody holds" in log, log
        assert judge(bench)[-1]["state"] == "OFF" and re.search(r"SETTLED -> OFF", log), log


def ends_while_the_drives_come_up(bench, source):
    """They are waited for up to ten seconds, and homing may take minutes: not once somebody ends heaved."""
    daemon = bench.traced(config=bench.write_config("slow.ini", platform__cycle_us=CYCLE_US, sim__homed="no", sim__enable_delay_ms=9000))
    bench.wait_state("HOMING")
    time.sleep(source.uniform(0, 7))
    since = time.monotonic()
    code = bench.stop(daemon)
    took_s = time.monotonic() - since
    log = daemon.log.read_text()
    assert code == 0 and took_s < 0.2, f"exit {code} after {took_s} s\n{log}"
    assert re.search(r"HOMING -> HOLD.*\n(.*\n)*.*HOLD -> OFF", log), log


def second_one_ends_at_once(bench, source):
    """Within two cycles of the second SIGTERM, at any moment of settling."""
    for _ in range(3):
        daemon = bench.traced()
        bench.engaged(0.3)
        daemon.send_signal(signal.SIGTERM)
        time.sleep(source.uniform(0.02, 1.0))
        since = time.monotonic()
        code = bench.stop(daemon)
        took_s = time.monotonic() - since
        assert code == EXIT_REFUSED and took_s < 0.05, f"exit {code} after {took_s} s"
        assert "second signal" in daemon.log.read_text()
        judge(bench)


CASES = {
    "stopped for 1 to 50 ms: late cycles are skipped, never caught up, and too many hold it": stopped_for_some_ms,
    "steps of the wall clock change nothing": clock_steps,
    "standard error is full: nothing is late": standard_error_is_full,
    "a full disk is said, and the ride goes on": disk_is_full,
    "SIGTERM at any moment settles within limits and time": ends_at_any_moment,
    "SIGTERM and holds: delayed, then it settles and ends": a_hold_delays_the_end,
    "SIGTERM while the drives come up ends at once": ends_while_the_drives_come_up,
    "a second SIGTERM at any moment ends at once": second_one_ends_at_once,
}


def main():
    suite = tap.Suite()
    wanted = sys.argv[3] if len(sys.argv) > 3 else ""
    seed = int(sys.argv[4]) if len(sys.argv) > 4 else SEED
    print(f"# seed {seed}")
    for name, check in CASES.items():
        if wanted in name:
            with TroubleBench(sys.argv[1]) as bench, suite.case(name):
                check(bench, random.Random(f"{seed} {name}"))
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
