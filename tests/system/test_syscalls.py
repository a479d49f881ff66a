#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_syscalls.py BIN JUDGE [PART OF A NAME] - every place in the programs and hal/linux that asks the system for something is refused.

The places are read from the programs themselves (objdump, addr2line), so that a new one is tried, or named here as not reached, or fails the test;
a new function that is called has to be put into a list. failing_calls.c, preloaded, makes one place at a time fail with each errno that
matters for its function, and malloc_guard.c watches the paths that this opens. What must hold, whatever fails:
- nothing crashes, nothing hangs, the exit code is a documented one, and one that is not 0 comes with a line that says why;
- a platform that runs goes on, or ends as documented; its set-points keep every limit, judged by JUDGE (tests/judge).
What hal/linux asks for has failed with every errno already in tests/contract/test_*_failures, where the system is played: these are run first, and
say which places that were. Here one errno is left for each that heaved reaches. BIN: of heaved and heavectl.
"""
import collections
import contextlib
import errno
import grp
import hashlib
import json
import mmap
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import harness
import tap
from twin_bench import TwinBench

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools/lib"))
import rooms  # noqa: E402  the path above has to be set first

SANE_EXITS = {0, 1, 64, 65, 66, 69, 70, 73, 74, 78}
FOR_EVER = 1 << 40
TIMES = 3  # for what is tried again
PASSING = {"EINTR", "EAGAIN"}  # the system never goes on saying so
LIMIT_S = 60

# What cannot fail, or asks nobody, or only looks into memory.
HARMLESS = set("""
atan2 bcmp feof hypot memrchr sin cos strcasecmp strcasestr strncasecmp strcpy stpcpy strnlen __ctype_b_loc __ctype_toupper_loc __cxa_finalize __errno_location __stack_chk_fail abort fmax fmin llround lround log10 pow remainder sqrt sincos mbrtowc memchr memcmp memcpy memmove memset strchr strcmp
strcspn strerror strerrorname_np strlen strncat strncmp strncpy strpbrk strrchr strspn strstr strtod strtok strtok_r strtoll strtoul strtoull wcwidth snprintf vsnprintf gmtime_r localtime_r inet_ntop inet_pton qsort
__libc_current_sigrtmax getenv putenv rewind dl_iterate_phdr getopt_long gai_strerror ferror fileno free raise syscall freeaddrinfo pthread_self pthread_attr_destroy pthread_attr_init pthread_cond_broadcast pthread_cond_init pthread_cond_timedwait pthread_condattr_destroy pthread_condattr_init pthread_condattr_setclock pthread_attr_setinheritsched
pthread_attr_setschedparam pthread_attr_setschedpolicy pthread_attr_setstacksize pthread_equal pthread_mutex_init pthread_mutex_lock pthread_mutex_unlock
pthread_join pthread_sigmask sigaction sigaddset sigemptyset sigfillset signal getpid time clock_gettime setvbuf setlocale nl_langinfo isatty munlockall ini_parse_stream
mnl_attr_get_payload mnl_attr_get_payload_len mnl_attr_get_type mnl_attr_parse mnl_attr_parse_nested mnl_attr_put_strz mnl_nlmsg_get_payload
mnl_nlmsg_put_extra_header mnl_nlmsg_put_header mnl_cb_run mnl_socket_get_fd mnl_socket_get_portid modbus_free modbus_get_socket modbus_set_byte_timeout
modbus_set_response_timeout modbus_set_slave modbus_rtu_set_rts_delay gpiod_chip_label gpiod_chip_num_lines gpiod_line_consumer gpiod_line_is_used gpiod_line_name
""".split())
# Whose result nobody could do anything with: the file is gone, the pause was short. Formatted output fails into its stream, which is asked at its end.
UNUSED = set("close renameat closedir munmap nanosleep gpiod_chip_close mnl_socket_close modbus_close fprintf vfprintf printf fputc putchar fputs puts fwrite".split())

# Not tried here, by file and function, and why.
ELSEWHERE = {("metrics.c", "unlink"): "tidies up after another failure; the next second tries again",
             ("atomic_file.c", "unlink"): "tidies up after another failure, which is what is told",
             ("main.c", "setrlimit"): "only where few descriptors are allowed; test_beside.py allows few",
             ("same_file.c", "stat"): "what cannot be looked at cannot be opened either, which is told then",
             ("standard_descriptors.c", "open"): "only where a standard descriptor is closed; test_beside.py closes them",
             ("operator_log.c", "rename"): "when the file is full: the old one goes on, see tests/unit/test_operator_log.c",
             ("operator_log.c", "ftruncate"): "when half a line went in: see there",
             ("state_file.c", "unlink"): "tidies up after another failure, which is what is told",
             ("output_file.c", "poll"): "when a pipe is full at the end",
             **{("hold.c", function): "only while a person holds a key; test_service_mode.py stops, kills and cuts it off" for function in ("fflush", "send", "recv", "read", "poll")},
             **{(file, function): "only with a person at a terminal; test_selftest.py kills it there, and gives it a report that cannot be written"
                for file in ("selftest.c", "heaved_link.c", "selftest_report.c", "identify.c", "identify_report.c")
                for function in ("calloc", "fclose", "fflush", "fopen", "fsync", "rename", "unlink", "connect", "poll", "read", "recv", "send", "socket", "tcflush")},
             ("control_configuration.c", "fflush"): "into memory, without a buffer",
             ("config_store.c", "unlink"): "tidies up after another failure, which is what is told",
             ("drive_dcf.c", "unlink"): "tidies up after another failure, which is what is told",
             ("rig_profile.c", "unlink"): "makes room, or tidies up: where it mattered, what comes after it fails, and is told",
             **{("setup_session.c", function): "tidies up a folder that the next boot empties" for function in ("unlink", "rmdir")},
             ("setup_session.c", "waitpid"): "an error says that there is no child any more, which is what is waited for",
             **{("setup_motion.c", function): "only while a person holds a key; test_setup.py kills it there, and lets go" for function in ("fflush", "poll", "read")},
             **{("linux_can_local.c", function): "the bus to heave-twin; test_twin.py takes its other side away" for function in ("socket", "connect", "send", "recv")},
             ("linux_modbus_link.c", "tcflush"): "its result is not used"}

MEMORY, FILES = ["ENOMEM"], ["EACCES", "ENOENT", "EMFILE", "EIO"]
DISK = ["ENOSPC", "EIO", "EDQUOT"]
MODBUS = ["ETIMEDOUT", "ECONNRESET", "EIO", "EBADF", 112345688 + 11]  # the last one: EMBXGTAR, an exception of the device
ERRNOS = {
    "adjtimex": ["EPERM"], "accept4": ["EMFILE", "ECONNABORTED", "EINTR", "EAGAIN"], "access": ["EACCES", "EROFS"], "bind": ["EADDRINUSE", "EACCES", "EADDRNOTAVAIL", "ENODEV"],
    "calloc": MEMORY, "malloc": MEMORY, "realloc": MEMORY, "chmod": ["EPERM", "EROFS"], "clock_nanosleep": ["EINTR", "EINVAL"],
    "fork": ["EAGAIN", "ENOMEM"], "prctl": ["EINVAL"], "waitpid": ["EINTR"], "connect": ["ECONNREFUSED", "EACCES", "ENOENT", "EAGAIN"], "dup3": ["EBUSY", "EMFILE"], "execv": ["ENOENT", "ENOMEM"], "eventfd": ["EMFILE", "ENOMEM"], "fchmod": ["EPERM", "EIO"], "fcntl": ["EBADF"], "fclose": DISK, "fdatasync": DISK, "ftruncate": DISK, "getgrnam": ["ENOENT", "EIO", "EMFILE"], "fflush": DISK,
    "fdopen": MEMORY, "fgets": ["EIO"], "fmemopen": MEMORY, "fopen": FILES, "memfd_create": ["EMFILE", "ENOMEM"], "mmap": MEMORY, "scandir": ["ENOENT", "ENOMEM"], "sendmsg": ["EPIPE", "EAGAIN", "EINTR"], "fread": ["EIO"], "readlink": ["ENOENT", "EACCES"], "fstat": ["EIO"], "fsync": DISK, "getaddrinfo": [-3, -10], "getrlimit": ["EFAULT"], "getrusage": ["EINVAL"], "setrlimit": ["EPERM"],
    "getsockname": ["ENOBUFS"], "getsockopt": ["ENOBUFS"], "if_nametoindex": ["ENODEV", "EMFILE"], "ioctl": ["EIO", "ENODEV", "ENOTTY", "EBUSY", "EPERM"], "link": ["EACCES", "ENOSPC"], "listen": ["EADDRINUSE"],
    "lstat": ["EACCES", "ENOENT"], "mkdir": ["EACCES", "ENOSPC", "EROFS"], "mlockall": ["EPERM", "ENOMEM"], "open": [*FILES, "ENOSPC", "EROFS", "EINTR"],
    "open_memstream": MEMORY, "opendir": FILES, "poll": ["EINTR", "ENOMEM"], "ppoll": ["EINTR", "ENOMEM"], "pread": ["EIO"], "pwrite": ["ENOSPC", "ENOMEM"], "pthread_create": ["EAGAIN", "EPERM"],
    "pthread_setschedparam": ["EPERM"], "pthread_timedjoin_np": ["ETIMEDOUT"], "read": ["EINTR", "EAGAIN", "EIO"], "readdir": ["EIO"], "readlink": ["EACCES", "ENOENT"],
    "realpath": ["EACCES", "ENOENT", "ELOOP"], "recv": ["ECONNRESET", "EINTR", "EAGAIN"],
    "recvmmsg": ["EINTR", "EAGAIN", "ENETDOWN", "ENOMEM", "ENODEV", "ENOBUFS"],
    "recvmsg": ["EINTR", "EAGAIN", "ENETDOWN", "ENOMEM", "ENODEV", "ENOBUFS", "ECONNREFUSED"], "rename": ["ENOSPC", "EACCES", "EIO"], "rmdir": ["ENOTEMPTY", "EACCES"],
    "sched_setscheduler": ["EPERM"], "send": ["EPIPE", "EAGAIN", "EINTR", "ENOBUFS", "ENETDOWN", "ENXIO", "EIO"], "sendto": ["ENOENT", "ECONNREFUSED", "EAGAIN", "EINTR", "ENOBUFS"],
    "setsockopt": ["ENOMEM", "EPERM", "ENOPROTOOPT"], "signalfd": ["EMFILE", "ENOMEM"], "sigprocmask": ["EINVAL"], "socket": ["EMFILE", "ENOMEM", "EACCES", "EAFNOSUPPORT"],
    "stat": ["EACCES", "ENOENT"], "symlink": ["EACCES", "EEXIST", "ENOSPC"], "tcflush": ["EIO"], "uname": ["EFAULT"], "unlink": ["EACCES", "EROFS", "EBUSY"], "write": ["EINTR", "EAGAIN", *DISK, "EPIPE"],
    "gpiod_chip_get_line": ["EINVAL"], "gpiod_chip_open": ["EACCES", "ENODEV", "EMFILE"], "gpiod_line_event_get_fd": ["EPERM"],
    "gpiod_line_event_read_multiple": ["EIO", "ENODEV", "EAGAIN"], "gpiod_line_get_value_bulk": ["EIO", "ENODEV"], "gpiod_line_request_bulk": ["EBUSY", "EINVAL", "ENOMEM"],
    "gpiod_line_set_value_bulk": ["EIO", "ENODEV"], "mnl_socket_bind": ["ENOMEM"], "mnl_socket_open2": ["EMFILE", "EAFNOSUPPORT"],
    "mnl_socket_recvfrom": ["ENOBUFS", "EINTR", "EAGAIN"], "mnl_socket_sendto": ["ENOBUFS", "EPERM"],
    "modbus_connect": ["ECONNREFUSED", "ETIMEDOUT", "EHOSTUNREACH", "EMFILE", "ENOENT", "EACCES", "EBUSY"], "modbus_flush": ["EIO"], "modbus_new_rtu": MEMORY,
    "modbus_new_tcp": MEMORY, "modbus_read_bits": MODBUS, "modbus_read_input_bits": MODBUS, "modbus_read_input_registers": MODBUS, "modbus_read_registers": MODBUS,
    "modbus_rtu_set_rts": ["EIO"], "modbus_rtu_set_serial_mode": ["ENOTTY"], "modbus_send_raw_request": MODBUS, "modbus_write_bit": MODBUS, "modbus_write_bits": MODBUS,
    "modbus_write_register": MODBUS, "modbus_write_registers": MODBUS,
}


def number_of(error):
    return error if isinstance(error, int) else getattr(errno, error)


# --- The places ---

Place = collections.namedtuple("Place", "file line function returns")


def tool(*command):
    return subprocess.run(list(map(str, command)), stdout=subprocess.PIPE, text=True, check=True).stdout


def instructions(program):
    """Of objdump: (start of the function, address of the next instruction, call or jump, target, name of the target)"""
    start, held = 0, None
    for line in tool("objdump", "-d", "--no-show-raw-insn", program).splitlines():
        head = re.match(r"([0-9a-f]+) <[^>]+>:$", line)
        code = re.match(r"\s+([0-9a-f]+):\s+(\S+)(?:\s+([0-9a-f]+) <([^>+]+)>)?", line)
        if code and held:
            yield (held[0], int(code[1], 16), *held[1:])
        held = None
        if head:
            start = int(head[1], 16)
        elif code and code[4] and (code[2] in ("call", "bl", "b") or code[2].startswith("jmp")):
            held = start, "call" if code[2] in ("call", "bl") else "jump", int(code[3], 16), code[4]


def places_of(program, wanted):
    """Every call of these functions in our sources; and the names of all others that are called from there."""
    callers, found, others = collections.defaultdict(list), [], set()
    for start, following, kind, target, name in instructions(program):
        if kind == "call":
            callers[target].append(following)
        function = name.removesuffix("@plt")
        if function != name:
            if function in wanted:
                found.append((start, following, kind, function))
            else:
                others.add(function)
    lines = [line.split(" ")[0] for line in tool("addr2line", "-e", program, *(hex(following - 1) for _, following, _, _ in found)).splitlines()]
    places = collections.defaultdict(list)
    for (start, following, kind, function), where in zip(found, lines):
        ours = re.search(rf"/(src/(?:{'|'.join(rooms.PROGRAMS)})|hal/linux)/([^/]+):(\d+)$", where)
        if ours:  # of what a function ends with, the caller hears
            places[ours[2], int(ours[3]), function] += [following] if kind == "call" else callers[start]
    return [Place(*key, tuple(returns)) for key, returns in sorted(places.items())], others


class Page:
    """The memory shared with failing_calls.c."""

    HEAD, NAME, MOST = "<QQQQ48s", 48, 64
    SEEN_AT = 32 + 48 + 64 * 8
    SIZE = 4 * mmap.PAGESIZE

    def __init__(self, bench):
        folder = bench.bin.resolve().parent / "tests/system"
        self.fd = os.memfd_create("failures")
        os.ftruncate(self.fd, Page.SIZE)
        self.memory = mmap.mmap(self.fd, Page.SIZE)
        self.options = {"pass_fds": (self.fd,), "env": {**os.environ, "LC_ALL": "C", "HEAVE_FAILURES": str(self.fd),
                                                         "LD_PRELOAD": f"{folder}/libfailing_calls.so:{folder}/libmalloc_guard.so"}}

    def close(self):
        self.memory.close()
        os.close(self.fd)

    def set(self, place, error, times=None):
        self.clear()
        assert len(place.returns) <= Page.MOST, place
        struct.pack_into("<QQQ", self.memory, 8, 0, number_of(error) & 0xFFFFFFFFFFFFFFFF, len(place.returns))
        self.memory[32:32 + 48] = place.function.encode().ljust(48, b"\0")
        struct.pack_into(f"<{len(place.returns)}Q", self.memory, 80, *place.returns)
        struct.pack_into("<Q", self.memory, 0, times or (TIMES if error in PASSING else FOR_EVER))

    def clear(self):
        struct.pack_into("<Q", self.memory, 0, 0)

    def failed(self):
        return struct.unpack_from("<Q", self.memory, 8)[0]

    def seen(self, forget=False):
        count = struct.unpack_from("<Q", self.memory, Page.SEEN_AT)[0]
        assert count <= 1900, "more places than failing_calls.c has room for"
        seen = set(struct.unpack_from(f"<{count}Q", self.memory, Page.SEEN_AT + 8))
        if forget:
            struct.pack_into("<Q", self.memory, Page.SEEN_AT, 0)
        return seen


class Story:
    """What was tried at which place, over all cases."""

    def __init__(self):
        self.tried, self.played = set(), set()
        self.count = 0

    def note(self, place, page):
        if page.failed():
            self.tried.add(place[:3])
            self.count += 1


STORY = Story()


def trials(places, seen, but=()):
    """Each place that was reached, with each error."""
    for place in places:
        is_wanted = place[:3] not in but and (place.file, place.function) not in ELSEWHERE
        if is_wanted and seen & set(place.returns):
            for error in ERRNOS[place.function][:1 if place[:3] in STORY.played else None]:
                yield place, error


def name_of(place, error):
    return f"{place.file}:{place.line}: {place.function}: {error}"


class Troubles(list):
    """What was not as it should be; all of it is told."""

    def judge(self, condition, text):
        if not condition:
            self.append(text)

    def done(self):
        assert not self, f"{len(self)}: " + "\n".join(self)


# --- Programs that run to their end ---

def run_into_a_full_pipe(page, command):
    """Standard output does not block, and is read slowly."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=writing, stderr=subprocess.PIPE, text=True, **page.options) as process:
        os.close(writing)
        time.sleep(0.2)
        with open(reading, "rb") as pipe:
            while pipe.read(1 << 16):
                pass
        return process.wait(LIMIT_S), "", process.stderr.read()


