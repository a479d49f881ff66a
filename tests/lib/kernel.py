#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""kernel.py - runs a test on a kernel that has SocketCAN, with an interface vcan0 that is up and its own: heave-lab, which skips where there is no kernel.

    kernel.py [--virtual-time] [--instrumented] [--python] [--limit SECONDS] -- COMMAND [ARG...]
        prints what the command printed and ends with its status; where no such kernel is to be had: "1..0 # SKIP reason", status 0

Used where the tests need CAN, GPIO or exact times. On this machine's kernel where it has vcan and lets us, else, and always with --virtual-time, on one of User
Mode Linux: python/heave/lab says what that is.
--python: the command is a script for the Python of tools/lib/venv.sh, which has python-can and canopen.
--instrumented: the command has the address sanitizer, which needs more addresses than a process has in User Mode Linux.
"""
import argparse
import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "python"))
from heave import lab  # noqa: E402  the path above has to be set first
from heave.lab import bounded, own_name_space  # noqa: E402,F401  for tests that start kernels of another kind


def wanted_environment(extra):
    """The variables that a test may rely on; the host's others would only differ from machine to machine."""
    kept = {"PYTHONHASHSEED": "0"}  # sets in the same order in each run
    kept |= {name: value for name, value in os.environ.items() if name.startswith(("PYTHON", "HEAVE_", "LC_", "LANG", "XDG_CACHE"))}
    return {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": os.path.expanduser("~"), **kept, **profile(), **extra}


def profile():
    """Where a command that counts what it reaches (tools/coverage) leaves that: a file of its own, for the lock of a shared one ends at this kernel."""
    shared = os.environ.get("LLVM_PROFILE_FILE")
    return {"LLVM_PROFILE_FILE": str(Path(shared).with_name(f"heave-lab-{uuid.uuid4().hex}-%p.profraw"))} if shared else {}


def read(path):
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""


def find(tool):
    """What tools/test has put into the cache."""
    found = subprocess.run([TOP / "tools/lib" / tool, "--cached"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if found.returncode != 0:
        raise tap.Skip(found.stderr.strip() or f"{tool} finds nothing")
    return found.stdout.strip()


def run(command, virtual_time=False, limit_s=300, is_instrumented=False, is_ahead=False, **environment):
    """Runs the command with these additional environment variables; is_ahead: a kernel of its own goes before other programs. Raises tap.Skip
    where no kernel is to be had; returncode None: killed after limit_s of real time."""
    if is_instrumented and (virtual_time or not lab.has_vcan_here()):
        raise tap.Skip("the address sanitizer does not work in User Mode Linux")
    if virtual_time or not lab.has_vcan_here():
        try:
            lab.find_kernel()
        except lab.LabError as reason:
            raise tap.Skip(reason) from reason
    environment |= {"HEAVE_VIRTUAL_TIME": "1"} if virtual_time else {}
    return lab.run(command, kernel="any", virtual_time=virtual_time, limit_s=limit_s, environment=wanted_environment(environment), is_ahead=is_ahead)


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("\n\n")[1].strip())
    parser.add_argument("--virtual-time", action="store_true")
    parser.add_argument("--python", action="store_true")
    parser.add_argument("--instrumented", action="store_true")
    parser.add_argument("--limit", type=float, default=300)
    parser.add_argument("command", nargs="+")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        command = [find("venv.sh"), *options.command] if options.python else options.command
        finished = run(command, options.virtual_time, options.limit, options.instrumented)
    except tap.Skip as reason:
        print(f"1..0 # SKIP {reason}")
        return 0
    except lab.LabError as error:
        print(f"kernel.py: {error}")
        return 1
    sys.stdout.write(finished.output)
    if finished.returncode is None:
        print(f"kernel.py: not finished within {options.limit:g} s")
        return 1
    return finished.returncode


if __name__ == "__main__":
    sys.exit(main())
