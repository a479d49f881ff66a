# SPDX-License-Identifier: MIT
"""objects.py - the object dictionary of a simulated CiA 402 drive: values, access, and the rules of PDO mapping.

Rules as strict as the strictest of several real stacks: what passes here passes there. A refusal is an SdoAbortedError with the code that
such a drive sends.
"""
import struct

from canopen.sdo.exceptions import SdoAbortedError

READ_ONLY, WRITE_ONLY = 0x06010002, 0x06010001
UNSUPPORTED, NO_OBJECT, NO_SUB, TOO_LONG, TOO_SHORT = 0x06010000, 0x06020000, 0x06090011, 0x06070012, 0x06070013
NOT_MAPPABLE, PDO_LENGTH, BAD_VALUE, WRONG_STATE = 0x06040041, 0x06040042, 0x06090030, 0x08000022

INVALID = 0x80000000
PDOS = 4
DUMMIES = {0x0002: 8, 0x0003: 16, 0x0004: 32, 0x0005: 8, 0x0006: 16, 0x0007: 32}
FORMATS = {"u8": "<B", "i8": "<b", "u16": "<H", "i16": "<h", "u32": "<I", "i32": "<i"}


class Entry:
    """One value. map: "r" may be in an RPDO, "t" in a TPDO."""

    def __init__(self, kind, value, access="rw", map=""):
        self.kind, self.value, self.default, self.access, self.map = kind, value, value, access, map

    def size(self):
        return len(self.value) if self.kind == "text" else struct.calcsize(FORMATS[self.kind])

    def encode(self):
        return self.value.encode() if self.kind == "text" else struct.pack(FORMATS[self.kind], self.value)

    def decode(self, data):
        return struct.unpack(FORMATS[self.kind], bytes(data))[0]


def communication(node, identity):
    rows = {
        (0x1000, 0): Entry("u32", 0x00020192, "ro"),
        (0x1001, 0): Entry("u8", 0, "ro", "t"),
        (0x1003, 0): Entry("u8", 0),
        (0x1003, 1): Entry("u32", 0, "ro"),
        (0x1005, 0): Entry("u32", 0x80),
        (0x1006, 0): Entry("u32", 0),
        (0x1007, 0): Entry("u32", 0),
        (0x1008, 0): Entry("text", "simulated drive", "ro"),
        (0x1014, 0): Entry("u32", 0x80 + node),
        (0x1016, 0): Entry("u8", 2, "ro"),
        (0x1016, 1): Entry("u32", 0),
        (0x1016, 2): Entry("u32", 0),
        (0x1017, 0): Entry("u16", 0),
        (0x1018, 0): Entry("u8", 4, "ro"),
        (0x1019, 0): Entry("u8", 0),
        (0x1029, 0): Entry("u8", 1, "ro"),
        (0x1029, 1): Entry("u8", 0),
    }
    rows.update({(0x1018, sub + 1): Entry("u32", value, "ro") for sub, value in enumerate(identity)})
    return rows


def pdos(node):
    """As many drives come: valid, event-driven, and flooding the bus until somebody configures them."""
    mapped = {0x1600: [0x60400010], 0x1601: [0x60400010, 0x607A0020], 0x1A00: [0x60410010], 0x1A01: [0x60410010, 0x60640020]}
    rows = {}
    for number in range(PDOS):
        receive, transmit = 0x200 + 0x100 * number + node, 0x180 + 0x100 * number + node
        off = 0 if number < 2 else INVALID
        rows.update({(0x1400 + number, 0): Entry("u8", 2, "ro"), (0x1400 + number, 1): Entry("u32", receive | off), (0x1400 + number, 2): Entry("u8", 255)})
        rows.update({(0x1800 + number, 0): Entry("u8", 6, "ro"), (0x1800 + number, 1): Entry("u32", transmit | off | 0x40000000),
                     (0x1800 + number, 2): Entry("u8", 255), (0x1800 + number, 3): Entry("u16", 0), (0x1800 + number, 5): Entry("u16", 0),
                     (0x1800 + number, 6): Entry("u8", 0)})
        for base in (0x1600, 0x1A00):
            entries = mapped.get(base + number, [])
            rows[base + number, 0] = Entry("u8", len(entries))
            rows.update({(base + number, sub): Entry("u32", entries[sub - 1] if sub <= len(entries) else 0) for sub in range(1, 9)})
    return rows


