#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""run_tests.py - runs ctest and counts every single case, not just every executable.

usage: run_tests.py BUILD_DIR [REGEX]
       run_tests.py BUILD_DIR --shake N [REGEX]    the clock tests N times beside a shaken machine, and how often which failed
       run_tests.py BUILD_DIR --same [REGEX]       the exact tests twice, beside busy processes and without: whether they print the same

A test with the label "clock" (heave_clock in cmake/unity.cmake) needs real time, which a busy machine may not give it. If one fails, it is tried again
when all others have ended and nothing else runs, at most twice. What passes then counts as passed, and "Passed when tried again:" names it with what it
printed first. An exact test is never tried again, and no test is whose failure no clock explains: a crash, a sanitizer's report, an assertion of the
product, tap.Fault.

Where HEAVE_TESTS_BESIDE names a file, other runs may go on at the same time, and name the same file: a test is tried again once all of them are that far.

An exact test prints the same in each run. Where all tests run, a tenth of the exact ones, those that take long left out, run a second time at the end, and
fail where they print something else; --same does so with all of them.

Two kinds of output are understood: Unity's ("file:12:test_name:PASS", "3 Tests 0 Failures 0 Ignored") and TAP
("ok 1 - name", "not ok 2 - name", "ok 3 - name # SKIP reason", "1..3"). Anything else counts as one case.
Nothing may pass by silence: a test that fails, crashes, stops before its summary or runs no case is a failed case.
A comment "# figure N TEXT" says how much was tried: figures with the same text are added up over all tests and printed above the last line.
Output: one line per test, below a failing one what it printed (except its passing cases), then the skipped and the failed cases, then "N passed, N failed, N skipped".
Exit status 0 only if something passed and nothing failed.
"""
import contextlib
import fcntl
import hashlib
import itertools
import json
import os
import re
import subprocess
import sys

import shake

TEST_LIMIT_S = 1800  # says that it never ends, not that it was slow
TESTS_FAILED = 8  # ctest's exit status
TRIES = 2  # more, of a clock test that failed
SLOWEST = 10
TENTH_S = 20  # tests that take longer have their second run in --same only
WEIGHTS, MORE = 3, 2  # for each processor, and in all: see cmake/unity.cmake

CTEST_OUTPUT = re.compile(r"^(\d+): ?(.*)$")
CTEST_RESULT = re.compile(r"^\s*\d+/\d+ Test +#(\d+): (.+?) \.*\s*(.*?)\s+([\d.]+) sec\s*$")
UNITY_CASE = re.compile(r"([^\s:][^:]*:\d+):([^:]+):(PASS|FAIL|IGNORE)(?:: ?(.*))?$")
UNITY_SUMMARY = re.compile(r"^(\d+) Tests (\d+) Failures (\d+) Ignored\s*$")
TAP_CASE = re.compile(r"^(not )?ok\b *\d* *(?:- *)?(.*?)(?: *# *(SKIP)\b *(.*))?$", re.IGNORECASE)
FIGURE = re.compile(r"^# figure (\d+) (.+)$")
TAP_PLAN = re.compile(r"^1\.\.(\d+)(?: *# *(.*))?$")
# What no clock explains, wherever a test prints it; ctest calls a crash of its own child an exception.
SANITIZER = re.compile(r"\b\w+Sanitizer: |: runtime error: ")
FAULT = re.compile(rf"^# FAULT |{SANITIZER.pattern}|: Assertion `.*' failed|\*\*\* stack smashing|buffer overflow detected|\bdumped core\b|\bSIG(SEGV|ABRT|BUS|ILL|FPE)\b"
                   r"|\b(free|malloc|realloc)\(\): |double free|the kernel stopped before|\b(exit(ed)?|exit (code|status)|ended with|returncode=) ?-(4|6|7|8|11)\b")
CRASH = "Exception"
BESIDE = os.environ.pop("HEAVE_TESTS_BESIDE", None)  # not for the runs that tests make
# What is another in each run of any test: names of temporary files, the virtual time at the end (tests/lib/tap.py), which one read of the clock changes.
ANY_NAME, ANY_LINE = re.compile(r"/tmp/[\w.-]+|\bheave-[\w-]*[a-z0-9_]{8}\b"), re.compile(r"^# \d+ ns$")


class Result:
    """What one test came to: numbers, and a line for each case that did not pass."""

    def __init__(self):
        self.passed = 0
        self.failures = []
        self.skips = []
        self.figures = {}
        self.is_fault = False  # it failed by what no clock explains
        self.seconds = 0.0
        self.printed = []  # but for the cases that passed
        self.said = []  # all that has to be the same in each run of an exact test

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


def judge(lines, verdict, is_plain=False):
    """The result of one test from what it printed and from what ctest says of it. is_plain: it prints no cases, and counts as one."""
    result = Result()
    result.count_figures(lines)
    result.is_fault = CRASH in verdict or any(map(FAULT.search, lines))
    result.said = [ANY_NAME.sub("(a name)", line) for line in lines if not ANY_LINE.match(line)]
    result.printed = [line for line in lines if not line.startswith("ok ") and not line.endswith(":PASS")]
    if any(UNITY_SUMMARY.match(line) for line in lines):
        result.count_unity(lines)
    elif any(TAP_PLAN.match(line) or TAP_CASE.match(line) for line in lines):
        result.count_tap(lines)
    elif any(UNITY_CASE.search(line) for line in lines):
        result.count_unity(lines)
    elif verdict == "Passed" and is_plain:
        result.passed = 1
    if "Skipped" in verdict and not result.cases():
        result.skips.append("skipped as a whole")
    elif verdict != "Passed" and not result.failures and "Skipped" not in verdict:
        result.failures.append(f"ctest says {verdict.strip('*') or 'failed'}")
    if not result.failures and any(map(SANITIZER.search, lines)):
        result.failures.append("a sanitizer's report")
    if not result.cases():
        result.failures.append("ran no case")
    return result


def after_preamble(lines):
    """What the test itself printed: ctest's own lines before it end with the time limit, their number differs between versions."""
    ends = [index for index, line in enumerate(lines) if line.startswith("Test timeout computed to be:")]
    return lines[ends[0] + 1:] if ends else lines