def run_to_end(page, command, **options):
    if command[-1] == "-":
        return run_into_a_full_pipe(page, command)
    run = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=LIMIT_S,
                         check=False, **page.options, **options)
    return run.returncode, run.stdout, run.stderr


def judge_end(troubles, what, code, stderr, is_silent=False):
    troubles.judge(code in SANE_EXITS and (code == 0 or is_silent or stderr.strip()), f"{what}: exit {code}: {stderr.strip()[-600:]}")


def replay_of(bench):
    """Of a run that goes on from what heaved knew: a dump in OFF begins with it."""
    config = bench.write_config("boxed.ini", platform__engage="manual")
    config.write_text(f"{config.read_text()}\n[black-box]\ndirectory = {bench.folder / 'incidents'}\n")
    daemon = bench.start(config=config)
    folder = bench.ask("dump")[0]["folder"]
    assert bench.stop(daemon) == 0
    frames = Path(folder) / "frames"
    assert " !state " in frames.read_text(encoding="utf-8")
    return [bench.bin / "heaved", "--config", config, "--play", frames, "--trace", bench.folder / "replayed.csv"]


def commands_of(bench):
    frames = bench.file("frames.txt", "0 !engage\n3000 @A6:0,0,0,0,0,5,0#\n3500 !park\n")
    raw = harness.TOP / "config/can-raw-hexapod.ini"
    head = [bench.bin / "heaved", "--config"]
    return [[*head, bench.config, "--check"], [*head, bench.config, "--check", "--json"], [bench.bin / "heaved", "--keys"], [*head, bench.config, "--dump-config"], [*head, raw, "--dump-dbc"],
            [*head, bench.config, "--envelope", bench.file("old.csv", "old")], [*head, bench.config, "--envelope", bench.folder / "new.csv"],
            [*head, bench.config, "--envelope", "/dev/null"],
            [*head, bench.config, "--play", frames, "--trace", bench.folder / "played.csv"],
            [*head, bench.config, "--play", frames, "--trace", "-"], replay_of(bench), [*head, bench.config, "--doctor"],
            [*head, harness.TOP / "config/hexapod-cia402.ini", "--doctor"], [bench.bin / "heaved", "--presets"], [bench.bin / "heaved", "--scan", "nobus0"],
            [bench.bin / "heaved", "--scan", "/dev/null"],
            [*head, harness.TOP / "config/hexapod-cia402.ini", "--check", "--eds", bench.file("drive.eds", "[1000]\nParameterName=type\nDataType=0x0007\nAccessType=ro\n")]]


