# SPDX-License-Identifier: MIT
"""command.py - heave-lab."""
from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence

from heave import lab
from heave.errors import HeaveError

CANNOT, TOO_LONG, NOBODY_READS = 125, 124, 141
DESCRIPTION = """Runs a command on a kernel that has CAN (vcan0 is up), slcan and simulated GPIO lines (gpio-sim), where this machine's own kernel has none.
The kernel is an ordinary program (User Mode Linux): no rights are needed, this machine's files are its files."""
EPILOG = f"""exit status: that of the command; {TOO_LONG} after --limit; {NOBODY_READS} where nobody reads what it prints; {CANNOT} where it could not be run, which is said.
The kernel is built once, by `heave-lab build`, from the newest package linux-source of Debian's backports (or else of this machine's lists),
into ~/.cache/heave: some minutes; takes gcc, make, flex, bison, bc and xz-utils.
For a CI machine keep that folder in its cache."""


def seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < 1e6:
        raise argparse.ArgumentTypeError(f"{text!r}: seconds above 0")
    return value


def parser_of(program: str) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog=program, description=DESCRIPTION, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="run | build | path")
    run = verbs.add_parser("run", usage=f"{program} run [OPTION...] -- COMMAND [ARG...]", help="runs a command", epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter)
    run.add_argument("--virtual-time", action="store_true", help="computing takes no time, sleeps are exact: every run is the same, an hour takes seconds")
    run.add_argument("--kernel", choices=lab.KERNELS, default="own", help="own: User Mode Linux (default); here: this machine's, in a name space; any: this machine's where it has vcan")
    run.add_argument("--limit", type=seconds, metavar="S", help="ends it after so many seconds of real time")
    run.add_argument("--memory", default=lab.MEMORY, metavar="SIZE", help=f"of the kernel (default {lab.MEMORY})")
    run.add_argument("command", nargs="+", metavar="COMMAND")
    verbs.add_parser("build", help="builds the kernel where there is none yet, and prints its path")
    verbs.add_parser("path", help="prints the path of the kernel, or says that there is none")
    return parser


def main(words: Sequence[str] | None = None, program: str = "heave-lab") -> int:
    options = parser_of(program).parse_args(words)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    try:
        if options.verb != "run":
            print(lab.find_kernel(build=options.verb == "build"))
            return 0
        finished = lab.run(options.command, kernel=options.kernel, virtual_time=options.virtual_time, limit_s=options.limit, memory=options.memory, echo=True)
    except BrokenPipeError:  # nobody reads what the command prints: the kernel is ended already
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return NOBODY_READS
    except (HeaveError, OSError) as error:
        print(f"{program}: {error}", file=sys.stderr)
        return CANNOT if options.verb == "run" else 1
    except KeyboardInterrupt:
        return 130
    if finished.returncode is None:
        print(f"{program}: not finished within {options.limit:g} s", file=sys.stderr)
        return TOO_LONG
    return finished.returncode
