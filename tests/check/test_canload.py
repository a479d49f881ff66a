#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_canload.py - the core's worst-case frame lengths against frames that are built and stuffed bit by bit here."""
import argparse
import random
import subprocess
import sys

import tap

END_BITS = 1 + 2 + 7 + 3  # checksum delimiter, acknowledgement with its delimiter, end of frame, intermission


def number(value, width):
    return [value >> (width - 1 - i) & 1 for i in range(width)]


def crc15(bits):
    register = 0
    for bit in bits:
        register = register << 1 & 0x7FFF ^ (0x4599 if bit ^ register >> 14 else 0)
    return number(register, 15)


def stuffed_part(identifier, is_extended, data):
    """Start of frame to checksum."""
    if is_extended:
        head = [0] + number(identifier >> 18, 11) + [1, 1] + number(identifier & 0x3FFFF, 18) + [0, 0, 0]
    else:
        head = [0] + number(identifier, 11) + [0, 0, 0]
    bits = head + number(len(data), 4) + [bit for byte in data for bit in number(byte, 8)]
    return bits + crc15(bits)


def stuff(bits):
    out, run = [], 0
    for bit in bits:
        run = run + 1 if out and out[-1] == bit else 1
        out.append(bit)
        if run == 5:
            out.append(1 - bit)
            run = 1
    return out


def frame_bits(identifier, is_extended, data):
    return len(stuff(stuffed_part(identifier, is_extended, data))) + END_BITS


def most_stuffing(length):
    """Most stuffing bits in any string of bits, by dynamic programming over the length of the run at its end."""
    best = {1: 0}
    for _ in range(length - 1):
        following = {}
        for run, bits in best.items():
            for next_run in (1, run + 1):
                state, total = (1, bits + 1) if next_run == 5 else (next_run, bits)
                following[state] = max(following.get(state, 0), total)
        best = following
    return max(best.values())


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--table", required=True)
    lines = subprocess.run([parser.parse_args().table], check=True, capture_output=True, text=True).stdout.splitlines()
    table = {(extended == "1", int(size)): int(bits) for extended, size, bits in (line.split() for line in lines)}
    suite = tap.Suite()

    with suite.case("the table has every frame of classic CAN"):
        assert set(table) == {(extended, size) for extended in (False, True) for size in range(9)}, table

    with suite.case("worst cases are the most stuffing that any bits of that length have"):
        for (extended, size), bits in table.items():
            plain = len(stuffed_part(0, extended, bytes(size)))
            assert bits == plain + most_stuffing(plain) + END_BITS, f"{extended} {size}: {bits}"

    with suite.case("no standard frame without data or with one byte of it is longer"):
        longest = [0, 0]
        for identifier in range(2048):
            longest[0] = max(longest[0], frame_bits(identifier, False, b""))
        for identifier in range(0, 2048, 16):
            for byte in range(256):
                longest[1] = max(longest[1], frame_bits(identifier, False, bytes([byte])))
        assert longest[0] <= table[False, 0] and longest[1] <= table[False, 1], longest
        assert longest[0] >= table[False, 0] - 2, f"{longest[0]} of {table[False, 0]}: the bound is not near"

    with suite.case("no frame at random is longer, and some come near"):
        source = random.Random(7)
        for (extended, size), bound in table.items():
            longest = 0
            for _ in range(600):
                identifier = source.choice((0, 0x78, 0x787, 0x7FF)) << (18 if extended else 0)
                identifier ^= source.getrandbits(29 if extended else 11) & source.getrandbits(29) & source.getrandbits(29)
                data = bytes(source.choice((0x00, 0xFF, 0x87, 0x78, 0xC3, 0x3C, 0xE1, 0x1E)) for _ in range(size))
                longest = max(longest, frame_bits(identifier & (0x1FFFFFFF if extended else 0x7FF), extended, data))
            assert bound - 16 <= longest <= bound, f"{extended} {size}: {longest} of {bound}"

    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
