# SPDX-License-Identifier: MIT
"""harness.py - what the system tests share: a platform in a temporary folder, the programs as child processes, a sender of frames.

Every heaved that a Bench starts live runs under malloc_guard.c, where that was built (not with sanitizers, which have an allocator of their own): it is
ended where it allocates after its start, and must have no page fault in its motion thread where memory is locked. stop() and the Bench's end say so.
"""
import atexit
import contextlib
import hashlib
import json
import mmap
import os
import random
import re
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
WAIT_S = 60  # for anything that has to happen: says that it never will, not that it was slow
HAS_OWN_KERNEL = "HEAVE_OWN_KERNEL" in os.environ  # where to start a program takes long, and mostly no time
CRASHES = {signal.SIGSEGV, signal.SIGABRT, signal.SIGBUS, signal.SIGILL, signal.SIGFPE}
SANITIZER = re.compile(r"\w+Sanitizer: |: runtime error: ")
LOOK_S = 0.01 if HAS_OWN_KERNEL else 0.05  # between two looks whether it has: most of them start a program
STATUS_LOOK_S = 0.1 if HAS_OWN_KERNEL else LOOK_S


def go_first():
    """Before other tests on a busy machine, with all that is started from here, where this is allowed: a hand that holds a key, and the machine that watches it, are not late in a hall."""
    with contextlib.suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, -10)


PORTS = range(20000, 32000)  # below those that the kernel gives to whoever asks for any
held_ports = []


def free_port(kind=socket.SOCK_DGRAM):
    """A port, of UDP unless kind is SOCK_STREAM, that nobody has and no other test takes before this process ends: a name that one alone can bind stands for it.
    On a kernel of its own always the same."""
    for port in PORTS if HAS_OWN_KERNEL else random.sample(PORTS, len(PORTS)):
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, kind) as probe:
            try:
                claim.bind(f"\0heave-test-port-{port}")
                probe.bind(("127.0.0.1", port))
            except OSError:
                claim.close()
                continue
        held_ports.append(claim)
        return port
    raise AssertionError(f"no port is free from {PORTS.start} to {PORTS.stop - 1}")


def wait_for(condition, what, look_s=None):
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(LOOK_S if look_s is None else look_s)
    raise AssertionError(f"{what}: not within {WAIT_S} s")


def pages_moved():
    """What the kernel has done to pages by itself, locked ones too: touching such a page is a fault."""
    names = ("pgmigrate_success ", "thp_collapse_alloc ", "thp_split_pmd ", "numa_hint_faults ")
    lines = Path("/proc/vmstat").read_text(encoding="ascii").splitlines()
    return [line for line in lines if line.startswith(names)]


class Guard:
    """malloc_guard.c around one heaved, and what it found."""

    cycles = {True: 0, False: 0}  # of all heaved so far, by whether page faults are judged
    has_own_faults = HAS_OWN_KERNEL  # User Mode Linux learns by faults what a processor reads in its tables, locked or not

    def __init__(self, library, environment):
        self.report_fd = os.memfd_create("guard")
        os.ftruncate(self.report_fd, mmap.PAGESIZE)
        self.report = mmap.mmap(self.report_fd, mmap.PAGESIZE)
        self.moved = pages_moved()
        self.options = {"env": {**environment, "LD_PRELOAD": f"{environment.get('LD_PRELOAD', '')} {library}", "HEAVE_GUARD_REPORT": str(self.report_fd)}, "pass_fds": (self.report_fd,)}

    def started(self):
        os.close(self.report_fd)

    def judge(self, daemon):
        """Once, when heaved has ended."""
        if self.report is None:
            return
        log = daemon.log.read_text(errors="replace") if daemon.log else "(its standard error is the test's)"
        cycles, page_faults, is_locked, refused = struct.unpack_from("4Q", self.report)
        self.report.close()
        self.report = None
        is_judged = is_locked and not Guard.has_own_faults
        if refused:
            raise tap.Fault(f"heaved was ended where it allocates after its start: {log}")
        assert not page_faults or not is_judged or pages_moved() != self.moved, f"{page_faults} page faults of the motion thread in {cycles} cycles: {log}"
        Guard.cycles[bool(is_judged)] += cycles

    @staticmethod
    def sum_up():
        for is_judged, text in ((True, "without an allocation or a page fault"), (False, "without an allocation, page faults not judged (User Mode Linux, memory not locked)")):
            if Guard.cycles[is_judged]:
                print(f"# figure {Guard.cycles[is_judged]} cycles of heaved {text}", flush=True)


