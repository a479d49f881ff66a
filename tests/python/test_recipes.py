#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_recipes.py --bin DIR [--no-lab] - every block of docs/testing-with-heave.md, and the test of a host in README.md, does what it says, as printed, in a clean virtual environment.

What is exchanged: /tmp and /usr/share/doc/heave/config, so that a run touches nothing of the machine's; build/demo/bin is the build that is tested; pip takes no network: the package
from its folder, pytest and NumPy from the Python of tools/lib/venv.sh. Of CI jobs the steps that install are left out.
"""
import argparse
import json
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
SYSTEM_PYTHON = "/usr/bin/python3"  # has Debian's packages
LAB_TAKES = ("gcc", "libc6-dev", "make", "flex", "bison", "bc", "xz-utils")  # to build its kernel
RECIPES = ("host", "drive", "CI", "incident", "show", "geometry")


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
        (self.clone / "build/demo").mkdir(parents=True)
        (self.clone / "build/demo/bin").symlink_to(Path(bin_dir).resolve())
        shutil.copytree(TOP / "python", self.clone / "python", ignore=shutil.ignore_patterns("__pycache__", "build", "*.egg-info"))
        self.python = kernel.find("venv.sh")
        self.said = {}  # by command

    def as_here(self, text):
        text = text.replace("/tmp/", f"{self.folder}/").replace("/usr/share/doc/heave/config", str(TOP / "config"))
        return re.sub(r"^pip install pytest( numpy)? \./python$", f"""
        echo {self.packages()} > "$(python3 -c 'import site; print(site.getsitepackages()[0])')/packages.pth"
        PYTHONPATH={self.packages()} pip install -q --no-index --no-build-isolation --no-deps --disable-pip-version-check ./python""", text, flags=re.MULTILINE)

    def packages(self):
        return subprocess.run([self.python, "-c", "import site; print(site.getsitepackages()[0])"], stdout=subprocess.PIPE, text=True, check=True).stdout.strip()

    def run(self, text, folder, is_setup=False):
        head = "set -eu\n" if is_setup else f"set -eu\n. {self.folder}/heave-venv/bin/activate\nexport HEAVE_BIN={self.clone}/build/demo/bin\n"
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
    if recipe == "show":
        lags = list(map(float, re.findall(r"lag ([0-9.]+) ms", said)))
        less = re.search(r"less than it asks for in the seconds ([0-9 ]+)", said)
        assert len(lags) == 3 and all(0 < lag < 300 for lag in lags) and less and {"0", "12", "13"} <= set(less[1].split()) and not {"5", "8", "18"} & set(less[1].split()), said
        assert "ride.html" in said, said
    if recipe == "geometry":
        shares = list(map(int, re.findall(r"(\d+)% of the cycles clamped", said)))
        assert len(shares) == 2 and shares[0] == 0 < shares[1], said


def host_of_the_readme(bench):
    """The file and the commands below it, in a clone that tools/demo has built."""
    blocks = BLOCK.findall((TOP / "README.md").read_text(encoding="utf-8"))
    (bench.clone / "test_my_host.py").write_text(next(text for language, text in blocks if language == "python"), encoding="utf-8")
    said = bench.run(next(text for language, text in blocks if language == "sh" and "pip install" in text), bench.clone, is_setup=True)
    assert "1 passed" in said, said


def ci_file(text):
    """What the service would read: the jobs' steps, each a command for a shell; programs that a step calls come with what it installs."""
    read = subprocess.run([SYSTEM_PYTHON, "-c", "import json, sys, yaml; print(json.dumps(yaml.safe_load(sys.stdin)))"], input=text, capture_output=True, text=True, check=False)
    if "No module named 'yaml'" in read.stderr or read.returncode == 127:
        raise tap.Skip("python3-yaml is not installed")
    assert read.returncode == 0, read.stderr
    file = json.loads(read.stdout)
    is_github = "jobs" in file
    job = file["jobs"]["test"] if is_github else file["test"]
    assert (job["container"] if is_github else job["image"]) == "debian:12", "the packages are for Debian 12"
    commands = [step["run"] for step in job["steps"] if "run" in step] if is_github else job["script"]
    install, *others = commands
    assert all(subprocess.run(["bash", "-n", "-c", command], check=False).returncode == 0 for command in commands), commands
    assert set(install.split()) >= {"./heave/*.deb", "python3-pytest", "python3-numpy", *LAB_TAKES}, install
    assert "sudo" not in install and [command.split()[0] for command in others] == ["heave-lab", "python3", "heave-lab"], commands
    cached = job["steps"][1]["with"]["path"] if is_github else f"{job['cache']['paths'][0]} {job['variables']['XDG_CACHE_HOME']}"
    assert cached == ("~/.cache/heave" if is_github else ".cache/heave $CI_PROJECT_DIR/.cache"), cached


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
    with suite.case("there are six recipes, the CI one for two services"):
        assert [len(blocks) for blocks in recipes] == [1, 1, 2, 1, 1, 1], recipes
    with tempfile.TemporaryDirectory(prefix="heave-recipes-") as name:
        try:
            bench = Bench(Path(name), options.bin)
        except tap.Skip as reason:
            with suite.case("the recipes"):
                raise reason
            return suite.done()
        with suite.case("set up: a virtual environment with the package"):
            bench.run(setup[0][1], bench.clone, is_setup=True)
        with suite.case("README.md: a test of a host"):
            host_of_the_readme(bench)
        for language, text in [block for blocks in recipes for block in blocks if block[0] == "yaml"]:
            with suite.case(f"{text.splitlines()[0]} is a file that its service understands"):
                ci_file(text)
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
