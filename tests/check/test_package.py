#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_package.py - the Debian package: the same bytes from another folder, accepted by lintian, and what it leaves when it comes and goes.

usage: test_package.py --build-dir DIR      packed without optimisation; into an empty root of dpkg, with this machine's libraries
       test_package.py --twice              the same bytes from another folder, later
       test_package.py --root DIR           the package as tools/package makes it, into a copy of a system (debootstrap --variant=minbase), in chroot
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
QUICK = ["-DCMAKE_BUILD_TYPE=None"]  # no optimisation
CONFIG = "etc/heave/demo.ini"
SOURCES = ("CHANGELOG.md", "CMakeLists.txt", "CMakePresets.json", "CONTRIBUTING.md", "LICENSE", "README.md", "README.zh-CN.md", "cmake", "config", "docs", "examples",
           "hal", "include", "packaging", "panel", "po", "python", "src", "tools")


def run(*command, **more):
    result = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            check=False, **more)
    return result.returncode, result.stdout


def checked(*command, **more):
    code, text = run(*command, **more)
    assert code == 0, f"{' '.join(map(str, command))}: exit status {code}\n{text[-3000:]}"
    return text


PANEL = subprocess.run(["pkg-config", "--exists", "libwebsockets"], check=False).returncode == 0


def pack(source, build, **more):
    """The packages: that of the programs, that for Python, that of the panel; without SOURCE_DATE_EPOCH."""
    environment = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"} | more
    for earlier in build.glob("*.deb"):
        earlier.unlink()
    checked("cmake", "--preset", "package", "-B", build, *QUICK, f"-DHEAVE_PANEL={'ON' if PANEL else 'OFF'}", cwd=source, env=environment)
    checked("cmake", "--build", build, env=environment)
    checked("cpack", "--config", build / "CPackConfig.cmake", "-B", build, env=environment)
    checked("cpack", "--config", build / "CPackPython.cmake", "-B", build, env=environment)
    if PANEL:
        checked("cpack", "--config", build / "CPackPanel.cmake", "-B", build, env=environment)
    return tuple(next(build.glob(f"{name}_*.deb")) for name in ("heave", "python3-heave", *(("heave-panel",) if PANEL else ())))


