#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_golden.py - the same frames give the same set-points, bit for bit, whatever compiled the program.

usage: test_golden.py --heaved PROGRAM [--update]
       test_golden.py --build COMPILER --build-dir DIR      builds the program without and with all optimisation, and compares each

Beside each TOPIC.frames, whose first line names its configuration in config/, stands TOPIC.expected: the SHA-256 of the whole trace, its
rows, and every 200th row of it, so that a difference can be read. --update writes them anew, which is right only where a change of the
motion is meant: look at the difference that it makes before it is committed.
"""
import argparse
import hashlib
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path.insert(0, str(TOP / "tests/lib"))
import tap  # noqa: E402  the path above has to be set first: --update is called by hand

EVERY = 200
TELLING = ("mode-changes", "out-of-reach", "stream-60hz", "stream-timed", "tripod-out-of-reach")  # say most for their time, where that is dear


def config_of(frames):
    with open(frames, encoding="utf-8") as file:
        return TOP / "config" / file.readline().split("config", 1)[1].strip()


def play(heaved, frames, trace):
    program = heaved if isinstance(heaved, list) else [heaved]
    run = subprocess.run([*program, "--config", config_of(frames), "--play", frames, "--trace", trace], stdout=subprocess.DEVNULL,
                         stderr=subprocess.PIPE, text=True, check=False)
    assert run.returncode == 0, f"heaved ended with {run.returncode}:\n{run.stderr}"


def digest(trace):
    """What TOPIC.expected holds: lines without their ends."""
    text = trace.read_bytes()
    header, *rows = text.decode("ascii").splitlines()
    return [f"sha256 {hashlib.sha256(text).hexdigest()}", f"rows {len(rows)}", header, *rows[::EVERY]]


def first_difference(expected, got):
    """A few lines that say where, and which columns."""
    names = expected[2].split(",") if len(expected) > 2 else []
    for old, new in zip(expected[2:], got[2:]):
        if old != new:
            columns = [f"  {name}: expected {a}, got {b}" for name, a, b in zip(names, old.split(","), new.split(",")) if a != b]
            return "\n".join([f"first difference among every {EVERY}th row, at t_ms {new.split(',')[0]}:", *columns, f"- {old}", f"+ {new}"])
    if expected[1] != got[1]:
        return f"expected {expected[1]}, got {got[1]}; the rows that both have are the same as far as they are kept"
    return f"every {EVERY}th row is the same, rows between them are not"


def compare(frames, got):
    expected = frames.with_suffix(".expected")
    assert expected.exists(), f"{expected.name} does not exist: --update writes it"
    lines = expected.read_text(encoding="ascii").splitlines()
    assert lines == got, f"{first_difference(lines, got)}\nif the change is meant: tests/golden/test_golden.py --heaved PROGRAM --update"


def check_limits(frames, trace):
    run = subprocess.run([sys.executable, TOP / "tools/check_trace", "--every", "1", "--frames", frames, config_of(frames), trace],
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode == 0, "\n".join(run.stdout.splitlines()[-25:])


def topics(only=None):
    return [frames for frames in sorted(HERE.glob("*.frames")) if only is None or frames.stem in only]


def run_topics(suite, label, heaved, trace, is_update=False, only=None):
    for frames in topics(only):
        with suite.case(f"{frames.stem}{label}: the trace is the expected one"):
            trace.unlink(missing_ok=True)
            play(heaved, frames, trace)
            if is_update:
                frames.with_suffix(".expected").write_text("\n".join(digest(trace)) + "\n", encoding="ascii")
            else:
                compare(frames, digest(trace))
        if not label:
            with suite.case(f"{frames.stem}: the trace keeps every limit"):
                check_limits(frames, trace)


def build(compiler, flags, folder):
    """The program, from the whole tree."""
    for command in (["cmake", "-G", "Ninja", "-S", TOP, "-B", folder, f"-DCMAKE_C_COMPILER={compiler}", "-DCMAKE_BUILD_TYPE=None", f"-DCMAKE_C_FLAGS={flags}"],
                    ["cmake", "--build", folder, "--target", "heaved", "--parallel"]):
        run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        assert run.returncode == 0, run.stdout[-3000:]
    return folder / "bin/heaved"


def main():
    parser = argparse.ArgumentParser()
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--heaved")
    what.add_argument("--build", metavar="COMPILER")
    parser.add_argument("--build-dir", type=Path, metavar="DIR")
    parser.add_argument("--update", action="store_true", help="write the expected files anew")
    arguments = parser.parse_args()
    if arguments.build and not arguments.build_dir:
        parser.error("--build needs --build-dir")
    suite = tap.Suite()
    with tempfile.TemporaryDirectory() as name:
        trace = Path(name) / "trace.csv"
        if arguments.heaved:
            run_topics(suite, "", arguments.heaved, trace, arguments.update)
        else:
            for flags in ("-O0", "-O3"):
                program = None
                with suite.case(f"{arguments.build} {flags} builds"):
                    program = build(arguments.build, flags, arguments.build_dir / flags[1:])
                if program:
                    run_topics(suite, f", {flags}", program, trace)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
