#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_peers.py - the simulated drives themselves, against a master made of the package canopen. Runs in a kernel with CAN, on virtual time."""
import json
import logging
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import canopen
from canopen.sdo.exceptions import SdoAbortedError

import tap

HERE = Path(__file__).resolve().parent
PERIOD_S = 0.004


class Master:
    """SYNC, set-points and a heartbeat from this thread, answers from canopen's."""

    def __init__(self, *drives, plan=()):
        self.folder = tempfile.TemporaryDirectory(prefix="heave-")
        self.log = Path(self.folder.name) / "events"
        config = Path(self.folder.name) / "drives.json"
        config.write_text(json.dumps({"log": str(self.log), "drives": list(drives), "plan": list(plan)}), encoding="utf-8")
        self.process = subprocess.Popen([sys.executable, HERE / "can_drives.py", config, "--follow"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self.network = canopen.Network()
        self.network.connect(interface="socketcan", channel="vcan0")
        self.heard = []
        self.network.subscribe(0x081, lambda *frame: self.heard.append(frame))
        self.network.subscribe(0x181, lambda *frame: self.heard.append(frame))
        self.network.subscribe(0x281, lambda *frame: self.heard.append(frame))
        self.network.subscribe(0x701, lambda *frame: self.heard.append(frame))
        assert self.process.stdout.readline() == b"ready\n"
        self.node = self.network.add_node(1, canopen.ObjectDictionary())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.network.disconnect()
        self.process.stdin.close()
        self.process.wait(timeout=20)
        self.process.stdout.close()
        self.folder.cleanup()

    def do(self, action, drive=1, **arguments):
        self.process.stdin.write(json.dumps({"drive": drive, "do": action, **arguments}).encode() + b"\n")
        self.process.stdin.flush()
        time.sleep(0.02)

    def events(self, name):
        rows = [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()]
        return [row["value"] for row in rows if row["event"] == name]

    def write(self, index, sub, kind, value):
        self.node.sdo.download(index, sub, struct.pack("<" + kind, value))

    def read(self, index, sub, kind):
        return struct.unpack("<" + kind, self.node.sdo.upload(index, sub))[0]

    def refused(self, index, sub, kind, value):
        try:
            self.write(index, sub, kind, value)
        except SdoAbortedError as error:
            return error.code
        return 0

    def nmt(self, command, node=1):
        self.network.send_message(0, [command, node])
        time.sleep(0.01)

    def sync(self, target=None, word=0x0F, count=1):
        for _ in range(count):
            self.network.send_message(0x080, b"")
            if target is not None:
                self.network.send_message(0x201, struct.pack("<Hi", word, target))
            time.sleep(PERIOD_S)

    def status(self):
        """State bits and position of the last TPDO1."""
        word, position = struct.unpack("<Hi", [data for cob_id, data, _ in self.heard if cob_id == 0x181][-1])
        return word & 0x6F, position, word

    def map_pdos(self):
        for record, cob_id, entries in ((0x1400, 0x201, (0x60400010, 0x607A0020)), (0x1800, 0x40000181, (0x60410010, 0x60640020))):
            for number in range(4):
                self.write(record + number, 1, "I", self.read(record + number, 1, "I") | 0x80000000)
            self.write(record, 2, "B", 1)
            self.write(record + 0x200, 0, "B", 0)
            for sub, entry in enumerate(entries, 1):
                self.write(record + 0x200, sub, "I", entry)
            self.write(record + 0x200, 0, "B", len(entries))
            self.write(record, 1, "I", cob_id)

    def bring_up(self, position=0):
        time.sleep(0.35)
        self.nmt(0x80)
        self.map_pdos()
        self.write(0x60C2, 1, "B", 4)
        self.write(0x6060, 0, "b", 8)
        self.write(0x6007, 0, "h", 1)
        self.nmt(0x01)
        for word in (0x06, 0x07, 0x0F):
            self.sync(position, word, 40)


def boots_once_and_is_deaf_before():
    with Master({"node": 1}) as master:
        master.network.send_message(0x601, [0x40, 0, 0x10, 0, 0, 0, 0, 0])
        time.sleep(0.5)
        assert [data for cob_id, data, _ in master.heard if cob_id == 0x701] == [b"\0"], master.heard
        assert master.read(0x1000, 0, "I") == 0x00020192 and master.node.sdo.upload(0x1008, 0) == b"simulated drive"


def mapping_rules_are_strict():
    with Master({"node": 1}) as master:
        time.sleep(0.35)
        found = [master.refused(0x1600, 1, "I", 0x607A0020), master.refused(0x1600, 0, "B", 0), master.refused(0x1400, 1, "I", 0x207)]
        assert found == [0x06010000, 0x06010000, 0x06090030], [hex(code) for code in found]
        master.write(0x1400, 1, "I", 0x80000201)
        assert master.refused(0x1600, 1, "I", 0x607A0020) == 0x06010000
        master.write(0x1600, 0, "B", 0)
        found = [master.refused(0x1600, 1, "I", entry) for entry in (0x60410010, 0x607A0010, 0x55550010, 0x60C10520)]
        assert found == [0x06040041, 0x06040041, 0x06020000, 0x06090011], [hex(code) for code in found]
        for sub, entry in enumerate((0x607A0020, 0x60C10120, 0x60600008), 1):
            master.write(0x1600, sub, "I", entry)
        assert master.refused(0x1600, 0, "B", 3) == 0x06040042
        assert master.refused(0x1600, 0, "B", 2) == 0x06010000, "607Ah is in RPDO2 too"
        master.write(0x1401, 1, "I", 0x80000301)
        assert master.refused(0x1400, 1, "I", 0x201) == 0x06090030, "nothing mapped"
        master.write(0x1600, 0, "B", 2)
        master.write(0x1400, 1, "I", 0x201)
        assert [master.refused(0x1401, 2, "B", 250), master.refused(0x1800, 3, "H", 5)] == [0x06090030, 0x06010000]
        assert [master.refused(0x6041, 0, "H", 1), master.refused(0x6040, 0, "I", 1), master.refused(0x6040, 0, "B", 1)] == [0x06010002, 0x06070012, 0x06070013]
        master.nmt(0x01)
        assert master.refused(0x1400, 1, "I", 0x80000201) == 0x08000022


def goes_up_follows_and_lags():
    with Master({"node": 1, "position": 1000}) as master:
        master.bring_up(1000)
        assert master.status()[:2] == (0x27, 1000) and master.status()[2] & 0x1000, master.status()
        for step in range(1, 101):
            master.sync(1000 + 40 * step)
        lag = 5000 - master.status()[1]
        assert 0 < lag < 200, lag
        master.sync(5000, count=20)
        assert master.status()[1] == 5000
        assert master.events("fault reset") == [] and master.events("emergency") == []


def set_point_acts_one_sync_later():
    with Master({"node": 1, "lag_us": 0}) as master:
        master.bring_up()
        master.sync(400)
        master.sync(400)
        positions = []
        for _ in range(3):
            master.sync(400)
            positions.append(master.status()[1])
        assert positions[-1] == 400 and master.events("jump") == [], positions


def jump_is_a_following_error_and_only_an_edge_resets():
    with Master({"node": 1}) as master:
        master.bring_up()
        master.sync(50000, count=3)
        assert master.status()[0] == 0x08 and master.events("emergency") == [0x8611], master.status()
        master.sync(0, 0x80, 3)
        assert master.status()[0] == 0x40
        master.do("broken")
        master.sync(0, 0x00, 3)
        master.sync(0, 0x80, 3)
        assert master.status()[0] == 0x08
        master.do("repaired")
        master.sync(0, 0x80, 3)
        assert master.status()[0] == 0x08, "the bit was up already"
        master.sync(0, 0x00, 3)
        master.sync(0, 0x80, 3)
        assert master.status()[0] == 0x40


def masters_heartbeat_is_watched_from_the_first_on():
    with Master({"node": 1, "delays_us": {"power": 2000, "brake": 2000}}) as master:
        master.bring_up()
        master.write(0x1016, 1, "I", 127 << 16 | 100)
        master.sync(0, count=50)
        assert master.status()[0] == 0x27
        master.network.send_message(0x77F, [5])
        master.sync(0, count=20)
        assert master.status()[0] == 0x27
        master.sync(0, count=10)
        assert master.events("master lost") and master.events("nmt")[-1] == 0x7F, master.events("nmt")
        assert master.read(0x6041, 0, "H") & 0x4F == 0x08


def missing_set_points_are_a_fault():
    with Master({"node": 1}) as master:
        master.bring_up()
        master.sync(count=2)
        master.sync(0)
        assert master.status()[0] == 0x27
        master.sync(count=5)
        assert master.status()[0] == 0x08 and master.events("emergency") == [0x8250], master.events("emergency")


def wrong_interpolation_period_is_a_fault():
    with Master({"node": 1}) as master:
        time.sleep(0.4)
        assert [master.refused(0x60C2, 1, "B", 21), master.refused(0x60C2, 2, "b", -4)] == [0x06090030] * 2
        master.bring_up()
        master.write(0x60C2, 1, "B", 10)
        master.sync(0, count=3)
        assert master.status()[0] == 0x08 and master.events("emergency") == [0xFF10], master.events("emergency")


def homing_and_profile_position_and_interpolation():
    with Master({"node": 1, "position": 700, "home_counts": 200, "is_homed": False}) as master:
        master.bring_up(700)
        master.sync(700, 0x07, 5)
        master.write(0x6060, 0, "b", 6)
        master.sync(700, 0x0F, 40)
        assert master.status()[2] & 0x3400 == 0x0400, hex(master.status()[2])
        master.sync(700, 0x1F, 10)
        assert master.status()[2] & 0x3400 == 0, hex(master.status()[2])
        master.sync(700, 0x1F, 60)
        assert master.status()[2] & 0x3400 == 0x1400 and master.status()[1] == 0, master.status()
        for mode, rise in ((7, 0x1F), (1, 0x1F)):
            master.sync(0, 0x07, 5)
            master.write(0x6060, 0, "b", mode)
            master.write(0x60C1, 1, "i", 0)
            master.sync(0, 0x0F, 40)
            assert not master.status()[2] & 0x1000
            master.sync(300, rise, 60)
            assert master.status()[2] & 0x1000 and master.status()[1] == (0 if mode == 7 else 300), master.status()


def plan_and_trouble():
    plan = [{"after_enabled": 0.5, "drive": 1, "do": "emergency", "code": 0x4310}, {"after_enabled": 1.0, "drive": 1, "do": "reboot"}]
    with Master({"node": 1, "refuse": {"6065": 0x06020000}, "identity": [7, 8, 9, 10], "missing_objects": ["1029"]}, {"node": 2, "is_there": False},
                plan=plan) as master:
        time.sleep(0.4)
        assert master.read(0x1018, 1, "I") == 7
        assert [master.refused(0x6065, 0, "I", 1), master.refused(0x1029, 1, "B", 1)] == [0x06020000] * 2
        master.do("refuse sdo", index="6066", code=0x08000022, times=1)
        assert [master.refused(0x6066, 0, "H", 1), master.refused(0x6066, 0, "H", 1)] == [0x08000022, 0]
        master.do("sdo off")
        master.node.sdo.RESPONSE_TIMEOUT = 0.1
        try:
            master.read(0x1000, 0, "I")
            raise AssertionError("answered")
        except canopen.sdo.SdoCommunicationError:
            master.do("sdo on")
        master.bring_up()
        master.do("on", drive=2)
        assert master.events("all enabled") == [], "drive 2 is not"


def sync_supervision_drops_to_pre_operational():
    with Master({"node": 1}) as master:
        time.sleep(0.4)
        master.write(0x1006, 0, "I", 4000)
        master.nmt(0x01)
        assert master.events("start refused") == ["no SYNC"]
        master.sync(count=3)
        master.nmt(0x01)
        time.sleep(0.1)
        assert master.events("nmt") == [0x7F, 0x05, 0x7F] and master.events("emergency") == [0x8100]


CASES = [
    ("one boot-up message, deaf before it, segmented upload", boots_once_and_is_deaf_before), ("PDO mapping as the strictest stacks want it", mapping_rules_are_strict),
    ("enabled step by step, follows and lags", goes_up_follows_and_lags), ("a set-point acts at the next SYNC", set_point_acts_one_sync_later),
    ("a jump is a following error, only an edge resets", jump_is_a_following_error_and_only_an_edge_resets),
    ("the master's heartbeat is watched from the first on", masters_heartbeat_is_watched_from_the_first_on),
    ("missing set-points are a fault", missing_set_points_are_a_fault), ("60C2h must be the SYNC period", wrong_interpolation_period_is_a_fault),
    ("homing, profile position, interpolated position", homing_and_profile_position_and_interpolation),
    ("plans, refusals, silence, a missing drive", plan_and_trouble), ("SYNC supervision", sync_supervision_drops_to_pre_operational),
]


def main():
    logging.disable(logging.CRITICAL)
    suite = tap.Suite()
    for name, case in CASES:
        with suite.case(name):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
