#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_readme.py - what README and docs say is what the programs and the tree do, in both languages.

usage: test_readme.py --build BUILD_DIR --heaved PROGRAM --heavectl PROGRAM --reference PROGRAM --faults PROGRAM
"""
import argparse
import functools
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
import clock_tests  # noqa: E402  the path above has to be set first

DOCS = TOP / "docs"
LANGUAGES = {"": "README.md", ".zh-CN": "README.zh-CN.md"}
README_BYTES = 8000
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.M | re.S)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
STATES = re.compile(r"<!-- (states|clock-tests):begin -->.*?<!-- \1:end -->", re.S)  # in one language, or in another one each
LINK = re.compile(r"\]\(([^)#:\s]*)(?:#([^)\s]*))?\)")
NOT_OURS = {".", "cmake", "export", "printf", "cp", "nano", "sleep", "sudo", "pip", "python3", "gpiodetect", "gpioinfo"}
OTHER_OPTIONS = {"--build", "--install", "--now", "--component", "--prefix"}  # of cmake, systemctl
NUMBER = re.compile(r"-?\d+")
OWN_STROKE_MM, OWN_POSE = 260, (5, 6, 0, 5.5, 3, 20)


def run(*command, **more):
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, **more)


@functools.cache
def help_of(program):
    result = run(program, "--help")
    assert result.returncode == 0, f"{program} --help: exit status {result.returncode}, {result.stderr}"
    return result.stdout


def page(path):
    """Without what is made from a table of the programs or the tests."""
    return STATES.sub("", path.read_text(encoding="utf-8"))


def blocks(path, language=None):
    return [text for name, text in FENCE.findall(page(path)) if language in (None, name)]


def prose(path):
    return FENCE.sub("", page(path))


def table_rows(path):
    """Rows of each table, in order."""
    return [len(table.splitlines()) for table in re.findall(r"(?:^\|.*\n)+", prose(path), re.M)]


def anchor(heading):
    """As GitHub makes it of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def anchors(path):
    return {anchor(heading) for heading in re.findall(r"^#+ +(.*)$", FENCE.sub("", path.read_text(encoding="utf-8")), re.M)}


def every_page():
    return [TOP / name for name in ("README.md", "README.zh-CN.md", "CONTRIBUTING.md", "CHANGELOG.md")] + sorted(DOCS.glob("*.md"))


def links():
    """What a page links to is there, headings included."""
    wrong, count = [], 0
    for path in every_page():
        for target, place in LINK.findall(prose(path)):
            count += 1
            found = (path.parent / target).resolve() if target else path
            if not found.exists() or place and place not in anchors(found):
                wrong.append(f"{path.name}: {target}#{place}")
    assert count > 100 and not wrong, f"links to what is not there: {wrong}"


def index():
    """Both indexes lead to every page: the Chinese one to the Chinese page where there is one."""
    for suffix, name in LANGUAGES.items():
        named = {target for target, _ in LINK.findall(prose(DOCS / name)) if "/" not in target} - set(LANGUAGES.values())
        pages = {path.name for path in DOCS.glob("*.md") if ".zh-CN" not in path.name} - {"README.md"}
        wanted = {f"{Path(page).stem}{suffix}.md" if (DOCS / f"{Path(page).stem}{suffix}.md").exists() else page for page in pages}
        assert named == wanted, f"docs/{name}: missing {wanted - named}, too many {named - wanted}"


def keys():
    """`[section] key` in a page is a key that there is. Of what is gone, the list of changes tells."""
    text = (DOCS / "configuration.md").read_text(encoding="utf-8")
    known = {(section, key) for section, rows in re.findall(r"^## \[([\w-]+)\]$(.*?)(?=^## |\Z)", text, re.M | re.S) for key in re.findall(r"^\| `(\w+)` \|", rows, re.M)}
    assert len(known) > 150
    named = [(path.name, *place) for path in every_page() for place in re.findall(r"`\[([\w-]+)\] (\w+)(?: = [^`]*)?`", path.read_text(encoding="utf-8"))]
    wrong = [place for place in named if place[1:] not in known]
    assert len(named) > 50 and not wrong, f"keys that are not there: {wrong}"


