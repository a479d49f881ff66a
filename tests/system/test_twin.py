#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin.py BIN [PART OF A NAME] - heave-twin on a bus between programs, as on a kernel without CAN: drives, mechanism, faults, and what it says to bad input."""
import contextlib
import csv
import json
import os
import re
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import harness
import tap
from twin_bench import TwinBench, ends_after_a_fault

NEAR_MM = 2  # axes lag a little behind
ERROR_FRAME = 0x20000000
TWO_AXES = "1.1, 1.2, 2.1, 2.2, 3.1, 3.2, 4"
FIXED = """
command_map = 2: 0x6040/16 0x6060/8, 3: 0x607A/32
answer_map = 1: 0x6041/16, 3: 0x6041/16 0x6064/32
map_written = no
"""
ANY_NUMBERS = """
command_map = 65: 0x6040/16 0x607A/32
answer_map = 129: 0x6041/16 0x6064/32 0x6061/8
"""
MODES = "mode = csp, ip, csp, csp, ip, csp, csp"


def up(bench, *arguments):
    bench.start_twin(*arguments)
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    return daemon


def rises_and_follows(bench):
    daemon = up(bench)
    with bench.sender() as sender:
        sender.send("@A6T:2,1,0,0,0,20,2000#")
        time.sleep(3)
    twin, status = bench.twin_status(), bench.status()
    for leg, drive in zip(status["cylinders"], twin["drives"]):
        assert abs(leg["actual_mm"] - drive["position"]) < NEAR_MM, (leg, drive)
        assert drive["state"] == "operation enabled" and drive["set_points"] > 500, drive
    assert abs(twin["pose"][0] - 2) < 0.3 and abs(twin["pose"][1] - 1) < 0.3, twin["pose"]
    assert bench.stop(daemon) == 0
    states = {drive["state"] for drive in bench.twin_status()["drives"]}
    assert states <= {"switch on disabled", "ready"}, states
    assert bench.end_twin() == 0


def backwards_is_seen_before_it_moves(bench):
    bench.start_twin("--reverse", "4", "--start", "20")
    bench.start()
    harness.wait_for(lambda: bench.status()["cylinders"][3]["actual_mm"] is not None, "drive 4 tells where it is")
    assert abs(bench.status()["cylinders"][3]["actual_mm"] + 20) < 0.1, bench.status()["cylinders"][3]
    assert abs(bench.twin_status()["drives"][3]["position"] - 20) < 0.1


def is_led_up(bench):
    """As an operator who tries again: a bus takes its time to come back."""
    state = bench.status()["state"]
    if state in ("FAULT", "OFF"):
        bench.ctl("reset" if state == "FAULT" else "engage")
    return state == "ENGAGED"


def faults_and_back(bench):
    """One after the other on the same machine: seen, and a reset leads back once it is mended."""
    up(bench)
    for line, fault, mend in (("jam 3", "following-error", "mend 3"), ("fault 2", "drive-fault", "mend 2"), ("reboot 5", "drive-offline", "mend 5"),
                              ("cable-out", "bus-lost", "cable-in"), ("down", "bus-lost", "up"), ("bus-off", "bus-lost", "active")):
        bench.do(line)
        with bench.sender() as sender:
            sender.send("@A6T:0,0,0,0,0,40,1500#")
            harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
        found = bench.status()["fault"]["name"]
        assert found == fault, f"{line}: {found}"
        bench.await_no_torque()
        bench.do(mend)
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)


def frames_of_their_own(bench):
    """Rises, follows where it is led, and is off or held in the end."""
    daemon = up(bench)
    with bench.sender() as sender:
        sender.send("@A6T:2,1,0,0,0,20,2000#")
        time.sleep(3)
    twin, status = bench.twin_status(), bench.status()
    for leg, drive in zip(status["cylinders"], twin["drives"]):
        assert abs(leg["actual_mm"] - drive["position"]) < NEAR_MM and drive["set_points"] > 200, (leg, drive)
        assert drive["state"] == "torque", drive
    assert abs(twin["pose"][0] - 2) < 0.3 and abs(twin["pose"][1] - 1) < 0.3, twin["pose"]
    assert bench.stop(daemon) == 0


