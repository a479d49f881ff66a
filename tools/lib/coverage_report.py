#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""coverage_report.py - what the profiles that tools/coverage has made say, file by file, and what was not reached.

usage: coverage_report.py BUILD_DIR VERSION [--html DIR] [--missing PATH]     VERSION is the suffix of llvm-cov, "-19" or nothing

tests/coverage-exclusions.txt: "PATH FUNCTION: the whole line of code", and below it, indented, the reason. Blank lines and lines with # are skipped.
Exit status: 0 lines and branches of the core are covered but for the exclusions, and BACKENDS_PERCENT of the branches of each backend; 1 they are
not, or an exclusion is wrong.
"""
import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

import rooms

TOP = Path(__file__).resolve().parents[2]
EXCLUSIONS = TOP / "tests/coverage-exclusions.txt"
FUNCTION_HEAD = re.compile(r"[a-z][^;=#]*?\b(\w+)\(")
GROUPS = (("Core", rooms.is_core), ("Programs", rooms.is_program),
          ("Backends", lambda name: name.startswith("hal/")))
BACKENDS_PERCENT = 90


class Exclusions:
    """Lines that no test can reach, each with a reason."""

    def __init__(self, path):
        self.path, self.entries, self.used, self.errors = path, {}, set(), []
        key = None
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines() if path.exists() else [], 1):
            if not line.strip() or line.startswith("#"):
                continue
            if line[0] in " \t":
                if key is None:
                    self.errors.append(f"{path.name}:{number}: a reason without a line of code above it")
                else:
                    self.entries[key] = number
                    key = None
            else:
                self.open_end(key)
                place, _, code = line.partition(": ")
                key = (place, code.strip())
                if not re.fullmatch(r"\S+ \w+", place) or not code or key in self.entries:
                    self.errors.append(f"{path.name}:{number}: must be PATH FUNCTION: CODE, and each once")
        self.open_end(key)

    def open_end(self, key):
        if key is not None:
            self.errors.append(f"{self.path.name}: {key[0]}: {key[1]}: no reason below it")

    def has(self, place, code):
        key = (place, code.strip())
        if key in self.entries:
            self.used.add(key)
        return key in self.entries

    def stale(self):
        return [f"{self.path.name}:{number}: {place}: is reached now or not there any more: {code}"
                for (place, code), number in self.entries.items() if (place, code) not in self.used]


class File:
    """What was reached of one file, over all builds of it."""

    def __init__(self, name):
        self.name, self.text = name, (TOP / name).read_text(encoding="utf-8").splitlines()
        self.lines, self.branches, self.decisions = {}, {}, {}

    def add_branch(self, branch):
        """What switches name no case for is no branch here: the compilers see to it (-Wswitch-enum) that every value has one."""
        place, taken = tuple(branch[:4]), branch[4:6]
        if self.text[place[0] - 1][:place[1] - 1].endswith("switch ("):
            return
        self.branches[place] = [old + new for old, new in zip(self.branches.get(place, (0, 0)), taken)]

    def add_decision(self, decision):
        place, shown = tuple(decision[:4]), decision[-1]
        self.decisions[place] = [old or new for old, new in zip(self.decisions.get(place, [False] * len(shown)), shown)]

    def function_at(self, line):
        """The function around a line: our style has its head, and nothing else of it, in the first column."""
        heads = (FUNCTION_HEAD.match(self.text[i]) for i in range(line - 1, -1, -1))
        return next((head[1] for head in heads if head), "")

    def source(self, place):
        first, begin, last, end = place
        if first == last:
            return self.text[first - 1][begin - 1:end - 1]
        return " ".join([self.text[first - 1][begin - 1:], *(line.strip() for line in self.text[first:last - 1]), self.text[last - 1][:end - 1].strip()])

    def missing_lines(self):
        return [(line, "not run") for line, count in sorted(self.lines.items()) if not count]

    def missing_branches(self):
        """(line, text), one for each way that was not taken."""
        return [(place[0], f"never {way}: {self.source(place)}") for place, taken in sorted(self.branches.items())
                for way, count in zip(("true", "false"), taken) if not count]

    def missing_conditions(self):
        missing = []
        for place, shown in sorted(self.decisions.items()):
            inside = [branch for branch in sorted(self.branches) if place[:2] <= branch[:2] and branch[2:] <= place[2:]]
            for index, is_shown in enumerate(shown):
                if not is_shown:
                    named = self.source(inside[index]) if len(inside) == len(shown) else f"condition {index + 1}"
                    missing.append((inside[index][0] if len(inside) == len(shown) else place[0], f"never decides alone: {named}"))
        return missing


class Judged:
    """One file against the exclusions."""

    def __init__(self, file, exclusions):
        def left(missing):
            return [item for item in missing if not exclusions.has(f"{file.name} {file.function_at(item[0])}", file.text[item[0] - 1])]

        self.name = file.name
        self.totals = [len(file.lines), 2 * len(file.branches), sum(map(len, file.decisions.values()))]
        found = [file.missing_lines(), file.missing_branches(), file.missing_conditions()]
        self.missing = [left(items) for items in found]
        self.reached = [total - len(items) for total, items in zip(self.totals, found)]
        self.excluded = len(found[0]) + len(found[1]) - len(self.missing[0]) - len(self.missing[1])


def run(command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"coverage: {command[0]} failed: {done.stderr.strip()}")
    return done.stdout


def programs(build):
    """Two sets: some programs compile sources of the core anew, with other options, and llvm-cov knows each function once."""
    found = [path for folder in ("bin", "src", "tests") for path in sorted((build / folder).rglob("*"))
             if path.is_file() and path.stat().st_mode & 0o100 and path.suffix not in (".so", ".py", ".sh") and "CMakeFiles" not in path.parts]
    found = [path for path in found if path.read_bytes()[:4] == b"\x7fELF"]
    sets = [[path for path in found if path.stem.endswith("_portable") == is_portable] for is_portable in (False, True)]
    return [paths for paths in sets if paths]


def objects(paths):
    return [paths[0], *(word for path in paths[1:] for word in ("-object", path))]


def read(build, version):
    """The files of src/ and hal/, by name."""
    profile = build / "all.profdata"
    run([f"llvm-profdata{version}", "merge", "-o", profile, *sorted((build / "profiles").glob("*.profraw"))])
    files = {}

    def file_of(path):
        name = str(Path(path).relative_to(TOP)) if Path(path).is_relative_to(TOP) else ""
        if not name.startswith(("src/", "hal/")):
            return None
        return files.setdefault(name, File(name)) if name in files or (TOP / name).is_file() else None

    for paths in programs(build):
        cov = [f"llvm-cov{version}", "export", "-instr-profile", profile, *objects(paths)]
        for data in json.loads(run([*cov, "-skip-functions"]))["data"][0]["files"]:
            file = file_of(data["filename"])
            for branch in data["branches"] if file else []:
                file.add_branch(branch)
            for decision in data.get("mcdc_records", []) if file else []:
                file.add_decision(decision)
        file = None
        for line in run([*cov, "-format=lcov"]).splitlines():
            if line.startswith("SF:"):
                file = file_of(line[3:])
            elif line.startswith("DA:") and file:
                number, count = map(int, line[3:].split(",")[:2])
                file.lines[number] = file.lines.get(number, 0) + count
    return files


def html(build, version, folder):
    run([f"llvm-cov{version}", "show", "-format=html", "-show-branches=count", "-output-dir", folder, "-instr-profile", build / "all.profdata",
         *objects(programs(build)[0]), *[TOP / name for name in ("src", "hal")]])
    print(f"{folder}/index.html")


def cell(reached, total):
    return f"{reached:>6}/{total:<6}{100 * reached / total if total else 100:>6.1f} %"


def show_row(name, reached, totals, excluded):
    print(f"{name:<36}" + "".join(cell(*pair) for pair in zip(reached, totals)) + (f"{excluded:>10}" if excluded else ""))


def show_group(title, judged):
    print(f"{title:<36}{'lines':>14}{'branches':>22}{'MC/DC':>22}{'excluded':>16}")
    for file in judged:
        show_row(file.name, file.reached, file.totals, file.excluded)
    sums = [[sum(getattr(file, which)[i] for file in judged) for i in range(3)] for which in ("reached", "totals")]
    show_row("all of it", *sums, sum(file.excluded for file in judged))
    print()


def gaps(file):
    """One line each; lines in a row that were not run are one."""
    found = []
    for line, what in sorted(item for items in file.missing for item in items):
        if found and what == "not run" and found[-1][2] == what and found[-1][1] == line - 1:
            found[-1][1] = line
        else:
            found.append([line, line, what])
    return [f"{file.name}:{first}{'' if first == last else f'-{last}'}: {what}" for first, last, what in found]


def thin(judged):
    """Backends of which too few branches are reached or excluded."""
    for file in judged:
        total = file.totals[1]
        reached = total - len(file.missing[1])
        if GROUPS[2][1](file.name) and 100 * reached < BACKENDS_PERCENT * total:
            yield f"{file.name}: {100 * reached / total:.1f} % of its branches are reached, it must be {BACKENDS_PERCENT} %"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build", type=Path)
    parser.add_argument("version")
    parser.add_argument("--html", type=Path)
    parser.add_argument("--missing")
    options = parser.parse_args()
    exclusions = Exclusions(EXCLUSIONS)
    judged = [Judged(file, exclusions) for _, file in sorted(read(options.build, options.version).items())]
    for title, is_in in GROUPS:
        show_group(title, [file for file in judged if is_in(file.name)])
    if options.html:
        html(options.build, options.version, options.html)
    is_core = GROUPS[0][1]
    for file in judged:
        if file.name.startswith(options.missing) if options.missing is not None else is_core(file.name):
            print("".join(f"{line}\n" for line in gaps(file)), end="")
    wrong = [*exclusions.errors, *exclusions.stale(), *thin(judged)]
    print(*wrong, sep="\n", end="\n" if wrong else "")
    left = sum(len(items) for file in judged if is_core(file.name) for items in file.missing[:2])
    print(f"{left} lines and branches of the core are neither reached nor excluded")
    return 1 if left or wrong else 0


if __name__ == "__main__":
    sys.exit(main())
