#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_tools.py - the tools that count and check are themselves able to fail: each is given something wrong and has to say so."""
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
CHECKER = TOP / "tests/check/check_core.py"
sys.path.insert(0, str(TOP / "tools/lib"))
import run_tests  # noqa: E402  the path above has to be set first
import shake  # noqa: E402

# what a test printed, what ctest says of it, and the (passed, failed, skipped) that must come out
COUNTED = {
    "Unity: all pass": (["a/test_x.c:9:test_one:PASS", "a/test_x.c:12:test_two:PASS", "", "2 Tests 0 Failures 0 Ignored ", "OK"], "Passed", (2, 0, 0)),
    "Unity: one fails, one ignored": (["x.c:9:test_a:FAIL: Expected 1 Was 2", "x.c:5:test_b:IGNORE: no vcan", "x.c:6:test_c:PASS",
                                       "3 Tests 1 Failures 1 Ignored ", "FAIL"], "***Failed", (1, 1, 1)),
    "Unity: failures although ctest passed": (["x.c:9:test_a:FAIL: no", "1 Tests 1 Failures 0 Ignored"], "Passed", (0, 1, 0)),
    "Unity: no case": (["0 Tests 0 Failures 0 Ignored", "OK"], "Passed", (0, 1, 0)),
    "Unity: crash half way": (["x.c:9:test_a:PASS"], "***Exception: SegFault", (1, 1, 0)),
    "Unity: exit 0 half way": (["x.c:9:test_a:PASS"], "Passed", (1, 1, 0)),
    "Unity: crash after the summary": (["x.c:9:test_a:PASS", "1 Tests 0 Failures 0 Ignored"], "Subprocess aborted***Exception:", (1, 1, 0)),
    "Unity: a case that printed no verdict": (["x.c:9:test_a:PASS", "2 Tests 0 Failures 0 Ignored"], "Passed", (1, 1, 0)),
    "TAP: all pass": (["ok 1 - one", "ok 2 - two", "1..2"], "Passed", (2, 0, 0)),
    "TAP: one fails, one skipped": (["1..3", "ok 1 - one", "not ok 2 - two", "# why", "ok 3 - three # SKIP no vcan"], "***Failed", (1, 1, 1)),
    "TAP: a skipped script": (["1..0 # SKIP no vcan"], "Passed", (0, 0, 1)),
    "TAP: no plan": (["ok 1 - one"], "Passed", (1, 1, 0)),
    "TAP: fewer cases than planned": (["1..3", "ok 1 - one"], "Passed", (1, 1, 0)),
    "TAP: Unity's output quoted in a comment": (["# x.c:9:test_a:FAIL: no", "ok 1 - one", "1..1"], "Passed", (1, 0, 0)),
    "plain: no case": (["hello"], "Passed", (0, 1, 0)),
    "TAP: passed beside a sanitizer's report": (["ok 1 - one", "==1==ERROR: AddressSanitizer: heap-use-after-free", "1..1"], "Passed", (1, 1, 0)),
    "plain: failed": (["hello"], "***Failed", (0, 1, 0)),
    "plain: took too long": ([], "***Timeout", (0, 1, 0)),
    "plain: not built": ([], "***Not Run", (0, 1, 0)),
    "plain: skipped by ctest": ([], "***Skipped", (0, 0, 1)),
}

# a file with something wrong, the check that has to find it, and the case that fails
WRONG = {
    "an OS header in the core": ("src/a/a.c", "#include <unistd.h>\n", "includes", "freestanding headers"),
    "the core reaches into hal/": ("src/a/a.c", '#include "../../hal/sim/sim.h"\n', "includes", "freestanding headers"),
    "a contract reaches into src/": ("include/heave/a.h", '#include "../../src/a/a.h"\n', "includes", "nothing but each other"),
    "hal/ reaches into src/": ("hal/sim/x.c", '#include "../../src/a/a.h"\n', "includes", "hal/ includes nothing"),
    "a double in the core": ("src/a/a.c", "int a(void) { return (int)(double)1; }\n", "includes", "no floating point"),
    "a float constant in the core": ("src/a/a.c", "int a(void) { return 1.5 > 1; }\n", "includes", "no floating point"),
    "a test that is not run": ("tests/unit/test_a.c", "void test_a(void)\n{\n}\n", "runners", "runs all it defines"),
    "a test run only in a comment": ("tests/unit/test_a.c", "void test_a(void)\n{\n}\n/* RUN_TEST(test_a); */\n", "runners", "runs all it defines"),
    "a test file that is not built": ("tests/unit/test_b.c", "void test_b(void) {}\nint x = RUN_TEST(test_b);\n", "runners", "is built"),
    "memory from the heap": ("src/a/a.c", "void *malloc(unsigned long);\nvoid *a(void) { return malloc(9); }\n", "core", "allocates nothing"),
    "a call of the C library": ("src/a/a.c", "int puts(const char *);\nint a(void) { return puts(\"a\"); }\n", "core", "neither OS nor C library"),
    "a variable at file scope": ("src/a/a.c", "int a(void) { static int n; return n++; }\n", "core", "no state"),
    "an initialised variable": ("src/a/a.c", "int counter = 3;\n", "core", "no state"),
    "arithmetic in floating point": ("src/a/a.c", "int a(int x) { return (int)(x * 1.5); }\n", "core", "integer registers"),
    "a header that needs another first": ("include/heave/a.h", "uint32_t a(void);\n", "core", "compiles alone"),
}

