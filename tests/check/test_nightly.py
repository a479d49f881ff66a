#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_nightly.py - tools/nightly counts what its runs print, fails when one fails, and says what it has left out; on programs that only pretend."""
import importlib.machinery
import importlib.util
import subprocess
import sys
import tempfile
import types
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
GOOD = 'echo "1..1"; echo "# figure $2 kills"; echo "ok 1 - seed $1"'


def nightly(script, *options):
    """(exit status, output) with a kills that does what the script says."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "tests/property/kills"
        program.parent.mkdir(parents=True)
        program.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
        program.chmod(0o755)
        run = subprocess.run([sys.executable, TOP / "tools/nightly", "--no-build", "--build-dir", folder, "--only", "kills", *options],
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        return run.returncode, run.stdout


def last_line(text):
    return text.splitlines()[-1]


def all_pass():
    code, text = nightly(GOOD, "--kills", "2500", "--seed", "7", "--jobs", "2")
    assert code == 0 and last_line(text) == "3 passed, 0 failed, 0 skipped", text
    assert "2,500 kills" in text and all(f"kills {seed} " in text for seed in (7, 8, 9)), text


def one_fails():
    code, text = nightly(f'if [ "$1" = 8 ]; then echo "1..1"; echo "# why"; echo "not ok 1 - stops"; exit 1; fi; {GOOD}', "--kills", "3000", "--seed", "7")
    assert code == 1 and last_line(text) == "2 passed, 1 failed, 0 skipped", text
    assert "# why" in text and "again: " in text and "kills 8 1000" in text.split("again: ")[1], text


def one_dies():
    for script in ("kill -SEGV $$", 'echo "1..2"; echo "ok 1 - half"', "exit 0", "exit 3"):
        code, text = nightly(script, "--kills", "1000")
        assert code == 1 and ", 1 failed," in last_line(text), (script, text)


def time_is_over():
    code, text = nightly(f"sleep 2.5; {GOOD}", "--kills", "4000", "--jobs", "1", "--hours", "0.0006")
    assert code == 0 and last_line(text) == "1 passed, 0 failed, 3 skipped" and "kills: 3 runs, the time was over" in text, text


def options():
    for wrong in (["--frobnicate"], ["--kills", "-1"], ["--kills", "many"], ["--hours", "0"], ["--only", "naps"], ["--jobs", "0"]):
        code, text = nightly(GOOD, *wrong)
        assert code == 2 and text, (wrong, code)
    code, text = nightly(GOOD, "--help")
    assert code == 0 and "--bus-kills" in text, text


def kinds():
    loader = importlib.machinery.SourceFileLoader("nightly", str(TOP / "tools/nightly"))
    sys.dont_write_bytecode = True
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("nightly", loader))
    loader.exec_module(module)
    few = types.SimpleNamespace(cycles=6, kills=1, bus_kills=1, hands=1, days=1, seed=7)
    for kind, make in module.MAKERS.items():
        assert f"\n  {kind} " in module.__doc__, kind
        for job in make(few, Path("/build")):
            assert job.kind == kind, job.command
            programs = [Path(word) for word in job.command if word.startswith(str(TOP / "t"))]
            assert all(program.is_file() for program in programs), programs


CASES = {"figures and cases are summed up, each run has a seed of its own": all_pass, "a run that fails is shown with its command": one_fails,
         "a run that dies, ends early or says nothing fails": one_dies, "what there was no time for is skipped and said": time_is_over,
         "each kind is in the help, and what it runs is there": kinds, "wrong options, and help": options}


def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"nightly: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
