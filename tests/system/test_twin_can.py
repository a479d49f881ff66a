#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin_can.py BIN [PART OF A NAME] - heave-twin on vcan, on virtual time: every row of docs/twin.md that plays a failure, and foreign masters.
Runs inside kernel.py --virtual-time --python."""
import re
import subprocess
import sys
import time

import can
import canopen
import harness
import tap
import vcan
from canopen.profiles.p402 import BaseNode402
from plain_master import drives_node_4
from test_twin import FIXED, is_led_up
from twin_bench import COUNTS_PER_MM, TwinBench, WithTwin, in_a_hurry

ROW = re.compile(r"^\| (.+) \| `([^`]+)` \| ([\w -]+) \|$", re.MULTILINE)
SETTLE_S = 3     # after a fault has struck
PATIENCE_S = 12  # a platform that shall not come up has not by then


TWO_AXES = {"nodes": "1.1, 1.2, 2.1, 2.2, 3.1, 3.2, 4"}
TAKES_ITS_TORQUE = "drives with frames of their own take their torque"  # has a map without `enable`
STRIKES_WHILE_RISING = ("+1 jam 3", "+1 ignore 3")  # a second after torque, and what stands already shows nothing
# What the sections of the page say of their configurations.
SECTIONS = {"": {}, "On nodes with several axes": TWO_AXES, "With fixed maps": {"more": FIXED}, "With node guarding": {"more": "error_control = node-guarding"},
            "With a start-up list": {"more": "[cia402-startup]\n0x6083:00 = 100000 u32"},
            "On drives with CAN frames of their own": {"frames": "rich"}}


def rows():
    """[(what, line, says, options of the bench)]"""
    text = (harness.TOP / "docs/twin.md").read_text(encoding="utf-8").split("## Each failure of Modbus")[0]
    first, *others = re.split(r"^### (?=On |With )", text, flags=re.MULTILINE)
    found = [(heading, row) for heading, part in [("", first), *(part.split("\n", 1) for part in others)] for row in ROW.findall(part)]
    return [(*row, {"frames": "selfish"} if row[0].startswith(TAKES_ITS_TORQUE) else SECTIONS[heading]) for heading, row in found]


def plays(line, says):
    def case(bench):
        try:
            play(bench, line, says)
        finally:
            vcan.fast()
            subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    return case


def play(bench, line, says):
    bench.start_twin("--fault", line)
    time.sleep(1 if line.startswith("0") else 0)
    bench.start()
    if says == "not enabled":
        time.sleep(PATIENCE_S)
        assert bench.status()["state"] not in ("RISING", "ENGAGED"), bench.status()["state"]
        assert not any(drive["set_points"] for drive in bench.twin_status()["drives"]), "somebody had torque"
        return
    if line.startswith("+"):
        harness.wait_for(lambda: f"s: {line.split(' ', 1)[1]}" in bench.twin_log.read_text(encoding="utf-8"), "the line is played")
    if says == "goes on":
        bench.wait_state("ENGAGED")
        time.sleep(1)
        assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]
        return
    bench.wait_state("FAULT")
    time.sleep(SETTLE_S)
    status = bench.status()
    assert (status["state"], status["fault"]["name"]) == ("FAULT", says), status["fault"]
    if says != "bus-lost" or not bench.has_own_frames:  # such drives have no watchdog
        bench.await_no_torque(but=[3] if "ignore" in line else [])


# --- Foreign masters ---

def dictionary():
    """What a user's EDS would say; objects are the standard's."""
    book = canopen.ObjectDictionary()

    def add(index, sub, kind, name, owner=None):
        variable = canopen.objectdictionary.ODVariable(name, index, sub)
        variable.data_type = kind
        owner.add_member(variable) if owner is not None else book.add_object(variable)

    types = canopen.objectdictionary.datatypes
    for index, kind, name in ((0x6040, types.UNSIGNED16, "Controlword"), (0x6041, types.UNSIGNED16, "Statusword"), (0x6060, types.INTEGER8, "Modes of operation"),
                              (0x6061, types.INTEGER8, "Modes of operation display"), (0x6064, types.INTEGER32, "Position actual value"),
                              (0x607A, types.INTEGER32, "Target position"), (0x6081, types.UNSIGNED32, "Profile velocity"),
                              (0x6098, types.INTEGER8, "Homing method"), (0x6502, types.UNSIGNED32, "Supported drive modes"), (0x1017, types.UNSIGNED16, "Heartbeat")):
        add(index, 0, kind, name)
    speeds = canopen.objectdictionary.ODRecord("Homing speeds", 0x6099)
    book.add_object(speeds)
    for sub in (0, 1, 2):
        add(0x6099, sub, types.UNSIGNED8 if sub == 0 else types.UNSIGNED32, f"speed {sub}", speeds)
    for base, subs in ((0x1400, (0, 1, 2)), (0x1800, (0, 1, 2, 3, 5))):
        for number in range(4):
            record = canopen.objectdictionary.ODRecord(f"PDO {base + number:X}", base + number)
            mapping = canopen.objectdictionary.ODArray(f"mapping {base + number + 0x200:X}", base + number + 0x200)
            book.add_object(record)
            book.add_object(mapping)
            for sub in subs:
                add(base + number, sub, {0: types.UNSIGNED8, 1: types.UNSIGNED32, 2: types.UNSIGNED8}.get(sub, types.UNSIGNED16), f"sub {sub}", record)
            for sub in range(9):
                add(base + number + 0x200, sub, types.UNSIGNED8 if sub == 0 else types.UNSIGNED32, f"sub {sub}", mapping)
    return book


def canopens_profile_homes_and_drives_it(bench):
    """The package canopen and its profile 402: somebody else's states, SDO and PDOs."""
    bench.start_twin("--start", "20")
    network = canopen.Network()
    network.connect(interface="socketcan", channel="vcan0")
    try:
        node = BaseNode402(2, dictionary())
        network.add_node(node)
        time.sleep(0.5)
        for number in (1, 2):
            node.tpdo[number].read()
            node.tpdo[number].event_timer = 10
            node.tpdo[number].save()
        node.setup_402_state_machine()
        node.sdo[0x6099][1].raw = 20 * COUNTS_PER_MM
        node.sdo[0x6098].raw = 17
        node.nmt.state = "OPERATIONAL"
        node.op_mode = "HOMING"
        assert node.homing(timeout=10, restore_op_mode=False), "homing does not end"
        assert abs(bench.twin_status()["drives"][1]["position"]) < 0.1, bench.twin_status()["drives"][1]
        node.state = "SWITCHED ON"
        node.op_mode = "PROFILED POSITION"
        node.sdo[0x6081].raw = 30 * COUNTS_PER_MM
        node.state = "OPERATION ENABLED"
        node.sdo[0x607A].raw = 42 * COUNTS_PER_MM
        for word in (0x0F, 0x1F):
            node.sdo[0x6040].raw = word
        time.sleep(3)
        assert abs(bench.twin_status()["drives"][1]["position"] - 42) < 0.1, bench.twin_status()["drives"][1]
        assert abs(node.sdo[0x6064].raw - 42 * COUNTS_PER_MM) < 100
        node.state = "SWITCH ON DISABLED"
    finally:
        network.disconnect()


