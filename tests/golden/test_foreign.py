#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_foreign.py - on another kind of processor the same frames give the same set-points, bit for bit: 32 bits, big-endian, ARM.

usage: test_foreign.py --arch arm64|armhf|s390x --build-dir DIR [--unity DIR] [--slow]

The program and some unit tests are built by Debian's cross compiler and run by qemu's user mode: the traces and tests that say most for their time,
with --slow all. What that takes is skipped by name where it cannot be had; tools/test installs it.
"""
import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap
import test_golden

TOP = Path(__file__).resolve().parents[2]
# Debian's name: (triplet, qemu's name, what it stands for)
KINDS = {"arm64": ("aarch64-linux-gnu", "aarch64", "64 bits, little-endian"), "armhf": ("arm-linux-gnueabihf", "arm", "32 bits, little-endian"),
         "s390x": ("s390x-linux-gnu", "s390x", "64 bits, big-endian")}
TESTS = ("fx", "kin", "number", "counts")
SLOW_TESTS = ("intensity", "halt", "ramp")  # minutes on an emulated processor; the traces go through the same code
TEST_LIMIT_S = 1500


class Foreign:
    def __init__(self, arch, build):
        self.arch, self.build = arch, build
        self.triplet, self.cpu, _ = KINDS[arch]
        self.emulator = shutil.which(f"qemu-{self.cpu}") or shutil.which(f"qemu-{self.cpu}-static")

    def command(self, program):
        return [self.emulator, "-L", f"/usr/{self.triplet}", self.build / program]

    def find_tools(self):
        """The root with the libraries."""
        missing = [name for name, found in ((f"{self.triplet}-gcc", shutil.which(f"{self.triplet}-gcc")), ("qemu-user", self.emulator),
                                            (f"libc6-dev-{self.arch}-cross", Path(f"/usr/{self.triplet}/include/stdio.h").exists())) if not found]
        if missing:
            raise tap.Skip(f"not installed: {', '.join(missing)}")
        run = subprocess.run([TOP / "tools/lib/foreign.sh", self.arch], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        if run.returncode != 0:
            raise tap.Skip(run.stderr.strip().splitlines()[-1] if run.stderr.strip() else "tools/lib/foreign.sh failed")
        return Path(run.stdout.strip())

    def make(self, root, unity, tests):
        """Where Unity is not told, the build looks for it."""
        libraries = root / "usr/lib" / self.triplet
        environment = {**os.environ, "PKG_CONFIG_LIBDIR": str(libraries / "pkgconfig"), "PKG_CONFIG_SYSROOT_DIR": str(root)}
        for command in (["cmake", "-G", "Ninja", "-S", TOP, "-B", self.build, "-DCMAKE_SYSTEM_NAME=Linux", f"-DCMAKE_SYSTEM_PROCESSOR={self.cpu}",
                         f"-DCMAKE_C_COMPILER={self.triplet}-gcc", f"-DCMAKE_EXE_LINKER_FLAGS=-Wl,-rpath,{libraries}", "-DHEAVE_TESTS=ON",
                         "-DHEAVE_WERROR=ON", *([f"-DUNITY_DIR={unity}"] if unity else [])],
                        ["cmake", "--build", self.build, "--parallel", "--target", "heaved", *(f"test_{name}" for name in tests)]):
            run = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
            assert run.returncode == 0, run.stdout[-3000:]

    def run_unit_test(self, name):
        run = subprocess.run(self.command(f"tests/unit/test_{name}"), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                             timeout=TEST_LIMIT_S)
        failed = [line for line in run.stdout.splitlines() if ":FAIL" in line]
        assert run.returncode == 0 and not failed and " 0 Failures" in run.stdout, "\n".join(failed) or run.stdout[-1000:]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--arch", choices=KINDS, required=True)
    parser.add_argument("--build-dir", type=Path, required=True)
    parser.add_argument("--unity", metavar="DIR")
    parser.add_argument("--slow", action="store_true", help="all traces, and the slow unit tests too")
    arguments = parser.parse_args()
    tests = TESTS + (SLOW_TESTS if arguments.slow else ())
    suite, foreign, is_built = tap.Suite(), Foreign(arguments.arch, arguments.build_dir), False
    with suite.case(f"{arguments.arch} ({KINDS[arguments.arch][2]}) builds without a warning"):
        foreign.make(foreign.find_tools(), arguments.unity, tests)
        is_built = True
    if is_built:
        with tempfile.TemporaryDirectory() as folder:
            test_golden.run_topics(suite, f", {arguments.arch}", foreign.command("bin/heaved"), Path(folder) / "trace.csv",
                                   only=None if arguments.slow else test_golden.TELLING)
        for name in tests:
            with suite.case(f"unit.{name}, {arguments.arch}"):
                foreign.run_unit_test(name)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
