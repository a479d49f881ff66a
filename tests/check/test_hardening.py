#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_hardening.py - what a release build makes resists: position independent, read-only relocations, checked buffers and stacks; and the Python
packages that tools/test fetches are the ones whose hashes are known."""
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
PROGRAMS = ("heaved", "heavectl")


def checked(*command):
    run = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(map(str, command))}: exit status {run.returncode}\n{run.stdout[-3000:]}"
    return run.stdout


def judge(program):
    """What is missing of it."""
    shown = checked("readelf", "-hldW", "--dyn-syms", program)
    wanted = {"PIE": r"Type:\s+DYN .*(Position-Independent|PIE)", "RELRO": r"GNU_RELRO", "all relocations at the start": r"FLAGS_1.*\bNOW\b",
              "stack protector": r"__stack_chk_fail", "FORTIFY": r"__\w+_chk@"}
    return [name for name, pattern in wanted.items() if not re.search(pattern, shown)]


def requirements():
    """{name: (version, hashes)} of what is installed."""
    text = (TOP / "tools/lib/requirements.txt").read_text(encoding="ascii").replace("\\\n", " ")
    rows = [line.split() for line in text.splitlines() if line and not line.startswith("#")]
    return {row[0].partition("==")[0]: (row[0].partition("==")[2], [word for word in row[1:] if word.startswith("--hash=sha256:")]) for row in rows}


def main():
    suite = tap.Suite()
    with tempfile.TemporaryDirectory(prefix="heave-") as name:
        build = Path(name) / "build"
        with suite.case("a release build is hardened without any option"):
            checked("cmake", "-S", TOP, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release")
            checked("cmake", "--build", build, "-j", "2", "--target", *PROGRAMS)
            for program in PROGRAMS:
                found, = (path for path in build.rglob(program) if path.is_file())
                assert judge(found) == [], f"{program} has no {', '.join(judge(found))}"
    with suite.case("every Python package is pinned with its hashes, those that others need too, and nothing else is taken"):
        pinned = requirements()
        asked = dict(line.split("==") for line in (TOP / "tools/lib/requirements.in").read_text(encoding="ascii").split())
        assert {name.replace("_", "-"): version for name, version in asked.items()}.items() <= {name: version for name, (version, _) in pinned.items()}.items()
        assert len(pinned) > len(asked) and all(version and hashes for version, hashes in pinned.values()), pinned
        assert re.search(r"pip\b.* install --require-hashes --only-binary :all: -r", (TOP / "tools/lib/venv.sh").read_text(encoding="utf-8"))
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
