#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_types.py - the types of the package heave: mypy, strict, as python/pyproject.toml sets it, finds nothing. mypy is that of tools/lib/venv.sh."""
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
WRONG = "def half(number):\n    return number / 2\n\n\nhalf('text') + 'more'\n"


def python():
    found = subprocess.run([TOP / "tools/lib/venv.sh", "--cached"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if found.returncode != 0:
        raise tap.Skip(found.stderr.strip())
    return found.stdout.strip()


def findings(interpreter, cache, *arguments):
    run = subprocess.run([interpreter, "-m", "mypy", "--no-error-summary", "--no-color-output", "--cache-dir", cache, *arguments], cwd=TOP / "python", stdout=subprocess.PIPE,
                         stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode in (0, 1), run.stdout
    assert (run.returncode == 0) == (run.stdout == ""), run.stdout
    return run.stdout


def main():
    suite = tap.Suite()
    with tempfile.TemporaryDirectory(prefix="heave-types-") as folder:
        with suite.case("python/heave: mypy --strict finds nothing"):
            found = findings(python(), folder)
            assert not found, found
        with suite.case("a function without types, and a wrong type, are found"):
            wrong = Path(folder) / "wrong.py"
            wrong.write_text(WRONG, encoding="utf-8")
            found = findings(python(), folder, str(wrong))
            assert "no-untyped-def" in found and "no-untyped-call" in found, found
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
