# SPDX-License-Identifier: MIT
"""bench_peers.py - the subcommand peers of tools/bench: Heave's parts beside what one would use instead, from tests/bench/bench_peers.c.

Candidates take turns within one process; what counts is the ratio of each round, of which the median is told with its quartiles. Where the
quartiles are too far apart, or others took too much of the CPU, there is no figure."""
import json
import os
import platform
import shutil
import statistics
import sys
import time

from bench_cost import CostError, instructions_of, output_of, processor

# name in bench_peers: (runs per turn, of a signal all of it, runs under callgrind, what it is, [(peer, ratio aimed at)])
SUBJECTS = {
    "parse-document": (512, 4096, "a frame of the vendor's document read", {"sscanf": 7, "from_chars": 1.3}),
    "parse-3": (512, 4096, "a frame A6 with three decimals read", {"sscanf": 8, "from_chars": 1.6}),
    "parse-6": (512, 4096, "a frame A7 with six decimals read", {}),
    "inverse": (512, 4096, "inverse kinematics of a hexapod", {"double": 1 / 1.5}),
    "forward-warm": (128, 1024, "forward kinematics, from 0.5 mm and 0.05 deg beside", {}),
    "forward-cold": (128, 1024, "forward kinematics, from pose zero", {}),
    "stream": (10000, 2000, "a stream rebuilt and limited, 7 axes, one cycle", {"ruckig": 80}),
    "platforms": (50, 1000, "a cycle of each of so many platforms in one process, all streaming", {}),
}
PLATFORMS = "platforms"
CYCLES = 64  # of a run, whatever the number of platforms
CYCLE_NS = 1_000_000
GOAL_CYCLE_NS = 5000
SPREAD_MAX = 0.15  # of the ratios: quartile to quartile, against their median
STOLEN_MAX = 0.05  # of the time of all CPUs
CHANGE_MIN = 0.01  # of instructions, which compilers and libraries change a little


class PeersError(Exception):
    """What keeps the figures from being compared."""


def stolen_ticks():
    """(ticks that the hypervisor took, all ticks) since the start of the machine; zeros where the kernel does not tell."""
    try:
        with open("/proc/stat", encoding="ascii") as file:
            fields = [int(word) for word in file.readline().split()[1:9]]
    except (OSError, ValueError):
        return 0, 0
    return (fields[7], sum(fields)) if len(fields) == 8 else (0, 0)


def stolen_share(before, after):
    total = after[1] - before[1]
    return (after[0] - before[0]) / total if total > 0 else 0.0


def quartiles(values):
    low, middle, high = statistics.quantiles(values, n=4, method="inclusive")
    return {"q25": low, "median": middle, "q75": high}


def spread(row):
    """How far the quartiles are apart, against the median."""
    return (row["q75"] - row["q25"]) / row["median"]


def doubt(row, stolen):
    """Why a figure does not count; None where it does."""
    reasons = []
    if spread(row) > SPREAD_MAX:
        reasons.append(f"quartiles {spread(row):.0%} apart")
    if stolen > STOLEN_MAX:
        reasons.append(f"{stolen:.0%} of the CPU stolen")
    return f"spread too wide ({', '.join(reasons)})" if reasons else None


def read_rounds(text, candidates):
    """Of bench_peers' output: what is off, and for each candidate the ns of each round."""
    off, rounds = {}, []
    for line in text.splitlines():
        words = line.split()
        if words[0] == "off":
            off[words[1]] = {"off": int(words[2]), "of": int(words[3])}
        else:
            rounds.append([float(word) for word in words])
    if len(rounds) < 2 or any(len(row) != len(candidates) for row in rounds):
        raise CostError("bench_peers printed no figures that fit its candidates")
    return off, dict(zip(candidates, zip(*rounds)))


def judge(candidates, off, times):
    """Figures of one subject: each candidate's time, and its ratio to the first one, round by round."""
    first = times[candidates[0]]
    return {name: {"ns": quartiles(times[name]), "ratio": quartiles([other / own for other, own in zip(times[name], first)]), **off.get(name, {})}
            for name in candidates}


def measured(program, name, candidates, rounds, with_instructions):
    runs, counted = SUBJECTS[name][:2]
    before = stolen_ticks()
    off, times = read_rounds(output_of(program, name, runs, rounds), candidates)
    row = {"stolen": stolen_share(before, stolen_ticks()), "candidates": judge(candidates, off, times)}
    for candidate in candidates:
        row["candidates"][candidate]["instructions"] = instructions_of(program, name, counted, candidate) if with_instructions else None
    return row


def against_goal(ratio, goal):
    return "" if goal is None else f"; goal {goal:.3g}: {'met' if ratio >= goal else 'missed'}"


def peer_line(name, own, peer, stolen, goal):
    """The ratio first."""
    ir = "" if not own["instructions"] else f", {peer['instructions'] / own['instructions']:.2f} x the instructions"
    off = f"; {peer['off']} of {peer['of']} {'cycles given up' if name == 'ruckig' else 'values not the nearest'}" if peer.get("off") else ""
    why = doubt(peer["ratio"], stolen)
    if why:
        return f"    {why}: no figure for {name}{ir}{off}"
    ratio = peer["ratio"]
    return (f"    {ratio['median']:6.2f} x ({ratio['q25']:.2f} to {ratio['q75']:.2f})  {name}: {peer['ns']['median']:.0f} ns{ir}"
            f"{against_goal(ratio['median'], goal)}{off}")


def subject_lines(name, row):
    candidates = row["candidates"]
    own_name, *peers = candidates
    own = candidates[own_name]
    ir = "" if not own["instructions"] else f", {own['instructions']:.0f} instructions"
    goals = SUBJECTS[name][3]
    return [f"{SUBJECTS[name][2]}: {own['ns']['median']:.0f} ns ({own['ns']['q25']:.0f} to {own['ns']['q75']:.0f}){ir}",
            *(peer_line(peer, own, candidates[peer], row["stolen"], goals.get(peer)) for peer in peers)]