def indented(lines):
    return "\n".join(f"    {line}" for line in lines)


def show(name, result, note=""):
    counts = f"{result.passed} passed"
    counts += f", {len(result.failures)} failed" if result.failures else ""
    counts += f", {len(result.skips)} skipped" if result.skips else ""
    print(f"{name:<36} {counts:<32} {result.seconds:>8.2f} s{note}", flush=True)
    if result.failures:
        print(indented(result.printed), flush=True)


def all_tests(build_dir, regex=None):
    """{name: its labels}"""
    listed = subprocess.run(["ctest", "--test-dir", build_dir, "--show-only=json-v1", *(["-R", regex] if regex else [])], stdout=subprocess.PIPE, text=True, check=True).stdout
    return {test["name"]: next((label["value"] for label in test.get("properties", []) if label["name"] == "LABELS"), []) for test in json.loads(listed)["tests"]}


def clock_tests(build_dir):
    """The names of the tests that were declared as such."""
    return {name for name, labels in all_tests(build_dir).items() if "clock" in labels}


def run_ctest(build_dir, regex, jobs, note=""):
    """Yields (name, result) for each test that has finished."""
    command = ["ctest", "--test-dir", build_dir, "-V", "-j", str(jobs), "--timeout", str(TEST_LIMIT_S)]
    command += ["-R", regex] if regex else []
    ctest = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace")
    printed, other = {}, []
    for line in ctest.stdout:
        output, finished = CTEST_OUTPUT.match(line), CTEST_RESULT.match(line)
        if output:
            printed.setdefault(output[1], []).append(output[2])
        elif finished:
            number, name, verdict, seconds = finished.groups()
            result = judge(after_preamble(printed.pop(number, [])), verdict)
            result.seconds = float(seconds)
            show(name, result, note)
            yield name, result
        else:
            other.append(line)
    if ctest.wait() not in (0, TESTS_FAILED):
        print("".join(other))


def only(names):
    return f"^({'|'.join(map(re.escape, sorted(names)))})$"


def all_jobs():
    return WEIGHTS * (os.cpu_count() or 1) + MORE


@contextlib.contextmanager
def turn(kind):
    """LOCK_SH: beside other runs; LOCK_EX: alone."""
    with open(BESIDE, "ab") if BESIDE else contextlib.nullcontext() as file:
        if file:
            fcntl.flock(file, kind)
        yield


def run_alone(build_dir, name, note):
    with turn(fcntl.LOCK_EX):
        return list(run_ctest(build_dir, only([name]), 1, note))


def try_again(build_dir, results, clock):
    """Replaces what passes when it runs alone. Returns {name: how it failed first}."""
    first = {name: result for name, result in results.items() if name in clock and result.failures and not result.is_fault}
    passed = {}
    for attempt in range(TRIES):
        for name in sorted(first.keys() - passed.keys()):
            for _, result in run_alone(build_dir, name, f"   tried again, {attempt + 1} of {TRIES}"):
                if result.is_fault:
                    results[name] = result
                elif not result.failures and result.passed and len(result.skips) <= len(first[name].skips):
                    results[name], passed[name] = result, first[name]
        first = {name: result for name, result in first.items() if not results[name].is_fault}
    return passed


def not_run(results, names):
    """Each of these that is missing has failed."""
    for name in sorted(names - results.keys()):
        results[name] = judge([], "it did not run")


