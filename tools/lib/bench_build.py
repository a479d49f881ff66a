# SPDX-License-Identifier: MIT
"""bench_build.py - the programs that tools/bench measures, built for release in a folder of their own."""
import subprocess
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]


class BuildError(Exception):
    """What is missing, or the end of the compiler's own words."""


def run_tool(*command):
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True, check=False)
    if result.returncode != 0:
        raise BuildError(f"{command[0]} failed:\n{result.stdout[-3000:]}")


def _lacks_cxx(folder):
    """Whether the folder was set up while there was no C++ compiler, which CMake remembers."""
    return "CMAKE_CXX_COMPILER:" in (cache := (folder / "CMakeCache.txt").read_text(encoding="utf-8")) and "CMAKE_CXX_COMPILER-NOTFOUND" in cache


def build(folder, target, *options):
    """Builds a program and returns its path; what the machine lacks is installed as tools/demo does it. Options are CMake's."""
    needs = ". tools/lib/deps.sh; deps_build; deps_install"
    if subprocess.run(["bash", "-c", needs, "bench"], cwd=TOP, stdin=subprocess.DEVNULL, check=False).returncode != 0:
        raise BuildError("not all that a build needs is installed")
    if not (folder / "build.ninja").exists():
        run_tool("cmake", "-S", str(TOP), "-B", str(folder), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DHEAVE_BENCH=ON", *options)
    elif options:
        run_tool("cmake", str(folder), *options, *(["-U", "CMAKE_CXX_COMPILER"] if _lacks_cxx(folder) else []))
    run_tool("cmake", "--build", str(folder), "--target", target)
    return folder / {"heaved": "bin/heaved", "heave_panel": "bin/heave-panel"}.get(target, f"tests/bench/{target}")
