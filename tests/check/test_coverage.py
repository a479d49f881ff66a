#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_coverage.py - the report of tools/coverage names what was not reached, and judges its exclusions; on counts that are made up."""
import contextlib
import io
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
import coverage_report  # noqa: E402  the path above has to be set first

CODE = """static int a(int x, int y)
{
    if (x > 1 && y > 2) {
        return 3;
        return 4;
    }
    switch (x) {
    }
    return 5;
}
"""
WHERE = {"x > 1": (3, 9, 3, 14), "y > 2": (3, 18, 3, 23), "both": (3, 9, 3, 23), "x": (7, 13, 7, 14)}


def with_file(check, exclusions=""):
    with tempfile.TemporaryDirectory() as folder:
        coverage_report.TOP = Path(folder)
        (Path(folder) / "src").mkdir()
        (Path(folder) / "src/a.c").write_text(CODE, encoding="utf-8")
        listed = Path(folder) / "list.txt"
        listed.write_text(exclusions, encoding="utf-8")
        file = coverage_report.File("src/a.c")
        file.lines = {line: 1 for line in range(1, 11)}
        return check(file, coverage_report.Exclusions(listed))


def told(fill, exclusions=""):
    """(gaps, what is wrong with the exclusions) of a file that `fill` has put counts into."""
    def check(file, listed):
        fill(file)
        judged = coverage_report.Judged(file, listed)
        return coverage_report.gaps(judged), listed.errors + listed.stale()
    return with_file(check, exclusions)


def branch(file, what, *taken):
    file.add_branch([*WHERE[what], *taken, 0, 0, 4])


def is_(got, expected):
    assert got == expected, f"got {got}, must be {expected}"


def all_reached():
    def fill(file):
        branch(file, "x > 1", 2, 3)
    is_(told(fill), ([], []))


def lines():
    def fill(file):
        file.lines.update({4: 0, 5: 0, 9: 0})
    is_(told(fill)[0], ["src/a.c:4-5: not run", "src/a.c:9: not run"])


def branches():
    def fill(file):
        branch(file, "x > 1", 2, 0)
        branch(file, "y > 2", 0, 2)
    is_(told(fill)[0], ["src/a.c:3: never false: x > 1", "src/a.c:3: never true: y > 2"])


def builds():
    def fill(file):
        branch(file, "x > 1", 2, 0)
        branch(file, "x > 1", 0, 1)
    is_(told(fill)[0], [])


def switches():
    def fill(file):
        branch(file, "x", 0, 1)
    is_(told(fill)[0], [])


def conditions():
    def fill(file):
        branch(file, "x > 1", 2, 2)
        branch(file, "y > 2", 2, 2)
        file.add_decision([*WHERE["both"], 0, 5, [True, False]])
    is_(told(fill)[0], ["src/a.c:3: never decides alone: y > 2"])


def excluded():
    def fill(file):
        file.lines.update({5: 0})
        branch(file, "x > 1", 2, 0)
    text = "# words\n\nsrc/a.c a: return 4;\n    Behind a return.\nsrc/a.c a: if (x > 1 && y > 2) {\n    Nobody calls it so.\n"
    is_(told(fill, text), ([], []))
    is_(told(fill, text.replace("c a:", "c b:"))[0], ["src/a.c:3: never false: x > 1", "src/a.c:5: not run"])


def wrong_exclusions():
    def fill(file):
        file.lines.update({5: 0})
    good = "src/a.c a: return 4;\n    Behind a return.\n"
    for text, word in {"src/a.c a: return 3;\n    It was rare once.\n": "is reached now", "src/a.c a: gone();\n    It is not.\n": "not there any more",
                       "src/a.c a: return 4;\n": "no reason", good + good: "each once", "src/a.c: return 4;\n    Why.\n": "FUNCTION",
                       "    Why.\n": "without a line"}.items():
        wrong = told(fill, text)[1]
        assert len(wrong) >= 1 and word in "\n".join(wrong), (text, wrong)


def table():
    def show(file, listed):
        branch(file, "x > 1", 2, 0)
        file.lines.update({5: 0})
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            coverage_report.show_group("Core", [coverage_report.Judged(file, listed)])
        return printed.getvalue()
    text = with_file(show)
    assert "9/10" in text and "90.0 %" in text and "1/2" in text and "50.0 %" in text, text


def backends():
    def of(name, missed, exclusions=""):
        def check(file, listed):
            file.name = name
            for column in range(10):
                file.add_branch([4, 9 + column, 4, 10 + column, 1, 0 if column < missed else 1, 0, 0, 4])
            return list(coverage_report.thin([coverage_report.Judged(file, listed)]))
        return with_file(check, exclusions)
    is_(of("hal/linux/a.c", 2), [])
    is_(of("hal/linux/a.c", 3), ["hal/linux/a.c: 85.0 % of its branches are reached, it must be 90 %"])
    is_(of("hal/linux/a.c", 3, "hal/linux/a.c a: return 3;\n    Nobody can.\n"), [])
    is_(of("src/daemon/a.c", 3), [])


CASES = {"what is reached is not told of": all_reached, "lines in a row are one": lines, "each way that was not taken": branches,
         "what another build takes counts": builds, "a switch needs no case for no name": switches, "MC/DC names the condition": conditions,
         "an exclusion is for one line of one function": excluded, "an exclusion that is stale, double or has no reason is wrong": wrong_exclusions,
         "the table has totals": table, "backends have to reach 90 % of the branches of each file": backends}


def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"coverage: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
