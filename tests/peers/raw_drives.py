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

from raw_drive import FIRST_ID, FIRST_REPLY, Drive
from wire import Wire


def main():
    drives = [Drive(int(position)) for position in sys.argv[2:]]
    with Wire("vcan0", range(FIRST_ID, FIRST_ID + len(drives))) as wire, open(sys.argv[1], "w", encoding="ascii") as log:
        for i, drive in enumerate(drives):
            log.write(f"start {FIRST_ID + i:x} {drive.position}\n")
        print("ready", flush=True)
        while True:
            readable = select.select([wire, sys.stdin], [], [])[0]
            if sys.stdin in readable:
                return
            now = time.monotonic()
            with contextlib.suppress(OSError):  # interface down: told once, then it is silent until it is up again
                for identifier, _, data in wire.heard():
                    log.write(f"{round(now * 1e6)} {identifier:x} {data.hex()}\n")
                    answer = drives[identifier - FIRST_ID].hear(data, now)
                    if answer is not None:
                        wire.send(identifier - FIRST_ID + FIRST_REPLY, answer)


if __name__ == "__main__":
    main()
