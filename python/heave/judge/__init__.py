# SPDX-License-Identifier: MIT
"""Independent checks of a run: limits and continuity of each row, kinematics, rest, relays, timed moves; lag and gain. Shares no code with heaved.

    verdict = judge.check("ride.ini", run)            # of heave.play(), or the path of a trace
    assert verdict, verdict
    judge.follow(run, "roll", "ride.ini").lag_ms
"""
from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from heave import programs, recording
from heave.configuration import ConfigError, Configuration
from heave.errors import HeaveError, NotInstalled
from heave.judge.checker import Checker
from heave.judge.following import Following, following
from heave.judge.rules import Violation
from heave.judge.timed import TimedWatcher
from heave.plot.dots import dots_of
from heave.trace import COLUMNS

if TYPE_CHECKING:
    from heave.offline import Run

__all__ = ["Following", "Rule", "Verdict", "Violation", "check", "follow", "following"]


@dataclass
class Rule:
    """A limit, and how near the run came to it."""
    name: str
    limit: str
    worst: str
    share: float  # of the limit
    t_us: int | None
    rows: int     # so many were checked


@dataclass
class Verdict:
    """True where nothing was found. str() names the first violations."""
    rows: int
    violations: int
    first: list[Violation]
    rules: list[Rule]
    by_rule: dict[str, int] = field(default_factory=dict)
    timed_moves: int = 0  # checked

    def __bool__(self) -> bool:
        return self.violations == 0 and self.rows > 0

    def __str__(self) -> str:
        lines = [f"{self.rows} rows, {self.violations} violations", *map(str, self.first)]
        return "\n".join(lines)

    def rule(self, name: str) -> Rule:
        for each in self.rules:
            if each.name == name:
                return each
        raise KeyError(f"{name!r} is no rule: {', '.join(each.name for each in self.rules)}")


def configuration_of(path: str | os.PathLike[str]) -> Configuration:
    """What the file says; where it leaves keys out, with those that heaved fills in."""
    try:
        return Configuration(path)
    except ConfigError as error:
        try:
            dump = subprocess.run([programs.find("heaved"), "--config", path, "--dump-config"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, check=False)
        except NotInstalled:
            raise error from None
        if dump.returncode != 0:
            raise ConfigError(dump.stderr.decode(errors="replace").strip()) from error
        with tempfile.NamedTemporaryFile(prefix="heave-", suffix=".ini") as file:
            file.write(dump.stdout)
            file.flush()
            return Configuration(file.name)


def check(config: str | os.PathLike[str], trace: Run | str | os.PathLike[str] | Iterable[str], *, frames: str | os.PathLike[str] | Sequence[recording.Line] | None = None,
          every: int = 10) -> Verdict:
    """trace: a run of heave.play(), the path of a trace, or its lines. frames: timed moves are checked too. every: as for heave check."""
    configuration = configuration_of(config)
    lines = recording.read(frames) if isinstance(frames, (str, os.PathLike)) else frames
    timed = TimedWatcher(lines, configuration, COLUMNS) if lines else None
    checker = Checker(configuration, every=every, watchers=[timed] if timed else [])
    if isinstance(trace, (str, os.PathLike)):
        with open(trace, encoding="ascii", errors="replace", newline="\n") as file:
            checker.read(file)
    else:
        checker.read(trace.text.splitlines(keepends=True) if hasattr(trace, "text") else trace)
    findings = checker.findings
    return Verdict(checker.rows, findings.count, findings.first, [Rule(*summary) for summary in checker.summaries()], findings.by_rule,
                   timed.checked if timed else 0)


def follow(run: Run, axis: str, config: str | os.PathLike[str] | None = None, *, frames: Sequence[recording.Line] | None = None, lag_max_s: float = 2.0) -> Following:
    """Lag and gain of an axis (roll ... z, angle, c1 ... c6) while the run is ENGAGED. config: what is asked goes through its signs, scales and offsets,
    and extensions of poses are known."""
    platform = configuration_of(config) if config is not None else None
    dots = [dot for dot in dots_of(frames if frames is not None else run.frames, platform) if axis in dot.values]
    if len(dots) < 2:
        raise HeaveError(f"the frames ask {len(dots)} times for {axis}: a stream is needed")
    led = [i for i, state in enumerate(run.states) if state == "ENGAGED"]
    if not led:
        raise HeaveError("the run was never ENGAGED")
    times, column = run.window.times_us, run.window.column(axis)
    return following([dot.t_us / 1e6 for dot in dots], [dot.values[axis] for dot in dots], [times[i] / 1e6 for i in led], [column[i] / 1e9 for i in led], lag_max_s=lag_max_s)
