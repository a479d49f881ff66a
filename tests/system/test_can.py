#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_can.py BIN [PART OF A NAME] - the daemon on CANopen drives: simulated ones, strict ones, on vcan, on virtual time. Runs inside kernel.py."""
import math
import re
import signal
import subprocess
import sys
import time

import can_bench
import heave
import tap

MM = can_bench.COUNTS_PER_MM

# What the daemon has to be told of these drives.
DRIVES = f"""
[drives]
driver = cia402

[can]
interface = vcan0
bitrate_bps = 1000000

[cia402]
nodes = 1, 2, 3, 4, 5, 6, 7
counts_per_mm = {MM}
angle_counts_per_deg = {MM}
"""


def can_config(bench, **changes):
    """The demonstration platform with CANopen drives instead of simulated ones."""
    text = bench.write_config("can.ini", **changes).read_text(encoding="utf-8")
    text, count = re.subn(r"\[drives\].*?(?=\n\[relays\])", DRIVES.strip() + "\n", text, flags=re.DOTALL)
    assert count == 1
    config = bench.file("can.ini", text)
    check = bench.heaved("--config", config, "--check")
    if "cia402" in check.stderr and check.returncode != 0:
        raise tap.Skip("this heaved has no driver cia402")
    return config


def wave(t):
    return f"@A6:{6 * math.sin(2 * t):.3f},{5 * math.sin(1.7 * t):.3f},0,0,0,{20 * math.sin(1.3 * t):.3f},0#"


def up(bench, config, **drives):
    bench.start_drives(**drives)
    daemon = bench.start(config=config)
    bench.wait_state("ENGAGED")
    return daemon


def largest_step(bench, since_us=0):
    rows = [targets for time_us, targets, _ in bench.positions() if time_us >= since_us and None not in targets]
    return max(abs(after - before) for first, second in zip(rows, rows[1:]) for before, after in zip(first, second))


# --- Cases ---

def rises_without_a_jump(bench):
    daemon = up(bench, can_config(bench))
    assert bench.stop(daemon) == 0
    bench.stop_drives()
    enabled = bench.events("enabled")
    assert len(enabled) == 7 and max(row["t"] for row in enabled) - min(row["t"] for row in enabled) < 0.02, enabled
    for row in enabled:
        assert row["value"]["target"] == row["value"]["actual"], row
    assert not bench.events("emergency") and not bench.events("jump") and not bench.events("set-point overwritten")
    assert all(row["missed"] == 0 for row in bench.statistics().values()), bench.statistics()


def follows_a_stream(bench):
    daemon = up(bench, can_config(bench))
    with bench.sender() as sender:
        sender.stream(10, wave)
    assert bench.status()["state"] == "ENGAGED"
    assert bench.stop(daemon) == 0
    bench.stop_drives()
    assert not bench.events("emergency")
    spans = [max(values) - min(values) for values in zip(*(targets[:6] for _, targets, _ in bench.positions()))]
    assert min(spans) > 20 * MM, spans


def follows_on_a_bus_of_finite_speed(bench):
    bench.slow_bus()
    follows_a_stream(bench)
    assert all(row["missed"] == 0 for row in bench.statistics().values()), bench.statistics()


TROUBLES = ({"do": "fault", "code": 0x2310}, {"do": "reboot"}, {"do": "off"}, {"do": "disable"})


def one_in_trouble_stops_all(action):
    def case(bench):
        up(bench, can_config(bench), plan=[{"after_enabled": 8, "drive": 3, **action}])
        with bench.sender() as sender:
            sender.stream(10, wave)
        bench.wait_state("FAULT")
        time.sleep(1)
        assert bench.status()["state"] == "FAULT", action
        bench.stop_drives()
        when = [row["t"] for row in bench.events("plan")][0]
        left = [row for row in bench.events("state") if row["t"] >= when and row["node"] != 3]
        assert {row["node"] for row in left if row["t"] < when + 0.5} == {1, 2, 4, 5, 6, 7}, left
    return case


def interface_down_stops_the_drives(bench):
    daemon = up(bench, can_config(bench))
    subprocess.run(["ip", "link", "set", "vcan0", "down"], check=True)
    bench.wait_state("FAULT")
    subprocess.run(["ip", "link", "set", "vcan0", "up"], check=True)
    time.sleep(1)
    assert bench.status()["state"] == "FAULT"
    assert bench.stop(daemon) == 0


def killed_daemon_stops_the_drives(bench):
    daemon = up(bench, can_config(bench))
    with bench.sender() as sender:
        sender.stream(3, wave)
        bench.stop(daemon, signal.SIGKILL)
    time.sleep(1)
    bench.stop_drives()
    lost = bench.events("master lost")
    assert {row["node"] for row in lost} == set(range(1, 8)), lost
    assert all(row["value"] != "operation enabled" for row in bench.events("state")[-7:])


def missing_or_wrong_drive_is_named(bench):
    for only in ({4: {"is_there": False}}, {4: {"missing_objects": ["607A"]}}, {4: {"refuse": {"6060": 0x06090030}}}):
        with can_bench.CanBench(bench.bin) as fresh:
            config = can_config(fresh)
            fresh.start_drives(only=only)
            daemon = fresh.start(config=config)
            time.sleep(15)
            assert fresh.status()["state"] != "ENGAGED"
            report = fresh.status()["cylinders"][3]["report"]
            assert report["node"] == 4 and report["phase"] in ("missing", "refused") and report["trouble"] and report["code"], report
            assert re.search(r"\b4\b", daemon.log.read_text(encoding="utf-8")), daemon.log.read_text(encoding="utf-8")
            fresh.stop_drives()
            assert not fresh.events("enabled"), "all or none"


CASES = [
    ("rises without a jump, all drives at once", rises_without_a_jump), ("follows a stream", follows_a_stream),
    ("follows a stream on a bus of 1 Mbit/s", follows_on_a_bus_of_finite_speed),
    *((f"one drive in trouble-{action['do']} stops all of them, latched", one_in_trouble_stops_all(action)) for action in TROUBLES),
    ("interface down and up: fault, nothing moves again", interface_down_stops_the_drives),
    ("a killed daemon is noticed by the drives", killed_daemon_stops_the_drives), ("a missing or wrong drive is named and nothing is enabled", missing_or_wrong_drive_is_named),
]


def main():
    suite = tap.Suite()
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case in CASES:
        if wanted not in name:
            continue
        with suite.case(name), can_bench.CanBench(sys.argv[1]) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