def differences(before, after):
    """Adds a failure to each test that had passed and whose second run has failed, is missing, or has printed something else."""
    not_run(after, before.keys())
    for name, first in before.items():
        pairs = itertools.zip_longest(first.said, after[name].said, fillvalue="nothing more")
        unlike = next(((a, b) for a, b in pairs if a != b), None)
        if first.failures:
            continue
        if unlike is not None:
            first.failures.append(f"prints something else in a second run: {unlike[0]!r}, then {unlike[1]!r}")
        first.failures += [f"in a second run: {case}" for case in after[name].failures]


def second_runs(build_dir, results, clock):
    """Of a tenth of the exact tests that have passed."""
    names = [name for name, result in results.items() if name not in clock and not result.failures and result.passed and result.seconds < TENTH_S
             and hashlib.sha256(name.encode()).digest()[0] % 10 == 0]
    if names:
        differences({name: results[name] for name in names}, dict(run_ctest(build_dir, only(names), all_jobs(), "   a second time")))


def print_cases(title, results, kind):
    cases = [f"  {name}: {case}" for name, result in results.items() for case in getattr(result, kind)]
    if cases:
        print(title, *cases, sep="\n")


def print_slowest(results):
    total = sum(result.seconds for result in results.values())
    slowest = sorted(results.items(), key=lambda item: -item[1].seconds)[:SLOWEST]
    print(f"Slowest, of {total:.0f} s that all tests took one by one:")
    for name, result in slowest:
        print(f"  {name:<36} {result.seconds:>8.0f} s  {100 * result.seconds / max(total, 1e-9):>4.0f} %")


def print_figures(results):
    figures = {}
    for text, number in (figure for result in results.values() for figure in result.figures.items()):
        figures[text] = figures.get(text, 0) + number
    for text, number in figures.items():
        print(f"{number:,} {text}")


def run_all(build_dir, regex):
    clock = clock_tests(build_dir)
    with turn(fcntl.LOCK_SH):
        results = dict(run_ctest(build_dir, regex, all_jobs()))
        not_run(results, all_tests(build_dir, regex).keys())
        if regex is None:
            second_runs(build_dir, results, clock)
    passed_again = try_again(build_dir, results, clock)
    if len(results) > SLOWEST:
        print_slowest(results)
    if passed_again:
        print("Passed when tried again:")
        for name, first in passed_again.items():
            print(f"  {name}: {'; '.join(first.failures)}", indented(first.printed), sep="\n")
    return sum_up(results)


def sum_up(results):
    print_cases("Skipped:", results, "skips")
    print_cases("Failed:", results, "failures")
    print_figures(results)
    passed, failed = sum(result.passed for result in results.values()), sum(len(result.failures) for result in results.values())
    if passed + failed == 0:
        print("No test ran.")
    print(f"{passed} passed, {failed} failed, {sum(len(result.skips) for result in results.values())} skipped")
    return 0 if passed and not failed else 1


def run_same(build_dir, regex):
    clock = clock_tests(build_dir)
    names = {name for name in all_tests(build_dir) if name not in clock and (not regex or re.search(regex, name))}
    with shake.busy() as what:
        print(f"Beside {what}:", flush=True)
        results = dict(run_ctest(build_dir, only(names), all_jobs())) if names else {}
    not_run(results, names)
    differences(results, dict(run_ctest(build_dir, only(names), all_jobs(), "   a second time")) if names else {})
    return sum_up(results)


def run_shaken(build_dir, regex, rounds):
    """Each clock test so often; a run counts as failed if it fails where the gate would have tried it again, too."""
    names = sorted(name for name in clock_tests(build_dir) if not regex or re.search(regex, name))
    passed, failed, skipped, how_often = 0, 0, 0, {name: 0 for name in names}
    with shake.shaken() as what:
        print(f"Shaken: {what}", flush=True)
        for i in range(rounds):
            for name, result in run_ctest(build_dir, only(names), all_jobs(), f"   round {i + 1} of {rounds}") if names else ():
                how_often[name] = how_often.get(name, 0) + bool(result.failures)
                failed, passed, skipped = failed + bool(result.failures), passed + bool(result.passed and not result.failures), skipped + bool(result.skips)
    for name, count in how_often.items():
        print(f"  {name:<36} failed in {count} of {rounds}")
    print(f"{passed} passed, {failed} failed, {skipped} skipped")
    return 0 if passed and not failed else 1


def main():
    arguments = sys.argv[1:]
    rounds, is_same = None, "--same" in arguments[1:2]
    if "--shake" in arguments[1:2]:
        rounds = int(arguments[2])
        del arguments[1:3]
    if is_same:
        del arguments[1]
    if len(arguments) not in (1, 2):
        sys.exit(__doc__)
    build_dir, regex = arguments[0], arguments[1] if len(arguments) == 2 else None
    if is_same:
        return run_same(build_dir, regex)
    return run_all(build_dir, regex) if rounds is None else run_shaken(build_dir, regex, rounds)


if __name__ == "__main__":
    sys.exit(main())