def platform_line(name, candidate, stolen):
    """The ratio first: what each of so many takes against one that is alone. A time beside a goal has to be as steady."""
    count = int(name.removeprefix("of-"))
    why = doubt(candidate["ratio"], stolen)
    if why:
        return f"    {count:2}: {why}: no figure"
    ratio, ns = candidate["ratio"], {key: value / CYCLES for key, value in candidate["ns"].items()}
    is_judged = count == 1 and doubt(ns, stolen) is None
    goal = f"; goal below {GOAL_CYCLE_NS} ns: {'met' if ns['median'] < GOAL_CYCLE_NS else 'missed'}" if is_judged else ""
    return f"    {count:2}: {ratio['median']:.2f} x ({ratio['q25']:.2f} to {ratio['q75']:.2f}), {ns['median']:.0f} ns each ({ns['q25']:.0f} to {ns['q75']:.0f}){goal}"


def platform_lines(row):
    lines = [f"{SUBJECTS[PLATFORMS][2]}:", *(platform_line(name, candidate, row["stolen"]) for name, candidate in row["candidates"].items())]
    *_, last = row["candidates"].values()
    if doubt(last["ratio"], row["stolen"]) is None:
        most, least = (CYCLE_NS * CYCLES / last["ns"][quartile] for quartile in ("q25", "q75"))
        lines.append(f"    {least:.0f} to {most:.0f} fit in 1 ms on one core, by what each of {[*row['candidates']][-1].removeprefix('of-')} takes")
    return lines


def candidate_change(old, new, stolen):
    """(text, whether it counts) of one candidate's ratio to Heave, before and now."""
    if doubt(new["ratio"], stolen[1]) or doubt(old["ratio"], stolen[0]):
        return "spread too wide to compare", False
    change = new["ratio"]["median"] / old["ratio"]["median"]
    is_beyond = new["ratio"]["q25"] > old["ratio"]["q75"] or new["ratio"]["q75"] < old["ratio"]["q25"]
    text = f"{old['ratio']['median']:.2f} x before, {new['ratio']['median']:.2f} x now ({change - 1:+.0%}, {'beyond' if is_beyond else 'within'} the spread)"
    return text, is_beyond


def instructions_change(old, new):
    if not old["instructions"] or not new["instructions"]:
        return None
    change = new["instructions"] / old["instructions"] - 1
    return f"{old['instructions']:.0f} instructions before, {new['instructions']:.0f} now ({change:+.1%})" if abs(change) >= CHANGE_MIN else "as many instructions"


def comparison(old, new):
    """Lines: what has changed against an older result."""
    lines = [f"against {old['date']}, {old['processor']}:"]
    for name, row in new["subjects"].items():
        before = old["subjects"].get(name)
        if not before:
            lines.append(f"{name}: not in the older result")
            continue
        own_name, *peers = row["candidates"]
        own = instructions_change(before["candidates"].get(own_name, {"instructions": None}), row["candidates"][own_name])
        lines.append(f"{name}: {own or 'no instructions to compare'}")
        for peer in peers:
            if peer in before["candidates"]:
                text = candidate_change(before["candidates"][peer], row["candidates"][peer], (before["stolen"], row["stolen"]))[0]
                lines.append(f"    {peer}: {text}")
            else:
                lines.append(f"    {peer}: not in the older result")
    return lines


def read_older(path):
    try:
        with open(path, encoding="utf-8") as file:
            older = json.load(file)
        for row in older["subjects"].values():
            for candidate in row["candidates"].values():
                doubt(candidate["ratio"], row["stolen"])
        return older
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise PeersError(f"{path}: no result of tools/bench peers --json ({type(error).__name__}: {error})") from error


def listed(program):
    """Subjects and candidates that the program has."""
    return {words[0]: words[1:] for words in (line.split() for line in output_of(program).splitlines())}


def tell_missing(subjects, has_valgrind, say):
    if not has_valgrind:
        say("no instruction counts: valgrind is not installed (apt-get install valgrind)")
    if "from_chars" not in subjects.get("parse-3", ()):
        say("without std::from_chars and Ruckig: no C++ compiler when this was built (apt-get install g++)")
    elif "ruckig" not in subjects.get("stream", ()):
        say("without Ruckig: its source was not there when this was built")


def run(program, rounds, only, older_path, as_json, say, out=sys.stdout):
    older = read_older(older_path) if older_path else None
    has_valgrind = shutil.which("valgrind") is not None
    subjects = listed(program)
    tell_missing(subjects, has_valgrind, say)
    result = {"date": time.strftime("%Y-%m-%d %H:%M"), "processor": processor(), "machine": platform.platform(), "load": os.getloadavg()[0], "rounds": rounds,
              "subjects": {}}
    if not as_json:
        print(f"{result['processor']}, load {result['load']:.1f}, {rounds} rounds in turn. How many times Heave's time others take: median of the rounds "
              "(quartiles); CPU time of one thread", file=out)
    for name, candidates in subjects.items():
        if only and name not in only:
            continue
        row = measured(program, name, candidates, rounds, has_valgrind and name != PLATFORMS)
        result["subjects"][name] = row
        if not as_json:
            print("\n".join(platform_lines(row) if name == PLATFORMS else subject_lines(name, row)), file=out, flush=True)
    if as_json:
        json.dump({**result, **({"comparison": comparison(older, result)} if older else {})}, out, indent=1)
        print(file=out)
    elif older:
        print("\n" + "\n".join(comparison(older, result)), file=out)
