#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_words.py - no identifier of the sources has a word that docs/style.md does not use, and no file name stands in two rooms."""
import collections
import re
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
NOT_CODE = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])+\'', re.S)
ROOMS = ("src", "hal", "include")
SEVERAL = {"main.c"}  # one in each program


def banned(style):
    """The words in the first column of the table of names that are not used: {word: what stands for it}."""
    table = re.search(r"\| not used \| instead \|\n\| --- \| --- \|\n((?:\|.*\|\n)+)", style)
    assert table, "docs/style.md has no table `| not used | instead |`"
    rows = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in table.group(1).splitlines()]
    return {word.strip(" `"): instead for words, instead in rows for word in words.split(",")}


def sources(root):
    return sorted(path for room in ROOMS for path in (root / room).rglob("*.[ch]"))


def wrong_words(root, words):
    wrong = []
    for path in sources(root):
        identifiers = set(re.findall(r"\b[A-Za-z_]\w*\b", NOT_CODE.sub(" ", path.read_text(encoding="utf-8"))))
        for name in sorted(identifiers):
            for word in words.keys() & set(name.lower().split("_")):
                wrong.append(f"{path.relative_to(root)}: {name}: not {word}, but {words[word]} (docs/style.md)")
    return wrong


def twice(root):
    """File names of two rooms. A public header and its source have one name, and the backends of hal may share theirs with a room."""
    rooms = collections.defaultdict(set)
    for path in sources(root):
        room = path.relative_to(root).parent
        if path.name not in SEVERAL and room.parts[0] == "src":
            rooms[path.name].add(str(room))
    return [f"{name}: in {', '.join(sorted(where))}" for name, where in sorted(rooms.items()) if len(where) > 1]


def style_words():
    return banned((TOP / "docs/style.md").read_text(encoding="utf-8"))


def words():
    wrong = wrong_words(TOP, style_words())
    assert not wrong, "\n".join(wrong)


def names():
    found = twice(TOP)
    assert not found, "\n".join(found)


def planted():
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, text in {"src/a/x.c": 'int take_frame(void); /* tell */ const char *k = "refuse";\n', "src/b/x.c": "int GRIP_Q32, mistake;\n", "src/b/main.c": "", "src/a/main.c": "",
                           "include/heave/x.h": ""}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        found = wrong_words(root, {"take": "parse", "tell": "log", "refuse": "reject", "grip": "bandwidth"})
        assert found == ["src/a/x.c: take_frame: not take, but parse (docs/style.md)", "src/b/x.c: GRIP_Q32: not grip, but bandwidth (docs/style.md)"], found
        assert twice(root) == ["x.c: in src/a, src/b"], twice(root)


CASES = {"no identifier has a word that is not used": words, "no file name stands in two rooms": names, "what is planted is found": planted}

def main():
    suite = tap.Suite()
    for name, check in CASES.items():
        with suite.case(f"words: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