def off_in_the_end(bench):
    frames_of_their_own(bench)
    assert {drive["state"] for drive in bench.twin_status()["drives"]} == {"no torque"}, bench.twin_status()


def faults_of_frames(bench):
    up(bench)
    for line, fault in (("jam 3", "following-error"), ("fault 2 0x17", "drive-fault"), ("mute 5", "drive-offline"), ("stuck-counter 4", "drive-offline"),
                        ("damaged 6 100000", "drive-offline"), ("drop 1", "drive-dropped"), ("bus-off", "bus-lost")):
        bench.do(line)
        with bench.sender() as sender:
            sender.send("@A6T:0,0,0,0,0,40,1500#")
            harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
        found = bench.status()["fault"]
        assert found["name"] == fault, f"{line}: {found}"
        assert line != "fault 2 0x17" or "0x17" in str(found) or found["device_code"] == 0x17, found
        if fault != "bus-lost":  # they have no watchdog
            bench.await_no_torque()
        bench.do("active" if line == "bus-off" else "mend all")
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)


def faults_of_a_shared_frame(bench):
    """The one that fails is named; where both are one device, either of them."""
    up(bench)
    for line, fault, axes in (("fault 2 0x17", "drive-fault", (2,)), ("jam 3", "following-error", (3,)), ("drop 6", "drive-dropped", (6,)),
                              ("mute 5", "drive-offline", (5, 6)), ("stuck-counter 1", "drive-offline", (1, 2))):
        bench.do(line)
        with bench.sender() as sender:
            sender.send("@A6T:0,0,0,0,0,40,1500#")
            harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
        found = bench.status()["fault"]
        assert (found["name"], found["axis"] in axes) == (fault, True), f"{line}: {found}"
        bench.await_no_torque()
        bench.do("mend all")
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)


def faults_of_a_status_apart(bench, faults):
    daemon = up(bench)
    for line, fault, axes, text in faults:
        bench.do(line)
        harness.wait_for(lambda: bench.status()["state"] == "FAULT", f"{line}: a fault")
        found = bench.status()["fault"]
        assert (found["name"], found["axis"] in axes, found["device_text"]) == (fault, True, text), f"{line}: {found}"
        assert fault != "drive-fault" or found["device_code"] == 0x1234, found
        bench.await_no_torque()
        bench.do("mend all")
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)
    return daemon.log.read_text(encoding="utf-8")


def said_in_a_status_apart(bench):
    """The drive's own code, and a status that fails while positions come."""
    faults_of_a_status_apart(bench, (("fault 2 0x1234", "drive-fault", (2,), "fault of the drive"), ("drop 6", "drive-dropped", (6,), ""),
                                     ("reboot 2", "drive-dropped", (2,), "")))


def wrong_in_a_status_apart(bench):
    """What does not come, check bytes and counters that are wrong."""
    log = faults_of_a_status_apart(bench, (("mute 5", "drive-offline", (5, 6), "nothing comes from it: supply, cable, identifier"),
                                           ("stuck-counter 1", "drive-offline", (1, 2), "its alive counter stands still"),
                                           ("damaged 4 100000", "drive-offline", (3, 4), "the check byte of what it sends is wrong")))
    assert "axis 1, identifier 0x281, enabled: its alive counter stands still" in log, log


def faults_of_a_node(bench):
    """An axis of a node is lost: it is named, the other axis goes with it, the platform stops, and a reset leads out once both are there."""
    up(bench)
    bench.do("lose 2 400")
    bench.wait_state("FAULT")
    assert bench.status()["fault"]["name"] == "drive-offline", bench.status()["fault"]
    assert bench.status()["fault"]["axis"] == 2, bench.status()["fault"]
    cylinders = bench.status()["cylinders"]
    assert [cylinders[i]["report"]["channel"] for i in (0, 1, 2)] == [1, 2, 1], cylinders
    time.sleep(3)
    assert bench.status()["state"] == "FAULT", "it came back by itself"
    harness.wait_for(lambda: is_led_up(bench), "up again", 0.5)
    bench.do("fault 4")
    bench.wait_state("FAULT")
    assert (bench.status()["fault"]["name"], bench.status()["fault"]["axis"]) == ("drive-fault", 4), bench.status()["fault"]


