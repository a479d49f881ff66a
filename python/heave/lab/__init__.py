# SPDX-License-Identifier: MIT
"""A kernel with SocketCAN (vcan, slcan) and simulated GPIO (gpio-sim) for a command, where this machine's own has none.

User Mode Linux: a kernel that is an ordinary program, boots in half a second, for any user, with this machine's files as its own. The command is root in there,
outside it has no other rights than the caller. HEAVE_OWN_KERNEL=1 tells it that it may even set the clock. On virtual time computing takes no time and sleeps are
exact, whatever this machine is doing: every time that a test measures can be asserted to the microsecond, and every run is the same.
"""
from __future__ import annotations

import contextlib
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heave.errors import HeaveError

HERE = Path(__file__).resolve().parent
MEMORY = "512M"
NICE = 5  # a third of the time beside one that computes too
AHEAD = -15  # nearly all of it
LOOK_S = 0.05
KERNELS_OF_A_PROCESSOR = 64  # more have no claim on one of their own
KERNELS = ("own", "any", "here")
VARIABLE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
SETUP = """
ip link set lo up
ip link add vcan0 type vcan && ip link set vcan0 txqueuelen 16 && ip link set vcan0 up || exit 97
"""


class LabError(HeaveError):
    """No kernel is to be had, or it has died; the text says why, and what would help."""


@dataclass
class Finished:
    """What a command came to."""
    returncode: int | None  # None: ended after the limit
    output: str


def find_kernel(build: bool = False) -> Path:
    """Of User Mode Linux, in the user's cache; build: made there first, from Debian's sources, where there is none."""
    found = subprocess.run([HERE / "uml.sh", *([] if build else ["--cached"])], stdout=subprocess.PIPE, stderr=None if build else subprocess.PIPE, text=True, check=False)
    if found.returncode != 0:
        raise LabError((found.stderr or "").strip().removeprefix("heave-lab: ") or "the kernel could not be built, see above")
    return Path(found.stdout.strip())


def own_name_space() -> list[str]:
    return ["unshare", "--net"] if os.geteuid() == 0 else ["unshare", "--user", "--map-root-user", "--net"]


def bounded(command: Sequence[Any], limit_s: float | None, **options: Any) -> tuple[int | None, str]:
    """Runs in a process group of its own and leaves nothing behind; None for the status where it took too long."""
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, **options}
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True, **options)
    try:
        output = process.communicate(timeout=limit_s)[0]
        return process.returncode, (output or b"").decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, (process.communicate()[0] or b"").decode(errors="replace")
    except BaseException:  # Ctrl-C, SIGTERM: a kernel of which nobody knows would stay
        os.killpg(process.pid, signal.SIGKILL)
        raise


def has_vcan_here() -> bool:
    """Whether this machine's kernel has vcan and permits a network name space of one's own."""
    try:
        return bounded([*own_name_space(), "sh", "-c", SETUP], 20)[0] == 0
    except OSError:
        return False


def run(command: Sequence[str | os.PathLike[str]], *, kernel: str = "own", virtual_time: bool = False, limit_s: float | None = None,
        environment: Mapping[str, str] | None = None, memory: str = MEMORY, is_ahead: bool = False, echo: bool = False) -> Finished:
    """Runs a command, in the folder of the caller, with an interface vcan0 that is up and its own.

    kernel: own is User Mode Linux; here this machine's, in a network name space of its own; any is this machine's where that has vcan and permits it.
    environment: None is the caller's. echo: what the command prints is printed while it comes. is_ahead: in real time the kernel goes before other programs, where permitted.
    The command's input is empty."""
    if kernel not in KERNELS:
        raise LabError(f"kernel: {kernel!r} is none of {', '.join(KERNELS)}")
    environment = dict(os.environ if environment is None else environment)
    is_inside = "HEAVE_OWN_KERNEL" in os.environ  # no kernel within a kernel
    if kernel == "here" or not virtual_time and (is_inside or kernel == "any" and has_vcan_here()):
        if virtual_time:
            raise LabError("virtual time takes a kernel of its own, not this machine's")
        if kernel == "here" and not has_vcan_here():
            raise LabError("this machine's kernel has no vcan (modprobe vcan, as root), or does not permit a network name space of one's own")
        return _run_here(command, limit_s, environment, echo)
    if is_inside:
        raise LabError("there is no virtual time within a kernel in real time: this command runs in heave-lab already")
    return _run_uml(find_kernel(), command, limit_s, environment, virtual_time, memory, is_ahead, echo)


