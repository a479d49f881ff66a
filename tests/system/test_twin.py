#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_twin.py BIN [PART OF A NAME] - heave-twin on a bus between programs, as on a kernel without CAN: drives, mechanism, faults, and what it says to bad input."""
import contextlib
import os
import re
import socket
import struct
import sys
import time
from pathlib import Path

import harness
import tap
from twin_bench import TwinBench

NEAR_MM = 2  # axes lag a little behind
ERROR_FRAME = 0x20000000


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
        bench.do("active" if line == "bus-off" else "mend all")
        harness.wait_for(lambda: is_led_up(bench), f"{line}: up again", 0.5)


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
    ("heave-twin: faults of drives with frames of their own, and back", faults_of_frames, {"frames": "rich"}),
    ("heave-twin: a script runs by its times", script_runs, {}),
    ("heave-twin: heaved without it says what to do, and goes on when it is there", without_a_twin_it_says_what_to_do, {}),
    ("heave-twin: bad input is named", bad_input, {}),
    ("heave-twin: heaved --doctor asks the drives on a bus between programs", doctor_asks_them, {}),
    ("heave-twin: without SocketCAN, or without the interface, it says what to do", says_what_is_missing, {}),
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
