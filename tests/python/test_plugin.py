#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_plugin.py --bin DIR - the fixtures for pytest, on the Python of tools/lib/venv.sh: what passes, what fails and what it says then."""
import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import kernel
import tap

from heave.configuration import changed

TOP = Path(__file__).resolve().parents[2]
LIMIT_S = 300


class Bench:
    def __init__(self, folder, bin_dir):
        self.folder, self.bin, self.python = folder, bin_dir, kernel.find("venv.sh")

    def pytest(self, text, *arguments, ini="", **environment):
        (self.folder / "test_it.py").write_text(text, encoding="utf-8")
        (self.folder / "pytest.ini").write_text(f"[pytest]\n{ini}", encoding="utf-8")
        settings = {**os.environ, "HEAVE_BIN": self.bin, "PYTHONPATH": str(TOP / "python"), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", **environment}
        run = subprocess.run([self.python, "-m", "pytest", "-p", "heave.pytest_plugin", "-p", "no:cacheprovider", "--strict-markers", "-q", *arguments], cwd=self.folder, env=settings,
                             stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=LIMIT_S, check=False)
        return run.returncode, run.stdout

    def expect(self, result, status, *words):
        code, said = result
        assert code == status and all(word in said for word in words), f"exit status {code}, not {status}, or not {words}:\n{said}"


def a_platform_and_a_sender(bench):
    text = """
def test_moves(heaved, platform, sender):
    platform.wait_for("ENGAGED", timeout=60)
    sender.a6(z=5, time_ms=300)
    platform.wait_for_pose(z_mm=5, timeout=60)
    assert heaved.platform is platform

def test_has_its_own(platform):
    assert platform.status()["counters"]["datagrams"] == 0
"""
    bench.expect(bench.pytest(text), 0, "2 passed")


def the_configuration_that_is_meant(bench):
    text = (TOP / "config/demo-hexapod.ini").read_text(encoding="utf-8")
    for name, percent in (("one.ini", 81), ("two.ini", 82), ("three.ini", 83)):
        (bench.folder / name).write_text(text.replace("[udp]", f"[intensity]\nmax_percent = {percent}\n\n[udp]", 1), encoding="utf-8")
    test = "def test_it(platform):\n    assert platform.status()['intensity']['max_percent'] == {}\n"
    bench.expect(bench.pytest(test.format(81), ini="heave_config = one.ini\n"), 0, "1 passed")
    bench.expect(bench.pytest(test.format(82), "--heave-config", "two.ini", ini="heave_config = one.ini\n"), 0, "1 passed")
    marked = "import pytest\n@pytest.mark.heave('three.ini', changes={'intensity.start_percent': 50})\n" + test.format(83) + "    assert platform.status()['intensity']['percent'] == 50\n"
    bench.expect(bench.pytest(marked, "--heave-config", "two.ini"), 0, "1 passed")
    bench.expect(bench.pytest(test.format(1), "--heave-config", "none.ini"), 1, "none.ini", "there is no such configuration")


def a_failure_shows_the_log(bench):
    bench.expect(bench.pytest("def test_it(platform):\n    platform.wait_for('ENGAGED', timeout=60)\n    assert False\n"), 1, "log of heaved", "NEUTRAL -> ENGAGED")


def a_heaved_that_is_not_there_is_said(bench):
    bench.expect(bench.pytest("def test_it(heaved): pass\n", HEAVE_BIN="/nowhere"), 1, "/nowhere/heaved", "HEAVE_BIN")
    bench.expect(bench.pytest("def test_it(heaved): pass\n", "--heave-bin", bench.bin, HEAVE_BIN="/nowhere"), 0, "1 passed")


def a_twin_where_there_is_one(bench):
    (bench.folder / "bin").mkdir()
    (bench.folder / "bin/heaved").symlink_to(Path(bench.bin) / "heaved")
    text = (TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8")
    (bench.folder / "twin.ini").write_text(changed(text, {"can.interface": f"twin{os.getpid() % 1000000}"}), encoding="utf-8")
    arguments = ("--heave-bin", str(bench.folder / "bin"), "--heave-config", "twin.ini", "-rs")
    test = "def test_it(twin, platform):\n    assert len(twin.positions) == 6 and platform.status()['state'] == 'OFF'\n"
    bench.expect(bench.pytest(test, *arguments), 0, "1 skipped", "heave-twin")
    twin = bench.folder / "bin/heave-twin"
    twin.symlink_to(Path(bench.bin) / "heave-twin")
    bench.expect(bench.pytest(test, *arguments), 0, "1 passed")
    changes = {"can.interface": f"twin{os.getpid() % 1000000}", "pose.settled_extension_mm": 8}
    marked = f"import pytest\n\n\n@pytest.mark.heave({str(TOP / 'config/hexapod-cia402.ini')!r}, changes={changes})\n"
    bench.expect(bench.pytest(marked + test.replace("== 'OFF'", "== 'OFF' and abs(twin.positions[0] - 8) < 0.5"), *arguments), 0, "1 passed")
    bench.expect(bench.pytest("def test_it(twin):\n    twin.process.kill()\n    twin.process.wait()\n", *arguments), 1, "heave-twin ended with exit code -9")
    twin.unlink()
    twin.write_text("#!/bin/sh\necho 'no such interface'\nexit 5\n", encoding="ascii")
    twin.chmod(0o755)
    bench.expect(bench.pytest(test, *arguments), 1, "exit code 5", "no such interface")


def a_lab(bench):
    test = """
def test_it(lab):
    done = lab.run(["sh", "-c", "ip -br link show vcan0; exit 7"])
    assert done.returncode == 7 and "UP" in done.output, done
"""
    with tempfile.TemporaryDirectory() as empty:
        bench.expect(bench.pytest(test, XDG_CACHE_HOME=empty), 1, "heave-lab build")
    try:
        kernel.lab.find_kernel()
    except kernel.lab.LabError as reason:
        raise tap.Skip(reason) from reason
    bench.expect(bench.pytest(test), 0, "1 passed")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options = parser.parse_args()
    suite = tap.Suite()
    for case in (a_platform_and_a_sender, the_configuration_that_is_meant, a_failure_shows_the_log, a_heaved_that_is_not_there_is_said, a_twin_where_there_is_one, a_lab):
        with suite.case(case.__name__.replace("_", " ")), tempfile.TemporaryDirectory(prefix="heave-plugin-") as folder:
            case(Bench(Path(folder), str(Path(options.bin).resolve())))
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
