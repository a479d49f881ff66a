# SPDX-License-Identifier: MIT
"""bench_latency.py - the subcommand latency of tools/bench: from a datagram to the set-points on the bus, heaved as it runs on a platform, measured by
latency_run.py; here what is measured where, and what of it counts."""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from bench_build import TOP
from bench_cost import processor
from bench_peers import STOLEN_MAX, stolen_share, stolen_ticks
from latency_run import LatencyError, kind_of

sys.path.append(str(TOP / "tests/lib"))
import kernel  # noqa: E402  the path above has to be set first
import tap  # noqa: E402

# name: (bus of latency_run.py, whether on virtual time, what it is)
PARTS = {
    "can-design": ("slow-can", True, "six CiA 402 drives on a CAN bus of 1 Mbit/s, by design: virtual time, computing takes none"),
    "modbus-design": ("modbus", True, "six drives on Modbus TCP, by design: virtual time, computing takes none"),
    "can": ("can", False, "six CiA 402 drives on vcan, which has no bus time, real time"),
    "modbus": ("modbus", False, "six drives on Modbus TCP over loopback, real time"),
}
# Of a frame, us: what latency_run.py tells.
SENT, RETURNED, FIRST, LAST, BEGUN, ACTING, LATE = range(7)
# A frame counts where the machine did what it was asked to around it, which is looked at for the same time whatever came of the frame.
BEFORE_US = 1000
AFTER_US = 12000   # longer than the longest way by design
SENDING_MAX_US = 500
WAKE_MAX_US = 1000
LEFT_OUT_MAX = 0.1
FRAME_S = 0.4
START_S = 120
VIRTUAL_S = 3      # at most, for a frame and 200 s
PER_MILLE = {"p50": 500, "p99": 990, "p99.9": 999, "max": 1000}


# --- What counts ---

def is_valid(frame, stalls):
    """Neither was the sender held up, nor did a processor stand."""
    start, end = frame[SENT] - BEFORE_US, max(frame[SENT] + AFTER_US, frame[LAST])
    is_held_up = frame[RETURNED] - frame[SENT] > SENDING_MAX_US or frame[LATE] > WAKE_MAX_US
    return not is_held_up and not any(begin < end and stop > start for begin, stop in stalls)


