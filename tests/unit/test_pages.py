#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_pages.py - the parts of heave-panel's pages that need no browser: tests/unit/pages/*.test.mjs by node's own test runner. Each of its tests is a case."""
import re
import shutil
import subprocess
import sys
from pathlib import Path

import tap

HERE = Path(__file__).resolve().parent / "pages"
LEAST = (18, 19)


def main():
    suite = tap.Suite()
    node = shutil.which("node")
    version = tuple(map(int, re.findall(r"\d+", subprocess.run([node, "--version"], capture_output=True, text=True, check=True).stdout)[:2])) if node else (0, 0)
    for path in sorted(HERE.glob("*.test.mjs")):
        if version < LEAST:
            with suite.case(path.name):
                raise tap.Skip("there is no node of version 18.19 or later")
            continue
        run = subprocess.run([node, "--import", HERE / "resolve.mjs", "--test", "--test-reporter=tap", path], capture_output=True, text=True, check=False, timeout=120)
        cases = re.findall(r"(?m)^( *)(not )?ok \d+ - (.*)$", run.stdout)
        deepest = max((len(indent) for indent, _, _ in cases), default=0)
        for indent, failed, name in cases:
            if len(indent) == deepest and not name.endswith(".mjs"):
                with suite.case(f"{path.name.removesuffix('.test.mjs')}: {name}"):
                    assert not failed, run.stdout[-3000:]
        with suite.case(f"{path.name.removesuffix('.test.mjs')}: all of it ran"):
            assert run.returncode == 0 and cases, (run.stdout + run.stderr)[-3000:]
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
