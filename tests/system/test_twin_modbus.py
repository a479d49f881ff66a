#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin_modbus.py BIN [PART OF A NAME] - heave-twin's drives and relays on Modbus: TCP, a serial line on a pseudo terminal, a board of coils, and every
row of docs/twin.md that plays a failure of Modbus. On virtual time, as they
are late on a busy machine; no CAN is needed."""
import re
import socket
import struct
import sys
import time

import harness
import tap
import twin_bench

ROW = re.compile(r"^\| (.+) \| `([^`]+)` \| ([\w -]+) \|$", re.MULTILINE)
NEAR_MM = 2
PATIENCE_S = 8  # a platform that shall not come up has not by then
SAFE = 0x801
FRAME = "@A6:0,0,0,0,0,5,{:03X}#"


class ModbusTwin(twin_bench.TwinBench):
    """A preset's platform; relays on a board beside it where there is a place for them."""

    def __init__(self, bin_dir, preset="modbus-tcp-hexapod", board=False):
        super().__init__(bin_dir)
        text = (harness.TOP / f"config/{preset}.ini").read_text(encoding="utf-8")
        self.device = self.folder / "line"
        changes = {"engage": "auto", "port": self.port, "hosts": ", ".join(f"127.0.0.1:{harness.free_port(socket.SOCK_STREAM)}" for _ in range(6)), "device": self.device, "parity": "none",
                   "drive_timeout_confirmed": "yes", "timeout_ms": 60, "silence_hold_ms": 60000}
        for key, value in changes.items():
            text = re.sub(rf"^{key} = [^;\n]*", f"{key} = {value} ", text, flags=re.MULTILINE)
        if board:
            lines = ", ".join(str(16 + i) for i in range(12))
            text, count = re.subn(r"\[relays\][^\[]*", f"[relays]\ndriver = modbus\nlines = {lines}\nsafe_mask = {SAFE:03X}\n\n", text)
            assert count == 1
            text += f"\n[relays-modbus]\nhost = 127.0.0.1:{harness.free_port(socket.SOCK_STREAM)}\nunit = 3\n"
        self.config.write_text(f"{twin_bench.in_a_hurry(text)}\n[control]\nsocket = {self.socket}\n", encoding="utf-8")


def up(bench, *arguments):
    bench.start_twin(*arguments)
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    return daemon


def rises_and_follows(bench):
    daemon = up(bench, "--start", "20")
    with bench.sender() as sender:
        sender.send("@A6T:2,1,0,0,0,110,3000#")
        harness.wait_for(lambda: abs(bench.twin_status()["pose"][0] - 2) < 0.2, "it rolls")
        time.sleep(1)
    twin, status = bench.twin_status(), bench.status()
    for leg, drive in zip(status["cylinders"], twin["drives"]):
        assert abs(leg["actual_mm"] - drive["position"]) < NEAR_MM, (leg, drive)
        assert drive["state"] == "torque" and drive["set_points"] > 20 and drive["alarm"] == 0, drive
    assert abs(twin["pose"][1] - 1) < 0.3, twin["pose"]
    assert bench.stop(daemon) == 0
    assert {drive["state"] for drive in bench.twin_status()["drives"]} == {"no torque"}, bench.twin_status()
    assert bench.end_twin() == 0
    assert not bench.device.is_symlink(), "its link stays behind"


def backwards_is_seen(bench):
    bench.start_twin("--reverse", "4", "--start", "20")
    bench.start()
    harness.wait_for(lambda: bench.status()["cylinders"][3]["actual_mm"] is not None, "drive 4 tells where it is")
    assert abs(bench.status()["cylinders"][3]["actual_mm"] + 20) < 0.1, bench.status()["cylinders"][3]


def board_takes_the_masks(bench):
    def coils(mask):
        return [16 + i for i in range(12) if mask >> i & 1]

    daemon = up(bench)
    harness.wait_for(lambda: bench.twin_status()["coils"] == coils(SAFE), "the safe mask is on the board")
    with bench.sender() as sender:
        for mask in (0x0F0, 0xFFF, 0x005):
            harness.wait_for(lambda: sender.send(FRAME.format(mask)) or bench.twin_status()["coils"] == coils(mask), f"mask {mask:03X}")
        bench.do("relays-forget")
        harness.wait_for(lambda: bench.twin_status()["coils"] == coils(0x005), "it is told again")
        bench.do("relays-silent")
        harness.wait_for(lambda: not bench.status()["relays"]["known"], "not known")
        status = bench.status()
        assert status["state"] == "ENGAGED", (status["state"], status["fault"], daemon.log.read_text(encoding="utf-8"))
        bench.do("relays-back")
        harness.wait_for(lambda: bench.status()["relays"]["known"], "known again")
    assert bench.stop(daemon) == 0
    assert bench.twin_status()["coils"] == coils(SAFE)


