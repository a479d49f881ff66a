# SPDX-License-Identifier: MIT
"""offline.py - runs of heaved --play: the same motion as live, in simulated time, as fast as this machine goes."""
from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from heave import programs, recording
from heave.configuration import changed
from heave.errors import HeaveError, PlayFailed
from heave.plot.window import NAMES, Window

if TYPE_CHECKING:
    import numpy
    from numpy.typing import NDArray

    Array = NDArray[numpy.float64]

Frames = str | os.PathLike[str] | Iterable[recording.Line | tuple[float, str]]


class Run:
    """What a run came to, a row per cycle. Arrays take NumPy; states, flags and rows do not."""

    def __init__(self, window: Window, log: str, text: str, frames: list[recording.Line]):
        self.window, self.log, self.text, self.frames = window, log, text, frames
        self.states: list[str] = window.states
        self.flags: list[str] = window.flags
        self.cycle_us: int = window.cycle_us

    def __len__(self) -> int:
        return len(self.states)

    @property
    def t_s(self) -> Array:
        return _array(self.window.times_us) / 1e6

    def __getitem__(self, name: str) -> Array:
        """roll, pitch, yaw, x, y, z, angle, c1 ... c6: the set-points, in deg and mm."""
        if name not in NAMES:
            raise KeyError(f"{name!r} is no axis: {', '.join(NAMES)}")
        return _array(self.window.column(name)) / 1e9

    @property
    def pose(self) -> Array:
        """A row per cycle: roll, pitch, yaw, x, y, z."""
        return _array([row[:6] for row in self.window.rows]) / 1e9

    @property
    def cylinders(self) -> Array:
        return _array([row[7:] for row in self.window.rows]) / 1e9

    def rates(self, name: str, order: int) -> Array:
        """Speed (1), acceleration (2) or jerk (3) as finite differences, per second; NaN where rows before are missing."""
        return _array([float("nan") if value is None else value for value in self.window.rates(name, order)])


def play(config: str | os.PathLike[str], frames: Frames, *, changes: Mapping[str, object] | None = None, arguments: Sequence[str] = (),
         program: str | os.PathLike[str] | None = None, timeout: float = 600.0) -> Run:
    """Plays frames on the platform of config. frames: a FRAMES or CSV file, lines of recording, or pairs (t_ms, text) as in `(5000, "!park")`."""
    with tempfile.TemporaryDirectory(prefix="heave-play-") as name:
        folder = Path(name)
        lines = _write(frames, folder / "frames")
        own = folder / "platform.ini"
        own.write_text(changed(Path(config).read_text(encoding="utf-8"), changes or {}, str(config)), encoding="utf-8")
        command = [program or programs.find("heaved"), "--config", own, "--play", folder / "frames", "--trace", folder / "trace.csv", *arguments]
        run = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=timeout, check=False)
        if run.returncode != 0:
            raise PlayFailed(run.stderr.strip().replace(str(own), os.fspath(config)) or f"heaved ended with exit code {run.returncode}", run.returncode)
        text = (folder / "trace.csv").read_text(encoding="ascii")
    return Run(Window(text.splitlines(keepends=True), name="trace"), run.stderr, text, lines)


def _write(frames: Frames, path: Path) -> list[recording.Line]:
    """As heaved takes them. A file of frames goes as it is: it may hold more than this package reads."""
    if isinstance(frames, (str, os.PathLike)):
        if not os.fspath(frames).lower().endswith(".csv"):
            path.write_bytes(Path(frames).read_bytes())
            return recording.read_frames(frames)
        lines = recording.read_csv(frames)
    else:
        lines = [line if isinstance(line, recording.Line) else recording.Line(round(line[0] * 1000), line[1]) for line in frames]
    path.write_text("".join(f"{line.t_us / 1000:.3f} {escape(line.text)}\n" for line in lines), encoding="ascii")
    return lines


def escape(text: str) -> str:
    return "".join(each if " " <= each <= "~" and each != "\\" else f"\\x{ord(each):02x}" for each in text)


def _array(values: Sequence[Any]) -> Array:
    try:
        import numpy as module
    except ImportError as error:
        raise HeaveError("arrays need NumPy: apt-get install python3-numpy, or pip install 'heave[arrays]'") from error
    return module.array(values, dtype=module.float64)