def offline(bench, places, _judge):
    page, troubles = Page(bench), Troubles()
    for command in commands_of(bench):
        page.clear()
        page.seen(forget=True)
        run_to_end(page, command)
        for place, error in trials(places, page.seen(), STORY.tried):
            page.set(place, error)
            code, stdout, stderr = run_to_end(page, command)
            judge_end(troubles, f"{name_of(place, error)}: {' '.join(map(str, command[1:]))}", code, stderr,
                      is_silent={"--doctor", "--eds", "--scan"} & set(map(str, command)) and stdout.strip())
            STORY.note(place, page)
    page.close()
    troubles.done()


# --- heavectl ---

def run_on_a_terminal(page, command):
    ours, its = os.openpty()
    shown = b""
    with subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=its, stderr=subprocess.PIPE, text=True, **page.options) as process:
        os.close(its)
        with contextlib.suppress(OSError), open(ours, "rb", buffering=0) as terminal:  # an error is its end
            while more := terminal.read(1 << 16):
                shown += more
        return process.wait(LIMIT_S), shown.decode(errors="replace"), process.stderr.read()


def interrupt(troubles, page, sends, command):
    """Ctrl-C while a request that signals interrupt is sent anew ends it as Ctrl-C does at any other time."""
    assert sends
    for place in sends:
        page.set(place, "EINTR", FOR_EVER)
        with subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **page.options) as process:
            harness.wait_for(lambda: page.failed() > TIMES, "the request is sent anew")
            process.send_signal(signal.SIGINT)
            _, stderr = process.communicate(timeout=LIMIT_S)
        troubles.judge(process.returncode == 0 and not stderr, f"Ctrl-C in {name_of(place, 'EINTR')}: exit {process.returncode}: {stderr.strip()[-300:]}")


