#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_service_vm.py - the Debian package under systemd in an emulated machine: service_guest.sh in a Debian that is all memory.

usage: test_service_vm.py [--deb FILE] [--root DIR]
  --deb   the package; default: what tools/package makes
  --root  a debootstrapped Debian 12 with the packages of PACKAGES; default: made once in the user's cache (root, network)

Takes minutes, so tools/test leaves it out; tools/nightly runs it, or run it by hand, as it is. Needs root (to unpack a system), qemu-system-x86_64, cpio, and the kernel of tools/lib/rt.sh.
"""
import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
sys.path[:0] = [str(TOP / "tests/lib"), str(TOP / "tests/check")]
import kernel  # noqa: E402  the path above has to be set first
import tap  # noqa: E402
import test_package  # noqa: E402

PACKAGES = "libinih1,libcjson1,libmnl0,libmodbus5,libgpiod2,systemd-sysv,dbus,udev,kmod,iproute2,procps"
QEMU = "qemu-system-x86_64"
LIMIT_S = 1500
TOLERANT = "no_timer_check nowatchdog rcupdate.rcu_cpu_stall_suppress=1"
UNNEEDED = ("usr/share/doc", "usr/share/man", "usr/share/locale", "usr/share/info", "usr/share/zoneinfo", "var/cache/apt", "var/lib/apt/lists", "usr/lib/udev/hwdb.bin", "usr/lib/udev/hwdb.d")
MASKED = ("systemd-modules-load.service", "systemd-logind.service", "getty.target", "e2scrub_reap.service", "systemd-udev-trigger.service", "timers.target")
# A chip that Debian's kernel has a driver for, which asks no more than the board's name (/drivers/platform/x86/pcengines-apuv2.c); there is nothing behind its lines.
MODULES = ("gpio-amd-fch", "pcengines-apuv2")
BOARD = ("-smbios", "type=1,manufacturer=PC Engines,product=apu2", "-smbios", "type=2,manufacturer=PC Engines,product=apu2")
UNIT = """[Unit]
After=multi-user.target
[Service]
Type=idle
ExecStart=/bin/bash /guest.sh
[Install]
WantedBy=multi-user.target
"""


def find_root():
    """A debootstrapped system in the cache."""
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "heave"
    root = cache / "system-bookworm-2"
    if not root.exists():
        if not shutil.which("debootstrap"):
            raise tap.Skip("no debootstrap")
        work = Path(tempfile.mkdtemp(prefix=".system.", dir=cache))
        run = subprocess.run(["debootstrap", "--variant=minbase", f"--include={PACKAGES}", "bookworm", work / "root"], stdin=subprocess.DEVNULL,
                             stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if run.returncode != 0:
            shutil.rmtree(work)
            raise tap.Skip(f"debootstrap: {run.stdout.strip().splitlines()[-1]}")
        (work / "root").rename(root)
        work.rmdir()
    return root


def find_modules(kernel_dir):
    """MODULES of the kernel's own package, in the cache; empty where it is not to be had."""
    release = Path(kernel_dir).name.removeprefix("rt-").rpartition("-")[0]
    cache = Path(kernel_dir).parent / f"gpio-{release}"
    files = [cache / f"{name}.ko" for name in MODULES]
    if not all(file.exists() for file in files):
        with tempfile.TemporaryDirectory(prefix="heave-modules-") as name:
            unpack = "tar -x --wildcards --no-anchored --transform='s,.*/,,' " + " ".join(f"'{module}.ko'" for module in MODULES)
            run = subprocess.run(f"apt-get -q download linux-image-{release} && dpkg-deb --fsys-tarfile linux-image-*.deb | {unpack}", shell=True, cwd=name,
                                 stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
            if run.returncode != 0:
                return []
            cache.mkdir(exist_ok=True)
            for file in files:
                shutil.copy(Path(name) / file.name, file)
    return files


def make_initramfs(system, deb, modules, folder):
    root = folder / "root"
    subprocess.run(["cp", "-a", system, root], check=True)
    for name in UNNEEDED:
        shutil.rmtree(root / name, ignore_errors=True) if (root / name).is_dir() else (root / name).unlink(missing_ok=True)
    shutil.copy(deb, root / "heave.deb")
    shutil.copy(test_package.later(deb, folder), root / "later.deb")
    shutil.copy(HERE / "service_guest.sh", root / "guest.sh")
    for module in modules:
        shutil.copy(module, root / module.name)
    (root / "etc/systemd/system/guest.service").write_text(UNIT, encoding="ascii")
    for name in MASKED:
        (root / "etc/systemd/system" / name).symlink_to("/dev/null")
    wants = root / "etc/systemd/system/multi-user.target.wants"
    wants.mkdir(exist_ok=True)
    (wants / "guest.service").symlink_to("../guest.service")
    (root / "init").symlink_to("usr/lib/systemd/systemd")
    with (folder / "initramfs").open("wb") as archive:
        subprocess.run("find . -print0 | cpio --quiet -0 -o -H newc", shell=True, cwd=root, stdout=archive, check=True)
    shutil.rmtree(root)
    return folder / "initramfs"


def boot(system, deb):
    kernel_dir = kernel.find("rt.sh")
    with tempfile.TemporaryDirectory(prefix="heave-vm-") as name:
        folder = Path(name)
        initramfs = make_initramfs(system, deb, find_modules(kernel_dir), folder)
        command_line = f"console=ttyS0 quiet panic=-1 {TOLERANT} systemd.show_status=0 TERM=dumb"
        status, console = kernel.bounded(
            ["setpriv", "--pdeathsig", "KILL", QEMU, "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-accel", "tcg", "-cpu",
             "qemu64,+rdrand", *BOARD, "-smp", "2", "-m", "1024", "-kernel", f"{kernel_dir}/vmlinux", "-initrd", initramfs, "-append", command_line,
             "-serial", "stdio", "-serial", f"file:{folder}/report"], LIMIT_S)
        return status, console, kernel.read(folder / "report").replace("\r", "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--deb", type=Path)
    parser.add_argument("--root", type=Path)
    arguments = parser.parse_args()
    for tool in (QEMU, "cpio", "dpkg-deb"):
        if not shutil.which(tool):
            print(f"1..0 # SKIP no {tool}")
            return 0
    if os.getuid() != 0:
        print("1..0 # SKIP unpacking a system takes root")
        return 0
    try:
        system = arguments.root or find_root()
        deb = arguments.deb or Path(test_package.checked(TOP / "tools/package").splitlines()[-1])
        status, console, report = boot(system, deb)
    except tap.Skip as reason:
        print(f"1..0 # SKIP {reason}")
        return 0
    print(report)
    if status != 0 or not re.search(r"^1\.\.\d+$", report, re.MULTILINE):
        print(f"not ok - the emulated machine: {f'not finished within {LIMIT_S} s' if status is None else f'ended with status {status}'}")
        print("\n".join(f"# {line}" for line in console.splitlines()[-60:]))
        return 1
    return 1 if re.search("^not ok", report, re.MULTILINE) else 0


if __name__ == "__main__":
    sys.exit(main())
