#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_failures.py - every row of docs/failures.md has a test that is in the tree, or says "not yet"; and so have who may do what at
the panel, and what it protects against."""
import re
import sys
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
SUITES = ("unit", "contract", "system", "property", "check", "cortex")


def rows(part=0):
    """0: of what fails; 1: of when the torque is off."""
    lines = (TOP / "docs/failures.md").read_text(encoding="utf-8").split("\n## When the torque is off\n")[part].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")][2:]


def panel_rows():
    """Who may do what, and against what it protects."""
    text = (TOP / "docs/panel.md").read_text(encoding="utf-8").split("\n## Who may do what\n", 1)[1].split("\n## Messages\n")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ") and not line.endswith("| test |")]


def tests_there():
    """The text of all suites, without the part of a name that a table of cases adds."""
    return "\n".join(path.read_text(encoding="utf-8") for suite in SUITES for path in sorted((TOP / "tests" / suite).glob("*.[cp]*"))
                     if path.name != Path(__file__).name)


def is_there(name, text):
    stem = re.sub(r": (all stop together|silence, latched)$", "", name)
    return f"RUN_TEST({name});" in text if name.startswith("test_") else f'"{stem}"' in text or f'"{name}"' in text or f': {name}"' in text


# Rows of which a bus, a drive or a board on it, or a GPIO line is the cause.
OF_BUS = re.compile(r"\b(Modbus|CAN|bus|drives?|EMCY|TPDOs|ENOBUFS|acknowledges|slcan|axis|heartbeat|error-passive|controller|queue)\b|GPIO|^one channel of the e-stop|^the chip of|^contacts|^the supply fails, or|^the enable key")
NOT_OF_BUS = re.compile(r"^(a flood of valid frames|anything that is not|SIGTERM while|a bus over its budget|more datagrams)|sender")


def twin_rows():
    """What docs/twin.md plays, and what it says it cannot."""
    text = (TOP / "docs/twin.md").read_text(encoding="utf-8").split("## Each failure", 1)[1].split("## Cost")[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ") and not line.startswith(("| what", "| ---"))]


def wrong_twin_rows(failures, played):
    there = {row[0] for row in failures}
    wanted = {what for what in there if OF_BUS.search(what) and not NOT_OF_BUS.search(what)}
    named = [row[0] for row in played]
    return [f"not in docs/twin.md: {what}" for what in sorted(wanted - set(named))] + [
        f"only in docs/twin.md, or twice: {what}" for what in sorted(set(named)) if what not in there or named.count(what) != 1]


def main():
    suite = tap.Suite()
    text = tests_there()
    with suite.case("docs/failures.md: every test that is named is there"):
        named = [(row[0], name) for row in rows() + rows(1) for name in re.findall(r"`([^`]+)`", row[3])]
        missing = [f"{what}: {name}" for what, name in named if not is_there(name, text)]
        assert len(named) > 30 and not missing, "\n".join(missing)
    with suite.case("docs/failures.md: every row names a test or says that there is none"):
        bad = [row for row in rows() if len(row) != 4 or ("`" in row[3]) == ("not yet" in row[3])]
        assert not bad, bad
        assert len(rows(1)) > 5 and all(len(row) == 4 and ("`" in row[3] or row[3] == "the test of the row") for row in rows(1)), rows(1)
    with suite.case("docs/panel.md: every row of who may do what, and of what it protects against, names tests that are there"):
        assert len(panel_rows()) > 20 and all(len(row) == 3 and "`" in row[2] for row in panel_rows()), panel_rows()
        missing = [f"{row[0]}: {name}" for row in panel_rows() for name in re.findall(r"`([^`]+)`", row[2]) if not is_there(name, text) and not (TOP / f"tests/fuzz/fuzz_{name}.c").is_file()]
        assert not missing, "\n".join(missing)
    with suite.case("docs/twin.md: every row that concerns a bus or a GPIO line is played by a line, or says why not"):
        wrong = wrong_twin_rows(rows(), twin_rows())
        assert not wrong, "\n".join(wrong)
        assert sum(len(row) == 3 and row[1].startswith("`") for row in twin_rows()) > 30
        assert wrong_twin_rows([*rows(), ["a drive burns", "", "", ""]], twin_rows()) and wrong_twin_rows(rows()[1:], [*twin_rows(), ["nothing", "`x`", "-"]])
    with suite.case("a test that is not there is found out"):
        assert not is_there("test_that_nobody_wrote", text) and not is_there("nobody wrote this: silence, latched", text)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
