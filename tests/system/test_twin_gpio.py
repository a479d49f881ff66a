#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin_gpio.py BIN [PART OF A NAME] - heave-twin on GPIO lines that the kernel simulates: switches, relays, the healthy pulse. Runs inside kernel.py --virtual-time;
the cases of a kernel without gpio-sim run on this one."""
import re
import signal
import sys
import time
from pathlib import Path

import gpio_sim
import harness
import tap
from twin_bench import TwinBench

from heave import Twin
from heave.errors import HeaveError

ROW = re.compile(r"^\| (.+) \| `([^`]+)` \| ([\w -]+) \|$", re.MULTILINE)
LINES = """
[inputs]
driver = gpio
estop = STOP
reset = RESET
enable = KEY
estop2 = STOP2
power = SUPPLY

[healthy]
driver = gpio
line = PULSE
toggle_ms = 20
"""


class LinesBench(TwinBench):
    """CiA 402 drives on a bus between programs, relays by chip and number, switches and pulse by name."""

    def __init__(self, bin_dir):
        super().__init__(bin_dir, platform__engage="manual", relays__driver="gpio", relays__lines="0, 1, R3, R4", relays__safe_mask="4")
        text = self.config.read_text(encoding="utf-8")
        assert text.count("[relays]\n") == 1
        self.config.write_text(text.replace("[relays]\n", "[relays]\nchip = board\nactive_low = yes\n") + LINES, encoding="utf-8")

    def press(self):
        for state in ("closed", "open"):
            self.do(f"reset {state}")
            time.sleep(0.2)

    def up(self):
        """heaved asks the chip for its resistor, and a simulated chip takes that for a wire that is off for a moment: the start ends in ESTOP."""
        self.start_twin()
        daemon = self.start()
        self.wait_state("ESTOP")
        harness.wait_for(lambda: self.status()["estop_active"] is False, "the twin holds its switch closed")
        self.press()
        self.wait_state("OFF")
        assert self.ctl("engage").returncode == 0
        self.wait_state("ENGAGED")
        return daemon

    def has_pulse(self):
        return self.twin_status()["healthy"]["still_ms"] < 100


def machine(bench):
    daemon = bench.up()
    assert bench.has_pulse(), bench.twin_status()["healthy"]
    status = bench.twin_status()
    assert status["switches"] == {"estop": "closed", "enable": "closed", "reset": "open", "estop2": "closed", "power": "closed"} and status["relays"] == [3], status
    with bench.sender() as sender:
        for mask, relays in ((0xB, [1, 2, 4]), (0x1, [1]), (0xF, [1, 2, 3, 4])):
            sender.send(f"@A6:0,0,0,0,0,20,{mask:X}#")
            harness.wait_for(lambda relays=relays: bench.twin_status()["relays"] == relays, f"relays {relays}")
        for switch in ("estop", "estop2"):
            bench.do(f"{switch} open")
        bench.wait_state("ESTOP")
    time.sleep(0.3)
    status = bench.twin_status()
    assert status["relays"] == [3] and status["healthy"]["still_ms"] > 200 and status["switches"]["estop"] == "open", status
    bench.press()
    time.sleep(1)
    assert bench.status()["state"] == "ESTOP", "it is open"
    for switch in ("estop", "estop2"):
        bench.do(f"{switch} closed")
    time.sleep(0.2)
    bench.press()
    bench.wait_state("OFF")
    assert bench.ctl("engage").returncode == 0
    bench.wait_state("ENGAGED")
    bench.do("enable open")
    bench.wait_state("SETTLED")
    assert bench.stop(daemon) == 0
    harness.wait_for(lambda: bench.twin_status()["relays"] == [], "nobody has the lines: a board with its resistors opens all")
    assert bench.end_twin() == 0
    assert not list(gpio_sim.CONFIGFS.iterdir()), "its chips are gone"


def chips_go(bench):
    daemon = bench.up()
    bench.do("chip-gone relays")
    harness.wait_for(lambda: bench.status()["relays"]["known"] is False, "the relays are not known")
    assert bench.twin_status()["relays"] is None and bench.status()["state"] == "ENGAGED"
    bench.do("chip-gone inputs")
    bench.wait_state("ESTOP")
    assert bench.twin_status()["healthy"] is None, "it is on the same chip"
    assert bench.stop(daemon) == 0
    for section in ("relays", "inputs"):
        bench.do(f"chip-back {section}")
    bench.socket.unlink(missing_ok=True)
    bench.start()
    harness.wait_for(lambda: bench.status()["estop_active"] is False, "the switch is where it was")


def rows():
    return ROW.findall((harness.TOP / "docs/twin.md").read_text(encoding="utf-8").split("## Each failure of GPIO")[1])


def plays(line, says):
    def case(bench):
        bench.up()
        bench.do(line)
        if says == "goes on":
            time.sleep(2)
            assert bench.status()["state"] == "ENGAGED", bench.status()
            return
        harness.wait_for(lambda: says in (bench.status()["state"], bench.status()["fault"]["name"]), says)
    return case


def script(bench):
    # both channels of the e-stop: one alone is a fault that stays
    bench.start_twin(*(word for line in ("3 estop open", "3 estop2 open", "4 estop closed", "4 estop2 closed") for word in ("--fault", line)))
    bench.start()
    harness.wait_for(lambda: bench.status()["estop_active"] is False, "closed")
    harness.wait_for(lambda: bench.status()["estop_active"] is True, "open")
    harness.wait_for(lambda: bench.status()["estop_active"] is False, "closed again")
    assert "s: estop open\n" in bench.twin_log.read_text(encoding="utf-8")


def killed(bench):
    bench.start_twin()
    bench.twin.send_signal(signal.SIGKILL)
    bench.twin.wait()
    left = {path.name for path in gpio_sim.CONFIGFS.iterdir()}
    assert len(left) == 2, left
    bench.twin_socket.unlink()
    bench.start_twin()
    assert not left & {path.name for path in gpio_sim.CONFIGFS.iterdir()}, "what it left behind"


def taken(bench):
    with gpio_sim.Chip("other", 3, "S"):
        text = bench.config.read_text(encoding="utf-8")
        bench.config.write_text(text.replace("estop = STOP", "estop = S0").replace("reset = RESET", "reset = S1").replace("enable = KEY\nestop2 = STOP2\npower = SUPPLY\n", ""), encoding="utf-8")
        run = bench.run_twin("--config", bench.config)
        assert run.returncode == 69 and "[inputs]: chip other of this machine has these lines already" in run.stderr and "--no-gpio" in run.stderr, run.stderr
        bench.start_twin("--no-gpio")
        status = bench.twin_status()
        assert "switches" not in status and "relays" not in status, status
        run = bench.run_twin("--socket", bench.twin_socket, "estop", "open")
        assert run.returncode == 1 and "no such GPIO line" in run.stderr, run.stderr


def in_python(bench):
    with Twin(bench.config, program=Path(sys.argv[1]) / "heave-twin") as twin:
        assert twin.switches == {"estop": True, "enable": True, "reset": False, "estop2": True, "power": True} and twin.relays == []
        twin.switch("estop", closed=False)
        assert twin.switches["estop"] is False
        for name in ("brake", "door"):
            try:
                twin.switch(name, closed=True)
            except HeaveError as reason:
                assert name in str(reason), reason
            else:
                raise AssertionError(f"{name} was switched")


def without(bench):
    """Where the kernel simulates no lines, or does not let us."""
    if harness.HAS_OWN_KERNEL or gpio_sim.is_there():
        raise tap.Skip("this kernel simulates lines")
    run = bench.run_twin("--config", bench.config)
    assert run.returncode == 69 and "modprobe gpio-sim" in run.stderr and "heave-lab" in run.stderr and "--no-gpio" in run.stderr, run.stderr
    bench.start_twin("--no-gpio")


CASES = [
    ("heave-twin: switches, relays and the healthy pulse of a machine on GPIO lines", machine),
    ("heave-twin: GPIO chips that go, and are back", chips_go),
    ("heave-twin: a script presses the e-stop", script),
    ("heave-twin: killed, and the next one tidies up its GPIO chips", killed),
    ("heave-twin: GPIO lines that are there already are left alone", taken),
    ("heave-twin: GPIO lines from Python", in_python),
    ("heave-twin: a kernel without gpio-sim: what to do is said", without),
] + [(f"docs/twin.md: {line}: {says}, {what}", plays(line, says)) for what, line, says in rows()]


def main():
    suite = tap.Suite()
    for name, case in CASES:
        if len(sys.argv) > 2 and not re.search(sys.argv[2], name):
            continue
        with suite.case(name):
            if case is not without and not gpio_sim.is_there():
                raise tap.Skip("this kernel has no gpio-sim")
            with LinesBench(sys.argv[1]) as bench:
                case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
