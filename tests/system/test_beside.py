#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_beside.py BIN [PART OF A NAME] - trouble beside the motion: descriptors, limits, devices and disks that are not as they should be. Operators
and signals are heard all the same, and no input is written over."""
import contextlib
import json
import os
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import harness
import tap

EXIT_USAGE, EXIT_DATA, EXIT_NO_INPUT, EXIT_UNAVAILABLE, EXIT_IO, EXIT_CONFIG = 64, 65, 66, 69, 74, 78


def wave(t):
    return f"@A6:{5 * ((t % 2) > 1)},0,0,0,0,{20 * ((t % 3) > 1):.3f},0#"


class Link:
    """A client at the control socket that stays connected."""

    def __init__(self, bench):
        self.link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.link.settimeout(5)
        self.link.connect(str(bench.socket))
        self.file = self.link.makefile("r", encoding="utf-8")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()
        self.link.close()

    def ask(self, text):
        self.link.sendall(text.encode())
        return json.loads(self.file.readline())


def cpu_s(pid):
    fields = open(f"/proc/{pid}/stat", encoding="ascii").read().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


# --- Descriptors ---

def too_few_descriptors(bench):
    def few(soft, hard):
        return lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

    run = bench.heaved("--config", bench.config, preexec_fn=few(8, 8))
    assert run.returncode == EXIT_UNAVAILABLE and "only 8 open files are allowed" in run.stderr and "64" in run.stderr, run
    daemon = bench.start(preexec_fn=few(8, 4096))
    assert resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE)[0] == 64
    assert bench.stop(daemon) == 0


def poll_fails_for_good(bench):
    """A limit below the number of descriptors makes every poll an error, and leaves none for a newcomer."""
    daemon = bench.start("--trace", bench.folder / "t.csv")
    bench.wait_state("ENGAGED")
    with Link(bench) as first, Link(bench) as second:
        assert first.ask("status\n")["ok"] and second.ask("status\n")["ok"]
        before = resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE)
        resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, (8, before[1]))
        since, at = cpu_s(daemon.pid), time.monotonic()
        assert first.ask("hold\n") == {"ok": True, "state": "HOLD"}
        assert first.ask("resume\n")["ok"]
        time.sleep(1)
        share = (cpu_s(daemon.pid) - since) / (time.monotonic() - at)
        assert share < 0.35, f"{share:.0%} of a processor"  # mostly the motion thread's
        resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, before)
        assert bench.ctl("hold").returncode == 0 and bench.ctl("resume").returncode == 0
        resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, (8, before[1]))
        assert bench.stop(daemon) == 0
        assert "shutting down" in daemon.log.read_text()


def closed_standard_descriptors(bench):
    """Log lines go nowhere then, rather than into a file that has got their number."""
    for closed in ((0,), (1,), (2,), (0, 1, 2)):
        trace, record = bench.folder / "t.csv", bench.folder / "r.txt"

        def close(closed=closed):
            for fd in closed:
                os.close(fd)

        daemon = bench.spawn("--trace", trace, "--record", record, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, preexec_fn=close)
        harness.wait_for(lambda: daemon.poll() is not None or bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
        bench.wait_state("ENGAGED")
        bench.ctl("hold")
        bench.ctl("nonsense")
        assert bench.stop(daemon) == 0, closed
        text = trace.read_text()
        assert text.startswith("t_ms,") and all(line.count(",") == 16 for line in text.splitlines()), f"{closed}: {text[:300]}"
        assert all(line[:1] in ";0123456789" for line in record.read_text().splitlines()), closed
    run = bench.ctl("status", preexec_fn=lambda: os.close(1))
    assert run.returncode != 0, "what nobody gets is no success"


# --- Files that end, or do not ---

def file_size_limit(bench):
    """SIGXFSZ: a trace that may grow no more is told at the end, and ends nothing."""
    daemon = bench.start("--trace", bench.folder / "t.csv", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (65536, 65536)))
    bench.wait_state("ENGAGED")
    with bench.sender() as sender:
        sender.stream(1.5, wave)
    assert (bench.folder / "t.csv").stat().st_size == 65536, "it has not come to the limit"
    assert bench.status()["state"] == "ENGAGED"
    assert bench.stop(daemon) == EXIT_IO
    assert "t.csv: File too large" in daemon.log.read_text(), daemon.log.read_text()


def configuration_from_a_pipe(bench):
    text = bench.config.read_bytes()
    as_file = bench.heaved("--config", bench.config, "--dump-config").stdout
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as pipe:
        pipe.write(text)
    run = bench.heaved("--config", f"/dev/fd/{reading}", "--dump-config", pass_fds=(reading,))
    os.close(reading)
    assert run.returncode == 0 and run.stdout == as_file, run.stderr
    fifo = bench.folder / "fifo"
    os.mkfifo(fifo)
    with subprocess.Popen(["sh", "-c", f"sleep 0.5; cat {bench.config} > {fifo}"]) as writer:
        run = bench.heaved("--config", fifo, "--dump-config")
        assert writer.wait() == 0 and run.returncode == 0 and run.stdout == as_file, run.stderr


def configuration_that_never_comes(bench):
    fifo = bench.folder / "fifo"
    os.mkfifo(fifo)
    since = time.monotonic()
    run = bench.heaved("--config", fifo, "--check")
    assert run.returncode == EXIT_CONFIG and "nothing came from it within 5 s" in run.stderr and time.monotonic() - since < 20, run
    run = bench.heaved("--config", "/dev/zero", "--check")
    assert run.returncode == EXIT_CONFIG and "larger than" in run.stderr, run
    if os.access("/proc/kmsg", os.R_OK):
        run = bench.heaved("--config", "/proc/kmsg", "--check")
        assert run.returncode == EXIT_CONFIG and run.stderr, run


def frames_that_never_end(bench):
    def little_memory():
        resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))

    run = bench.heaved("--config", bench.config, "--play", "/dev/zero", preexec_fn=little_memory)
    assert run.returncode == EXIT_DATA and "/dev/zero: a line of more than 1 MiB" in run.stderr, run


def output_onto_input(bench):
    """Refused before anything is opened for writing: the same name, a link of either sort, a name that is not there yet."""
    frames = bench.file("frames.txt", "0 !engage\n100 !park\n")
    hard, soft = bench.folder / "hard", bench.folder / "soft"
    os.link(frames, hard)
    soft.symlink_to(bench.config)
    new = bench.folder / "new"
    play, config, before = ["--play", frames], bench.config, (frames.read_bytes(), bench.config.read_bytes())
    odd = f"{bench.folder}/./../{bench.folder.name}/new"
    for arguments in ([*play, "--trace", frames], [*play, "--trace", hard], [*play, "--trace", config], [*play, "--trace", soft], ["--record", config],
                      ["--trace", soft], ["--trace", new, "--record", new], ["--trace", new, "--record", odd], ["--envelope", config]):
        run = bench.heaved("--config", config, *arguments)
        assert run.returncode == EXIT_USAGE and "would be written over" in run.stderr, (arguments, run)
        assert (frames.read_bytes(), config.read_bytes()) == before and not new.exists(), arguments
    text = config.read_text()
    config.write_text(text.replace("[control]\n", f"[control]\nmetrics = {soft}\n"))
    run = bench.heaved("--config", config)
    assert run.returncode == EXIT_USAGE and "[control] metrics" in run.stderr, run
    for section, key in (("control", "operator_log"), ("platform", "life_file")):
        for target, arguments in ((soft, []), (new, ["--trace", new]), (new, ["--record", odd])):
            config.write_text(text.replace(f"[{section}]\n", f"[{section}]\n{key} = {target}\n"))
            before = config.read_bytes()
            run = bench.heaved("--config", config, *arguments)
            assert run.returncode == EXIT_USAGE and f"[{section}] {key}" in run.stderr and not new.exists(), (arguments, run)
            assert config.read_bytes() == before
    config.write_text(text.replace("[control]\n", f"[control]\noperator_log = {new}\n").replace("[platform]\n", f"[platform]\nlife_file = {new}\n"))
    run = bench.heaved("--config", config)
    assert run.returncode == EXIT_USAGE and "would be written over" in run.stderr and not new.exists(), run
    config.write_text(text)
    assert bench.heaved("--config", config, *play, "--trace", "/dev/null").returncode == 0


def disk_that_stalls(bench):
    """Record, trace, metrics and log on a disk that does not answer: operators, signals and the service manager do not notice; losses are counted."""
    library = bench.bin.resolve().parent / "tests/system/libstalled_disk.so"
    if not library.exists():
        raise tap.Skip("instrumented build")
    disk, stall = bench.folder / "disk", bench.folder / "disk.stall"
    disk.mkdir()
    manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    manager.bind(str(bench.folder / "notify"))
    manager.settimeout(2)
    text = bench.config.read_text()
    bench.config.write_text(text.replace("[control]\n", f"[control]\nmetrics = {disk}/heave.prom\n"))
    with open(disk / "log", "wb") as log:
        daemon = bench.spawn("--trace", disk / "trace.csv", "--record", disk / "record.txt", stdout=log, stderr=log,
                             environment={"LD_PRELOAD": str(library), "HEAVE_STALLED": str(disk), "NOTIFY_SOCKET": manager.getsockname(),
                                          "WATCHDOG_USEC": "1000000"})
    harness.wait_for(lambda: bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
    bench.wait_state("ENGAGED")
    harness.wait_for((disk / "heave.prom").exists, "metrics are written")
    stall.touch()
    with Link(bench) as link, bench.sender() as sender:
        end = time.monotonic() + 25  # the rings hold 16 s
        while time.monotonic() < end:
            sender.stream(0.5, wave)
            for request in ("hold", "resume"):
                since = time.monotonic()
                assert link.ask(f"{request}\n")["ok"] and time.monotonic() - since < 1, f"{request}: {time.monotonic() - since:.2f} s"
            while manager.recv(500) != b"WATCHDOG=1":
                pass
        status = link.ask("status\n")
    lost = status["lost"]
    assert lost["trace_rows"] > 1000 and lost["metrics"] >= 20 and status["counters"]["faults"] == 0, (lost, status["state"])
    stall.unlink()

    def told():
        found = re.search(r'^heave_lost_total{what="trace_rows"} (\d+)$', (disk / "heave.prom").read_text(), re.MULTILINE)
        return found and int(found[1]) >= lost["trace_rows"]

    harness.wait_for(told, "the count is in the metrics")
    assert bench.ctl("status").returncode == 0
    assert bench.stop(daemon) == 0
    said = (disk / "log").read_text()
    assert "trace.csv: lines are lost: its disk or its reader is too slow" in said and re.search(r"trace.csv: \d{4,} rows are missing", said), said
    assert (disk / "trace.csv").read_text().endswith("\n") and not (disk / "heave.prom").exists()


def ends_on_a_disk_that_stalls(bench):
    """SIGTERM is acted on at once; what the disk does not take is given up after some seconds, and said."""
    library = bench.bin.resolve().parent / "tests/system/libstalled_disk.so"
    if not library.exists():
        raise tap.Skip("instrumented build")
    disk, stall = bench.folder / "disk", bench.folder / "disk.stall"
    disk.mkdir()
    daemon = bench.start("--trace", disk / "trace.csv", environment={"LD_PRELOAD": str(library), "HEAVE_STALLED": str(disk)})
    bench.wait_state("ENGAGED")
    stall.touch()
    since = time.monotonic()
    assert bench.stop(daemon) == EXIT_IO and time.monotonic() - since < 15
    assert "trace.csv: the disk does not answer: its end is missing" in daemon.log.read_text(), daemon.log.read_text()


def signals_of_others(bench):
    """None but those that end it has an effect, and SIGQUIT ends it as SIGTERM does."""
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    kept = {signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM, signal.SIGINT, signal.SIGQUIT, signal.SIGHUP, signal.SIGABRT, signal.SIGBUS, signal.SIGFPE,
            signal.SIGILL, signal.SIGSEGV, signal.SIGSYS, signal.SIGTRAP, signal.SIGXCPU, signal.SIGCONT}
    with bench.sender() as sender:
        for number in sorted(set(range(1, signal.SIGRTMAX + 1)) - kept - {32, 33}):
            daemon.send_signal(number)
            sender.stream(0.02, wave)
            assert daemon.poll() is None, number
    status = bench.status()
    assert status["state"] == "ENGAGED", status["state"]
    daemon.send_signal(signal.SIGQUIT)
    bench.wait_state("SETTLING")
    assert daemon.wait(20) == 0 and "SIGQUIT" not in daemon.log.read_text()
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    daemon.send_signal(signal.SIGQUIT)
    time.sleep(0.2)
    daemon.send_signal(signal.SIGQUIT)
    assert daemon.wait(5) != 0, "once more ends at once"


class Stalled:
    """heaved with its configuration on a disk, the service manager beside it, and perhaps nobody who reads its standard error."""

    def __init__(self, bench, is_log_full, has_black_box=False):
        library = bench.bin.resolve().parent / "tests/system/libstalled_disk.so"
        if not library.exists():
            raise tap.Skip("instrumented build")
        self.bench, disk, self.stall = bench, bench.folder / "disk", bench.folder / "disk.stall"
        disk.mkdir()
        self.config = disk / "platform.ini"
        self.config.write_text(bench.config.read_text(encoding="utf-8") + f"\n[black-box]\ndirectory = {disk}/box\n" * has_black_box, encoding="utf-8")
        self.manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.manager.bind(str(bench.folder / "notify"))
        self.manager.settimeout(0.5)  # half of:
        environment = {"LD_PRELOAD": str(library), "HEAVE_STALLED": str(disk), "NOTIFY_SOCKET": self.manager.getsockname(), "WATCHDOG_USEC": "1000000"}
        if is_log_full:
            self.reader, writer = socket.socketpair()
            self.daemon = bench.spawn(config=self.config, stderr=writer, environment=environment)
            harness.wait_for(lambda: bench.socket.exists() and bench.ctl("status").returncode == 0, "heaved answers")
            with contextlib.suppress(BlockingIOError):
                while writer.send(b"x" * 4096, socket.MSG_DONTWAIT):
                    pass
            writer.close()
        else:
            self.daemon = bench.start(config=self.config, environment=environment)
        bench.wait_state("ENGAGED")

    def serve(self, seconds, each=lambda: None):
        """Whoever holds is answered in a tenth of a second, and the manager hears of heaved in half of its time."""
        with Link(self.bench) as link, self.bench.sender() as sender:
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                sender.stream(0.1, wave)
                each()
                for request in ("hold", "resume"):
                    since = time.monotonic()
                    assert link.ask(f"{request}\n")["ok"] and time.monotonic() - since < 0.1, f"{request}: {time.monotonic() - since:.2f} s"
                while self.manager.recv(500) != b"WATCHDOG=1":
                    pass

    def ends(self):
        since = time.monotonic()
        assert self.bench.stop(self.daemon) == 0 and time.monotonic() - since < 15, time.monotonic() - since
        self.manager.close()


def reload_of_a_file_that_does_not_open(bench):
    """The configuration in force stays, which is said; what was asked meanwhile is one more reading; once the disk answers it is in force."""
    stalled = Stalled(bench, False)
    before = bench.status()["configuration"]["hash"]
    said = lambda words: harness.wait_for(lambda: words in stalled.daemon.log.read_text(), words)  # noqa: E731
    text = stalled.config.read_text(encoding="utf-8")
    stalled.config.write_text(text.replace("silence_hold_ms", "silence_hold_ms = 777 ;", 1), encoding="utf-8")
    stalled.stall.touch()
    stalled.daemon.send_signal(signal.SIGHUP)
    stalled.serve(4)
    said("platform.ini is not read yet: its disk does not answer")
    assert bench.status()["configuration"]["hash"] == before
    stalled.daemon.send_signal(signal.SIGHUP)
    stalled.serve(1)
    stalled.stall.unlink()
    harness.wait_for(lambda: stalled.daemon.log.read_text().count("has been read again") == 2, "read twice")
    assert "silence_hold_ms: 777 from now on" in stalled.daemon.log.read_text() and bench.status()["configuration"]["hash"] != before
    stalled.stall.touch()
    stalled.daemon.send_signal(signal.SIGHUP)
    stalled.ends()


def reload_beside_a_log_that_nobody_reads(bench):
    """Whatever a file of mistakes has to say, and a disk that stalls besides: no line of it is waited for."""
    stalled = Stalled(bench, True)
    text = stalled.config.read_text(encoding="utf-8")
    stalled.config.write_text(text.replace("[platform]\n", "[platform]\nfrobnicate = 1\n" * 300), encoding="utf-8")
    stalled.serve(5, lambda: stalled.daemon.send_signal(signal.SIGHUP))
    stalled.stall.touch()
    stalled.daemon.send_signal(signal.SIGHUP)
    stalled.serve(2)
    assert bench.status()["lost"]["log_lines"] > 0
    stalled.ends()


def reload_beside_a_dump(bench):
    """A dump that the disk does not take, and a file that it does not give: who asked for the dump waits, nobody else does."""
    stalled = Stalled(bench, False, has_black_box=True)
    assert bench.ctl("dump").returncode == 0
    with Link(bench) as link:
        stalled.stall.touch()
        link.link.sendall(b"dump\n")
        stalled.serve(4, lambda: stalled.daemon.send_signal(signal.SIGHUP))
        link.link.sendall(b"dump\n")
        stalled.serve(2)
        stalled.stall.unlink()
        folders = [json.loads(link.file.readline())["folder"] for _ in range(2)]
        assert len(set(folders)) == 2, folders
    stalled.ends()


def zero_in_a_request(bench):
    daemon = bench.start()
    bench.wait_state("ENGAGED")
    with Link(bench) as link:
        answer = link.ask("hold\0park\n")
        assert not answer["ok"] and "zero byte" in answer["error"], answer
        assert link.ask("status\n")["state"] == "ENGAGED"
        assert not link.ask("\0hold\n")["ok"] and not link.ask("hold\0\n")["ok"] and link.ask("hold\n")["ok"]
    assert bench.stop(daemon) == 0


# --- What is kept of the way up ---

def seen_from_the_first_feedback_on(bench):
    """A machine that homes by itself moves further than ever: trace and black box have it, and what a dump in HOMING says can be repeated."""
    config, trace = bench.write_config("homing.ini", platform__engage="manual", sim__enable_delay_ms="500", sim__start_extension_mm="60", sim__homed="no"), bench.folder / "t.csv"
    config.write_text(f"{config.read_text()}\n[black-box]\ndirectory = {bench.folder}/box\n")
    daemon = bench.start("--trace", trace, config=config)
    time.sleep(0.3)
    assert bench.ctl("engage").returncode == 0
    bench.wait_state("HOMING")
    harness.wait_for(lambda: bench.status()["cylinders"][0]["drive"] == "homing", "it homes")
    time.sleep(0.5)
    answer, code = bench.ask("dump")
    assert code == 0 and bench.status()["state"] == "HOMING", answer
    assert bench.stop(daemon) == 0
    folder = Path(answer["folder"])
    text = (folder / "frames").read_text()
    assert "NO REPLAY" not in text and " !engage" in text and " !feedback 1 " in text, text[:400]
    rows = (folder / "trace.csv").read_bytes()
    moved = {line.split(b",")[9] for line in rows.splitlines() if b",HOMING," in line}
    assert len(moved) > 300 and b",OFF," in rows, len(moved)
    assert bench.play(folder / "frames", config=folder / "platform.ini") == rows, "the incident is repeated otherwise"
    live = trace.read_bytes()
    assert rows.split(b"\n", 1)[1] in live, "the trace has other rows"
    assert all(line.endswith(b"before-zero") for line in live.splitlines()[1:]), "time zero never came"


# --- Late cycles where nothing is led ---

def late_on_its_way(bench):
    """In HOMING the drives move by themselves; in SETTLING the end is rest, and a shutdown has to come to it."""
    config = bench.write_config("slow.ini", platform__engage="manual", sim__enable_delay_ms="1500", sim__start_extension_mm="60")
    trace = bench.folder / "t.csv"
    daemon = bench.start("--trace", trace, config=config)

    def stall_in(state):
        late = bench.wait_state(state)["late_cycles"]
        daemon.send_signal(signal.SIGSTOP)
        time.sleep(0.1)
        daemon.send_signal(signal.SIGCONT)
        harness.wait_for(lambda: bench.status()["late_cycles"] >= late + 50, "late cycles are counted")
        assert bench.status()["state"] == state

    assert bench.ctl("engage").returncode == 0
    stall_in("HOMING")
    with bench.sender() as sender:
        def is_engaged():  # a busy machine may hold it on its way up
            sender.send("@A6:0,0,0,0,0,40,0#")
            status = bench.status()
            return bench.ctl("resume") and False if status["state"] == "HOLD" else status["state"] == "ENGAGED"
        harness.wait_for(is_engaged, "ENGAGED")
        for _ in range(100):
            sender.send("@A6:0,0,0,0,0,40,0#")
            time.sleep(0.02)
    bench.ctl("resume")
    bench.ctl("park")
    stall_in("SETTLING")
    assert bench.wait_state("SETTLED", "HOLD")["state"] == "SETTLED"
    assert bench.stop(daemon) == 0


CASES = {
    "the way up: trace and black box from the first feedback on, and a dump in HOMING replays": seen_from_the_first_feedback_on,
    "too few descriptors: raised, or refused at the start": too_few_descriptors,
    "poll fails for good: operators and signals are heard": poll_fails_for_good,
    "closed standard descriptors: no log line in a trace or record": closed_standard_descriptors,
    "a file that may grow no more ends nothing": file_size_limit,
    "the configuration from a pipe is whole": configuration_from_a_pipe,
    "a configuration that never comes, or never ends": configuration_that_never_comes,
    "frames that never end": frames_that_never_end,
    "an output that is an input is refused, and stays as it is": output_onto_input,
    "late in HOMING and SETTLING: counted, and it goes on": late_on_its_way,
    "a disk that stalls holds up nobody, and what is lost is counted": disk_that_stalls,
    "signals that others send change nothing": signals_of_others,
    "SIGTERM on a disk that stalls": ends_on_a_disk_that_stalls,
    "SIGHUP with a file that does not open": reload_of_a_file_that_does_not_open,
    "SIGHUP beside a dump on a disk that stalls": reload_beside_a_dump,
    "SIGHUP beside a log that nobody reads": reload_beside_a_log_that_nobody_reads,
    "a zero byte in a request is no end of it": zero_in_a_request,
}


def main():
    suite = tap.Suite()
    only = sys.argv[2] if len(sys.argv) > 2 else ""
    for name, check in CASES.items():
        if only in name:
            with harness.Bench(sys.argv[1]) as bench, suite.case(name):
                check(bench)
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