def licence():
    """LICENSE is what the package's copyright file says, and every source names it."""
    words = [re.findall(r"[\w\"']+", (TOP / name).read_text(encoding="utf-8")) for name in ("LICENSE", "packaging/debian/copyright")]
    start = [one.index("Permission") for one in words]
    assert words[0][start[0]:] == words[1][start[1]:], "LICENSE and packaging/debian/copyright differ"
    sources = [path for folder in ("include", "src", "hal", "examples") for path in (TOP / folder).rglob("*.[ch]")]
    silent = [str(path) for path in sources if "SPDX-License-Identifier: MIT" not in path.read_text(encoding="utf-8")[:200]]
    assert len(sources) > 200 and not silent, f"no SPDX line: {silent}"


def commands(path, programs):
    """Of shell blocks: program and paths exist, the program knows its options."""
    for line in (line for text in blocks(path, "sh") for line in text.splitlines()):
        words = line.split()
        if words[0] in NOT_OURS or words[0].startswith("build/"):
            continue
        is_known = words[0] in programs
        assert is_known or (TOP / words[0]).exists(), f"{line}: {words[0]} is not there"
        known = set(OPTION.findall(help_of(programs[words[0]]))) if is_known else set()
        unknown = set(OPTION.findall(line)) - known
        assert not is_known or not unknown, f"{line}: {words[0]} does not know {unknown}"
        for word in words[1:]:
            is_path = "/" in word and re.fullmatch(r"[\w.][\w./-]*", word)
            assert not is_path or (TOP / word).exists(), f"{line}: {word} is not there"


