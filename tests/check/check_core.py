#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_core.py - the project's rules that no compiler enforces, as test cases (TAP).

    check_core.py [--root DIR] core --lib LIB [--cc CC] [--nm NM] [--instrumented]
        what the core library is made of: no heap, no floating point, no OS, no state of its own
    check_core.py [--root DIR] includes   who may include whom; no floating point in the text of the core
    check_core.py [--root DIR] runners    every test function is run, every test file is built
    check_core.py [--root DIR] format     clang-format has nothing to change
    check_core.py [--root DIR] lint --build DIR   clang-tidy has nothing to say; DIR holds compile_commands.json

"Core" is include/ and the rooms of src/ that are not a program's (tools/lib/rooms.py). --instrumented: the library carries sanitizers, so its symbols say nothing.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import tap

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lib"))
import rooms  # noqa: E402  the path above has to be set first

CLANG_FORMAT = "clang-format-14"  # another version formats differently
CLANG_TIDY = "clang-tidy-14"      # another version has other checks
TIDY_KEPT_S = 30 * 86400

HEAP = re.compile(r"_*(malloc|calloc|realloc|reallocarray|free|alloca|aligned_alloc|posix_memalign|memalign|strdup|strndup|sbrk|mmap)$")
SOFT_FLOAT = re.compile(r"__(aeabi_[df]|(add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|unord|cmp|fix|fixuns|float|floatun|extend|trunc|pow)\w*[sdtx]f)")
# What a C compiler may call on its own even when freestanding, and what distributions' compilers weave in (stack protector, _FORTIFY_SOURCE).
ALLOWED_SYMBOLS = {"memcpy", "memset", "memmove", "memcmp", "hv_assert_failed", "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail",
                   "__memcpy_chk", "__memset_chk", "__memmove_chk"}
WRITABLE_SECTION = re.compile(r"(\.data|\.bss|\.tdata|\.tbss|\*COM\*|COMMON)(?!\.rel\.ro)")

CORE_HEADERS = {"stdbool.h", "stddef.h", "stdint.h", "limits.h", "string.h"}  # string.h: for memcpy and its kin; nm shows any other use
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)
FLOAT_TOKEN = re.compile(r"\b(float|double|_Complex|_Imaginary|float_t|double_t)\b|(?<![\w.])(\d+\.\d*|\.\d+|\d+[eE][+-]?\d+)")
COMMENT_OR_TEXT = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'', re.DOTALL)

TEST_FUNCTION = re.compile(r"^(?:static +)?void +(test_\w+) *\( *(?:void)? *\)\s*\{", re.MULTILINE)
RUN_TEST = re.compile(r"\bRUN_TEST *\( *(\w+)")


def without_comments(text, keep_texts=False):
    """The code alone, with line numbers as they were."""
    def blank(match):
        found = match[0]
        if keep_texts and found[0] in "\"'":
            return found
        return " " + "\n" * found.count("\n")
    return COMMENT_OR_TEXT.sub(blank, text)


def c_files(root, *folders):
    return [path for folder in folders for path in sorted((root / folder).rglob("*.[ch]"))]


def core_files(root):
    return [path for path in c_files(root, "include", "src") if not rooms.is_program(path.relative_to(root))]


def includes_of(path):
    """(line, "<" or '"', name) of each include."""
    text = without_comments(path.read_text(encoding="utf-8"), keep_texts=True)
    return [(text.count("\n", 0, match.start(1)) + 1, match[1], match[2]) for match in INCLUDE.finditer(text)]


def none_of(offenders, what):
    assert not offenders, what + ":\n" + "\n".join(offenders)


def output_of(command):
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(map(str, command))}\n{run.stdout}"
    return run.stdout


# --- core: the built library ---------------------------------------------------------------------------------------------