def is_led_up(bench):
    state = bench.status()["state"]
    if state in ("FAULT", "OFF"):
        bench.ctl("reset" if state == "FAULT" else "engage")
    return state == "ENGAGED"


def faults_and_back(bench):
    up(bench)
    for line, faults, mend in (("fault 3", ("drive-fault",), "mend 3"), ("mute 3", ("drive-offline",), "mend 3"), ("power-off 5", ("drive-offline",), "power-on 5"),
                               ("unplug", ("bus-lost", "drive-offline"), "plug"), ("cable-out", ("bus-lost", "drive-offline"), "cable-in"),
                               ("damaged 2 1000000", ("drive-offline",), "mend 2"), ("exception 2 1000000 4", ("drive-offline",), "mend 2")):
        bench.do(line)
        harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
        found = bench.status()["fault"]["name"]
        assert found in faults, f"{line}: {found}"
        bench.await_no_torque()
        bench.do(mend)
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)
    bench.do("jam 4")
    with bench.sender() as sender:
        sender.send("@A6T:0,0,0,0,0,160,2000#")
        harness.wait_for(lambda: bench.status()["state"] == "FAULT", "a stuck cylinder")
    assert bench.status()["fault"]["axis"] == 4, bench.status()["fault"]
    assert bench.status()["fault"]["name"] in ("following-error", "drive-fault"), bench.status()["fault"]
    bench.await_no_torque()


def killed(bench):
    """What is under torque and hears nothing more stops by its own watchdog."""
    daemon = up(bench)
    with bench.sender() as sender:
        sender.send("@A6T:0,0,0,0,0,140,4000#")
        time.sleep(1)
        daemon.kill()
        daemon.wait()
    harness.wait_for(lambda: {drive["state"] for drive in bench.twin_status()["drives"]} == {"fault"}, "all have stopped by themselves")
    where = [drive["position"] for drive in bench.twin_status()["drives"]]
    time.sleep(0.5)
    assert where == [drive["position"] for drive in bench.twin_status()["drives"]]


def plain_questions(bench):
    """A master of nothing but bytes, right and wrong."""
    bench.start_twin()
    time.sleep(0.5)
    host = re.search(r"hosts = 127.0.0.1:(\d+)", bench.config.read_text(encoding="utf-8"))

    def ask(pdu, unit=1, protocol=0, length=None):
        with socket.create_connection(("127.0.0.1", int(host[1])), timeout=1) as link:
            link.sendall(struct.pack(">HHHB", 7, protocol, len(pdu) + 1 if length is None else length, unit) + pdu)
            try:
                return link.recv(300)[7:]
            except TimeoutError:
                return None
            except ConnectionError:
                return b""

    assert ask(struct.pack(">BHH", 3, 0x100, 4))[:2] == bytes([3, 8])
    assert ask(struct.pack(">BHH", 3, 0x0FFF, 1)) == bytes([0x83, 2]), "an address that the map lacks"
    assert ask(struct.pack(">BHH", 3, 0x100, 126)) == bytes([0x83, 3])
    assert ask(struct.pack(">BHH", 43, 0x100, 1)) == bytes([0xAB, 1])
    assert ask(struct.pack(">BHHBH", 16, 0x210, 1, 2, 77)) == bytes([0x90, 3]), "a command that the map lacks"
    assert ask(struct.pack(">BHHBHHH", 16, 0x200, 3, 6, 0, 500, 100)) == struct.pack(">BHH", 16, 0x200, 3)
    assert ask(struct.pack(">BHHB", 16, 0x200, 3, 200)) == bytes([0x90, 3])
    assert ask(struct.pack(">BHH", 3, 0x100, 4), unit=9) is None, "another unit"
    assert ask(b"\3", protocol=0x4142) in (b"", None), "not Modbus"
    assert ask(b"", length=0) in (b"", None) and ask(b"\3", length=60000) is None
    assert bench.twin_status()["drives"][0]["position"] > -4
    assert bench.end_twin() == 0


