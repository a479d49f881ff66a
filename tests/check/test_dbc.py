#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_dbc.py - heaved --dump-dbc as cantools reads it: numbers, places, limits and kinds, of the preset and of a map with everything else.

usage: test_dbc.py --heaved PROGRAM; runs itself again with the Python of tools/lib/venv.sh, which has cantools"""
import argparse
import re
import struct
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

BITS = """[can-raw]
command_id = 0x201
reply_id = 0x281
counts_per_mm = 1000
zero_counts = 500
setpoint = A0 00 00 00 {position:i20be@0.3} {counter:u4@3.4}
enable = A1
position_reply = {position:f32be/1000} 00 {status:u3@4.5} {fault:u5@4.0}
fault_when = 0x02/0x02
"""

SHARED = """[can-raw]
command_id = 0x601
setpoint_id = 0x201
reply_id = 0x281
counts_per_mm = 100
setpoint = {position.1:i16le} {position.2:i16le} {position.3:i16le} {position.4:i16le}
enable = A1
position_reply = {position.1:i24le} {position.2:i24le} {status:u8}
"""

APART = """[can-raw]
command_id = 0x601
reply_id = 0x281
status_id = 0x701, 0x701, 0x702, 0x702, 0x703, 0x703
startup1 = 2F 10 {counter:u8} -> 60 ..
enable = B1
counts_per_mm = 100
setpoint = 10 {position:i32le}
position_reply = {position:i32le} {torque:i16be}
status_reply = {status.1:u8} {fault.1:u16le} {status.2:u8} {fault.2:u16le} {sum}
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