atexit.register(Guard.sum_up)


def judge_trace(judge, config, trace):
    """Every limit, in every row, by tests/judge."""
    with open(trace, "rb") as rows:
        run = subprocess.run([judge, config], stdin=rows, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=WAIT_S, check=False)
    if run.returncode != 0:
        raise tap.Fault(run.stdout)


def check_trace(config, trace):
    """As judge_trace, and relays, states and timed moves, by tools/check_trace."""
    run = subprocess.run([sys.executable, TOP / "tools/check_trace", config, trace], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    if run.returncode != 0:
        raise tap.Fault(run.stdout)


def counts_what_is_reached(program):
    """A program of tools/coverage: its counters are written, and memory is allocated for that, when it has ended."""
    return b"__llvm_profile_runtime" in program.read_bytes() if program.exists() else False


class Bench:
    """A folder with a configuration of its own port and socket; ends what it started."""

    def __init__(self, bin_dir, **changes):
        self.bin = Path(bin_dir)
        self.temporary = tempfile.TemporaryDirectory(prefix="heave-")
        self.folder = Path(self.temporary.name)
        self.port = free_port()
        self.socket = self.folder / "heaved.sock"
        self.config = self.write_config("platform.ini", **changes)
        self.running = []
        library = self.bin.resolve().parent / "tests/system/libmalloc_guard.so"
        self.guard = library if library.exists() and not counts_what_is_reached(self.bin / "heaved") else None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for daemon in self.running:
            if daemon.poll() is None:
                daemon.kill()
            daemon.wait()
        try:
            self.judge_ended()
        finally:
            self.temporary.cleanup()

    def write_config(self, name, source="demo-hexapod.ini", **changes):
        """The demonstration platform; a change is section__key="value"."""
        text = (TOP / "config" / source).read_text(encoding="utf-8")
        changes = {"udp__port": self.port, "control__socket": self.socket, **changes}
        for where, value in changes.items():
            section, key = where.split("__")
            pattern = re.compile(rf"(\[{section}\][^\[]*?^{key} *= *)[^;\n]*", re.MULTILINE | re.DOTALL)
            text, count = pattern.subn(lambda match, value=value: f"{match[1]}{value} ", text)
            assert count == 1, f"{where} found {count} times"
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def file(self, name, text):
        path = self.folder / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    def heaved(self, *arguments, **options):
        """Runs heaved to its end."""
        return subprocess.run([self.bin / "heaved", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              timeout=60, check=False, **options)

    def play(self, frames, *arguments, config=None):
        trace = self.folder / "played.csv"
        run = self.heaved("--config", config or self.config, "--play", frames, "--trace", trace, *arguments)
        assert run.returncode == 0, f"exit {run.returncode}: {run.stderr}"
        played = trace.read_bytes()
        print(f"# played {hashlib.sha256(played).hexdigest()[:16]}", flush=True)  # the same in each run
        return played

    def check_limits(self, config=None):
        """Of what was played last: tests/judge, which takes a twentieth of check_trace's time. (What check_trace has more: relays, states, timed moves.)"""
        judge_trace(self.bin.resolve().parent / "tests/judge/trace_judge", config or self.config, self.folder / "played.csv")

    def judge_ended(self):
        """Of all that have ended so far: none has crashed, and what the guard has to say."""
        for daemon in self.running:
            if daemon.poll() is not None:
                log = daemon.log.read_text(errors="replace") if daemon.log else ""
                if -daemon.returncode in CRASHES - {daemon.signal_sent} or SANITIZER.search(log):
                    raise tap.Fault(f"heaved has crashed, exit code {daemon.returncode}: {log}")
                daemon.judge(daemon)

    def spawn(self, *arguments, config=None, environment=None, **options):
        """Starts heaved live, under guard."""
        self.judge_ended()
        environment = {**os.environ, **(environment or {})}
        guard = Guard(self.guard, environment) if self.guard else None
        daemon = subprocess.Popen([self.bin / "heaved", "--config", str(config or self.config), *map(str, arguments)],
                                  **(guard.options if guard else {"env": environment}), **options)
        if guard:
            guard.started()
        daemon.log = daemon.signal_sent = None
        daemon.judge = guard.judge if guard else lambda _: None
        self.running.append(daemon)
        return daemon

    def start(self, *arguments, **options):
        """Starts heaved live and waits until it answers."""
        log = open(self.folder / f"log{len(self.running)}", "w+b")
        daemon = self.spawn(*arguments, stdout=log, stderr=log, **options)
        daemon.log = Path(log.name)
        log.close()
        wait_for(lambda: daemon.poll() is not None or self.answers(), "heaved answers")
        assert daemon.poll() is None, f"heaved ended with {daemon.returncode}: {daemon.log.read_text()}"
        return daemon

    def stop(self, daemon, number=signal.SIGTERM):
        """Signals and waits; the exit code."""
        daemon.signal_sent = number
        daemon.send_signal(number)
        code = daemon.wait(timeout=WAIT_S)
        daemon.judge(daemon)
        return code

    def ctl(self, *arguments, **options):
        return subprocess.run([self.bin / "heavectl", "--socket", str(self.socket), *map(str, arguments)], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True, timeout=60, check=False, **options)

    def ask(self, request):
        """heavectl --json REQUEST: the answer, and the exit code."""
        run = self.ctl("--json", request)
        return json.loads(run.stdout), run.returncode

    def status(self):
        """Without heavectl: to start a program takes as long as many cycles, above all on a kernel of its own."""
        with Line(self.socket) as line:
            return line.good("status")

    def answers(self):
        with contextlib.suppress(OSError):
            return bool(self.status())
        return False

    def wait_state(self, *states):
        return wait_for(lambda: (lambda status: status if status["state"] in states else None)(self.status()), f"state {' or '.join(states)}",
                        STATUS_LOOK_S)

    def reset(self):
        """Until it leads back: it is given up after two seconds, which a busy machine may need for the line of the drives alone."""
        wait_for(lambda: (self.ctl("reset"), self.status()["state"] == "OFF")[1], "a reset leads back", 0.5)

    def sender(self):
        return Sender(self.port)


class Line:
    """A client of the control socket that speaks its protocol itself."""

    def __init__(self, path):
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.link.connect(str(path))
        self.link.settimeout(WAIT_S)
        self.file = self.link.makefile("rb")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        self.link.close()

    def ask(self, request):
        self.link.sendall(request.encode() + b"\n")
        return json.loads(self.file.readline())

    def good(self, request):
        answer = self.ask(request)
        assert answer["ok"], f"{request}: {answer}"
        return answer

    def refused(self, request, text):
        answer = self.ask(request)
        assert not answer["ok"] and text in answer["error"], f"{request}: {answer}"
        return answer

    def press(self, request):
        return self.good(f"{request} {self.good('tick')['tick']}")


class Sender:
    """Sends frames to the daemon."""

    def __init__(self, port):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.close()

    def send(self, text):
        self.link.send(text if isinstance(text, bytes) else text.encode())

    def stream(self, seconds, frame, period_s=0.02):
        """frame(t) gives each text."""
        start = time.monotonic()
        while (t := time.monotonic() - start) < seconds:
            self.send(frame(t))
            time.sleep(period_s)


def since_zero(trace):
    """A trace without its rows before time zero, which a recording does not repeat."""
    return b"".join(line for line in trace.splitlines(keepends=True) if not line.endswith(b"before-zero\n"))


def rows_of(trace):
    """A trace as a list of dicts, from time zero on."""
    lines = since_zero(trace).decode().splitlines()
    names = lines[0].split(",")
    return [dict(zip(names, line.split(","))) for line in lines[1:]]
