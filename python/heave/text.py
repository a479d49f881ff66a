# SPDX-License-Identifier: MIT
"""text.py - text files of people, read as heaved reads them: UTF-8 with or without a mark in front; comments in any encoding, such as GBK or that of Windows."""
from __future__ import annotations

import codecs
import os
from pathlib import Path

from heave.errors import HeaveError


def read_text(path: str | os.PathLike[str], error: type[HeaveError]) -> str:
    """The whole file. Bytes that are no UTF-8 are kept (surrogateescape), as they may stand in a comment.

    error: what to raise where it is UTF-16."""
    data = Path(path).read_bytes()
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise error(f"{path}:1: the file is UTF-16; allowed: plain text (UTF-8)")
    return data.removeprefix(codecs.BOM_UTF8).decode("utf-8", "surrogateescape")
