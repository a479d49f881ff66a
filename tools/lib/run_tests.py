#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_tests.py - runs ctest and counts every single case, not just every executable.

usage: run_tests.py BUILD_DIR [REGEX]

Two kinds of output are understood: Unity's ("file:12:test_name:PASS", "3 Tests 0 Failures 0 Ignored") and TAP
("ok 1 - name", "not ok 2 - name", "ok 3 - name # SKIP reason", "1..3"). Anything else counts as one case.
Nothing may pass by silence: a test that fails, crashes, stops before its summary or runs no case is a failed case.
A comment "# figure N TEXT" says how much was tried: figures with the same text are added up over all tests and printed above the last line.
Output: one line per test, below a failing one what it printed (except its passing cases), then the skipped and the failed cases, then "N passed, N failed, N skipped".
Exit status 0 only if something passed and nothing failed.
"""
import os
import re
import subprocess
import sys

TEST_LIMIT_S = 900
WEIGHTS, MORE = 3, 2  # for each processor, and in all: see cmake/unity.cmake

CTEST_OUTPUT = re.compile(r"^(\d+): ?(.*)$")
CTEST_RESULT = re.compile(r"^\s*\d+/\d+ Test +#(\d+): (.+?) \.*\s*(.*?)\s+([\d.]+) sec\s*$")
UNITY_CASE = re.compile(r"([^\s:][^:]*:\d+):([^:]+):(PASS|FAIL|IGNORE)(?:: ?(.*))?$")
UNITY_SUMMARY = re.compile(r"^(\d+) Tests (\d+) Failures (\d+) Ignored\s*$")
TAP_CASE = re.compile(r"^(not )?ok\b *\d* *(?:- *)?(.*?)(?: *# *(SKIP)\b *(.*))?$", re.IGNORECASE)
FIGURE = re.compile(r"^# figure (\d+) (.+)$")
TAP_PLAN = re.compile(r"^1\.\.(\d+)(?: *# *(.*))?$")


class Result:
    """What one test came to: numbers, and a line for each case that did not pass."""

    def __init__(self):
        self.passed = 0
        self.failures = []
        self.skips = []
        self.figures = {}

    def count_figures(self, lines):
        for number, text in (match.groups() for match in map(FIGURE.match, lines) if match):
            self.figures[text] = self.figures.get(text, 0) + int(number)

    def count_unity(self, lines):
        summaries = [match for match in map(UNITY_SUMMARY.match, lines) if match]
        for where, name, verdict, message in (m.groups() for m in map(UNITY_CASE.search, lines) if m):
            if verdict == "PASS":
                self.passed += 1
            else:
                (self.skips if verdict == "IGNORE" else self.failures).append(f"{name} ({where}): {message or 'no reason given'}")
        announced = sum(int(match[1]) for match in summaries)
        if not summaries:
            self.failures.append("ended before Unity's summary")
        elif announced != self.cases():
            self.failures.append(f"Unity's summary says {announced} cases, {self.cases()} were printed")

    def count_tap(self, lines):
        plan = None
        for line in lines:
            planned, case = TAP_PLAN.match(line), TAP_CASE.match(line)
            if planned:
                plan = int(planned[1])
                if plan == 0:
                    self.skips.append(planned[2] or "the whole script")
            elif line.startswith("Bail out!"):
                self.failures.append(line)
            elif case:
                self.count_tap_case(*case.groups())
        if plan is None:
            self.failures.append("ended before the TAP plan")
        elif plan and plan != self.cases():
            self.failures.append(f"the TAP plan says {plan} cases, {self.cases()} were printed")

    def count_tap_case(self, failed, name, directive, reason):
        if failed:
            self.failures.append(name)
        elif directive:
            self.skips.append(f"{name}: {reason or 'no reason given'}")
        else:
            self.passed += 1

    def cases(self):
        return self.passed + len(self.failures) + len(self.skips)


def judge(lines, verdict):
    """The result of one test from what it printed and from what ctest says of it."""
    result = Result()
    result.count_figures(lines)
    if any(UNITY_SUMMARY.match(line) for line in lines):
        result.count_unity(lines)
    elif any(TAP_PLAN.match(line) or TAP_CASE.match(line) for line in lines):
        result.count_tap(lines)
    elif any(UNITY_CASE.search(line) for line in lines):
        result.count_unity(lines)
    elif verdict == "Passed":
        result.passed = 1
    if "Skipped" in verdict and not result.cases():
        result.skips.append("skipped as a whole")
    elif verdict != "Passed" and not result.failures and "Skipped" not in verdict:
        result.failures.append(f"ctest says {verdict.strip('*') or 'failed'}")
    if not result.cases():
        result.failures.append("ran no case")
    return result


def after_preamble(lines):
    """What the test itself printed: ctest's own lines before it end with the time limit, their number differs between versions."""
    ends = [index for index, line in enumerate(lines) if line.startswith("Test timeout computed to be:")]
    return lines[ends[0] + 1:] if ends else lines


def show(name, result, seconds, lines):
    counts = f"{result.passed} passed"
    counts += f", {len(result.failures)} failed" if result.failures else ""
    counts += f", {len(result.skips)} skipped" if result.skips else ""
    print(f"{name:<36} {counts:<32} {seconds:>8} s", flush=True)
    if result.failures:
        print("\n".join(f"    {line}" for line in lines if not line.startswith("ok ") and not line.endswith(":PASS")), flush=True)


def run_ctest(build_dir, regex):
    """Yields (name, result) for each finished test, and one more that failed if ctest itself went wrong."""
    command = ["ctest", "--test-dir", build_dir, "-V", "-j", str(WEIGHTS * (os.cpu_count() or 1) + MORE), "--timeout", str(TEST_LIMIT_S)]
    command += ["-R", regex] if regex else []
    ctest = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    printed, other, any_failed = {}, [], False
    for line in ctest.stdout:
        output, finished = CTEST_OUTPUT.match(line), CTEST_RESULT.match(line)
        if output:
            printed.setdefault(output[1], []).append(output[2])
        elif finished:
            number, name, verdict, seconds = finished.groups()
            lines = after_preamble(printed.pop(number, []))
            result = judge(lines, verdict)
            any_failed |= verdict != "Passed"
            show(name, result, seconds, lines)
            yield name, result
        else:
            other.append(line)
    if ctest.wait() != 0 and not any_failed:
        print("".join(other))
        yield "ctest", judge([], f"exit status {ctest.returncode}")


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    results = list(run_ctest(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else None))
    for title, kind in (("Skipped:", "skips"), ("Failed:", "failures")):
        cases = [f"  {name}: {case}" for name, result in results for case in getattr(result, kind)]
        if cases:
            print(title, *cases, sep="\n")
    figures = {}
    for text, number in (figure for _, result in results for figure in result.figures.items()):
        figures[text] = figures.get(text, 0) + number
    for text, number in figures.items():
        print(f"{number:,} {text}")
    passed = sum(result.passed for _, result in results)
    failed = sum(len(result.failures) for _, result in results)
    if passed + failed == 0:
        print("No test ran.")
    print(f"{passed} passed, {failed} failed, {sum(len(result.skips) for _, result in results)} skipped")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
