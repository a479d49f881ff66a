#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""shake.py - a machine that is busy and stands still now and then, for what runs meanwhile.

    with shake.shaken() as what:
        ...

Four processes compute without end. Where the system permits it, one more takes all processors from everybody, real-time threads included, for up to
STOP_MS at random moments, as the host of a virtual machine does; shaken() says whether it may. All of them end with the program that began them.
"""
import contextlib
import os
import random
import signal
import subprocess
import sys
import time

BUSY = 4
STOP_MS = 50
BETWEEN_MS = 1000  # at most; half of it on average
PRIORITY = 99


def end_with_parent():
    """Asks the kernel for SIGKILL when the parent dies (PR_SET_PDEATHSIG)."""
    import ctypes  # noqa: PLC0415  in the child only
    ctypes.CDLL(None).prctl(1, signal.SIGKILL, 0, 0, 0)


def compute():
    while True:
        pass


def stop_now_and_then(processor, seed, at):
    """On this processor; the same seed and begin on each, so that all stand still at once."""
    os.sched_setaffinity(0, {processor})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    moments = random.Random(seed)
    while True:
        at += moments.uniform(0, BETWEEN_MS) / 1000
        time.sleep(max(0, at - time.monotonic()))
        at += moments.uniform(0, STOP_MS) / 1000
        while time.monotonic() < at:
            pass


def may_stop():
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        os.sched_setscheduler(0, *before)
    except OSError:
        return False
    return True


def child(*arguments):
    return subprocess.Popen([sys.executable, __file__, *map(str, arguments)], stdin=subprocess.DEVNULL, preexec_fn=end_with_parent)


@contextlib.contextmanager
def ending(children):
    try:
        yield
    finally:
        for one in children:
            one.kill()
            one.wait()


@contextlib.contextmanager
def busy():
    """Without stops."""
    with ending([child("compute") for _ in range(BUSY)]):
        yield f"{BUSY} busy processes"


@contextlib.contextmanager
def shaken(seed=None):
    """Yields what is done to the machine, in words."""
    seed = random.randrange(1 << 30) if seed is None else seed
    begin = time.monotonic() + 1
    with contextlib.ExitStack() as stack:
        what = stack.enter_context(busy())
        if may_stop():
            stack.enter_context(ending([child("stop", processor, seed, begin) for processor in os.sched_getaffinity(0)]))
            what += f", stops of up to {STOP_MS} ms (seed {seed})"
        else:
            what += "; no stops, as this user may not have SCHED_FIFO"
        yield what


if __name__ == "__main__":
    compute() if sys.argv[1] == "compute" else stop_now_and_then(int(sys.argv[2]), int(sys.argv[3]), float(sys.argv[4]))
