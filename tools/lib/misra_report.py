# SPDX-License-Identifier: MIT
"""misra_report.py - what tools/misra does once cppcheck is there: runs it file by file, and judges what it finds by the list of deviations."""
import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rooms

TOP = Path(__file__).resolve().parents[2]
LIST = TOP / "docs/misra.md"
CPPCHECK = ("cppcheck", "--addon=misra", "--std=c99", "--language=c", "--quiet", "--enable=warning,performance,portability", "-I", "include",
            "--template={file}:{line}: {id}: {message}")
FINDING = re.compile(r"(\S+?):(\d+): (?:misra-c2012-)?([\w.]+):")  # a rule, or a finding of cppcheck's own
BROKEN = re.compile(r"internal\w*|syntaxError|\w*[Cc]onfig\w*")  # the file was not judged as a whole
ENTRY = re.compile(r"\|\s*(\d+\.\d+|[a-z]\w*[A-Z]\w*|uninitvar)\s*\|[^|]*\|([^|]*)\|\s*([^|]+?)\s*\|$")
EVERYWHERE = "everywhere"
WHOLE_PROGRAM = ("2.3", "2.4", "2.5", "5.6", "5.7", "5.8", "5.9", "8.5", "8.6", "8.7")  # no verdict from one file at a time


class Deviations:
    """The list: of each rule where it is deviated from."""

    def __init__(self, path):
        self.path, self.places, self.lines, self.errors, self.used = path, {}, {}, [], set()
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            entry = ENTRY.match(line)
            if entry:
                self.add(number, entry[1], entry[2])

    def add(self, number, rule, where):
        places = re.findall(r"`([^`]+)`", where) or ([EVERYWHERE] if where.strip() == EVERYWHERE else [])
        if rule in self.places:
            self.errors.append(f"{self.path.name}:{number}: rule {rule} is listed twice")
        if not places:
            self.errors.append(f"{self.path.name}:{number}: rule {rule}: where? `FILE`, `FILE`, or the word {EVERYWHERE}")
        self.places[rule], self.lines[rule] = places, number

    def covers(self, rule, file):
        for place in self.places.get(rule, []):
            if place in (EVERYWHERE, file):
                self.used.add((rule, place))
                return True
        return False

    def stale(self):
        return [f"{self.path.name}:{self.lines[rule]}: rule {rule}: nothing is found any more{'' if place == EVERYWHERE else f' in {place}'}"
                for rule, places in self.places.items() for place in places if (rule, place) not in self.used]


def core_files():
    return [path for path in sorted((TOP / "src").rglob("*.c")) if rooms.is_core(path.relative_to(TOP))]


def check(file):
    """What cppcheck prints of one file; in a copy, because the addon leaves files beside the sources."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("src", "include"):
            shutil.copytree(TOP / name, Path(folder) / name)
        run = subprocess.run([*CPPCHECK, str(file)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace", check=False)
        return run.returncode, run.stdout.splitlines()


def findings_of(files, jobs):
    """(rules' findings as (rule, file, line), other lines that cppcheck printed), each once however often a header was read."""
    found, other = set(), []
    with ThreadPoolExecutor(jobs) as pool:
        for file, (status, lines) in zip(files, pool.map(check, files)):
            if status != 0:
                other.append(f"{file}: cppcheck ends with {status}")
            for line in lines:
                finding = FINDING.match(line)
                if not finding or BROKEN.fullmatch(finding[3]):
                    other += [line] if line.strip() else []
                elif finding[3] not in WHOLE_PROGRAM:
                    found.add((finding[3], finding[1], int(finding[2])))
    return sorted(found, key=lambda row: ([int(part) for part in re.findall(r"\d+", row[0])], row)), sorted(set(other))


def source_line(file, line):
    try:
        return (TOP / file).read_text(encoding="utf-8").splitlines()[line - 1].strip()
    except (OSError, IndexError):
        return ""


def judge(listed, found, is_whole):
    """(what is wrong, in lines; how often each rule was found)."""
    wrong, counts = list(listed.errors), {}
    for rule, file, line in found:
        counts[rule] = counts.get(rule, 0) + 1
        if not listed.covers(rule, file):
            wrong.append(f"{file}:{line}: rule {rule} is not listed: {source_line(file, line)}")
    return wrong + (listed.stale() if is_whole else []), counts


def main():
    parser = argparse.ArgumentParser(prog="tools/misra")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("file", type=Path, nargs="*")
    options = parser.parse_args()
    listed = Deviations(LIST)
    files = [path.relative_to(TOP) for path in options.file or core_files()]
    found, other = findings_of(files, options.jobs)
    wrong, counts = judge(listed, found, not options.file)
    if options.all:
        print(*[f"{file}:{line}: rule {rule}: {source_line(file, line)}" for rule, file, line in found], sep="\n")
    for rule, count in counts.items():
        print(f"{rule:<24}{count:>6}")
    print(*other, *wrong, sep="\n")
    print(f"{len(files)} files, {sum(counts.values())} deviations from {len(counts)} rules, {len(wrong)} not as listed, {len(other)} other findings")
    return 1 if wrong or other else 0


if __name__ == "__main__":
    sys.exit(main())
