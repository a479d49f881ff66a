#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""proof_run.py - runs Frama-C on the entry points in tests/proof, and says what it has proved; see tools/proof.

tests/proof/unproved.txt: "PATH FUNCTION: the property", and below it, indented, why it holds nevertheless. Blank lines and lines with # are skipped.
Exit status: 0 everything is proved but for that list, 1 it is not, or the list is wrong, 2 wrong option.
"""
import argparse
import csv
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import coverage_report

TOP = Path(__file__).resolve().parents[2]
UNPROVED = TOP / "tests/proof/unproved.txt"
# The processor and the compiler are gcc's on x86-64, without what Frama-C has no idea of: 128-bit integers and built-in functions.
# The core has portable code for compilers that lack them, with the same results bit by bit.
COMMON = ["-machdep", "gcc_x86_64", "-cpp-extra-args=-Iinclude -Isrc/protocol -Isrc/canopen -Isrc/drives -Itests/proof -U__SIZEOF_INT128__ -U__GNUC__",
          "-kernel-warn-key", "annot:missing-spec=abort"]
EVA = ["-eva", "-eva-msg-key=-initial-state,-final-states", "-eva-domains", "cvalue,equality,symbolic-locations", "-eva-ilevel", "24",
       "-eva-split-limit", "256"]
PROVED = {"Valid", "Considered valid", "Dead"}
INSTANCE = re.compile(r"_\d+$")  # of a static function in more than one file
GOALS = re.compile(r"^\[wp\] Proved goals: +(\d+) / (\d+)", re.MULTILINE)
STATEMENTS = re.compile(r"^ +(\w+?)(?:_\d+)?: (\d+) stmts out of (\d+) ")
LIMIT_S = 1800  # says that it never ends, not that it was slow


class Target:
    """One run of Eva: an entry point and the sources it is about. `by_contract`: functions that are not gone through but taken by their contracts."""

    def __init__(self, name, what, driver, sources, by_contract="", slevel=100, unroll=64):
        self.name, self.what, self.driver, self.sources = name, what, driver, sources.split()
        self.by_contract, self.slevel, self.unroll = by_contract, slevel, unroll

    def command(self, folder):
        table = folder / f"{self.name}.csv"
        table.unlink(missing_ok=True)
        contract = ["-eva-use-spec", self.by_contract] if self.by_contract else []
        return ["frama-c", *COMMON, *EVA, "-eva-slevel", str(self.slevel), "-eva-auto-loop-unroll", str(self.unroll), *contract,
                "-main", f"proof_{self.name}", f"tests/proof/{self.driver}.c", *self.sources,
                "-then", "-report-csv", str(table), "-then", "-metrics", "-metrics-eva-cover"]


class Contracts(Target):
    """One run of WP: these functions do what their contracts say, and nothing overflows."""

    def __init__(self, name, what, source, functions):
        super().__init__(name, what, "", source)
        self.functions = functions.split()

    def command(self, folder):
        table = folder / f"{self.name}.csv"
        table.unlink(missing_ok=True)
        return ["frama-c", *COMMON, "-wp", "-wp-rte", "-wp-fct", ",".join(self.functions), "-wp-prover", "z3,cvc4", "-wp-timeout", "60", "-wp-par", "1",
                "-wp-cache", "none", *self.sources, "-then", "-report-csv", str(table)]


PARSER = "src/protocol/frame.c src/protocol/frame_command.c src/protocol/frame_quick.c src/protocol/frame_reject.c src/protocol/number.c"
WORDS = "src/protocol/frame.c src/protocol/frame_command.c src/protocol/frame_reject.c src/protocol/frame_text.c src/protocol/text.c"
FIXED = "src/fixed/fx.c src/fixed/fx_root.c src/fixed/fx_trig.c"
DRIVERS = ("src/canopen/cia402_axis.c", "src/canopen/cia402_map.c", "src/canopen/cia402_pdo", "src/drives/canraw", "src/drives/modbus")  # of these, the codecs alone
TARGETS = [
    Target("scanner", "frames, byte by byte", "parser", PARSER),
    Target("quick", "a plain frame", "parser", PARSER),
    Target("next", "a datagram", "parser", PARSER, "frame_quick,frame_scanner_feed,frame_scanner_end"),
    Target("number", "a number", "parser", PARSER),
    Target("words", "a reject in words", "parser", WORDS, "text_put,text_put_char,text_put_u32,text_put_hex"),
    Target("text", "lines of text", "parser", WORDS + " src/fixed/fx.c", unroll=16),
    Contracts("sums", "sums and limits do as fx.h says", "src/fixed/fx.c", "fx_add_sat fx_sub_sat fx_clamp fx_abs q32_from_q16 q32_from_int"),
    Target("rounding", "shifts, rounding, limits", "fixed", FIXED),
    Target("wide", "wide products", "fixed", FIXED),
    Target("mul_div", "products with a quotient", "fixed", FIXED),
    Target("roots", "square roots", "fixed", FIXED),
    Target("angles", "sines and cosines", "fixed", FIXED, "fx_mul_high,fx_mul_high_0,fx_mul_high_1,fx_mul_high_2,fx_mul_high_here,fx_mul_high_here_0,fx_mul_high_here_1,fx_mul_high_here_2"),
    Target("counts", "counts and units", "fixed", "src/drives/counts.c", "fx_mul_div"),
    Target("sdo", "SDO answers", "codecs", "src/canopen/sdo.c"),
    Target("pdo", "PDOs and emergencies", "codecs", "src/canopen/cia402_pdo.c src/canopen/cia402_pdo_rows.c src/canopen/cia402_map.c src/canopen/cia402_axis.c src/drives/counts.c src/fixed/fx.c", "fx_mul_div,fx_add_sat"),
    Target("canraw", "frames of raw CAN drives", "codecs", "src/drives/canraw_frame.c src/drives/canraw_float.c"),
    Target("modbus", "registers of Modbus drives", "codecs", "src/drives/modbus_drive_map.c"),
]


PROVED_BY_WP = {function for target in TARGETS if isinstance(target, Contracts) for function in target.functions}


class Proof:
    """What Frama-C says of a target."""

    def __init__(self, target):
        self.target, self.trouble, self.open, self.goals = target, "", [], 0
        self.functions, self.is_wp = {}, isinstance(target, Contracts)

    def read_table(self, path):
        with path.open(encoding="utf-8", newline="") as table:
            for row in csv.DictReader(table, delimiter="\t", quoting=csv.QUOTE_NONE):
                row["function"] = INSTANCE.sub("", row["function"])
                is_for_wp = row["property kind"].startswith("postcondition") and row["function"] in PROVED_BY_WP and not self.is_wp
                if row["directory"].startswith(("src", "include", "tests")) and not is_for_wp:
                    self.goals += row["status"] == "Valid"
                    if row["status"] not in PROVED:
                        self.open.append((f"{row['directory']}/{row['file']} {row['function']}", row["property"], row["line"]))

    def read_log(self, text):
        """Statements that Eva reached, or goals that WP has proved."""
        if self.is_wp:
            found = GOALS.search(text)
            self.goals, goals = (int(found[1]), int(found[2])) if found else (0, 0)
            self.functions = {function: (0, 0) for function in self.target.functions} if goals else {}
            if self.goals < goals and not self.open:
                self.trouble = f"{goals - self.goals} of {goals} goals are not proved"
        for line in text.splitlines():
            found = STATEMENTS.match(line)
            if found and found[1] not in self.target.by_contract.split(","):
                done, total = self.functions.get(found[1], (0, 0))
                self.functions[found[1]] = done + int(found[2]), total + int(found[3])


def functions_in(path):
    """Functions that a source defines: our style has their heads, and nothing else of them, in the first column."""
    text = (TOP / path).read_text(encoding="utf-8")
    return re.findall(r"^[a-zA-Z][^;{}=#]*?\b(\w+)\([^;{}]*\)\n\{", text, re.MULTILINE)


def left_out(proofs):
    """[(place, what)] of the functions that no target has reached, in the sources that the targets are about."""
    reached = {function for proof in proofs for function, counts in proof.functions.items() if counts[0] or proof.is_wp}
    sources = sorted({source for proof in proofs for source in proof.target.sources if not source.startswith(DRIVERS)})
    return [(f"{source} {function}", "not analysed") for source in sources for function in functions_in(source) if function not in reached]


def run(target, folder):
    proof, log = Proof(target), folder / f"{target.name}.log"
    try:
        with log.open("w", encoding="utf-8") as out:
            done = subprocess.run(target.command(folder), cwd=TOP, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                                  timeout=LIMIT_S, check=False, env={**os.environ, "WHY3CONFIG": str(folder / "why3.conf")})
    except subprocess.TimeoutExpired:
        proof.trouble = f"did not end within {LIMIT_S} s"
        return proof
    text = log.read_text(encoding="utf-8", errors="replace")
    if done.returncode != 0:
        errors = [line for line in text.splitlines() if "rror" in line]
        proof.trouble = f"frama-c: exit status {done.returncode}: {errors[0] if errors else 'see the log'}"
        return proof
    proof.read_table(folder / f"{target.name}.csv")
    proof.read_log(text)
    return proof


def show(proof, listed):
    """Prints a target; returns how many properties are neither proved nor listed."""
    name = f"{proof.target.name + ':':<12} {proof.target.what}"
    if proof.trouble:
        print(f"{name:<44}{proof.trouble}")
        return 1
    own = {function: counts for function, counts in proof.functions.items() if not function.startswith("proof_")}
    done, total = (sum(counts[i] for counts in own.values()) for i in (0, 1))
    alarms = [entry for entry in proof.open if not listed.has(entry[0], entry[1])]
    reached = f"{done:>8}/{total:<6}{100 * done / total:>6.1f} %" if total else f"{'':>23}"
    print(f"{name:<44}{len(own):>10}{reached}{len(proof.open):>9}{proof.goals:>9}", flush=True)
    for place, what, line in alarms:
        path, function = place.split()
        print(f"  {path}:{line}: {function}: not proved: {what}")
    if not own:
        print("  nothing was analysed")
    return len(alarms) + (not own)


def parse_arguments():
    parser = argparse.ArgumentParser(prog="tools/proof", usage="tools/proof [OPTION...] [TARGET...]", add_help=False, allow_abbrev=False)
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--build-dir", type=Path, default=TOP / "build/proof")
    options = parser.parse_args()
    names = [target.name for target in TARGETS]
    wrong = [name for name in options.targets if name not in names]
    if wrong:
        parser.error(f"no target {wrong[0]}; there are {', '.join(names)}")
    if options.jobs < 1:
        parser.error("--jobs takes a number of 1 or more")
    return options


def main():
    options = parse_arguments()
    folder = options.build_dir.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    listed = coverage_report.Exclusions(UNPROVED)
    targets = [target for target in TARGETS if not options.targets or target.name in options.targets]
    print(f"{'target':<44}{'functions':>10}{'statements':>13}{'reached':>9}{'open':>10}{'proved':>9}", flush=True)
    proofs, failures = [], 0
    with ThreadPoolExecutor(options.jobs) as pool:
        for proof in pool.map(lambda target: run(target, folder), targets):
            proofs.append(proof)
            failures += show(proof, listed)
    errors = listed.errors
    if not options.targets:
        errors += [f"{place}: {what}" for place, what in left_out(proofs) if not listed.has(place, what)]
        errors += [f"{UNPROVED.name}:{number}: {place}: is proved now or not there any more: {what}"
                   for (place, what), number in listed.entries.items() if (place, what) not in listed.used]
    for (place, what) in sorted(listed.used):
        print(f"listed as unproved: {place}: {what}")
    for error in errors:
        print(error)
    print(f"proof: {failures + len(errors)} not proved or wrong, {len(listed.used)} listed in {UNPROVED.relative_to(TOP)}; logs in {folder}")
    return 1 if failures or errors else 0


if __name__ == "__main__":
    sys.exit(main())
