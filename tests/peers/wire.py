# SPDX-License-Identifier: MIT
"""wire.py - a CAN interface as one call of the system for each frame: on virtual time these are nearly all that a test takes."""
import socket
import struct

FRAME = struct.Struct("=IB3x8s")
EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000


class Wire:
    """Frames with identifiers of 11 bits of others; `only`: no others than these."""

    def __init__(self, interface, only=None):
        self.link = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        if only is not None:
            masks = b"".join(struct.pack("=II", identifier, EXTENDED | REMOTE | 0x7FF) for identifier in only)
            self.link.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, masks)
        self.link.bind((interface,))
        self.link.setblocking(False)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def fileno(self):
        return self.link.fileno()

    def heard(self):
        """Each frame that waits: (identifier, is_remote, bytes). OSError: the interface is down, which is told once."""
        while True:
            try:
                identifier, length, data = FRAME.unpack(self.link.recv(FRAME.size))
            except BlockingIOError:
                return
            if not identifier & (EXTENDED | ERROR):
                yield identifier & 0x7FF, bool(identifier & REMOTE), data[:length]

    def send(self, identifier, data):
        """OSError: not sent."""
        self.link.send(FRAME.pack(identifier, len(data), bytes(data)))

    def close(self):
        self.link.close()
