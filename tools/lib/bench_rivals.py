# SPDX-License-Identifier: MIT
"""bench_rivals.py - what tools/bench compares heaved with: a limiter of speed and acceleration, and Ruckig in an environment of its own."""
import json
import math
import os
import subprocess
import tarfile
import tempfile
import venv
from pathlib import Path

PACKAGES = ("ruckig",)
SOURCE = "ruckig-0.19.4"


def two_limits(targets, speed, accel, cycle_s):
    """Follows held targets within speed and acceleration limits only, as fast as those allow, in whole cycles. That is what LinuxCNC documents
    of its component limit3 (without its bounds of position), written anew; a held target counts as standing."""
    position, step, result = targets[0], 0.0, []
    step_max, change_max = speed * cycle_s, accel * cycle_s**2
    for target in targets:
        way = target - position
        # the largest step after which braking in whole cycles ends no further than the target
        brake = -change_max / 2 + math.sqrt(change_max**2 / 4 + 2 * change_max * abs(way))
        wished = math.copysign(min(brake, abs(way), step_max), way)
        step = min(max(wished, step - change_max), step + change_max)
        position += step
        result.append(position)
    return result


class NoRuckig(Exception):
    """Why there is no Ruckig to compare with."""


def cache():
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "heave"


def ruckig_source(say):
    """The folder of Ruckig's C++ source, as its package on PyPI has it; fetched once into the user's cache."""
    folder = cache() / SOURCE
    if (folder / "include" / "ruckig" / "ruckig.hpp").exists():
        return folder
    python = Ruckig(say).python
    say(f"fetching {SOURCE} from PyPI into {folder}")
    with tempfile.TemporaryDirectory(dir=cache()) as scratch:
        command = [str(python), "-m", "pip", "download", "-q", "--disable-pip-version-check", "--no-deps", "--no-binary", "ruckig", "-d", scratch,
                   SOURCE.replace("-", "==")]
        result = subprocess.run(command, capture_output=True, text=True, check=False)
        archive = Path(scratch) / f"{SOURCE}.tar.gz"
        if not archive.exists():
            raise NoRuckig(f"pip could not fetch its source: {(result.stderr.strip().splitlines() or ['no reason given'])[-1]}")
        with tarfile.open(archive) as tar:
            tar.extractall(scratch, members=[member for member in tar.getmembers() if member.isfile() and member.name.startswith(f"{SOURCE}/")
                                             and ".." not in member.name])
        (Path(scratch) / SOURCE).rename(folder)
    return folder


class Ruckig:
    """Ruckig, one axis, given each new target as it comes, to be reached at rest; runs in a virtual environment."""

    def __init__(self, say):
        self.folder = cache() / "bench-venv"
        self.python = self.folder / "bin" / "python"
        if not self._answers():
            self._install(say)
        self.version = self._run(["-c", "import importlib.metadata as m; print(m.version('ruckig'))"]).stdout.strip()

    def _run(self, arguments, **options):
        return subprocess.run([str(self.python), *arguments], capture_output=True, text=True, check=False, **options)

    def _answers(self):
        return self.python.exists() and self._run(["-c", "import ruckig"]).returncode == 0

    def _install(self, say):
        say(f"installing {', '.join(PACKAGES)} from PyPI into {self.folder} (delete that folder to undo it)")
        try:
            venv.create(self.folder, with_pip=True, clear=True)
        except (subprocess.CalledProcessError, OSError) as error:
            raise NoRuckig(f"python3 -m venv does not work here ({error}); on Debian and Ubuntu: apt-get install python3-venv") from error
        result = self._run(["-m", "pip", "install", "-q", "--disable-pip-version-check", *PACKAGES])
        if result.returncode != 0 or not self._answers():
            lines = [line for line in result.stderr.splitlines() if line.startswith("ERROR")] or ["import ruckig fails"]
            raise NoRuckig(f"pip could not install it: {lines[-1]}")

    def follow(self, targets, speed, accel, jerk, cycle_s):
        job = json.dumps({"targets": targets, "limits": [speed, accel, jerk], "cycle_s": cycle_s})
        result = self._run([str(Path(__file__).with_name("bench_ruckig.py"))], input=job)
        if result.returncode != 0:
            raise NoRuckig(f"it failed: {(result.stderr.strip().splitlines() or ['no reason given'])[-1]}")
        return json.loads(result.stdout)