def plain_frames_drive_it(bench):
    bench.start_twin()
    time.sleep(0.5)
    drives_node_4(bench, can.Bus(interface="socketcan", channel="vcan0"))


def canopen_drives_the_second_axis_of_a_node(bench):
    """The package canopen: the objects of a node's second axis are 800h further, its PDOs 40h; the first axis stays where it is."""
    bench.start_twin("--start", "20")
    network = canopen.Network()
    network.connect(interface="socketcan", channel="vcan0")
    try:
        node = network.add_node(1, canopen.ObjectDictionary())
        time.sleep(0.5)

        def write(index, sub, value, size):
            node.sdo.download(index, sub, value.to_bytes(size, "little", signed=value < 0))

        def read(index, sub=0):
            return int.from_bytes(node.sdo.upload(index, sub), "little")

        assert read(0x1A40) > 0 and read(0x1840, 1) & 0x80000000, "the PDOs of the second axis are off until somebody maps them"
        write(0x6860, 0, 1, 1)
        write(0x6881, 0, 30 * COUNTS_PER_MM, 4)
        node.nmt.state = "OPERATIONAL"
        for word in (0x06, 0x07, 0x0F):
            write(0x6840, 0, word, 2)
            time.sleep(0.3)
        assert read(0x6841) & 0x6F == 0x27, hex(read(0x6841))
        assert read(0x6041) & 0x6F == 0x40, hex(read(0x6041))
        write(0x687A, 0, 42 * COUNTS_PER_MM, 4)
        write(0x6840, 0, 0x1F, 2)
        time.sleep(2)
        drives = bench.twin_status()["drives"]
        assert abs(drives[1]["position"] - 42) < 0.1, drives[1]
        assert abs(drives[0]["position"] - 20) < 0.1, drives[0]
        assert abs(read(0x6864) - 42 * COUNTS_PER_MM) < 100
    finally:
        network.disconnect()


