#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin_can.py BIN [PART OF A NAME] - heave-twin on vcan, on virtual time: every row of docs/twin.md that plays a failure, and foreign masters.
Runs inside kernel.py --virtual-time --python."""
import re
import struct
import subprocess
import sys
import time

import can
import canopen
import harness
import tap
import vcan
from canopen.profiles.p402 import BaseNode402
from twin_bench import COUNTS_PER_MM, TwinBench

ROW = re.compile(r"^\| (.+) \| `([^`]+)` \| ([\w -]+) \|$", re.MULTILINE)
SETTLE_S = 3     # after a fault has struck
PATIENCE_S = 12  # a platform that shall not come up has not by then
SETTLED_MM = 5


def rows():
    return ROW.findall((harness.TOP / "docs/twin.md").read_text(encoding="utf-8").split("## Each failure of Modbus")[0])


def plays(line, says):
    def case(bench):
        try:
            play(bench, line, says)
        finally:
            vcan.fast()
            subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    return case


def play(bench, line, says):
    bench.start_twin("--fault", line)
    time.sleep(1 if line.startswith("0") else 0)
    bench.start()
    if says == "not enabled":
        time.sleep(PATIENCE_S)
        assert bench.status()["state"] not in ("RISING", "ENGAGED"), bench.status()["state"]
        assert not any(drive["set_points"] for drive in bench.twin_status()["drives"]), "somebody had torque"
        return
    if line.startswith("+"):
        harness.wait_for(lambda: f"s: {line.split(' ', 1)[1]}" in bench.twin_log.read_text(encoding="utf-8"), "the line is played")
    if says == "goes on":
        bench.wait_state("ENGAGED")
        time.sleep(1)
        assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]
        return
    time.sleep(SETTLE_S)
    status = bench.status()
    assert (status["state"], status["fault"]["name"]) == ("FAULT", says), status["fault"]


# --- Foreign masters ---

def dictionary():
    """What a user's EDS would say; objects are the standard's."""
    book = canopen.ObjectDictionary()

    def add(index, sub, kind, name, owner=None):
        variable = canopen.objectdictionary.ODVariable(name, index, sub)
        variable.data_type = kind
        owner.add_member(variable) if owner is not None else book.add_object(variable)

    types = canopen.objectdictionary.datatypes
    for index, kind, name in ((0x6040, types.UNSIGNED16, "Controlword"), (0x6041, types.UNSIGNED16, "Statusword"), (0x6060, types.INTEGER8, "Modes of operation"),
                              (0x6061, types.INTEGER8, "Modes of operation display"), (0x6064, types.INTEGER32, "Position actual value"),
                              (0x607A, types.INTEGER32, "Target position"), (0x6081, types.UNSIGNED32, "Profile velocity"),
                              (0x6098, types.INTEGER8, "Homing method"), (0x6502, types.UNSIGNED32, "Supported drive modes"), (0x1017, types.UNSIGNED16, "Heartbeat")):
        add(index, 0, kind, name)
    speeds = canopen.objectdictionary.ODRecord("Homing speeds", 0x6099)
    book.add_object(speeds)
    for sub in (0, 1, 2):
        add(0x6099, sub, types.UNSIGNED8 if sub == 0 else types.UNSIGNED32, f"speed {sub}", speeds)
    for base, subs in ((0x1400, (0, 1, 2)), (0x1800, (0, 1, 2, 3, 5))):
        for number in range(4):
            record = canopen.objectdictionary.ODRecord(f"PDO {base + number:X}", base + number)
            mapping = canopen.objectdictionary.ODArray(f"mapping {base + number + 0x200:X}", base + number + 0x200)
            book.add_object(record)
            book.add_object(mapping)
            for sub in subs:
                add(base + number, sub, {0: types.UNSIGNED8, 1: types.UNSIGNED32, 2: types.UNSIGNED8}.get(sub, types.UNSIGNED16), f"sub {sub}", record)
            for sub in range(9):
                add(base + number + 0x200, sub, types.UNSIGNED8 if sub == 0 else types.UNSIGNED32, f"sub {sub}", mapping)
    return book


def canopens_profile_homes_and_drives_it(bench):
    """The package canopen and its profile 402: somebody else's states, SDO and PDOs."""
    bench.start_twin("--start", "20")
    network = canopen.Network()
    network.connect(interface="socketcan", channel="vcan0")
    try:
        node = BaseNode402(2, dictionary())
        network.add_node(node)
        time.sleep(0.5)
        for number in (1, 2):
            node.tpdo[number].read()
            node.tpdo[number].event_timer = 10
            node.tpdo[number].save()
        node.setup_402_state_machine()
        node.sdo[0x6099][1].raw = 20 * COUNTS_PER_MM
        node.sdo[0x6098].raw = 17
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "HOMING"
        assert node.homing(timeout=10, restore_op_mode=False), "homing does not end"
        assert abs(bench.twin_status()["drives"][1]["position"]) < 0.1, bench.twin_status()["drives"][1]
        node.state = "SWITCHED ON"
        node.op_mode = "PROFILED POSITION"
        node.sdo[0x6081].raw = 30 * COUNTS_PER_MM
        node.state = "OPERATION ENABLED"
        node.sdo[0x607A].raw = 42 * COUNTS_PER_MM
        for word in (0x0F, 0x1F):
            node.sdo[0x6040].raw = word
        time.sleep(3)
        assert abs(bench.twin_status()["drives"][1]["position"] - 42) < 0.1, bench.twin_status()["drives"][1]
        assert abs(node.sdo[0x6064].raw - 42 * COUNTS_PER_MM) < 100
        node.state = "SWITCH ON DISABLED"
    finally:
        network.disconnect()


