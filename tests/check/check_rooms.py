#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""check_rooms.py --build DIR [--root DIR] - the folders of src/ use each other in the directions that tools/lib/rooms.py names, and no source leads
back to itself.

Which room uses which is told by the headers that its files include; which source uses which, by the symbols of the objects in DIR.
src/DESIGN.md has a row for each folder, which names the same directions.
"""
import argparse
import re
import subprocess
import sys
from pathlib import Path

import tap

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lib"))
import rooms  # noqa: E402  the path above has to be set first

USES = {**rooms.CORE, **rooms.PROGRAMS}
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*"([^"]+)"', re.MULTILINE)
ROW = re.compile(r"^\| `src/(\w+)/` \|[^|]*\|([^|]*)\|$", re.MULTILINE)
HEAVIEST = 0.2  # of the lines of src/, hal/ and include/
LONGEST = 500  # lines of a file
TABLES = {"src/config/keys.c"}


def included(root):
    """(room, header's name as it is written, the folder of src/ or "include" that it is in, where) of each include that leads out of its room."""
    for path in sorted((root / "src").rglob("*.[ch]")):
        room = path.parent.name
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            for base in (path.parent, root / "src", root / "include"):
                target = (base / name).resolve()
                if target.is_file() and target.is_relative_to(root):
                    parts = target.relative_to(root).parts
                    other = parts[1] if parts[0] == "src" else parts[0]
                    if other != room:
                        yield room, other, f"{path.relative_to(root)} includes {name}"
                    break


def backend_ways(root):
    """Includes of a backend where none belongs, and of anything but contracts in a backend."""
    wrong = []
    for path in sorted((root / "src").rglob("*.[ch]")) + sorted((root / "hal").rglob("*.[ch]")):
        top, room = path.relative_to(root).parts[:2]
        for name in INCLUDE.findall(path.read_text(encoding="utf-8")):
            found = next((base for base in (path.parent, root / "src", root / "include", *(root / "hal" / backend for backend in rooms.BACKENDS)) if (base / name).is_file()), None)
            target = (found / name).resolve().relative_to(root.resolve()).parts if found else ()
            is_backend = target[:1] == ("hal",) and target[:2] != (top, room)
            is_allowed = target[1] in rooms.NAMES_BACKEND.get(room, ()) if top == "src" and is_backend else not is_backend
            if not is_allowed or (top == "hal" and target[:1] == ("src",)):
                wrong.append(f"{path.relative_to(root)} includes {name}: {top}/{room} may not use {'/'.join(target[:2])}")
    return wrong


def references(build, sources):
    """{source: the sources that define what it needs}. An object whose source below `sources` is gone is one of an earlier build."""
    defined, needed = {}, {}
    for path in sorted((build / "src").rglob("*.o")):
        source = "/".join(part for part in path.relative_to(build / "src").parts if part != "CMakeFiles" and not part.endswith(".dir")).removesuffix(".o")
        if not (sources / source.replace("__", "..")).exists():
            continue
        needed[source] = set()
        listed = subprocess.run(["nm", "--format=posix", path], stdout=subprocess.PIPE, text=True, check=True).stdout
        for name, kind in (line.split()[:2] for line in listed.splitlines()):
            if kind == "U":
                needed[source].add(name)
            elif kind.isupper() and name != "hv_assert_failed":  # each program has its own
                defined[name] = source
    return {source: {defined[name] for name in names if name in defined} - {source} for source, names in needed.items()}


def circles(edges):
    """Each group of names that lead to each other (Tarjan's strongly connected components)."""
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


def wrong_ways(root):
    return [f"{where}: src/{room} may not use src/{other}" for room, other, where in included(root)
            if other in USES and other not in USES.get(room, ()) and not (room in rooms.PROGRAMS and other in rooms.CORE)]


def private_ways(root):
    return [where for room, other, where in included(root) if room in rooms.PROGRAMS and other in rooms.CORE]


def up_ways():
    """Rooms that lead back to themselves in the table."""
    return circles({(name, ""): {(other, ""): "" for other in others} for name, others in USES.items()})


def lines_of(root):
    count = {}
    for path in [path for folder in ("src", "hal", "include") for path in (root / folder).rglob("*.[ch]")]:
        count[path.parent.name] = count.get(path.parent.name, 0) + path.read_text(encoding="utf-8").count("\n")
    return count


def too_long(root, limit=LONGEST):
    found = {str(path.relative_to(root)): path.read_text(encoding="utf-8").count("\n")
             for folder in ("src", "hal", "include") for path in sorted((root / folder).rglob("*.[ch]"))}
    return [f"{name}: {lines} lines, at most {limit}" for name, lines in found.items() if name not in TABLES and lines > limit]


def must(nothing, what):
    assert not nothing, f"{what}:\n" + "\n".join(map(str, nothing))


def design_rows(root):
    rows = {name: set(re.findall(r"`(\w+)`", uses)) for name, uses in ROW.findall((root / "src/DESIGN.md").read_text(encoding="utf-8"))}
    return [f"{name}: {sorted(rows.get(name, ['no row']))}, tools/lib/rooms.py: {sorted(USES.get(name, ['no room']))}"
            for name in sorted({*rows, *USES}) if rows.get(name) != USES.get(name)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[2])
    parser.add_argument("--build", type=Path, required=True)
    args = parser.parse_args()
    root, suite = args.root.resolve(), tap.Suite()
    with suite.case("each folder of src/ is a room, and each room a folder"):
        folders = {path.name for path in (root / "src").iterdir() if path.is_dir()}
        must(sorted(folders ^ set(USES)), "only in one of src/ and tools/lib/rooms.py")
    with suite.case("the rooms are in layers"):
        must(up_ways(), "rooms that lead to each other")
    with suite.case("each room uses the rooms that it may"):
        must(wrong_ways(root), "the wrong way")
    with suite.case("the programs use the core through its public headers"):
        must(private_ways(root), "private headers")
    with suite.case("no source leads back to itself"):
        found = references(args.build, root / "src")
        assert found, f"no object in {args.build}"
        must(circles(found), "circles")
    with suite.case("backends are named where they may be, and use contracts only"):
        must(backend_ways(root), "includes")
    with suite.case("src/DESIGN.md says the same"):
        must(design_rows(root), "differs")
    with suite.case(f"no room has more than {HEAVIEST:.0%} of the lines"):
        count = lines_of(root)
        must([f"{name}: {lines} of {sum(count.values())}" for name, lines in count.items() if lines > HEAVIEST * sum(count.values())], "too heavy")
    with suite.case(f"no file has more than {LONGEST} lines but tables and the ones that are named"):
        must(too_long(root), "too long: split it by subject")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