Told = collections.namedtuple("Told", "code stdout stderr")


def is_told_of(place, error, told):
    """By a line of its own, or one of a file that was read; with the system's word, where that is all there is to say."""
    is_named = place.function not in ("poll", "recv") or error == "ECONNRESET" or os.strerror(number_of(error)) in told.stderr
    return told.code in SANE_EXITS - {0} and re.search(r"^heavectl: |^/[^:]+:\d+: ", told.stderr, re.MULTILINE) and is_named


def try_all(troubles, page, places, run, command, *, prepare=lambda: None, is_whole=lambda _: True, is_right=None):
    """@param prepare puts back what a run may have changed @param is_whole what must hold of the files afterwards @param is_right of (place, error, told, expected)"""
    is_right = is_right or (lambda place, error, told, expected: is_told_of(place, error, told) or (told.code == expected.code == 0 and told.stdout))
    prepare()
    page.clear()
    page.seen(forget=True)
    expected = Told(*run(page, command))
    for place, error in trials(places, page.seen(), STORY.tried):
        prepare()
        page.set(place, error)
        told = Told(*run(page, command))
        page.clear()
        what = f"{name_of(place, error)}: {' '.join(map(str, command[1:]))}: exit {told.code}"
        troubles.judge(is_right(place, error, told, expected), f"{what}: {told.stderr.strip()[-300:]} {told.stdout[-300:]}")
        troubles.judge(is_whole(told), f"{what}: files are not as they should be: {told.stderr.strip()[-300:]}")
        STORY.note(place, page)
    return expected


def control(bench, _places, _judge):
    """What fails is told of with an exit code that is not 0, or does not matter: then the answer is there all the same."""
    page, troubles = Page(bench), Troubles()
    places = places_of(bench.bin / "heavectl", wrapped(bench))[0]
    named = ["--socket", bench.socket]
    bench.start()
    for run, *arguments in ((run_to_end, "status", *named), (run_to_end, "status", "--json", *named), (run_to_end, "watch", "--for", "0.2", *named),
                            (run_on_a_terminal, "watch", "--for", "0.2", *named), (run_to_end, "scope", "--for", "0.2", *named),
                            (run_to_end, "counts", *named), (run_on_a_terminal, "counts", "--for", "0.2", *named), (run_to_end, "presets"), (run_to_end, "intensity", "50", *named), (run_to_end, "--help"),
                            (run_to_end, "--version"), (run_to_end, "status")):
        try_all(troubles, page, places, run, [bench.bin / "heavectl", *arguments])
    for tell in (in_chinese, profiles, one_drive, setup):
        tell(bench, page, troubles, places)
    interrupt(troubles, page, [place for place in places if (place.file, place.function) == ("connection.c", "send")], [bench.bin / "heavectl", "watch", *named])
    page.close()
    troubles.done()
    left = missing(places)
    assert not left, "\n".join(f"{place.file}:{place.line}: {place.function}" for place in left)