def two_axes_rise_and_fail(bench):
    """heaved and nodes of two axes on SocketCAN: the platform rises, the loss of one axis is named, nothing comes back by itself."""
    bench.start_twin()
    bench.start()
    bench.wait_state("ENGAGED")
    bench.do("lose 4 400")
    bench.wait_state("FAULT")
    fault = bench.status()["fault"]
    assert (fault["name"], fault["axis"]) == ("drive-offline", 4), fault
    time.sleep(SETTLE_S)
    assert bench.status()["state"] == "FAULT", "it came back by itself"
    bench.ctl("reset")
    harness.wait_for(lambda: bench.status()["state"] != "FAULT", "the reset leads out")


# --- Ready-made files of drive families ---

PRESETS = sorted((harness.TOP / "config/cia402").glob("*.ini"))


class PresetBench(WithTwin):
    """A preset as it is, but for its bus and for a busy machine."""

    def __init__(self, bin_dir, preset):
        super().__init__(bin_dir)
        text = preset.read_text(encoding="utf-8")
        for key, value in (("interface = can0", "interface = vcan0"), ("engage = manual", "engage = manual\nlate_hold_cycles = 0"), ("port = 9800", f"port = {self.port}")):
            assert text.count(f"{key}\n") == 1, key
            text = text.replace(f"{key}\n", f"{value}\n")
        if "accept_without" in text:
            run = self.heaved("--config", preset, "--check")
            assert run.returncode == 78 and run.stderr.count("\n") == 1 and "stop_confirmed = yes where somebody has tried it" in run.stderr, run.stderr
            text = text.replace("accept_without", "stop_confirmed = yes\naccept_without")
        self.config.write_text(f"{in_a_hurry(text)}\n[control]\nsocket = {self.socket}\n", encoding="utf-8")


def preset_rides(bench):
    """heaved and drives that have the objects of its list: they come up with what the list says, the platform rises, follows, and parks. A drive that holds
    another value is refused with the object's name."""
    listed = re.findall(r"^0x(\w+):(?:0x)?(\w+) = ", bench.config.read_text(encoding="utf-8"), re.MULTILINE)
    bench.start_twin()
    bench.start()
    engage(bench)
    with bench.sender() as sender:
        sender.send("@A6T:2,1,0,0,0,10,1500#")
        time.sleep(2)
    assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]
    for leg, drive in zip(bench.status()["cylinders"], bench.twin_status()["drives"]):
        assert abs(leg["actual_mm"] - drive["position"]) < 1 and drive["set_points"] > 100, (leg, drive)
    bench.do("fault 2 0x2310")
    assert bench.wait_state("FAULT")["fault"]["name"] == "drive-fault"
    bench.await_no_torque()
    bench.ctl("reset")
    bench.wait_state("OFF")
    for index, sub in listed[:1]:
        bench.end_twin()
        bench.start_twin("--fault", f"0 object 3 {index}:{sub} 1")
        bench.ctl("reset")
        harness.wait_for(lambda: bench.status()["cylinders"][2].get("report", {}).get("phase") == "refused", "drive 3 is refused")
        report = bench.status()["cylinders"][2]["report"]
        assert (report["object"], report["sub_index"]) == (int(index, 16), int(sub, 16)), report
        bench.do("mend 3")
        bench.ctl("reset")
        harness.wait_for(lambda: bench.status()["state"] == "OFF", "the reset leads out")
        engage(bench)