# Nothing wrong: comments, texts, constant tables with pointers.
FINE = {
    "include/heave/b.h": "#include <stdint.h>\nint b(int x); /* 1.5 double */\n",
    "src/a/a.h": "int a(void);\n",
    "src/a/b.c": '#include "heave/b.h"\n#include "a.h"\nstatic const char *const k_names[] = {"1.5", "float"};\n'
                 "int b(int x) { return k_names[x & 1][0]; }\n",
    "src/daemon/main.c": "#include <stdio.h>\ndouble unused;\n",
    "hal/sim/sim.h": "#include <math.h>\n",
    "tests/unit/CMakeLists.txt": "heave_unit_test(a)\n",
    "tests/unit/test_a.c": "void test_fine(void)\n{\n}\nint main(void) { RUN_TEST(test_fine); }\n",
}


def run_checker(root, check):
    """The names of the cases that failed."""
    command = [sys.executable, CHECKER, "--root", root, check]
    if check == "core":
        objects = []
        for source in sorted((root / "src/a").glob("*.c")):
            objects.append(source.with_suffix(".o"))
            subprocess.run(["cc", "-fPIC", "-w", "-I", root / "include", "-c", "-o", objects[-1], source], check=True)
        subprocess.run(["ar", "rc", root / "core.a", *objects], check=True)
        command += ["--lib", root / "core.a"]
    run = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    failed = [line for line in run.stdout.splitlines() if line.startswith("not ok")]
    assert bool(failed) == (run.returncode != 0), run.stdout
    assert "1.." in run.stdout, run.stdout
    return failed


def failed_with(extra, check):
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, text in {**FINE, **extra}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        return run_checker(root, check)


def left_out_of_memory():
    """Unit tests in front of those of the programs, but for those that config files are read in, by a library."""
    chosen = re.search(r"memory- \] \|\| filter='(.*)'$", (TOP / "tools/test").read_text(encoding="utf-8"), re.MULTILINE)[1]
    text = (TOP / "tests/unit/CMakeLists.txt").read_text(encoding="utf-8").partition("# the programs' own parts")[0]
    names = re.findall(r"^heave_unit_test\((\w+)", text, re.MULTILINE)
    names += [name for group in re.findall(r"^foreach\(name (.*)\)\n  heave_unit_test", text, re.MULTILINE) for name in group.split()]
    assert len(names) > 30, names
    return [name for name in names if not name.startswith(("config", "hal_")) and not re.search(chosen, f"unit.{name}")]


