#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""demo_report.py - the end of tools/demo: what both platforms made of the show, compared with what they should have.

usage: demo_report.py FOLDER HEXAPOD_CONFIG TRIPOD_CONFIG

Reads what demo_sender.py left in FOLDER (hexapod.json, tripod.json), and checks every set-point of both runs (hexapod.csv, tripod.csv)
with tools/check_trace. Exit status 0 only if everything is as expected; what is not stands in lines that start with "WRONG:".
"""
import json
import subprocess
import sys
from pathlib import Path

from demo_sender import ACCEPTED, CYLINDERS, SLIPS, expected

CHECK_TRACE = Path(__file__).resolve().parent.parent / "check_trace"
# How many of these the show may cause: none.
MUST_BE_ZERO = ["oversize", "receive_errors", "refused_senders", "lost_in_kernel", "not_followed", "impossible", "relay_errors", "faults"]


class Report:
    def __init__(self):
        self.wrong = 0

    def expect(self, what, got, wanted):
        if got != wanted:
            self.wrong += 1
            print(f"WRONG: {what}: {got}, expected {wanted}")

    def compare(self, status, count):
        counters, name = status["counters"], count.name
        self.expect(f"{name}: datagrams", counters["datagrams"], count.datagrams)
        self.expect(f"{name}: T forms accepted", counters["accepted_timed"], count.timed)
        for command, got in counters["accepted"].items():
            self.expect(f"{name}: {command} accepted", got, count.accepted.get(command, 0))
        for reason, got in counters["rejected"].items():
            self.expect(f"{name}: rejected for {reason}", got, count.rejected.get(reason, 0))
        for key in MUST_BE_ZERO:
            self.expect(f"{name}: {key}", counters[key], 0)
        self.expect(f"{name}: fault", status["fault"]["name"], "none")
        state = status["state"] + (" by silence" if status["held_by_silence"] else "")
        if name == "hexapod":  # the last frame for the tripod came long before
            self.expect(f"{name}: state at the end of the show", state, "ENGAGED")
        elif state not in ("ENGAGED", "HOLD by silence"):
            self.expect(f"{name}: state at the end of the show", state, "HOLD by silence")

    def check_limits(self, checks):
        for name, process in checks.items():
            output = process.communicate()[0]
            if process.returncode == 2 or not output.startswith("{"):
                self.wrong += 1
                print(f"WRONG: {name}: the set-points cannot be checked: {output.strip()}")
                continue
            result = json.loads(output)
            self.expect(f"{name}: set-points beyond a limit", result["violations"], 0)
            print(f"{name:9}{result['rows']} set-points of each cylinder checked: {result['violations']} beyond a limit")


def print_table(status, counts):
    print(f"{'command':9}{'sent':>5}   " + "".join(f"{CYLINDERS[name] + ' cylinders':26}" for name in counts).rstrip())
    for command in sorted(set().union(*ACCEPTED.values())):
        accepted = {name: status[name]["counters"]["accepted"][command] for name in counts}
        cells = [f"{accepted[name]} accepted" if accepted[name] or command in ACCEPTED[name] else "rejected: not for it" for name in counts]
        sent = max(count.accepted.get(command, 0) for count in counts.values())
        print(f"{command:9}{sent:5}   " + "".join(f"{cell:26}" for cell in cells).rstrip())
    for reason in SLIPS.values():
        cells = [f"{status[name]['counters']['rejected'][reason]} rejected: {reason}" for name in counts]
        print(f"{'misprint':9}{1:5}   " + "".join(f"{cell:26}" for cell in cells).rstrip())


def print_cycles(status):
    for name, one in status.items():
        wake = one["wake_latency"]
        print(f"{name:9}{one['cycle']} cycles, {one['late_cycles']} skipped; late by {wake['p50_us']} us (median), {wake['p99_us']} us (99 %), {wake['max_us']} us (most)"
              f"{'' if one['realtime'] else ', no real-time priority'}")


def main():
    folder, configs = Path(sys.argv[1]), dict(zip(("hexapod", "tripod"), sys.argv[2:4]))
    checks = {name: subprocess.Popen([sys.executable, CHECK_TRACE, "--json", config, folder / f"{name}.csv"], stdin=subprocess.DEVNULL,
                                     stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) for name, config in configs.items()}
    counts = expected()
    status = {name: json.loads((folder / f"{name}.json").read_text(encoding="ascii")) for name in counts}
    report = Report()
    print_table(status, counts)
    for name, count in counts.items():
        report.compare(status[name], count)
    report.check_limits(checks)
    print_cycles(status)
    print(f"{report.wrong} not as expected." if report.wrong else "Everything as expected.")
    return 1 if report.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
