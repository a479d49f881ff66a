# SPDX-License-Identifier: MIT
"""programs.py - where heaved and its companions are."""
from __future__ import annotations

import os
import shutil
from pathlib import Path

from heave.errors import NotInstalled


def find(name: str, folder: str | os.PathLike[str] | None = None) -> Path:
    """Of a program: in the folder, else in $HEAVE_BIN, else on PATH."""
    chosen = folder or os.environ.get("HEAVE_BIN")
    if chosen:
        path = Path(chosen) / name
        if os.access(path, os.X_OK):
            return path
        raise NotInstalled(f"{path} is not there or no program" + ("" if folder else " (the environment's HEAVE_BIN names that folder)"))
    found = shutil.which(name)
    if found is None:
        raise NotInstalled(f"{name} is not on PATH: install Heave's package, or name the folder of a build: HEAVE_BIN=.../build/release/bin")
    return Path(found)


def demo_config() -> Path:
    """A simulated hexapod that rises by itself: the platform to try things out on."""
    return Path(__file__).resolve().with_name("demo-hexapod.ini")