def canopen_is_read_as_it_is_sent(heaved):
    """PDOs as they are mapped, telemetry where it is asked for."""
    text = (TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8")
    text = re.sub(r"^(counts_per_mm|zero_counts) =.*$", "", text, flags=re.MULTILINE)
    plain = load_database(heaved, text.replace("[cia402]", "[cia402]\ncounts_per_mm = -1000\nzero_counts = 5000"))
    assert {message.name for message in plain.messages} == {f"drive{drive}_{kind}" for drive in range(1, 7) for kind in ("command", "answer", "emergency")}
    signals = plain.get_message_by_frame_id(0x202).decode(b"\x0f\x00" + (-5000).to_bytes(4, "little", signed=True))
    assert signals["controlword"] == 15 and abs(signals["target"] - 10) < 1e-9, signals
    signals = plain.get_message_by_name("drive2_answer").decode(b"\x37\x12" + (5000).to_bytes(4, "little") + b"\x08")
    assert (signals["statusword"], signals["mode"]) == (0x1237, 8) and abs(signals["actual"]) < 1e-9, signals
    signals = plain.get_message_by_frame_id(0x083).decode(bytes.fromhex("1023210102030405"))
    assert (signals["code"], signals["register"]) == (0x2310, 0x21), signals
    told = load_database(heaved, text.replace("[cia402]", "[cia402]\ncounts_per_mm = 1000\ntell_torque = yes\ntell_following_error = yes\ntell_inputs = yes"))
    signals = told.get_message_by_frame_id(0x286).decode((-125).to_bytes(2, "little", signed=True) + (500).to_bytes(4, "little"))
    assert abs(signals["torque"] + 12.5) < 1e-9 and abs(signals["following_error"] - 0.5) < 1e-9, signals
    assert told.get_message_by_frame_id(0x386).decode(b"\x05\0\x01\0") == {"inputs": 0x10005}
    text = re.sub("^nodes.*", "nodes = 1.1, 1.2, 2.1, 2.2, 3.1, 3.2", text, flags=re.MULTILINE)
    pairs = load_database(heaved, text.replace("[cia402]", "[cia402]\ncounts_per_mm = 1000"))
    assert pairs.get_message_by_frame_id(0x301).name == "drive2_command" and pairs.get_message_by_frame_id(0x283).name == "drive6_answer"
    assert {message.name for message in pairs.messages if "emergency" in message.name} == {f"drive{drive}_emergency" for drive in (1, 3, 5)}
    maps = "command_map = 1: 0x6040/16 0x6840/16, 2: 0x607A/32 0x687A/32\nanswer_map = 1: 0x6041/16 0x6841/16 0x2100/8, 2: 0x6064/32 0x6864/32\nmap_written = no"
    shared = load_database(heaved, text.replace("[cia402]", f"[cia402]\ncounts_per_mm = 1000\n{maps}"))
    signals = shared.get_message_by_frame_id(0x302).decode((1000).to_bytes(4, "little") + (-2000).to_bytes(4, "little", signed=True))
    assert abs(signals["target_drive3"] - 1) < 1e-9 and abs(signals["target_drive4"] + 2) < 1e-9, signals
    assert shared.get_message_by_frame_id(0x181).decode(bytes.fromhex("3712210007"))["x2100_00_drive1"] == 7


def bits_and_floats_are_read_as_they_are_sent(heaved):
    """A prefix of which a field takes a part tells no frames apart: the set-point stands alone."""
    text = re.sub(r"\[can-raw\].*?(?=\n\[relays\])", BITS, PRESET.read_text(encoding="utf-8"), flags=re.DOTALL)
    database = load_database(heaved, text)
    signals = database.get_message_by_name("drive1_command").decode(bytes.fromhex("A493E070"))
    assert abs(signals["position"] - 299.5) < 1e-9 and signals["counter"] == 7 and "kind" not in signals, signals
    reply = database.get_message_by_name("drive2_reply").decode(bytes.fromhex("42F7000045"))
    assert abs(reply["position"] - 123) < 1e-9 and (reply["status"], reply["fault"]) == (2, 5), reply


def frames_that_drives_share_name_them(heaved):
    """Four, and the other two of six; the slots that are free carry nothing."""
    text = re.sub(r"\[can-raw\].*?(?=\n\[relays\])", SHARED, PRESET.read_text(encoding="utf-8"), flags=re.DOTALL)
    database = load_database(heaved, text)
    assert sorted(message.frame_id for message in database.messages) == [0x201, 0x202, 0x281, 0x282, 0x283, *range(0x601, 0x607)], database.messages
    signals = database.decode_message(0x202, struct.pack("<4h", 1000, 2000, 0, 0))
    assert signals == {"drive5_position": 10, "drive6_position": 20}, signals
    signals = database.decode_message(0x282, bytes.fromhex("E80300 D00700 05"))
    assert signals == {"drive3_position": 10, "drive4_position": 20, "status": 5}, signals


def a_status_apart_is_a_message_of_its_own(heaved):
    text = re.sub(r"\[can-raw\].*?(?=\n\[relays\])", APART, PRESET.read_text(encoding="utf-8"), flags=re.DOTALL)
    database = load_database(heaved, text)
    command = database.get_message_by_frame_id(0x602)
    assert sorted(map(str, command.get_signal_by_name("kind").choices.values())) == ["enable", "setpoint", "startup1"], command
    assert command.decode(bytes.fromhex("2F10070000"))["counter"] == 7
    assert database.decode_message(0x283, struct.pack("<i", 1000) + struct.pack(">h", -3)) == {"position": 10, "torque": -3}
    signals = database.decode_message(0x702, bytes.fromhex("01 3412 02 7856 00"))
    assert signals == {"drive3_status": 1, "drive3_fault": 0x1234, "drive4_status": 2, "drive4_fault": 0x5678, "checksum": 0}, signals


def drives_without_frames_are_told(heaved):
    run = subprocess.run([heaved, "--config", TOP / "config/demo-hexapod.ini", "--dump-dbc"], capture_output=True, text=True, check=False)
    assert run.returncode == 78 and "can-raw, cia402" in run.stderr and not run.stdout, run


CASES = [
    ("counters, check bytes and fields of 24 bits have their places", sealed_map_is_read_as_it_is_sent),
    ("the preset's DBC file reads what is sent", preset_is_read_as_it_is_sent),
    ("a DBC file of 29-bit, big-endian, signed, backward frames reads what is sent", other_map_is_read_as_it_is_sent),
    ("the PDOs of CANopen drives are read as they are sent", canopen_is_read_as_it_is_sent),
    ("bit fields and floats have their places and types", bits_and_floats_are_read_as_they_are_sent),
    ("frames that drives share name the drive of each field", frames_that_drives_share_name_them),
    ("a status apart is a message of its own", a_status_apart_is_a_message_of_its_own),
    ("drives without frames of their own have no DBC file", drives_without_frames_are_told),
]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--heaved", required=True)
    options = parser.parse_args()
    tap.needs_package("cantools")
    suite = tap.Suite()
    for name, case in CASES:
        with suite.case(name):
            case(options.heaved)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
