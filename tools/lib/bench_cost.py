# SPDX-License-Identifier: MIT
"""bench_cost.py - the subcommand cost of tools/bench: time and instructions of what the gateway does, from tests/bench/bench_core.c."""
import json
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

# name in bench_core: (runs per round, runs under callgrind, what it is)
SUBJECTS = {
    "cycle-rest": (4000, 2000, "cycle, engaged and at rest, no frames"),
    "cycle-stream": (4000, 2000, "cycle, stream of A6 poses at 60 Hz"),
    "motion-stream": (4000, 2000, "of it planning, kinematics, limiting of 6+1 axes, all moving"),
    "cycle-hostile": (4000, 4000, "cycle, another kind of frame every 7 cycles, holds between"),
    "cycle-flood": (200, 100, "cycle, 64 such frames in every cycle (the most it takes)"),
    "frame-vendor": (4096, 4096, "frame of the vendor's document, A6 or A7, read"),
    "frame-a6": (4096, 4096, "frame A6, three decimals, read"),
    "frame-a7": (4096, 4096, "frame A7, six decimals, read"),
    "inverse": (4096, 4096, "inverse kinematics of a hexapod"),
    "forward-warm": (4096, 2048, "forward kinematics, from 0.5 mm and 0.05 deg beside"),
    "forward-cold": (4096, 2048, "forward kinematics, from pose zero"),
    "can-period": (2000, 2000, "bus period (4 cycles) of 6+1 CiA 402 drives, simulated bus"),
    "can-wire": (2000, 2000, "of it the simulated bus and its peers"),
}
CYCLE_NS = 1_000_000
GOAL_NS = 5000  # of motion-stream
SUMMARY = re.compile(r"^(?:summary|totals): (\d+)", re.MULTILINE)


class CostError(Exception):
    """The program could not be run."""


def output_of(*command):
    result = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise CostError(f"{Path(command[0]).name} ended with status {result.returncode}: {result.stderr.strip()[-300:]}")
    return result.stdout


def percentile(values, share):
    """The smallest value that at least this share of the values does not exceed."""
    ordered = sorted(values)
    return ordered[max(0, -(-len(ordered) * share // 100) - 1)]


def timed(program, name, runs, rounds):
    lines = output_of(program, name, runs, rounds).split("\n")
    values = [float(line) for line in lines if line[:1].isdigit()]
    words = {line.split()[0]: [float(part) for part in line.split()[1:]] for line in lines if line[:1].isalpha()}
    return {"rounds": rounds, "runs_per_round": runs, "ns_median": statistics.median(values), "ns_min": min(values), "ns_p95": percentile(values, 95),
            "single_ns": dict(zip(("p50", "p99", "p999"), words["single"])), **({"frames": words["frames"][0]} if "frames" in words else {})}


def instructions_of(program, name, runs, *others):
    """Per run, as callgrind counts them; None without valgrind."""
    if not shutil.which("valgrind"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "callgrind.out"
        output_of("valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", "--toggle-collect=bench_region*", program, name, runs, *others)
        match = SUMMARY.search(out.read_text(encoding="utf-8", errors="replace"))
    if not match or not int(match[1]):
        raise CostError("callgrind's output holds no count")
    return int(match[1]) / runs


def processor():
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            return next((line.split(":", 1)[1].strip() for line in file if line.startswith("model name")), "unknown")
    except OSError:
        return "unknown"


def can_summary(period, wire):
    """What the driver does for each frame: the period without what only simulates its surroundings. Of runs timed one by one, which other work disturbs least."""
    driver_ns, frames = period["single_ns"]["p50"] - wire["single_ns"]["p50"], period["frames"]
    counted = "" if period["instructions"] is None else f", {(period['instructions'] - wire['instructions']) / frames:.0f} instructions"
    return (f"driver of 6+1 CiA 402 drives: {driver_ns:.0f} ns a bus period of {frames:.1f} frames, {driver_ns / (4 * CYCLE_NS):.2%} of 4 ms; "
            f"{driver_ns / frames:.0f} ns{counted} a frame, {1e9 * frames / driver_ns / 1e6:.2f} million frames/s where nothing else were to do; "
            f"the bus carries {frames / 0.004:.0f} frames/s")


def run(program, rounds, as_json, say, out=sys.stdout):
    has_valgrind = shutil.which("valgrind") is not None
    if not has_valgrind:
        say("no instruction counts: valgrind is not installed (apt-get install valgrind)")
    if not as_json:
        print(f"processor: {processor()}. ns per run: median, least and 95th percentile of {rounds} rounds; then of runs timed one by one, "
              "clock taken off\n"
              f"{'':62}{'median':>9}{'min':>9}{'p95':>9}{'one: p50':>11}{'p99':>9}{'p99.9':>9}{'runs':>9}{'instructions':>14}", file=out)
    result = {"processor": processor(), "subjects": {}}
    for name, (runs, counted, text) in SUBJECTS.items():
        row = timed(program, name, runs, rounds)
        row["instructions"] = instructions_of(program, name, counted)
        row["instructions_runs"] = counted if has_valgrind else 0
        result["subjects"][name] = row
        if not as_json:
            one, ir = row["single_ns"], row["instructions"]
            print(f"{text:62}{row['ns_median']:9.0f}{row['ns_min']:9.0f}{row['ns_p95']:9.0f}{one['p50']:11.0f}{one['p99']:9.0f}{one['p999']:9.0f}"
                  f"{runs * rounds:9}{'-' if ir is None else f'{ir:.0f}':>14}", file=out, flush=True)
    motion = result["subjects"]["motion-stream"]
    if as_json:
        json.dump(result, out, indent=1)
        print(file=out)
    else:
        counted = "" if motion["instructions"] is None else f", {motion['instructions']:.0f} instructions"
        print(f"\nplanning, kinematics and limiting of 6+1 axes: {motion['ns_median']:.0f} ns a cycle, {motion['ns_median'] / CYCLE_NS:.2%} of 1 ms, "
              f"{motion['ns_median'] / GOAL_NS:.0%} of the {GOAL_NS / 1000:.0f} us aimed at{counted}", file=out)
        print(can_summary(result["subjects"]["can-period"], result["subjects"]["can-wire"]), file=out)
        print("instructions: callgrind, mean over " + ", ".join(f"{counted} ({name})" for name, (_, counted, _) in SUBJECTS.items())
              + "\nThe gateway stands between devices that do nothing; a cycle of the stream includes its share of frames. A bus period: SYNC, seven set-points, "
              "their echoes, seven answers, heartbeats.", file=out)