class Manual:
    """README and the pages of one language, against the programs."""

    def __init__(self, suffix, programs):
        self.suffix, self.programs = suffix, programs
        self.readme = TOP / LANGUAGES[suffix]
        self.pages = [self.readme, *(DOCS / f"{name}{suffix}.md" for name in
                                     ("installation", "platform", "operation", "protocol", "offline", "motion", "testing"))]
        self.text = "\n".join(page(path) for path in self.pages)

    def of(self, name):
        return DOCS / f"{name}{self.suffix}.md"

    def size(self):
        size = self.readme.stat().st_size
        assert size <= README_BYTES, f"{size} bytes: what is more than two screens goes to docs/"

    def states(self):
        for path in (self.of("operation"), TOP / "panel/states.js"):
            result = run(sys.executable, TOP / "tools/gen_states.py", "--check", path)
            assert result.returncode == 0, result.stdout + result.stderr

    def the_two_commands(self):
        assert "tools/demo\ntools/test\n" in blocks(self.readme, "sh")

    def shell_blocks(self):
        for path in self.pages:
            commands(path, self.programs)

    def options(self):
        """Options named here exist, options that exist are named."""
        named = set(OPTION.findall(self.text))
        existing = {program: set(OPTION.findall(help_of(path))) for program, path in self.programs.items()}
        for program in ("heaved", "heavectl"):
            missing = existing[program] - named - {"--help", "--version"}
            assert not missing, f"options of {program} that are not named: {missing}"
        unknown = named - set().union(*existing.values()) - OTHER_OPTIONS
        assert not unknown, f"no program has {unknown}"

    def commands_of_heavectl(self):
        table = re.search(r"^## heavectl\n.*?(?=^## )", page(self.of("operation")), re.M | re.S)[0]
        named = re.findall(r"^\| `([\w-]+)` \|", table, re.M)
        answer = run(self.programs["heavectl"], "nonsense").stderr
        known = re.findall(r"[\w-]+", re.search(r"unknown command \"nonsense\"; allowed: (.*); see", answer)[1])
        assert sorted(named) == sorted(known), f"named {named}, known {known}"

    def exit_codes(self):
        header = (TOP / "src/common/message.h").read_text(encoding="ascii")
        known = set(re.findall(r"EXIT_\w+ = (\d+)", header))
        table = re.search(r"^\| [^|]+ \| heaved, heavectl \|\n(?:\|.*\n)+", page(self.of("operation")), re.M)[0]
        named = set(re.findall(r"\d+", " ".join(re.findall(r"^\| ([\d, ]+) \|", table, re.M))))
        assert named == known, f"named {sorted(named)}, known {sorted(known)}"

    def flags(self):
        words = re.findall(r'\{(?:MOTION|FLAG)_\w+, "([\w-]+)"\}', (TOP / "src/record/trace.c").read_text(encoding="ascii"))
        missing = [word for word in words if f"`{word}`" not in page(self.of("offline"))]
        assert words and not missing, f"flags of a trace that are not named: {missing}"

    def events(self):
        """Each line that starts with ! and that --play takes is described."""
        named = set(re.findall(r"`(![a-z]+)", page(self.of("offline"))))
        known = {f"!{word}" for word in ("engage", "hold", "resume", "park", "reset", "shutdown", "intensity", "estop", "from", "late", "drive", "fault", "end")}
        assert known <= named, f"events that are not described: {known - named}"

    def frames(self):
        """Every frame is one that a hexapod or a platform of three cylinders takes."""
        frames = sorted(set(re.findall(r"@[AC]\d[^#`]*#", self.text)))
        assert len(frames) > 7
        for frame in frames:
            takers = [name for name in ("demo-hexapod", "tripod-rotation") if self.is_taken(frame, name)]
            assert takers, f"no platform takes {frame}"

    def is_taken(self, frame, name):
        with tempfile.NamedTemporaryFile("w", suffix=".frames") as file:
            file.write(f"0 {frame}\n")
            file.flush()
            result = run(self.programs["heaved"], "--config", TOP / f"config/{name}.ini", "--play", file.name)
        assert result.returncode == 0, result.stderr
        return ": 1 frames accepted" in result.stderr

    def environment(self):
        path = f"{self.programs['heaved'].parent}:{os.environ['PATH']}"
        return {**os.environ, "PATH": path}

    def offline_blocks(self):
        """The blocks that only read configurations and run offline do as they stand, in a folder of their own."""
        text = "\n".join(text for path in (self.of("platform"), self.of("offline")) for text in blocks(path, "sh"))
        assert "--play" in text and "--check" in text
        with tempfile.TemporaryDirectory() as folder:
            result = run("bash", "-e", "-c", text.replace("/tmp/", f"{folder}/"), cwd=TOP, env=self.environment())
        assert result.returncode == 0, result.stdout[-2000:] + result.stderr

    def one_frame(self):
        """The line that sends a frame by hand: what arrives is that frame."""
        text, = (text for text in blocks(self.of("protocol"), "sh") if "/dev/udp/" in text)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.bind(("127.0.0.1", 0))
            receiver.settimeout(60)
            result = run("bash", "-c", text.replace("/9800", f"/{receiver.getsockname()[1]}"))
            assert result.returncode == 0, result.stderr
            assert receiver.recv(512).decode() in text

    def a_platform_of_ones_own(self):
        """The file with another stroke and port, then the commands as they stand: the frame brings the platform to its pose."""
        text, = (text for text in blocks(self.readme, "sh") if "my-platform.ini" in text)
        sizes, = blocks(self.readme, "ini")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            port = str(free.getsockname()[1])
        with tempfile.TemporaryDirectory() as folder:
            own = re.sub(r"(?m)^stroke_mm = \d+$", f"stroke_mm = {OWN_STROKE_MM}", sizes)
            assert own != sizes
            (Path(folder) / "my-platform.ini").write_text(f"{own}\n[udp]\nport = {port}\n", encoding="utf-8")
            text = text.replace("/tmp/", f"{folder}/").replace("/9800", f"/{port}").replace("$PWD/build/demo/bin", str(self.programs["heaved"].parent))
            text = text.replace("heavectl shutdown", "heavectl --json status\nheavectl shutdown\nwait")
            with subprocess.Popen(["bash", "-e", "-c", text], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True, start_new_session=True) as process:
                try:
                    output, _ = process.communicate(timeout=120)
                except subprocess.TimeoutExpired:
                    os.killpg(process.pid, signal.SIGKILL)
                    raise
        assert process.returncode == 0, output[-3000:]
        status = next(json.loads(line) for line in output.splitlines() if line.startswith("{"))
        assert all(cylinder["stroke_mm"] == OWN_STROKE_MM for cylinder in status["cylinders"]), output[-3000:]
        assert all(abs(a - b) < 0.01 for a, b in zip(status["pose_sent"].values(), OWN_POSE)), status["pose_sent"]


