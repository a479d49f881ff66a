# SPDX-License-Identifier: MIT
"""stack_bound.py - the most stack a program can take: gcc's frames and calls (-fcallgraph-info=su), longest way from reset on.

What no compiler knows is where calls through pointers lead. They are listed here by the place they stand at, with the reason; one that
is not listed is an error, and so is recursion. Functions that gcc did not compile (libgcc's divisions) are read from the disassembly.
"""
import re
import subprocess
from functools import lru_cache

# File of the call: what its targets are called, by the name that the call uses. Each contract of the HAL has one backend in hal/template and
# one in hal/sim; a program that has both is bounded by the deeper one.
INDIRECT = {
    "include/heave/drives.h": ("cia402_{}", "drives_sim_{}"),
    "include/heave/hal/can.h": ("can_{}",),
    "include/heave/hal/inputs.h": ("inputs_{}",),
    "include/heave/hal/log.h": ("log_{}",),
    "include/heave/hal/relays.h": ("relays_{}",),
    "include/heave/hal/udp.h": ("udp_{}", "player_{}"),
}
OPTIONAL = {"ask_state", "counts", "read_back", "request_one", "waited"}  # of the contracts: a backend may leave them out, and then nothing is called
# Calls of a parameter or of a table's entry: a pattern that finds everything the file puts there.
NAMED = {
    ("src/canopen/cia402_node.c", "is_such"): r"\bare\(drive, (\w+)\)",
    ("src/canopen/cia402_stage.c", "is_there"): r"\b(?:are_all|fail_where)\(self, (\w+)",
    ("src/canopen/cia402_watch.c", "is_seen"): r"\[CIA402_WATCH_\w+\]\s*=\s*\{(\w+)",
    ("src/record/player.c", "refused"): None,  # NULL in the firmware
    ("src/protocol/frame.c", "k_scan"): r"\[FRAME_PHASE_\w+\]\s*=\s*(scan_\w+)",
}
UNLISTED = "a call through a pointer that tests/cortex/stack_bound.py does not list: "
SUFFIX = re.compile(r"\.(constprop|isra|part|cold|lto_priv)\.\d+|\.(cold|isra|part|constprop)\b")
FRAME = re.compile(r"\\n(\d+) bytes \((\w+)")


