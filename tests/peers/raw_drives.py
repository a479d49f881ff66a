#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""raw_drives.py LOG POSITION... - drives on vcan0 that speak the frames of config/can-raw-hexapod.ini, one per start position (counts), homed.

They follow: where a set-point has been for a period, they are. LOG gets a line per frame that they hear: `<time_us> <id> <bytes>`, and before the
first of a drive `start <id> <counts>`. Prints "ready", ends when stdin does.
"""
import contextlib
import select
import struct
import sys
import time

import can

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


def main():
    drives = [Drive(int(position)) for position in sys.argv[2:]]
    filters = [{"can_id": FIRST_ID + i, "can_mask": 0x7FF, "extended": False} for i in range(len(drives))]
    with can.Bus(interface="socketcan", channel="vcan0", can_filters=filters) as bus, open(sys.argv[1], "w", encoding="ascii") as log:
        for i, drive in enumerate(drives):
            log.write(f"start {FIRST_ID + i:x} {drive.position}\n")
        print("ready", flush=True)
        while True:
            readable = select.select([bus.fileno(), sys.stdin], [], [])[0]
            if sys.stdin in readable:
                return
            try:
                message = bus.recv(0)
            except can.CanOperationError:
                continue  # interface down: told once, then it is silent until it is up again
            if message is None:
                continue
            now = time.monotonic()
            log.write(f"{round(now * 1e6)} {message.arbitration_id:x} {message.data.hex()}\n")
            answer = drives[message.arbitration_id - FIRST_ID].hear(bytes(message.data), now)
            if answer is not None:
                with contextlib.suppress(can.CanOperationError):
                    bus.send(can.Message(arbitration_id=message.arbitration_id - FIRST_ID + FIRST_REPLY, data=answer, is_extended_id=False))


if __name__ == "__main__":
    main()