def guarded_rise_and_fail(bench):
    """Old drives, without 1016h and 1017h."""
    up(bench, *(argument for drive in range(1, 8) for argument in ("--fault", f"0 missing {drive} 0x1017", "--fault", f"0 missing {drive} 0x1016:1")))
    bench.do("heartbeat-lost 3")
    bench.wait_state("FAULT")
    fault = bench.status()["fault"]
    assert (fault["name"], fault["axis"], fault["device_code"]) == ("drive-offline", 3, 0x10003), fault
    bench.do("mend 3")
    time.sleep(2)
    assert bench.status()["state"] == "FAULT", "it came back by itself"
    harness.wait_for(lambda: is_led_up(bench), "up again", 0.5)


def script_runs(bench):
    script = bench.file("script", "# drive 3, a second after torque\n+1 emcy 3 0x5000   # only told\n+1.5 drop 4\n")
    bench.start_twin("--script", script)
    bench.start()
    bench.wait_state("FAULT")
    fault = bench.status()["fault"]
    assert (fault["name"], fault["axis"]) == ("drive-dropped", 4), fault
    log = bench.twin_log.read_text(encoding="utf-8")
    assert "s: emcy 3 0x5000" in log and "s: drop 4" in log, log


def without_a_twin_it_says_what_to_do(bench):
    daemon = bench.start()
    harness.wait_for(lambda: "start heave-twin" in daemon.log.read_text(encoding="utf-8"), "what to do is said")
    bench.start_twin()
    bench.wait_state("ENGAGED")


def bad_input(bench):
    def refused(code, words, *arguments):
        run = bench.run_twin(*arguments)
        assert run.returncode == code and words in run.stderr, f"{arguments}: exit {run.returncode}: {run.stderr}"

    config = ("--config", bench.config)
    script = bench.file("script", "1 jam 2\n\nsoon jam 2\n2 jam 8\n")
    run = bench.run_twin(*config, "--script", script, "--check")
    assert run.returncode == 65 and f"{script}:3: soon is no time" in run.stderr and f"{script}:4: there is no drive 8" in run.stderr, run.stderr
    refused(66, "No such file", *config, "--script", "/nonexistent")
    refused(65, "--fault '1 explode': there is no fault explode", *config, "--fault", "1 explode")
    refused(64, "--config FILE: is missing")
    refused(64, "--swap 1,8", *config, "--swap", "1,8")
    refused(64, "--socket PATH FAULT", "jam", "3")
    refused(64, "see --help", "--frobnicate")
    refused(69, "nobody answers", "--socket", bench.folder / "none", "status")
    refused(78, "", "--config", bench.file("empty.ini", ""))
    refused(78, "heaved simulates these drives itself", "--config", harness.TOP / "config/demo-hexapod.ini")
    refused(65, "CiA 402 drives have no such fault", *config, "--fault", "1 stuck-counter 2")
    refused(65, "drives with CAN frames of their own have no such fault", "--config", harness.TOP / "config/can-raw-hexapod.ini", "--fault", "1 sdo-silent 2")
    assert bench.run_twin(*config, "--fault", "1 jam 2", "--check").returncode == 0
    bench.start_twin()
    refused(69, "another heave-twin is this bus already", *config)
    refused(1, "there is no drive 9", "--socket", bench.twin_socket, "jam", "9")


def doctor_asks_them(bench):
    """It knows the bus between programs, and says that it is none for a machine."""
    def run():
        return bench.heaved("--config", bench.config, "--doctor")

    alone = run()
    assert alone.returncode == 1 and "start heave-twin with the same configuration" in alone.stdout, alone.stdout
    bench.start_twin("--fault", "0 sdo-refuse 3 6065", "--fault", "0 power-off 5")
    time.sleep(1)
    seen = run().stdout
    assert "is a bus between programs, for heave-twin" in seen, seen
    assert re.search(r"^ok\s+node 2 \(drive 2\)", seen, re.MULTILINE) and re.search(r"^FAIL\s+node 5 \(drive 5\) does not answer", seen, re.MULTILINE), seen
    bench.do("power-on 5")
    time.sleep(1)
    run = bench.heaved("--config", bench.config, "--doctor")
    assert run.returncode == 0, run.stdout


