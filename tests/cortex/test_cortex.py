#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_cortex.py - the core as firmware for microcontrollers without an FPU: it builds freestanding, gives the same set-points bit for bit in
an emulator, and takes as much memory as is said here.

usage: test_cortex.py --table PROGRAM --build-dir DIR [--all]

Two processors: Cortex-M3, and Cortex-M0+, which has neither long multiplication nor division nor unaligned words (its code runs on the emulated
M3, where unaligned words and divisions by zero are made to trap). Of the traces those are played that say most for their time, with --all every
one: 7 s of work each on the M3, 25 on the M0+.
"""
import argparse
import concurrent.futures
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tests/golden"))
import stack_bound  # noqa: E402
import tap  # noqa: E402
import test_golden  # noqa: E402  the path above has to be set first

TOOLS = {"arm-none-eabi-gcc": "gcc-arm-none-eabi", "qemu-system-arm": "qemu-system-arm"}
RUN_LIMIT_S = 300
START = ("core", "CMakeFiles/heave_start.dir")
# Processor: topics it plays, and what must not be exceeded, in bytes: what it takes, and some 5 % for the next change and another gcc. What is aimed at: docs/firmware.md.
KINDS = {
    "cortex-m3": (test_golden.TELLING, {"flash": 145 * 1024, "ram": 30 * 1024, "stack": 2560}),
    "cortex-m0plus": (("mode-changes",), {"flash": 156 * 1024, "ram": 30 * 1024, "stack": 2816}),
}


def output_of(command):
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(map(str, command))}\n{run.stdout[-3000:]}"
    return run.stdout


class Firmware:
    def __init__(self, cpu, build, table):
        self.cpu, self.build, self.table = cpu, build / cpu, table

    def make(self):
        missing = [package for program, package in TOOLS.items() if not shutil.which(program)]
        if missing:
            raise tap.Skip(f"not installed: {', '.join(missing)}")
        # No ccache: it does not keep the .ci files.
        output_of(["cmake", "-G", "Ninja", "-S", TOP / "tests/cortex/firmware", "-B", self.build, "--toolchain",
                   TOP / "hal/template/cortex-m.cmake", f"-DHEAVE_CPU={self.cpu}", "-DHEAVE_WERROR=ON", "-DCMAKE_C_COMPILER_LAUNCHER="])
        output_of(["cmake", "--build", self.build])

    def sizes(self):
        """Bytes of hal/template's program: flash, variables of one platform, stack."""
        flash, data, bss = map(int, output_of(["arm-none-eabi-size", self.build / "heave_template"]).splitlines()[1].split()[:3])
        return {"flash": flash + data, "ram": data + bss, "stack": self.stack("heave_template")[0]}

    def stack(self, program):
        """Bound of the stack, and the way there."""
        folders = (*START, "sim", f"CMakeFiles/{program}.dir")
        return stack_bound.Program(TOP, self.build, folders, self.build / program).deepest("start_reset")

    def play(self, frames, folder):
        """Lines for the comparison, and the bytes of stack that were in use."""
        table, trace = folder / f"{frames.stem}.table", folder / f"{frames.stem}.csv"
        output_of([self.table, test_golden.config_of(frames), frames, table])
        run = subprocess.run(["qemu-system-arm", "-M", "mps2-an385", "-display", "none", "-monitor", "none", "-serial", "none",
                              "-kernel", self.build / "heave_play", "-semihosting-config",
                              f"enable=on,target=native,arg=heave_play,arg={table},arg={trace}"],
                             stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, timeout=RUN_LIMIT_S)
        assert run.returncode == 0, f"the firmware ended with {run.returncode}: {run.stdout}"
        return test_golden.digest(trace), int(re.search(r"^stack (\d+)$", run.stdout, re.MULTILINE)[1])


def run_sizes(suite, firmware, limits):
    with suite.case(f"{firmware.cpu}: flash, variables and stack of hal/template are within their limits"):
        sizes = firmware.sizes()
        print(f"# {firmware.cpu}: flash {sizes['flash'] / 1024:.1f} KiB, RAM {sizes['ram'] / 1024:.1f} KiB, stack at most {sizes['stack'] / 1024:.1f} KiB")
        for name, limit in limits.items():
            assert sizes[name] <= limit, f"{name}: {sizes[name]} bytes, more than {limit}; the stack's longest way: {firmware.stack('heave_template')[1]}"


def run_traces(suite, firmware, topics):
    used = 0
    with tempfile.TemporaryDirectory() as name, concurrent.futures.ThreadPoolExecutor(2) as pool:
        runs = {frames: pool.submit(firmware.play, frames, Path(name)) for frames in test_golden.topics(topics)}
        for frames, run in runs.items():
            with suite.case(f"{frames.stem}, {firmware.cpu}: the trace is the expected one"):
                got, stack = run.result()
                used = max(used, stack)
                test_golden.compare(frames, got)
    with suite.case(f"{firmware.cpu}: no trace took more stack than is possible"):
        bound, _ = firmware.stack("heave_play")
        print(f"# {firmware.cpu}: {used} bytes of stack were in use, {bound} are possible")
        assert 0 < used <= bound, f"{used} bytes of stack were in use, {bound} are said to be possible"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--table", required=True, help="the program that writes a configuration and frames as a table")
    parser.add_argument("--build-dir", type=Path, required=True)
    parser.add_argument("--all", action="store_true", help="every trace on both processors")
    arguments = parser.parse_args()
    suite = tap.Suite()
    for cpu, (topics, limits) in KINDS.items():
        firmware, is_built = Firmware(cpu, arguments.build_dir, arguments.table), False
        with suite.case(f"{cpu}: the core, hal/template and the player build freestanding without a warning"):
            firmware.make()
            is_built = True
        if is_built:
            run_sizes(suite, firmware, limits)
            run_traces(suite, firmware, None if arguments.all else topics)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