# name, whether it is a clock test, what the n-th run prints before it fails (None: it passes), how often it runs, and (passed, failed)
TRIED = [
    ("late_once", True, ["not ok 1 - late", None], 2, (1, 0)),
    ("late_twice", True, ["not ok 1 - late", "not ok 1 - late", None], 3, (1, 0)),
    ("late_always", True, ["not ok 1 - late"] * 4, 3, (0, 1)),
    ("exact_once", False, ["not ok 1 - wrong", None], 1, (0, 1)),
    ("limit_once", True, ["not ok 1 - a\n# FAULT left a limit", None], 1, (0, 1)),
    ("sanitizer_once", True, ["==1==ERROR: AddressSanitizer: heap-use-after-free", None], 1, (0, 1)),
    ("undefined_once", True, ["a.c:1:2: runtime error: signed integer overflow", None], 1, (0, 1)),
    ("assertion_once", True, ["heaved: a.c:1: f: Assertion `x > 0' failed.", None], 1, (0, 1)),
    ("crash_once", True, ["SEGV", None], 1, (0, 1)),
    ("crash_told_once", True, ["not ok 1 - the program ended with -11", None], 1, (0, 1)),
    ("skipped_when_tried_again", True, ["not ok 1 - late"] + 2 * ["ok 1 - fine # SKIP busy"], 3, (0, 1)),
    ("fault_when_tried_again", True, ["not ok 1 - late", "not ok 1 - a\n# FAULT left a limit", None], 2, (0, 1)),
    ("good", True, [None, None], 1, (1, 0)),
]
TRIED_SCRIPT = """
import os, pathlib, signal, sys
name, runs = sys.argv[1], eval(sys.argv[2])
with open("runs", "a") as file:
    file.write(name + chr(10))
text = runs[pathlib.Path("runs").read_text().split().count(name) - 1]
if text == "SEGV":
    os.kill(os.getpid(), signal.SIGSEGV)
has_passed = text is None or text.startswith(("ok", "#"))
print("ok 1 - fine" if text is None else text)
print("1..1")
sys.exit(not has_passed)
"""


