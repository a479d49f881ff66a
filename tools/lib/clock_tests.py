#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""clock_tests.py - the table of docs/testing.md that lists the tests which need real time, from the declarations in CMake (heave_clock).

usage: clock_tests.py BUILD_DIR            prints the table
       clock_tests.py BUILD_DIR --write    puts it into docs/testing.md
"""
import re
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parents[2] / "docs/testing.md"
BLOCK = re.compile(r"(<!-- clock-tests:begin -->\n).*?(<!-- clock-tests:end -->)", re.S)


def declared(build_dir):
    """{sentence: tests} of this build."""
    tests = {}
    for line in (Path(build_dir) / "clock_tests.tsv").read_text(encoding="utf-8").splitlines():
        name, sentence = line.split("\t")
        tests.setdefault(sentence, []).append(name)
    return tests


def table(build_dir):
    rows = sorted(f"| {sentence} | {' '.join(f'`{name}`' for name in sorted(names))} |\n" for sentence, names in declared(build_dir).items())
    return "| why it cannot be exact | tests |\n| --- | --- |\n" + "".join(rows)


def written():
    return BLOCK.search(PAGE.read_text(encoding="utf-8"))[0].split("\n", 1)[1].rsplit("\n", 1)[0] + "\n"


def main():
    if len(sys.argv) not in (2, 3) or sys.argv[2:] not in ([], ["--write"]):
        sys.exit(__doc__)
    text = table(sys.argv[1])
    if len(sys.argv) == 2:
        print(text, end="")
    else:
        page = PAGE.read_text(encoding="utf-8")
        PAGE.write_text(BLOCK.sub(lambda match: match[1] + text + match[2], page), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
