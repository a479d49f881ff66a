# SPDX-License-Identifier: MIT
"""bench_cortex.py - the subcommand cortex of tools/bench: instructions of the kinematics on processors without an FPU, in an emulator,
from tests/cortex/firmware/count.c."""
import json
import subprocess
import sys

from bench_build import TOP, BuildError, run_tool

CPUS = ("cortex-m3", "cortex-m0plus")
SUBJECTS = {"inverse": ("inverse kinematics of a hexapod", 10), "forward": ("forward kinematics, from 0.5 mm and 0.05 deg beside", None)}
CALIBRATION = 1_000_000  # instructions
RUN_LIMIT_S = 300


class CortexError(Exception):
    """The program could not be run, or printed nothing that can be believed."""


def build(folder, cpu):
    needs = (". tools/lib/deps.sh; deps_build; deps_need gcc-arm-none-eabi cmd:arm-none-eabi-gcc; deps_need qemu-system-arm cmd:qemu-system-arm; "
             "deps_need libnewlib-arm-none-eabi file:/usr/include/newlib/math.h; deps_install")
    if subprocess.run(["bash", "-c", needs, "bench"], cwd=TOP, stdin=subprocess.DEVNULL, check=False).returncode != 0:
        raise BuildError("not all that a build for Cortex-M needs is installed")
    run_tool("cmake", "-G", "Ninja", "-S", str(TOP / "tests/cortex/firmware"), "-B", str(folder), "--toolchain", str(TOP / "hal/template/cortex-m.cmake"),
         f"-DHEAVE_CPU={cpu}", "-DHEAVE_COUNT=ON")
    run_tool("cmake", "--build", str(folder), "--target", "heave_count")
    return folder / "heave_count"


def count(program):
    """Of each candidate the instructions of a run. The emulator's time is instructions; what its timer makes of them is measured with a loop of known length."""
    command = ["qemu-system-arm", "-M", "mps2-an385", "-icount", "shift=0", "-display", "none", "-monitor", "none", "-serial", "none",
               "-kernel", str(program), "-semihosting-config", "enable=on,target=native"]
    run = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, timeout=RUN_LIMIT_S)
    if run.returncode != 0:
        raise CortexError(f"{program.name} ended with status {run.returncode}: {run.stdout.strip()[-300:]}")
    ticks = {name: int(number) for name, number in (line.split() for line in run.stdout.splitlines())}
    each = CALIBRATION / ticks["calibration"] / ticks["runs"]
    return {subject: {name: (ticks[f"{subject}-{name}"] - ticks["nothing"]) * each for name in ("heave", "double")} for subject in SUBJECTS}


def line_of(cpu, subject, row):
    text, goal = SUBJECTS[subject]
    ratio = row["double"] / row["heave"]
    told = "" if goal is None or cpu != CPUS[0] else f"; goal {goal}: {'met' if ratio >= goal else 'missed'}"
    return f"{cpu}: {text}: {row['heave']:.0f} instructions; {ratio:.1f} x as many in double, {row['double']:.0f}{told}"


def run(folder, as_json, say, out=sys.stdout):
    figures = {}
    for cpu in CPUS:
        say(f"building for {cpu} in {folder / cpu}")
        figures[cpu] = count(build(folder / cpu, cpu))
    if as_json:
        json.dump(figures, out, indent=1)
        print(file=out)
        return
    for cpu, rows in figures.items():
        for subject, row in rows.items():
            print(line_of(cpu, subject, row), file=out)