def application(position):
    return {
        (0x603F, 0): Entry("u16", 0, "ro", "t"),
        (0x6040, 0): Entry("u16", 0, "rw", "rt"),
        (0x6041, 0): Entry("u16", 0, "ro", "t"),
        (0x6007, 0): Entry("i16", 0),
        (0x605A, 0): Entry("i16", 0),
        (0x605B, 0): Entry("i16", 0),
        (0x605C, 0): Entry("i16", 0),
        (0x605D, 0): Entry("i16", 1),
        (0x605E, 0): Entry("i16", 0),
        (0x6060, 0): Entry("i8", 0, "rw", "rt"),
        (0x6061, 0): Entry("i8", 0, "ro", "t"),
        (0x6062, 0): Entry("i32", position, "ro", "t"),
        (0x6064, 0): Entry("i32", position, "ro", "t"),
        (0x6065, 0): Entry("u32", 0xFFFFFFFF),
        (0x6066, 0): Entry("u16", 0),
        (0x606C, 0): Entry("i32", 0, "ro", "t"),
        (0x607A, 0): Entry("i32", 0, "rw", "rt"),
        (0x607C, 0): Entry("i32", 0),
        (0x607D, 0): Entry("u8", 2, "ro"),
        (0x607D, 1): Entry("i32", 0),
        (0x607D, 2): Entry("i32", 0),
        (0x607F, 0): Entry("u32", 0),
        (0x6081, 0): Entry("u32", 10000, "rw", "r"),
        (0x6083, 0): Entry("u32", 100000),
        (0x6084, 0): Entry("u32", 100000),
        (0x6085, 0): Entry("u32", 1000000),
        (0x6091, 0): Entry("u8", 2, "ro"),
        (0x6091, 1): Entry("u32", 1),
        (0x6091, 2): Entry("u32", 1),
        (0x6098, 0): Entry("i8", 0),
        (0x6099, 0): Entry("u8", 2, "ro"),
        (0x6099, 1): Entry("u32", 5000),
        (0x6099, 2): Entry("u32", 1000),
        (0x609A, 0): Entry("u32", 100000),
        (0x60B1, 0): Entry("i32", 0, "rw", "r"),
        (0x60C0, 0): Entry("i16", 0),
        (0x60C1, 0): Entry("u8", 1, "ro"),
        (0x60C1, 1): Entry("i32", 0, "rw", "rt"),
        (0x60C2, 0): Entry("u8", 2, "ro"),
        (0x60C2, 1): Entry("u8", 1),
        (0x60C2, 2): Entry("i8", -3),
        (0x60F4, 0): Entry("i32", 0, "ro", "t"),
        (0x60FD, 0): Entry("u32", 0, "ro", "t"),
        (0x6502, 0): Entry("u32", 0xA1 | 0x40, "ro"),
    }


