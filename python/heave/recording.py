# SPDX-License-Identifier: MIT
"""recording.py - what senders have sent: FRAMES, which heaved --play takes and --record writes, and CSV files with a column per axis."""
from __future__ import annotations

import csv
import io
import os
import re
from dataclasses import dataclass

from heave.errors import HeaveError
from heave.errors import FrameError
from heave.frames import COMMANDS, frame
from heave.text import read_text

ESCAPE = re.compile(r"\\(x[0-9A-Fa-f]{2}|[0-7]{1,3}|.)", re.DOTALL)
PLAIN = {"n": "\n", "r": "\r", "t": "\t", "0": "\0", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}
TIME = re.compile(r"(\d+)(?:\.(\d{0,3}))?")
UNIT = re.compile(r"_(deg|mm)$")
TIME_COLUMNS = {"t_ms": 1000, "t_us": 1, "t_s": 1_000_000, "t": 1_000_000}


class RecordingError(HeaveError, ValueError):
    """The file, the line, and what would be right."""


@dataclass
class Line:
    """A datagram, or a request, which keeps its exclamation mark."""
    t_us: int
    text: str  # unescaped

    @property
    def is_request(self) -> bool:
        return self.text.startswith("!")


def unescape(text: str) -> str:
    def one(match: re.Match[str]) -> str:
        code = match[1]
        if code[0] == "x":
            return chr(int(code[1:], 16))
        return PLAIN.get(code) or (chr(int(code, 8) & 255) if code.isdigit() else code)
    return ESCAPE.sub(one, text)


def read_frames(path: str | os.PathLike[str]) -> list[Line]:
    """The lines of a FRAMES file, in its order, without comments."""
    lines = []
    for number, text in enumerate(read_text(path, RecordingError).split("\n"), 1):
        text = text.removesuffix("\r")
        if not text.strip() or text.startswith(";"):
            continue
        time, blank, rest = text.partition(" ")
        match = TIME.fullmatch(time)
        if not match or not blank:
            raise RecordingError(f"{path}:{number}: {text[:60]!r}; lines are `<t_ms> <text>`")
        lines.append(Line(int(match[1]) * 1000 + int((match[2] or "").ljust(3, "0")), unescape(rest)))
    return lines


def _command_of(path: str | os.PathLike[str], names: list[str]) -> str:
    """The smallest command that has all of the columns. Poses go before extensions: a trace of heaved has both."""
    used = [[name for name in names if name in axes] for axes in (COMMANDS["A7"], COMMANDS["C7"])]
    wanted = set(used[0]) if set(used[0]) - {"angle"} else set(used[1])
    for command in ("A3", "A4", "A6", "A7") if set(used[0]) - {"angle"} else ("C3", "C6", "C7"):
        if wanted and wanted <= set(COMMANDS[command]):
            return command
    raise RecordingError(f"{path}:1: the header names neither poses ({', '.join(COMMANDS['A7'])}) nor cylinders (c1 to c6), beside the time (t_ms, t_s or t)")


def _delimiter_of(header: str) -> str:
    """Spreadsheets of a language with decimal commas separate by semicolons."""
    return ";" if ";" in header and "," not in header else ","


def read_csv(path: str | os.PathLike[str], command: str | None = None) -> list[Line]:
    """A header `t_ms,roll,pitch,...` (or t_s; units as in roll_deg may stand behind), then a row per frame. `mask` (hexadecimal) and `time_ms` may be columns.

    Values are separated by commas; or by semicolons, and then they may have decimal commas. A column that a command needs and the file lacks is 0. command: which one to send, where the smallest that takes the columns is not meant."""
    lines: list[Line] = []
    text = read_text(path, RecordingError)
    delimiter = _delimiter_of(text.partition("\n")[0])
    rows = csv.reader(io.StringIO(text, newline=""), delimiter=delimiter)
    header = [UNIT.sub("", name.strip().lower()) for name in next(rows, [])]
    time_name = next((name for name in header if name in TIME_COLUMNS), None)
    if time_name is None:
        raise RecordingError(f"{path}:1: no column for the time; one of {', '.join(TIME_COLUMNS)} is needed")
    command = command or _command_of(path, header)
    if command not in COMMANDS:
        raise RecordingError(f"{command!r} is no command; there are {', '.join(COMMANDS)}")
    for row in rows:
        if row and not row[0].startswith((";", "#")):
            cells = row if delimiter == "," else [cell.replace(",", ".") for cell in row]
            lines.append(_line_of(f"{path}:{rows.line_num}", header, cells, time_name, command))
            if len(lines) > 1 and lines[-1].t_us < lines[-2].t_us:
                raise RecordingError(f"{path}:{rows.line_num}: its time is before that of the row before")
    return lines


def _line_of(where: str, header: list[str], row: list[str], time_name: str, command: str) -> Line:
    if len(row) != len(header):
        raise RecordingError(f"{where}: {len(row)} values under {len(header)} names")
    cells = dict(zip(header, (cell.strip() for cell in row)))

    def number(name: str) -> float:
        try:
            return float(cells.get(name) or 0)
        except ValueError:
            raise RecordingError(f"{where}: {name}: {cells[name]!r} is no number") from None

    t_us = number(time_name) * TIME_COLUMNS[time_name]
    if not 0 <= t_us < 2**53:
        raise RecordingError(f"{where}: {time_name}: {cells[time_name]!r} is no time from 0 on")
    try:
        mask = int(cells["mask"], 16) if cells.get("mask") else None
    except ValueError:
        raise RecordingError(f"{where}: mask: {cells['mask']!r} is no hexadecimal number") from None
    try:
        text = frame(command, [number(name) for name in COMMANDS[command]], mask=mask, time_ms=number("time_ms") if cells.get("time_ms") else None)
    except FrameError as error:
        raise RecordingError(f"{where}: {error}") from None
    return Line(round(t_us), text)


def read(path: str | os.PathLike[str]) -> list[Line]:
    """CSV by its name, everything else as FRAMES."""
    return read_csv(path) if os.fspath(path).lower().endswith(".csv") else read_frames(path)
