#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_doctor.py BIN [PART OF A NAME] - heaved --doctor on heave-twin's drives, one fault at a time, on vcan, on virtual time. Runs inside kernel.py."""
import re
import socket
import subprocess
import sys
import time

import can
import harness
import tap
import vcan
from test_can import can_config
from twin_bench import WithTwin

RAW_PRESET = harness.TOP / "config/can-raw-hexapod.ini"
SERIAL_PRESET = harness.TOP / "config/modbus/iai-robo-cylinder.ini"
MODBUS_PRESET = harness.TOP / "config/modbus-tcp-hexapod.ini"


class DoctorBench(WithTwin):
    def __init__(self, bin_dir):
        super().__init__(bin_dir)
        self.config = can_config(self)

    def __exit__(self, *exception):
        vcan.fast()
        super().__exit__(*exception)

    def start_drives(self, *faults):
        """They have started, and have what is wrong with them."""
        self.start_twin(*(word for line in faults for word in ("--fault", line)))
        time.sleep(1)


def link(*arguments):
    subprocess.run(["ip", "link", "set", "vcan0", *arguments], check=True)


def doctor(bench, config, code, *expected):
    """Findings of a run: (level, text with its remedy). Each expected text is in exactly one of the bad ones, and no other FAIL is there."""
    result = bench.heaved("--config", config, "--doctor")
    assert result.returncode == code, f"{result.returncode}\n{result.stdout}{result.stderr}"
    *lines, total = result.stdout.rstrip("\n").split("\n")
    rows = re.findall(r"^(ok|warn|FAIL)\s+(.*)$", re.sub(r"\n +->", " ->", "\n".join(lines)), re.MULTILINE)
    count = {level: sum(row[0] == level for row in rows) for level in ("ok", "warn", "FAIL")}
    assert total == f"{count['ok']} ok, {count['warn']} to look at, {count['FAIL']} wrong", total
    assert all(" -> " in text for level, text in rows if level != "ok"), result.stdout
    for text in expected:
        assert sum(text in row for level, row in rows if level != "ok") == 1, f"{text}\n{result.stdout}"
    fails = [text for level, text in rows if level == "FAIL"]
    assert all(any(text in row for text in expected) for row in fails), result.stdout
    return rows


def with_keys(bench, config, **keys):
    text = config.read_text(encoding="utf-8")
    for key, value in keys.items():
        text = text.replace("[cia402]\n", f"[cia402]\n{key} = {value}\n")
    return bench.file("changed.ini", text)


# --- Cases ---

def sound(bench, config):
    bench.start_drives()
    rows = doctor(bench, config, 0)
    assert sum(level == "ok" and "switch on disabled" in text for level, text in rows) == 7, rows
    assert all(level == "ok" for level, _ in rows), rows


def inventory_is_ready_to_paste(bench, config):
    """What it prints goes into [cia402] as it is, and the next run has nothing to say; with another drive's number it has."""
    bench.start_drives()
    output = bench.heaved("--config", config, "--doctor").stdout
    pasted = output.split("; the drives that were found", 1)[1].rsplit("\n", 2)[0].split("\n", 1)[1]
    assert "; drive 1, node 1: heave-twin" in pasted and re.search(r"^serial_numbers = 0x", pasted, re.MULTILINE), output
    text = config.read_text(encoding="utf-8")
    for line in pasted.splitlines():
        text = re.sub(rf"^{line.split(' ')[0]} = .*\n", "", text, flags=re.MULTILINE) if " = " in line else text
    doctor(bench, bench.file("pasted.ini", text.replace("[cia402]\n", f"[cia402]\n{pasted}\n")), 0)
    wrong = re.sub(r"^serial_numbers = 0x\w+", "serial_numbers = 0xBEEF", pasted, flags=re.MULTILINE)
    doctor(bench, bench.file("wrong.ini", text.replace("[cia402]\n", f"[cia402]\n{wrong}\n")), 1, "serial_numbers is")


def writes_nothing(bench, config):
    bench.start_drives()
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        doctor(bench, config, 0)
        heard = []
        while (message := bus.recv(0)) is not None:
            heard.append(message)
    sent = [message for message in heard if 0x600 <= message.arbitration_id < 0x680]
    assert len(sent) > 100 and all(message.data[0] in (0x40, 0x60, 0x70) for message in sent), "something else than reading"
    own = {message.arbitration_id for message in heard} - {base + node for base in (0x580, 0x700, 0x180, 0x280, 0x80) for node in range(1, 8)} - set(range(0x601, 0x680))
    assert not own, own