def tail_of(values):
    """Mean, percentiles beyond which there is a frame, and the largest; of nothing, nothing."""
    if not values:
        return {}
    ordered = sorted(values)
    count = len(ordered)
    known = {name: ordered[-(-count * share // 1000) - 1] for name, share in PER_MILLE.items() if share == 1000 or count * (1000 - share) >= 1000}
    return {"mean": sum(ordered) / count, **known}


def parts_of(kind, frames):
    """What the way is made of; a datagram that came while the cycle of its period ran has not waited."""
    ways = {"on the bus: to the last of six set-points": [frame[LAST] - frame[SENT] for frame in frames]}
    if kind != "can":
        return {**ways, "of it to the first one": [frame[FIRST] - frame[SENT] for frame in frames]}
    begun = [max(frame[BEGUN], frame[SENT]) for frame in frames]
    return {**ways, "of it to the SYNC of its period (waiting)": [at - frame[SENT] for at, frame in zip(begun, frames)],
            "of it from there to the first set-point": [frame[FIRST] - at for at, frame in zip(begun, frames)],
            "of it from there to the last one": [frame[LAST] - frame[FIRST] for frame in frames],
            "acting: to the SYNC after the last one": [frame[ACTING] - frame[SENT] for frame in frames]}


def doubt(all_frames, valid, stolen):
    """Why the figures do not count; None where they do."""
    left_out = 1 - valid / all_frames
    if left_out > LEFT_OUT_MAX:
        return f"the machine stood, or held the sender up, during {left_out:.0%} of the frames"
    return f"{stolen:.0%} of the CPU stolen" if stolen > STOLEN_MAX else None


def judge(kind, found, stolen):
    frames = [frame for run in found["runs"] for frame in run["frames"]]
    valid = [frame for run in found["runs"] for frame in run["frames"] if is_valid(frame, run["stalls"])]
    return {"frames": len(frames), "left_out": len(frames) - len(valid), "stops": found["stops"], "stolen": stolen, "doubt": doubt(len(frames), len(valid), stolen),
            "is_uml": found["is_uml"], "is_urgent": all(run["is_urgent"] for run in found["runs"]), "is_realtime": all(run["is_realtime"] for run in found["runs"]),
            "us": {name: tail_of(values) for name, values in parts_of(kind, valid).items()}, "heaved_us": found["runs"][-1]["heaved_us"]}


# --- What is told ---

def line_of(what, figures, names):
    return f"  {what:44}" + "".join(f"{figures[name]:10.0f}" if name in figures else f"{'-':>10}" for name in names)


def notes_of(result):
    """What has to be known of the figures."""
    notes = []
    if result["is_uml"] and not result["is_virtual"]:
        notes.append("in User Mode Linux, as this machine's kernel gives no vcan: its system calls cost more, so that these are upper bounds")
    if result["stops"]:
        notes.append(f"started again {len(result['stops'])} times, for what the machine did: {'; '.join(result['stops'])}")
    if not result["is_virtual"] and not (result["is_urgent"] and result["is_realtime"]):
        notes.append("without real-time priority, which was not permitted: as root, or with a limit rtprio, heaved is in time also beside other work")
    return notes


def lines_of(name, result):
    head = f"{PARTS[name][2]}"
    if result["doubt"]:
        return [head, f"  spread too wide ({result['doubt']}): no figure. Measure again on an idle machine; --json has what was measured"]
    names = ["mean", *PER_MILLE]
    heaved = {name: result["heaved_us"].get(key) for name, key in (("p50", "p50_us"), ("p99", "p99_us"), ("max", "max_us"))}
    return [head, f"  {result['frames'] - result['left_out']} frames, {result['left_out']} left out; us from sending a datagram".ljust(46) + "".join(f"{each:>10}" for each in names),
            *(line_of(what, figures, names) for what, figures in result["us"].items()),
            line_of("heaved's own count: kernel to end of cycle", heaved, names), *(f"  {note}" for note in notes_of(result))]


# --- Measuring ---

def missing_kernel(reason):
    return (f"{reason}. Either a kernel of one's own (tools/heave-lab build makes it once, some minutes; User Mode Linux, any x86_64 machine, no rights needed), "
            "or on real time vcan of this machine's kernel: modprobe vcan as root (Debian's package linux-image-amd64 has it), and run this as root or where users "
            "may make name spaces")


def run_part(name, heaved, drives, frames):
    """What latency_run.py leaves."""
    bus, is_virtual, _ = PARTS[name]
    with tempfile.TemporaryDirectory(prefix="heave-latency.") as folder:
        result = Path(folder) / "result.json"
        command = [sys.executable, TOP / "tools/lib/latency_run.py", heaved, drives, bus, str(frames), str(int(not is_virtual)), result]
        if name == "modbus":
            output = subprocess.run(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False).stdout
        else:
            limit_s = START_S + (VIRTUAL_S if is_virtual else 2 * FRAME_S) * frames + 200
            try:
                output = kernel.run(command, virtual_time=is_virtual, limit_s=limit_s, is_ahead=True).output
            except tap.Skip as reason:
                raise LatencyError(missing_kernel(reason)) from reason
        if not result.exists():
            raise LatencyError(f"no result: {output.strip()[-500:]}")
        found = json.loads(result.read_text(encoding="utf-8"))
    if "error" in found:
        raise LatencyError(found["error"])
    return found


def measured(name, heaved, drives, frames):
    before = stolen_ticks()
    found = run_part(name, heaved, drives, frames)
    is_virtual = PARTS[name][1]
    stolen = 0 if is_virtual else stolen_share(before, stolen_ticks())
    return {"is_virtual": is_virtual, **judge(kind_of(PARTS[name][0]), found, stolen)}


def run(heaved, drives, frames, only, as_json, say, out=sys.stdout):
    result = {"processor": processor(), "load": os.getloadavg()[0], "parts": {}}
    failed = None
    if not as_json:
        print(f"{result['processor']}, load {result['load']:.1f}", file=out, flush=True)
    for name in only or PARTS:
        say(f"{name}: {frames} frames, about {frames * FRAME_S + 10:.0f} s")
        try:
            result["parts"][name] = measured(name, heaved, drives, frames)
        except LatencyError as error:
            failed = LatencyError(f"{name}: {error}")
            say(failed)
            continue
        if not as_json:
            print(*lines_of(name, result["parts"][name]), sep="\n", file=out, flush=True)
    if as_json:
        json.dump(result, out, indent=1)
        print(file=out)
    if failed:
        raise LatencyError("not all could be measured")
