# SPDX-License-Identifier: MIT
"""plain_master.py - a master of python-can only, for heave-twin on any of its buses: shares nothing with heaved or heave-twin."""
import struct
import time

import can
from twin_bench import COUNTS_PER_MM

HOMING, CYCLIC = 6, 8
TO_THE_LOWER_END = 17
HOMED, HOMING_FAILED = 0x1400, 0x2000


class PlainMaster:
    """Frames by python-can, and nothing else: a cyclic master as somebody writes it in an afternoon."""

    def __init__(self, bus, node):
        self.bus, self.node = bus, node

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


def homes(master):
    """Its own homing, begun by bit 4 and held until it says that it has attained its zero."""
    status = position = 0
    for _ in range(1000):
        status, position = master.cycle(0x1F, position)
        assert not status & HOMING_FAILED, hex(status)
        if status & HOMED == HOMED:
            return
    raise AssertionError(f"homing does not end: {status:04x}, {position}")


def drives_node_4(bench, bus):
    """Four's mapping as that master wants it, its torque, its homing, and a way in a cyclic mode."""
    master = PlainMaster(bus, 4)
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
        master.write(0x6098, 0, 1, TO_THE_LOWER_END)
        master.write(0x6099, 1, 4, 40 * COUNTS_PER_MM)
        master.write(0x6060, 0, 1, HOMING)
        master.send(0, bytes([1, 4]))
        _, position = master.cycle(0x06, 0)
        for word in (0x06, 0x07, 0x0F):
            for _ in range(60):
                status, position = master.cycle(word, position)
        assert status & 0x6F == 0x27, hex(status)
        homes(master)
        assert abs(bench.twin_status()["drives"][3]["position"]) < 0.1, bench.twin_status()["drives"][3]
        for _ in range(60):
            status, position = master.cycle(0x07, position)
        master.write(0x6060, 0, 1, CYCLIC)  # refused by drives that have torque
        for _ in range(60):
            status, position = master.cycle(0x0F, position)
        for step in range(250):
            status, position = master.cycle(0x0F, 40 * step)
        assert abs(position - 40 * 250) < 200, position
        assert abs(bench.twin_status()["drives"][3]["position"] - 10) < 0.2
        time.sleep(0.1)
        master.cycle(0x0F, position)  # after a silence: the drive has seen no SYNC, and takes that as no fault
    finally:
        master.bus.shutdown()
