#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_proof.py - tools/proof says what is not proved and fails then, and judges its list; on a Frama-C that only pretends."""
import contextlib
import io
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
import proof_run  # noqa: E402  the path above has to be set first

HEAD = "directory\tfile\tline\tfunction\tproperty kind\tstatus\tproperty"
GOOD = "src\ta.c\t3\tf\tuser assertion\tValid\tx < 9"
DEAD = "src\ta.c\t4\tf\tuser assertion\tDead\t\\false"
LIBRARY = "FRAMAC_SHARE/libc\tmath.h\t4\tsin\tprecondition\tUnknown\tx"
OPEN = "src\ta.c\t5\tf\tindex\tUnknown\tx < 10"
REACHED = "  f: 4 stmts out of 5 (80.0%)"
SOURCE = "static int f(int x)\n{\n    return x;\n}\n\nint g(void)\n{\n    return 1;\n}\n"
FAKE = """#!/bin/sh
while [ $# -gt 1 ]; do
    [ "$1" = -report-csv ] && cat "$HERE/rows" >"$2"
    shift
done
cat "$HERE/log"
exit "$(cat "$HERE/status")"
"""


def proved(rows, log=REACHED, unproved="src/a.c g: not analysed\n    Never called.\n", status=0, targets=()):
    """(exit status, output) over a source with two functions."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        (here / "src").mkdir()
        (here / "src/a.c").write_text(SOURCE, encoding="utf-8")
        for name, text in (("rows", "\n".join([HEAD, *rows]) + "\n"), ("log", log), ("status", str(status)), ("unproved.txt", unproved)):
            (here / name).write_text(text, encoding="utf-8")
        (here / "frama-c").write_text(FAKE, encoding="utf-8")
        (here / "frama-c").chmod(0o755)
        proof_run.TOP, proof_run.UNPROVED = here, here / "unproved.txt"
        proof_run.TARGETS = [proof_run.Target("one", "what it is", "a", "src/a.c")]
        saved, sys.argv = (os.environ["PATH"], sys.argv), ["proof", "--build-dir", str(here / "build"), *targets]
        os.environ.update(PATH=f"{folder}:{saved[0]}", HERE=folder)
        out = io.StringIO()
        try:
            with contextlib.redirect_stdout(out):
                code = proof_run.main()
        finally:
            os.environ["PATH"], sys.argv = saved
        return code, out.getvalue()


def must(result, code, *texts):
    assert result[0] == code, f"exit status {result[0]}, must be {code}: {result[1]}"
    for text in texts:
        assert text in result[1], f"does not say {text!r}: {result[1]}"


def all_proved():
    must(proved([GOOD, DEAD, LIBRARY]), 0, "1       4/5       80.0 %        0        1", "proof: 0 not proved")


def alarm():
    must(proved([GOOD, OPEN]), 1, "src/a.c:5: f: not proved: x < 10", "proof: 1 not proved")


def listed():
    entry = "src/a.c f: x < 10\n    Since x is 3.\n"
    must(proved([OPEN], unproved=f"{entry}src/a.c g: not analysed\n    Never called.\n"), 0, "listed as unproved: src/a.c f: x < 10")
    must(proved([GOOD], unproved=f"{entry}src/a.c g: not analysed\n    Never called.\n"), 1, "src/a.c f: is proved now or not there any more: x < 10")
    must(proved([OPEN], unproved="src/a.c f: x < 10\n"), 1, "no reason below it")


def not_analysed():
    must(proved([GOOD], unproved=""), 1, "src/a.c g: not analysed")
    must(proved([GOOD], unproved="", targets=["one"]), 0, "proof: 0 not proved")
    must(proved([GOOD], log=""), 1, "nothing was analysed")


def frama_c_fails():
    must(proved([GOOD], log="[kernel] User Error: unbound f\n", status=1, targets=["one"]), 1, "exit status 1: [kernel] User Error: unbound f")


def options():
    def run(*words):
        return subprocess.run([TOP / "tools/proof", *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    assert run("--help").stdout.startswith("usage: tools/proof"), "no usage"
    for words in (["--jobs"], ["--jobs", "0"], ["--fast"]):
        done = run(*words)
        assert done.returncode == 2 and "--help" in done.stderr, f"{words}: {done}"
    with contextlib.suppress(SystemExit), contextlib.redirect_stderr(io.StringIO()) as said:
        proved([GOOD], targets=["two"])
    assert "no target two; there are one" in said.getvalue(), said.getvalue()


CASES = {"all proved": all_proved, "an alarm fails": alarm, "the list of what is not proved": listed, "functions left out": not_analysed,
         "Frama-C fails": frama_c_fails, "options": options}


def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"proof: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