def _script_of(command: Sequence[Any], environment: Mapping[str, str]) -> str:
    exports = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in environment.items() if VARIABLE.fullmatch(name))
    return f"{SETUP}{exports}cd {shlex.quote(os.getcwd())}\nexec {shlex.join(map(str, command))}\n"


def _run_here(command: Sequence[Any], limit_s: float | None, environment: dict[str, str], echo: bool) -> Finished:
    own = {"stdout": None, "stderr": None} if echo else {}
    return Finished(*bounded([*own_name_space(), "bash", "-c", _script_of(command, environment)], limit_s, env=environment, **own))


def _run_uml(kernel: Path, command: Sequence[Any], limit_s: float | None, environment: dict[str, str], virtual_time: bool, memory: str, is_ahead: bool,
             echo: bool) -> Finished:
    with tempfile.TemporaryDirectory(prefix="heave-uml-") as folder:
        job = Path(folder)
        (job / "run.sh").write_text(_script_of(command, {**environment, "HEAVE_OWN_KERNEL": "1"}), encoding="utf-8")
        boot = [kernel, f"mem={memory}", "rootfstype=hostfs", "rootflags=/", "rw", f"init={HERE / 'init.sh'}", f"job={job}", f"uml_dir={job}/",
                "vcan.echo=1", "seccomp=auto", "quiet", "con=null", "con0=null,fd:1", *(["time-travel=inf-cpu"] if virtual_time else []), *(["heave_live"] if echo and not virtual_time else [])]
        nice = NICE if virtual_time else AHEAD if is_ahead else 0
        with (job / "console").open("wb") as console, _one_processor() if virtual_time else contextlib.nullcontext(os.sched_getaffinity(0)) as processors:
            ended = _watched(boot, job / "output", limit_s, echo, stdout=console, stderr=console, env={**os.environ, "TMPDIR": folder},
                             preexec_fn=lambda: _weigh(nice, processors))
        output, status = _read(job / "output"), _read(job / "status").strip()
        if ended is None:
            return Finished(None, output)
        if not status:
            raise LabError(f"the kernel stopped before the command ended: {_read(job / 'console').strip()[-2000:] or 'it has said nothing'}\n{output}".rstrip())
        return Finished(int(status), output)


def _watched(command: Sequence[Any], output: Path, limit_s: float | None, echo: bool, **options: Any) -> int | None:
    """As bounded(), and what is added to output is passed on."""
    process = subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, start_new_session=True, **options)
    end, passed = None if limit_s is None else time.monotonic() + limit_s, 0
    try:
        while True:
            try:
                status: int | None = process.wait(LOOK_S if echo else limit_s)
            except subprocess.TimeoutExpired:
                status = None
            if echo and output.exists():
                with output.open("rb") as file:
                    file.seek(passed)
                    text = file.read()
                passed += len(text)
                sys.stdout.buffer.write(text)
                sys.stdout.buffer.flush()
            if status is not None:
                return status
            if end is not None and time.monotonic() >= end:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
                return None
    except BaseException:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        raise


def _read(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""


@contextlib.contextmanager
def _one_processor() -> Iterator[set[int]]:
    """The one on which fewest such kernels run. At each system call a kernel and the program in it take turns; on two processors each turn takes four times as long."""
    processors = sorted(os.sched_getaffinity(0))
    for place in range(KERNELS_OF_A_PROCESSOR):
        for processor in processors:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
                try:
                    claim.bind(f"\0heave-lab-{processor}-{place}")
                except OSError:
                    continue
                yield {processor}
                return
    yield set(processors)


def _weigh(nice: int, processors: set[int]) -> None:
    """Where that is permitted. On virtual time nobody minds to wait; tests on real time beside this one do. Linux may weigh by sessions, and this is one (autogroup)."""
    with contextlib.suppress(OSError):
        os.sched_setaffinity(0, processors)
    if nice == 0:
        return
    with contextlib.suppress(OSError):
        os.nice(nice)
        Path("/proc/self/autogroup").write_text(str(nice), encoding="ascii")