class PlainMaster:
    """Frames by python-can, and nothing else: a cyclic master as somebody writes it in an afternoon."""

    def __init__(self, node):
        self.bus, self.node = can.Bus(interface="socketcan", channel="vcan0"), node

    def send(self, identifier, data=b""):
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))

    def wait(self, identifier):
        end = time.monotonic() + 2
        while time.monotonic() < end:
            message = self.bus.recv(0.1)
            if message is not None and message.arbitration_id == identifier:
                return bytes(message.data)
        raise AssertionError(f"nothing from {identifier:X}")

    def write(self, index, sub, size, value):
        self.send(0x600 + self.node, struct.pack("<BHBi", 0x23 | (4 - size) << 2, index, sub, value))
        answer = self.wait(0x580 + self.node)
        assert answer[0] == 0x60, f"{index:X}:{sub}: {answer.hex()}"

    def cycle(self, word, target):
        self.send(0x80)
        word_back, position = struct.unpack("<Hi", self.wait(0x180 + self.node))
        self.send(0x200 + self.node, struct.pack("<Hi", word, target))
        time.sleep(0.004)
        return word_back, position


def plain_frames_drive_it(bench):
    bench.start_twin()
    time.sleep(0.5)
    master = PlainMaster(4)
    try:
        for record, cob_id, entries in ((0x1400, 0x204, (0x60400010, 0x607A0020)), (0x1800, 0x40000184, (0x60410010, 0x60640020))):
            for number, other in ((0, cob_id), (1, cob_id + 0x100)):
                master.write(record + number, 1, 4, struct.unpack("<i", struct.pack("<I", other | 0x80000000))[0])
            master.write(record, 2, 1, 1)
            master.write(record + 0x200, 0, 1, 0)
            for sub, entry in enumerate(entries, 1):
                master.write(record + 0x200, sub, 4, entry)
            master.write(record + 0x200, 0, 1, len(entries))
            master.write(record, 1, 4, cob_id)
        master.write(0x60C2, 1, 1, 4)
        master.write(0x6060, 0, 1, 8)
        master.send(0, bytes([1, 4]))
        _, position = master.cycle(0x06, 0)
        for word in (0x06, 0x07, 0x0F):
            for _ in range(60):
                status, position = master.cycle(word, position)
        assert status & 0x106F == 0x1027 & 0x106F, hex(status)
        for step in range(250):
            status, position = master.cycle(0x0F, SETTLED_MM * COUNTS_PER_MM + 40 * step)
        assert abs(position - SETTLED_MM * COUNTS_PER_MM - 40 * 250) < 200, position
        assert abs(bench.twin_status()["drives"][3]["position"] - 15) < 0.2
        time.sleep(0.1)
        master.cycle(0x0F, position)  # after a silence: the drive has seen no SYNC, and takes that as no fault
    finally:
        master.bus.shutdown()


CASES = [(f"docs/twin.md: {line}: {says}, {what}", plays(line, says)) for what, line, says in rows()] + [
    ("masters: the package canopen and its profile 402 home and drive it", canopens_profile_homes_and_drives_it),
    ("masters: frames by python-can drive it in a cyclic mode", plain_frames_drive_it),
]


def main():
    suite = tap.Suite()
    seen = set()
    for name, case in CASES:
        line = name.split(",")[0]
        if line in seen or (len(sys.argv) > 2 and not re.search(sys.argv[2], name)):
            continue
        seen.add(line)
        with suite.case(name), TwinBench(sys.argv[1], interface="vcan0") as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
