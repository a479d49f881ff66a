# SPDX-License-Identifier: MIT
"""twin.py - a heave-twin of one's own: the drives outside a heaved, made from the same configuration file."""
from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from heave import programs
from heave.errors import NotRunning

STOP_S = 10.0


class Twin:
    """with Twin("ride.ini"): heave-twin --config ride.ini, until the end."""

    def __init__(self, config: str | os.PathLike[str], arguments: Sequence[str] = (), *, program: str | os.PathLike[str] | None = None):
        self.program = Path(program) if program is not None else programs.find("heave-twin")
        descriptor, name = tempfile.mkstemp(prefix="heave-twin-")
        self._log, self._said = Path(name), ""
        command = [str(self.program), "--config", os.fspath(config), *arguments]
        try:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=descriptor, stderr=descriptor)
        finally:
            os.close(descriptor)

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
            raise NotRunning(f"heave-twin ended with exit code {self.process.returncode}: {' / '.join(self.log.splitlines()[-5:]) or 'it has said nothing'}")

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(STOP_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self._said = self.log
        self._log.unlink(missing_ok=True)