@contextlib.contextmanager
def environment(page, **changes):
    before = page.options["env"]
    page.options["env"] = {**before, **{name: str(value) for name, value in changes.items()}}
    yield
    page.options["env"] = before


def in_chinese(bench, page, troubles, places):
    """A catalogue that cannot be read: English, and on it goes."""
    def is_english(_place, _error, told, expected):
        return told.code == expected.code == 0 and told.stdout and told.stdout.isascii() and not told.stderr

    with environment(page, LC_ALL="zh_CN.UTF-8", HEAVE_LOCALES=bench.bin.resolve().parent / "locale"):
        expected = try_all(troubles, page, places, run_to_end, [bench.bin / "heavectl", "--help"], is_right=is_english)
    assert not expected.stdout.isascii(), "there is no catalogue to lose"


def profiles(bench, page, troubles, places):
    """Two profiles of a platform that does not run, and a systemctl that is played; the profile of before is there, or the new one."""
    folder, tools = bench.folder / "etc", bench.folder / "tools"
    link, running = folder / "ride.ini", [bench.bin / "heavectl", "--socket", bench.folder / "nobody"]
    (folder / "ride.d").mkdir(parents=True)
    tools.mkdir()
    for name in ("small", "large"):
        (folder / f"ride.d/{name}.ini").write_bytes(bench.config.read_bytes())
    (tools / "systemctl").write_text("#!/bin/sh\nexit 0\n", encoding="ascii")
    (tools / "systemctl").chmod(0o755)

    def prepare():
        for file in folder.glob("ride.ini*"):
            file.unlink()
        link.symlink_to("ride.d/small.ini")

    def is_whole(told):
        return os.readlink(link) == ("ride.d/large.ini" if told.code == 0 and "profile: large" in told.stdout else "ride.d/small.ini") and not (folder / "ride.ini.new").exists()

    with environment(page, HEAVE_CONFIG_DIRECTORY=folder, PATH=f"{tools}:{bench.bin}:{os.environ['PATH']}"):
        for arguments in (["profile"], ["--json", "profile"], ["--platform", "ride", "profile", "large"]):
            try_all(troubles, page, places, run_to_end, [*running, *arguments], prepare=prepare, is_whole=is_whole)


def one_drive(bench, page, troubles, places):
    """Of a heave-twin: what it is, its settings saved and compared. A file is whole, or not there."""
    with TwinBench(bench.bin, platform__engage="manual") as rig:
        (rig.folder / "kept").mkdir()
        rig.start_twin()
        rig.start(environment={"STATE_DIRECTORY": str(rig.folder / "kept")})
        harness.wait_for(lambda: rig.status()["cylinders"][2]["drive"] == "disabled", "the drives are set up")
        saved, whole = rig.folder / "saved.dcf", rig.folder / "whole.dcf"
        eds = rig.file("drive.eds", "[6083]\nParameterName=acceleration\nDataType=0x0007\nAccessType=rw\n")
        assert rig.ctl("--save", whole, "drive", "3").returncode == 0
        ctl = [bench.bin / "heavectl", "--socket", rig.socket]
        for arguments in (["drive", "3"], ["sdo", "3", "6083"], ["--compare", whole, "drive", "2"], ["config"], ["--json", "config"], ["config", rig.file("other.ini", rig.config.read_bytes() + b"; other\n")]):
            try_all(troubles, page, places, run_to_end, [*ctl, *arguments])
        for arguments in ([], ["--eds", eds]):
            try_all(troubles, page, places, run_to_end, [*ctl, "--save", saved, *arguments, "drive", "3"], prepare=lambda: saved.unlink(missing_ok=True),
                    is_whole=lambda told: saved.exists() == (told.code == 0))


# --- heavectl setup ---

def run_and_type(*lines):
    """Types all of it at once; whatever is asked then is answered with \"quit\"."""
    def run(page, command):
        ours, its = os.openpty()
        os.write(ours, "".join(f"{line}\n" for line in (*lines, *["quit"] * 4)).encode())
        done = subprocess.run(list(map(str, command)), stdin=its, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=LIMIT_S, check=False, **page.options)
        os.close(its)
        os.close(ours)
        return done.returncode, done.stdout, done.stderr
    return run


BEGUN = [["start", "hexapod-cia402"], ["start.found", "hexapod cia402"], ["kind", "hexapod"], ["driver", "cia402"], ["geometry", "k"], ["geometry.check", "right"]]
LAST = [["start", "hexapod-400"], ["start.found", "hexapod sim"], ["kind", "hexapod"], ["driver", "sim"], ["geometry", "k"], ["geometry.check", "right"], ["limits", "shown"],
        ["limits.take", "k"], ["relays.kind", "g"], ["relays.lines", "NO-SUCH-LINE"], ["switches.kind", "n"]]  # heaved ends at once, and says why


def setup(bench, page, troubles, places):
    """As far as nobody has to look or to hold a key. What fails is on the screen, or changes nothing; answers that were given are kept."""
    file = bench.folder / "mine.ini"
    state = bench.folder / "mine.ini.setup"

    def story(answers, *lines, there=None):
        def prepare():
            state.unlink(missing_ok=True)
            file.unlink(missing_ok=True)
            if there:
                file.write_text(there, encoding="utf-8")
            if answers:
                state.write_text(json.dumps({"heave_setup": 1, "answers": answers}), encoding="utf-8")

        def is_right(place, error, told, expected):
            if (place.file, place.function, error) == ("answers.c", "fopen", "ENOENT"):
                return told.code == 1 and "From what do you want to begin" in told.stdout  # nobody has begun yet
            screen = " ".join(told.stdout.replace("\n! ", " ").split())
            is_told = re.search("^heavectl: ", told.stderr, re.MULTILINE) or os.strerror(number_of(error)) in screen or "Not taken" in screen or "! heaved has ended: heaved: " in screen
            is_told = is_told or (error in ("EACCES", "EPERM") and "on a configuration that you may not read" in screen)
            kept = json.loads(state.read_text(encoding="utf-8"))["answers"] if state.exists() else []
            return told.code in SANE_EXITS - {0} and (is_told or told[:2] == expected[:2]) and kept[:len(answers)] == answers

        expected = try_all(troubles, page, places, run_and_type(*lines), [bench.bin / "heavectl", "setup", file], prepare=prepare, is_right=is_right)
        assert "goes on here" in expected.stdout and (file.read_text(encoding="utf-8") == there if there else not file.exists()), expected

    with environment(page, PATH=f"{bench.bin}:{os.environ['PATH']}"):
        for start in ("none", "hexapod-400", harness.TOP / "config/hexapod-400.ini"):
            story([], start)
        story(BEGUN[:-2], "k")
        story(BEGUN[:-2], "k", there="; written by heavectl setup\n")
        story(BEGUN, "nobus0")
        story(LAST, "y")


