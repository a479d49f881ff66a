#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_rt.py BIN - rt_guest.py in an emulated machine: Debian's PREEMPT_RT kernel, two CPUs, an initramfs of the files that the test takes.

Emulated whole, without KVM, so that it runs wherever there is a qemu-system-x86_64, for any user. Skipped where there is none, or no kernel.
"""
import importlib.util
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import heave
import kernel
import tap

HERE = Path(__file__).resolve().parent
PEERS = heave.TOP / "tests/peers"
GUEST = HERE / "rt_guest.py"
MODULES = ["can-dev", "can", "can-raw", "slcan"]
QEMU = "qemu-system-x86_64"
LIMIT_S = 850  # a minute where the machine has nothing else to do
# Checks of the kernel's that fail where the host gives no time to the emulator for a while.
TOLERANT = "no_timer_check nowatchdog rcupdate.rcu_cpu_stall_suppress=1"


class Archive:
    """A cpio archive (newc) as kernels unpack it: Documentation/driver-api/early-userspace/buffer-format.rst."""

    def __init__(self):
        self.bytes = bytearray()
        self.names = set()

    def add(self, name, mode, data=b"", time=0, device=(0, 0)):
        fields = (len(self.names) + 1, mode, 0, 0, 1, time, len(data), 0, 0, *device, len(name.encode()) + 1, 0)
        self.bytes += b"070701" + b"".join(b"%08x" % field for field in fields) + name.encode() + b"\0"
        self.pad()
        self.bytes += data
        self.pad()

    def pad(self):
        self.bytes += bytes(-len(self.bytes) % 4)

    def new(self, path):
        name = str(path).lstrip("/")
        is_new = name not in self.names
        self.names.add(name)
        return name if is_new else None

    def folder(self, path):
        for each in [*reversed(Path(path).parents), Path(path)]:
            name = self.new(each)
            if name:
                self.add(name, stat.S_IFDIR | 0o755)

    def file(self, path, source=None):
        self.folder(Path(path).parent)
        name = self.new(path)
        if name:
            about = os.stat(source or path)
            self.add(name, stat.S_IFREG | stat.S_IMODE(about.st_mode), Path(source or path).read_bytes(), int(about.st_mtime))

    def console(self):
        self.folder("/dev")
        self.add("dev/console", stat.S_IFCHR | 0o600, device=(5, 1))

    def done(self):
        self.add("TRAILER!!!", 0)
        return self.bytes


def libraries(program):
    listed = subprocess.run(["ldd", program], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False).stdout
    return re.findall(r"(/[^ ]+) \(0x", listed)


def python_files():
    """What Python needs in there: the modules that the guest's script and its drives import, compiled where they are."""
    listing = "import sys, encodings.ascii, encodings.latin_1, rt_guest; print(*{getattr(m, '__file__', 0) for m in sys.modules.values()}, sep='\\n')"
    run = subprocess.run([sys.executable, "-c", listing], stdout=subprocess.PIPE, text=True, check=True, env={**os.environ, "PYTHONPATH": search_path()})
    for line in run.stdout.splitlines():
        if line.startswith("/"):
            yield line
            compiled = line.endswith(".py") and importlib.util.cache_from_source(line)
            if compiled and os.path.exists(compiled):
                yield compiled


def search_path():
    return f"{HERE}:{heave.TOP / 'tests/lib'}:{PEERS}"


def initramfs(bin_dir, kernel_dir, python):
    archive = Archive()
    programs = [python, f"{bin_dir}/heaved", f"{bin_dir}/heavectl"]
    guard = Path(bin_dir).resolve().parent / "tests/system/libmalloc_guard.so"  # where a Bench looks for it
    for path in [*programs, guard, *python_files(), *heave.TOP.glob("config/*.ini")]:
        archive.file(path)
        if os.access(path, os.X_OK) or str(path).endswith(".so"):
            for library in libraries(path):
                archive.file(library)
    for module in MODULES:
        archive.file(f"/modules/{module}.ko", f"{kernel_dir}/{module}.ko")
    for folder in ("/proc", "/sys", "/run", "/tmp"):
        archive.folder(folder)
    archive.console()
    return archive.done()


def boot(bin_dir, kernel_dir):
    """The status and what both serial lines said: the kernel, the report."""
    python = os.path.realpath(sys.executable)
    with tempfile.TemporaryDirectory(prefix="heave-rt-") as name:
        folder = Path(name)
        (folder / "initramfs").write_bytes(initramfs(bin_dir, kernel_dir, python))
        command_line = f"console=ttyS0 quiet panic=-1 {TOLERANT} PYTHONPATH={search_path()} PYTHONDONTWRITEBYTECODE=1 PYTHONUTF8=1 rdinit={python} -- {GUEST} {bin_dir}"
        status, output = kernel.bounded(
            ["setpriv", "--pdeathsig", "KILL", QEMU, "-nodefaults", "-no-user-config", "-display", "none", "-no-reboot", "-accel", "tcg", "-cpu", "qemu64,+rdrand",
             "-smp", "2", "-m", "512", "-kernel", f"{kernel_dir}/vmlinux", "-initrd", folder / "initramfs", "-append", command_line,
             "-serial", "stdio", "-serial", f"file:{folder}/report"], LIMIT_S)
        return status, output, kernel.read(folder / "report").replace("\r", "")


def main():
    if not shutil.which(QEMU):
        print(f"1..0 # SKIP no {QEMU} (package qemu-system-x86)")
        return 0
    try:
        kernel_dir = kernel.find("rt.sh")
    except tap.Skip as reason:
        print(f"1..0 # SKIP {reason}")
        return 0
    status, console, report = boot(sys.argv[1], kernel_dir)
    print(report)
    if status != 0 or not re.search(r"^1\.\.\d+$", report, re.MULTILINE):
        print(f"not ok - the emulated machine: {'not finished within %d s' % LIMIT_S if status is None else 'ended with status %d' % status}")
        print("\n".join(f"# {line}" for line in console.splitlines()[-60:]))
        return 1
    return 1 if re.search("^not ok", report, re.MULTILINE) else 0


if __name__ == "__main__":
    sys.exit(main())
