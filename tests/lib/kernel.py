#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""kernel.py - runs a command on a kernel that has SocketCAN, with an interface vcan0 that is up and its own.

    kernel.py [--virtual-time] [--instrumented] [--python] [--limit SECONDS] -- COMMAND [ARG...]
        prints what the command printed and ends with its status; where no such kernel is to be had: "1..0 # SKIP reason", status 0

Used where the tests need CAN, GPIO or exact times:
- this machine's kernel, in a network name space of its own, where it has vcan and lets us;
- else a User Mode Linux kernel (tools/lib/uml.sh keeps it in the cache), which boots in half a second, with this machine's files as its own.
  The command is root in there, outside it has no other rights than the caller; HEAVE_OWN_KERNEL=1 tells it that it may even set the clock.
--virtual-time: always User Mode Linux. Computing takes no time there and sleeps are exact, whatever the machine is doing: every time that a
test measures can be asserted to the microsecond, and every run is the same.
--python: the command is a script for the Python of tools/lib/venv.sh, which has python-can and canopen.
--instrumented: the command has the address sanitizer, which needs more addresses than a process has in User Mode Linux.
"""
import argparse
import contextlib
import os
import shlex
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

HERE = Path(__file__).resolve().parent
TOOLS = HERE.parents[1] / "tools/lib"
MEMORY = "512M"
NICE = 5  # a third of the time beside one that computes too
AHEAD = -15  # nearly all of it
SETUP = """
ip link set lo up
ip link add vcan0 type vcan && ip link set vcan0 txqueuelen 16 && ip link set vcan0 up || exit 97
"""


class Finished:
    """What a command came to."""

    def __init__(self, returncode, output):
        self.returncode, self.output = returncode, output


def script_of(command, environment):
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment.items())
    return f"{SETUP}{exports}cd {shlex.quote(os.getcwd())}\nexec {shlex.join(map(str, command))}\n"


def wanted_environment(extra):
    """The variables that a test may rely on; the host's others would only differ from machine to machine."""
    kept = {name: value for name, value in os.environ.items() if name.startswith(("PYTHON", "HEAVE_", "LC_", "LANG", "XDG_CACHE"))}
    return {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": os.path.expanduser("~"), **kept, **extra}


def bounded(command, limit_s, **options):
    """Runs in a process group of its own and leaves nothing behind; None for the status where it took too long."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True, **options)
    try:
        output = process.communicate(timeout=limit_s)[0]
        return process.returncode, output.decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[0].decode(errors="replace")
    except BaseException:  # Ctrl-C, SIGTERM: a kernel of which nobody knows would stay
        os.killpg(process.pid, signal.SIGKILL)
        raise


def own_name_space():
    return ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user", "--net"]


def host_has_vcan():
    try:
        return bounded([*own_name_space(), "sh", "-c", SETUP], 20)[0] == 0
    except OSError:
        return False


def profile_of(folder):
    """Where a command that counts what it reaches (tools/coverage) leaves that: a file of its own, for the lock of a shared one ends at this kernel."""
    shared = os.environ.get("LLVM_PROFILE_FILE")
    return {"LLVM_PROFILE_FILE": str(Path(shared).with_name(f"{folder.name}-%p.profraw"))} if shared else {}


def run_here(command, limit_s, environment):
    status, output = bounded([*own_name_space(), "bash", "-c", script_of(command, environment)], limit_s, env=environment)
    return Finished(status, output)


def read(path):
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""


def weigh(nice):
    """Where that is permitted. On virtual time nobody minds to wait; tests on real time beside this one do. Linux may weigh by sessions, and this is one (autogroup)."""
    with contextlib.suppress(OSError):
        os.nice(nice)
        Path("/proc/self/autogroup").write_text(str(nice), encoding="ascii")


def run_uml(kernel, command, limit_s, environment, virtual_time, is_ahead):
    with tempfile.TemporaryDirectory(prefix="heave-uml-") as folder:
        job = Path(folder)
        (job / "run.sh").write_text(script_of(command, {**environment, **profile_of(job), "HEAVE_OWN_KERNEL": "1"}), encoding="utf-8")
        boot = [kernel, f"mem={MEMORY}", "rootfstype=hostfs", "rootflags=/", "rw", f"init={HERE / 'uml_init.sh'}", f"job={job}", f"uml_dir={job}/",
                "vcan.echo=1", "quiet", "con=null", "con0=null,fd:1", *(["time-travel=inf-cpu"] if virtual_time else [])]
        nice = NICE if virtual_time else AHEAD if is_ahead else 0
        ended, console = bounded(boot, limit_s, env={**os.environ, "TMPDIR": folder}, preexec_fn=(lambda: weigh(nice)) if nice else None)
        output, status = read(job / "output"), read(job / "status").strip()
    if ended is None:
        return Finished(None, output)
    return Finished(int(status) if status else None, output if status else f"{output}\n{console}\nthe kernel stopped before the command ended\n")


def find(tool):
    """What tools/test has put into the cache."""
    found = subprocess.run([TOOLS / tool, "--cached"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if found.returncode != 0:
        raise tap.Skip(found.stderr.strip() or f"{tool} finds nothing")
    return found.stdout.strip()


def run(command, virtual_time=False, limit_s=300, is_instrumented=False, is_ahead=False, **environment):
    """Runs the command with these additional environment variables; is_ahead: a kernel of its own goes before other programs. Raises tap.Skip
    where no kernel is to be had; returncode None: killed after limit_s of real time, or the kernel died."""
    environment = wanted_environment(environment)
    if not virtual_time and host_has_vcan():
        return run_here(command, limit_s, environment)
    if is_instrumented:
        raise tap.Skip("the address sanitizer does not work in User Mode Linux")
    return run_uml(find("uml.sh"), command, limit_s, environment, virtual_time, is_ahead)


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
    sys.stdout.write(finished.output)
    if finished.returncode is None:
        print(f"kernel.py: not finished within {options.limit:g} s, or the kernel died")
        return 1
    return finished.returncode


if __name__ == "__main__":
    sys.exit(main())
