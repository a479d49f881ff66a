#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_misra.py - tools/misra fails for what its list does not have, and for entries that match nothing; on a cppcheck that only pretends."""
import contextlib
import io
import os
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
import misra_report  # noqa: E402  the path above has to be set first

RETURNS, TEXT = "src/a.c:3: misra-c2012-15.5: x", "src/b.c:1: misra-c2012-7.2: x"
LISTED = "| 15.5 | one return | everywhere | guards |\n| 7.2 | U | `src/b.c` | signed |\n"


def judged(printed, entries, *options, status=0):
    """(exit status, output) over src/a.c, src/b.c and a program that is not looked at; `printed`: of each of them."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        for name in ("src/a.c", "src/b.c", "src/daemon/c.c", "include/a.h"):
            (here / name).parent.mkdir(parents=True, exist_ok=True)
            (here / name).write_text("one\ntwo\nthree\n", encoding="utf-8")
        (here / "misra.md").write_text(f"# Text\n\n| rule | about | where | why |\n| --- | --- | --- | --- |\n{entries}", encoding="utf-8")
        (here / "cppcheck").write_text(f"#!/bin/sh\nfor last; do :; done\ncase $last in src/daemon/*) exit 9 ;; esac\n: >$last.dump\n"
                                       + "".join(f"case '{line}' in *h:*|$last*|no*) echo '{line}' ;; esac\n" for line in printed)
                                       + f"exit {status}\n", encoding="utf-8")
        (here / "cppcheck").chmod(0o755)
        misra_report.TOP, misra_report.LIST = here, here / "misra.md"
        saved, sys.argv = (os.environ["PATH"], sys.argv), ["misra", *[str(here / word) if word.endswith(".c") else word for word in options]]
        os.environ["PATH"] = f"{folder}:{saved[0]}"
        out = io.StringIO()
        try:
            with contextlib.redirect_stdout(out):
                code = misra_report.main()
        finally:
            os.environ["PATH"], sys.argv = saved
        assert not list(here.rglob("src/*.dump")), "something was left beside the sources"
        return code, out.getvalue()


def all_listed():
    code, text = judged([RETURNS, TEXT, "include/a.h:2: misra-c2012-15.5: x"], LISTED)
    assert code == 0 and text.splitlines()[-1] == "2 files, 3 deviations from 2 rules, 0 not as listed, 0 other findings", text
    assert "include/a.h:2: rule 15.5: two" in judged([RETURNS, TEXT, "include/a.h:2: misra-c2012-15.5: x"], LISTED, "--all")[1]


def not_listed():
    for new, rule in (("misra-c2012-11.3", "11.3"), ("misra-c2012-7.2", "7.2"), ("nullPointer", "nullPointer")):
        code, text = judged([RETURNS, TEXT, f"src/a.c:2: {new}: x"], LISTED)
        assert code == 1 and f"src/a.c:2: rule {rule} is not listed: two" in text, text
    assert judged([RETURNS, TEXT, "src/a.c:2: nullPointer: x"], LISTED + "| nullPointer | - | `src/a.c` | wrong |\n")[0] == 0


def stale():
    code, text = judged([RETURNS], LISTED)
    assert code == 1 and "misra.md:6: rule 7.2: nothing is found any more in src/b.c" in text, text
    code, text = judged([TEXT], LISTED)
    assert code == 1 and "misra.md:5: rule 15.5: nothing is found any more" in text, text
    code, text = judged([RETURNS, TEXT], LISTED, "src/a.c")
    assert code == 0 and text.splitlines()[-1].startswith("1 files, 1 deviations"), text


def other():
    for line in ("src/a.c:1: internalAstError: Syntax Error", "nothing of a finding"):
        code, text = judged([RETURNS, TEXT, line], LISTED)
        assert code == 1 and line in text, text
    assert judged([RETURNS, TEXT], LISTED, status=1)[0] == 1


def broken_list():
    for entries, wrong in ((LISTED + "| 15.5 | one return | everywhere | again |\n", "listed twice"), (LISTED.replace("everywhere", "here"), "where?")):
        code, text = judged([RETURNS, TEXT], entries)
        assert code == 1 and wrong in text, text


def real_list():
    listed = misra_report.Deviations(TOP / "docs/misra.md")
    assert not listed.errors and listed.places, listed.errors
    missing = [place for places in listed.places.values() for place in places if place != misra_report.EVERYWHERE and not (TOP / place).is_file()]
    assert not missing, missing


CASES = {"what is listed passes, and is counted": all_listed, "a rule or a place that is not listed fails": not_listed,
         "an entry that matches nothing any more fails, unless files are given": stale, "whatever else cppcheck says fails": other,
         "entries that say nothing, or twice": broken_list, "docs/misra.md can be read, and its files are there": real_list}


def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"misra: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
