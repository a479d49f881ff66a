#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_readme.py - what README.md, README.zh-CN.md and docs/configuration.md say is what the programs and the tree do.

usage: test_readme.py --heaved PROGRAM --heavectl PROGRAM --reference PROGRAM --faults PROGRAM
"""
import argparse
import functools
import os
import re
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
README, README_ZH = TOP / "README.md", TOP / "README.zh-CN.md"
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
STATES = re.compile(r"<!-- states:begin -->.*?<!-- states:end -->", re.S)
NOT_OURS = {"cmake", "export", "printf"}


def run(*command, **more):
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, **more)


@functools.cache
def help_of(program):
    result = run(program, "--help")
    assert result.returncode == 0, f"{program} --help: exit status {result.returncode}, {result.stderr}"
    return result.stdout


def page(path):
    """Without the states, which are in another language each."""
    return STATES.sub("", path.read_text(encoding="utf-8"))


def blocks(path, language=None):
    return [text for name, text in FENCE.findall(page(path)) if language in (None, name)]


def prose(path):
    return FENCE.sub("", page(path))


def table_rows(path):
    """Rows of each table, in order."""
    return [len(table.splitlines()) for table in re.findall(r"(?:^\|.*\n)+", prose(path), re.M)]


class Page:
    """One README against the programs."""

    def __init__(self, path, programs):
        self.path = path
        self.programs = programs

    def states(self):
        result = run(sys.executable, TOP / "tools/gen_states.py", "--check", self.path)
        assert result.returncode == 0, result.stdout + result.stderr

    def links(self):
        targets = re.findall(r"\]\(([^)#:]+)\)", page(self.path))
        missing = [target for target in targets if not (TOP / target).exists()]
        assert targets and not missing, f"links to what is not there: {missing}"

    def command(self, line):
        """A line of a shell block: program and paths exist, the program knows its options."""
        words = line.split()
        if words[0] in NOT_OURS:
            return
        is_known = words[0] in self.programs
        assert is_known or (TOP / words[0]).exists(), f"{line}: {words[0]} is not there"
        known = set(OPTION.findall(help_of(self.programs[words[0]]))) if is_known else set()
        unknown = set(OPTION.findall(line)) - known
        assert not unknown, f"{line}: {words[0]} does not know {unknown}"
        for word in words[1:]:
            is_path = "/" in word and re.fullmatch(r"[\w.][\w./-]*", word)
            assert not is_path or (TOP / word).exists(), f"{line}: {word} is not there"

    def commands(self):
        lines = [line for text in blocks(self.path, "sh") for line in text.splitlines()]
        assert lines, "no shell block"
        for line in lines:
            self.command(line)

    def options(self):
        """Options named here exist, options that exist are named."""
        named = set(OPTION.findall(page(self.path)))
        existing = {program: set(OPTION.findall(help_of(path))) for program, path in self.programs.items()}
        for program in ("heaved", "heavectl"):
            missing = existing[program] - named - {"--help", "--version"}
            assert not missing, f"options of {program} that are not named: {missing}"
        unknown = named - set().union(*existing.values()) - {"--build", "--install", "--now"}  # of cmake, systemctl
        assert not unknown, f"no program has {unknown}"

    def commands_of_heavectl(self):
        table = re.search(r"^## heavectl\n.*?(?=^## )", page(self.path), re.M | re.S)[0]
        named = re.findall(r"^\| `(\w+)` \|", table, re.M)
        answer = run(self.programs["heavectl"], "nonsense").stderr
        known = re.findall(r"\w+", re.search(r"unknown command; (.*) are allowed", answer)[1].replace(" and ", " "))
        assert sorted(named) == sorted(known), f"named {named}, known {known}"

    def exit_codes(self):
        header = (TOP / "src/common/message.h").read_text(encoding="ascii")
        known = set(re.findall(r"EXIT_\w+ = (\d+)", header))
        table = re.search(r"^\| [^|]+ \| heaved, heavectl \|\n(?:\|.*\n)+", page(self.path), re.M)[0]
        named = set(re.findall(r"\d+", " ".join(re.findall(r"^\| ([\d, ]+) \|", table, re.M))))
        assert named == known, f"named {sorted(named)}, known {sorted(known)}"

    def flags(self):
        words = re.findall(r'\{(?:MOTION|FLAG)_\w+, "([\w-]+)"\}', (TOP / "src/record/trace.c").read_text(encoding="ascii"))
        missing = [word for word in words if f"`{word}`" not in page(self.path)]
        assert words and not missing, f"flags of a trace that are not named: {missing}"

    def sections(self):
        dump = run(self.programs["heaved"], "--config", TOP / "config/demo-hexapod.ini", "--dump-config").stdout
        known = set(re.findall(r"^\[(\w+)\]", dump, re.M))
        named = set(re.findall(r"`\[(\w+)\]`", page(self.path)))
        assert known and known <= named, f"sections that are not named: {known - named}"

    def frames(self):
        """Every frame is one that a hexapod or a platform of three cylinders takes."""
        frames = sorted(set(re.findall(r"@[AC]\d[^#`]*#", page(self.path))))
        assert len(frames) > 7
        for frame in frames:
            takers = [name for name in ("demo-hexapod", "tripod-rotation") if self.is_taken(frame, name)]
            assert takers, f"no platform takes {frame}"

    def is_taken(self, frame, name):
        with tempfile.NamedTemporaryFile("w", suffix=".frames") as file:
            file.write(f"0 {frame}\n")
            file.flush()
            result = run(self.programs["heaved"], "--config", TOP / f"config/{name}.ini", "--play", file.name)
        assert result.returncode == 0, result.stderr
        return ": 1 frames accepted" in result.stderr

    def offline_block(self):
        """The blocks that only read configurations and run offline do as they stand, in a folder of their own."""
        text = "\n".join(text for text in blocks(self.path, "sh") if "--play" in text or "--check" in text)
        assert "--play" in text and "--check" in text
        with tempfile.TemporaryDirectory() as folder:
            path = f"{self.programs['heaved'].parent}:{os.environ['PATH']}"
            result = run("bash", "-e", "-c", text.replace("/tmp/", f"{folder}/"), cwd=TOP, env={**os.environ, "PATH": path})
        assert result.returncode == 0, result.stdout[-2000:] + result.stderr

    def one_frame(self):
        """The line that sends a frame by hand: what arrives is that frame."""
        text = next(text for text in blocks(self.path, "sh") if "/dev/udp/" in text)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(60)
            result = run("bash", "-c", text.replace("/9800", f"/{receiver.getsockname()[1]}"))
            assert result.returncode == 0, result.stderr
            assert receiver.recv(512).decode() in text


def same_structure():
    for what, of in {"headings": lambda path: re.findall(r"^#+", prose(path), re.M), "rows of tables": table_rows, "code blocks": blocks}.items():
        one, other = of(README), of(README_ZH)
        assert one == other, f"{what} differ: {one} and {other}"


def reference(program, page):
    wanted = run(program).stdout
    got = (TOP / page).read_text(encoding="utf-8")
    assert got == wanted, f"{page} is not up to date: {program} > {page}"


def main():
    parser = argparse.ArgumentParser()
    for name in ("heaved", "heavectl", "reference", "faults"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    arguments = parser.parse_args()
    programs = {"heaved": arguments.heaved, "heavectl": arguments.heavectl, "tools/demo": TOP / "tools/demo", "tools/test": TOP / "tools/test",
                "tools/check_trace": TOP / "tools/check_trace"}
    suite = tap.Suite()
    for path in (README, README_ZH):
        checked = Page(path, programs)
        for check in (checked.states, checked.links, checked.commands, checked.options, checked.commands_of_heavectl, checked.exit_codes,
                      checked.flags, checked.sections, checked.frames, checked.offline_block, checked.one_frame):
            with suite.case(f"{path.name}: {check.__name__.replace('_', ' ')}"):
                check()
    with suite.case("both pages have the same headings, tables and code blocks"):
        same_structure()
    with suite.case("docs/configuration.md is what the table of keys says"):
        reference(arguments.reference, "docs/configuration.md")
    with suite.case("docs/faults.md is what the table of faults says"):
        reference(arguments.faults, "docs/faults.md")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
