# SPDX-License-Identifier: MIT
"""heave.py - what the system tests share: a platform in a temporary folder, the programs as child processes, a sender of frames."""
import json
import os
import re
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
WAIT_S = 60  # for anything that has to happen: says that it never will, not that it was slow
LOOK_S = 0.01  # between two looks whether it has


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, what):
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(LOOK_S)
    raise AssertionError(f"{what}: not within {WAIT_S} s")


class Bench:
    """A folder with a configuration of its own port and socket; ends what it started."""

    def __init__(self, bin_dir, **changes):
        self.bin = Path(bin_dir)
        self.temporary = tempfile.TemporaryDirectory(prefix="heave-")
        self.folder = Path(self.temporary.name)
        self.port = free_port()
        self.socket = self.folder / "heaved.sock"
        self.config = self.write_config("platform.ini", **changes)
        self.running = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for daemon in self.running:
            if daemon.poll() is None:
                daemon.kill()
            daemon.wait()
        self.temporary.cleanup()

    def write_config(self, name, source="demo-hexapod.ini", **changes):
        """The demonstration platform; a change is section__key="value"."""
        text = (TOP / "config" / source).read_text(encoding="utf-8")
        changes = {"udp__port": self.port, "control__socket": self.socket, **changes}
        for where, value in changes.items():
            section, key = where.split("__")
            pattern = re.compile(rf"(\[{section}\][^\[]*?^{key} *= *)[^;\n]*", re.MULTILINE | re.DOTALL)
            text, count = pattern.subn(lambda match, value=value: f"{match[1]}{value} ", text)
            assert count == 1, f"{where} found {count} times"
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return path

    def file(self, name, text):
        path = self.folder / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    def heaved(self, *arguments, **options):
        """Runs heaved to its end."""
        return subprocess.run([self.bin / "heaved", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                              timeout=60, check=False, **options)

    def play(self, frames, *arguments, config=None):
        trace = self.folder / "played.csv"
        run = self.heaved("--config", config or self.config, "--play", frames, "--trace", trace, *arguments)
        assert run.returncode == 0, f"exit {run.returncode}: {run.stderr}"
        return trace.read_bytes()

    def start(self, *arguments, config=None, environment=None):
        """Starts heaved live and waits until it answers."""
        log = open(self.folder / f"log{len(self.running)}", "w+b")
        daemon = subprocess.Popen([self.bin / "heaved", "--config", str(config or self.config), *map(str, arguments)], stdout=log, stderr=log,
                                  env={**os.environ, **(environment or {})})
        daemon.log = Path(log.name)
        log.close()
        self.running.append(daemon)
        wait_for(lambda: daemon.poll() is not None or self.socket.exists() and self.ctl("--json", "status").returncode == 0, "heaved answers")
        assert daemon.poll() is None, f"heaved ended with {daemon.returncode}: {daemon.log.read_text()}"
        return daemon

    def stop(self, daemon, number=signal.SIGTERM):
        """Signals and waits; the exit code."""
        daemon.send_signal(number)
        return daemon.wait(timeout=WAIT_S)

    def ctl(self, *arguments, **options):
        return subprocess.run([self.bin / "heavectl", "--socket", str(self.socket), *map(str, arguments)], stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, text=True, timeout=60, check=False, **options)

    def ask(self, request):
        """heavectl --json REQUEST: the answer, and the exit code."""
        run = self.ctl("--json", request)
        return json.loads(run.stdout), run.returncode

    def status(self):
        answer, code = self.ask("status")
        assert code == 0, answer
        return answer

    def wait_state(self, *states):
        return wait_for(lambda: (lambda status: status if status["state"] in states else None)(self.status()), f"state {' or '.join(states)}")

    def sender(self):
        return Sender(self.port)


class Sender:
    """Sends frames to the daemon."""

    def __init__(self, port):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.close()

    def send(self, text):
        self.link.send(text if isinstance(text, bytes) else text.encode())

    def stream(self, seconds, frame, period_s=0.02):
        """frame(t) gives each text."""
        start = time.monotonic()
        while (t := time.monotonic() - start) < seconds:
            self.send(frame(t))
            time.sleep(period_s)


def rows_of(trace):
    """A trace as a list of dicts."""
    lines = trace.decode().splitlines()
    names = lines[0].split(",")
    return [dict(zip(names, line.split(","))) for line in lines[1:]]
