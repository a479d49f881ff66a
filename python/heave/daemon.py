# SPDX-License-Identifier: MIT
"""daemon.py - a heaved of one's own: on a configuration, in a temporary folder, on a port that nobody has, ended at the end."""
from __future__ import annotations

import os
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

from heave import programs
from heave.configuration import changed
from heave.errors import NotRunning
from heave.platform import Platform
from heave.sender import Sender

START_S = 20.0
STOP_S = 60.0
LOOK_S = 0.01
ATTEMPTS = 5
PORT_OR_SOCKET_IN_USE = 69


def free_port() -> int:
    """A UDP port that nobody has at the moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Heaved:
    """with Heaved("ride.ini") as heaved: heaved.platform.wait_for("ENGAGED"); heaved.sender.a6(z=20)

    The configuration is copied, with a port and a socket of its own, and so with changes ({"pose.settled_extension_mm": "10"}): nothing of the original is
    touched, and any number may run beside each other. platform and sender are made for it."""

    def __init__(self, config: str | os.PathLike[str] | None = None, *, changes: Mapping[str, object] | None = None, arguments: Sequence[str] = (),
                 program: str | os.PathLike[str] | None = None, start: bool = True):
        """config: None is the demonstration platform. program: else heaved of $HEAVE_BIN or PATH. start=False: start() is called later."""
        self.program = Path(program) if program is not None else programs.find("heaved")
        self.source = Path(config) if config is not None else programs.demo_config()
        self.changes, self.arguments = dict(changes or {}), list(arguments)
        self._temporary = tempfile.TemporaryDirectory(prefix="heave-")
        self.folder = Path(self._temporary.name)
        self.config, self.socket, self.trace, self.frames = (self.folder / name for name in ("platform.ini", "heaved.sock", "trace.csv", "frames"))
        self.log_file = self.folder / "log"
        self.port = 0
        self.process: subprocess.Popen[bytes] | None = None
        self.platform = Platform(self.socket)
        self._sender: Sender | None = None
        self._said = ""
        try:
            self._text = self.source.read_text(encoding="utf-8")
            if start:
                self.start()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Heaved:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def sender(self) -> Sender:
        if self._sender is None:
            self._sender = Sender("127.0.0.1", self.port)
        return self._sender

    @property
    def log(self) -> str:
        return self.log_file.read_text(encoding="utf-8", errors="replace") if self.log_file.exists() else self._said

    def start(self) -> Heaved:
        """Starts it and waits until it answers. It records itself: trace (a row per cycle) and frames (all that came)."""
        for attempt in range(ATTEMPTS):
            self.port = free_port()
            own = {"udp.port": self.port, "control.socket": self.socket}
            self.config.write_text(changed(self._text, {**own, **self.changes}, str(self.source)), encoding="utf-8")
            with self.log_file.open("wb") as log:
                command = [self.program, "--config", self.config, "--record", self.frames, "--trace", self.trace, *self.arguments]
                self.process = subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            if self._answers():
                return self
            code = self.process.returncode
            if code != PORT_OR_SOCKET_IN_USE or "udp.port" in self.changes or attempt == ATTEMPTS - 1:
                raise NotRunning(f"heaved ended with exit code {code}: {' / '.join(self.log.splitlines()[-5:]) or 'it has said nothing'}")
        raise AssertionError("not reached")

    def _answers(self) -> bool:
        assert self.process is not None
        end = time.monotonic() + START_S
        while self.process.poll() is None:
            try:
                self.platform.status()
                return True
            except NotRunning as error:
                if time.monotonic() > end:
                    raise NotRunning(f"heaved has not answered within {START_S:g} s: {error}") from error
            time.sleep(LOOK_S)
        return False

    def stop(self, timeout: float = STOP_S) -> int:
        """As systemd ends it: it settles, switches its drives off, ends. The exit code; trace and frames are complete then."""
        if self.process is None:
            raise NotRunning("heaved was not started")
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout)

    def close(self) -> None:
        """Ends it at once where it still runs, and removes the folder."""
        if self._sender is not None:
            self._sender.close()
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._said = self.log
        self._temporary.cleanup()
