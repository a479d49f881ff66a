#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_canraw.py BIN [PART OF A NAME [KILLS]] - the daemon on drives with CAN frames of their own, on vcan, on virtual time. Runs inside kernel.py.

What is on the bus is judged by the DBC file of the same configuration and cantools, never by code of the driver."""
import math
import random
import signal
import sys
import time

import can_bench
import cantools
import harness
import tap
import twin_bench

PRESET = harness.TOP / "config/can-raw-hexapod.ini"
CYLINDERS = 6
COUNTS_PER_MM = 2000
FIRST_ID, FIRST_REPLY = 0x601, 0x581
PERIOD_US = 4000
JITTER_US = 100
BOOT_S = 0.5  # of the drives
KILLS = 6
SETPOINT = b"\x01\x05"
QUESTIONS = (b"\x00\x15", b"\x00\x12")  # where it is, and whether it is homed
REPLY_BYTES = 6  # to the first one
LIMITS = (300.0, 3000.0, 50000.0)  # speed_mm_s, accel_mm_s2, jerk_mm_s3 of the preset


class RawBench(can_bench.Recorder, twin_bench.WithTwin):
    """The preset on vcan0, rising by itself, with heave-twin's drives and a recorder beside them."""

    def __init__(self, bin_dir, start):
        super().__init__(bin_dir)
        text = PRESET.read_text(encoding="utf-8")
        for pattern, by in (("interface = can0", "interface = vcan0"), ("engage = manual", "engage = auto"), ("port = 9800", f"port = {self.port}")):
            assert text.count(pattern) == 1, pattern
            text = text.replace(pattern, by)
        self.config = self.file("raw.ini", f"{text}\n[control]\nsocket = {self.socket}\n")
        middle_mm, beside = start
        self.start_twin("--homed", "--start", middle_mm, "--zero", ",".join(f"{k + 1}={counts}" for k, counts in enumerate(beside)))
        time.sleep(BOOT_S)

    def setpoints(self):
        """Of each drive, at the end: where it said before the first set-point that it stood, and (time_us, mm) of each set-point, as cantools reads both. All that heaved
        has sent is of its map."""
        self.end_recorder()
        database = cantools.database.load_string(self.heaved("--config", self.config, "--dump-dbc").stdout, "dbc")
        starts, rows = {}, {FIRST_ID + k: [] for k in range(CYLINDERS)}
        for line in self.recording.read_text(encoding="ascii").splitlines():
            when, identifier, data = line.split(" ")
            identifier, data = int(identifier, 16), bytes.fromhex(data)
            if identifier in rows and data[:2] == SETPOINT:
                signals = database.decode_message(identifier, data)
                assert str(signals["kind"]) == "setpoint" and signals["speed"] == 2000, signals
                rows[identifier].append((int(when), signals["position"]))
            elif identifier in rows:
                assert data in QUESTIONS, f"{identifier:x}: {data.hex()} is no frame of these drives"
            elif len(data) == REPLY_BYTES and not rows[identifier - FIRST_REPLY + FIRST_ID]:
                starts[identifier - FIRST_REPLY + FIRST_ID] = database.decode_message(identifier, data)["position"]
        return [(starts[identifier], rows[identifier]) for identifier in sorted(rows)]


def wave(t):
    return f"@A6:{6 * math.sin(2 * t):.3f},{5 * math.sin(1.7 * t):.3f},0,0,0,{100 + 20 * math.sin(1.3 * t):.3f},0#"


def random_start(source):
    """A platform that somebody left anywhere: cylinders within a few mm of each other, as a rigid plate allows."""
    return round(source.uniform(20, 250), 3), [round(source.uniform(-3, 3) * COUNTS_PER_MM) for _ in range(CYLINDERS)]


def check_limits(start_mm, rows):
    """Differences per bus period, first to third, within the limits and what rounding to counts may add."""
    values = [start_mm] * 3 + [mm for _, mm in rows]
    period_s = PERIOD_US / 1e6
    for order, limit in enumerate(LIMITS, 1):
        values = [after - before for before, after in zip(values, values[1:])]
        most = limit * period_s**order + 2 ** (order - 1) / COUNTS_PER_MM + 1e-9
        worst = max(map(abs, values))
        assert worst <= most, f"difference {order}: {worst:.5f} mm, allowed {most:.5f} mm"


# --- Cases ---