def missing_interface(bench, config):
    text = config.read_text(encoding="utf-8").replace("interface = vcan0", "interface = can7")
    doctor(bench, bench.file("other.ini", text), 1, "there is no interface can7", "have not been asked")


def no_can_interface(bench, config):
    text = config.read_text(encoding="utf-8").replace("interface = vcan0", "interface = lo")
    doctor(bench, bench.file("other.ini", text), 1, "lo is not a CAN interface", "have not been asked")


def interface_down(bench, config):
    link("down")
    try:
        doctor(bench, config, 1, "ip link set vcan0 up", "have not been asked")
    finally:
        link("up")


def short_queue(bench, config):
    bench.start_drives()
    link("txqueuelen", "10")
    try:
        doctor(bench, config, 0, "txqueuelen is 10, not 16 -> ip link set vcan0 txqueuelen 16")
    finally:
        link("txqueuelen", "16")


def missing_node(bench, config):
    bench.start_drives("0 power-off 4")
    doctor(bench, config, 1, "node 4 (drive 4) does not answer")


def no_drive_at_all(bench, config):
    doctor(bench, config, 1, *(f"node {node} (drive {node}) does not answer" for node in range(1, 8)))


def nobody_acknowledges(bench, config):
    """Cable off: one finding, not one for each drive."""
    subprocess.run("tc qdisc replace dev vcan0 root tbf rate 8bit burst 16 limit 1600".split(), check=True)
    try:
        doctor(bench, config, 1, "nobody acknowledges on vcan0 (what was sent never left")
    finally:
        vcan.fast()


def wrong_identity(bench, config):
    bench.start_drives("0 object 2 1018:1 0x9A")
    doctor(bench, with_keys(bench, config, vendor_id=0x2E5), 1, "node 2: vendor_id is 154 (0x9A), configured 741")


def not_402(bench, config):
    bench.start_drives("0 object 5 1000 0x20191")
    doctor(bench, config, 1, "node 5 is no CiA 402 drive (1000h = 0x20191)")


def missing_watchdog(bench, config):
    bench.start_drives("0 missing 6 6007")
    doctor(bench, config, 1, "node 6 has no watchdog 6007h")
    doctor(bench, with_keys(bench, config, accept_without="605E, 6007", stop_confirmed="yes"), 0, "node 6 has no watchdog 6007h")


def watchdogs_off(bench, config):
    bench.start_drives("0 object 1 6007 0", "0 object 1 605A 0")
    rows = doctor(bench, config, 0)
    assert any("node 1: watchdogs off until heaved sets them" in text and "6007h 605Ah" in text for level, text in rows), rows


def no_such_mode(bench, config):
    bench.start_drives("0 object 3 6502 0x61")
    doctor(bench, config, 1, "node 3 does not have mode csp (6502h = 0x61) -> [cia402] mode = ip")


def no_mapping(bench, config):
    bench.start_drives(*(f"0 missing 3 1A00:{sub}" for sub in range(9)))
    doctor(bench, config, 1, "node 3: 1A00h cannot be read: there is no such object")


def drive_in_fault(bench, config):
    bench.start_drives("0.4 fault 7 0x2310")
    doctor(bench, config, 1, "node 7 is in fault, 603Fh = 2310h: continuous over-current")


def two_drives_with_one_number(bench, config):
    bench.start_drives("0 node 2 1")
    doctor(bench, config, 1, "two drives have this number", "node 2 (drive 2) does not answer")


def another_master(bench, config):
    bench.start_drives()
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        sync = bus.send_periodic(can.Message(arbitration_id=0x80, data=b"", is_extended_id=False), 0.01)
        doctor(bench, config, 1, "another master")
        sync.stop()


def unknown_node(bench, config):
    bench.start_drives()
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        beat = bus.send_periodic(can.Message(arbitration_id=0x70C, data=b"\x7f", is_extended_id=False), 0.1)
        doctor(bench, config, 0, "node 12 is on the bus and not in [cia402] nodes")
        beat.stop()


def unknown_node_without_heartbeat(bench, config):
    """It speaks only where it is asked."""
    bench.start_drives()
    with can.Bus(interface="socketcan", channel="vcan0") as bus:
        def answer(message):
            if message.arbitration_id == 0x60C:
                bus.send(can.Message(arbitration_id=0x58C, data=b"\x80" + message.data[1:4] + b"\x00\x00\x02\x06", is_extended_id=False))
        listener = can.Notifier(bus, [answer])
        rows = doctor(bench, config, 0, "node 12 is on the bus and not in [cia402] nodes")
        listener.stop()
        assert sum("is on the bus and not" in text for _, text in rows) == 1, rows


