# SPDX-License-Identifier: MIT
"""frames_file.py - reads FRAMES, the record of datagrams that heaved --play takes and --record writes."""
import re
from dataclasses import dataclass

ESCAPE = re.compile(r"\\(x[0-9A-Fa-f]{2}|[0-7]{1,3}|.)", re.DOTALL)
PLAIN = {"n": "\n", "r": "\r", "t": "\t", "0": "\0", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}


@dataclass
class Line:
    t_us: int
    text: str  # unescaped; a request keeps its exclamation mark

    @property
    def is_request(self):
        return self.text.startswith("!")


def unescape(text):
    def one(match):
        code = match[1]
        if code[0] == "x":
            return chr(int(code[1:], 16))
        return PLAIN.get(code) or (chr(int(code, 8) & 255) if code.isdigit() else code)
    return ESCAPE.sub(one, text)


def read_frames(path):
    """The lines in order of the file, without comments."""
    lines = []
    with open(path, encoding="utf-8", newline="\n") as file:
        for text in file:
            text = text.rstrip("\n")
            if text and not text.startswith(";"):
                time, _, rest = text.partition(" ")
                whole, _, part = time.partition(".")
                lines.append(Line(int(whole) * 1000 + int(part.ljust(3, "0") or "0"), unescape(rest)))
    return lines