# --- The daemon ---

class Daemon:
    def __init__(self, bench, page, config=None, arguments=(), is_after_a_crash=False):
        self.bench, self.page = bench, page
        bench.socket.unlink(missing_ok=True)
        if is_after_a_crash:
            with socket.socket(socket.AF_UNIX) as dead:
                dead.bind(str(bench.socket))
        self.said = []
        self.process = subprocess.Popen([bench.bin / "heaved", "--config", config or bench.config, *map(str, arguments)], stdout=subprocess.DEVNULL,
                                        stderr=subprocess.PIPE, text=True, errors="replace", **page.options)
        bench.running.append(self.process)
        self.process.judge, self.process.log, self.process.signal_sent = lambda _: None, None, None
        self.reader = threading.Thread(target=lambda: self.said.extend(self.process.stderr), daemon=True)
        self.reader.start()

    def text(self):
        if self.has_ended():
            self.reader.join(LIMIT_S)
        return "".join(list(self.said))

    def ask(self, request="status"):
        """The answer; nothing where there is none."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
            link.settimeout(1)
            try:
                link.connect(str(self.bench.socket))
                link.sendall(f"{request}\n".encode())
                return link.recv(65536).decode()
            except OSError:
                return ""

    def has_ended(self):
        return self.process.poll() is not None

    def wait_for(self, condition, limit_s=LIMIT_S):
        """False where it never comes true."""
        end = time.monotonic() + limit_s
        while not condition() and time.monotonic() < end:
            time.sleep(0.005)
        return bool(condition())

    def is_ready(self):
        """It says so, for nobody else may be able to."""
        return self.wait_for(lambda: self.has_ended() or "heaved: version " in self.text() or self.ask()) and not self.has_ended()

    def end(self):
        """The exit code; None where it does not end."""
        if not self.has_ended():
            self.process.send_signal(signal.SIGTERM)
        if not self.wait_for(self.has_ended):
            self.process.kill()
            self.process.wait()
            return None
        self.text()
        self.process.stderr.close()
        return self.process.wait()


def outputs(bench):
    return ["--record", bench.folder / "record.txt", "--trace", bench.folder / "trace.csv"]


def busy_config(bench, engage):
    config = bench.write_config(f"{engage}.ini", platform__engage=engage)
    life = "heave life 1\nsequence 2\nrides 0\nfaults 0\naxes 7\n" + "".join(f"axis {n} energized_ms 0 travel_milli 0 turns 0\n" for n in range(1, 8))
    bench.file("life", f"{life}sum {hashlib.sha256(life.encode()).hexdigest()[:16]}\n")
    group = grp.getgrgid(os.getgid()).gr_name
    control = f"metrics = {bench.folder}/heave.prom\nlook_socket = {bench.folder}/look\noperator_log = {bench.folder}/operators\noperate_group = {group}\nservice_group = {group}\n"
    text = config.read_text(encoding="utf-8").replace("[udp]\nbind = 127.0.0.1", "[udp]\nbind = 0.0.0.0\ngroup = 239.77.1.2%lo")
    text = text.replace("[control]\n", f"[control]\n{control}").replace("[platform]\n", f"[platform]\nlife_file = {bench.folder}/life\n", 1)
    config.write_text(f"{text}\n[black-box]\ndirectory = {bench.folder}/incidents\nseconds = 10\nincidents = 2\n", encoding="utf-8")
    (bench.folder / "incidents").mkdir(exist_ok=True)
    (bench.folder / "incidents/.seen").write_text("000000\n", encoding="ascii")
    return config


def notified(bench, page):
    """A service manager that nobody listens to."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listener.bind(str(bench.folder / "notify"))
    threading.Thread(target=lambda: [None for _ in iter(lambda: listener.recv(500), b"")], daemon=True).start()
    page.options["env"].update(NOTIFY_SOCKET=listener.getsockname(), WATCHDOG_USEC="100000")
    return listener


def start_and_end(bench, places, is_after_a_crash):
    page, troubles = Page(bench), Troubles()
    config, listener = busy_config(bench, "manual"), notified(bench, page)
    new = lambda: Daemon(bench, page, config, outputs(bench), is_after_a_crash)  # noqa: E731
    daemon = new()
    assert daemon.is_ready(), daemon.text()
    starting = page.seen(forget=True)
    assert daemon.end() == 0, daemon.text()
    ending = page.seen() - starting
    for place, error in trials(places, starting, STORY.tried):
        page.set(place, error)
        daemon = new()
        troubles.judge(daemon.is_ready() or daemon.has_ended(), f"{name_of(place, error)}: neither ready nor ended")
        STORY.note(place, page)
        page.clear()
        judge_end(troubles, name_of(place, error), daemon.end(), daemon.text())
    for place, error in trials(places, ending, STORY.tried):
        page.clear()
        daemon = new()
        troubles.judge(daemon.is_ready(), f"{name_of(place, error)}: not ready")
        page.set(place, error)
        code = daemon.end()
        STORY.note(place, page)
        judge_end(troubles, name_of(place, error), code, daemon.text())
    listener.shutdown(socket.SHUT_RDWR)  # ends the thread that reads it
    listener.close()
    page.close()
    troubles.done()


FOOT = re.compile("; heaved: applied over [0-9a-f]+\n")