def bad_input(bench):
    def refused(code, words, config=bench.config, *arguments):
        run = bench.run_twin("--config", config, *arguments)
        assert run.returncode == code and words in run.stderr, f"{arguments}: exit {run.returncode}: {run.stderr}"

    text = bench.config.read_text(encoding="utf-8")
    refused(65, "drives on Modbus have no such fault", bench.config, "--fault", "1 heartbeat-lost 3")
    refused(65, "no board of relays", bench.config, "--fault", "1 relays-silent")
    refused(65, "this is written as: register DRIVE ADDRESS VALUE", bench.config, "--fault", "1 register 3")
    far = bench.file("far.ini", re.sub("hosts = .*", "hosts = " + ", ".join(f"192.0.2.{k}" for k in range(1, 7)), text))
    refused(69, "on a network that may have real drives. Take 127.0.0.1", far)
    refused(69, "take 127.0.0.1", far, "--on-real-bus")
    serial = (harness.TOP / "config/modbus/oriental-motor-az.ini").read_text(encoding="utf-8").replace("drive_timeout_confirmed = no", "drive_timeout_confirmed = yes")
    refused(69, "parity = none", bench.file("serial.ini", serial))
    there = bench.file("there", "somebody's")
    plain = serial.replace("parity = even", "parity = none")
    refused(69, "is there already", bench.file("serial.ini", re.sub("device = .*", f"device = {there}", plain)))
    assert there.read_text(encoding="utf-8") == "somebody's"
    refused(69, "where you may write", bench.file("serial.ini", re.sub("device = .*", "device = /nonexistent/line", plain)))
    assert bench.run_twin("--config", bench.config, "--fault", "1 damaged 3 2", "--check").returncode == 0


def rows():
    text = (harness.TOP / "docs/twin.md").read_text(encoding="utf-8")
    return ROW.findall(text.split("## Each failure of Modbus")[1].split("## ")[0])


def plays(line, says):
    def case(bench):
        bench.start_twin("--fault", line)
        time.sleep(1 if line.startswith("0") else 0)
        bench.start()
        if says == "not enabled":
            time.sleep(PATIENCE_S)
            assert bench.status()["state"] not in ("RISING", "ENGAGED"), bench.status()["state"]
            assert not any(drive["set_points"] for drive in bench.twin_status()["drives"]), "somebody had torque"
            return
        harness.wait_for(lambda: f"s: {line.split(' ', 1)[1]}" in bench.twin_log.read_text(encoding="utf-8"), "the line is played")
        if says == "goes on":
            bench.wait_state("ENGAGED")
            time.sleep(1)
            assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]
            return
        bench.wait_state("FAULT")
        assert bench.status()["fault"]["name"] in says.split(" or "), bench.status()["fault"]
        bench.await_no_torque()
    return case


CASES = [
    ("Modbus TCP: the platform rises and follows, and ends without torque", rises_and_follows, {}),
    ("Modbus RTU, iai: rises and follows on a pseudo terminal", rises_and_follows, {"preset": "modbus/iai-robo-cylinder"}),
    ("Modbus RTU, az: rises and follows on a pseudo terminal", rises_and_follows, {"preset": "modbus/oriental-motor-az"}),
    ("Modbus: a drive that runs backwards shows it before anything moves", backwards_is_seen, {}),
    ("Modbus: a board of relays takes the masks, forgets, falls silent and comes back", board_takes_the_masks, {"board": True}),
    ("Modbus TCP: faults of each class, and back", faults_and_back, {}),
    ("Modbus RTU: faults of each class, and back", faults_and_back, {"preset": "modbus/iai-robo-cylinder"}),
    ("Modbus: faults, and the end of heaved", twin_bench.ends_after_a_fault, {}),
    ("Modbus: heaved is killed, the drives stop by their watchdogs", killed, {}),
    ("Modbus: a master of plain bytes, right and wrong", plain_questions, {}),
    ("Modbus: bad input is named", bad_input, {}),
] + [(f"docs/twin.md: {line}: {says}, {what}", plays(line, says), {"board": "relays" in line}) for what, line, says in rows()]


def main():
    suite = tap.Suite()
    for name, case, options in CASES:
        if len(sys.argv) > 2 and not re.search(sys.argv[2], name):
            continue
        with suite.case(name), ModbusTwin(sys.argv[1], **options) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
