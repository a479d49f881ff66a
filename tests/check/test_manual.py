#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_manual.py --build DIR - manual pages and completion: well-formed, and with everything that --help and the configuration know."""
import argparse
import gzip
import re
import shutil
import subprocess
import sys
import unicodedata
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
PAGES = ["heaved.8", "heavectl.1", "heave-twin.1", "heave.ini.5"]
PROGRAMS = [("heaved", "heaved.8"), ("heavectl", "heavectl.1"), ("heave-twin", "heave-twin.1")]
PANEL = ("heave-panel", "heave-panel.8")  # where it was built
COMPLETION = Path("/usr/share/bash-completion/bash_completion")
WORD_LIST = re.compile(r"(?m)^  (?!heave)(--)?([a-z][a-z0-9-]*)")


def output(*command, **more):
    result = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            check=False, **more)
    return result.returncode, result.stdout


class Built:
    def __init__(self, build):
        self.bin = build / "bin"
        self.pages = build / "packaging"

    def help(self, program):
        code, text = output(self.bin / program, "--help")
        assert code == 0, text
        return text

    def words(self, program):
        """Options and commands of its --help."""
        found = WORD_LIST.findall(self.help(program))
        return sorted(word for dashes, word in found if dashes), sorted(word for dashes, word in found if not dashes)

    def roff(self, page):
        text = (self.pages / page).read_text(encoding="utf-8")
        assert gzip.decompress((self.pages / f"{page}.gz").read_bytes()).decode() == text, f"{page}.gz is another one"
        return text

    def items(self, page, heading):
        """What the list of a section defines, in the words of the page."""
        section = re.search(rf"(?ms)^\.SH {heading}\n(.*?)(?=^\.SH |\Z)", self.roff(page))
        assert section, f"{page} has no {heading}"
        return [item.replace(r"\-", "-") for item in re.findall(r"(?m)^\.TP\n\\fB(.*)\\fR$", section[1])]


def lint(built):
    if shutil.which("mandoc") is None:
        raise tap.Skip("mandoc is not there")
    for page in PAGES:
        code, text = output("mandoc", "-Tlint", "-Wall", built.pages / page)
        assert code == 0 and text == "", text


def man_warnings(built):
    if shutil.which("man") is None:
        raise tap.Skip("man is not there")
    for page in PAGES:
        run = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-Tutf8", "-Z", "-l", str(built.pages / page)], stdin=subprocess.DEVNULL,
                             stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False, env={"LC_ALL": "C.UTF-8", "PATH": "/usr/bin:/bin"})
        assert run.returncode == 0 and run.stderr == "", run.stderr


def columns(line):
    return sum(2 if unicodedata.east_asian_width(character) in "WF" else 1 for character in line)


def shown(path):
    """The lines of a page as man shows them in 80 columns."""
    run = subprocess.run(["man", "--warnings", "-E", "UTF-8", "-l", str(path)], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
                         env={"LC_ALL": "C.UTF-8", "MANWIDTH": "80", "PATH": "/usr/bin:/bin"})
    assert run.returncode == 0 and run.stderr == "", run.stderr
    return run.stdout.splitlines()


def chinese(built):
    """The same lists in the same order, every text in Chinese, lines that man can break."""
    for page in PAGES:
        text = built.roff(f"zh_CN/{page}")
        for what in (r"(?m)^\.TP\n(.*)", r"(?m)^\.SH [^\[\n]*(\[.*\])"):
            assert re.findall(what, text) == re.findall(what, built.roff(page)), f"{what} of {page} differs in Chinese"
        text = text[text.index(".SH "):]
        plain = re.sub(r"\\f[BR]|\\:", "", text)
        told = [entry for entry in re.split(r"(?m)^\.(?:TP\n.*|SH .*|PP|br)$", plain) if re.search(r"[a-z]{3} [a-z]{3} [a-z]{3}", re.sub(r"(?ms)^\.nf.*?^\.fi$", "", entry))]
        english = [entry for entry in told if not re.search("[\u4e00-\u9fff]", entry)]
        assert not english, f"{page}: in English: {english[:3]}"
        if shutil.which("man") is not None:
            widest = max(map(columns, shown(built.pages / page))) # of examples, which nobody breaks
            long = [line for line in shown(built.pages / "zh_CN" / page) if columns(line) > max(80, widest)]
            assert not long, f"{page}: wider than 80 columns: {long[:3]}"


