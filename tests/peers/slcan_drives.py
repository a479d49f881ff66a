# SPDX-License-Identifier: MIT
"""slcan_drives.py LOG POSITION... - an adapter on a serial line (slcan) and the drives of raw_drive.py on its other side; takes root.

The serial line is a pseudo terminal, so that all that an adapter does can be done to it: stop this process, and nobody takes frames any more;
end it, and the adapter has been unplugged. LOG gets a line per frame that they hear: `<time_us> <id> <bytes>`, and before the first of a drive `start <id> <counts>`. Prints the name of the interface when it is up; ends when its
standard input does.
"""
import fcntl
import os
import select
import socket
import struct
import sys
import termios
import time
import tty

from raw_drive import FIRST_ID, FIRST_REPLY, Drive

N_SLCAN = 17
SIOCGIFNAME, SIOCSIFFLAGS, SIOCSIFTXQLEN = 0x8910, 0x8914, 0x8943
IFF_UP, IFF_NOARP = 0x1, 0x80
QUEUE_FRAMES = 16
PRIORITY = 20  # real drives wait for nobody either


def set_up(name, queue_frames=None):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as control:
        if queue_frames is not None:
            fcntl.ioctl(control, SIOCSIFTXQLEN, struct.pack("16si20x", name, queue_frames))
        fcntl.ioctl(control, SIOCSIFFLAGS, struct.pack("16sh22x", name, IFF_UP | IFF_NOARP))


def attach(line):
    """The kernel's side: an interface behind this terminal."""
    fcntl.ioctl(line, termios.TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(line, SIOCGIFNAME, bytes(40))[:16].rstrip(b"\0")
    set_up(name, QUEUE_FRAMES)
    return name.decode()


def frame_of(line):
    """(id, data) of "tiiildd..", None where it is another command."""
    if line[:1] != b"t":
        return None
    return int(line[1:4], 16), bytes.fromhex(line[5:5 + 2 * int(line[4:5])].decode())


def serve(adapter, drives, log):
    waiting = b""
    while True:
        readable = select.select([adapter, sys.stdin], [], [])[0]
        if sys.stdin in readable:
            return
        *lines, waiting = (waiting + os.read(adapter, 4096)).split(b"\r")
        now = time.monotonic()
        for identifier, data in filter(None, map(frame_of, lines)):
            log.write(f"{round(now * 1e6)} {identifier:x} {data.hex()}\n")
            answer = drives[identifier - FIRST_ID].hear(data, now)
            if answer is not None:
                os.write(adapter, b"t%03X%d%s\r" % (identifier - FIRST_ID + FIRST_REPLY, len(answer), answer.hex().encode()))


def main():
    drives = [Drive(int(position)) for position in sys.argv[2:]]
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    adapter, line = os.openpty()
    tty.setraw(line)
    name = attach(line)
    with open(sys.argv[1], "w", encoding="ascii", buffering=1) as log:
        for i, drive in enumerate(drives):
            log.write(f"start {FIRST_ID + i:x} {drive.position}\n")
        print(name, flush=True)
        serve(adapter, drives, log)


if __name__ == "__main__":
    main()
