#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_service.py --build DIR - what is installed for a service manager: complete, accepted by systemd, and without privileges."""
import argparse
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import tap
import unit_filter

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "python"))
from heave.configuration import read_ini  # noqa: E402  the path above has to be set first

TOP = Path(__file__).resolve().parents[2]
PACKAGING = TOP / "packaging"
EXPOSURE_MAX = 18  # tenths of systemd's measure, 100 the worst
HELPER_EXPOSURE_MAX = 25  # of what runs as root for a moment


def installed(build, folder):
    subprocess.run(["cmake", "--install", str(build), "--prefix", "/usr"], env={"DESTDIR": str(folder), "PATH": "/usr/bin:/bin:/usr/local/bin"},
                   check=True, stdout=subprocess.DEVNULL)
    return {str(path.relative_to(folder / "usr")) for path in folder.rglob("*") if path.is_file()}


def analyze(*arguments):
    if shutil.which("systemd-analyze") is None:
        raise tap.Skip("systemd-analyze is not there")
    return subprocess.run(["systemd-analyze", *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)


def flush_takes_away(folder):
    """A file, a folder and a link to something else; `ip` is played."""
    requests, tools, kept = folder / "requests", folder / "tools", folder / "kept"
    for each in (requests, tools, kept):
        each.mkdir()
    (kept / "file").write_text("")
    request, log = requests / "flush-can7", folder / "ip.log"
    (tools / "ip").write_text(f'#!/bin/sh\n[ ! -e {request} ] && [ ! -L {request} ] || exit 1\necho "$@" >>{log}\n')
    (tools / "ip").chmod(0o755)
    makers = (lambda: request.write_text(""), lambda: (request.mkdir(), (request / "in it").mkdir()), lambda: request.symlink_to(kept))
    for make in makers:
        make()
        log.write_text("")
        run = subprocess.run(["sh", PACKAGING / "heave-can", "flush", "can7"], env={"PATH": f"{tools}:/usr/bin:/bin", "HEAVE_RUN": str(requests)},
                             stderr=subprocess.PIPE, text=True, check=False)
        assert run.returncode == 0 and log.read_text() == "link set can7 down\nlink set can7 up\n", (run.stderr, log.read_text())
    assert (kept / "file").exists()
    request.write_text("")  # and one that cannot be removed stops no flush
    (tools / "rm").write_text("#!/bin/sh\nexit 1\n")
    (tools / "rm").chmod(0o755)
    (tools / "ip").write_text(f'#!/bin/sh\necho "$@" >>{log}\n')
    log.write_text("")
    run = subprocess.run(["sh", PACKAGING / "heave-can", "flush", "can7"], env={"PATH": f"{tools}:/usr/bin:/bin", "HEAVE_RUN": str(requests)}, check=False)
    assert run.returncode == 1 and log.read_text() == "link set can7 down\nlink set can7 up\n", log.read_text()


def settling_s(config):
    """The longest stroke at engage speed, and both ramps."""
    ini = read_ini(config)
    speed, accel = (float(ini.get("engage", {}).get(key, default)) for key, default in (("speed_mm_s", 30), ("accel_mm_s2", 100)))
    return max(map(float, ini["geometry"]["stroke_mm"].split(","))) / speed + 2 * speed / accel


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--build", type=Path, required=True)
    build = parser.parse_args().build
    suite = tap.Suite()
    with tempfile.TemporaryDirectory(prefix="heave-") as name:
        folder = Path(name)
        with suite.case("programs, manual, completion, units, user and ready-made platforms are installed"):
            files = installed(build, folder)
            assert {"bin/heaved", "bin/heavectl", "lib/systemd/system/heave@.service", "lib/sysusers.d/heave.conf", "libexec/heave-can",
                    "lib/systemd/system/heave-can@.service", "lib/systemd/system/heave-can-flush@.path",
                    "share/man/man8/heaved.8.gz", "share/man/man1/heavectl.1.gz", "share/man/man5/heave.ini.5.gz",
                    "share/heave/presets/hexapod-400.ini", "share/heave/presets/tripod.ini", "share/bash-completion/completions/heaved", "share/bash-completion/completions/heavectl", "lib/modules-load.d/heave.conf", "lib/udev/rules.d/60-heave.rules", "share/doc/heave/examples/70-heave-can.link",
                    "share/doc/heave/examples/70-heave-can.network"} <= files, files
            assert any(file.endswith("demo-hexapod.ini") for file in files), files
        unit = folder / "heave@test.service"
        text = (build / "packaging/heave@.service").read_text(encoding="utf-8")
        # the programs are not where the unit will have them
        unit.write_text(re.sub(r"(?m)^ExecStart=\S+", "ExecStart=/bin/true", text), encoding="utf-8")
        with suite.case("systemd takes the unit without a word"):
            run = analyze("verify", unit)
            assert run.returncode == 0 and run.stdout.strip() == "", run.stdout
        with suite.case("systemd takes the units of the CAN interface without a word"):
            can_units = []
            for source in (build / "packaging/heave-can@.service", build / "packaging/heave-can-flush@.service", PACKAGING / "heave-can-flush@.path"):
                can_units.append(folder / source.name.replace("@", "@can0"))
                can_units[-1].write_text(re.sub(r"(?m)^ExecStart=\S+", "ExecStart=/bin/true", source.read_text(encoding="utf-8")), encoding="utf-8")
            run = analyze("verify", *can_units)
            assert run.returncode == 0 and run.stdout.strip() == "", run.stdout
        with suite.case(f"the service is exposed by {EXPOSURE_MAX / 10} of 10 at most, and holds no capability"):
            run = analyze("security", "--offline=true", f"--threshold={EXPOSURE_MAX}", unit)
            assert run.returncode == 0, run.stdout[-400:]
            assert re.search(r"(?m)^CapabilityBoundingSet=$", text) and "NoNewPrivileges=yes" in text
        with suite.case("systemd takes the unit of the panel without a word; it is exposed by as little, and has no capability and no device"):
            source = build / "packaging/heave-panel.service"
            if not source.exists():
                raise tap.Skip("built without the panel")
            panel = folder / source.name
            panel_text = source.read_text(encoding="utf-8")
            panel.write_text(re.sub(r"(?m)^ExecStart=\S+", "ExecStart=/bin/true", panel_text), encoding="utf-8")
            run = analyze("verify", panel)
            assert run.returncode == 0 and run.stdout.strip() == "", run.stdout
            run = analyze("security", "--offline=true", f"--threshold={EXPOSURE_MAX}", panel)
            assert run.returncode == 0, run.stdout[-400:]
            for line in ("CapabilityBoundingSet=", "PrivateDevices=yes", "DynamicUser=yes", "NoNewPrivileges=yes", "UMask=0077", "IPAddressDeny=any"):
                assert re.search(rf"(?m)^{line}$", panel_text), f"{line} is missing"
            assert "heave-panel" in " ".join(files) and not re.search(r"(?m)^Requires=|^BindsTo=|^PartOf=", panel_text), "it goes with no platform"
        with suite.case("neither program calls by its name what its unit ends it for"):
            for name, service, by_hand in (("heaved", unit, {"execv", "syscall"}), ("heave-panel", build / "packaging/heave-panel.service", {"fchown", "setrlimit", "syscall"})):
                if not (build / "bin" / name).exists():
                    continue
                allowed, known = unit_filter.calls_of(service.read_text(encoding="utf-8"))
                named = subprocess.run(["nm", "-D", "--undefined-only", build / "bin" / name], stdout=subprocess.PIPE, text=True, check=True).stdout
                called = {line.split()[-1].split("@")[0] for line in named.splitlines()}
                # glibc has execve and prlimit64 behind two of them; close_range, and the exit of a replay, are called by their numbers; passwd and replays are run by hand
                assert called & known - allowed == by_hand, (name, called & known - allowed)
                assert {"read", "close"} <= called & allowed, name
        with suite.case(f"what sets up and flushes a CAN interface is exposed by {HELPER_EXPOSURE_MAX / 10} of 10 at most"):
            for helper in can_units[:2]:
                run = analyze("security", "--offline=true", f"--threshold={HELPER_EXPOSURE_MAX}", helper)
                assert run.returncode == 0, f"{helper.name}: {run.stdout[-400:]}"
        with suite.case("a request to flush is taken away whatever it is, before the interface goes down"):
            flush_takes_away(folder)
        with suite.case("a wrong configuration or command line and an end by a second signal are no reason to start again; a crash and a port in use are"):
            final = set(re.search(r"(?m)^RestartPreventExitStatus=(.*)$", text)[1].split())
            assert {"1", "64", "66", "78"} <= final and not {"69", "70", "74"} & final, final
        with suite.case("a program that ends again and again is left alone in the end"):
            seconds = {name: int(re.search(rf"(?m)^{name}=(\d+)$", text)[1]) for name in ("StartLimitIntervalSec", "StartLimitBurst", "RestartSec", "WatchdogSec")}
            longest_s = seconds["RestartSec"] + 2 * seconds["WatchdogSec"]  # from one start to the next, also where it hangs
            assert 2 <= seconds["StartLimitBurst"] and seconds["StartLimitBurst"] * longest_s < seconds["StartLimitIntervalSec"], seconds
            assert re.search(r"(?m)^Restart=on-failure$", text)
        with suite.case("every ready-made platform settles in less time than a stop is given"):
            given_s = int(re.search(r"(?m)^TimeoutStopSec=(\d+)$", text)[1])
            for config in sorted((TOP / "config").glob("*.ini")):
                needed_s = settling_s(config)
                assert needed_s + 15 < given_s, f"{config.name}: {needed_s:.0f} s, {given_s} s are given"  # 15: drives that do not obey
        with suite.case("user, real time, devices and address families are as narrow as they can be"):
            for line in ("Type=notify", "WatchdogSec=2", "DynamicUser=yes", "Group=heave", "LimitRTPRIO=90", "LimitMEMLOCK=infinity", "DevicePolicy=closed",
                         "DeviceAllow=char-gpiochip rw", "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_CAN AF_NETLINK"):
                assert re.search(rf"(?m)^{line}$", text), f"{line} is missing"
            groups = re.findall(r"(?m)^g (\S+) -$", (PACKAGING / "heave.sysusers").read_text(encoding="ascii"))
            assert groups == ["heave", "heave-can"], "the group that the unit runs with, and the one that may have a bus flushed"
            assert re.search(r"(?m)^SupplementaryGroups=heave-can$", text) and "install -d -m 1770 -g heave-can /run/heave-can" in text
            assert re.search(r"(?m)^IPAddressDeny=any$", text) and re.search(r"(?m)^IPAddressAllow=localhost ", text) and re.search(r"(?m)^UMask=0027$", text)
        with suite.case("what a platform has beside its configuration is its own: it may run beside others"):
            for line in ("RuntimeDirectory=heave/%i", "StateDirectory=heave/%i"):
                assert re.search(rf"(?m)^{line}$", text), f"{line} is missing"
            assert "/heaved.sock" not in re.sub(r"(?m)^#.*$", "", text), "a path that all of them share"
        with suite.case("heaved may ask for a flush where the path unit looks, and the flush may take the request away"):
            asked = re.search(r'(?m)^#define RUN_DIR +"([^"]+)"', (TOP / "src/daemon/devices.c").read_text(encoding="utf-8"))[1]
            assert f"PathExists={asked}/flush-%i\n" in (PACKAGING / "heave-can-flush@.path").read_text(encoding="utf-8")
            assert f"ReadWritePaths=-{asked}\n" in (PACKAGING / "heave-can-flush@.service.in").read_text(encoding="utf-8")
            assert f"HEAVE_RUN:-{asked}}}/flush-" in (PACKAGING / "heave-can").read_text(encoding="utf-8")
            assert f"ReadWritePaths=-{asked}\n" in text and re.search(rf"(?m)^ExecStartPre=\+/usr/bin/install .* {asked}$", text)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