def options_and_commands(built):
    for program, page in PROGRAMS:
        options, commands = built.words(program)
        assert len(options) > 5, options
        named = sorted(item.split()[0][2:] for item in built.items(page, "OPTIONS"))
        assert named == options, f"{page} has {named}, --help {options}"
        if commands:
            named = sorted(item.split()[0] for item in built.items(page, "COMMANDS"))
            assert named == commands, f"{page} has {named}, --help {commands}"


def exit_codes(built):
    in_header = set(re.findall(r"EXIT_\w+ = (\d+)", (TOP / "src/common/message.h").read_text(encoding="ascii")))
    everywhere = set()
    for program, page in PROGRAMS:
        listed = re.search(r"(?s)Exit codes: (.*)\.\n", built.help(program))[1]
        codes = re.findall(r"(?:^|[ \n])(\d+) ", listed)
        assert built.items(page, "EXIT STATUS") == codes and codes, f"{page}, and --help {codes}"
        everywhere |= set(codes)
    assert everywhere == in_header, f"{everywhere} documented, {in_header} in use"


def keys(built):
    reference = (TOP / "docs/configuration.md").read_text(encoding="utf-8")
    count = 0
    for section, text in re.findall(r"(?ms)^## \[([\w-]+)\]$(.*?)(?=^## |\Z)", reference):
        wanted = re.findall(r"(?m)^\| `(\w+)` \|", text)
        named = [item.split()[0] for item in built.items("heave.ini.5", rf"SECTION \[{section}\]")]
        assert named == wanted, f"[{section}]: {named}, and {wanted}"
        count += len(wanted)
    assert count > 150, count


def complete(built, *words):
    """What bash offers for the last word."""
    if not COMPLETION.exists():
        raise tap.Skip("bash-completion is not there")
    script = TOP / "packaging" / ("panel" if words[0] == "heave-panel" else "completions") / words[0]
    program = built.bin / words[0]
    text = f"""source {COMPLETION}; source {script}
COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMP_LINE="$*"; COMP_POINT=${{#COMP_LINE}}
_{words[0].replace('-', '_')} {program} "${{COMP_WORDS[COMP_CWORD]}}" "${{COMP_WORDS[COMP_CWORD-1]}}"
printf '%s\\n' "${{COMPREPLY[@]}}" """
    code, found = output("bash", "--norc", "-c", text, "bash", *words, cwd=TOP / "config")
    assert code == 0, found
    return sorted(found.split())


def completion(built):
    for program, _ in PROGRAMS:
        options, commands = built.words(program)
        assert complete(built, program, "--") == sorted(f"--{option}" for option in options), complete(built, program, "--")
        if commands:
            assert complete(built, program, "") == commands, complete(built, program, "")
    assert complete(built, "heaved", "--d") == ["--doctor", "--drive", "--dump-config", "--dump-dbc"]
    assert complete(built, "heaved", "--config", "demo") == ["demo-hexapod.ini"]
    assert complete(built, "heavectl", "--json", "s") == ["scope", "sdo", "seen", "selftest", "service", "service-off", "setup", "shutdown", "signal", "status"]
    assert complete(built, "heavectl", "--hz", "") == []
    assert complete(built, "heave-twin", "cable-") == ["cable-in", "cable-out"]
    assert complete(built, "heave-twin", "--swap", "") == []
    if PANEL in PROGRAMS:
        assert complete(built, "heave-panel", "passwd", "") == ["look", "operate", "service"]
    assert not any(word.startswith("-") for word in complete(built, "heavectl", "--platform", "")), "names of platforms, where some run"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, required=True)
    built = Built(parser.parse_args().build.resolve())
    if (built.pages / PANEL[1]).exists():
        PAGES.append(PANEL[1])
        PROGRAMS.append(PANEL)
    suite = tap.Suite()
    for what, case in (("mandoc finds nothing to say about the pages", lint), ("man formats them without a warning", man_warnings),
                       ("a page has the options and commands of --help, and no others", options_and_commands),
                       ("exit codes are those of --help, and all that there are", exit_codes),
                       ("heave.ini(5) has every section and key, and no others", keys),
                       ("the Chinese pages have the same lists, and no English", chinese),
                       ("bash completes what --help names, files where they belong, and nothing else", completion)):
        with suite.case(what):
            case(built)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