def engage(bench):
    assert bench.ctl("--wait", "engage").returncode == 0
    status = bench.wait_state("ENGAGED", "FAULT")
    assert status["state"] == "ENGAGED", f"{status['fault']} {status['cylinders']}"


# --- A pair of interfaces ---

PAIR = ("vxcan0", "vxcan1")


def follows_on_a_pair(bench):
    """heaved at one end, the drives at the other; the cable is out at heaved's end, where the interface says so."""
    subprocess.run(["ip", "link", "add", PAIR[0], "type", "vxcan", "peer", "name", PAIR[1]], check=True)
    try:
        for name in PAIR:
            subprocess.run(["ip", "link", "set", name, "txqueuelen", "100", "up"], check=True)
        bench.start_twin("--interface", PAIR[1])
        bench.start()
        bench.wait_state("ENGAGED")
        with bench.sender() as sender:
            sender.send("@A6T:0,0,0,0,0,20,1500#")
            time.sleep(2)
        twin, status = bench.twin_status(), bench.status()
        for leg, drive in zip(status["cylinders"], twin["drives"]):
            assert abs(leg["actual_mm"] - drive["position"]) < 2 and drive["set_points"] > 200, (leg, drive)
        for line, mend in (("cable-out", "cable-in"), ("down", "up")):
            bench.do(line)
            bench.wait_state("FAULT")
            assert bench.status()["fault"]["name"] == "bus-lost", f"{line}: {bench.status()['fault']}"
            bench.do(mend)
            harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)
    finally:
        bench.end_twin()
        subprocess.run(["ip", "link", "del", PAIR[0]], check=True)


CASES = [(f"docs/twin.md{' with a configuration of its own' if options else ''}: {line}: {says}, {what}", plays(line, says),
          {**options, "rises_fast": line not in STRIKES_WHILE_RISING}) for what, line, says, options in rows()] + [
    ("masters: the package canopen and its profile 402 home and drive it", canopens_profile_homes_and_drives_it, {}),
    ("masters: the package canopen drives the second axis of a node", canopen_drives_the_second_axis_of_a_node, TWO_AXES),
    ("nodes: drives of two axes on SocketCAN rise, and one fails", two_axes_rise_and_fail, TWO_AXES),
    ("masters: frames by python-can home it and drive it in a cyclic mode", plain_frames_drive_it, {}),
    ("pair: the drives at the other end of vxcan", follows_on_a_pair, {"interface": PAIR[0]}),
]


def main():
    suite = tap.Suite()
    seen = set()
    for name, case, options in CASES:
        played = (name.split(",")[0], str(options))  # a line that plays several rows counts once
        if played in seen or (len(sys.argv) > 2 and not re.search(sys.argv[2], name)):
            continue
        seen.add(played)
        with suite.case(name), TwinBench(sys.argv[1], **{"interface": "vcan0", **options}) as bench:
            case(bench)
    for preset in PRESETS:
        name = f"preset: config/cia402/{preset.name} on drives that have its objects"
        if len(sys.argv) <= 2 or re.search(sys.argv[2], name):
            with suite.case(name), PresetBench(sys.argv[1], preset) as bench:
                preset_rides(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
