# SPDX-License-Identifier: MIT
"""rt_guest.py BIN - first process of the emulated machine of test_rt.py: heaved on slcan drives under a PREEMPT_RT kernel with two CPUs.

Reports in TAP on the second serial line. The machine is slow, and slower where the host is busy: nothing is judged by a clock, and what has to
happen may take minutes. One platform goes through all cases, from its start to its end.
"""
import configparser
import contextlib
import ctypes
import math
import os
import signal
import subprocess
import sys
import time
import traceback

import can_judge
import harness
import slcan_drives
import tap

PLATFORM = harness.TOP / "config/tripod.ini"
MAP = harness.TOP / "config/can-raw-hexapod.ini"
PEER = slcan_drives.__file__
MODULES = ["can-dev", "can", "can-raw", "slcan"]
REPORT = "/dev/ttyS1"
WAIT_S = 100
LOOK_S = 0.3  # each look is a program to be started
FRAME_S = 0.1
COUNTS_PER_MM = 2000
STARTS_MM = (101, 100, 98.25)
SETPOINT = "0105"
LIMITS = (60, 100, 400)  # of the cylinders: speed_mm_s, accel_mm_s2, jerk_mm_s3
PERIOD_US = 400000
SYS_finit_module = 313
POWER_OFF = 0x4321FEDC

# A slow bus, and nothing that a pause of the host could set off: the watches that need a clock are tested elsewhere.
CHANGES = {"platform": {"cycle_us": 10000, "late_hold_cycles": 0, "engage": "auto"},
           "cylinders": {"speed_mm_s": LIMITS[0], "accel_mm_s2": LIMITS[1], "jerk_mm_s3": LIMITS[2], "following_error_mm": 0},
           "engage": {"speed_mm_s": LIMITS[0], "accel_mm_s2": LIMITS[1]}, "udp": {"silence_hold_ms": 0},
           "can-raw": {"period_us": PERIOD_US, "query_every": 3, "offline_periods": 12, "following_error_mm": 0}}

libc = ctypes.CDLL(None, use_errno=True)


def checked(result, what):
    if result != 0:
        raise OSError(ctypes.get_errno(), what)


def prepare():
    for kind, where in (("proc", "/proc"), ("sysfs", "/sys"), ("devtmpfs", "/dev"), ("devpts", "/dev/pts"), ("tmpfs", "/run")):
        os.makedirs(where, exist_ok=True)
        checked(libc.mount(kind.encode(), where.encode(), kind.encode(), 0, None), f"mount {where}")
    for name in MODULES:
        with open(f"/modules/{name}.ko", "rb") as file:
            checked(libc.syscall(SYS_finit_module, file.fileno(), b"", 0), f"module {name}")
    slcan_drives.set_up(b"lo")


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def write(path, text):
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)


class Threads:
    """Those of a process, by what they are to the scheduler."""

    def __init__(self, pid):
        self.pid = pid
        self.all = [int(name) for name in os.listdir(f"/proc/{pid}/task")]
        first = [tid for tid in self.all if os.sched_getscheduler(tid) == os.SCHED_FIFO]
        assert len(first) == 1 and len(self.all) > 1, f"{first} of {self.all} have SCHED_FIFO"
        self.motion = first[0]

    def cpu(self, tid):
        """Where it ran last."""
        return int(read(f"/proc/{self.pid}/task/{tid}/stat").rpartition(")")[2].split()[36])


@contextlib.contextmanager
def endless(cpu, priority):
    """A real-time thread that leaves nothing to others on its CPU."""
    write("/proc/sys/kernel/sched_rt_runtime_us", "-1")
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        try:
            os.sched_setaffinity(busy.pid, {cpu})
            os.sched_setscheduler(busy.pid, os.SCHED_FIFO, os.sched_param(priority))
            yield
        finally:
            busy.kill()
            busy.wait()
            write("/proc/sys/kernel/sched_rt_runtime_us", "950000")


