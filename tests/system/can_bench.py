# SPDX-License-Identifier: MIT
"""can_bench.py - a platform whose drives are simulated CiA 402 drives on vcan0, for system tests inside kernel.py --virtual-time --python.

    with CanBench(bin_dir) as bench:
        bench.start_drives(plan=[{"after_enabled": 1, "drive": 3, "do": "reboot"}])
        daemon = bench.start()
        ...
        bench.do("fault", drive=2)                now
        bench.events("state", node=2)             what happened to it, with times
        bench.positions()                         one row per SYNC: time, targets, actuals
"""
import json
import sys

import can_judge
import forked
import harness
import vcan

sys.path.append(str(harness.TOP / "tests/peers"))
import can_drives  # noqa: E402  the path above has to be set first
import can_record  # noqa: E402

COUNTS_PER_MM = 1000
SETTLED_MM = 5
CYLINDERS = 6
NODES = range(1, CYLINDERS + 2)  # the last one is the rotation motor


class CanBench(harness.Bench):
    def __init__(self, bin_dir, **changes):
        super().__init__(bin_dir, **changes)
        self.drives = None
        self.log = self.folder / "drives.jsonl"
        self.trace = self.folder / "drives.csv"

    def __exit__(self, *exception):
        self.stop_drives()
        self.fast_bus()
        super().__exit__(*exception)

    slow_bus = staticmethod(vcan.slow)
    fast_bus = staticmethod(vcan.fast)

    def start_drives(self, plan=(), each=None, only=None):
        """each: keys of all drives; only: {node: keys} of single ones. Positions are those of a settled platform."""
        entries = [{"node": node, "position": SETTLED_MM * COUNTS_PER_MM if node <= CYLINDERS else 0, **(each or {}), **(only or {}).get(node, {})}
                   for node in NODES]
        config = self.file("drives.json", json.dumps({"log": str(self.log), "trace": str(self.trace), "drives": entries, "plan": list(plan)}))
        self.drives = forked.Forked(can_drives.main, config, "--follow")
        assert self.drives.stdout.readline() == "ready\n", "the simulated drives do not start"

    def stop_drives(self):
        if self.drives:
            self.drives.stdin.close()
            self.drives.wait(timeout=harness.WAIT_S)
            self.drives.stdout.close()
            self.drives = None

    def do(self, action, drive, **arguments):
        self.drives.stdin.write(json.dumps({"drive": drive, "do": action, **arguments}) + "\n")
        self.drives.stdin.flush()

    def events(self, name=None, node=None):
        rows = [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()]
        return [row for row in rows if name in (None, row["event"]) and node in (None, row["node"])]

    def statistics(self):
        """Of each drive, after stop_drives()."""
        return {row["node"]: row["value"] for row in self.events("statistics")}

    def positions(self):
        """After stop_drives(): (time_us, [target], [actual]) per SYNC, counts; None for a drive without power."""
        rows = []
        for line in self.trace.read_text(encoding="utf-8").splitlines():
            time_us, *values = [int(value) if value else None for value in line.split(",")]
            rows.append((time_us, values[0::2], values[1::2]))
        return rows


class Recorder(harness.Bench):
    """A recorder of vcan0 beside whatever platform."""

    def __init__(self, bin_dir, **changes):
        super().__init__(bin_dir, **changes)
        self.recording = self.folder / "bus.log"
        self.recorder = forked.Forked(can_record.main, "vcan0", self.recording)
        assert self.recorder.stdout.readline() == "ready\n", "the recorder does not start"

    def __exit__(self, *exception):
        self.end_recorder()
        super().__exit__(*exception)

    def end_recorder(self):
        if self.recorder:
            self.recorder.stdin.close()
            self.recorder.wait(timeout=harness.WAIT_S)
            self.recorder.stdout.close()
            self.recorder = None


class RecordedBench(Recorder, CanBench):
    """Drives of tests/peers with a recorder beside them."""

    def record(self):
        """What was on the bus; ends the drives and the recorder."""
        self.stop_drives()
        self.end_recorder()
        return can_judge.Record(self.recording, NODES)