class Dictionary:
    """All objects of one drive, and the mapped PDOs."""

    def __init__(self, node, identity, position):
        self.entries = {**communication(node, identity), **pdos(node), **application(position)}
        self.indexes = {index for index, _ in self.entries}
        self.is_operational = False

    def __getitem__(self, where):
        return self.entries[where if isinstance(where, tuple) else (where, 0)].value

    def __setitem__(self, where, value):
        self.entries[where if isinstance(where, tuple) else (where, 0)].value = value

    def remove(self, index):
        self.entries = {where: entry for where, entry in self.entries.items() if where[0] != index}
        self.indexes.discard(index)

    def restore(self, low, high):
        for (index, _), entry in self.entries.items():
            if low <= index <= high:
                entry.value = entry.default

    def find(self, index, sub):
        if (index, sub) in self.entries:
            return self.entries[index, sub]
        raise SdoAbortedError(NO_SUB if index in self.indexes else NO_OBJECT)

    def read(self, index, sub):
        entry = self.find(index, sub)
        if entry.access == "wo":
            raise SdoAbortedError(WRITE_ONLY)
        return entry.encode()

    def write(self, index, sub, data):
        """The new value is checked here as far as the mapping goes; what it means is the drive's business."""
        entry = self.find(index, sub)
        if entry.access == "ro":
            raise SdoAbortedError(READ_ONLY)
        if len(data) != entry.size():
            raise SdoAbortedError(TOO_LONG if len(data) > entry.size() else TOO_SHORT)
        value = entry.decode(data)
        if index == 0x1003 and value != 0:
            raise SdoAbortedError(BAD_VALUE)
        if 0x1400 <= index < 0x1C00:
            self.check_pdo(index, sub, value)
        entry.value = value
        return value

    # --- PDO rules ---

    def is_valid(self, index):
        """index of the communication record."""
        return not self[index, 1] & INVALID

    def check_pdo(self, index, sub, value):
        if self.is_operational:
            raise SdoAbortedError(WRONG_STATE)
        if index & 0x0200:
            self.check_mapping(index, sub, value)
        elif sub == 1:
            self.check_cob_id(index, value)
        elif sub == 2 and 241 <= value <= 253:
            raise SdoAbortedError(BAD_VALUE)
        elif sub in (3, 6) and self.is_valid(index):
            raise SdoAbortedError(UNSUPPORTED)

    def check_cob_id(self, index, value):
        is_change = (value ^ self[index, 1]) & 0x1FFFFFFF
        if self.is_valid(index) and not value & INVALID and is_change:
            raise SdoAbortedError(BAD_VALUE)
        if index >= 0x1800 and (value ^ self[index, 1]) & 0x40000000:
            raise SdoAbortedError(BAD_VALUE)
        if not value & INVALID and self[index + 0x200, 0] == 0:
            raise SdoAbortedError(BAD_VALUE)

    def check_mapping(self, index, sub, value):
        if self.is_valid(index - 0x200) or (sub > 0 and self[index, 0] != 0):
            raise SdoAbortedError(UNSUPPORTED)
        if sub > 0:
            self.check_mapped(index, value)
        elif value > 8 or sum(self[index, k] & 0xFF for k in range(1, value + 1)) > 64:
            raise SdoAbortedError(PDO_LENGTH)
        else:
            for k in range(1, value + 1):
                self.check_mapped(index, self[index, k])
            self.check_not_elsewhere(index, value)

    def check_mapped(self, index, value):
        target, sub, bits = value >> 16, value >> 8 & 0xFF, value & 0xFF
        if index < 0x1800 and sub == 0 and DUMMIES.get(target) == bits:
            return
        entry = self.find(target, sub)
        if ("r" if index < 0x1800 else "t") not in entry.map or bits != 8 * entry.size():
            raise SdoAbortedError(NOT_MAPPABLE)

    def check_not_elsewhere(self, index, count):
        """No object in two valid RPDOs: which of them would count?"""
        if index >= 0x1800:
            return
        mine = {self[index, k] for k in range(1, count + 1)}
        for number in range(PDOS):
            other = 0x1600 + number
            if other != index and self.is_valid(other - 0x200) and mine & {self[other, k] for k in range(1, self[other, 0] + 1)}:
                raise SdoAbortedError(UNSUPPORTED)

    def mapped(self, index):
        """[(where, bytes)] of a mapping record; where is None for a dummy."""
        values = [self[index, k] for k in range(1, self[index, 0] + 1)]
        return [(None if value >> 16 in DUMMIES else (value >> 16, value >> 8 & 0xFF), (value & 0xFF) // 8) for value in values]

    def pack(self, index):
        return b"".join(self.entries[where].encode() for where, _ in self.mapped(index))

    def unpack(self, index, data):
        """{where: value} of a received PDO."""
        values, start = {}, 0
        for where, size in self.mapped(index):
            if where is not None:
                values[where] = self.entries[where].decode(data[start:start + size])
            start += size
        return values
