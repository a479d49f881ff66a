#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""can_record.py INTERFACE FILE - writes every frame of a CAN interface down, a line each: `<time_us> <id> <bytes>`, hexadecimal, x before
an id of 29 bits. Prints "ready", ends when stdin does. Looks for the interface again where it goes away."""
import select
import socket
import struct
import sys
import time

FRAME = struct.Struct("=IB3x8s")
EXTENDED = 0x80000000


def listener(interface):
    link = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    link.bind((interface,))
    link.setblocking(False)
    return link


def note_all(log, link):
    """What waits; that is of now, for on virtual time nobody hears late."""
    now_us = None
    while True:
        identifier, length, data = FRAME.unpack(link.recv(FRAME.size))
        now_us = now_us or time.monotonic_ns() // 1000
        kind = "x" if identifier & EXTENDED else ""
        log.write(f"{now_us} {kind}{identifier & 0x1FFFFFFF:x} {data[:length].hex()}\n")


def main():
    link = listener(sys.argv[1])
    with open(sys.argv[2], "w", encoding="ascii") as log:
        print("ready", flush=True)
        while True:
            readable = select.select([sys.stdin, *([link] if link else [])], [], [], None if link else 0.005)[0]
            if sys.stdin in readable:
                return
            try:
                link = link or listener(sys.argv[1])
                note_all(log, link)
            except BlockingIOError:
                continue
            except OSError:  # down: told once; gone: never again
                link.close() if link else None
                link = None


if __name__ == "__main__":
    main()
