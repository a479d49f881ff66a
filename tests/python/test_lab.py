#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_lab.py - heave-lab as its users call it: what comes out, exit codes, and what it says where it cannot. (What the tests themselves use of it: system.kernel.)"""
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import kernel  # its path to the package
import tap

from heave import lab

LAB = Path(__file__).resolve().parents[2] / "tools/heave-lab"
LIMIT_S = 200


def ask(*arguments, **environment):
    return subprocess.run([LAB, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=LIMIT_S, check=False, env={**os.environ, **environment})


def need_kernel():
    try:
        lab.find_kernel()
    except lab.LabError as reason:
        raise tap.Skip(reason) from reason


def output_status_folder_and_environment():
    need_kernel()
    with tempfile.TemporaryDirectory(prefix="heave-lab-test-") as folder:
        run = subprocess.run([LAB, "run", "--", "sh", "-c", "pwd; echo $OF_MINE; echo $HEAVE_OWN_KERNEL; echo there > file; ip -br link show vcan0; ls -d /sys/kernel/config/gpio-sim; exit 41"],
                             cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=LIMIT_S, check=False, env={**os.environ, "OF_MINE": "a 'b' $c"})
        assert run.returncode == 41, (run.returncode, run.stdout, run.stderr)
        lines = run.stdout.splitlines()
        assert lines[:3] == [folder, "a 'b' $c", "1"] and "UP" in lines[3] and lines[4] == "/sys/kernel/config/gpio-sim", lines
        assert (Path(folder) / "file").read_text(encoding="ascii") == "there\n", "its files are not this machine's"


def virtual_time_is_exact():
    need_kernel()
    run = ask("run", "--virtual-time", "--", sys.executable, "-c", "import time; a = time.monotonic(); time.sleep(1800); print(round(time.monotonic() - a, 3))")
    assert (run.returncode, run.stdout) == (0, "1800.0\n"), run


def output_comes_while_it_runs():
    need_kernel()
    process = subprocess.Popen([LAB, "run", "--", "sh", "-c", "echo first; sleep 6; echo last; sleep 600"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
    try:
        begin = time.monotonic()
        assert process.stdout.readline() == "first\n"
        middle = time.monotonic()
        assert process.stdout.readline() == "last\n"
        assert time.monotonic() - middle > 1 and process.poll() is None, f"first after {middle - begin:.1f} s, last with it"
    finally:
        process.terminate()
        assert process.wait(60) == 143
        process.stdout.close()


def too_long_is_said():
    need_kernel()
    run = ask("run", "--limit", "4", "--", "sh", "-c", "echo begun; sleep 1000")
    assert run.returncode == 124 and "not finished within 4 s" in run.stderr, run


def what_is_missing_is_said():
    with tempfile.TemporaryDirectory(prefix="heave-lab-test-") as folder:
        run = ask("run", "--", "true", XDG_CACHE_HOME=folder)
        assert run.returncode == 125 and "heave-lab build" in run.stderr and folder in run.stderr and len(run.stderr.splitlines()) == 1, run
        run = ask("path", XDG_CACHE_HOME=folder)
        assert run.returncode == 1 and "heave-lab build" in run.stderr, run
    if not lab.has_vcan_here():
        run = ask("run", "--kernel", "here", "--", "true")
        assert run.returncode == 125 and "no vcan" in run.stderr and "modprobe vcan" in run.stderr, run
    run = ask("run", "--kernel", "here", "--virtual-time", "--", "true")
    assert run.returncode == 125 and "virtual time" in run.stderr, run


def a_kernel_that_dies_is_said():
    need_kernel()
    run = ask("run", "--memory", "4M", "--", "true")
    assert run.returncode == 125 and "stopped before the command ended" in run.stderr, run


def ends_where_nobody_reads():
    need_kernel()
    out, into = os.pipe()
    run = subprocess.Popen([LAB, "run", "--", "sh", "-c", "echo begun; while sleep 0.2; do echo more; done"], stdin=subprocess.DEVNULL, stdout=into, stderr=subprocess.PIPE, text=True)
    os.close(into)
    assert os.read(out, 6) == b"begun\n"
    os.close(out)
    said = run.communicate(timeout=LIMIT_S)[1]
    assert run.returncode == 141 and said == "", (run.returncode, said)


def wrong_options_are_refused():
    for words, *arguments in ((("required",),), (("invalid choice", "walk"), "walk"), (("COMMAND",), "run"), (("seconds above 0",), "run", "--limit", "0", "--", "true"), (("'own'",), "run", "--kernel", "mine", "--", "true")):
        run = ask(*arguments)
        assert run.returncode == 2 and all(word in run.stderr for word in words), (arguments, run)
    for arguments in (("--help",), ("run", "--help")):
        run = ask(*arguments)
        assert run.returncode == 0 and "exit status" in run.stdout and "125" in run.stdout, run


def main():
    suite = tap.Suite()
    for case in (output_status_folder_and_environment, virtual_time_is_exact, output_comes_while_it_runs, too_long_is_said, what_is_missing_is_said, a_kernel_that_dies_is_said, ends_where_nobody_reads, wrong_options_are_refused):
        with suite.case(case.__name__.replace("_", " ")):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
