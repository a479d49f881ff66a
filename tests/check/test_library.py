#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_library.py - the core as an installed library: the commands of docs/library.md as they stand, the example with CMake and with pkg-config."""
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tools/lib"))
from platform_ini import Platform  # noqa: E402  the path above has to be set first

POSE = [5, 6, 0, 0, 0, 20]  # of the example
WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def checked(*command, **more):
    run = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, **more)
    assert run.returncode == 0, f"{' '.join(map(str, command))}: exit status {run.returncode}\n{run.stdout[-3000:]}"
    return run.stdout


def commands(folder):
    """The block of the page, in a folder of its own, and without optimisation: it takes less time."""
    text, = re.findall(r"^```sh\n(.*?)^```$", (TOP / "docs/library.md").read_text(encoding="utf-8"), re.M | re.S)
    assert "--component library" in text and "/tmp/heave" in text
    for old, new in (("/tmp/heave", folder / "prefix"), (" build/", f" {folder}/build/"), ("\nbuild/", f"\n{folder}/build/"),
                     ("-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_BUILD_TYPE=None")):
        assert old in text, old
        text = text.replace(str(old), str(new))
    return text


def judge(rows):
    """The example ends where another calculation of the same pose ends, on the way from pose zero."""
    platform = Platform(TOP / "config/demo-hexapod.ini")
    assert rows[0] == "t_ms,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm" and len(rows) > 5, rows
    values = [[float(value) for value in row.split(",")] for row in rows[1:]]
    for row, pose in ((values[0], [0] * 6), (values[-1], POSE)):
        wanted = platform.extensions(pose)
        assert all(abs(a - b) < 0.002 for a, b in zip(row[1:], wanted)), f"{row[1:]}, and wanted {wanted}"


def main():
    suite = tap.Suite()
    with tempfile.TemporaryDirectory(prefix="heave-") as name:
        folder = Path(name)
        prefix = folder / "prefix"
        with suite.case("docs/library.md: its commands install the core and build an example that calculates and moves"):
            lines = checked("bash", "-e", "-c", commands(folder), cwd=TOP).splitlines()
            judge(lines[lines.index("t_ms,c1_mm,c2_mm,c3_mm,c4_mm,c5_mm,c6_mm"):])
        with suite.case("the same with pkg-config, from a prefix that was moved, with warnings as errors"):
            if shutil.which("pkg-config") is None:
                raise tap.Skip("pkg-config is not there")
            moved = prefix.rename(folder / "moved")
            found = next(moved.rglob("heave.pc")).parent
            flags = checked("pkg-config", "--cflags", "--libs", "heave", env={**os.environ, "PKG_CONFIG_PATH": str(found)}).split()
            checked("cc", *WARNINGS, TOP / "examples/core/main.c", *flags, "-o", folder / "example")
            judge(checked(folder / "example").splitlines())
        with suite.case("every header can be included alone, from the installed place"):
            headers = sorted((folder / "moved/include").rglob("*.h"))
            assert len(headers) == len(list((TOP / "include").rglob("*.h"))) > 40, len(headers)
            for header in headers:
                place = header.relative_to(folder / "moved/include")
                (folder / "one.c").write_text(f"#include <{place}>\nint main(void) {{ return 0; }}\n", encoding="ascii")
                checked("cc", *WARNINGS, "-fsyntax-only", f"-I{folder / 'moved/include'}", folder / "one.c")
        with suite.case("an installation without this component has neither headers nor archive"):
            checked("cmake", "--build", folder / "build/release")
            checked("cmake", "--install", folder / "build/release", "--prefix", folder / "plain")
            assert (folder / "plain/bin/heaved").exists()
            assert not [path for path in (folder / "plain").rglob("*") if path.suffix in (".h", ".a", ".pc")]
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
