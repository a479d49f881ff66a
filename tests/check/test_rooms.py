#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_rooms.py - check_rooms.py finds what is planted: an include the wrong way, a private header of the core, sources that lead to each other, a file that is too long."""
import subprocess
import sys
import tempfile
from pathlib import Path

import check_rooms
import tap

FILES = {"src/config/a.h": '#include "common/b.h"\n#include "heave/c.h"\n', "src/common/b.h": "", "include/heave/c.h": "", "src/motion/d.h": "",
         "src/service/e.h": "", "src/motion/f.c": '#include "d.h"\n'}


def planted(extra):
    """(includes the wrong way, private headers)"""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        for name, text in {**FILES, **extra}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        return check_rooms.wrong_ways(root), check_rooms.private_ways(root)


def fine():
    assert planted({}) == ([], []), planted({})


def wrong_way():
    assert planted({"src/config/g.c": '#include "service/e.h"\n'}) == (["src/config/g.c includes service/e.h: src/config may not use src/service"], [])
    assert planted({"src/motion/g.c": '#include "common/b.h"\n'})[0] == ["src/motion/g.c includes common/b.h: src/motion may not use src/common"]


def private():
    assert planted({"src/daemon/g.c": '#include "motion/d.h"\n'}) == ([], ["src/daemon/g.c includes motion/d.h"])


def backend():
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        for name, text in {"hal/linux/x.h": "", "hal/linux/y.c": '#include "x.h"\n#include "heave/c.h"\n', "hal/sim/s.h": "", "include/heave/c.h": "", "src/common/b.h": "",
                           "src/daemon/d.c": '#include "x.h"\n#include "s.h"\n'}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text(text, encoding="utf-8")
        assert check_rooms.backend_ways(root) == [], check_rooms.backend_ways(root)
        (root / "src/common/e.c").write_text('#include "x.h"\n', encoding="utf-8")
        (root / "hal/sim/t.c").write_text('#include "common/b.h"\n#include "x.h"\n', encoding="utf-8")
        assert check_rooms.backend_ways(root) == ["src/common/e.c includes x.h: src/common may not use hal/linux", "hal/sim/t.c includes common/b.h: hal/sim may not use src/common",
                                                  "hal/sim/t.c includes x.h: hal/sim may not use hal/linux"], check_rooms.backend_ways(root)


def circle():
    with tempfile.TemporaryDirectory() as folder:
        objects, sources = Path(folder) / "build/src/config/CMakeFiles/x.dir", Path(folder) / "src/config"
        objects.mkdir(parents=True)
        sources.mkdir(parents=True)
        for name, code in {"a": "int b(void); int a(void) { return b(); }", "b": "int c(void); int b(void) { return c(); }",
                           "c": "int a(void); int c(void) { return a(); }", "d": "int a(void); int d(void) { return a(); }", "z": "int c(void) { return 1; }"}.items():
            (sources / f"{name}.c").write_text(code, encoding="utf-8")
            subprocess.run(["cc", "-c", "-o", objects / f"{name}.c.o", sources / f"{name}.c"], check=True)
        (sources / "z.c").unlink()  # its object is still there and defines c, too
        found = check_rooms.circles(check_rooms.references(Path(folder) / "build", Path(folder) / "src"))
        assert found == [["config/a.c", "config/b.c", "config/c.c"]], found


def long_file():
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, lines in {"src/motion/a.c": 500, "src/motion/b.c": 501, "hal/sim/c.h": 700, "src/config/keys.c": 900, "src/protocol/long.c": 9000}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_text("\n" * lines, encoding="utf-8")
        assert sorted(check_rooms.too_long(root)) == ["hal/sim/c.h: 700 lines, at most 500", "src/motion/b.c: 501 lines, at most 500",
                                                      "src/protocol/long.c: 9000 lines, at most 500"], check_rooms.too_long(root)


def main():
    suite = tap.Suite()
    for name, check in {"nothing wrong is nothing": fine, "an include the wrong way": wrong_way, "a private header of the core": private,
                        "a backend that is named elsewhere, and one that uses more than contracts": backend,
                        "sources that lead to each other": circle, "a file that is too long": long_file}.items():
        with suite.case(f"rooms: {name}"):
            check()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