def copy_sources(folder):
    """The sources as a later download has them: other folder, other times."""
    folder.mkdir()
    for name in SOURCES:
        place = TOP / name
        if place.is_dir():
            shutil.copytree(place, folder / name, copy_function=shutil.copy, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(place, folder / name)


def later(deb, folder):
    """The same package with a higher version and another /etc/heave/demo.ini."""
    unpacked = folder / "later"
    checked("dpkg-deb", "-R", deb, unpacked)
    control = unpacked / "DEBIAN/control"
    control.write_text(re.sub(r"(?m)^(Version: .*)$", r"\g<1>+later", control.read_text(encoding="utf-8")), encoding="utf-8")
    with (unpacked / CONFIG).open("a", encoding="utf-8") as file:
        file.write("; a later version\n")
    built = folder / "later.deb"
    checked("dpkg-deb", "--root-owner-group", "-b", unpacked, built)
    return built


class EmptyRoot:
    """A folder that dpkg takes for the root: no chroot, programs run with the machine's own libraries."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "var/lib/dpkg/info").mkdir(parents=True)
        (folder / "var/lib/dpkg/updates").mkdir()
        (folder / "var/lib/dpkg/status").touch()
        (folder / "etc").mkdir()

    def dpkg(self, *arguments):
        return checked("dpkg", f"--root={self.folder}", "--force-script-chrootless", "--force-depends", "--force-not-root", *arguments)

    def program(self, name, *arguments):
        return run(self.folder / "usr/bin" / name, *(self.folder / word[1:] if word.startswith("/") else word for word in arguments))

    def bring(self, deb):
        return deb


class Chroot:
    """A real system: scripts and programs find only what is in it."""

    def __init__(self, folder):
        self.folder = folder

    def dpkg(self, *arguments):
        return checked("chroot", self.folder, "env", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "dpkg", *arguments)

    def program(self, name, *arguments):
        return run("chroot", self.folder, f"/usr/bin/{name}", *arguments)

    def bring(self, deb):
        shutil.copy(deb, self.folder / "tmp")
        return f"/tmp/{deb.name}"


class Life:
    """Of the package on a machine, in this order."""

    def __init__(self, machine, deb, next_deb):
        self.machine, self.deb, self.next_deb = machine, machine.bring(deb), machine.bring(next_deb)
        self.root = machine.folder
        self.config = self.root / CONFIG
        self.own = self.root / "etc/heave/ride.ini"

    def installs(self):
        self.machine.dpkg("-i", self.deb)
        for name in ("heaved", "heavectl", "heave-twin"):
            code, text = self.machine.program(name, "--version")
            assert code == 0 and re.fullmatch(rf"{name} \d+\.\d+\.\d+\n", text), text
        code, text = self.machine.program("heaved", "--config", f"/{CONFIG}", "--check")
        assert code == 0 and "singularity" in text, text
        code, text = self.machine.program("heavectl", "status")
        assert code == 69, text
        groups = (self.root / "etc/group").read_text(encoding="ascii")
        assert re.search(r"(?m)^heave:", groups), groups

    def upgrades(self):
        """A changed configuration stays without a question; a changed one that is new as well stays where the operator says so."""
        self.config.write_text(self.config.read_text(encoding="utf-8") + "; mine\n", encoding="utf-8")
        self.own.write_text("; my platform\n", encoding="utf-8")
        self.machine.dpkg("-i", self.deb)
        assert self.config.read_text(encoding="utf-8").endswith("; mine\n")
        self.machine.dpkg("--force-confold", "-i", self.next_deb)
        assert self.config.read_text(encoding="utf-8").endswith("; mine\n")
        assert Path(f"{self.config}.dpkg-dist").read_text(encoding="utf-8").endswith("; a later version\n")
        code, text = self.machine.program("heaved", "--version")
        assert code == 0, text

    def removes(self):
        incidents = self.root / "var/lib/private/heave/demo/incident-000001"
        incidents.mkdir(parents=True)
        self.machine.dpkg("-r", "heave")
        assert self.config.exists() and self.own.exists() and incidents.exists()
        left = [path for path in (self.root / "usr").rglob("*heave*") if not path.is_dir()]
        assert not left, f"left behind: {left}"

    def purges(self):
        enabled = self.root / "etc/systemd/system/multi-user.target.wants/heave@demo.service"
        enabled.parent.mkdir(parents=True, exist_ok=True)
        enabled.symlink_to("/usr/lib/systemd/system/heave@.service")
        self.machine.dpkg("--purge", "heave")
        assert self.own.read_text(encoding="utf-8") == "; my platform\n", "a platform of the operator's own"
        assert list(self.own.parent.iterdir()) == [self.own], list(self.own.parent.iterdir())
        assert not enabled.is_symlink() and not (self.root / "var/lib/private/heave").exists()


def life(suite, machine, deb, folder):
    told = Life(machine, deb, later(deb, folder))
    for what, case in (("is installed: programs start, the platform for trying out is valid, the group is there", told.installs),
                       ("is upgraded: a configuration that was changed stays", told.upgrades),
                       ("is removed: configurations and incidents stay", told.removes),
                       ("is purged: what is of the package goes, a platform of the operator's own stays", told.purges)):
        with suite.case(what):
            if os.geteuid() != 0:
                raise tap.Skip("dpkg takes root")
            case()


def python_works(deb, root):
    """Unpacked: its programs run, its data are there, and pytest finds the plugin by the metadata."""
    checked("dpkg-deb", "-x", deb, root)
    packages = root / "usr/lib/python3/dist-packages"
    environment = {**os.environ, "PYTHONPATH": str(packages), "PYTHONDONTWRITEBYTECODE": "1"}
    for name, words in (("heave", ("--version",)), ("heave-lab", ("--help",))):
        code, text = run(sys.executable, root / "usr/bin" / name, *words, env=environment)
        assert code == 0 and name in text, text
    script = "import heave; from importlib.metadata import version, entry_points; print(heave.__file__, version('heave'), heave.demo_config().read_text()[:20], *entry_points(group='pytest11', name='heave'))"
    text = checked(sys.executable, "-c", script, env=environment)
    assert str(packages) in text and "; demo-hexapod.ini" in text and "heave.pytest_plugin" in text, text
    mine = {path.relative_to(TOP / "python").as_posix() for path in (TOP / "python/heave").rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    there = {path.relative_to(packages).as_posix() for path in (packages / "heave").rglob("*") if path.is_file()}
    assert mine == there, f"sources and package differ in {mine ^ there}"
    assert all(os.access(packages / "heave/lab" / name, os.X_OK) for name in ("uml.sh", "init.sh"))
    project, installed = (TOP / "python/pyproject.toml").read_text(encoding="utf-8"), (TOP / "packaging/python/entry_points.txt").read_text(encoding="utf-8")
    for name, target in re.findall(r"(?m)^([\w-]+) = ([\w.]+(?::\w+)?)$", installed):
        assert f'{name} = "{target}"' in project, f"pyproject.toml and entry_points.txt differ in {name}"
    versions = {re.search(r'(?m)^version = "(.*)"', project)[1], re.search(r'__version__ = "(.*)"', (TOP / "python/heave/__init__.py").read_text(encoding="utf-8"))[1],
                re.search(r"project\(heave VERSION (\S+)", (TOP / "CMakeLists.txt").read_text(encoding="utf-8"))[1]}
    assert len(versions) == 1, f"versions differ: {versions}"


def python_goes(machine, deb):
    if os.geteuid() != 0:
        raise tap.Skip("dpkg takes root")
    machine.dpkg("-i", deb)
    assert (machine.folder / "usr/lib/python3/dist-packages/heave/__init__.py").exists()
    machine.dpkg("-r", "python3-heave")
    left = [path for path in (machine.folder / "usr").rglob("*heave*") if not path.is_dir()]
    assert not left, f"left behind: {left}"


def fields(deb):
    return dict(line.split(": ", 1) for line in checked("dpkg-deb", "-f", deb).splitlines() if re.match(r"[\w-]+: ", line))


def panel_is_apart(deb, panel_deb, machine):
    if panel_deb is None:
        raise tap.Skip("libwebsockets-dev is not there")
    assert not re.search("websockets|node|crypt", fields(deb)["Depends"]) and not re.search(r"heave-panel|share/heave/panel", checked("dpkg-deb", "-c", deb)), fields(deb)["Depends"]
    assert re.search(r"\blibwebsockets\d+", fields(panel_deb)["Depends"]) and re.search(r"\bheave \(>=", fields(panel_deb)["Depends"]) and "node" not in fields(panel_deb)["Depends"], fields(panel_deb)
    accepted_by_lintian(panel_deb)
    if os.geteuid() != 0:
        raise tap.Skip("dpkg takes root")
    machine.dpkg("-i", deb, panel_deb)
    code, text = machine.program("heave-panel", "--version")
    assert code == 0 and re.fullmatch(r"heave-panel \d+\.\d+\.\d+\n", text), text
    pages = machine.folder / "usr/share/heave/panel"
    assert {path.name for path in pages.iterdir()} == {"scene.js"} | {path.name for path in (TOP / "panel").iterdir() if path.is_file()}, sorted(pages.iterdir())
    unit = (machine.folder / "usr/lib/systemd/system/heave-panel.service").read_text(encoding="utf-8")
    assert "ExecStart=/usr/bin/heave-panel\n" in unit and "DynamicUser=yes" in unit and (machine.folder / "usr/share/man/man8/heave-panel.8.gz").exists()
    passwords = machine.folder / "var/lib/private/heave-panel/passwords"
    passwords.parent.mkdir(parents=True)
    passwords.write_text("service:$y$\n", encoding="ascii")
    machine.dpkg("-r", "heave-panel")
    assert passwords.exists() and not pages.exists() and (machine.folder / "usr/bin/heaved").exists()
    machine.dpkg("--purge", "heave-panel")
    assert not passwords.parent.exists()
    left = [path for path in machine.folder.rglob("*heave-panel*") if "dpkg" not in path.parts]
    assert not left, left


def accepted_by_lintian(deb):
    if shutil.which("lintian") is None:
        raise tap.Skip("lintian is not there")
    is_known = re.search(r'(?m)^ID=debian$', release := Path("/etc/os-release").read_text(encoding="utf-8")) and 'VERSION_ID="12"' in release
    code, text = run("lintian", "--allow-root", "--fail-on", "error,warning" if is_known else "error", deb)  # later ones have other warnings
    assert code == 0, text


def in_a_system(system, folder):
    """tools/package into a copy of a debootstrapped system."""
    suite = tap.Suite()
    with suite.case("tools/package makes it"):
        deb = Path(checked(TOP / "tools/package", "--build-dir", folder / "build").splitlines()[-1])
        accepted_by_lintian(deb)
        checked("cp", "-a", "--reflink=auto", system, folder / "root")
    life(suite, Chroot(folder / "root"), deb, folder)
    return suite.done()


def twice(folder):
    suite = tap.Suite()
    with suite.case("has the same bytes when its sources are copied and built in another folder, later"):
        copy_sources(folder / "copy")
        # without ccache, which writes other paths into what it keeps
        ours, others = (pack(source, folder / build, CCACHE_DISABLE="1") for source, build in ((TOP, "one"), (folder / "copy", "elsewhere/two")))
        for one, other in zip(ours, others):
            assert one.read_bytes() == other.read_bytes(), f"{one.name}: {one.stat().st_size} and {other.stat().st_size} bytes"
    return suite.done()


def quickly(folder, build):
    suite = tap.Suite()
    deb = python_deb = panel_deb = None
    with suite.case("is packed"):
        deb, python_deb, panel_deb = (*pack(TOP, build), None)[:3]
    with suite.case("lintian finds nothing to say"):
        accepted_by_lintian(deb)
    with suite.case("lintian finds nothing to say about the Python package"):
        accepted_by_lintian(python_deb)
    with suite.case("the Python package is installed, works, and is what pip would install"):
        python_works(python_deb, folder / "python")
    with suite.case("the Python package is removed: nothing of it is left"):
        python_goes(EmptyRoot(folder / "python-root"), python_deb)
    with suite.case("heaved alone needs no library of the panel, and the panel is whole"):
        panel_is_apart(deb, panel_deb, EmptyRoot(folder / "panel-root"))
    with suite.case("is refused where the units would name programs that are not there"):
        (folder / "local").mkdir()
        text = (build / "CPackConfig.cmake").read_text(encoding="utf-8").replace('CPACK_HEAVE_PREFIX "/usr"', 'CPACK_HEAVE_PREFIX "/usr/local"')
        (folder / "local/CPackConfig.cmake").write_text(text, encoding="utf-8")
        code, text = run("cpack", "--config", folder / "local/CPackConfig.cmake", "-B", folder / "local")
        assert code != 0 and "-DCMAKE_INSTALL_PREFIX=/usr" in text and not list((folder / "local").glob("*.deb")), text
    life(suite, EmptyRoot(folder / "root"), deb, folder)
    return suite.done()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    way = parser.add_mutually_exclusive_group(required=True)
    way.add_argument("--build-dir", type=Path)
    way.add_argument("--twice", action="store_true")
    way.add_argument("--root", type=Path)
    options = parser.parse_args()
    for tool in ("dpkg", "dpkg-shlibdeps", "systemd-sysusers", "gzip"):
        if shutil.which(tool) is None:
            print(f"1..0 # SKIP {tool} is not there")
            return 0
    with tempfile.TemporaryDirectory(prefix="heave-") as name:
        folder = Path(name)
        if options.root:
            return in_a_system(options.root, folder)
        return twice(folder) if options.twice else quickly(folder, options.build_dir)


if __name__ == "__main__":
    sys.exit(main())
