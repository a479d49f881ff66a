# SPDX-License-Identifier: MIT
"""heave check, heave plot: what can be told of runs."""
from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import heave

USAGE = """usage: heave check [--json] [--strict] [--frames FRAMES] [--every N] CONFIG TRACE     proves row by row that a trace kept every limit of its configuration
       heave plot TRACE|INCIDENT [-o FILE] [--what curves|limits|spectrum|animation] ...   draws it
       heave --version
`heave check --help` and `heave plot --help` say more."""


def main(words: Sequence[str] | None = None) -> int:
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends it without a word, as other programs
    words = list(sys.argv[1:] if words is None else words)
    if words[:1] == ["check"]:
        from heave.judge.command import main as check
        return check(words[1:], "heave check")
    if words[:1] == ["plot"]:
        from heave.plot.command import main as plot
        return plot(words[1:], "heave plot")
    if words == ["--version"]:
        print(f"heave {heave.__version__}")
        return 0
    is_help = words in (["--help"], ["-h"])
    print(USAGE, file=sys.stdout if is_help else sys.stderr)
    return 0 if is_help else 2


if __name__ == "__main__":
    sys.exit(main())
