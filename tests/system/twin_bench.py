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

# Drives with frames of their own: one that tells a position and whether it is homed, and one with torque, status, fault code, counter and check byte.
FRAMES = {"plain": """
command_id = 0x601
reply_id = 0x581
setpoint = 01 05 {position:i32le} {speed:u16le}
speed_counts = 2000
home = 01 03 01 00 00 00 00 00
position_query = 00 15
position_reply = .. .. {position:i32le}
homing_query = 00 12
homing_reply = .. .. {status:u8}
homing_done_when = 0x01/0xFF
""", "rich": """
id_bits = 29
command_id = 0x18FF0100
reply_id = 0x18FF0200
setpoint = 10 {position:i32be} {counter:u8} {crc8:1D}
enable = 20 {counter:u8} {crc8:1D}
disable = 21 {counter:u8} {crc8:1D}
stop = 22 {counter:u8} {crc8:1D}
reset = 23 {counter:u8} {crc8:1D}
position_reply = {status:u8} {position:i32be} {fault:u8} {counter:u8} {crc8:1D}
enabled_when = 0x01/0x01
fault_when = 0x02/0x02
"""}
OWN_FRAMES = """
[drives]
driver = can-raw

[can]
interface = {interface}
bitrate_bps = 1000000

[can-raw]
counts_per_mm = {counts}
angle_counts_per_deg = {counts}
period_us = {period_us}
offline_periods = 20
following_error_mm = 10
angle_following_error_deg = 10
"""


class TwinBench(harness.Bench):
    def __init__(self, bin_dir, interface=None, period_us=4000, more="", frames=None, **changes):
        super().__init__(bin_dir, **changes)
        self.interface = interface or f"twin{self.port}"  # a bus between programs, of this test alone
        self.twin = None
        self.twin_socket = self.folder / "twin.sock"
        self.twin_log = self.folder / "twin.log"
        text = self.config.read_text(encoding="utf-8")
        more = FRAMES[frames] if frames else more
        section = (OWN_FRAMES if frames else DRIVES).format(interface=self.interface, counts=COUNTS_PER_MM, period_us=period_us).strip() + "\n" + more.strip() + "\n"
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
