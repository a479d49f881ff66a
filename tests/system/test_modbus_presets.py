#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_modbus_presets.py BIN - the ready-made platforms of config/modbus: six drives on one serial line, whose registers are pymodbus servers.

With pymodbus, on virtual time. The drives keep the rules that their manuals give (the presets name the pages): what is asked of them in
the wrong order is an alarm. What is judged is what they received."""
import concurrent.futures
import contextlib
import math
import re
import signal
import sys
import threading
import time
from pathlib import Path

import harness
import tap

sys.path.insert(0, str(harness.TOP / "tests/peers"))
HOLDING = 3
START_MM = [60, 70, 80, 80, 70, 60]
UNITS = range(1, 7)
COUNTS_PER_MM = 100
STROKE_MM, SPEED_MM_S, STEP_MM = 300, 40, 6
WIRE_S = 0.006  # of a question and its answer on a serial line
RIDE_SETPOINTS = 10
LOOK_S = 0.004  # between two looks of the drives at what they were told
TELL_S = 0.02  # between two looks of a moving drive at its position


def signed32(high, low):
    value = high << 16 | low
    return value - (1 << 32) if value >> 31 else value


def halves(value):
    return (value >> 16) & 0xFFFF, value & 0xFFFF


class Drive:
    """What all have in common: a position that follows its target at the speed it was given."""

    def __init__(self, devices, unit, start_mm):
        self.devices, self.unit = devices, unit
        self.position = self.target = start_mm * COUNTS_PER_MM
        self.speed, self.alarm = 0, 0
        self.targets, self.commands, self.wrongs = [], [], []
        self.told, self.moved_s, self.heard_s = None, time.monotonic(), 0

    def hear(self, address, values):
        """A write that came in."""

    def registers(self):
        """[(address, values)] that it shows."""
        return []

    def go(self, target, speed):
        self.targets.append((self.heard_s, self.position, target))
        self.target, self.speed = target, speed

    def refuse(self, why):
        self.wrongs.append(why)
        self.alarm = 0x80

    def move(self):
        now_s = time.monotonic()
        way = int(self.speed * (now_s - self.moved_s))
        if way > 0:
            self.position += max(-way, min(way, self.target - self.position))
            self.moved_s = now_s
        shown = self.registers()
        if shown != self.told:
            for address, values in shown:
                self.devices.set(self.unit, HOLDING, address, *values)
            self.told = shown


class RoboCylinder(Drive):
    """IAI: moves when its target is written, and only with the servo on, the zero known and its line in charge; else an alarm."""
    HOLDING = [(0x0D00, 4), (0x9000, 16), (0x9900, 9)]
    SERVO, RESET, MODBUS, STOP = 0x1000, 0x0100, 0x0100, 0x0008
    CONSTANTS = {2: 0, 3: 10, 6: 30, 7: 0, 8: 0}

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.control, self.is_modbus = 0, False

    def hear(self, address, values):
        if address == 0x0D00:
            if self.control & self.RESET and not values[0] & self.RESET:
                self.alarm = 0
            self.control = values[0]
        elif address == 0x0D02:
            self.is_modbus = bool(values[0] & self.MODBUS)
            if values[0] & self.STOP:
                self.target = self.position
        elif address == 0x9900:
            speed = signed32(*values[4:6])
            if self.alarm:
                return  # nothing moves then
            if not self.is_modbus or not self.has_torque:
                self.refuse("a target without the servo")
            elif not 1 <= speed <= SPEED_MM_S * COUNTS_PER_MM * 9 // 8 + 1:
                self.refuse(f"speed {speed}")
            elif any(values[at] != value for at, value in self.CONSTANTS.items()) or len(values) != 9:
                self.refuse(f"{values}")
            else:
                self.go(signed32(*values[:2]), speed)
        if address != 0x9900:
            self.commands.append((address, values[0]))
        if not self.control & self.SERVO:
            self.target = self.position

    @property
    def is_stopped(self):
        return (0x0D02, self.MODBUS | self.STOP) in self.commands

    @property
    def has_torque(self):
        return bool(self.control & self.SERVO)

    def registers(self):
        status = 0x2010 | (0x1000 if self.has_torque else 0) | (0x0400 if self.alarm else 0)
        return [(0x9000, [*halves(self.position), self.alarm, 0, 0, status])]


class Az(Drive):
    """Oriental Motor: always holds; direct data operation while STOP is on, or without its trigger, is refused."""
    HOLDING = [(0x0058, 48), (0x00C0, 20)]
    STOP, RESET = 0x0020, 0x0080

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.inputs = 0

    def hear(self, address, values):
        if address == 0x007C:
            if values[1] & self.RESET and not self.inputs & self.RESET:
                self.alarm = 0
            self.inputs = values[1]
            self.commands.append((address, values[1]))
            if self.inputs & self.STOP:
                self.target = self.position
        elif address == 0x005A:
            kind, position, speed, *rest = (signed32(*values[at:at + 2]) for at in range(0, len(values), 2))
            if self.alarm:
                return
            if self.inputs & self.STOP:
                self.refuse("an operation while it cannot start")
            elif (kind, *rest) != (1, 300000, 300000, 1000, 1) or not 1 <= speed <= SPEED_MM_S * COUNTS_PER_MM * 9 // 8 + 1:
                self.refuse(f"{values}")
            else:
                self.go(position, speed)

    @property
    def is_stopped(self):
        return self.commands[-1][1] == self.STOP

    @property
    def has_torque(self):
        return not self.inputs & self.STOP

    def registers(self):
        return [(0x007C, [0, self.inputs, 0, 0, 0, self.alarm]), (0x00CC, halves(self.position))]


class Line(contextlib.ExitStack):
    """Six drives on one serial line, and what makes them move."""

    def __init__(self, kind):
        from modbus_peer import Devices, FaultyLine
        super().__init__()
        self.devices = self.enter_context(Devices("serial", units=list(UNITS), holding=kind.HOLDING))
        self.line = self.enter_context(FaultyLine(self.devices))
        self.line.delay_s = lambda number: WIRE_S
        self.drives = [kind(self.devices, unit, start) for unit, start in zip(UNITS, START_MM)]
        self.seen, self.rounds, self.is_ending = 0, 0, False
        for drive in self.drives:
            drive.move()
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()
        self.callback(self.end)

    def work(self):
        moved_s = 0
        while not self.is_ending:
            fresh = self.devices.written_since(self.seen)
            self.seen += len(fresh)
            for at_s, unit, address, values in fresh:
                self.drives[unit - 1].heard_s = at_s
                self.drives[unit - 1].hear(address, values)
            if fresh or time.monotonic() - moved_s > TELL_S:
                moved_s = time.monotonic()
                for drive in self.drives:
                    drive.move()
            self.rounds += 1
            time.sleep(LOOK_S)

    def unplug(self):
        """The adapter is gone, and the drives have heard all that came through it: the line answers a question before it goes."""
        self.line.unplug()
        rounds = self.rounds
        harness.wait_for(lambda: self.rounds > rounds + 1, "the drives have heard what was written")

    def end(self):
        self.is_ending = True
        self.thread.join(harness.WAIT_S)


class PresetBench(harness.Bench):
    """A preset with the address of this line, the confirmation that it asks for, and times for a busy machine."""

    def __init__(self, bin_dir, preset, line):
        super().__init__(bin_dir)
        source = harness.TOP / f"config/modbus/{preset}.ini"
        run = self.heaved("--config", source, "--check")
        assert run.returncode == 78 and run.stderr.count("\n") == 1 and "drive_timeout_confirmed = yes" in run.stderr, run.stderr
        text = source.read_text(encoding="utf-8")
        text = text.replace("engage = manual\n", "engage = manual\nlate_hold_cycles = 0\n")
        text = text.replace("margin_mm = 2\n", "margin_mm = 2\nfollowing_error_mm = 0\n").replace("[modbus]\n", "[modbus]\nretries = 8\n")
        changes = {"port": self.port, "device": line.address[0], "timeout_ms": 900, r"feedback_timeout_ms = 900\b": 9500, r"following_error_mm = [23]": 0,
                   "drive_timeout_confirmed": "yes", "speed_mm_s = 15": 35, "parity": "none"}  # pseudo terminals have no parity
        for key, value in changes.items():
            key, _, was = key.partition(" = ")
            text, count = re.subn(rf"^{key} = {was}[^;\n]*", f"{key} = {value} ", text, flags=re.MULTILINE)
            assert count == 1, key
        self.config = self.file("preset.ini", f"{text}\n[control]\nsocket = {self.socket}\n")
        run = self.heaved("--config", self.config, "--check")
        assert run.returncode == 0 and "Hz of each drive expected" in run.stdout, run.stderr


def check_registers(platform):
    """Nothing that a drive takes for wrong; each enabled where it was, steps that the time between two set-points allows, never out of its stroke."""
    from modbus_peer import judged_whatever, steps
    for drive in platform.drives:
        with judged_whatever():
            assert drive.wrongs == [], drive.wrongs
            assert len(drive.targets) > RIDE_SETPOINTS, f"{len(drive.targets)} set-points"
            assert drive.targets[0][1] == drive.targets[0][2], "its first target was not where it was"
            assert all(0 <= target <= STROKE_MM * COUNTS_PER_MM for *_, target in drive.targets), drive.targets
            for (_, position, target), (step, within_s) in zip(drive.targets[1:], steps([(at_s, target) for at_s, _, target in drive.targets])):
                step_mm = min(step, abs(target - position)) / COUNTS_PER_MM
                assert step_mm <= SPEED_MM_S * within_s + 3 * STEP_MM, f"a step of {step_mm} mm in {within_s:.3f} s"


def wait_ready(bench):
    harness.wait_for(lambda: all(leg["drive"] == "disabled" for leg in bench.status()["cylinders"]), "the drives are started up")


def engage(bench):
    wait_ready(bench)
    assert bench.ctl("engage").returncode == 0
    status = bench.wait_state("ENGAGED", "FAULT")
    assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"


def ride(bench, platform, seconds):
    """At least as long as that, and until each drive has heard some set-points."""
    wanted = [len(drive.targets) + RIDE_SETPOINTS for drive in platform.drives]

    def is_enough():
        sender.stream(seconds, lambda t: f"@A6:{2 * math.sin(2 * t):.3f},{math.sin(2 * t):.3f},0,0,0,{100 + 10 * math.sin(2 * t):.3f}#")
        status = bench.status()
        assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"
        return all(len(drive.targets) >= count for drive, count in zip(platform.drives, wanted))

    with bench.sender() as sender:
        harness.wait_for(is_enough, f"{RIDE_SETPOINTS} set-points of each drive")


def await_fault(bench, names, axis=None):
    fault = bench.wait_state("FAULT")["fault"]
    assert fault["name"] in names and axis in (None, fault["axis"]), fault


def all_stopped(platform, but=()):
    harness.wait_for(lambda: all(drive.is_stopped for drive in platform.drives if drive.unit not in but), "every other drive is told to stop")


def come_back(bench):
    assert bench.status()["state"] == "FAULT"  # nothing clears itself
    bench.reset()
    engage(bench)


def check_ride(bin_dir, preset, kind):
    with Line(kind) as platform, PresetBench(bin_dir, preset, platform.line) as bench:
        daemon = bench.start()
        engage(bench)
        ride(bench, platform, 2)
        status = bench.status()
        assert status["state"] == "ENGAGED", status["fault"]
        assert all(leg["period_ms"] > 0 for leg in status["cylinders"])
        assert [leg["report"]["unit"] for leg in status["cylinders"]] == list(UNITS)
        assert bench.stop(daemon) == 0
        harness.wait_for(lambda: not any(drive.has_torque for drive in platform.drives), "torque is off")
        check_registers(platform)


def check_silent(bin_dir, preset, kind):
    """One drive that hears nothing: the others go on until it is given up, then all stop."""
    with Line(kind) as platform, PresetBench(bin_dir, preset, platform.line) as bench:
        bench.start()
        engage(bench)
        ride(bench, platform, 0.2)
        before = [len(drive.targets) for drive in platform.drives]
        platform.line.silent = {3}
        await_fault(bench, ["drive-offline"], 3)
        all_stopped(platform, but={3})
        after = [len(drive.targets) for drive in platform.drives]
        assert all(now > then for unit, then, now in zip(UNITS, before, after) if unit != 3), (before, after)
        platform.line.silent = set()
        wait_ready(bench)
        come_back(bench)
        check_registers(platform)


def check_unplugged(bin_dir, preset, kind):
    """The serial adapter is pulled out in motion: named, and when it is back nothing moves before a reset."""
    with Line(kind) as platform, PresetBench(bin_dir, preset, platform.line) as bench:
        bench.start()
        engage(bench)
        ride(bench, platform, 0.2)
        platform.unplug()
        await_fault(bench, ["drive-offline", "bus-lost"])  # whichever of one and all of them is seen first
        assert str(platform.line.path) in bench.ctl("status").stdout and "plugged in" in bench.status()["bus"]["trouble"], bench.status()["bus"]
        before = [len(drive.targets) for drive in platform.drives]
        platform.line.plug()
        wait_ready(bench)
        assert [len(drive.targets) for drive in platform.drives] == before, "a set-point after the return"
        come_back(bench)
        check_registers(platform)


def check_alarm(bin_dir, preset, kind):
    """A drive's own alarm stops all, and is taken back by a reset as the manual has it."""
    with Line(kind) as platform, PresetBench(bin_dir, preset, platform.line) as bench:
        bench.start()
        engage(bench)
        ride(bench, platform, 0.2)
        platform.drives[4].alarm = 0x30
        await_fault(bench, ["drive-fault"], 5)
        all_stopped(platform)
        leg = bench.status()["cylinders"][4]
        assert leg["device_code"] == 0x30, leg
        bench.reset()
        assert platform.drives[4].alarm == 0, "the alarm is not taken back"
        engage(bench)
        check_registers(platform)


