# SPDX-License-Identifier: MIT
"""raw_drive.py - a drive that speaks the frames of config/can-raw-hexapod.ini, homed. It follows: where a set-point has been for a period, it is."""
import struct

FIRST_ID, FIRST_REPLY = 0x601, 0x581
SETTLE_S = 0.003


class Drive:
    def __init__(self, position):
        self.position = self.target = position
        self.when = 0.0

    def actual(self, now):
        if now - self.when >= SETTLE_S:
            self.position = self.target
        return self.position

    def hear(self, data, now):
        """The answer, or nothing."""
        if data[:2] == b"\x01\x05" and len(data) == 8:
            self.actual(now)
            self.target, self.when = struct.unpack("<I", data[2:6])[0], now
        elif data == b"\x00\x15":
            return b"\x00\x15" + struct.pack("<i", self.actual(now))
        elif data == b"\x00\x12":
            return b"\x00\x12\x01"
        else:
            raise ValueError(f"no frame of these drives: {data.hex()}")
        return None
