#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_fuzz.py - one fuzz target over its corpora and, where it has libFuzzer inside, a fixed number of inputs made from them.

usage: run_fuzz.py PROGRAM CORPUS... [--runs N --max-length BYTES --keep DIR] [--seed N]

The same seed makes the same inputs. Without --runs the corpora are replayed and nothing more. An input that breaks something is kept in DIR,
and `PROGRAM INPUT` shows it again.
"""
import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

SHOWN_LINES = 60


def run(command):
    """What a program printed; it must end well."""
    done = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          errors="replace")
    last_lines = "\n".join(done.stdout.splitlines()[-SHOWN_LINES:])
    assert done.returncode == 0, f"exit status {done.returncode}: {' '.join(map(str, command))}\n{last_lines}"
    return done.stdout


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program", type=Path)
    parser.add_argument("corpus", type=Path, nargs="+")
    parser.add_argument("--runs", type=int)
    parser.add_argument("--max-length", type=int, default=4096)
    parser.add_argument("--keep", type=Path, default=Path("."))
    parser.add_argument("--seed", type=int, default=20261122)
    options = parser.parse_args()
    files = sorted(path for folder in options.corpus for path in folder.iterdir() if path.is_file())
    suite = tap.Suite()
    with suite.case(f"{len(files)} inputs of the corpus"):
        assert files, f"no input in {' '.join(map(str, options.corpus))}"
        run([options.program, *files])
    if options.runs is not None:
        with suite.case(f"{options.runs} inputs made from seed {options.seed}"), tempfile.TemporaryDirectory() as found:
            output = run([options.program, f"-seed={options.seed}", f"-runs={options.runs}", f"-max_len={options.max_length}",
                          f"-artifact_prefix={options.keep}/{options.program.name}-", found, *options.corpus])
            done = re.search(r"^Done (\d+) runs", output, re.MULTILINE)
            assert done and int(done[1]) >= options.runs, "fewer inputs were tried than asked for"
            print(f"# figure {done[1]} inputs made by fuzzing")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
