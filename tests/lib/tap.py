# SPDX-License-Identifier: MIT
"""tap.py - how a script test reports its cases (Test Anything Protocol), so that tools/test counts each of them.

    suite = tap.Suite()
    with suite.case("the frame is refused"):
        assert answer == expected, f"got {answer}"
    with suite.case("error frames"):
        raise tap.Skip("this kernel has no vcan")
    sys.exit(suite.done())

A case fails by any exception; what it says follows as comment lines. A Fault says that no clock explains it, so that the test is not tried again. done() prints the plan; a script that dies before it has failed.
"""
import contextlib
import importlib.util
import os
import subprocess
import sys
import time
import traceback
from pathlib import Path

VENV = Path(__file__).resolve().parents[2] / "tools/lib/venv.sh"


def needs_package(name):
    """Begins the script again with the Python of tools/lib/venv.sh where this one has no such package; ends it as skipped where that one is not there."""
    if importlib.util.find_spec(name):
        return
    found = subprocess.run([VENV, "--cached"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if found.returncode != 0:
        print(f"1..0 # SKIP {found.stderr.strip()}")
        sys.exit(0)
    os.execv(found.stdout.strip(), [found.stdout.strip(), *sys.argv])


class Skip(Exception):
    """Raised in a case that cannot run here; the text is the reason."""


class Fault(AssertionError):
    """What is wrong however late the machine was: a limit that was left, a crash."""


class Suite:
    def __init__(self):
        self.count = 0
        self.failed = 0

    @contextlib.contextmanager
    def case(self, name):
        self.count += 1
        try:
            yield
            print(f"ok {self.count} - {name}", flush=True)
        except Skip as reason:
            print(f"ok {self.count} - {name} # SKIP {reason}", flush=True)
        except Exception as error:
            self.failed += 1
            text = str(error) if isinstance(error, AssertionError) and str(error) else traceback.format_exc()
            print(f"not ok {self.count} - {name}")
            if isinstance(error, Fault):
                text = f"FAULT {text}"
            print("\n".join(f"# {line}" for line in text.rstrip().splitlines()), flush=True)

    def done(self):
        if "HEAVE_VIRTUAL_TIME" in os.environ:
            print(f"# {time.monotonic_ns()} ns", flush=True)  # the same in each run, where really nothing depends on this machine
        print(f"1..{self.count}", flush=True)
        return 1 if self.failed or not self.count else 0
