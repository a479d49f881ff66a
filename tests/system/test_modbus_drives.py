#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_modbus_drives.py BIN - the daemon on six drives on Modbus TCP, whose registers are pymodbus servers.

Runs itself again with the Python of tools/lib/venv.sh, which has pymodbus. What is judged is what the servers received; nothing
depends on how fast the machine is: the line is measured by the daemon itself, and a slow one makes the motion slower."""
import contextlib
import math
import re
import sys
import threading
import time
from pathlib import Path

import harness
import tap

sys.path.insert(0, str(harness.TOP / "tests/peers"))
PRESET = harness.TOP / "config/modbus-tcp-hexapod.ini"
UNIT, HOLDING = 1, 3
# registers of the preset, moved to where the servers have some
STATUS, POSITION, ALARM, TARGET, CONTROL, WATCHDOG = 1, 2, 4, 10, 20, 30
PLACES = {"0x0200": f"0x{TARGET:04X}", "0x0100": f"0x{STATUS:04X}", "0x0210": f"0x{CONTROL:04X}", "0x0300": f"0x{WATCHDOG:04X}"}
ENABLE, DISABLE, STOP = 1, 0, 2
COUNTS_PER_MM = 100
STROKE_MM = 300
STEP_MM, SPEED_MM_S = 5.0, 300
ANSWER_S = 0.01
FEEDBACK_MS, RIDE_SETPOINTS = 9500, 20
START_MM = [60, 70, 80, 80, 70, 60]


def signed32(high, low):
    value = high << 16 | low
    return value - (1 << 32) if value >> 31 else value


class Drive:
    """One drive: obeys what its server is written, and says where it is."""

    def __init__(self, devices, start_mm):
        self.devices, self.seen, self.is_enabled = devices, 0, False
        self.position = start_mm * COUNTS_PER_MM
        self.commands, self.targets, self.events = [], [], []
        self.brake_s, self.off_s = 0, math.inf  # it has torque for so long after it was told not to; until when
        self.tell()

    def tell(self):
        high, low = (self.position & 0xFFFFFFFF) >> 16, self.position & 0xFFFF
        for address, value in ((POSITION, high), (POSITION + 1, low), (STATUS, 1 if self.is_enabled else 0)):
            self.devices.set(UNIT, HOLDING, address, value)

    def control(self, command, at_s):
        self.commands.append(command)
        if command in (DISABLE, STOP):
            self.off_s = min(self.off_s, at_s + self.brake_s)
        elif command == ENABLE:
            self.is_enabled, self.off_s = True, math.inf

    def obey(self):
        fresh = self.devices.written_since(self.seen)
        self.seen += len(fresh)
        for at_s, _, address, values in fresh:
            if address == TARGET:
                target = signed32(values[0], values[1])
                self.targets.append((at_s, self.is_enabled, self.position, target))
                if self.is_enabled:
                    self.position = target
            elif address == CONTROL:
                self.control(values[0], at_s)
            self.events.append(address)
        is_off = self.is_enabled and time.monotonic() >= self.off_s
        self.is_enabled &= not is_off
        if fresh or is_off:
            self.tell()


class Platform(contextlib.ExitStack):
    """Six drives, each behind a line of its own that a test can cut, and what makes them move."""

    def __init__(self):
        from modbus_peer import Devices, FaultyLine
        super().__init__()
        self.devices = [self.enter_context(Devices("tcp", units=[UNIT])) for _ in START_MM]
        self.lines = [self.enter_context(FaultyLine(devices)) for devices in self.devices]
        self.pass_on()
        self.drives = [Drive(devices, start) for devices, start in zip(self.devices, START_MM)]
        self.is_ending = False
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()
        self.callback(self.end)

    def work(self):
        while not self.is_ending:
            for drive in self.drives:
                drive.obey()
            time.sleep(0.001)

    def pass_on(self):
        """Every line answers as soon as drives do: without that time, this machine is busy with nothing but questions."""
        for line in self.lines:
            line.delay_s = lambda number: ANSWER_S

    def end(self):
        self.is_ending = True
        self.thread.join(harness.WAIT_S)


class ModbusBench(harness.Bench):
    """The preset with the registers and addresses of these servers, and times for a busy machine."""

    def __init__(self, bin_dir, platform, **changes):
        super().__init__(bin_dir)
        hosts = ", ".join(f"127.0.0.1:{line.address[1]}" for line in platform.lines)
        changes = {"port": self.port, "hosts": hosts, "timeout_ms": 900, "feedback_timeout_ms": FEEDBACK_MS, **changes}
        text = PRESET.read_text(encoding="utf-8")
        for register, by in PLACES.items():
            text = text.replace(register, by)
        text = text.replace("engage = manual\n", "engage = manual\nlate_hold_cycles = 0\n")
        text = text.replace("[modbus]\n", "[modbus]\nretries = 8\n")
        text = text.replace("step_mm = 5\n", "step_mm = 5\nfeedback_timeout_ms = 3000\n")
        text = text.replace("following_error_mm = 20\n", "following_error_mm = 0\n").replace("margin_mm = 2\n", "margin_mm = 2\nfollowing_error_mm = 0\n")
        for key, value in changes.items():
            text, count = re.subn(rf"^{key} = [^;\n]*", f"{key} = {value} ", text, flags=re.MULTILINE)
            assert count == 1, key
        self.config = self.file("modbus.ini", f"{text}\n[control]\nsocket = {self.socket}\n")


def check_registers(platform):
    """What every drive has received: placed where it was before it got torque, steps that the line carries, never out of its stroke."""
    from modbus_peer import judged_whatever, steps
    for drive in platform.drives:
        with judged_whatever():
            _, is_enabled, position, target = drive.targets[0]
            assert not is_enabled and position == target, "its target was not set to where it was before it got torque"
            assert WATCHDOG in drive.events and drive.events.index(WATCHDOG) < drive.events.index(TARGET)
            assert sum(is_enabled for _, is_enabled, *_ in drive.targets) > RIDE_SETPOINTS, f"{len(drive.targets)} set-points"
            assert all(0 <= target <= STROKE_MM * COUNTS_PER_MM for *_, target in drive.targets), drive.targets
            taken = steps([(at_s, target) for at_s, *_, target in drive.targets])
            for (_, is_enabled, *_), (step, within_s) in zip(drive.targets[1:], taken):
                most_mm = 3 * STEP_MM + SPEED_MM_S * within_s
                assert not is_enabled or step <= most_mm * COUNTS_PER_MM, f"a step of {step / COUNTS_PER_MM} mm in {within_s:.3f} s"


def engage(bench):
    harness.wait_for(lambda: all(leg["drive"] == "disabled" for leg in bench.status()["cylinders"]), "the drives are started up")
    assert bench.ctl("engage").returncode == 0
    return bench.wait_state("ENGAGED", "FAULT")


def ride(bench, platform, seconds):
    """At least as long as that, and until each drive has heard some set-points."""
    wanted = [len(drive.targets) + RIDE_SETPOINTS for drive in platform.drives]

    def is_enough():
        sender.stream(seconds, lambda t: f"@A6:{4 * math.sin(3 * t):.3f},{3 * math.sin(2 * t):.3f},0,0,0,{100 + 20 * math.sin(2 * t):.3f}#")
        status = bench.status()
        assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"
        return all(len(drive.targets) >= count for drive, count in zip(platform.drives, wanted))

    with bench.sender() as sender:
        harness.wait_for(is_enough, f"{RIDE_SETPOINTS} set-points of each drive")


def check_ride(bin_dir):
    with Platform() as platform, ModbusBench(bin_dir, platform) as bench:
        daemon = bench.start()
        assert engage(bench)["state"] == "ENGAGED", bench.status()["fault"]
        ride(bench, platform, 2)
        status = bench.status()
        assert status["state"] == "ENGAGED", status["fault"]
        for leg in status["cylinders"]:
            assert leg["period_ms"] > 0, leg
            assert leg["setpoint_age_ms"] < FEEDBACK_MS and leg["feedback_age_ms"] < FEEDBACK_MS, leg
        assert re.search(r"[0-9.]+ Hz, newest set-point \d+ ms ago, feedback \d+ ms ago", bench.ctl("status").stdout)
        assert bench.ctl("park").returncode == 0
        bench.wait_state("OFF", "SETTLED")
        assert bench.stop(daemon) == 0
        assert not any(drive.is_enabled for drive in platform.drives), "heaved has ended, and there is torque"
        check_registers(platform)


def settle(bench):
    daemon = bench.start()
    harness.wait_for(lambda: all(leg["drive"] == "disabled" for leg in bench.status()["cylinders"]), "the drives are started up")
    assert bench.ctl("park").returncode == 0
    status = bench.wait_state("SETTLED", "FAULT")
    assert status["state"] == "SETTLED", f"{status['fault']} {status['cylinders']}"
    return daemon


def check_end(bin_dir):
    """A drive that closes its brake first, one whose line loses what it is told, one that keeps its torque whatever it is told."""
    from modbus_peer import Fault
    with Platform() as platform, ModbusBench(bin_dir, platform, timeout_ms=300) as bench:
        daemon = settle(bench)
        platform.drives[2].brake_s = 0.4
        lossy = platform.lines[4]
        lossy.plan = {lossy.asked + number: Fault.LOST for number in (1, 2, 3)}
        assert bench.stop(daemon) == 0, daemon.log.read_text(encoding="utf-8")
        assert not any(drive.is_enabled for drive in platform.drives), "heaved has ended, and there is torque"
        daemon = settle(bench)
        platform.drives[2].brake_s = math.inf
        assert bench.stop(daemon) == 1
        assert "not confirmed that the torque is off: axis 3\n" in daemon.log.read_text(encoding="utf-8"), daemon.log.read_text(encoding="utf-8")
        assert [drive.is_enabled for drive in platform.drives] == [False, False, True, False, False, False]


def check_silent(bin_dir):
    with Platform() as platform, ModbusBench(bin_dir, platform) as bench:
        daemon = bench.start()
        status = engage(bench)
        assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"
        ride(bench, platform, 0.5)
        platform.lines[2].delay_s = lambda number: 5.0  # a device that is far too late
        harness.wait_for(lambda: bench.status()["state"] == "FAULT", "FAULT")
        status = bench.status()
        assert status["fault"]["name"] == "drive-offline" and status["fault"]["axis"] == 3, status["fault"]
        harness.wait_for(lambda: all(STOP in drive.commands for k, drive in enumerate(platform.drives) if k != 2), "every other drive is told to stop")
        for k, drive in enumerate(platform.drives):
            assert k == 2 or not drive.is_enabled
        assert status["cylinders"][2]["report"]["phase"] == "waiting for the line"
        platform.pass_on()
        harness.wait_for(lambda: bench.status()["cylinders"][2]["drive"] == "disabled", "the drive is back, without torque")
        assert bench.status()["state"] == "FAULT"  # nothing clears itself
        bench.reset()
        status = engage(bench)
        assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"
        assert bench.stop(daemon) == 0
        check_registers(platform)


def check_refusal(bin_dir):
    with Platform() as platform, ModbusBench(bin_dir, platform) as bench:
        text = bench.config.read_text(encoding="utf-8").replace(f"0x{WATCHDOG:04X} = 100", f"0x{WATCHDOG:04X} is 77")
        bench.config.write_text(text, encoding="utf-8")
        daemon = bench.start()
        leg = harness.wait_for(lambda: (lambda leg: leg if leg["report"]["phase"] == "refused" else None)(bench.status()["cylinders"][0]), "refused")
        assert leg["drive"] == "offline" and leg["report"]["register"] == WATCHDOG and leg["report"]["unit"] == UNIT, leg
        assert f"unit {UNIT}: refused, register 0x{WATCHDOG:04X}; a register holds another value" in bench.ctl("status").stdout
        assert all(not drive.targets for drive in platform.drives)
        assert bench.stop(daemon) == 0
        said = f"axis 1, unit {UNIT}, refused: a register holds another value (0x10005), register 0x{WATCHDOG:04X}"
        assert said in daemon.log.read_text(encoding="utf-8"), daemon.log.read_text(encoding="utf-8")


def main():
    bin_dir = Path(sys.argv[1])
    only = sys.argv[sys.argv.index("--only") + 1] if "--only" in sys.argv else ""
    suite = tap.Suite()
    cases = [
        ("six drives on TCP ride within what the line carries, and end without torque", check_ride),
        ("ends when each drive has confirmed that its torque is off; with 1 and its name where one does not", check_end),
        ("one drive too late: all are told to stop, the cycle goes on, only a reset leads back", check_silent),
        ("a register that does not hold what it has to: the drive is refused by name", check_refusal),
    ]
    for name, check in cases:
        if only in name:
            with suite.case(name):
                check(bin_dir)
    return suite.done()


if __name__ == "__main__":
    tap.needs_package("pymodbus")
    sys.exit(main())
