#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""can_drives.py CONFIG.json - simulated CiA 402 drives on a CAN interface; ends by SIGTERM, or with its standard input where --follow is given.

    {"interface": "vcan0", "log": "events.jsonl", "trace": "positions.csv",
     "drives": [{"node": 1, "position": 5000, ...}, ...],          keys: DEFAULTS of drive.py
     "plan": [{"at": 2.5, "drive": 1, "do": "fault", "code": 8976},   keys: ACTIONS of faults.py; drive: node, or "all"
              {"after_enabled": 1.0, "drive": 3, "do": "reboot"}]}

at: seconds since the start; after_enabled: seconds since all drives were enabled for the first time. --follow: each line of the standard
input is such an entry, done at once (at 0).
The log has a line for each event of a drive, the last one their statistics; the trace a row per SYNC: time, then target and actual of each.
Everything runs in one thread, so that on virtual time every run is the same.
"""
import json
import os
import select
import signal
import sys
import time

import faults
from drive import Drive
from wire import Wire

LOOK_US = 1000  # how often an axis with torque is looked at


def now_us():
    return time.monotonic_ns() // 1000


class Log:
    def __init__(self, path, start_us):
        self.file = open(path, "w", encoding="utf-8") if path else None
        self.start_us = start_us

    def __call__(self, time_us, node, event, value):
        if self.file:
            self.file.write(json.dumps({"t": (time_us - self.start_us) / 1e6 if time_us else 0, "node": node, "event": event, "value": value}) + "\n")
            self.file.flush()


class Drives:
    def __init__(self, config):
        self.start_us = now_us()
        self.log = Log(config.get("log"), self.start_us)
        self.wire = Wire(config.get("interface", "vcan0"))
        self.drives = [Drive(entry, self.wire, self.log, self.start_us) for entry in config["drives"]]
        self.trace = open(config["trace"], "w", encoding="utf-8") if config.get("trace") else None
        self.plan = list(config.get("plan", []))
        self.enabled_us = None
        self.is_ended = False
        for entry in self.plan:
            entry["due_us"] = self.start_us + round(entry["at"] * 1e6) if "at" in entry else None

    # --- Time ---

    def next_due_us(self, now):
        dues = [due for due in (drive.next_due_us() for drive in self.drives) if due is not None]
        dues += [entry["due_us"] for entry in self.plan if entry["due_us"] is not None]
        dues.append(now + (LOOK_US if any(drive.is_busy() for drive in self.drives) else 100000))
        return min(dues)

    def advance(self, now):
        for drive in self.drives:
            drive.advance(now)
        self.note_enabled(now)
        due = [entry for entry in self.plan if entry["due_us"] is not None and entry["due_us"] <= now]
        self.plan = [entry for entry in self.plan if entry not in due]
        for entry in due:
            self.act(entry, now)

    def note_enabled(self, now):
        if self.enabled_us is None and all(drive.is_powered and drive.machine.state == "operation enabled" for drive in self.drives):
            self.enabled_us = now
            self.log(now, 0, "all enabled", None)
            for entry in self.plan:
                if "after_enabled" in entry:
                    entry["due_us"] = now + round(entry["after_enabled"] * 1e6)

    def act(self, entry, now):
        arguments = {key: value for key, value in entry.items() if key not in ("at", "after_enabled", "due_us", "drive", "do")}
        for drive in self.drives:
            if entry["drive"] in ("all", drive.node):
                drive.now_us = now
                faults.act(drive, entry["do"], arguments)

    # --- The bus ---

    def hear(self, now):
        try:
            for identifier, is_remote, data in self.wire.heard():
                for drive in self.drives:
                    drive.now_us = now
                    drive.hear(identifier, data, is_remote)
                if identifier == 0x80:
                    self.trace_row(now)
        except OSError as error:
            self.log(now, 0, "bus", str(error))

    def trace_row(self, now):
        if self.trace:
            values = [f"{drive.target()},{drive.count()}" if drive.is_powered else "," for drive in self.drives]
            self.trace.write(f"{now - self.start_us},{','.join(values)}\n")

    # --- Life ---

    def run(self, follow):
        watched = [self.wire.fileno()] + ([sys.stdin.fileno()] if follow else [])
        waiting, now = b"", now_us()
        while not self.is_ended:
            ready, _, _ = select.select(watched, [], [], max(0, self.next_due_us(now) - now) / 1e6)
            now = now_us()
            if self.wire.fileno() in ready:
                self.hear(now)
            if follow and sys.stdin.fileno() in ready:
                heard = os.read(sys.stdin.fileno(), 65536)
                self.is_ended |= not heard
                *lines, waiting = (waiting + heard).split(b"\n")
                for line in lines:
                    self.act(json.loads(line), now)
            self.advance(now)
        self.end()

    def end(self):
        for drive in self.drives:
            self.log(now_us(), drive.node, "statistics", drive.stats)
        if self.trace:
            self.trace.close()
        self.wire.close()


def main():
    follow = "--follow" in sys.argv
    path = next(argument for argument in sys.argv[1:] if argument != "--follow")
    with open(path, encoding="utf-8") as file:
        drives = Drives(json.load(file))
    signal.signal(signal.SIGTERM, lambda *_: setattr(drives, "is_ended", True))
    print("ready", flush=True)
    drives.run(follow)


if __name__ == "__main__":
    main()
