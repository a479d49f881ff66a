#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_complexity.py - no function branches more than 15 times. And tools/complexity counts functions, half of them, nine of ten, the longest, and names the
worst; on a pmccabe that only pretends."""
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
CORE, PROGRAM = "src/motion/ramp.c", "src/daemon/main.c"


def row(complexity, lines, where, name):
    """One of pmccabe's: modified and traditional complexity, statements, first line, lines, where it is."""
    return f"{complexity}\t{complexity + 1}\t9\t7\t{lines}\t{where}(7): {name}"


def complexity(rows, *options, has_pmccabe=True):
    """(exit status, output): rows of a file are printed where pmccabe is given that file."""
    with tempfile.TemporaryDirectory() as folder:
        if has_pmccabe:
            program = Path(folder) / "pmccabe"
            lines = "".join(f"case \" $* \" in *\" {where} \"*) echo '{text}' ;; esac\n" for where, text in rows)
            program.write_text(f"#!/bin/sh\n{lines}echo 'something else'\n", encoding="utf-8")
            program.chmod(0o755)
        run = subprocess.run([sys.executable, TOP / "tools/complexity", *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                             env={**os.environ, "PATH": folder})
        return run.returncode, run.stdout


def rows():
    core = [(CORE, row(i, 10 * i, CORE, f"f{i}")) for i in range(1, 11)]
    return [*core, (PROGRAM, row(30, 5, PROGRAM, "main")), ("hal/sim/sim_log.c", row(2, 3, "hal/sim/sim_log.c", "put"))]


def counted():
    code, text = complexity(rows())
    table = {line.split()[0]: line.split()[1:] for line in text.splitlines()[1:4]}
    assert code == 1, text
    assert table == {"core": ["10", "60", "100", "40.0", "%", "6", "10", "10"], "programs": ["1", "5", "5", "0.0", "%", "30", "30", "30"],
                     "backends": ["1", "3", "3", "0.0", "%", "2", "2", "2"]}, text


def named():
    assert complexity(rows())[1].splitlines()[4:] == [f"{PROGRAM}:7: main: complexity 30, 5 lines"]
    assert len(complexity(rows(), "--over", "8")[1].splitlines()[4:]) == 3
    code, text = complexity(rows(), "--over", "30")
    assert code == 0 and len(text.splitlines()) == 4, text


def told():
    code, text = complexity([], has_pmccabe=False)
    assert code == 1 and "apt-get install pmccabe" in text, text
    assert complexity([], "--frobnicate")[0] == 2 and "--over N" in complexity([], "--help")[1]


def sources():
    if not shutil.which("pmccabe"):
        raise tap.Skip("pmccabe is missing")
    run = subprocess.run([sys.executable, TOP / "tools/complexity"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode == 0, run.stdout


CASES = {"no function branches more than 15 times": sources, "the core, the programs and the backends are counted apart": counted, "what branches more than asked for is named, the worst first": named,
         "a missing pmccabe, wrong options, and help": told}


def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"complexity: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