def takes_a_configuration(bench, places, _judge):
    """What comes into force is what was given, or what was before, and then it is told of. What is kept is one of the two, whole."""
    page, troubles = Page(bench), Troubles()
    state = bench.folder / "kept"
    kept, own = state / "configuration.ini", bench.write_config("own.ini", platform__engage="manual")
    state.mkdir()
    page.options["env"]["STATE_DIRECTORY"] = str(state)
    text = own.read_text(encoding="utf-8")
    count = 0

    def apply(change=""):
        nonlocal count
        count += 1
        given = f"{re.sub('(?m)^stroke_mm = [^;]*', change, text) if change else text}; number {count}\n"
        return bench.ctl("config", bench.file("given.ini", given)), given

    def in_force():
        return bench.ctl("config").stdout

    def new():
        daemon = Daemon(bench, page, own)
        assert daemon.is_ready() and daemon.wait_for(lambda: '"OFF"' in daemon.ask()), daemon.text()
        return daemon

    daemon = new()
    page.seen(forget=True)
    for _ in range(3):  # older ones are there then
        run, given = apply()
        assert run.returncode == 0 and in_force() == given, run
    own_places = [place for place in places if place.file in ("config_store.c", "config.c", "sealed.c")]  # what all requests need has its own cases
    for place, error in trials(own_places, page.seen(), STORY.tried):
        before, what = in_force(), name_of(place, error)
        page.set(place, error)
        run, given = apply()
        page.clear()
        STORY.note(place, page)
        now = in_force()
        is_told = run.returncode in SANE_EXITS - {0} and run.stderr.startswith("heavectl: ")
        is_hidden = now == "" and place.function in ("memfd_create", "pwrite", "fcntl", "dup3")  # in force, but there is no memory to show it until SIGHUP
        troubles.judge(now == given or is_hidden if run.returncode == 0 else is_told and now == before, f"{what}: exit {run.returncode}: {run.stderr.strip()[-300:]} {now[-60:]!r}")
        whole = FOOT.sub("", kept.read_text(encoding="utf-8"))
        troubles.judge(whole == (given if run.returncode == 0 else before), f"{what}: kept is {whole[-60:]!r}")
        if daemon.has_ended() or now not in (before, given):
            troubles.judge(not daemon.has_ended(), f"{what}: ended: {daemon.text()[-300:]}")
            daemon.end()
            daemon = new()
    for place in (place for place in places if place.function == "execv"):
        page.set(place, "ENOENT")
        apply("stroke_mm = 199 ")
        troubles.judge(daemon.wait_for(daemon.has_ended), "execv: it goes on")
        STORY.note(place, page)
        page.clear()
        troubles.judge(daemon.end() == 69 and "cannot start anew" in daemon.text(), f"execv: {daemon.text()[-300:]}")
        daemon = new()
    assert daemon.end() == 0
    own.write_text(text + "; edited\n", encoding="utf-8")  # and which counts is judged at the start
    daemon = new()
    starting = page.seen(forget=True)
    daemon.end()
    for place, error in trials([place for place in places if place.file in ("config_store.c", "main.c")], starting, STORY.tried):
        page.set(place, error)
        daemon = Daemon(bench, page, own)
        troubles.judge(daemon.is_ready() or daemon.has_ended(), f"{name_of(place, error)}: neither ready nor ended")
        STORY.note(place, page)
        page.clear()
        judge_end(troubles, name_of(place, error), daemon.end(), daemon.text())
    page.close()
    troubles.done()


class Day:
    """All that happens to a running platform, again and again."""

    def __init__(self, bench, daemon):
        self.bench, self.daemon = bench, daemon
        self.is_over = False
        self.hours = 0
        self.watch = None
        self.thread = threading.Thread(target=self.send)
        self.thread.start()

    def send(self):
        with self.bench.sender() as sender:
            start = time.monotonic()
            while not self.is_over:
                t = time.monotonic() - start
                try:
                    sender.send(f"@A6:{3 * (t % 4 > 2)},0,0,0,0,{20 * ((t % 2) > 1):.3f},0#")
                except OSError:
                    pass  # the daemon is not there just now
                time.sleep(0.01)

    def hour(self):
        crowd = [socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) for _ in range(9)]  # one more than there is room for
        for client in crowd:
            try:
                client.connect(str(self.bench.socket))
                client.sendall(b"watch 50\n")
            except OSError:
                pass
        for client in crowd:
            client.settimeout(1)
            try:
                client.recv(65536)  # it has been let in, or turned away
            except OSError:
                pass
        self.daemon.ask("hold")  # voids what the others have asked; is_engaged() goes on
        for client in crowd:
            client.close()
        self.hours += 1
        for request in ("status", "samples", "counts", "dump", "incidents", "seen", f"intensity {80 + self.hours % 20}", "nonsense"):  # the operator log takes nothing twice
            self.daemon.ask(request)
        if not self.daemon.has_ended():
            self.daemon.process.send_signal(signal.SIGHUP)
        with self.bench.sender() as sender:
            for _ in range(3):
                sender.send("nonsense") if not self.daemon.has_ended() else None

    def flood(self):
        """More than anybody reads: the filter of the kernel comes, and goes. False where it did not."""
        for condition in (lambda: "a flood of" in self.daemon.text(), lambda: "the flood is over" in self.daemon.text()):
            end = time.monotonic() + LIMIT_S
            while not self.daemon.has_ended() and not condition() and time.monotonic() < end:
                self.pour() if "a flood of" not in self.daemon.text() else time.sleep(0.1)
        return "the flood is over" in self.daemon.text()

    def pour(self):
        with self.bench.sender() as sender:
            for _ in range(2000):
                try:
                    sender.send("nonsense")
                except OSError:
                    break

    def end(self):
        self.is_over = True
        self.thread.join()


def pieces(trace, cycle_us):
    """Where the service thread could not write, rows are missing, and counted: what is between is whole."""
    head, *rows = harness.since_zero(trace).splitlines(keepends=True)
    piece, due = [], None
    for row in rows:
        t_us = round(float(row.split(b",", 1)[0]) * 1000)
        if due not in (None, t_us):
            yield b"".join([head, *piece])
            piece = []
        piece.append(row)
        due = t_us + cycle_us
    yield b"".join([head, *piece])


