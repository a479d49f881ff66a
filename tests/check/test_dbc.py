#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_dbc.py - heaved --dump-dbc as cantools reads it: numbers, places, limits and kinds, of the preset and of a map with everything else.

usage: test_dbc.py --heaved PROGRAM; runs itself again with the Python of tools/lib/venv.sh, which has cantools"""
import argparse
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
PRESET = TOP / "config/can-raw-hexapod.ini"
OTHER = """[can-raw]
id_bits = 29
command_id = 0x18FF0100
reply_id = 0x18FF0200
counts_per_mm = -10000/3
zero_counts = 4000000
setpoint = 10 {position:i32be} {speed:i16be}
speed_counts_per_mm_s = 5/2
enable = 20
disable = 21
position_query = 30
position_reply = 30 {status:u8} {position:i32be}
homing_query = 31
homing_reply = 31 {status:u16le}
"""


SEALED = """[can-raw]
command_id = 0x601
reply_id = 0x581
counts_per_mm = 100
setpoint = 10 {position:i24be} {counter:u8} {crc8:07}
position_reply = 30 {status:u8} {fault:u8} {position:i24le} {counter:u8} {xor}
fault_when = 0x02/0x02
"""


def load_database(heaved, text):
    import cantools  # noqa: PLC0415  only in the second run
    with tempfile.NamedTemporaryFile("w", suffix=".ini") as config:
        config.write(text)
        config.flush()
        run = subprocess.run([heaved, "--config", config.name, "--dump-dbc"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return cantools.database.load_string(run.stdout, "dbc", strict=True)


def preset_is_read_as_it_is_sent(heaved):
    database = load_database(heaved, PRESET.read_text(encoding="utf-8"))
    assert len(database.messages) == 12
    for drive in range(6):
        message = database.get_message_by_frame_id(0x601 + drive)
        signals = message.decode(bytes.fromhex("0105C0270900D007"))
        assert signals["position"] == 300 and signals["speed"] == 2000 and str(signals["kind"]) == "setpoint", signals
        assert message.encode({"kind": "setpoint", "position": 123.4565, "speed": 2000}) == b"\x01\x05" + (246913).to_bytes(4, "little") + b"\xd0\x07"
        position = message.get_signal_by_name("position")
        assert (position.unit, position.minimum, position.maximum, position.scale) == ("mm", 0, 300, 0.0005), position
        reply = database.get_message_by_frame_id(0x581 + drive)
        assert reply.decode(bytes.fromhex("0015F0D8FFFF"))["position"] == -5
    kinds = {int(number): str(name) for number, name in message.get_signal_by_name("kind").choices.items()}
    assert kinds == {0x0501: "setpoint", 0x0301: "home", 0x1500: "position_query", 0x1200: "homing_query"}, kinds


def other_map_is_read_as_it_is_sent(heaved):
    text = re.sub(r"\[can-raw\].*?(?=\n\[relays\])", OTHER, PRESET.read_text(encoding="utf-8"), flags=re.DOTALL)
    database = load_database(heaved, text)
    message = database.get_message_by_name("drive6_command")
    assert message.is_extended_frame and message.frame_id == 0x18FF0105
    signals = message.decode(b"\x10" + (3900000).to_bytes(4, "big", signed=True) + (-250).to_bytes(2, "big", signed=True))
    assert abs(signals["position"] - 30) < 1e-9 and abs(signals["speed"] + 100) < 1e-9, signals
    reply = database.get_message_by_name("drive1_reply")
    signals = reply.decode(b"\x30\x07" + (4000000).to_bytes(4, "big"))
    assert abs(signals["position"]) < 1e-9 and signals["status"] == 7 and str(signals["kind"]) == "position_reply", signals
    assert reply.decode(b"\x31\x34\x12\0\0\0")["homing_status"] == 0x1234


def sealed_map_is_read_as_it_is_sent(heaved):
    """Fields of 24 bits, fault codes, counters and check bytes have their places."""
    text = re.sub(r"\[can-raw\].*?(?=\n\[relays\])", SEALED, PRESET.read_text(encoding="utf-8"), flags=re.DOTALL)
    database = load_database(heaved, text)
    signals = database.get_message_by_name("drive1_command").decode(b"\x10" + (30000).to_bytes(3, "big") + b"\x07\x99")
    assert abs(signals["position"] - 300) < 1e-9 and signals["counter"] == 7 and signals["checksum"] == 0x99, signals
    reply = database.get_message_by_name("drive2_reply").decode(b"\x30\x01\x2a" + (-100).to_bytes(3, "little", signed=True) + b"\x05\x44")
    assert (reply["status"], reply["fault"], reply["counter"], reply["checksum"]) == (1, 0x2A, 5, 0x44) and abs(reply["position"] + 1) < 1e-9, reply


def drives_without_frames_are_told(heaved):
    run = subprocess.run([heaved, "--config", TOP / "config/demo-hexapod.ini", "--dump-dbc"], capture_output=True, text=True, check=False)
    assert run.returncode == 78 and "can-raw" in run.stderr and not run.stdout, run


CASES = [
    ("counters, check bytes and fields of 24 bits have their places", sealed_map_is_read_as_it_is_sent),
    ("the preset's DBC file reads what is sent", preset_is_read_as_it_is_sent),
    ("a DBC file of 29-bit, big-endian, signed, backward frames reads what is sent", other_map_is_read_as_it_is_sent),
    ("drives without frames of their own have no DBC file", drives_without_frames_are_told),
]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    options = parser.parse_args()
    if "HEAVE_TEST_VENV" not in os.environ:
        found = subprocess.run([TOP / "tools/lib/venv.sh", "--cached"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
        if found.returncode != 0:
            print(f"1..0 # SKIP {found.stderr.strip()}")
            return 0
        os.environ["HEAVE_TEST_VENV"] = "1"
        os.execv(found.stdout.strip(), [found.stdout.strip(), *sys.argv])
    suite = tap.Suite()
    for name, case in CASES:
        with suite.case(name):
            case(options.heaved)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
