#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_demo.py - what tools/demo sends, and how it ends when it cannot begin. The show itself is not run: it takes half a minute.

usage: test_demo.py --build BUILD_DIR
"""
import argparse
import csv
import os
import re
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
import demo_sender  # noqa: E402  the path above has to be set first

DOCUMENT_ROWS = 24  # of tests/data/frames.csv, the first ones: the examples of the vendor's document


def document():
    """Frames of the vendor's document: accepted ones, and rejected ones with the reason."""
    with (TOP / "tests/data/frames.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))[:DOCUMENT_ROWS]
    rejected = {row["frame_utf8"]: re.match(r"!(\w+)@", row["v3_events"])[1] for row in rows if row["v3_events"].startswith("!")}
    return [row["frame_utf8"] for row in rows if row["frame_utf8"] not in rejected], rejected


def demo(*arguments, **environment):
    return subprocess.run([TOP / "tools/demo", *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                          env={**os.environ, **environment})


def without_blanks(frames):
    return sorted(frame.replace(" ", "") for frame in frames)


def check_stream(frames, period_s):
    """Starts and ends at pose zero, with no jump in between."""
    poses = [[float(value) for value in re.split("[:,]", frame)[1:7]] for frame in frames]
    assert not any(poses[0]) and max(map(abs, poses[-1])) < 0.5, f"{poses[0]} ... {poses[-1]}"
    fastest = max(abs(b - a) for one, other in zip(poses, poses[1:]) for a, b in zip(one, other)) / period_s
    assert fastest < 150, f"{fastest} mm/s or deg/s"


def check_port_in_use(build):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other, tempfile.TemporaryDirectory() as folder:
        try:
            other.bind(("127.0.0.1", 9800))
        except OSError:
            pass  # somebody else has it: that will do
        result = demo("--build-dir", build, TMPDIR=folder)
        assert result.returncode == 1 and "9800 is in use" in result.stderr, f"{result.returncode}: {result.stdout}{result.stderr}"
        assert len(result.stderr.splitlines()) == 1, result.stderr
        assert not list(Path(folder).iterdir()), f"left behind: {list(Path(folder).iterdir())}"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", required=True)
    build = parser.parse_args().build
    accepted, rejected = document()
    suite = tap.Suite()
    with suite.case("every example of the document is sent, and nothing else"):
        sent = without_blanks([*demo_sender.TABLE, *demo_sender.EXAMPLES])
        assert sent == without_blanks(accepted), f"sent {sent}, the document has {without_blanks(accepted)}"
    with suite.case("misprints are expected to be rejected for the right reason"):
        wrong = {frame: reason for frame, reason in demo_sender.SLIPS.items() if rejected.get(frame) != reason}
        assert demo_sender.SLIPS and not wrong, f"{wrong}, should be {rejected}"
    with suite.case("the stream of poses begins and ends at rest"):
        check_stream(list(demo_sender.pose_stream()), 1 / demo_sender.POSE_STREAM_HZ)
    with suite.case("the stream of timed poses begins and ends at rest"):
        check_stream(list(demo_sender.timed_stream()), demo_sender.TIMED_STREAM_MS / 1000)
    with suite.case("--help"):
        result = demo("--help")
        assert result.returncode == 0 and "--keep" in result.stdout
    with suite.case("an unknown option is refused in one line"):
        result = demo("--nonsense")
        assert result.returncode == 2 and len(result.stderr.splitlines()) == 1, f"{result.returncode}: {result.stderr}"
    with suite.case("a port in use is said in one line, and nothing stays behind"):
        check_port_in_use(build)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