def judged(bench, judge, config):
    """What is wrong with the set-points."""
    trace = (bench.folder / "trace.csv").read_bytes()
    trace = trace[:trace.rindex(b"\n") + 1]
    for piece in pieces(trace, 1000):
        run = subprocess.run([judge, config], input=piece, stdout=subprocess.PIPE, check=False)
        if run.returncode != 0:
            return run.stdout.decode()[-500:]
    return "" if trace.count(b"\n") > 1000 else "a trace of nothing"


def is_engaged(daemon):
    """A busy machine may have held it."""
    answer = daemon.ask()
    if '"HOLD"' in answer:
        daemon.ask("resume")
    return '"state":"ENGAGED"' in answer


def in_operation(bench, places, judge):
    page, troubles = Page(bench), Troubles()
    config, listener = busy_config(bench, "auto"), notified(bench, page)

    def new():
        daemon = Daemon(bench, page, config, outputs(bench))
        assert daemon.is_ready() and daemon.wait_for(lambda: is_engaged(daemon)), daemon.text()
        return daemon, Day(bench, daemon)

    def close(daemon, day, what):
        day.end()
        page.clear()
        code = daemon.end()
        judge_end(troubles, what, code, daemon.text())
        spoilt = ("output_file.c" in what)
        troubles.judge(spoilt or not (wrong := judged(bench, judge, config)), f"{what}: {wrong if not spoilt else ''}")

    def flood():
        """Takes 5 s to be over, so once: both places with one error, and then without."""
        daemon, day = new()
        filters = [place for place in places if place.file == "linux_udp_filter.c"]
        for place in filters[:1]:
            page.set(place, "ENOMEM")
            day.pour()
            troubles.judge(daemon.wait_for(lambda: page.failed() or day.pour(), 20) or True, "no flood")
            STORY.note(place, page)
            page.clear()
        for place in filters[1:]:
            page.set(place, "ENOMEM")
            troubles.judge(day.flood(), f"{name_of(place, 'ENOMEM')}: no flood, or it never ends")
            STORY.note(place, page)
        close(daemon, day, "floods")

    flood()
    page.seen(forget=True)
    daemon, day = new()
    page.seen(forget=True)
    day.hour()
    time.sleep(0.5)
    day.hour()
    seen, what = page.seen(), "all day"
    for place, error in trials(places, seen, STORY.tried):
        if place.file == "output_file.c":
            continue
        what = name_of(place, error)
        page.set(place, error)
        end = time.monotonic() + LIMIT_S / 3
        while not page.failed() and not daemon.has_ended() and time.monotonic() < end:
            day.hour()
        time.sleep(0.03)
        STORY.note(place, page)
        page.clear()
        if daemon.wait_for(lambda: daemon.has_ended() or is_engaged(daemon)) and not daemon.has_ended():
            continue
        troubles.judge(daemon.has_ended() and daemon.process.poll() != 0, f"{what}: exit {daemon.process.poll()}, {daemon.ask()[:200]}: {daemon.text()[-300:]}")
        print(f"# {what}: ended it with {daemon.process.poll()}: {daemon.text().strip().splitlines()[-1:]}")
        close(daemon, day, what)
        daemon, day = new()
    close(daemon, day, what)
    listener.shutdown(socket.SHUT_RDWR)  # ends the thread that reads it
    listener.close()
    page.close()
    troubles.done()


# --- The backends, whose system is played ---

PLAYED = ("can", "gpio", "modbus", "udp")


def backends(bench, _places, _judge):
    folder = bench.bin.resolve().parent / "tests/contract"
    for name in PLAYED:
        program, failed = folder / f"test_{name}_failures", bench.folder / f"{name}.places"
        run = subprocess.run([program], stdout=subprocess.PIPE, text=True, check=False, env={**os.environ, "HEAVE_FAILED_PLACES": str(failed)})
        assert run.returncode == 0, run.stdout
        returns, functions = zip(*(line.split() for line in failed.read_text(encoding="utf-8").splitlines()))
        lines = tool("addr2line", "-e", program, *(hex(int(place, 16) - 1) for place in returns)).splitlines()
        for where, function in zip(lines, functions):
            ours = re.search(r"/hal/linux/([^/]+):(\d+)", where)
            STORY.played |= {(ours[1], int(ours[2]), function)} if ours else set()


CASES = {"backends": backends,
         "programs that run to their end": offline,
         "heavectl": control,
         "heaved starts and ends": lambda bench, places, _: start_and_end(bench, places, False),
         "heaved starts after a crash": lambda bench, places, _: start_and_end(bench, places, True),
         "heaved in operation": in_operation,
         "heaved takes a configuration": takes_a_configuration}


def wrapped(bench):
    library = bench.bin.resolve().parent / "tests/system/libfailing_calls.so"
    return {line.split()[-1] for line in tool("nm", "-D", "--defined-only", library).splitlines() if " T " in line}


def missing(places):
    return [place for place in places
            if place[:3] not in STORY.tried | STORY.played and (place.file, place.function) not in ELSEWHERE]


def main():
    suite = tap.Suite()
    with harness.Bench(sys.argv[1]) as bench:
        can_fail = wrapped(bench)
        places, others = places_of(bench.bin / "heaved", can_fail)
        if "__llvm_profile_runtime" in tool("nm", bench.bin / "heaved"):
            others = set()  # those of the library that counts what is reached are among them
    if not places:
        print("1..0 # SKIP a build without debug information does not tell where its calls are")
        return 0
    only = sys.argv[3] if len(sys.argv) > 3 else ""
    for name, check in CASES.items():
        if only in name or check is backends:
            with harness.Bench(sys.argv[1]) as bench, suite.case(name):
                check(bench, places, sys.argv[2])
    if not only:
        with suite.case("every function that is called can be made to fail, or cannot fail"):
            assert not others - HARMLESS - UNUSED, sorted(others - HARMLESS - UNUSED)
            assert can_fail == set(ERRNOS), can_fail ^ set(ERRNOS)
        with suite.case("every place has failed"):
            for check in CASES.values():  # what was missed on a busy machine
                if missing(places):
                    with harness.Bench(sys.argv[1]) as bench:
                        check(bench, missing(places), sys.argv[2])
            assert not missing(places), "\n".join(f"{place.file}:{place.line}: {place.function}" for place in missing(places))
    print(f"# {len(STORY.tried)} places tried here, {len(STORY.played)} where the system is played")
    print(f"# figure {STORY.count} failures of system calls injected")
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
