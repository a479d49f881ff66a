# SPDX-License-Identifier: MIT
"""unit_filter.py - the system calls that a unit of systemd allows, and a program that runs with these alone. systemd-analyze knows the groups."""
import ctypes
import os
import re
import shutil
import struct
import subprocess

import tap

PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2
LOAD, JUMP_IF_EQUAL, RETURN = 0x20, 0x15, 0x06  # of BPF, with a constant
ALLOW, KILL_PROCESS = 0x7FFF0000, 0x80000000


def groups():
    """{name: names in it}, which may be groups."""
    if shutil.which("systemd-analyze") is None:
        raise tap.Skip("systemd-analyze is not there")
    found, names = {}, []
    for line in subprocess.run(["systemd-analyze", "syscall-filter"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=True).stdout.splitlines():
        if line.startswith("@"):
            names = found[line.strip()] = []
        elif line.startswith("    ") and not line.strip().startswith("#"):
            names.append(line.strip())
    return found


def expand(name, found):
    return set().union(*(expand(member, found) for member in found[name])) if name.startswith("@") else {name}


def calls_of(unit):
    """(allowed, all that are known): SystemCallFilter= of a unit's text, the first line of which allows."""
    found = groups()
    allowed = expand("@default", found)
    for excludes, names in re.findall(r"(?m)^SystemCallFilter=(~?)(.*)$", unit):
        named = set().union(*(expand(name, found) for name in names.split()))
        allowed = allowed - named if excludes else allowed | named
    return allowed, set().union(*(expand(name, found) for name in found))


def numbers_of(names):
    text = subprocess.run(["gcc", "-dM", "-E", "-include", "sys/syscall.h", "-x", "c", os.devnull], stdout=subprocess.PIPE, text=True, check=True).stdout
    known = {name: int(number) for name, number in re.findall(r"(?m)^#define __NR_(\w+) (\d+)$", text)}
    return sorted(known[name] for name in names if name in known)


def within(unit):
    """For subprocess.Popen(preexec_fn=): from there on a call that the unit does not allow ends the process with SIGSYS."""
    numbers = numbers_of(calls_of(unit)[0])
    assert len(numbers) > 200, numbers
    steps = [(LOAD, 0, 0, 0)]  # the number of the call
    for number in numbers:
        steps += [(JUMP_IF_EQUAL, 0, 1, number), (RETURN, 0, 0, ALLOW)]
    steps.append((RETURN, 0, 0, KILL_PROCESS))
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    head = ctypes.create_string_buffer(struct.pack("@HP", len(steps), ctypes.addressof(program)))
    libc = ctypes.CDLL(None, use_errno=True)

    def install():
        assert program  # it has to stay
        if libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 or libc.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, head, 0, 0) != 0:
            os._exit(99)

    return install
