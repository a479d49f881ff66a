# SPDX-License-Identifier: MIT
"""bench_latency.py - the subcommand latency of tools/bench: from a datagram to the set-points on the bus, heaved as it runs on a platform,
with the drives of tests/bench/bench_latency.c."""
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from bench_build import TOP
from bench_cost import processor
from bench_peers import STOLEN_MAX, stolen_share, stolen_ticks

CONFIG = TOP / "config/modbus-tcp-hexapod.ini"
WAIT_S = 60
WAKE_MAX_US = 1000  # of the sender's pauses, one in 100 may last so much too long: else the machine is not free to serve anybody in time
PER_MILLE = {"p50": 500, "p99": 990, "p99.9": 999, "max": 1000}


class LatencyError(Exception):
    """heaved did not do what the measurement needs."""


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def config_for(folder, ports, port):
    """The preset with these drives, which tell a nanometre."""
    changes = {"hosts": ", ".join(f"127.0.0.1:{one}" for one in ports), "port": str(port), "counts_per_mm": "1000000/1", "timeout_ms": "900",
               "engage": "manual\nlate_hold_cycles = 0", "step_mm": "5\nfeedback_timeout_ms = 6000"}
    text = CONFIG.read_text(encoding="utf-8")
    for key, value in changes.items():
        text, count = re.subn(rf"^{key} = [^;\n]*", f"{key} = {value} ", text, flags=re.MULTILINE)
        assert count == 1, key
    path = folder / "latency.ini"
    path.write_text(f"{text}\n[control]\nsocket = {folder}/heaved.sock\n", encoding="utf-8")
    return path


def wait_for(condition, what, daemon):
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if daemon.poll() is not None:
            raise LatencyError(f"heaved ended with status {daemon.returncode}: {daemon.stderr.read()[-500:]}")
        if condition():
            return
        time.sleep(0.05)
    raise LatencyError(f"{what}: not within {WAIT_S} s")


def engage(heaved, folder, daemon):
    def ctl(*words):
        return subprocess.run([str(heaved.parent / "heavectl"), "--socket", f"{folder}/heaved.sock", *words], capture_output=True, text=True, check=False)

    def status():
        answer = ctl("--json", "status")
        return json.loads(answer.stdout) if answer.returncode == 0 else {"state": "", "cylinders": [{"drive": ""}]}

    wait_for(lambda: all(leg["drive"] == "disabled" for leg in status()["cylinders"]), "the drives are started up", daemon)
    if ctl("engage").returncode != 0:
        raise LatencyError("heaved does not engage")
    wait_for(lambda: status()["state"] == "ENGAGED", "the platform is engaged", daemon)


def rows_of(heaved, drives, frames):
    """Of each frame: us until the first drive's set-point, until the last one's, and how much too long the sender's pause was."""
    with tempfile.TemporaryDirectory(prefix="heave-latency.") as name, \
            subprocess.Popen([str(drives)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as peer:
        folder, port = Path(name), free_port()
        config = config_for(folder, peer.stdout.readline().split(), port)
        with subprocess.Popen([str(heaved), "--config", str(config)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as daemon:
            try:
                engage(heaved, folder, daemon)
                said, error = peer.communicate(f"{port} {frames + 1}\n")
            finally:
                peer.kill()
                daemon.terminate()
    if peer.returncode != 0:
        raise LatencyError(f"{drives.name} ended with status {peer.returncode}: {error.strip()[-300:]}")
    return [tuple(map(float, line.split())) for line in said.splitlines()]


def tail_of(values):
    ordered = sorted(values)
    return {name: ordered[-(-len(ordered) * share // 1000) - 1] for name, share in PER_MILLE.items()}


def doubt(wake_p99_us, stolen):
    """Why the figures do not count; None where they do."""
    if wake_p99_us > WAKE_MAX_US:
        return f"the machine is busy: one in 100 pauses of the sender was {wake_p99_us / 1000:.1f} ms too long"
    return f"{stolen:.0%} of the CPU stolen" if stolen > STOLEN_MAX else None


def judge(rows, stolen):
    first, last, late = zip(*rows)
    return {"frames": len(rows), "first_us": tail_of(first), "last_us": tail_of(last), "sender_late_us": tail_of(late), "stolen": stolen,
            "doubt": doubt(tail_of(late)["p99"], stolen)}


def line_of(what, figures):
    return f"{what:44}" + "".join(f"{figures[name]:10.0f}" for name in figures)


def lines_of(result):
    if result["doubt"]:
        return [f"spread too wide ({result['doubt']}): no figure. Measure again on an idle machine; --json has what was measured"]
    return [f"{result['frames']} frames, us from sending a datagram" + "".join(f"{name:>10}" for name in result["first_us"]),
            line_of("to the first drive's set-point", result["first_us"]), line_of("to that of the last of six", result["last_us"]),
            line_of("by how much the sender's own pauses were late", result["sender_late_us"])]


def run(heaved, drives, frames, as_json, say, out=sys.stdout):
    say(f"{frames} frames, {frames * 0.33:.0f} s")
    before = stolen_ticks()
    load = os.getloadavg()[0]
    rows = rows_of(heaved, drives, frames)
    result = {"processor": processor(), "load": load, **judge(rows, stolen_share(before, stolen_ticks()))}
    if as_json:
        json.dump(result, out, indent=1)
        print(file=out)
    else:
        print(f"{result['processor']}, load {load:.1f}", *lines_of(result), sep="\n", file=out)
