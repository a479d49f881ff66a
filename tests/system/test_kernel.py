#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_kernel.py - the runner of kernel.py itself: what it passes on, and that virtual time is exact. Runs on the host."""
import shutil
import sys
import tempfile
from pathlib import Path

import kernel
import tap

TICKS = """
import time
start = time.monotonic_ns()
for i in range(1, 1001):
    time.sleep(max(0, (start + i * 3600_000_000_000 // 1000 - time.monotonic_ns()) / 1e9))
print((time.monotonic_ns() - start) // 1000)
"""


def passes_on_output_and_status():
    finished = kernel.run(["sh", "-c", "echo one; echo two >&2; echo $HEAVE_X; exit 3"], HEAVE_X="a 'b' $c")
    assert (finished.returncode, finished.output) == (3, "one\ntwo\na 'b' $c\n"), vars(finished)


def nested(runner, *user):
    """The runner inside itself: there the machine's own kernel has vcan, so that it runs on that one, in a name space of its own."""
    inner = [sys.executable, runner, "--", "sh", "-c", "ip -br link show vcan0; ip link set vcan0 down; exit 5"]
    return kernel.run(["sh", "-c", 'cd /; ip link add outside type vcan; "$@"; status=$?; ip -br link show vcan0; exit $status', "sh", *user, *inner])


def runs_directly_where_it_can():
    with tempfile.TemporaryDirectory() as folder:  # that any user may read, wherever the tree is
        Path(folder).chmod(0o755)
        for part in ("python/heave", "tests/lib"):
            shutil.copytree(kernel.TOP / part, Path(folder) / part)
        for user in ([], ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"]):
            is_direct(nested(f"{folder}/tests/lib/kernel.py", *user))


def is_direct(finished):
    lines = finished.output.splitlines()
    assert finished.returncode == 5 and "UP" in lines[0], finished.output
    assert "UP" in lines[-1] and "DOWN" not in lines[-1], "the machine's own interface was touched: " + finished.output


def has_vcan():
    finished = kernel.run(["ip", "-br", "link", "show", "vcan0"])
    assert finished.returncode == 0 and "UP" in finished.output, finished.output


def virtual_hour_is_exact_and_short():
    finished = kernel.run([sys.executable, "-c", TICKS], virtual_time=True, limit_s=600)  # a sixth of the hour that passes inside
    assert finished.returncode == 0, finished.output
    assert abs(int(finished.output) - 3600_000_000) < 1000, finished.output


def endless_command_is_ended():
    finished = kernel.run(["sh", "-c", "echo begun; while :; do :; done"], virtual_time=True, limit_s=20)
    assert finished.returncode is None and "begun" in finished.output, vars(finished)


def main():
    suite = tap.Suite()
    for name, case in [("output and exit status come out", passes_on_output_and_status), ("there is a vcan0", has_vcan),
                       ("a kernel with vcan is used directly, its own interfaces stay as they are", runs_directly_where_it_can),
                       ("an hour of virtual time is exact and takes seconds", virtual_hour_is_exact_and_short),
                       ("a command that never ends is ended", endless_command_is_ended)]:
        with suite.case(name):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
