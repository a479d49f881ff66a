# SPDX-License-Identifier: MIT
"""latency_run.py HEAVED DRIVES BUS FRAMES IS-WATCHED RESULT - one run of tools/bench latency: heaved as it runs on a platform, with the drives of
tests/bench/bench_latency.c on BUS: modbus, can (vcan0), or slow-can (the same, where each frame takes its time). On CAN inside kernel.py.

Leaves in RESULT what was measured, as JSON, or {"error": why it was not}."""
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

sys.path.append(str(TOP / "tests/lib"))
import vcan  # noqa: E402  the path above has to be set first

# Where heaved listens, and drives that tell a nanometre.
COMMON = {"engage": "manual\nlate_hold_cycles = 0", "silence_hold_ms": "3000", "counts_per_mm": "1000000/1"}
PRESETS = {
    "modbus": ("modbus-tcp-hexapod.ini", {"timeout_ms": "900", "step_mm": "5\nfeedback_timeout_ms = 6000"}),
    "can": ("hexapod-cia402.ini", {"interface": "vcan0", "when_gateway_lost": "fault\nheartbeat_timeout_ms = 1000"}),
}
WAIT_S = 60
STOPS_MAX = 5
LOST_US = 2e6  # so long is waited for set-points
LOOK_S = 0.1


class LatencyError(Exception):
    """heaved or the drives did not do what the measurement needs."""


class StartError(LatencyError):
    """The platform did not come up, which on a machine that stands for long it may not."""


def kind_of(bus):
    return "can" if bus.endswith("can") else bus


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def config_for(folder, bus, ports, port):
    """The preset with these drives."""
    name, own = PRESETS[kind_of(bus)]
    changes = {**COMMON, **own, "port": str(port), **({"hosts": ", ".join(f"127.0.0.1:{one}" for one in ports)} if ports else {})}
    text = (TOP / "config" / name).read_text(encoding="utf-8")
    for key, value in changes.items():
        text, count = re.subn(rf"^{key} = [^;\n]*", f"{key} = {value} ", text, flags=re.MULTILINE)
        assert count == 1, key
    path = folder / "latency.ini"
    path.write_text(f"{text}\n[control]\nsocket = {folder}/heaved.sock\n", encoding="utf-8")
    return path


class Daemon:
    def __init__(self, heaved, folder, config):
        self.ctl_program, self.socket = heaved.parent / "heavectl", folder / "heaved.sock"
        self.log = open(folder / "log", "w+", encoding="utf-8")
        self.process = subprocess.Popen([str(heaved), "--config", str(config)], stdout=subprocess.DEVNULL, stderr=self.log)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()  # its drives have gone: there is nothing to settle
        self.process.wait()
        self.log.close()

    def ctl(self, *words):
        return subprocess.run([str(self.ctl_program), "--socket", str(self.socket), *words], capture_output=True, text=True, check=False)

    def status(self):
        answer = self.ctl("--json", "status")
        return json.loads(answer.stdout) if answer.returncode == 0 else None

    def wait_for(self, condition, what):
        """The status of which the condition holds."""
        end = time.monotonic() + WAIT_S
        status = None
        while time.monotonic() < end and self.process.poll() is None:
            status = self.status()
            if status and condition(status):
                return status
            if status and status["state"] == "FAULT":
                break
            time.sleep(LOOK_S)
        if self.process.poll() is not None:
            raise LatencyError(f"heaved ended with status {self.process.returncode}: {self.said()}")
        raise StartError(trouble_of(what, status) if status else f"heaved does not answer: {self.said()}")

    def said(self):
        self.log.flush()
        self.log.seek(0)
        return self.log.read()[-500:].strip()

    def engage(self):
        self.wait_for(lambda status: all(leg["drive"] == "disabled" for leg in status["cylinders"]), "drives that are all started up")
        answer = self.ctl("engage")
        if answer.returncode != 0:
            raise LatencyError(f"heaved does not engage: {answer.stderr.strip()}")
        self.wait_for(lambda status: status["state"] == "ENGAGED", "engaged platform")


def trouble_of(what, status):
    """What is not there, and which drives keep it from being."""
    drives = [leg["drive"] for leg in status["cylinders"]]
    usual = max(set(drives), key=drives.count)
    odd = [f"drive {number} is {drive}" for number, drive in enumerate(drives, 1) if drive != usual]
    fault = status.get("fault", {}).get("name", "none")
    return f"no {what}: the state is {status['state']}, fault {fault}; {', '.join(odd) + ', the others are' if odd else 'all drives are'} {usual}"


def lines_of(heaved, drives, bus, frames, is_watched):
    """What bench_latency printed, and heaved's own status at the end."""
    words = {"modbus": ["modbus"], "can": ["can", "vcan0"]}[kind_of(bus)]
    with tempfile.TemporaryDirectory(prefix="heave-latency.") as name, \
            subprocess.Popen([str(drives), *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as peer:
        try:
            folder, port = Path(name), free_port()
            ready = peer.stdout.readline()
            if not ready:
                raise LatencyError(peer.stderr.read().strip()[-300:])
            with Daemon(heaved, folder, config_for(folder, bus, ready.split(), port)) as daemon:
                daemon.engage()
                said, error = peer.communicate(f"{port} {frames + 1} {is_watched}\n")
                status = daemon.status()
        finally:
            peer.kill()
    if peer.returncode != 0:
        raise LatencyError(error.strip()[-300:])
    return said.splitlines(), status


def numbers(lines, what):
    return [[float(word) for word in line.split()[1:]] for line in lines if line.startswith(f"{what} ")]


def excuse(lines, status):
    """Why heaved stopped where it did: only for a machine that stood. LatencyError where it did not."""
    ((lost,),) = numbers(lines, "lost")
    before = max((frame[0] for frame in numbers(lines, "frame")), default=0)
    if not any(start < lost + LOST_US and end > before for start, end in numbers(lines, "stall")):
        raise LatencyError(trouble_of("set-point after a frame, and the machine did not stand", status))
    return status["fault"]["name"]


def measure(heaved, drives, bus, frames, is_watched):
    """Runs of bench_latency until there are so many frames: of each its frames and stalls; and what goes with them."""
    if bus == "slow-can":
        vcan.slow()
    runs, stops = [], []
    while (missing := frames - sum(len(run["frames"]) for run in runs)) > 0:
        try:
            lines, status = lines_of(heaved, drives, bus, missing, is_watched)
            if numbers(lines, "lost"):
                stops.append(excuse(lines, status))
            runs.append({"frames": numbers(lines, "frame"), "stalls": numbers(lines, "stall"), "is_urgent": "urgent 1" in lines,
                         "is_realtime": status["realtime"], "heaved_us": status["frame_latency"]})
        except StartError as error:
            stops.append(str(error))
        if len(stops) > STOPS_MAX:
            raise LatencyError(f"stopped {len(stops)} times, at last: {stops[-1]}")
    return {"runs": runs, "stops": stops, "is_uml": "HEAVE_OWN_KERNEL" in os.environ}


def main():
    heaved, drives, bus, frames, is_watched, result = sys.argv[1:]
    try:
        found = measure(Path(heaved), Path(drives), bus, int(frames), int(is_watched))
    except (LatencyError, OSError, subprocess.SubprocessError) as error:
        found = {"error": str(error)}
    Path(result).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main()
