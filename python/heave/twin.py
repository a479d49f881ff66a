# SPDX-License-Identifier: MIT
"""twin.py - a heave-twin of one's own: the drives outside a heaved, made from the same configuration file, with faults and positions while it runs.

    with Twin("ride.ini") as twin:
        twin.fault("jam 3")             # any line of docs/twin.md, without a time
        twin.positions                  # mm, deg: where the drives really are
        twin.mend()
        twin.switch("estop", closed=False)      # with [inputs] driver = gpio
"""
from __future__ import annotations

import json
import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from heave import programs
from heave.configuration import changed
from heave.errors import NotRunning, Refused

STOP_S = 10.0
START_S = 10.0
LOOK_S = 0.02
SWITCHES = ("estop", "estop2", "enable", "reset", "power")


class Twin:
    """with Twin("ride.ini"): heave-twin --config ride.ini, until the end. It listens when the constructor returns."""

    def __init__(self, config: str | os.PathLike[str], arguments: Sequence[str] = (), *, script: Sequence[str] = (), changes: Mapping[str, object] | None = None,
                 program: str | os.PathLike[str] | None = None, timeout: float = 5.0):
        """arguments: of heave-twin, such as "--swap", "2,5". script: lines of faults with their times, as "+2 jam 3". changes: of a copy of the configuration, as Heaved
        has them ({"can.interface": "twin0"}). timeout: of one answer, in s."""
        self.program = Path(program) if program is not None else programs.find("heave-twin")
        self.timeout, self._said = timeout, ""
        self._folder = tempfile.TemporaryDirectory(prefix="heave-twin-")
        self._log, self.socket = Path(self._folder.name) / "log", Path(self._folder.name) / "socket"
        if changes:
            source, config = Path(config), Path(self._folder.name) / "platform.ini"
            config.write_text(changed(source.read_text(encoding="utf-8"), changes, str(source)), encoding="utf-8")
        faults = [word for line in script for word in ("--fault", line)]
        command = [str(self.program), "--config", os.fspath(config), "--socket", str(self.socket), *faults, *arguments]
        with open(self._log, "wb") as log:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        end = time.monotonic() + START_S
        while not self.socket.exists() and self.process.poll() is None and time.monotonic() < end:
            time.sleep(LOOK_S)
        if self.process.poll() is not None or not self.socket.exists():
            code, said = self.process.poll(), self.log
            self.close()
            raise NotRunning(f"heave-twin {'does not answer' if code is None else f'ended with exit code {code}'}: {_last(said)}")

    def __enter__(self) -> Twin:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def log(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace") if self._log.exists() else self._said

    def check(self) -> None:
        """Raises where it has ended by itself."""
        if self.process.poll() is not None:
            raise NotRunning(f"heave-twin ended with exit code {self.process.returncode}: {_last(self.log)}")

    def _ask(self, line: str) -> str:
        if "\n" in line or "\0" in line:
            raise Refused(line, f"{line!r}: a fault is one line")
        answer = b""
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
                link.settimeout(self.timeout)
                link.connect(str(self.socket))
                link.sendall(f"{line}\n".encode())
                while not answer.endswith(b"\n"):
                    more = link.recv(65536)
                    if not more:
                        break
                    answer += more
        except OSError as error:
            self.check()
            raise NotRunning(f"heave-twin cannot be asked at {self.socket}: {error.strerror or error}") from error
        text = answer.decode("utf-8", errors="replace").rstrip("\n")
        if text.startswith("error: "):
            raise Refused(line, text.removeprefix("error: "))
        if not text:
            raise NotRunning(f"heave-twin has not answered {line!r}")
        return text

    def fault(self, line: str) -> None:
        """Makes it now: a line of docs/twin.md without its time, such as "jam 3" or "lose 2 5". Refused: heave-twin's own words."""
        self._ask(line)

    def mend(self, drive: int | None = None) -> None:
        """Ends the lasting faults of a drive, or of all."""
        self._ask(f"mend {'all' if drive is None else drive}")

    def status(self) -> dict[str, Any]:
        """All that heave-twin knows: drives, pose, coils of a board, switches, relays and healthy pulse on GPIO lines."""
        status: dict[str, Any] = json.loads(self._ask("status"))
        return status

    def switch(self, name: str, *, closed: bool) -> None:
        """Opens or closes a switch on a GPIO line, by its key of [inputs]: estop, estop2, enable, reset, power."""
        if name not in SWITCHES:
            raise Refused(name, f"{name!r} is no switch: {', '.join(SWITCHES)}")
        self._ask(f"{name} {'closed' if closed else 'open'}")

    @property
    def switches(self) -> dict[str, bool]:
        """Which switches on GPIO lines are closed."""
        return {name: state == "closed" for name, state in self.status().get("switches", {}).items()}

    @property
    def relays(self) -> list[int] | None:
        """Numbers of the relays on GPIO lines that are closed; None where there are none, or their chip is gone."""
        relays: list[int] | None = self.status().get("relays")
        return relays

    @property
    def positions(self) -> list[float]:
        """Where the drives really are, mm or deg."""
        return [float(drive["position"]) for drive in self.status()["drives"]]

    @property
    def pose(self) -> dict[str, float] | None:
        """Where the platform really is: roll, pitch, yaw in deg, x, y, z in mm; None where the legs fit no pose."""
        pose = self.status()["pose"]
        return None if pose is None else dict(zip(("roll", "pitch", "yaw", "x", "y", "z"), map(float, pose)))

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._said = self.log
        self._folder.cleanup()


def _last(text: str) -> str:
    return " / ".join(text.splitlines()[-5:]) or "it has said nothing"