class Program:
    def __init__(self, root, build, folders, elf, tools="arm-none-eabi-"):
        self.root, self.elf, self.tools = root, elf, tools
        self.frame, self.calls, self.by_name = {}, {}, {}
        self.names_at = {}
        for address, name in re.findall(r"^([0-9a-f]+) [tTwW] (\S+)$", self.run("nm"), re.MULTILINE):
            self.names_at.setdefault(address, set()).add(name)
        self.symbols = set().union(*self.names_at.values())
        self.local, file = set(), ""  # (file, static function): several files may have one of the same name
        for kind, name in re.findall(r"^ *\d+: \S+ +\S+ (FILE|FUNC) +LOCAL +\S+ +\S+ (\S+)$", self.run("readelf", "-sW"), re.MULTILINE):
            file = name if kind == "FILE" else file
            self.local.add((file, name))
        for path in sorted(path for folder in folders for path in (build / folder).rglob("*.ci")):
            self.read(path.read_text(encoding="utf-8"))
        self.read_foreign()

    def read(self, text):
        for title, label in re.findall(r'^node: \{ title: "([^"]*)" label: "([^"]*)"(?! shape)', text, re.MULTILINE):
            found = FRAME.search(label)
            path, _, name = title.rpartition(":")
            is_linked = (path.rsplit("/", 1)[-1], name) in self.local if path else name in self.symbols
            if found and is_linked:  # else the linker has left it out
                assert found[2] in ("static", "dynamic,bounded"), f"{title}: the size of its frame is not bounded"
                self.add(title, int(found[1]))
        for source, target, label in re.findall(r'^edge: \{ sourcename: "([^"]*)" targetname: "([^"]*)"(?: label: "([^"]*)")?', text, re.MULTILINE):
            self.calls.setdefault(source, set()).add(tuple(self.targets(label)) if target == "__indirect_call" else target)

    def add(self, title, frame):
        self.frame[title] = max(frame, self.frame.get(title, 0))
        self.by_name.setdefault(SUFFIX.sub("", title.rsplit(":", 1)[-1]), set()).add(title)

    def targets(self, place):
        """Names of what a call through a pointer may reach."""
        path, line, column = place.rsplit(":", 2)
        file = path[len(str(self.root)) + 1:]
        with open(path, encoding="utf-8") as source:
            lines = source.read().split("\n")
        text = lines[int(line) - 1]
        called = re.search(r"(?:->|\.)?(\w+)(?:\[[^\]]*\](?:->\w+\])?)?\(", text[int(column) - 1:] if "ops->" not in text else text[text.index("ops->") + 3:])
        name = called[1] if called else "?"
        if NAMED.get((file, name), "") is None:
            return []
        if (file, name) in NAMED:
            names = re.findall(NAMED[file, name], "\n".join(lines))
            assert names, f"{file} puts nothing into {name}: the pattern is out of date"
            return names
        if file in INDIRECT:
            return [*(["optional"] if name in OPTIONAL else []), *(pattern.format(name) for pattern in INDIRECT[file])]
        return [f"{UNLISTED}{file}:{line}: {text.strip()}"]

    def run(self, tool, *options):
        return subprocess.run([self.tools + tool, *options, self.elf], stdout=subprocess.PIPE, text=True, check=True).stdout

    def read_foreign(self):
        """Frames and calls of functions that are in the program, but in no .ci file."""
        for name, body in re.findall(r"^[0-9a-f]+ <([^>]+)>:\n((?:.+\n)+)", self.run("objdump", "-d", "--no-show-raw-insn"), re.MULTILINE):
            if SUFFIX.sub("", name) in self.by_name:
                continue
            pushed = sum(4 * len(registers.split(",")) for registers in re.findall(r"(?:push|stmdb\s+sp!,|stmfd\s+sp!,)\s*\{([^}]*)\}", body))
            moved = sum(int(number) for number in re.findall(r"sub(?:\.w|w)?\s+sp, (?:sp, )?#(\d+)", body))
            stored = sum(int(number) for number in re.findall(r"\[sp, #-(\d+)\]!", body))
            self.add(name, pushed + moved + stored)
            self.calls[name] = {target for target in re.findall(r"\bbl?(?:\.[nw])?\s+[0-9a-f]+ <([^>+]+)>", body) if target != name}

        for names in self.names_at.values():  # libgcc's functions have several names, and the disassembly shows one
            titles = set().union(*(self.by_name.get(name, set()) for name in names))
            for name in names - self.by_name.keys():
                self.by_name[name] = titles

    def resolve(self, callee):
        """Titles of what a call reaches: a name, or the names that a pointer may hold. Static functions have their file in front."""
        if callee in self.frame:
            return {callee}
        names = [callee] if isinstance(callee, str) else callee
        assert not names or not names[0].startswith(UNLISTED), names[0]
        found = set().union(*(self.by_name.get(SUFFIX.sub("", name.rsplit(":", 1)[-1]), set()) for name in names))
        assert found or not callee or names[0] == "optional" or callee in names and callee not in self.symbols, f"nothing is known of {callee}, which is called"
        return found  # nothing: a call that gcc had noted and then left out, as what it calls is not in the program

    def deepest(self, root):
        """(bytes, ((function, frame), ...)) of the longest way from a function on."""
        under_way = []

        @lru_cache(maxsize=None)
        def walk(title):
            assert title not in under_way, "recursion: " + " -> ".join([*under_way, title])
            under_way.append(title)
            ways = [walk(one) for callee in self.calls.get(title, ()) for one in self.resolve(callee)]
            under_way.pop()
            size, way = max(ways, default=(0, ()))
            return size + self.frame[title], ((title.rsplit("/", 1)[-1], self.frame[title]), *way)

        (title,) = self.resolve(root)
        return walk(title)
