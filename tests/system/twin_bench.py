# SPDX-License-Identifier: MIT
"""twin_bench.py - a platform whose drives are heave-twin's, as its users run it.

    with TwinBench(bin_dir, interface="vcan0") as bench:
        bench.start_twin("--fault", "+1 reboot 3")
        daemon = bench.start()
        bench.do("jam 3")                  now
        bench.twin_status()                where the drives really are
"""
import json
import re
import signal
import subprocess

import harness

COUNTS_PER_MM = 1000
DRIVES = """
[drives]
driver = cia402

[can]
interface = {interface}
bitrate_bps = 1000000

[cia402]
nodes = 1, 2, 3, 4, 5, 6, 7
counts_per_mm = {counts}
angle_counts_per_deg = {counts}
period_us = {period_us}
"""


class TwinBench(harness.Bench):
    def __init__(self, bin_dir, interface=None, period_us=4000, more="", **changes):
        super().__init__(bin_dir, **changes)
        self.interface = interface or f"twin{self.port}"  # a bus between programs, of this test alone
        self.twin = None
        self.twin_socket = self.folder / "twin.sock"
        self.twin_log = self.folder / "twin.log"
        text = self.config.read_text(encoding="utf-8")
        section = DRIVES.format(interface=self.interface, counts=COUNTS_PER_MM, period_us=period_us).strip() + more + "\n"
        text, count = re.subn(r"\[drives\].*?(?=\n\[relays\])", section, text, flags=re.DOTALL)
        assert count == 1
        self.config.write_text(text, encoding="utf-8")

    def __exit__(self, *exception):
        self.end_twin()
        super().__exit__(*exception)

    def run_twin(self, *arguments):
        """Runs heave-twin to its end."""
        return subprocess.run([self.bin / "heave-twin", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60, check=False)

    def start_twin(self, *arguments):
        with open(self.twin_log, "w", encoding="utf-8") as log:
            self.twin = subprocess.Popen([self.bin / "heave-twin", "--config", self.config, "--socket", self.twin_socket, *map(str, arguments)], stdout=log, stderr=log)
        harness.wait_for(lambda: self.twin.poll() is not None or self.twin_socket.exists(), "heave-twin answers")
        assert self.twin.poll() is None, self.twin_log.read_text(encoding="utf-8")

    def end_twin(self):
        """Its exit code; None where it does not run."""
        if self.twin is None:
            return None
        self.twin.send_signal(signal.SIGTERM)
        code = self.twin.wait(timeout=harness.WAIT_S)
        self.twin = None
        return code

    def do(self, line):
        run = self.run_twin("--socket", self.twin_socket, *line.split())
        assert run.returncode == 0, run.stderr

    def twin_status(self):
        run = self.run_twin("--socket", self.twin_socket, "status")
        assert run.returncode == 0, run.stderr
        return json.loads(run.stdout)
