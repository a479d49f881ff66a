#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_rooms.py [--root DIR] - the folders of src/ use each other in the directions that tools/lib/rooms.py names, and no file leads back to itself.

A file is an x.c with its x.h: the header beside it, or the public one, include/heave/x.h. What it uses are the headers that both include.
src/DESIGN.md has a row for each folder, which names the same directions.
"""
import argparse
import re
import sys
from pathlib import Path

import tap

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lib"))
import rooms  # noqa: E402  the path above has to be set first

USES = {**rooms.CORE, **rooms.PROGRAMS}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)
ROW = re.compile(r"^\| `src/(\w+)/` \|[^|]*\|([^|]*)\|$", re.MULTILINE)
HEAVIEST = 0.2  # of all lines


def units(root):
    """{(room, name): paths}: sources with their headers."""
    found = {}
    for path in sorted((root / "src").rglob("*.[ch]")):
        found.setdefault((path.parent.name, path.stem), []).append(path)
    for path in sorted((root / "include/heave").glob("*.h")):
        homes = [unit for unit in found if unit[1] == path.stem and unit[0] in rooms.CORE]
        if homes:
            found[homes[0]].append(path)
        else:
            found["include", path.stem] = [path]
    return found


def graph(root):
    """{unit: {unit: where it is included}}"""
    found = units(root)
    unit_of = {path.resolve(): unit for unit, paths in found.items() for path in paths}
    edges = {unit: {} for unit in found}
    for unit, paths in found.items():
        for path in paths:
            for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
                for target in (path.parent / name, root / "src" / name, root / "include" / name):
                    other = unit_of.get(target.resolve())
                    if other is not None:
                        if other != unit:
                            edges[unit].setdefault(other, f"{path.relative_to(root)} includes {name}")
                        break
    return edges


def circles(edges):
    """Each group of units that lead to each other (Tarjan's strongly connected components)."""
    index, low, stack, found = {}, {}, [], []

    def visit(unit):
        index[unit] = low[unit] = len(index)
        stack.append(unit)
        for other in edges[unit]:
            if other not in index:
                visit(other)
                low[unit] = min(low[unit], low[other])
            elif other in stack:
                low[unit] = min(low[unit], index[other])
        if low[unit] == index[unit]:
            group = stack[stack.index(unit):]
            del stack[stack.index(unit):]
            if len(group) > 1:
                found.append(sorted(group))

    sys.setrecursionlimit(10000)
    for unit in edges:
        if unit not in index:
            visit(unit)
    return found


def wrong_ways(edges):
    return [f"{where}: {unit[0]} may not use {other[0]}" for unit, others in edges.items() for other, where in others.items()
            if unit[0] != "include" and other[0] not in ("include", unit[0]) and other[0] not in USES.get(unit[0], ())
            and not (other[0] in rooms.CORE and (unit[0] in rooms.PROGRAMS or where.split(" includes ")[1].startswith("heave/")))]


def private_ways(edges):
    return [where for unit, others in edges.items() for other, where in others.items()
            if unit[0] in rooms.PROGRAMS and other[0] in rooms.CORE and not where.split(" includes ")[1].startswith("heave/")]


def up_ways():
    """Rooms that lead back to themselves in the table."""
    return circles({(name, ""): {(other, ""): "" for other in others} for name, others in USES.items()})


def lines_of(root):
    count = {}
    for path in (root / "src").rglob("*.[ch]"):
        count[path.parent.name] = count.get(path.parent.name, 0) + path.read_text(encoding="utf-8").count("\n")
    return count


def must(nothing, what):
    assert not nothing, f"{what}:\n" + "\n".join(map(str, nothing))


def design_rows(root):
    rows = {name: set(re.findall(r"`(\w+)`", uses)) for name, uses in ROW.findall((root / "src/DESIGN.md").read_text(encoding="utf-8"))}
    return [f"{name}: {sorted(rows.get(name, ['no row']))}, tools/lib/rooms.py: {sorted(USES.get(name, ['no room']))}"
            for name in sorted({*rows, *USES}) if rows.get(name) != USES.get(name)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2])
    root = parser.parse_args().root.resolve()
    suite, edges = tap.Suite(), graph(root)
    with suite.case("each folder of src/ is a room, and each room a folder"):
        folders = {path.name for path in (root / "src").iterdir() if path.is_dir()}
        must(sorted(folders ^ set(USES)), "only in one of src/ and tools/lib/rooms.py")
    with suite.case("the rooms are in layers"):
        must(up_ways(), "rooms that lead to each other")
    with suite.case("each room uses the rooms that it may"):
        must(wrong_ways(edges), "the wrong way")
    with suite.case("the programs use the core through its public headers"):
        must(private_ways(edges), "private headers")
    with suite.case("src/DESIGN.md says the same"):
        must(design_rows(root), "differs")
    with suite.case(f"no room has more than {HEAVIEST:.0%} of the lines"):
        count = lines_of(root)
        must([f"{name}: {lines} of {sum(count.values())}" for name, lines in count.items() if lines > HEAVIEST * sum(count.values())], "too heavy")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