def read_symbols(nm, library):
    """(undefined names, names in writable sections, number of defined names), from nm's table form: its letters hide the section's name."""
    undefined, writable, defined = set(), [], set()
    for line in output_of([nm, "--format=sysv", library]).splitlines():
        fields = [field.strip() for field in line.split("|")]
        if len(fields) != 7:
            continue
        name, kind, section = fields[0], fields[2], fields[6]
        if kind in "Uw":
            undefined.add(name)
        elif name and not name.startswith("."):
            defined.add(name)
            if WRITABLE_SECTION.match(section):
                writable.append(f"{name} in {section}")
    return undefined - defined, writable, len(defined)


def compile_each(root, compiler, paths, *options):
    for path in paths:
        output_of([compiler, "-std=c99", "-pedantic", "-O1", "-I", root / "include", "-I", root / "src", "-w", *options, path])


def check_core(suite, root, args):
    undefined, writable, defined = (set(), [], 0) if args.instrumented else read_symbols(args.nm, args.lib)

    def symbols_case(name, check):
        with suite.case(name):
            if args.instrumented:
                raise tap.Skip("the sanitizers' own symbols are in the library")
            check()

    def has_content():
        assert defined, f"{args.lib} defines nothing"

    others = {name for name in undefined if not HEAP.match(name) and not SOFT_FLOAT.match(name)} - ALLOWED_SYMBOLS
    symbols_case("the core library has content", has_content)
    symbols_case("the core allocates nothing", lambda: none_of(sorted(filter(HEAP.match, undefined)), "heap functions"))
    symbols_case("the core calls no floating-point helper", lambda: none_of(sorted(filter(SOFT_FLOAT.match, undefined)), "helpers"))
    symbols_case("the core calls neither OS nor C library", lambda: none_of(sorted(others), "foreign symbols"))
    symbols_case("the core keeps no state of its own", lambda: none_of(writable, "writable variables at file scope"))
    with suite.case("the core needs integer registers only"):
        if not re.match(r"(x86_64|aarch64)", output_of([args.cc, "-dumpmachine"])):
            raise tap.Skip("the compiler has no such option for this CPU")
        sources = [path for path in core_files(root) if path.suffix == ".c"]
        assert sources, "no source found"
        compile_each(root, args.cc, sources, "-mgeneral-regs-only", "-c", "-o", os.devnull)
    with suite.case("each public header compiles alone"):
        compile_each(root, args.cc, c_files(root, "include"), "-x", "c", "-fsyntax-only")


# --- includes: who may know whom -------------------------------------------------------------------------------------------

def foreign_includes(root, paths, is_allowed):
    return [f"{path.relative_to(root)}:{line}: {name}"
            for path in paths for line, kind, name in includes_of(path) if not is_allowed(path, kind, name)]


def float_uses(root, paths):
    uses = []
    for path in paths:
        for number, line in enumerate(without_comments(path.read_text(encoding="utf-8")).split("\n"), 1):
            found = FLOAT_TOKEN.search(line)
            if found:
                uses.append(f"{path.relative_to(root)}:{number}: {found[0]}")
    return uses


def is_inside(folder, path, name):
    """Whether an include in `path` names a file in `folder`: beside it, or from the folder's top."""
    targets = [(path.parent / name).resolve(), (folder / name).resolve()]
    return any(target.is_file() and folder.resolve() in target.parents for target in targets)


def is_contract(root, name):
    return name.startswith("heave/") and (root / "include" / name).is_file()


def check_includes(suite, root, _args):
    core = core_files(root)

    def allowed_in_core(path, kind, name):
        if kind == "<":
            return name in CORE_HEADERS
        return is_contract(root, name) or is_inside(root / "src", path, name)

    def allowed_in_contract(_path, kind, name):
        return name in CORE_HEADERS if kind == "<" else is_contract(root, name)

    def allowed_in_hal(path, kind, name):
        return kind == "<" or is_contract(root, name) or is_inside(root / "hal", path, name)

    with suite.case("the core includes contracts and freestanding headers only"):
        assert core, "no source found"
        none_of(foreign_includes(root, core, allowed_in_core), "not allowed")
    with suite.case("the contracts include nothing but each other"):
        none_of(foreign_includes(root, c_files(root, "include"), allowed_in_contract), "not allowed")
    with suite.case("hal/ includes nothing of src/"):
        none_of(foreign_includes(root, c_files(root, "hal"), allowed_in_hal), "neither a contract nor in hal/")
    with suite.case("the text of the core holds no floating point"):
        none_of(float_uses(root, core), "floating point")


