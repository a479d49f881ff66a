#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_typed.py BIN - what the pages say to type does what they say, line by line as it is printed, in a shell; only the places of files are others: blocks that start
simulated drives, blocks that need none, and lines for a platform that runs."""
import contextlib
import os
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import harness
import tap
from heave import Heaved, Twin

BIN = Path(sys.argv[1]).resolve()
FENCE = re.compile(r"^```(?:sh|text)\n(.*?)^```$", re.M | re.S)
PAGES = ("installation.md", "installation.zh-CN.md", "twin.md", "offline.md", "platform.md", "platform.zh-CN.md")
MARK = "/tmp/"  # of a block that is typed on a machine without the platform
BLOCK_S = 120
NEEDS_SUDO = "sudo "
PREPARED = "modprobe "  # of vcan: the bus of this machine is there


def blocks():
    """Each block that starts simulated drives or needs none, with its page, and how often it stands in that."""
    for page in PAGES:
        for number, text in enumerate(FENCE.findall((harness.TOP / "docs" / page).read_text(encoding="utf-8"))):
            if MARK in text and ("heave-twin" in text or re.search(r"^heaved .*--(?:play|check)", text, re.M)):
                yield page, number, text


def lines_for_a_platform_that_runs():
    """Saved and looked at while it runs, then made into start-up lists, and what was recorded."""
    drives, samples = ((harness.TOP / "docs" / page).read_text(encoding="utf-8") for page in ("cia402.md", "samples.md"))
    left_out = [f"{line} || test $? = 1" for line in re.findall(r"^ {4}(heaved --import-dcf .*?) *#.*$", drives, re.M)]  # as the page says, with settings that no list needs
    lines = [*re.findall(r"^(?:for n in|heavectl --save) .*$", drives, re.M), *re.findall(r"^ {4}(heavectl --for .*)$", samples, re.M), *left_out]
    assert len(lines) == 7 and len(left_out) == 3, lines
    return "\n".join(lines)


@contextlib.contextmanager
def running(folder):
    """A platform with CANopen drives. Gives the environment that finds it."""
    config = (harness.TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8").replace("can0", "vcan0" if harness.HAS_OWN_KERNEL else f"twin{os.getpid() % 1000000}")
    (folder / "cia402.ini").write_text(config, encoding="utf-8")
    (folder / "maker.eds").write_text("[6083]\nParameterName=acceleration\nDataType=0x0007\nAccessType=rw\n", encoding="utf-8")
    with Twin(folder / "cia402.ini", program=BIN / "heave-twin"), Heaved(folder / "cia402.ini", program=BIN / "heaved") as daemon:
        harness.wait_for(lambda: all(drive["drive"] == "disabled" for drive in daemon.platform.status()["cylinders"]), "the drives are ready")
        yield {"HEAVE_SOCKET": str(daemon.socket)}


def moved(text, folder):
    """The places of files are those of this test; everything else is as printed."""
    lines = [line for line in text.splitlines() if PREPARED not in line]
    places = {"/usr/share/doc/heave/config": harness.TOP / "config", "/etc/heave": folder, "/tmp": folder}
    return re.sub("|".join(places), lambda found: str(places[found[0]]), "\n".join(lines).replace(NEEDS_SUDO, ""))


def has_gone(group, number):
    """True where nobody is left who could get a signal."""
    try:
        os.killpg(group, number)
    except ProcessLookupError:
        return True
    return False


def typed(text, folder, **variables):
    """Its exit status and all it has printed. What it has started ends with it."""
    environment = {**os.environ, "PATH": f"{BIN}:{Path(sys.executable).parent}:{os.environ['PATH']}", "LC_ALL": "C.UTF-8", **variables}
    with subprocess.Popen(["bash", "-e", "-o", "pipefail"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder, env=environment, start_new_session=True) as shell:
        said = folder / "said"
        shell.stdin.write(f"exec > {said} 2>&1\n{moved(text, folder)}\n")
        shell.stdin.close()
        try:
            code = shell.wait(timeout=BLOCK_S)
        finally:
            has_gone(shell.pid, signal.SIGTERM)
            harness.wait_for(lambda: has_gone(shell.pid, 0), "all of it has ended")
    return code, said.read_text(encoding="utf-8")


WANTED = [  # a line of the block, what is printed in the end
    ("dry.ini", r"engage: ENGAGED, waiting for a sender\n(?s:.*)ENGAGED"),
    ("jam 3", r"(?ms)engage: ENGAGED.*^FAULT .*does not follow its set-points, axis 3"),
    ("modbus-tcp-hexapod.ini", r"engage: ENGAGED"),
    ("estop open", r'"estop": ?"?open"?'),
    ("--slcan", r"V\d|\d"),
    ("can-raw-hexapod.ini", r"engage: ENGAGED"),
    ("--script", r""),
    ("--play", r"(?i)keeps|within|ok|0 violations"),
    ("--envelope", r"(?s)worst cylinder speed.*\[geometry\]"),
]


def main():
    suite = tap.Suite()
    found = set()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for name in ("config", "tools"):  # as in the folder of the project
            (folder / name).symlink_to(harness.TOP / name)
        (folder / "ride.ini").write_text((harness.TOP / "config/can-raw-hexapod.ini").read_text(encoding="utf-8"), encoding="utf-8")
        for page, number, text in blocks():
            wanted = [(mark, pattern) for mark, pattern in WANTED if mark in text]
            found |= {mark for mark, _ in wanted}
            with suite.case(f"{page}, block {number + 1}: {text.splitlines()[0][:60]}"):
                code, said = typed(text, folder)
                print("\n".join(f"# {line}" for line in said.splitlines()))
                assert code == 0, (code, said)
                assert all(re.search(pattern, said) for _, pattern in wanted), said
        with suite.case("cia402.md and samples.md, for a platform that runs"), running(folder) as variables:
            code, said = typed(lines_for_a_platform_that_runs(), folder, **variables)
            assert code == 0, (code, said[:2000])
            assert all((folder / f"drive{n}.dcf").stat().st_size > 500 for n in range(1, 7)), said[:2000]
            assert (folder / "z.csv").read_text(encoding="ascii").startswith("t_ms,sent_z_mm,actual_z_mm\n"), said[:2000]
            assert "[cia402-startup-3]" in said and "[cia402-startup]" in said, said[:2000]
    with suite.case("each of them is looked for"):
        assert found == {mark for mark, _ in WANTED}, found
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
