# SPDX-License-Identifier: MIT
"""forked.py - a Python program beside a test, forked from it: in a User Mode Linux kernel a new Python with its packages takes seconds.

    drives = Forked(can_drives.main, config, "--follow")      the rest as subprocess.Popen with two pipes of text
    assert drives.stdout.readline() == "ready\\n"
    drives.stdin.close()
    assert drives.wait(timeout=60) == 0
"""
import os
import subprocess
import sys
import time
import traceback

FIRST_FREE_FD = 3
LOOK_S = 0.01


class Forked:
    def __init__(self, main, *arguments):
        heard, told = os.pipe(), os.pipe()  # by the child: what it reads, what it writes
        sys.stdout.flush()
        sys.stderr.flush()
        self.returncode, self.pid = None, os.fork()
        if self.pid == 0:
            self.become(main, arguments, heard[0], told[1])
        os.close(heard[0])
        os.close(told[1])
        self.stdin, self.stdout = os.fdopen(heard[1], "w", encoding="utf-8"), os.fdopen(told[0], encoding="utf-8")

    @staticmethod
    def become(main, arguments, stdin, stdout):
        """Nothing of the test goes on in the child: neither its open files nor what it does at its end."""
        status = 1
        try:
            os.dup2(stdin, 0)
            os.dup2(stdout, 1)
            os.closerange(FIRST_FREE_FD, os.sysconf("SC_OPEN_MAX"))
            sys.stdin, sys.stdout = os.fdopen(0, encoding="utf-8", closefd=False), os.fdopen(1, "w", encoding="utf-8", closefd=False)
            sys.argv = [main.__module__, *map(str, arguments)]
            main()
            sys.stdout.flush()
            status = 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)

    def poll(self):
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode

    def wait(self, timeout):
        end = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout)
            time.sleep(LOOK_S)
        return self.returncode

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)
