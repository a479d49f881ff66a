#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_samples.py --bin DIR - the Python package beside a running machine: Samples, with eight readers and a slow one, and Twin, its faults and positions. On the Python of
tools/lib/venv.sh, which has NumPy."""
import argparse
import contextlib
import os
import socket
import struct
import sys
import tempfile
import threading
import time
from pathlib import Path

import tap
from test_heave import python_with_numpy, refused

import heave
from heave.configuration import changed

TOP = Path(__file__).resolve().parents[2]
READERS, SECONDS, RING_S = 8, 3.0, 2
WAIT_S = 60


def samples_are_what_was_asked_for():
    import numpy
    with heave.Heaved() as heaved, heaved.platform.samples() as samples:
        heaved.platform.wait_for("ENGAGED")
        heaved.sender.a6(z=20, roll=3, time_ms=500)
        heaved.platform.wait_for_pose(z_mm=20)
        time.sleep(0.2)
        run = samples.read(["cycle", "t_ms", "sent_z_mm", "sent_roll_deg"])
        assert len(run["t_ms"]) > 500 and samples.lost == 0, (len(run["t_ms"]), samples.lost)
        assert (numpy.diff(run["cycle"]) == 1).all()
        periods = numpy.diff(run["t_ms"]) / (samples.cycle_us / 1000)  # from cycle to cycle; more where this machine was late, and as many as heaved counts
        skipped = numpy.rint(periods) - 1
        assert numpy.allclose(periods, skipped + 1, atol=1e-6) and (skipped >= 0).all(), periods
        late = heaved.platform.status()["late_cycles"]
        assert skipped.sum() <= late, (skipped, late)
        for name, value in (("sent_z_mm", 20), ("sent_roll_deg", 3)):
            assert abs(run[name][-1] - value) < 1e-3, (name, run[name][-1])
        assert samples.units["sent_z_mm"] == "mm" and "sent_c1_mm" in samples.columns
        view = samples.view("sent_z_mm")
        assert view.base is not None and not view.flags.owndata and not view.flags.writeable, "a copy, or one that can be written"
        before = samples.written
        time.sleep(0.1)
        assert samples.written > before
        assert abs(view[(samples.written - 2) % samples.capacity] * samples.scales["sent_z_mm"] - 20) < 1e-3, "the view does not follow"
        with refused(heave.SamplesError, "no column z", "sent_z_mm"):
            samples.read(["z"])
        try:
            view[0] = 1
        except ValueError:
            pass
        else:
            raise AssertionError("the ring can be written")
    with refused(heave.SamplesError, "closed"):
        samples.read()
    assert len(view) == samples.capacity, "a view outlives the reader"


def eight_readers_and_a_slow_one():
    import numpy
    found, errors = {}, []

    def read(who, pause_s, platform):
        try:
            with platform.samples() as samples:
                parts, end = [], time.monotonic() + SECONDS + (RING_S if pause_s > RING_S else 0)
                first = samples.next
                while time.monotonic() < end:
                    time.sleep(pause_s)
                    parts.append(samples.read(["cycle"])["cycle"])
                found[who] = (numpy.concatenate(parts), samples.lost, samples.next - first)
        except Exception as error:  # a thread's own is nobody's
            errors.append((who, error))

    with heave.Heaved(changes={"samples.seconds": RING_S}) as heaved:
        heaved.platform.wait_for("ENGAGED")
        threads = [threading.Thread(target=read, args=(who, 0.02 * who, heaved.platform)) for who in range(1, READERS + 1)]
        threads.append(threading.Thread(target=read, args=("slow", RING_S + 1.5, heaved.platform)))
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(WAIT_S)
        status = heaved.platform.status()
    assert not errors, errors
    assert status["state"] == "ENGAGED", status["fault"]
    for who, (cycles, lost, passed) in found.items():
        assert len(cycles) + lost == passed, f"reader {who}: {len(cycles)} read and {lost} lost of {passed}"
        assert (numpy.diff(cycles) >= 1).all(), f"reader {who}: out of order, or twice"
        if who == "slow":
            assert lost > 500 and len(cycles) > 500, f"it lost {lost} and read {len(cycles)}"
            assert numpy.count_nonzero(numpy.diff(cycles) > 1) <= 2, "gaps inside of what it read"
        else:
            assert lost == 0 and (numpy.diff(cycles) == 1).all(), f"reader {who} lost {lost}"
    assert len(found) == READERS + 1


def answer_with(memory, text=b'{"ok":true}\n'):
    """A socket whose heaved hands out this memory, once; None: nothing."""
    folder = tempfile.TemporaryDirectory()
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(f"{folder.name}/s")
    listener.listen(1)

    def serve():
        link, _ = listener.accept()
        with link, listener:
            link.recv(100)
            if memory is None:
                link.sendall(text)
                return
            descriptor = os.memfd_create("samples")
            os.write(descriptor, memory)
            socket.send_fds(link, [text], [descriptor])
            os.close(descriptor)
    threading.Thread(target=serve, daemon=True).start()
    return folder


def wrong_memories_are_named():
    def header(magic=b"HEAVESMP", version=1, record=16, capacity=4, columns=1, kind=b"u8", at=8):
        head = struct.pack("=8s7I4x3Q", magic, version, 256, record, capacity, columns, 64, 1000, 0, 0, 0).ljust(128, b"\0")
        return (head + struct.pack("=32s12s4sI4xd", b"cycle", b"", kind, at, 1.0)).ljust(256, b"\0") + bytes(64)

    for memory, words in ((b"x" * 300, "no samples of heaved"), (b"HEAVESMP", "no samples"), (header(version=2), "version 2"), (header(capacity=0), "contradicts"),
                          (header(capacity=9), "contradicts"), (header(record=12), "contradicts"), (header(columns=9), "contradicts"), (header(kind=b"f4"), "column cycle"),
                          (header(at=9), "column cycle")):
        folder = answer_with(memory)
        with folder, refused(heave.SamplesError, words):
            heave.Samples(f"{folder.name}/s")
    for text, kind, words in ((b'{"ok":false,"error":"not for you"}\n', heave.Refused, "not for you"), (b"", heave.NotRunning, "closed"), (b'{"ok":true}\n', heave.Refused, "no samples")):
        folder = answer_with(None, text)
        with folder, refused(kind, words):
            heave.Samples(f"{folder.name}/s")
    folder = answer_with(header())
    with folder, heave.Samples(f"{folder.name}/s") as samples:
        assert samples.columns == ["cycle"] and len(samples.read()["cycle"]) == 0
    with heave.Heaved(changes={"samples.seconds": 0}) as heaved, refused(heave.Refused, "samples"):
        heaved.platform.samples()


@contextlib.contextmanager
def twin_and_heaved(*arguments, **options):
    """CiA 402 drives on a bus between programs, which every kernel has."""
    config = TOP / "config/hexapod-cia402.ini"
    changes = {"can.interface": f"twin{os.getpid() % 1000000}", "platform.engage": "auto", "platform.late_hold_cycles": 0, "udp.silence_hold_ms": 60000, "udp.silence_neutral_ms": 0,
               "udp.silence_settle_ms": 0}
    with heave.Twin(config, arguments, changes=changes, **options) as twin, heave.Heaved(config, changes=changes) as heaved:
        yield twin, heaved


def faults_and_positions_at_run_time():
    with twin_and_heaved("--start", "20") as (twin, heaved):
        assert all(abs(position - 20) < 0.5 for position in twin.positions), twin.positions
        heaved.platform.wait_for("ENGAGED", timeout=WAIT_S)
        heaved.sender.a6(z=20, roll=2, time_ms=1000)
        heaved.platform.wait_for_pose(roll_deg=2)
        time.sleep(0.3)
        assert abs(twin.pose["roll"] - 2) < 0.2 and len(twin.positions) == 6, (twin.pose, twin.positions)
        twin.fault("drop 3")
        status = heaved.platform.wait_for("FAULT", timeout=WAIT_S)
        assert (status["fault"]["name"], status["fault"]["axis"]) == ("drive-dropped", 3), status["fault"]
        twin.mend()
        for line, words in (("explode 3", "no fault explode"), ("jam 9", "no drive 9"), ("jam 3\njam 2", "one line")):
            with refused(heave.Refused, words):
                twin.fault(line)
        twin.check()
    with refused(heave.NotRunning, "ended with exit code"):
        twin.check()


def a_twin_that_cannot_start_says_why():
    with refused(heave.NotRunning, "exit code 78", "heaved simulates these drives itself"):
        heave.Twin(heave.demo_config())
    with refused(heave.NotRunning, "exit code 65", "soon is no time"):
        heave.Twin(TOP / "config/hexapod-cia402.ini", script=["soon jam 3"])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    options = parser.parse_args()
    python_with_numpy()
    os.environ["HEAVE_BIN"] = options.bin
    suite = tap.Suite()
    for case in (samples_are_what_was_asked_for, eight_readers_and_a_slow_one, wrong_memories_are_named, faults_and_positions_at_run_time, a_twin_that_cannot_start_says_why):
        with suite.case(case.__name__.replace("_", " ")):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