def says_what_is_missing(bench):
    """On a kernel without CAN, and where the interface is not there."""
    text = bench.config.read_text(encoding="utf-8").replace(f"interface = {bench.interface}", "interface = vcan77")
    run = bench.run_twin("--config", bench.file("other.ini", text))
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
        words = "ip link add vcan77 type vcan"
    except OSError:
        words = "no SocketCAN"
    assert run.returncode == 69 and words in run.stderr, run.stderr


def hostile_clients_stop_nothing(bench):
    """Of the socket: long lines, halves, too many; of the bus: packets that are none, error frames, a client that reads nothing."""
    up(bench)
    links = []
    for text in (b"x" * 1000, b"jam", b"\n\n\n", b"\0\n", b"status"):
        for _ in range(2):
            links.append(socket.socket(socket.AF_UNIX))
            links[-1].connect(str(bench.twin_socket))
            with contextlib.suppress(BrokenPipeError):  # it was one too many
                links[-1].sendall(text)
    bus = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    bus.connect(f"\0heave-can-{bench.interface}")
    for _ in range(50):
        bus.send(struct.pack("=IB3x8sI4x", ERROR_FRAME | 0x80, 8, bytes(8), 0))
    bus.send(b"short")
    time.sleep(1)
    for link in links:
        link.close()
    harness.wait_for(lambda: bench.run_twin("--socket", bench.twin_socket, "status").returncode == 0, "the socket serves again")
    assert bench.status()["state"] == "ENGAGED", bench.status()["fault"]


TELLS_ALL = "tell_torque = yes\ntell_following_error = yes\ntell_inputs = yes\ntell_every = 5"


def telemetry_is_told(bench):
    """Drive 2 pushes with 2 mm of error, drive 1 stands at its lower end until it rises."""
    metrics = bench.folder / "heave.prom"
    bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[control]\n", f"[control]\nmetrics = {metrics}\n"), encoding="utf-8")
    up(bench)
    bench.do("friction 2 2")
    with bench.sender() as sender:
        sender.send("@A6T:0,0,0,0,0,20,2000#")
        time.sleep(3)
    told = [leg["report"]["telemetry"] for leg in bench.status()["cylinders"]]
    assert all(one["age_ms"] <= 100 and one["inputs"] & 3 == 0 for one in told), told
    assert 1 < told[1]["following_error_mm"] < 3 and told[1]["torque_percent"] > 5, told[1]
    assert abs(told[0]["following_error_mm"]) < 0.1, told[0]
    table = " ".join(bench.ctl("status").stdout.split())
    assert "behind by" in table and "inputs 0x" in table, table
    rows = list(csv.DictReader(bench.ctl("--for", "0.1", "scope").stdout.splitlines()))
    assert len(rows) > 20 and float(rows[-1]["drive2_torque_percent"]) > 5 and 1 < float(rows[-1]["drive2_lag_mm"]) < 3, rows[-1:]
    assert rows[-1]["drive7_lag_deg"] and int(rows[-1]["drive1_inputs"]) & 3 == 0 and rows[-1]["drive1_notes"] == "0", rows[-1:]
    harness.wait_for(lambda: "heave_drive_torque_percent{axis=\"2\"}" in metrics.read_text(encoding="utf-8"), "the metrics have it")
    page = metrics.read_text(encoding="utf-8")
    assert re.search(r'heave_drive_following_error\{axis="2",unit="mm"\} [12]\.', page) and 'heave_drive_inputs{axis="7"}' in page, page


def words_of(run):
    assert run.returncode == 0, run
    return run.stdout