def port_in_use(bench, config):
    bench.start_drives()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", bench.port))
        doctor(bench, config, 1, "ss -ulpn")


def running_daemon(bench, config):
    bench.start_drives()
    daemon = bench.start(config=config)
    result = bench.heaved("--config", config, "--doctor")
    assert result.returncode == 1 and "heaved is running" in result.stdout and "heavectl status" in result.stdout, result.stdout
    assert bench.stop(daemon) == 0


def drives_with_frames_of_their_own(bench, _config):
    text = RAW_PRESET.read_text(encoding="utf-8").replace("interface = can0", "interface = vcan0").replace("port = 9800", f"port = {bench.port}")
    bench.config = bench.file("raw.ini", f"{text}\n[control]\nsocket = {bench.socket}\n")
    bench.start_drives("0 power-off 6")
    rows = doctor(bench, bench.config, 1, "drive 6: nothing with identifier 586h")
    assert [text for level, text in rows if "answers with" in text] == [f"drive {k + 1} answers with identifier {0x581 + k:X}h" for k in range(5)], rows


def drives_on_modbus(bench, _config):
    hosts = ", ".join(f"127.0.0.1:{3501 + k}" for k in range(6))
    text = re.sub("hosts = .*", f"hosts = {hosts}", MODBUS_PRESET.read_text(encoding="utf-8")).replace("port = 9800", f"port = {bench.port}")
    bench.config = bench.file("modbus.ini", f"{text}\n[control]\nsocket = {bench.socket}\n")
    doctor(bench, bench.config, 1, *(f"127.0.0.1:{3501 + k}: the connection is refused" for k in range(6)))
    bench.start_drives("0 power-off 4", "0 exception 2 1000 2", "0 lose 5 1")
    rows = doctor(bench, bench.config, 1, "drive 4: unit 1 does not answer", "drive 2: unit 1 refuses to read registers 256 to 259, exception 2")
    assert [text for level, text in rows if "answers as" in text] == [f"drive {k} answers as unit 1" for k in (1, 3, 5, 6)], rows


def serial_line_without_its_adapter(bench, _config):
    text = SERIAL_PRESET.read_text(encoding="utf-8").replace("port = 9800", f"port = {bench.port}").replace("drive_timeout_confirmed = no", "drive_timeout_confirmed = yes")
    doctor(bench, bench.file("serial.ini", f"{text}\n[control]\nsocket = {bench.socket}\n"), 1, "usb-your-adapter: there is no such serial device")


CASES = [
    ("sound drives: nothing is wrong", sound),
    ("its inventory is ready to paste", inventory_is_ready_to_paste),
    ("reads, and sends nothing else", writes_nothing),
    ("an interface that is not there", missing_interface),
    ("an interface of another kind", no_can_interface),
    ("an interface that is down", interface_down),
    ("a queue of another length", short_queue),
    ("a node that does not answer", missing_node),
    ("no drive at all", no_drive_at_all),
    ("a bus on which nobody acknowledges", nobody_acknowledges),
    ("a drive of another maker", wrong_identity),
    ("a node that is no CiA 402 drive", not_402),
    ("a drive without a watchdog", missing_watchdog),
    ("a drive whose watchdogs are off", watchdogs_off),
    ("a drive without the mode", no_such_mode),
    ("a drive without mapping", no_mapping),
    ("a drive in fault", drive_in_fault),
    ("two drives with one number", two_drives_with_one_number),
    ("another master on the bus", another_master),
    ("a node that nobody has configured", unknown_node),
    ("a node that nobody has configured, without a heartbeat", unknown_node_without_heartbeat),
    ("a UDP port in use", port_in_use),
    ("a daemon that runs", running_daemon),
    ("drives with frames of their own, one of them missing", drives_with_frames_of_their_own),
    ("drives on Modbus, before they run and with faults", drives_on_modbus),
    ("a serial line without its adapter", serial_line_without_its_adapter),
]


def main():
    suite = tap.Suite()
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case in CASES:
        if wanted not in name:
            continue
        with suite.case(name), DoctorBench(sys.argv[1]) as bench:
            case(bench, bench.config)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
