#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_can.py BIN [PART OF A NAME] - the daemon on CANopen drives: simulated ones, strict ones, on vcan, on virtual time. Runs inside kernel.py."""
import random
import re
import signal
import sys
import time

import can_bench
import can_judge
import harness
import tap

sys.path.append(str(harness.TOP / "tools/lib"))
import demo_sender  # noqa: E402  the path above has to be set first

MM = can_bench.COUNTS_PER_MM
PERIOD_US = 4000

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
    return config


def up(bench, config, **drives):
    bench.start_drives(**drives)
    daemon = bench.start(config=config)
    bench.wait_state("ENGAGED")
    return daemon


# --- Cases ---

def rises_without_a_jump(bench):
    daemon = up(bench, can_config(bench))
    bench.do("tpdo late", drive=2, us=3000)
    assert bench.stop(daemon) == 0
    assert "not confirmed" not in daemon.log.read_text(encoding="utf-8")
    assert_asked_to_go_off(bench)
    bench.stop_drives()
    enabled = bench.events("enabled")
    assert len(enabled) == 7 and max(row["t"] for row in enabled) - min(row["t"] for row in enabled) < 0.02, enabled
    for row in enabled:
        assert row["value"]["target"] == row["value"]["actual"], row
    assert not bench.events("emergency") and not bench.events("jump") and not bench.events("set-point overwritten")
    assert all(row["missed"] == 0 for row in bench.statistics().values()), bench.statistics()


def demo(sender):
    """What tools/demo sends to a hexapod: the examples of the vendor's document, then both streams."""
    frames = [frame for frame in [*demo_sender.TABLE, *demo_sender.EXAMPLES] if demo_sender.command_of(frame) in demo_sender.ACCEPTED["hexapod"]]
    for frame in frames:
        if "T:" not in frame:
            sender.send(frame)
            time.sleep(demo_sender.SEEN_S)
    sender.send("@A7T:5,6,0,5.5,3.0,20,-30,3000#")
    time.sleep(3.1)
    streams(sender)


def poses(sender):
    """Slowly, as profile positions are for."""
    for frame in ("@A6T:2,1,0,0,0,20,2000#", "@A6T:0,0,0,0,0,0,2000#"):
        sender.send(frame)
        time.sleep(2.5)


def streams(sender):
    for frame in demo_sender.pose_stream():
        sender.send(frame)
        time.sleep(1 / demo_sender.POSE_STREAM_HZ)
    for frame in demo_sender.timed_stream():
        sender.send(frame)
        time.sleep(demo_sender.TIMED_STREAM_MS / 1000)


def follows(mode, frames, seed):
    """From anywhere: no step at enabling, and every target on the bus within every limit of the configuration, one set per SYNC."""
    def case(bench):
        source = random.Random(seed)
        config = can_config(bench)
        config.write_text(config.read_text(encoding="utf-8").replace("[cia402]\n", f"[cia402]\nmode = {mode}\n"), encoding="utf-8")
        middle = source.uniform(20, 150)
        bench.start_drives(only={node: {"position": round((middle + source.uniform(-3, 3)) * MM)} for node in can_bench.NODES})
        daemon = bench.start(config=config)
        time.sleep(4)
        bench.wait_state("ENGAGED")
        with bench.sender() as sender:
            frames(sender)
        end_us = time.monotonic_ns() // 1000
        assert bench.status()["state"] == "ENGAGED"
        assert bench.stop(daemon) == 0
        record = bench.record()
        assert not bench.events("emergency") and not bench.events("jump")
        can_judge.check_start(record)
        periods = can_judge.check_order(record, record.first_status(1, can_judge.ENABLED), end_us, PERIOD_US)
        assert periods > 1000, periods
        if mode != "pp":
            check_targets(config, record, end_us)
    return case


def check_targets(config, record, end_us):
    for node in can_bench.NODES:
        targets = [target for _, target in record.enabled_span(node, end_us)]
        limits = can_judge.limits_of(config, node, can_bench.CYLINDERS)
        can_judge.check_limits([targets[0]] * 3 + targets, limits, PERIOD_US, MM, f"node {node}")
        assert node > can_bench.CYLINDERS or max(targets) - min(targets) > 20 * MM, f"node {node} hardly moved"


def rises_fast_in_profile_position(bench):
    """At the speed of engaging that --check allows with this window and with none that is narrower."""
    def config_with(window):
        config = can_config(bench, engage__speed_mm_s=200, cylinders__accel_mm_s2=3000)
        config.write_text(config.read_text(encoding="utf-8").replace("[cia402]\n", f"[cia402]\nmode = pp\nfollowing_error_mm = {window}\n"), encoding="utf-8")
        return config
    refused = bench.heaved("--config", config_with(13), "--check")
    assert refused.returncode == 78 and "at least 13.067 mm" in refused.stderr, refused
    daemon = up(bench, config_with(13.1))
    assert bench.status()["fault"]["name"] == "none"
    assert bench.stop(daemon) == 0


def follows_on_a_bus_of_finite_speed(bench):
    bench.slow_bus()
    daemon = up(bench, can_config(bench))
    with bench.sender() as sender:
        streams(sender)
    assert bench.stop(daemon) == 0
    bench.stop_drives()
    assert not bench.events("emergency")
    assert all(row["missed"] == 0 for row in bench.statistics().values()), bench.statistics()


