#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_profile.py BIN - heavectl profile: several rigs of one service, listed and changed as an integrator does it; in which states it may be, and what is
refused. systemctl is played: that it is asked, and for what."""
import json
import os
import subprocess
import sys

import harness
import tap


class Rigs:
    """A configuration directory with two profiles of the platform `ride`, and a systemctl that starts heaved anew as the service would."""

    def __init__(self, bench):
        self.bench = bench
        self.folder = bench.folder / "etc"
        (self.folder / "ride.d").mkdir(parents=True)
        self.link = self.folder / "ride.ini"
        for name, port in (("small", bench.port), ("large", bench.port)):
            bench.write_config("one.ini", platform__engage="manual", udp__port=port).rename(self.folder / f"ride.d/{name}.ini")
        self.tools = bench.folder / "tools"
        self.tools.mkdir()
        self.asked = bench.folder / "asked"
        self.play(0)

    def play(self, code):
        (self.tools / "systemctl").write_text(f'#!/bin/sh\necho "$@" >>{self.asked}\nexit {code}\n')
        (self.tools / "systemctl").chmod(0o755)

    def ctl(self, *arguments, platform="ride"):
        environment = {**os.environ, "HEAVE_CONFIG_DIRECTORY": str(self.folder), "PATH": f"{self.tools}:{os.environ['PATH']}"}
        named = ("--platform", platform) if platform else ()
        return subprocess.run([self.bench.bin / "heavectl", "--socket", str(self.bench.socket), *named, *arguments], env=environment, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=60, check=False)

    def active(self):
        return os.readlink(self.link)


def lists_and_changes_without_heaved(bench):
    rigs = Rigs(bench)
    assert "none is active" in rigs.ctl("profile").stdout
    run = rigs.ctl("profile", "small")
    assert run.returncode == 0 and run.stdout == "profile: small, from the next start\n", run
    assert rigs.active() == "ride.d/small.ini" and not rigs.asked.exists()
    assert rigs.ctl("profile").stdout == "  large\n* small\n", rigs.ctl("profile")
    assert rigs.ctl("profile", platform=None).stdout == "  large\n* small\n", "the only platform that has profiles"
    assert json.loads(rigs.ctl("--json", "profile").stdout) == {"ok": True, "platform": "ride", "active": "small", "profiles": ["large", "small"]}
    assert bench.heaved("--config", rigs.link, "--check").returncode == 0, "heaved reads the profile by the link"


def changes_in_off_and_settled_only(bench):
    rigs = Rigs(bench)
    assert rigs.ctl("profile", "small").returncode == 0
    bench.start(config=rigs.link)
    run = rigs.ctl("profile", "large")
    assert run.returncode == 0 and run.stdout == "profile: large, and heaved runs with it\n", run
    assert rigs.asked.read_text() == "restart heave@ride\n" and rigs.active() == "ride.d/large.ini"
    for request, state in (("park", "SETTLED"), ("engage", None)):
        assert bench.ctl(request).returncode == 0
        if state:
            bench.wait_state(state)
            assert rigs.ctl("profile", "small").returncode == 0
            assert rigs.active() == "ride.d/small.ini"
    bench.wait_state("RISING", "ENGAGED", "HOLD")
    run = rigs.ctl("profile", "large")
    assert run.returncode == 1 and "possible in OFF and SETTLED" in run.stderr, run
    assert rigs.active() == "ride.d/small.ini" and len(rigs.asked.read_text().splitlines()) == 2


def a_bad_one_changes_nothing(bench):
    rigs = Rigs(bench)
    assert rigs.ctl("profile", "small").returncode == 0
    text = (rigs.folder / "ride.d/large.ini").read_text()
    (rigs.folder / "ride.d/large.ini").write_text(text.replace("stroke_mm", "stroke_m", 1))
    run = rigs.ctl("profile", "large")
    assert run.returncode == 78 and "stroke_m" in run.stderr and "not taken" in run.stderr, run
    for wrong in ("none", "../ride", ".large", "small.ini"):
        run = rigs.ctl("profile", wrong)
        assert run.returncode == 66 and "heavectl profile lists" in run.stderr, run
    assert rigs.active() == "ride.d/small.ini"
    assert rigs.ctl("profile", platform="other").returncode == 66
    rigs.link.unlink()
    rigs.link.write_text(text)
    run = rigs.ctl("profile", "small")
    assert run.returncode == 1 and "is a file: move it into" in run.stderr and rigs.link.read_text() == text, run


def says_where_the_restart_fails(bench):
    rigs = Rigs(bench)
    rigs.play(1)
    bench.start()
    run = rigs.ctl("profile", "small")
    assert run.returncode == 69 and "systemctl restart heave@ride" in run.stderr, run
    assert rigs.active() == "ride.d/small.ini"


CASES = [
    ("profiles are listed and changed where no heaved runs", lists_and_changes_without_heaved),
    ("profiles change in OFF and SETTLED only, and the service starts anew", changes_in_off_and_settled_only),
    ("a profile that --check does not pass, or that is not there, changes nothing", a_bad_one_changes_nothing),
    ("where the service cannot be started anew, it is said", says_where_the_restart_fails),
]


def main():
    suite = tap.Suite()
    for name, case in CASES:
        with suite.case(name), harness.Bench(sys.argv[1], platform__engage="manual") as bench:
            case(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