def sections(programs):
    """The Chinese page names every section; for English readers docs/configuration.md does."""
    dump = run(programs["heaved"], "--config", TOP / "config/demo-hexapod.ini", "--dump-config").stdout
    known = set(re.findall(r"^\[([\w-]+)\]", dump, re.M)) | set(re.findall(r"^## \[([\w-]+)\]", (DOCS / "configuration.md").read_text(encoding="utf-8"), re.M))
    named = set(re.findall(r"`\[([\w-]+)\]`", page(DOCS / "platform.zh-CN.md")))
    assert len(known) > 15 and known <= named, f"sections that are not named: {known - named}"


def same_structure(path):
    """A page and its Chinese one: the same headings, tables and code blocks. (The Chinese page of the platform lists the sections beside that.)"""
    other = path.with_name(f"{path.stem}.zh-CN.md")
    for what, of in {"headings": lambda path: re.findall(r"^#+", prose(path), re.M), "rows of tables": table_rows, "code blocks": blocks}.items():
        if what == "rows of tables" and path.name == "platform.md":
            continue
        assert of(path) == of(other), f"{path.name}: {what} differ: {of(path)} and {of(other)}"


def picture(heaved):
    """The picture shows what heaved does."""
    shown = DOCS / "demo.svg"
    assert shown.stat().st_size < 150_000, f"{shown.stat().st_size} bytes"
    result = run(TOP / "tools/picture", "--heaved", heaved, "--check", shown)
    assert result.returncode == 0, result.stdout + result.stderr
    for animation in ElementTree.parse(shown).iter("{http://www.w3.org/2000/svg}animate"):
        values, times = animation.get("values").split(";"), [float(time) for time in animation.get("keyTimes", "").split(";") if time]
        assert len(values) > 1 and len({len(NUMBER.findall(value)) for value in values}) == 1, f"not alike from picture to picture: {animation.attrib}"
        assert not times or times[0] == 0 and times == sorted(times) and len(times) == len(values), f"key times: {animation.attrib}"
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "other.svg"
        other.write_text(shown.read_text(encoding="ascii").replace("ENGAGED", "HOLD"), encoding="ascii")
        assert run(TOP / "tools/picture", "--heaved", heaved, "--check", other).returncode == 1, "another ride is not noticed"


def recipes():
    """Each file of a recipe in CONTRIBUTING.md holds all its examples, and no other file of the programs, their tests and generated pages does."""
    text = (TOP / "CONTRIBUTING.md").read_text(encoding="utf-8")
    examples = {"Add a fault": ("FAULT_ESTOP_CHANNELS|estop-channels", r"FAULT_POWER\b|power-failing", "FAULT_OUTSIDE_STROKE|outside-stroke"),
                "Add a key": ("blend_ms", "delay_max_ms", "silence_hold_ms"),
                "Add a drive family": ("(?i)cia_?402", "(?i)can[-_]?raw", "(?i)modbus[-_ ](drive|tcp)")}
    told = re.findall(r"^### (Add .*)$", text, re.M)
    assert sorted(told) == sorted(examples), told
    places = [path for folder in ("include", "src", "hal/sim", "tests/unit", "tests/contract") for path in sorted((TOP / folder).rglob("*.[ch]"))]
    places += [DOCS / "configuration.md", DOCS / "faults.md", TOP / "python/heave/faults.py"]
    texts = {str(path.relative_to(TOP)): path.read_text(encoding="utf-8") for path in places}
    for title, patterns in examples.items():
        part = re.search(rf"^### {title}$.*?(?=^##|\Z)", text, re.M | re.S)[0]
        listed = set(re.findall(r"^\| `([^`]+)` \|", part, re.M))
        holding = {name for name, held in texts.items() if all(re.search(pattern, held) for pattern in patterns)}
        assert listed == holding, f"{title}: not in the list: {sorted(holding - listed)}; in the list, but without the examples: {sorted(listed - holding)}"