def run_tried(folder, *options, tests=None):
    """(exit status, output, {name: how often it ran}, in which order) of run_tests.py on a build that has these tests."""
    source, build = Path(folder), Path(folder) / "build"
    (source / "tried.py").write_text(TRIED_SCRIPT, encoding="utf-8")
    declared = "".join(f'add_test(NAME {name} COMMAND {sys.executable} {source}/tried.py {name} [==[{runs}]==])\n' + (f"set_property(TEST {name} APPEND PROPERTY LABELS clock)\n" if is_clock else "")
                       for name, is_clock, runs, *_ in tests or TRIED)
    (source / "CMakeLists.txt").write_text(f"cmake_minimum_required(VERSION 3.16)\nproject(tried NONE)\nenable_testing()\n{declared}", encoding="utf-8")
    subprocess.run(["cmake", "-S", source, "-B", build], stdout=subprocess.DEVNULL, check=True)
    run = subprocess.run([sys.executable, TOP / "tools/lib/run_tests.py", build, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return run.returncode, run.stdout, (build / "runs").read_text(encoding="utf-8").split()


def tries_again_what_the_clock_explains():
    with tempfile.TemporaryDirectory() as folder:
        code, text, order = run_tried(folder)
    for name, _, _, runs, _ in TRIED:
        assert order.count(name) == runs, f"{name} ran {order.count(name)} times, must be {runs}:\n{text}"
    assert len(set(order[:len(TRIED)])) == len(TRIED), f"tried again before all had run: {order}"
    passed, failed = (sum(counts[i] for *_, counts in TRIED) for i in (0, 1))
    assert code == 1 and text.splitlines()[-1] == f"{passed} passed, {failed} failed, 0 skipped", text
    again = text.partition("Passed when tried again:\n")[2].partition("Failed:\n")[0].splitlines()
    assert [line.strip() for line in again] == ["late_once: late", "not ok 1 - late", "1..1", "late_twice: late", "not ok 1 - late", "1..1"], text
    with tempfile.TemporaryDirectory() as folder:
        code, text, order = run_tried(folder, "^(late_once|late_twice|good)$")
    assert code == 0 and text.splitlines()[-1] == "3 passed, 0 failed, 0 skipped", text


def tries_again_without_other_runs():
    """Runs that go on side by side share a file: a test here fails as long as others may run, and passes once none does."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder)
        (source / "alone.sh").write_text(f"if flock -n -s {folder}/beside true; then echo 'not ok 1 - alone'; else echo 'ok 1 - alone'; fi; echo 1..1\n", encoding="ascii")
        (source / "CMakeLists.txt").write_text("cmake_minimum_required(VERSION 3.16)\nproject(tried NONE)\nenable_testing()\n"
                                               f"add_test(NAME alone COMMAND sh {source}/alone.sh)\nset_property(TEST alone PROPERTY LABELS clock)\n", encoding="utf-8")
        subprocess.run(["cmake", "-S", source, "-B", source / "build"], stdout=subprocess.DEVNULL, check=True)
        run = subprocess.run([sys.executable, TOP / "tools/lib/run_tests.py", source / "build"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
                             env={**os.environ, "HEAVE_TESTS_BESIDE": str(source / "beside")})
    assert run.stdout.splitlines()[-1] == "1 passed, 0 failed, 0 skipped" and "  alone: alone\n" in run.stdout, run.stdout


def runs_exact_tests_twice():
    """What an exact test prints is the same each time, but for names of temporary files; clock tests do not run."""
    tests = [("dies", False, [None, "SEGV"], 2, (1, 1)), ("same", False, [f"ok 1 - x in /tmp/heave-{name}" for name in ("abcd1234", "dcba4321")], 2, (1, 0)),
             ("another", False, ["ok 1 - x\n# figure 5 mm", "ok 1 - x\n# figure 6 mm"], 2, (1, 1)), ("clock", True, [None, None], 0, (0, 0))]
    with tempfile.TemporaryDirectory() as folder:
        code, text, order = run_tried(folder, "--same", tests=tests)
    assert sorted(order) == ["another", "another", "dies", "dies", "same", "same"], order
    assert "dies: in a second run: " in text, text
    assert code == 1 and "another: prints something else in a second run: '# figure 5 mm', then '# figure 6 mm'" in text and "same: prints" not in text, text
    assert text.splitlines()[-1] == "3 passed, 3 failed, 0 skipped", text


def shakes():
    """Clock tests alone, beside processes that are gone afterwards; whatever fails once has failed."""
    with tempfile.TemporaryDirectory() as folder:
        code, text, order = run_tried(folder, "--shake", "2", "once|good")
    assert sorted(order) == sorted(2 * [name for name, is_clock, *_ in TRIED if is_clock and re.search("once|good", name)]), order
    assert code == 1 and re.search(r"^  late_once +failed in 1 of 2$", text, re.MULTILINE) and re.search(r"^  good +failed in 0 of 2$", text, re.MULTILINE), text
    assert text.splitlines()[-1] == f"{len(order) - 7} passed, 7 failed, 0 skipped", text
    assert "4 busy processes" in text, text
    with shake.shaken():
        assert busy_children() == shake.BUSY
    assert busy_children() == 0


def busy_children():
    run = subprocess.run(["ps", "--ppid", str(os.getpid()), "-o", "args"], stdout=subprocess.PIPE, text=True, check=True)
    return run.stdout.count("tools/lib/shake.py compute")


def main():
    suite = tap.Suite()
    with suite.case("a clock test that fails is tried again alone, and nothing else is"):
        tries_again_what_the_clock_explains()
    with suite.case("a test is tried again once no other run goes on"):
        tries_again_without_other_runs()
    with suite.case("--same runs exact tests twice, and finds what prints something else"):
        runs_exact_tests_twice()
    with suite.case("--shake runs clock tests beside a shaken machine, and counts what fails"):
        shakes()
    with suite.case("tools/test --sanitize=memory runs every unit test of the core"):
        assert not left_out_of_memory(), left_out_of_memory()
    for name, (lines, verdict, expected) in COUNTED.items():
        with suite.case(f"counting, {name}"):
            result = run_tests.judge(lines, verdict)
            got = (result.passed, len(result.failures), len(result.skips))
            assert got == expected, f"counted {got}, must be {expected}: {result.failures}"
    with suite.case("counting, what has no plan is one case"):
        assert run_tests.judge(["hello"], "Passed", is_plain=True).passed == 1
    with suite.case("counting, what is missing has failed"):
        results = {}
        run_tests.not_run(results, {"gone"})
        assert results["gone"].failures == ["ctest says it did not run"], results["gone"].failures
    with suite.case("counting, figures of the same name are added up"):
        result = run_tests.judge(["# figure 5 cycles", "ok 1 - a", "# figure 7 cycles", "# figure 1 seed", "1..1"], "Passed")
        assert (result.figures, result.passed) == ({"cycles": 12, "seed": 1}, 1), result.figures
    with suite.case("counting, ctest's own lines are no output of the test"):
        assert run_tests.after_preamble(["Test command: /t", "Working Directory: /", "Test timeout computed to be: 9", "ok 1 - a"]) == ["ok 1 - a"]
        assert run_tests.after_preamble(["Test command: /t", "Test timeout computed to be: 9", "ok 1 - a"]) == ["ok 1 - a"]
    for check in ("core", "includes", "runners"):
        with suite.case(f"checking, {check}: a tree with nothing wrong passes"):
            assert not failed_with({}, check), failed_with({}, check)
    for name, (path, text, check, case) in WRONG.items():
        with suite.case(f"checking, {name} is found"):
            failed = failed_with({path: text}, check)
            assert any(case in line for line in failed), f"failed were only {failed}"
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