def follows_and_keeps_its_limits(bench, source):
    trace = bench.folder / "trace.csv"
    daemon = bench.start("--trace", trace)
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(3, wave)
    assert bench.status()["state"] == "ENGAGED"
    assert bench.stop(daemon) == 0
    columns = [[float(row[f"c{k + 1}_mm"]) for row in harness.rows_of(trace.read_bytes())] for k in range(CYLINDERS)]
    for k, (start_mm, rows) in enumerate(bench.setpoints()):
        assert abs(rows[0][1] - start_mm) <= 1 / COUNTS_PER_MM, f"first set-point {rows[0][1]}, the drive stood at {start_mm}"
        gaps = {after - before for (before, _), (after, _) in zip(rows, rows[1:])}
        assert min(gaps) > PERIOD_US - JITTER_US and max(gaps) < PERIOD_US + JITTER_US, f"periods of {min(gaps)} to {max(gaps)} us"
        check_limits(start_mm, rows)
        sent = {round(mm * COUNTS_PER_MM) for _, mm in rows}
        assert max(sent) - min(sent) > 30 * COUNTS_PER_MM, "hardly moved"
        # the last rows of the trace, every fourth one: the same numbers in the same order
        asked = [[round(mm * COUNTS_PER_MM) for mm in columns[k][phase::4]] for phase in range(4)]
        tail = [round(mm * COUNTS_PER_MM) for _, mm in rows][-700:-200]
        text = ",".join(map(str, tail))
        assert any(text in ",".join(map(str, phase)) for phase in asked), "what was sent is not what was traced"


def is_not_moved_by_enabling(bench, source):
    """From anywhere: the first set-point is where the drive stands."""
    daemon = bench.start()
    bench.wait_state("ENGAGED", "RISING", "HOMING")
    time.sleep(source.uniform(0.1, 2))
    bench.stop(daemon, signal.SIGKILL)
    for start_mm, rows in bench.setpoints():
        assert rows and abs(rows[0][1] - start_mm) <= 1 / COUNTS_PER_MM, rows[:1]
        check_limits(start_mm, rows)


def life_s(source, turn):
    """From the start to the kill: mostly while the drives are enabled and lifted, each sixth time up to where they follow a sender."""
    return source.uniform(2, 6) if turn % 6 == 5 else source.uniform(0.05, 0.7)


def comes_back_after_a_kill(bench, source):
    kills = int(sys.argv[3]) if len(sys.argv) > 3 else KILLS
    for turn in range(kills):
        daemon = bench.start()
        with bench.sender() as sender:
            sender.stream(life_s(source, turn), wave)
        bench.stop(daemon, signal.SIGKILL)
        time.sleep(source.uniform(0.01, 0.2))
        bench.socket.unlink(missing_ok=True)
    worst = 0
    most_mm = LIMITS[0] * PERIOD_US / 1e6 + 1 / COUNTS_PER_MM
    for start_mm, rows in bench.setpoints():
        values = [start_mm, *(mm for _, mm in rows)]
        pauses = sum(after - before > 2 * PERIOD_US for (before, _), (after, _) in zip(rows, rows[1:]))
        assert pauses <= kills - 1, f"{pauses} pauses, {kills - 1} of them for a restart"
        assert pauses >= kills / 2, f"only {pauses} of {kills} starts came as far as set-points"
        assert max(abs(after - before) for before, after in zip(values, values[1:])) <= most_mm
        for index, ((before_us, before), (after_us, after)) in enumerate(zip(rows, rows[1:])):
            if after_us - before_us > 2 * PERIOD_US:
                assert abs(after - before) <= 1 / COUNTS_PER_MM, f"set-point {index}: {after - before:.4f} mm after a restart"
                worst = max(worst, round(abs(after - before) * COUNTS_PER_MM))
    print(f"# {kills} kills: first set-point after a restart at most {worst} count(s) from where the drive stood")


def silent_drives_stop_the_platform(bench, source):
    bench.start()
    bench.wait_state("ENGAGED")
    bench.twin.send_signal(signal.SIGSTOP)
    bench.wait_state("FAULT")
    bench.twin.send_signal(signal.SIGCONT)
    time.sleep(1)
    status = bench.status()
    assert status["state"] == "FAULT" and status["fault"]["name"] in ("drive-offline", "bus-lost"), status["fault"]


CASES = [
    ("follows a stream: the bytes on the bus are the set-points, within every limit", follows_and_keeps_its_limits, 1),
    ("is not moved by enabling, wherever it stands", is_not_moved_by_enabling, 2),
    ("is killed at any moment and comes back without a jump", comes_back_after_a_kill, 1),
    ("drives that fall silent stop the platform", silent_drives_stop_the_platform, 1),
]


def main():
    suite = tap.Suite()
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, case, times in CASES:
        for seed in range(times if wanted in name else 0):
            source = random.Random(seed)
            with suite.case(name if times == 1 else f"{name}, {seed + 1}"), RawBench(sys.argv[1], random_start(source)) as bench:
                case(bench, source)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