# --- The end ---

def states(bench, node):
    return [row["value"] for row in bench.events("state", node)]


def assert_asked_to_go_off(bench):
    """By their controlwords, not because nobody led them any more: they wait for the gateway's heartbeat for 150 ms."""
    time.sleep(0.5)
    assert not bench.events("connection lost"), bench.events("connection lost")
    assert all(states(bench, node)[-1] in ("ready", "switch on disabled") for node in can_bench.NODES), [states(bench, node)[-3:] for node in can_bench.NODES]


def ends_and_names_who_keeps_torque(bench):
    """One drive that answers, and acts on nothing; one that has lost its power, of which nobody knows."""
    bench.start_drives()
    daemon = bench.start(config=can_config(bench, platform__engage="manual"))
    harness.wait_for(lambda: all(leg["drive"] == "disabled" for leg in bench.status()["cylinders"]), "the drives are set up")
    assert bench.ctl("park").returncode == 0
    bench.wait_state("SETTLED")
    bench.do("stuck", drive=3)
    bench.do("off", drive=5)
    bench.wait_state("FAULT")
    since = time.monotonic()
    assert bench.stop(daemon) == 1
    assert time.monotonic() - since < 8
    log = daemon.log.read_text(encoding="utf-8")
    assert "not confirmed that the torque is off: axis 3, 5\n" in log, log
    assert all(states(bench, node)[-1] == "switch on disabled" for node in can_bench.NODES if node not in (3, 5))


def second_signal_stops_the_drives(bench, is_one_stuck=False):
    daemon = up(bench, can_config(bench))
    daemon.send_signal(signal.SIGTERM)
    time.sleep(0.3)
    if is_one_stuck:
        bench.do("stuck", drive=3)
    assert bench.stop(daemon) == 1
    log = daemon.log.read_text(encoding="utf-8")
    assert "ended at once by a second signal" in log and ("not every drive has confirmed" in log) == is_one_stuck, log
    if is_one_stuck:
        return
    assert all("quick stop" in states(bench, node) for node in can_bench.NODES), [states(bench, node)[-3:] for node in can_bench.NODES]


def moved_by_hand(bench):
    """In service: torque of all, one cylinder led while there are proofs of a hand, at rest without them; no drive sees a jump."""
    config = can_config(bench, platform__engage="manual")
    bench.start_drives()
    daemon = bench.start(config=config)
    with harness.Line(bench.socket) as line:
        harness.wait_for(lambda: line.ask("service")["ok"], "service")
        assert line.refused("torque 3 on", "all drives together")["why"] == "together"
        counts = [drive["counts"] for drive in line.good("counts")["drives"]]
        assert all(isinstance(count, int) for count in counts), counts
        line.good("torque all on")
        harness.wait_for(lambda: all(drive["torque"] for drive in line.good("counts")["drives"]), "torque")
        answer = line.press("jog 3 5")
        for counter in range(1, 21):
            time.sleep(0.05)
            answer = line.good(f"beat {answer['series']} {counter} {answer['tick']}")
        time.sleep(0.25 + 0.2)  # nobody is there any more
        moved = [drive["counts"] for drive in line.good("counts")["drives"]]
        assert 3 * MM < moved[2] - counts[2] < 7 * MM, (counts, moved)
        assert all(abs(after - before) < MM / 20 for i, (before, after) in enumerate(zip(counts, moved)) if i != 2), (counts, moved)
        assert "press again" in line.ask(f"beat {answer['series']} 99 {line.good('tick')['tick']}")["error"]
        time.sleep(0.5)
        rest = [drive["counts"] for drive in line.good("counts")["drives"]]
        assert abs(rest[2] - moved[2]) < MM / 20, (moved, rest)
        line.good("service-off")
    assert bench.stop(daemon) == 0, daemon.log.read_text(encoding="utf-8")
    bench.stop_drives()
    assert not bench.events("emergency") and not bench.events("jump"), (bench.events("emergency"), bench.events("jump"))


CASES = [
    ("is moved by hand in service, CSP", moved_by_hand),
    ("rises without a jump, all drives at once; the torque is off before the end", rises_without_a_jump),
    ("follows the demonstration, CSP", follows("csp", demo, 1)), ("follows streams, IP", follows("ip", streams, 2)), ("follows poses, PP", follows("pp", poses, 3)),
    ("rises at the fastest that --check allows, PP", rises_fast_in_profile_position),
    ("follows a stream on a bus of 1 Mbit/s", follows_on_a_bus_of_finite_speed),
    ("ends with 1 and names the drives that have not confirmed that their torque is off", ends_and_names_who_keeps_torque),
    ("ends at a second signal when the drives have taken their quick stop", second_signal_stops_the_drives),
    ("ends at a second signal, and says that a drive has not confirmed", lambda bench: second_signal_stops_the_drives(bench, is_one_stuck=True)),
]


def main():
    suite = tap.Suite()
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case in CASES:
        if wanted not in name:
            continue
        with suite.case(name), can_bench.RecordedBench(sys.argv[1]) as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