# --- runners: no test is forgotten ---------------------------------------------------------------------------------------------

def check_runners(suite, root, _args):
    files = [path for path in c_files(root, "tests") if path.name.startswith("test_") and path.suffix == ".c"]
    for path in files:
        with suite.case(f"{path.relative_to(root)} runs all it defines"):
            text = without_comments(path.read_text(encoding="utf-8"))
            defined, run = TEST_FUNCTION.findall(text), RUN_TEST.findall(text)
            assert defined, "defines no test"
            none_of(sorted(set(defined) - set(run)), "defined but not in RUN_TEST")
            none_of(sorted({name for name in run if run.count(name) > 1}), "run twice")
    with suite.case("each test file is built"):
        assert files, "no test file found"
        lists = "\n".join(path.read_text(encoding="utf-8") for path in (root / "tests").rglob("CMakeLists.txt"))
        lists = re.sub(r"#.*", "", lists)
        none_of([str(path.relative_to(root)) for path in files
                 if not re.search(rf"\b(test_)?{re.escape(path.stem.removeprefix('test_'))}\b", lists)], "in no CMakeLists.txt")


# --- format ----------------------------------------------------------------------------------------------------------------------

def check_format(suite, root, _args):
    with suite.case(f"{CLANG_FORMAT} has nothing to change"):
        if not shutil.which(CLANG_FORMAT):
            raise tap.Skip(f"{CLANG_FORMAT} is not installed")
        files = [path.relative_to(root) for path in c_files(root, "include", "src", "hal", "tests", "tools")]
        assert files, "no source found"
        run = subprocess.run([CLANG_FORMAT, "--dry-run", *files], cwd=root, stderr=subprocess.PIPE, text=True, check=True)
        none_of(sorted(set(re.findall(r"^(\S+?):\d+:\d+: warning", run.stderr, re.MULTILINE))), f"run {CLANG_FORMAT} -i on")


# --- lint ------------------------------------------------------------------------------------------------------------------------