def check_killed(bin_dir, preset, kind):
    """Killed in motion and started again: placed anew where the drives have come to, whatever was asked before."""
    with Line(kind) as platform, PresetBench(bin_dir, preset, platform.line) as bench:
        daemon = bench.start()
        engage(bench)
        ride(bench, platform, 0.5)
        bench.stop(daemon, signal.SIGKILL)
        platform.unplug()  # what the dead one had asked is not heard later
        harness.wait_for(lambda: all(drive.position == drive.target for drive in platform.drives), "they come to rest at their last set-point")
        before = [len(drive.targets) for drive in platform.drives]
        bench.socket.unlink(missing_ok=True)
        platform.line.plug()
        daemon = bench.start()
        engage(bench)
        for drive, count in zip(platform.drives, before):
            _, position, target = drive.targets[count]
            assert position == target, f"begins at {target} where the drive is at {position}"
        assert bench.stop(daemon) == 0
        check_registers(platform)


def counted(check, *arguments):
    """Runs the check, in a process that ends without a word; the cycles of its heaved."""
    before = dict(harness.Guard.cycles)
    check(*arguments)
    return [(is_judged, cycles - before[is_judged]) for is_judged, cycles in harness.Guard.cycles.items()]


def main():
    bin_dir = Path(sys.argv[1])
    only = sys.argv[sys.argv.index("--only") + 1] if "--only" in sys.argv else ""
    tap.needs_package("pymodbus")
    suite = tap.Suite()
    cases = [
        ("iai-robo-cylinder: six on one serial line ride by their manual's rules", check_ride, RoboCylinder),
        ("oriental-motor-az: six on one serial line ride by their manual's rules", check_ride, Az),
        ("iai-robo-cylinder: one silent on the line: the others go on, then all stop; a reset leads back", check_silent, RoboCylinder),
        ("oriental-motor-az: the adapter is unplugged and back", check_unplugged, Az),
        ("iai-robo-cylinder: an alarm of a drive stops all", check_alarm, RoboCylinder),
        ("oriental-motor-az: killed in motion and started again: no step", check_killed, Az),
    ]
    chosen = [row for row in cases if only in row[0]]
    __import__("modbus_peer")  # once for all
    with concurrent.futures.ProcessPoolExecutor(3) as pool:  # they mostly wait, but no thread of one for those of another
        running = [(name, pool.submit(counted, check, bin_dir, name.partition(":")[0], kind)) for name, check, kind in chosen]
        for name, future in running:
            with suite.case(name):
                for is_judged, cycles in future.result():
                    harness.Guard.cycles[is_judged] += cycles
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