class SlcanBench(harness.Bench):
    """Three cylinders on drives behind a serial adapter: few frames, because the kernel and the drives need long for each."""

    def __init__(self, bin_dir):
        super().__init__(bin_dir)
        settings = configparser.ConfigParser(inline_comment_prefixes=(";",))
        settings.read(MAP, encoding="utf-8")
        drives = {name: dict(settings[name]) for name in ("drives", "can", "can-raw")}
        settings.clear()
        settings.read(PLATFORM, encoding="utf-8")
        settings.read_dict(drives)
        settings.read_dict({**CHANGES, "udp": {**CHANGES["udp"], "port": self.port}, "control": {"socket": self.socket}})
        self.config = self.folder / "rt.ini"
        with open(self.config, "w", encoding="utf-8") as file:
            settings.write(file)
        self.adapters = []
        self.daemon = None
        self.last_status = None
        self.plug_in([round(mm * COUNTS_PER_MM) for mm in STARTS_MM])

    def plug_in(self, positions):
        self.log = self.folder / f"bus{len(self.adapters)}.log"
        adapter = subprocess.Popen([sys.executable, PEER, self.log, *map(str, positions)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.adapters.append(adapter)
        name = adapter.stdout.readline()
        assert name == "can0\n", f"the adapter's interface is {name!r}"

    def wait_state(self, *states):
        """Not longer than it can still come."""
        status = super().wait_state(*states, "FAULT")
        assert status["state"] in states, f"{status['state']}: {status['fault']['name']}"
        return status

    def check_state(self, state):
        status = self.status()
        assert status["state"] == state, f"{status['state']}, not {state}: {status['fault']}"

    def story(self):
        """What heaved said, for who reads of a failure."""
        return "".join(f"# {line}\n" for daemon in self.running for line in daemon.log.read_text(encoding="utf-8").splitlines()[-30:])

    def status(self):
        self.last_status = super().status()
        return self.last_status

    def adapter(self):
        return self.adapters[-1]

    def rows(self):
        return [line.split() for line in self.log.read_text(encoding="ascii").splitlines()]

    def wait_for_setpoints(self, count):
        """Until so many more have come to each drive."""
        wanted = len(self.setpoints(self.rows())[slcan_drives.FIRST_ID]) + count
        harness.wait_for(lambda: len(self.setpoints(self.rows())[slcan_drives.FIRST_ID]) >= wanted, f"{count} more set-points")

    def wait_for_quiet(self):
        """Until no set-point comes any more; those that the adapter has taken already do come."""
        def is_quiet():
            before = self.setpoints(self.rows())
            time.sleep(5 * PERIOD_US / 1e6)
            return self.setpoints(self.rows()) == before
        harness.wait_for(is_quiet, "an end of the set-points")

    def wait_for_drives(self):
        harness.wait_for(lambda: {drive["drive"] for drive in self.status()["cylinders"]} == {"disabled"}, "the drives are heard again")

    @staticmethod
    def setpoints(rows):
        """Of each drive: the counts, in order, after where it stood."""
        found = {}
        for what, identifier, rest in rows:
            if what == "start":
                found[int(identifier, 16)] = [int(rest)]
            elif rest.startswith(SETPOINT):
                found[int(identifier, 16)].append(int.from_bytes(bytes.fromhex(rest)[2:6], "little"))
        return found


def check_setpoints(rows, least_way_mm):
    """Of a span that begins with drives at rest: none ever gets more of a step than the limits allow, the first one counted from where it stood."""
    for identifier, (start, *values) in SlcanBench.setpoints(rows).items():
        can_judge.check_limits([start] * 3 + values, LIMITS, PERIOD_US, COUNTS_PER_MM, f"drive {identifier:x}")
        way_mm = (max(values) - min(values)) / COUNTS_PER_MM
        assert way_mm >= least_way_mm, f"{identifier:x}: hardly moved, {way_mm} mm"


def wave(t):
    return f"@A3:{6 * math.sin(2 * t):.3f},{5 * math.sin(1.7 * t):.3f},{20 * math.sin(1.3 * t):.3f},0#"


# --- Cases, in this order ---

def is_the_machine_meant(bench):
    assert read("/sys/kernel/realtime").strip() == "1" and "PREEMPT_RT" in os.uname().version, os.uname()
    assert os.sched_getaffinity(0) == {0, 1}, os.sched_getaffinity(0)


def goes_before_what_is_less_urgent(bench):
    """Without the kernel's reserve for others: a thread with a lower real-time priority that never waits, on the same CPU. Drives are simulated
    by heaved itself, because nothing else goes on there, not even the kernel's own work for slcan."""
    with harness.Bench(bench.bin, platform__cycle_us="10000", platform__late_hold_cycles="0") as other, endless(1, 10):
        daemon = other.start()
        motion = Threads(daemon.pid).motion
        os.sched_setaffinity(motion, {1})
        begin = other.status()["cycle"]
        harness.wait_for(lambda: other.status()["cycle"] >= begin + 50, "cycles beside a busy thread of lower priority")
        assert Threads(daemon.pid).cpu(motion) == 1
        other.wait_state("ENGAGED")
        assert other.stop(daemon) == 0


def rises_and_follows(bench):
    bench.daemon = bench.start()
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(4, wave, FRAME_S)
    bench.wait_for_setpoints(5)
    bench.check_state("ENGAGED")
    check_setpoints(bench.rows(), 5)


def is_realtime(bench):
    threads = Threads(bench.daemon.pid)
    assert bench.status()["realtime"] is True
    assert os.sched_getparam(threads.motion).sched_priority > 50, "not above the threaded interrupts"
    kib = {name: int(value.split()[0]) for name, value in (line.split(":") for line in read(f"/proc/{bench.daemon.pid}/status").splitlines())
           if name in ("VmSize", "VmLck")}
    assert kib["VmLck"] > 0.9 * kib["VmSize"], f"not locked: {kib}"


def moves_between_cpus(bench):
    threads = Threads(bench.daemon.pid)
    motion = threads.motion
    with bench.sender() as sender:
        for cpu in (0, 1, 0, 1):
            os.sched_setaffinity(motion, {cpu})
            sender.stream(0.5, wave, FRAME_S)
            bench.wait_for_setpoints(3)
            assert threads.cpu(motion) == cpu, f"runs on {threads.cpu(motion)}, not on {cpu}"
    os.sched_setaffinity(motion, {0, 1})
    bench.check_state("ENGAGED")
    check_setpoints(bench.rows(), 5)


def stops_when_nobody_answers(bench):
    bench.adapter().send_signal(signal.SIGSTOP)
    status = bench.wait_state("FAULT")
    assert status["fault"]["name"] == "bus-lost", status["fault"]
    bench.adapter().send_signal(signal.SIGCONT)  # reads what was on its way
    bench.wait_for_drives()
    bench.wait_for_quiet()
    bench.check_state("FAULT")
    check_setpoints(bench.rows(), 5)


def comes_back_when_asked(bench):
    rows = len(bench.rows())
    assert bench.ctl("reset").returncode == 0 and bench.ctl("engage").returncode == 0
    bench.wait_state("ENGAGED")
    stood = [f"start {identifier:x} {values[-1]}".split() for identifier, values in bench.setpoints(bench.rows()[:rows]).items()]
    check_setpoints(stood + bench.rows()[rows:], 0)


def stops_when_unplugged(bench):
    stood = [values[-1] for values in bench.setpoints(bench.rows()).values()]
    bench.adapter().kill()
    bench.adapter().wait()
    bench.wait_state("FAULT")
    bench.plug_in(stood)
    bench.wait_for_drives()
    bench.check_state("FAULT")
    comes_back_when_asked(bench)


def ends_when_asked(bench):
    assert bench.stop(bench.daemon) == 0
    check_setpoints(bench.rows(), 5)


CASES = [("a PREEMPT_RT kernel with two CPUs", is_the_machine_meant),
         ("cycles go on beside a busy real-time thread of lower priority", goes_before_what_is_less_urgent),
         ("rises on slcan drives and follows a stream within every limit", rises_and_follows),
         ("the motion thread has SCHED_FIFO, all memory is locked", is_realtime),
         ("the motion thread moves from CPU to CPU in motion", moves_between_cpus),
         ("nobody takes frames any more: a latched fault, no more set-points", stops_when_nobody_answers),
         ("reset and engage bring it back without a jump", comes_back_when_asked),
         ("the adapter is unplugged and plugged in: a latched fault, then back without a jump", stops_when_unplugged),
         ("SIGTERM settles it and ends with 0", ends_when_asked)]


def judge(case, bench):
    """Where the host leaves the emulator so little time that even a real-time thread misses cycle after cycle, nothing can be said."""
    try:
        case(bench)
    except Exception as error:
        status = bench.last_status
        if status and status["late_cycles"] > status["cycle"] // 4:
            raise tap.Skip(f"this machine is too busy: {status['late_cycles']} cycles missed, {status['cycle']} run ({str(error)[:60]})") from error
        raise


def main():
    prepare()
    harness.WAIT_S, harness.LOOK_S, harness.STATUS_LOOK_S = WAIT_S, LOOK_S, LOOK_S
    os.nice(10)  # the test itself; the kernel's work for slcan is not nice
    sys.stdout = open(REPORT, "w", encoding="utf-8")
    suite = tap.Suite()
    with SlcanBench(sys.argv[1]) as bench:
        for name, case in CASES:
            is_done = False
            with suite.case(name):
                judge(case, bench)
                is_done = True
            if not is_done:
                print(bench.story())
                break
    harness.Guard.sum_up()  # there is no end of the interpreter
    suite.done()


if __name__ == "__main__":
    try:
        main()
    except Exception:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        libc.reboot(POWER_OFF)