def drives_in_their_own_words(bench):
    """What a person who exchanges a drive does: looks at it, saves what it is set to, and compares the new one."""
    bench.start_twin()
    bench.start()
    harness.wait_for(lambda: bench.status()["cylinders"][2]["drive"] == "disabled", "the drives are set up")
    text = words_of(bench.ctl("drive", "3"))
    for wanted in ("drive 3, node 3: disabled", "1008:00 device name: heave-twin", "1018:04 serial number: 3", "6041:00 statusword: 576 (0x0240): switch on disabled",
                   "6502:00 supported modes: 225 (0x000000E1): pp, hm, ip, csp", "errors kept (1003): none"):
        assert wanted in text, (wanted, text)
    assert bench.ctl("drive", "8").returncode == 1
    refused = bench.ctl("sdo", "3", "6083", "5")
    assert refused.returncode == 1 and "in SERVICE only" in refused.stderr, refused
    saved = bench.folder / "drive3.dcf"
    assert "22 objects saved" in words_of(bench.ctl("--save", saved, "drive", "3"))
    assert bench.ctl("--save", saved, "drive", "3").returncode == 73, "what was saved before is kept"
    words_of(bench.ctl("service"))
    assert "6083:00 profile acceleration, counts/s^2: 12345 (0x00003039), written" in words_of(bench.ctl("sdo", "3", "6083", "12345"))
    assert "12345" in words_of(bench.ctl("sdo", "3", "6083:00"))
    words_of(bench.ctl("sdo", "3", "6098", "i8", "-3"))
    for place in ("6040", "6065", "607A", "1A00:1", "6092:1"):
        refused = bench.ctl("sdo", "3", place, "u32", "5")
        assert refused.returncode == 1 and "relies on this object" in refused.stderr, refused
    refused = bench.ctl("sdo", "3", "5FFF", "u8", "1")
    assert refused.returncode == 1 and "no such object (0x06020000)" in refused.stderr, refused
    differs = bench.ctl("--compare", saved, "drive", "3")
    assert differs.returncode == 1 and "6083:00 profile acceleration, counts/s^2: the drive has 12345, the file 100000" in differs.stdout, differs
    assert "6098:00 homing method: the drive has -3, the file 0" in differs.stdout and "20 objects are the same, 2 differ" in differs.stdout, differs
    assert "22 objects are the same, 0 differ" in words_of(bench.ctl("--compare", saved, "drive", "2"))
    with open(saved, "a", encoding="utf-8") as file:
        file.write("[2100]\nObjectType=7\nDataType=8\nAccessType=rw\nParameterValue=1.5\n")
    assert "write-only): 1" in words_of(bench.ctl("--compare", saved, "drive", "2"))
    imported = subprocess.run([bench.bin / "heaved", "--import-dcf", saved, "--drive", "3"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert imported.returncode == 1 and "drive3.dcf: left out" in imported.stderr, imported
    assert imported.stdout.startswith("[cia402-startup-3]\n") and "; 0x2100:00 (line " in imported.stdout, imported
    words_of(bench.ctl("service-off"))


def engage_waits_for_the_drives(bench):
    """At once after the start, with drives that are still being set up; then with one that has no power."""
    bench.start_twin()
    daemon = bench.start()
    early = bench.ctl("engage")
    assert early.returncode == 0 and early.stdout == "engage: HOMING\n" and "are not ready; drive 1: " in early.stderr, early
    bench.wait_state("ENGAGED")
    assert bench.ctl("park").returncode == 0
    bench.wait_state("SETTLED")
    assert bench.ctl("--wait", "shutdown").returncode == 0
    daemon.wait(timeout=harness.WAIT_S)
    bench.do("power-off 3")
    bench.start()
    missing = bench.ctl("park")
    assert missing.returncode == 1 and missing.stderr.endswith("heavectl: park: drive 3 is not ready: missing: does not answer: supply, cable, termination, node id, bit rate?\n"), missing
    status = bench.status()
    assert (status["state"], status["fault"]["name"]) == ("OFF", "none"), "nothing was begun"
    for after, wanted in (("hold", "a hold came after it was asked, so it is not done"), ("power-on 3", "engage: ENGAGED")):
        with subprocess.Popen([bench.bin / "heavectl", "--socket", bench.socket, "--wait", "--for", "30", "engage"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as waiting:
            assert "drive 3 is not ready: missing" in waiting.stdout.readline()
            if after == "hold":
                bench.ctl("hold")
            else:
                bench.do(after)
            assert wanted in waiting.communicate(timeout=harness.WAIT_S)[0]
        assert waiting.returncode == (1 if after == "hold" else 0) and bench.status()["state"] == ("OFF" if after == "hold" else "ENGAGED")


def late_watchdog_is_refused_in_words(bench):
    """The drive waits ten seconds for a gateway that is gone, and cannot be told otherwise."""
    bench.start_twin("--fault", "0 object 2 0x1016:1 0x7F2710")
    bench.start()
    harness.wait_for(lambda: (bench.status()["cylinders"][1].get("report") or {}).get("phase") == "refused", "drive 2 is refused")
    text = words_of(bench.ctl("drive", "2"))
    for wanted in ("would stop too late by itself when the gateway is gone (0x1001C)", "about object: 1016:01", "found: 0x7F2710, wanted: 0x7F00"):
        assert wanted in text, (wanted, text)
    table = " ".join(bench.ctl("status").stdout.split())
    assert "node 2: refused, object 1016:01; would stop too late" in table and "found 0x7F2710, wanted 0x7F00" in table, table


def axes_of_a_node_in_their_own_words(bench):
    """The objects of the second axis are 800h further; those of the node are the same."""
    bench.start_twin()
    bench.start()
    harness.wait_for(lambda: bench.status()["cylinders"][5]["drive"] == "disabled", "the drives are set up")
    text = words_of(bench.ctl("drive", "4"))
    for wanted in ("drive 4, node 2.2: disabled", "1008:00 device name: heave-twin", "6841:00 statusword: 576 (0x0240): switch on disabled", "6864:00 position, counts: "):
        assert wanted in text, (wanted, text)
    assert "6041" not in text and "6064" not in text, text
    assert "drive 3, node 2.1: disabled" in words_of(bench.ctl("drive", "3"))
    saved = bench.folder / "drive4.dcf"
    assert "22 objects saved" in words_of(bench.ctl("--save", saved, "drive", "4"))
    words_of(bench.ctl("service"))
    assert "6883:00 profile acceleration, counts/s^2: 12345 (0x00003039), written" in words_of(bench.ctl("sdo", "4", "6883", "12345"))
    differs = bench.ctl("--compare", saved, "drive", "4")
    assert differs.returncode == 1 and "6883:00 profile acceleration, counts/s^2: the drive has 12345, the file 100000" in differs.stdout, differs
    words_of(bench.ctl("service-off"))


def drives_are_read_where_nothing_is_led(bench):
    """In FAULT a person wants to know why; elsewhere the bus is the motion's. Set-points go on beside it."""
    up(bench)
    refused = json.loads(bench.ctl("--json", "sdo", "1", "6041:00").stdout)
    assert not refused["ok"] and refused["why"] == "moving", refused
    text = words_of(bench.ctl("drive", "3"))
    assert "enabled, homed" in text and "elsewhere the bus belongs to the motion" in text, text
    bench.do("fault 3 0x8611")
    bench.wait_state("FAULT")
    text = words_of(bench.ctl("drive", "3"))
    for wanted in ("trouble: following error (0x8611)", "errors kept (1003), newest first:\n  0x8611 (following error)", "603F:00 error code: 34321 (0x8611): following error"):
        assert wanted in text, (wanted, text)


def cpu_us(pid):
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) * 1e6 / os.sysconf("SC_CLK_TCK")


def costs_little(bench):
    """Of real time: on virtual time computing takes none."""
    if harness.HAS_OWN_KERNEL:
        raise tap.Skip("takes real time")
    up(bench)
    begin, begin_us = time.monotonic(), cpu_us(bench.twin.pid)
    time.sleep(5)
    share = (cpu_us(bench.twin.pid) - begin_us) / 1e6 / (time.monotonic() - begin)
    print(f"# figure {share * 100:.1f} % of a core for seven drives at 2 ms", flush=True)
    assert share < 0.25, f"{share:.2f} of a core"


CASES = [
    ("heave-twin: the platform rises and follows, and the drives are where heaved believes", rises_and_follows, {}),
    ("heave-twin: a drive that runs backwards shows it before anything moves", backwards_is_seen_before_it_moves, {"platform__engage": "manual"}),
    ("heave-twin: faults of each class, and back", faults_and_back, {}),
    ("heave-twin: drives with CAN frames of their own, a plain map", frames_of_their_own, {"frames": "plain"}),
    ("heave-twin: drives with CAN frames of their own, a rich map", off_in_the_end, {"frames": "rich"}),
    ("heave-twin: drives with CAN frames of their own, fields of bits and floats", off_in_the_end, {"frames": "bits"}),
    ("heave-twin: drives with CAN frames of their own, two in a frame", off_in_the_end, {"frames": "shared"}),
    ("heave-twin: one of two drives in a frame fails, and back", faults_of_a_shared_frame, {"frames": "shared"}),
    ("heave-twin: drives with CAN frames of their own, a status apart", off_in_the_end, {"frames": "apart"}),
    ("heave-twin: faults that a status apart says, by name", said_in_a_status_apart, {"frames": "apart"}),
    ("heave-twin: a status apart that is missing or wrong, by name", wrong_in_a_status_apart, {"frames": "apart"}),
    ("heave-twin: faults of drives with frames of their own, and back", faults_of_frames, {"frames": "rich"}),
    ("heave-twin: faults of drives with frames of their own, and the end of heaved", ends_after_a_fault, {"frames": "rich"}),
    ("heave-twin: drives with two axes each, some of them in mode ip, rise and follow", rises_and_follows, {"nodes": TWO_AXES, "more": MODES}),
    ("heave-twin: drives whose PDOs have high numbers rise and follow", rises_and_follows, {"more": ANY_NUMBERS}),
    ("heave-twin: one axis of a node fails, and back", faults_of_a_node, {"nodes": TWO_AXES}),
    ("heave-twin: drives that are guarded, without heartbeats", guarded_rise_and_fail, {"more": "error_control = node-guarding"}),
    ("heave-twin: drives with fixed maps rise and follow", rises_and_follows, {"more": FIXED}),
    ("heave-twin: a script runs by its times", script_runs, {}),
    ("heave-twin: heaved without it says what to do, and goes on when it is there", without_a_twin_it_says_what_to_do, {}),
    ("heave-twin: bad input is named", bad_input, {}),
    ("heave-twin: heaved --doctor asks the drives on a bus between programs", doctor_asks_them, {}),
    ("heave-twin: without SocketCAN, or without the interface, it says what to do", says_what_is_missing, {}),
    ("heave-twin: torque, following error and inputs of the drives are in status and metrics", telemetry_is_told, {"more": TELLS_ALL}),
    ("heave-twin: heavectl drive and sdo say what a drive is, set it, save it and compare", drives_in_their_own_words, {"platform__engage": "manual"}),
    ("heave-twin: engage waits for drives that are being set up, names one that is not there, and ends with a hold", engage_waits_for_the_drives, {"platform__engage": "manual"}),
    ("heave-twin: a watchdog that waits far too long is refused, and said in words", late_watchdog_is_refused_in_words, {"platform__engage": "manual"}),
    ("heave-twin: heavectl drive reads the objects of the axis that it is asked for", axes_of_a_node_in_their_own_words, {"nodes": TWO_AXES, "platform__engage": "manual"}),
    ("heave-twin: drives are read where nothing is led, with the errors they kept", drives_are_read_where_nothing_is_led, {}),
    ("heave-twin: drives that answer at every fourth SYNC, in turns, rise and follow", rises_and_follows, {"more": "answer_every = 4\nsync_counter = 8\nfollowing_error_mm = 14\nangle_following_error_deg = 14"}),
    ("heave-twin: hostile clients stop nothing", hostile_clients_stop_nothing, {}),
    ("heave-twin: costs little, seven drives at 2 ms less than a quarter of a core", costs_little, {"period_us": 2000}),
]


def main():
    suite = tap.Suite()
    for name, case, options in CASES:
        if len(sys.argv) > 2 and not re.search(sys.argv[2], name):
            continue
        with suite.case(name), TwinBench(sys.argv[1], **options) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
