# SPDX-License-Identifier: MIT
"""reader.py - finds the texts of the programs on a screen, in English or by their translations in po/, and says them in English with what was filled in."""
import re
import sys
from pathlib import Path

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tests/lib"))
CONVERSION = re.compile(r"%(?:(\d+)\$)?[-+ 0#]*[\d.]*([a-z%])")
VALUES = {"u": r"\d+", "d": r"-?\d+", "f": r"-?[\d.]+", "g": r"-?[\d.e+-]*\d", "s": r".*?"}
LEAST = 3  # characters that tell a text from another


def texts(language):
    """{English: translation} of a catalogue's setup and held keys."""
    found = {}
    for block in (TOP / "po" / f"{language}.po").read_text(encoding="utf-8").split("\n\n"):
        parts = {name: "".join(re.findall(r'"((?:\\.|[^"\\])*)"', lines)) for name, lines in re.findall(r'^(msgid|msgstr) ((?:"(?:\\.|[^"\\])*"\n?)+)', block, re.M)}
        if re.search(r"^#: .*src/(setup|heavectl/(setup|hold))", block, re.M):
            found[plain(parts["msgid"])] = plain(parts["msgstr"])
    return found


def plain(text):
    return text.replace("\\n", "\n").replace('\\"', '"').replace("\\\\", "\\")


def pattern(text):
    """What a text looks like on a screen, where a line may end anywhere; a group for each conversion."""
    out, at = "", 0
    for found in CONVERSION.finditer(text):
        out += spread(text[at:found.start()]) + (f"({VALUES[found[2]]})" if found[2] != "%" else "%")
        at = found.end()
    return re.compile(out + spread(text[at:]), re.DOTALL)


def spread(text):
    return "".join(r"\s*" if letter.isspace() else re.escape(letter) + r"\s*" for letter in text)


class Reader:
    def __init__(self, language=None):
        """language: the name of a catalogue; None: English, which needs none."""
        self.texts = texts(language) if language else None
        self.patterns = [(english, own, pattern(own)) for english, own in self.texts.items() if len(CONVERSION.sub("", own).strip()) >= LEAST] if language else []

    def own(self, english):
        """A text as the screen says it, as a pattern."""
        return pattern(self.texts[english] if self.texts else english).pattern

    def english(self, screen):
        """What stands on the screen, in English; a screen that is English as it is."""
        if self.texts is None:
            return screen
        said = []
        for english, own, look in self.patterns:
            found = look.search(screen)
            if found:
                order = [int(one[1] or n + 1) for n, one in enumerate(one for one in CONVERSION.finditer(own) if one[2] != "%")]
                values = dict(zip(order, found.groups()))
                numbers = iter(range(1, len(values) + 1))
                said.append((found.start(), CONVERSION.sub(lambda one: "%" if one[2] == "%" else values[next(numbers)].strip(), english)))
        return "\n".join(text for _, text in sorted(said))
