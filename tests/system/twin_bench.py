# SPDX-License-Identifier: MIT
"""twin_bench.py - a platform whose drives, or GPIO lines, are heave-twin's, as its users run it.

    with TwinBench(bin_dir, interface="vcan0") as bench:
        bench.start_twin("--fault", "+1 reboot 3")
        daemon = bench.start()
        bench.do("jam 3")                  now
        bench.twin_status()                where the drives really are
"""
import re
import signal
import subprocess
import time

import harness
import tap

COUNTS_PER_MM = 1000
OFF_S = 5.5  # the longest quick stop, and what it takes to be told and seen
TORQUE = ("torque", "homing", "operation enabled", "quick stop", "fault reaction")
DRIVES = """
[drives]
driver = cia402

[can]
interface = {interface}
bitrate_bps = 1000000

[cia402]
nodes = {nodes}
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
""", "bits": """
command_id = 0x201
reply_id = 0x281
setpoint = A0 00 00 00 {position:i21be@0.4} {counter:u4@3.4} {crc8:2F/FF}
enable = B1 00 {counter:u4@1.4} {crc8:2F/FF}
disable = B2 {crc8:2F/FF}
stop = B3 {crc8:2F/FF}
reset = B4 {crc8:2F/FF}
position_reply = {position:f32be/1000} 00 00 00 {status:u3@4.1} {fault:u5le@4.4} {counter:u10le@5.3}
enabled_when = 0x01/0x01
fault_when = 0x02/0x02
""", "shared": """
command_id = 0x601
setpoint_id = 0x201
reply_id = 0x281, 0x281, 0x282, 0x282, 0x283, 0x283, 0x284
setpoint = {position.1:i24le} {position.2:i24le} {counter:u8} {crc8:1D}
enable = B1
disable = B2
stop = B3
reset = B4
position_reply = {position.1:i24le} {position.2:i24le} 00 {status.1:u4@6.0} {status.2:u4@6.4} {counter:u8}
enabled_when = 0x01/0x01
fault_when = 0x02/0x02
""", "apart": """
command_id = 0x601
reply_id = 0x281
status_id = 0x701, 0x701, 0x702, 0x702, 0x703, 0x703, 0x704
startup1 = 2F 10 {counter:u8} {xor} -> 60 10 .. {xor} wait 50
startup2 = 2F 11 01
startup3 = 2F 12 -> 60 12
setpoint = 10 {position:i32le}
enable = B1
disable = B2
stop = B3
reset = B4
position_reply = {position:i32le} {torque:i16le} {counter:u8} {xor}
status_reply = {status.1:u8} {fault.1:u16le} {status.2:u8} {fault.2:u16le} {counter:u8} {sum}
status_every = 5
enabled_when = 0x01/0x01
fault_when = 0x02/0x02
"""}
FRAMES["selfish"] = "".join(line for line in FRAMES["rich"].splitlines(keepends=True) if not line.startswith("enable ="))  # set-points give torque
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


def in_a_hurry(text, rises_fast=True):
    """The configuration with half of the cycles, and a rise as fast as other motion: what these tests judge depends on neither, and is mostly what they compute."""
    text, count = re.subn(r"^cycle_us = [12]000\b", "cycle_us = 2000", text, flags=re.MULTILINE)
    assert count == 1, text
    if rises_fast:
        fast = re.search(r"\[cylinders\][^\[]*?^(speed_mm_s = [\d.]+).*?^(accel_mm_s2 = [\d.]+)", text, re.MULTILINE | re.DOTALL)
        text, count = re.subn(r"(\[engage\]\n)speed_mm_s = [\d.]+(.*\n)accel_mm_s2 = [\d.]+", rf"\1{fast[1]}\2{fast[2]}", text)
        assert count == 1, text
    return text


class WithTwin(harness.Bench):
    """Any platform, with a heave-twin beside it."""

    def __init__(self, bin_dir, *arguments, **changes):
        super().__init__(bin_dir, *arguments, **changes)
        self.twin = None
        self.twin_socket = self.folder / "twin.sock"
        self.twin_log = self.folder / "twin.log"

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
        if -code in harness.CRASHES:
            raise tap.Fault(f"heave-twin has crashed, exit code {code}: {self.twin_log.read_text(errors='replace')}")
        return code

    def do(self, line):
        run = self.run_twin("--socket", self.twin_socket, *line.split())
        assert run.returncode == 0, run.stderr

    def twin_status(self):
        with harness.Line(self.twin_socket) as line:
            return line.ask("status")

    def await_no_torque(self, but=()):
        """After a fault, seen at the drives: none of them has torque, at most OFF_S after the call. heaved says the same."""
        begin = time.monotonic()
        harness.wait_for(lambda: not self.with_torque(but), "the drives lose their torque")
        took_s = time.monotonic() - begin
        assert took_s <= OFF_S, f"after {took_s:.2f} s"
        harness.wait_for(lambda: not any(leg["torque"] for leg in self.status()["cylinders"] if leg["number"] not in but and leg["drive"] != "offline"), "heaved tells so")
        assert not self.with_torque(but), "it has come back"

    def with_torque(self, but=()):
        return [drive["drive"] for drive in self.twin_status()["drives"] if drive["state"] in TORQUE and drive["drive"] not in but]


class TwinBench(WithTwin):
    def __init__(self, bin_dir, interface=None, period_us=4000, more="", frames=None, nodes="1, 2, 3, 4, 5, 6, 7", rises_fast=True, **changes):
        super().__init__(bin_dir, **changes)
        self.interface = interface or f"twin{self.port}"  # a bus between programs, of this test alone
        text = self.config.read_text(encoding="utf-8")
        self.has_own_frames = frames is not None
        more = FRAMES[frames] if frames else more
        section = (OWN_FRAMES if frames else DRIVES).format(interface=self.interface, counts=COUNTS_PER_MM, period_us=period_us, nodes=nodes).strip() + "\n" + more.strip() + "\n"
        text, count = re.subn(r"\[drives\].*?(?=\n\[relays\])", section, text, flags=re.DOTALL)
        assert count == 1
        self.config.write_text(in_a_hurry(text, rises_fast), encoding="utf-8")


def ends_after_a_fault(bench):
    """The torque is off in the end, whenever heaved is told to end after a fault: in motion, while the drives stop, later; and at a second signal without a fault."""
    for pause_s, is_at_once in ((0, False), (0.1, False), (1, False), (0, True)):
        bench.start_twin()
        daemon = bench.start()
        bench.wait_state("ENGAGED")
        with bench.sender() as sender:
            sender.send("@A6T:0,0,0,0,0,40,1500#")
            time.sleep(0.6)
            if not is_at_once:
                bench.do("fault 2 0x17")
                bench.wait_state("FAULT")
            time.sleep(pause_s)
            daemon.terminate()
            if is_at_once:
                time.sleep(0.02)
            code = bench.stop(daemon)
        log = daemon.log.read_text(encoding="utf-8")
        assert (code, "confirmed" in log, bench.with_torque()) == (1 if is_at_once else 0, False, []), (pause_s, code, bench.twin_status()["drives"], log)
        assert bench.end_twin() == 0