def tidy_key(root, version, commands):
    """Of all that clang-tidy looks at: the file with what it includes and their comments, the options, its own; wherever the tree is."""
    key = hashlib.sha256(version + (root / ".clang-tidy").read_bytes())
    for command in commands:
        words = shlex.split(command["command"])
        words[words.index("-o") + 1] = "/dev/stdout"
        words[words.index("-c")] = "-E"
        run = subprocess.run([*words, "-C"], cwd=command["directory"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True)
        key.update(" ".join(words[1:]).encode().replace(bytes(root), b"") + run.stdout.replace(bytes(root), b""))
    return key.hexdigest()


def lint_findings(root, build, path, clean):
    """clean: a file that says that nothing was found before."""
    if clean.exists():
        clean.touch()
        return []
    found = tidy_findings(root, build, path)
    if not found:
        clean.parent.mkdir(parents=True, exist_ok=True)
        clean.touch()
    return found


def forget_old(folder):
    for path in folder.glob("*"):
        if time.time() - path.stat().st_mtime > TIDY_KEPT_S:
            path.unlink(missing_ok=True)


def tidy_findings(root, build, path):
    run = subprocess.run([CLANG_TIDY, "-p", build, "--quiet", path], cwd=root, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
    found = [line.removeprefix(f"{root}/") for line in run.stdout.splitlines() if re.search(r": (warning|error): ", line)]
    return found or ([f"{os.path.relpath(path, root)}: {CLANG_TIDY} ends with {run.returncode}"] if run.returncode else [])


def check_lint(suite, root, args):
    check_sleeps(suite, root)
    with suite.case(f"{CLANG_TIDY} has nothing to say"):
        if not shutil.which(CLANG_TIDY):
            raise tap.Skip(f"{CLANG_TIDY} is not installed")
        commands = json.loads((args.build / "compile_commands.json").read_text(encoding="utf-8"))
        of_path = {}  # once: with all its commands
        for command in commands:
            if re.match(r"(src|hal)/", os.path.relpath(command["file"], root)):
                of_path.setdefault(command["file"], []).append(command)
        assert of_path, "no source found"
        version = subprocess.run([CLANG_TIDY, "--version"], stdout=subprocess.PIPE, check=True).stdout
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "heave/tidy"
        forget_old(folder)
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            findings = pool.map(lambda path: lint_findings(root, args.build, path, folder / tidy_key(root, version, of_path[path])), sorted(of_path))
        none_of(sorted({line for found in findings for line in found}), "findings")


# What real time passes in: each is a sleep and then a look, which a busy machine makes wrong. These are left; the numbers only shrink.
SLEEPS = {"system/harness.py": 2, "system/test_flood.py": 2, "system/test_kernel.py": 1, "system/test_metrics.py": 1, "system/test_modbus_drives.py": 1,
          "system/test_modbus_line.py": 3, "system/test_panel_pages.py": 18, "system/test_panel_commission.py": 9, "system/test_panel_configuration.py": 4,
          "system/test_panel_hands.py": 10, "system/test_syscalls.py": 6, "system/rt_guest.py": 1, "python/test_heave.py": 1, "python/test_lab.py": 1, "python/test_samples.py": 4, "lib/forked.py": 1,
          "lib/web_socket.py": 2, "peers/modbus_peer.py": 5}
VIRTUAL = re.compile(r"heave_(?:exact|kernel)_test\(\S+ .*?(test_\w+\.py)")  # sleeps take no time there, and end exactly
SLEEP, BARE = re.compile(r"\bsleep\("), re.compile(r"\b(?:took|passed|elapsed|needed)\w*_s\)? *<=? *[0-9.]+\b")


def check_sleeps(suite, root):
    tests = root / "tests"
    virtual = {"person.py", "plain_master.py", "twin_bench.py"}  # what the scripts below share
    virtual |= {name for path in tests.rglob("CMakeLists.txt") for name in VIRTUAL.findall(path.read_text(encoding="utf-8"))}
    texts = {str(path.relative_to(tests)): path.read_text(encoding="utf-8") for path in sorted(tests.rglob("*.py")) if path.name not in virtual and path != Path(__file__).resolve()}
    with suite.case("tests in real time wait for causes, not for time"):
        counts = {name: len(SLEEP.findall(text)) for name, text in texts.items() if name in SLEEPS or SLEEP.search(text)}
        none_of([f"{name}: {count} sleeps, {SLEEPS.get(name, 0)} are allowed: wait for what has to happen (harness.wait_for); or it runs on virtual time (heave_exact_test)"
                 for name, count in counts.items() if count > SLEEPS.get(name, 0)], "more sleeps")
        none_of([f"{name}: {counts.get(name, 0)} sleeps are left: put that number into SLEEPS of {Path(__file__).name}" for name, count in SLEEPS.items() if counts.get(name, 0) < count], "fewer sleeps")
    with suite.case("tests in real time compare no duration with a number alone"):
        none_of([f"{name}: {found}: a busy machine takes longer" for name, text in texts.items() for found in BARE.findall(text)], "bare durations")


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2])
    checks = parser.add_subparsers(dest="check", required=True)
    core = checks.add_parser("core")
    core.add_argument("--lib", required=True)
    core.add_argument("--cc", default="cc")
    core.add_argument("--nm", default="nm")
    core.add_argument("--instrumented", action="store_true")
    lint = checks.add_parser("lint")
    lint.add_argument("--build", type=Path, required=True)
    for name in ("includes", "runners", "format"):
        checks.add_parser(name)
    return parser.parse_args()


def main():
    args = parse_arguments()
    suite = tap.Suite()
    {"core": check_core, "includes": check_includes, "runners": check_runners, "format": check_format, "lint": check_lint}[args.check](
        suite, args.root, args)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
