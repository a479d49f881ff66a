#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin_slcan.py BIN [PART OF A NAME] - heave-twin behind a serial CAN adapter, on virtual time: for python-can, which needs no CAN in the kernel, and for the
kernel's own slcan, as slcand makes it. Runs inside kernel.py --virtual-time --python."""
import os
import re
import subprocess
import sys
import time

import can
import harness
import tap
from plain_master import drives_node_4
from twin_bench import TwinBench

sys.path.append(str(harness.TOP / "tests/peers"))
from slcan_drives import attach  # noqa: E402  the path above has to be set first

PATIENCE_S = 8


def adapter_of(bench):
    return bench.folder / "adapter"


def plug_in(bench, *arguments):
    bench.start_twin("--slcan", adapter_of(bench), *arguments)
    time.sleep(0.5)


def foreign_master_drives_it(bench):
    plug_in(bench)
    bus = can.Bus(interface="slcan", channel=str(adapter_of(bench)), bitrate=1000000, sleep_after_open=0.1)
    assert bus.get_version(1) == (10, 13) and bus.get_serial_number(1) == "TWIN"
    drives_node_4(bench, bus)


def wrong_rate_is_said(bench):
    plug_in(bench)
    bus = can.Bus(interface="slcan", channel=str(adapter_of(bench)), bitrate=500000, sleep_after_open=0.1)
    try:
        bus.send(can.Message(arbitration_id=0x604, data=[0x40, 0x64, 0x60, 0, 0, 0, 0, 0], is_extended_id=False))
        assert bus.recv(1) is None, "something passes"
        assert "S6 is 500000 bit/s, the drives have 1000000" in bench.twin_log.read_text(encoding="utf-8")
        bus.set_bitrate(1000000)
        bus.send(can.Message(arbitration_id=0x604, data=[0x40, 0x64, 0x60, 0, 0, 0, 0, 0], is_extended_id=False))
        harness.wait_for(lambda: getattr(bus.recv(1), "arbitration_id", None) == 0x584, "node 4 answers")
    finally:
        bus.shutdown()


class Interface:
    """What `slcand -o -s8 PATH` does: the rate and the channel by commands, then the kernel's interface behind that terminal, which is named as the configuration has it."""

    def __init__(self, bench):
        self.line = os.open(adapter_of(bench), os.O_RDWR | os.O_NOCTTY)
        os.write(self.line, b"C\rS8\rO\r")
        name = attach(self.line)
        for words in (("down",), ("name", bench.interface), ("txqueuelen", "100"), ("up",)):
            subprocess.run(["ip", "link", "set", name, *words], check=True)
            name = bench.interface if words[0] == "name" else name

    def __enter__(self):
        return self

    def __exit__(self, *_):
        os.close(self.line)


def up(bench, *arguments):
    plug_in(bench, *arguments)
    interface = Interface(bench)
    bench.start()
    bench.wait_state("ENGAGED")
    return interface


def heaved_rises_and_follows(bench):
    with up(bench):
        with bench.sender() as sender:
            sender.send("@A6T:2,1,0,0,0,20,2000#")
            time.sleep(3)
        twin, status = bench.twin_status(), bench.status()
        assert status["state"] == "ENGAGED" and abs(twin["pose"][0] - 2) < 0.3 and abs(twin["pose"][1] - 1) < 0.3, twin["pose"]


def fails(line, says):
    def case(bench):
        with up(bench):
            bench.do(line)
            if says == "goes on":
                time.sleep(3)
                assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]
                return
            harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
            assert bench.status()["fault"]["name"] == says, bench.status()["fault"]
    return case


def comes_back(bench):
    """Unplugged, plugged in, opened again: a reset leads back."""
    with up(bench):
        bench.do("unplug")
        bench.wait_state("FAULT")
    bench.do("plug")
    with Interface(bench):
        end = time.monotonic() + 10 * PATIENCE_S
        while bench.status()["state"] != "ENGAGED" and time.monotonic() < end:
            state = bench.status()["state"]
            if state in ("FAULT", "OFF"):
                bench.ctl("reset" if state == "FAULT" else "engage")
            time.sleep(1)
        assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]


def not_in_place_of_real_drives(bench):
    """By the kind of the interface: behind this one there are drives, which another heave-twin plays."""
    command = [bench.bin / "heave-twin", "--config", bench.config]
    with up(bench):
        for options, words in (((), "leads to real drives"), (("--on-real-bus",), "is there already, and heave-twin would answer in its place")):
            run = subprocess.run([*command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
            assert run.returncode == 69 and f"{bench.interface}: " in run.stderr and words in run.stderr, run
        assert bench.status()["state"] == "ENGAGED" and bench.status()["counters"]["faults"] == 0, bench.status()["fault"]


CASES = [
    ("slcan: python-can alone drives it in a cyclic mode", foreign_master_drives_it),
    ("slcan: a wrong rate lets nothing pass, and is said", wrong_rate_is_said),
    ("slcan: heaved rises and follows on the kernel's interface", heaved_rises_and_follows),
    ("docs/twin.md: a serial adapter: frames that are not acknowledged", fails("cable-out", "bus-lost")),
    ("slcan: unplugged", fails("unplug", "bus-lost")),
    ("slcan: bus-off", fails("bus-off", "bus-lost")),
    ("slcan: error-passive", fails("passive", "bus-failing")),
    ("slcan: error frames", fails("storm 300", "goes on")),
    ("slcan: unplugged, and back", comes_back),
    ("slcan: heave-twin does not answer in place of drives that are there", not_in_place_of_real_drives),
]


def main():
    suite = tap.Suite()
    for name, case in CASES:
        if len(sys.argv) > 2 and not re.search(sys.argv[2], name):
            continue
        with suite.case(name), TwinBench(sys.argv[1], interface="slcan9") as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
