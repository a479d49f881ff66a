#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""raw_drives.py LOG POSITION... - drives on vcan0 that speak the frames of config/can-raw-hexapod.ini, one per start position (counts), homed.

LOG gets a line per frame that they hear: `<time_us> <id> <bytes>`, and before the
first of a drive `start <id> <counts>`. Prints "ready", ends when stdin does.
"""
import contextlib
import select
import sys
import time

import can

from raw_drive import FIRST_ID, FIRST_REPLY, Drive


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
