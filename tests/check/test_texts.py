#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_texts.py - every text of the programs has its translation, and tools/texts finds each way in which one could be wrong."""
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
PO = "po/zh_CN.po"
COPIED = ["src", "hal/linux", "include", "config", "po", "tools/texts"]


def check(top):
    run = subprocess.run([top / "tools/texts", "--check"], capture_output=True, text=True, check=False)
    return run.returncode, run.stdout + run.stderr


def change(text, pattern, to):
    changed, count = re.subn(pattern, to, text, count=1, flags=re.M)
    assert count == 1, f"{pattern} is not there"
    return changed


class Copy:
    """The sources with one change, which has to be found."""

    def __init__(self, folder):
        self.top = Path(folder)
        for name in COPIED:
            source, target = TOP / name, self.top / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target)
            else:
                shutil.copy(source, target)

    def finds(self, path, pattern, to, complaint):
        file = self.top / path
        before = file.read_text(encoding="utf-8")
        file.write_text(change(before, pattern, to), encoding="utf-8")
        code, text = check(self.top)
        file.write_text(before, encoding="utf-8")
        assert code == 1 and re.search(complaint, text), f"{complaint} is not in: {text}"


def main():
    suite = tap.Suite()
    with suite.case("every text is translated, up to date, and takes the arguments of the English one"):
        code, text = check(TOP)
        assert code == 0, text
        print(f"# figure {text.splitlines()[-1]}")
    with tempfile.TemporaryDirectory(prefix="heave-texts-") as folder:
        copy = Copy(folder)
        entry = r'msgid "heaved does not answer"\n'
        with suite.case("a copy of the sources is as right"):
            code, text = check(copy.top)
            assert code == 0, text
        with suite.case("found: a text without translation"):
            copy.finds(PO, entry + 'msgstr ".*"', entry + 'msgstr ""', "heaved does not answer.*has no translation")
        with suite.case("found: a fuzzy one"):
            copy.finds(PO, entry, "#, fuzzy\n" + entry, "heaved does not answer.*is fuzzy")
        with suite.case("found: one that nobody uses any more"):
            copy.finds("src/heavectl/main.c", r'"heaved has ended"', '"heaved is no more"', 'missing: "heaved is no more"')
            copy.finds("src/heavectl/lists.c", r'_\("no incidents\\n"\)', '"%s"', 'stale: "no incidents')
        with suite.case("found: a new text that is not in the po file"):
            copy.finds("src/heavectl/main.c", r'"the null device: %s"', '"the device of nothing: %s"', 'missing: "the device of nothing: %s"')
        with suite.case("found: a sentence of a program that nobody has marked"):
            copy.finds("src/heavectl/lists.c", r'_\("no incidents\\n"\)', r'"nothing was found\\n"', 'nobody marked "nothing was found')
        with suite.case("found: a help of a key without translation"):
            copy.finds("src/config/keys.c", r'"period of the motion cycle"', '"how long a cycle is"', 'missing: "how long a cycle is"')
        with suite.case("found: a text of the core without translation"):
            copy.finds("src/canopen/canopen_text.c", r'"the motor is too hot"', '"the motor is on fire"', 'missing: "the motor is on fire"')
        with suite.case("found: a format that takes other arguments"):
            copy.finds(PO, r'(msgid "heaved cannot be asked: %s"\nmsgstr ".*)%s', r"\1%d", "format specifications|not a valid")
            copy.finds(PO, r'(msgid "heaved cannot be asked: %s"\nmsgstr ".*)%s', r"\1", "number of format specifications")
        with suite.case("found: a translation that has lost a key, an option or a command"):
            copy.finds(PO, r'(msgid "--eds is for --check"\nmsgstr ".*)--check', r"\1", "lacks --check")
            copy.finds(PO, r'(msgid "a drive has no torque: `torque` switches it on"\nmsgstr ".*)`torque`', r"\1", "lacks `torque`")
        with suite.case("found: a line of po/english that no source has"):
            copy.finds("po/english", r"\A", "no such sentence here\n", 'no source has "no such sentence here"')
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
