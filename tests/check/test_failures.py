#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_failures.py - every row of docs/failures.md has a test that is in the tree, or says "not yet"."""
import re
import sys
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
SUITES = ("unit", "contract", "system", "property", "check", "cortex")


def rows():
    lines = (TOP / "docs/failures.md").read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")][2:]


def tests_there():
    """The text of all suites, without the part of a name that a table of cases adds."""
    return "\n".join(path.read_text(encoding="utf-8") for suite in SUITES for path in sorted((TOP / "tests" / suite).glob("*.[cp]*"))
                     if path.name != Path(__file__).name)


def is_there(name, text):
    stem = re.sub(r": (all stop together|silence, latched)$", "", name)
    return f"RUN_TEST({name});" in text if name.startswith("test_") else f'"{stem}"' in text or f'"{name}"' in text or f': {name}"' in text


def main():
    suite = tap.Suite()
    text = tests_there()
    with suite.case("docs/failures.md: every test that is named is there"):
        named = [(row[0], name) for row in rows() for name in re.findall(r"`([^`]+)`", row[3])]
        missing = [f"{what}: {name}" for what, name in named if not is_there(name, text)]
        assert len(named) > 30 and not missing, "\n".join(missing)
    with suite.case("docs/failures.md: every row names a test or says that there is none"):
        bad = [row for row in rows() if len(row) != 4 or ("`" in row[3]) == ("not yet" in row[3])]
        assert not bad, bad
    with suite.case("a test that is not there is found out"):
        assert not is_there("test_that_nobody_wrote", text) and not is_there("nobody wrote this: silence, latched", text)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
