#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_recipes.py --bin DIR [--no-lab] - every block of docs/testing-with-heave.md does what it says, as printed, in a clean virtual environment.

What is exchanged: /tmp and /usr/share/doc/heave/config, so that a run touches nothing of the machine's; build/release/bin is the build that is tested; pip takes no network: the package
from its folder, pytest and NumPy from the Python of tools/lib/venv.sh. Of CI jobs the steps that install are left out.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import kernel
import tap

TOP = Path(__file__).resolve().parents[2]
PAGES = [TOP / "docs/testing-with-heave.md", TOP / "docs/testing-with-heave.zh-CN.md"]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^## (.+)$", re.MULTILINE)
LIMIT_S = 500
RECIPES = ("host", "drive", "CI", "incident", "geometry")


def sections(path):
    """[(language of a block, its text)] of each section with blocks, in order: set-up first, then the recipes."""
    parts = re.split(r"^## .*$", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return [blocks for part in parts if (blocks := BLOCK.findall(part))]


def steps(text):
    """Commands of a CI job, without those that install."""
    commands = re.findall(r"^ +- (?:run: )?((?:python3|heave-lab|sudo apt-get|apt-get).*)$", text, re.MULTILINE)
    return [command for command in commands if "apt-get" not in command]


class Bench:
    def __init__(self, folder, bin_dir):
        self.folder, self.clone = folder, folder / "clone"
        (self.clone / "build/release").mkdir(parents=True)
        (self.clone / "build/release/bin").symlink_to(Path(bin_dir).resolve())
        shutil.copytree(TOP / "python", self.clone / "python", ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
        self.python = kernel.find("venv.sh")
        self.said = {}  # by command

    def as_here(self, text):
        text = text.replace("/tmp/", f"{self.folder}/").replace("/usr/share/doc/heave/config", str(TOP / "config"))
        return text.replace("pip install pytest numpy ./python", f"""
        echo {self.packages()} > "$(python3 -c 'import site; print(site.getsitepackages()[0])')/packages.pth"
        PYTHONPATH={self.packages()} pip install -q --no-index --no-build-isolation --no-deps --disable-pip-version-check ./python""")

    def packages(self):
        return subprocess.run([self.python, "-c", "import site; print(site.getsitepackages()[0])"], stdout=subprocess.PIPE, text=True, check=True).stdout.strip()

    def run(self, text, folder, is_setup=False):
        head = "set -eu\n" if is_setup else f"set -eu\n. {self.folder}/heave-venv/bin/activate\nexport HEAVE_BIN={self.clone}/build/release/bin\n"
        environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "HEAVE_BIN", "HEAVE_SOCKET")}
        result = subprocess.run(["bash", "-c", head + self.as_here(text)], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                text=True, timeout=LIMIT_S, check=False)
        assert result.returncode == 0, f"exit status {result.returncode}\n{result.stdout[-4000:]}"
        return result.stdout

    def run_once(self, command, folder):
        """Both services do the same, and most of it is how a recipe ends."""
        if command not in self.said:
            self.said[command] = self.run(command, folder)
        return self.said[command]


def expect_said(recipe, said):
    """That the block did something."""
    if recipe == "host":
        assert "1 passed" in said, said
    if recipe == "drive":
        assert "2 passed" in said, said
    if recipe == "incident":
        assert " rows, 0 violations" in said and "incident.html" in said, said
    if recipe == "geometry":
        shares = list(map(int, re.findall(r"(\d+)% of the cycles clamped", said)))
        assert len(shares) == 2 and shares[0] == 0 < shares[1], said


def same_in_both():
    one, other = map(sections, PAGES)
    assert one == other, "the blocks differ"
    one, other = (len(HEADING.findall(path.read_text(encoding="utf-8"))) for path in PAGES)
    assert one == other, "the headings differ"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--no-lab", action="store_true", help="heaved carries a sanitizer, which the kernel of heave-lab does not run")
    options = parser.parse_args()
    suite = tap.Suite()
    with suite.case("both pages have the same blocks"):
        same_in_both()
    setup, *recipes = sections(PAGES[0])
    with suite.case("there are five recipes, the CI one for two services"):
        assert [len(blocks) for blocks in recipes] == [1, 1, 2, 1, 1], recipes
    with tempfile.TemporaryDirectory(prefix="heave-recipes-") as name:
        try:
            bench = Bench(Path(name), options.bin)
        except tap.Skip as reason:
            with suite.case("the recipes"):
                raise reason
            return suite.done()
        with suite.case("set up: a virtual environment with the package"):
            bench.run(setup[0][1], bench.clone, is_setup=True)
        folder = Path(name) / "heave-try"
        for recipe, blocks in zip(RECIPES, recipes):
            for language, text in blocks:
                with suite.case(f"recipe {recipe}, {text.splitlines()[0]}"):
                    if "heave-lab run" in text and options.no_lab:
                        raise tap.Skip("the address sanitizer does not work in User Mode Linux")
                    if language == "yaml":
                        commands = steps(text)
                        assert len(commands) == 3, commands
                        assert [each.count("passed") for each in map(lambda command: bench.run_once(command, folder), commands)] == [0, 1, 1]
                    else:
                        said = bench.said[text.splitlines()[-1]] = bench.run(text, folder)
                        expect_said(recipe, said)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