def reference(program, page, **variables):
    wanted = run(program, env={**os.environ, **variables}).stdout
    got = (TOP / page).read_text(encoding="utf-8")
    assert got == wanted, f"{page} is not up to date: {program} > {page}"


def lists_clock_tests(build):
    """A build without heave-panel, or with sanitizers, has fewer."""
    told = dict(re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", clock_tests.written(), re.M))
    missing = {name: sentence for sentence, names in clock_tests.declared(build).items() for name in names if f"`{name}`" not in told.get(sentence, "")}
    assert not missing, f"not listed, or with another sentence: {missing}; tools/lib/clock_tests.py BUILD_DIR --write"
    declarations = "".join(path.read_text(encoding="utf-8") for path in (TOP / "tests").rglob("CMakeLists.txt"))
    assert len(told) > 5 and all(f'heave_clock("{sentence}"' in declarations for sentence in told if not sentence.startswith(("why", "---"))), told


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--build", type=Path, required=True)
    for name in ("heaved", "heavectl", "reference", "faults"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    arguments = parser.parse_args()
    programs = {"heaved": arguments.heaved, "heavectl": arguments.heavectl,
                **{f"tools/{name}": TOP / "tools" / name for name in ("demo", "test", "check_trace", "nightly", "proof", "package")}}
    suite = tap.Suite()
    for suffix, name in LANGUAGES.items():
        manual = Manual(suffix, programs)
        for check in (manual.size, manual.states, manual.the_two_commands, manual.shell_blocks, manual.options, manual.commands_of_heavectl, manual.exit_codes,
                      manual.flags, manual.events, manual.frames, manual.offline_blocks, manual.one_frame, manual.a_platform_of_ones_own):
            with suite.case(f"{name} and its pages: {check.__name__.replace('_', ' ')}"):
                check()
    with suite.case("the Chinese page names every section"):
        sections(programs)
    for path in sorted([TOP / "README.md", *(DOCS / other.name.replace(".zh-CN", "") for other in DOCS.glob("*.zh-CN.md"))]):
        with suite.case(f"{path.relative_to(TOP)} has the same headings, tables and code blocks in both languages"):
            same_structure(path)
    with suite.case("links lead to pages and headings that are there"):
        links()
    with suite.case("the indexes lead to every page"):
        index()
    with suite.case("keys that pages name are there"):
        keys()
    with suite.case("LICENSE is what the package and the sources say"):
        licence()
    with suite.case("CONTRIBUTING.md: the files of the recipes are all there are"):
        recipes()
    with suite.case("docs/demo.svg shows what heaved does"):
        picture(arguments.heaved)
    with suite.case("docs/configuration.md is what the table of keys says"):
        reference(arguments.reference, "docs/configuration.md", LC_ALL="C")
    with suite.case("docs/configuration.zh-CN.md is what it says in Chinese"):
        reference(arguments.reference, "docs/configuration.zh-CN.md", LANGUAGE="", LC_ALL="zh_CN.UTF-8", HEAVE_LOCALES=str(Path(arguments.build) / "locale"))
    with suite.case("docs/testing.md lists the clock tests"):
        lists_clock_tests(arguments.build)
    with suite.case("docs/faults.md is what the table of faults says"):
        reference(arguments.faults, "docs/faults.md")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
