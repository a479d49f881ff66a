#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_chinese.py BIN - what a person reads at a terminal, in Chinese: every command, the report of every platform, and every sort of error that
programs without hardware can make. No line has English words left beyond names: keys, sections, commands, options, files, units, words of the standards.

The locale is zh_CN.UTF-8, which need not be there.
"""
import fcntl
import json
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
import time
import unicodedata
from pathlib import Path

import harness
import tap

BIN = Path(sys.argv[1])
TOP = harness.TOP
LOCALES = BIN.resolve().parent / "locale"
CHINESE = {**{key: value for key, value in os.environ.items() if not key.startswith("LC_") and key != "LANGUAGE"}, "LANG": "zh_CN.UTF-8",
           "HEAVE_LOCALES": str(LOCALES), "COLUMNS": "80"}
ENGLISH = {**CHINESE, "LANG": "C.UTF-8"}
HAN = re.compile("[\u4e00-\u9fff]")

# Names that are the same in Chinese text: of programs, standards, units, and the words of keys and commands, which are read from the tables.
NAMES = set("""
heave heaved heavectl heave-twin heave-panel systemd systemctl enable now modprobe vcan ip link set up down type show can mm deg us ms rpm bit kbit rms dB Hz
CANopen CAN Modbus GPIO gpio udp modbus SocketCAN slcan bus-off error-passive operational pre-operational halt tick remote node_exporter textfile collector Prometheus
heartbeat OFF ini json python3 import sys print load stdin state grep pty terminal python-can slcand gpiodetect gpioinfo gpio-sim dialout root crypt docs echo
main auto manual kind accel jerk key value bus-failing wait if-there last offset min max prom true false config head hexapod tripod Mbit CiA passed failed by whole beat release geometry samples incident-folder operator-log configuration configure heard tick request
""".split())
STRIPPED = [r"Ctrl-C", r"tripod-3rps", r"`[^`]*`", r"\"[^\"]*\"", r"\[[\w-]+\]", r"--[\w-]+", r"(?<![\w.])/[\w./@*<>-]+", r"\b[\w.-]*\.(?:ini|md|csv|frames|sock|c|service|prom|log|eds|dcf|py)\b",
            r"\b[A-Za-z]*[_\d][\w.]*", r"\b[A-Z][A-Z0-9_./-]*(?:-[\w]+)?\b", r"\{[^}]*\}", r"\b\w+=\S+", r"->.*ip link.*", r"\$\w+", r"\b\w+\(\d\)"]


def spoken(*command, env, **more):
    run = subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120, check=False,
                         env=env, **more)
    return run.stdout


def table_words():
    """Sections, keys, their words and the commands: what a configuration or a command line is made of."""
    words = set(NAMES)
    for config in sorted((TOP / "config").glob("*.ini")):
        text = spoken(BIN / "heaved", "--config", config, "--dump-config", env=ENGLISH)
        words.update(re.findall(r"^(?:; )?([\w]+)(?: =|:)", text, re.M))
        words.update(word for line in re.findall(r"^\[([\w-]+)\]", text, re.M) for word in line.split())
        for line in re.findall(r"^; ([\w-]+(?: \| [\w-]+)+|none, or.*|.*; default .*)$", text, re.M):
            words.update(re.findall(r"[\w-]+", line.split(";")[0] if "|" in line else line.rsplit("default", 1)[-1]))
    text = spoken(BIN / "heavectl", "--help", env=ENGLISH)
    words.update(re.findall(r"^  ([a-z-]+)", text, re.M))
    words.update(re.findall(r"[a-z-]+", " ".join(re.findall(r"^  heavectl (.*)$", text, re.M))))
    words.update("roll pitch yaw angle base plate startup setpoint position speed status feedback units command_id unchecked ok cutoff whole csp ip pp sim none".split())
    return words


def left_in_english(text, words):
    """Lines with words that are no names."""
    found = []
    for line in text.splitlines():
        rest = line
        for pattern in STRIPPED:
            rest = re.sub(pattern, " ", rest, flags=re.ASCII)
        unknown = [word for word in re.findall(r"(?<![\w-])[a-zA-Z][a-zA-Z-]{2,}(?![\w-])", rest, re.ASCII) if word not in words and word.lower() not in words]
        if unknown:
            found.append(f"{' '.join(unknown)}: {line}")
    return found


def columns(line):
    return sum(2 if unicodedata.east_asian_width(c) in "WF" else 0 if unicodedata.combining(c) else 1 for c in line)


class Judge:
    def __init__(self):
        self.words = table_words()
        self.lines = 0

    def reads(self, *command, is_told=True, **more):
        """Runs it in Chinese and looks at each line; the text."""
        text = spoken(*command, env=CHINESE, **more)
        found = left_in_english(text, self.words)
        assert not found, f"{' '.join(map(str, command))} says in English: " + "\n".join(found[:20])
        assert not is_told or HAN.search(text), f"{command}: {text}"
        self.lines += len(text.splitlines())
        return text


    def types(self, bench, arguments, keys):
        """The same in a terminal of 80 columns, where keys are pressed again and again; what it shows, without what moves the cursor."""
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 40, 80, 0, 0))
        process = subprocess.Popen([BIN / "heavectl", "--socket", bench.socket, *arguments], stdin=slave, stdout=slave, stderr=slave, env={**CHINESE, "TERM": "xterm"}, start_new_session=True)
        os.close(slave)
        shown, end = b"", time.monotonic() + harness.WAIT_S
        while time.monotonic() < end:
            try:
                if select.select([master], [], [], 0.03)[0]:
                    new = os.read(master, 65536)
                    shown += new
                    if "松开".encode() in new:  # a key that is down already has to be let go
                        time.sleep(0.4)
                elif process.poll() is not None:
                    break
                elif keys:
                    os.write(master, keys)
            except OSError: # the terminal has gone with the program
                break
        os.close(master)
        assert process.wait(timeout=harness.WAIT_S) in (0, 1, 64), f"{arguments}: {shown.decode(errors='replace')}"
        text = re.sub(r"\x1b\[[?\d;]*[A-Za-z]|\r", "\n", shown.decode())
        found = left_in_english(text, self.words)
        assert not found, f"{arguments} says in English: " + "\n".join(found[:20])
        self.lines += len(text.splitlines())
        return text


def wrong_configurations():
    """Every key with something that cannot be, and files that are none: the errors of the reader and of each type of value."""
    for path in sorted((TOP / "config").glob("*.ini")):
        text = path.read_text(encoding="utf-8")
        keys = list(re.finditer(r"^(\w+) *= *([^;\n]*)", text, re.M))
        for bad in ("what is this", "1, 2", "-99999999", "", "0x01 {nothing:u8}", "1\uff0c5", "none", "5 mm", "300000.5"):
            yield f"{path.stem} {bad!r}", "".join(
                line if line is None else line for line in [re.sub(r"^(\w+ *= *)([^;\n]*)", lambda match: match[1] + bad + " ", text, flags=re.M)])
        yield f"{path.stem} without values", "".join(f"{line}\n" for line in text.splitlines() if line.startswith("["))
        yield f"{path.stem} given twice", text + "\n" + "\n".join(f"[{name}]" for name in re.findall(r"^\[([\w-]+)\]", text, re.M))
        yield f"{path.stem} keys twice", re.sub(r"^(\w+ *=.*)$", r"\1\n\1", text, flags=re.M)
        yield f"{path.stem} unknown keys", re.sub(r"^(\w+)( *=)", r"\1_x\2", text, flags=re.M)
        assert keys
    yield "sections", "[cam]\nbus = 1\n[platfrm]\n[platform\n[nonsense]\n"
    yield "lines", "kind = hexapod\n[platform]\nstray text\n  kind = hexapod\n\x07\n" + "a" * 300 + "\n"


def main():
    suite = tap.Suite()
    judge = Judge()
    heaved, heavectl = BIN / "heaved", BIN / "heavectl"

    with suite.case("--help, --version and wrong command lines of heaved and heavectl"):
        for program in (heaved, heavectl):
            judge.reads(program, "--help")
            judge.reads(program, "--version", is_told=False)
            judge.reads(program, "--nonsense")
            judge.reads(program)
        for arguments in (["--config"], ["--config", "a", "--preset", "b"], ["--preset", "../x"], ["--check", "--doctor", "--config", "a"], ["--config", "a", "--check", "more"],
                          ["--config", "a", "--check", "--record", "b"], ["--config", "a", "--eds", "b"], ["--template", "hexapod"], ["--template", "octo_pod", "sim"],
                          ["--config", "a", "--check", "--trace", "b"], ["--config", "/nonexistent", "--check"], ["--config", "/", "--check"], ["--import-dcf", "/nonexistent", "--drive", "all"], ["--import-dcf", "a"], ["--drive", "7"], ["--import-dcf", *"abcdefg"],
                          ["--config", "a", "--socket", ""]):
            judge.reads(heaved, *arguments)
        for arguments in (["--for", "x", "watch"], ["--hz", "99", "watch"], ["--band", "1", "identify", "z"], ["--amplitude", "x", "identify", "z"], ["--platform", "a/b", "status"],
                          ["--socket"], ["status", "twice"], ["intensity"], ["torque", "1"], ["jog", "", "1"], ["--wait", "status"], ["--socket", "/nonexistent", "status"],
                          ["--socket", "/" + "a" * 200, "status"], ["--socket", "a", "--platform", "b", "status"], ["--socket", "/nonexistent", "selftest"],
                          ["--socket", "/nonexistent", "identify", "z"]):
            judge.reads(heavectl, *arguments)

    with suite.case("presets, templates and dumped configurations, which read back as the same platform"):
        for program in ([heaved, "--presets"], [heavectl, "presets"]):
            text = subprocess.run([*program], env=CHINESE, capture_output=True, text=True, check=True).stdout
            told = "\n".join(line.split(None, 1)[1] for line in text.splitlines())
            assert HAN.search(told) and not left_in_english(told, judge.words), told
        for kind in ("hexapod", "tripod", "tripod-3rps"):
            for driver in ("sim", "cia402", "can-raw", "modbus-tcp", "modbus-rtu"):
                judge.reads(heaved, "--template", kind, driver)
        with harness.Bench(BIN) as bench:
            for config in sorted((TOP / "config").glob("*.ini")):
                dumped = judge.reads(heaved, "--config", config, "--dump-config")
                again = bench.file("again.ini", dumped)
                assert judge.reads(heaved, "--config", again, "--dump-config") == dumped, f"{config} is another one after --dump-config in Chinese"
                english = spoken(heaved, "--config", config, "--dump-config", env=ENGLISH)
                assert re.findall(r"^[^;\n].*", english, re.M) == re.findall(r"^[^;\n].*", dumped, re.M), config

    with suite.case("--check and --doctor of every platform"):
        for config in sorted((TOP / "config").glob("*.ini")):
            for mode in ("--check", "--doctor"):
                judge.reads(heaved, "--config", config, mode)

    with harness.Bench(BIN) as bench:
        with suite.case("errors of configurations: each key with values that cannot be"):
            errors = 0
            for name, text in wrong_configurations():
                path = bench.file("wrong.ini", text)
                said = spoken(heaved, "--config", path, "--check", env=CHINESE)
                found = left_in_english(said, judge.words)
                assert not found, f"{name}: " + "\n".join(found[:20])
                errors += said.count("wrong.ini")
            assert errors > 1000, errors
            print(f"# figure {errors} errors of configurations without an English word")

        daemon = bench.start(environment={"LANG": "zh_CN.UTF-8", "HEAVE_LOCALES": str(LOCALES)})
        ctl = [heavectl, "--socket", bench.socket]
        with suite.case("status: in 80 columns, its tables aligned"):
            bench.wait_state("OFF", "SETTLED", "ENGAGED")
            text = judge.reads(*ctl, "status")
            lines = text.splitlines()
            assert max(map(columns, lines)) <= 80, [line for line in lines if columns(line) > 80]
            poses = [line for line in lines if re.search(r"(-?\d+\.\d{3} *){6}$|z mm$", line)]
            assert len(poses) >= 3 and len({columns(line) for line in poses}) == 1, poses
            bars = [line for line in lines if "░" in line or "█" in line]
            assert len(bars) == 6 and len({columns(line[:re.search(r"\.\d{3} \D*$", line).start()]) for line in bars}) == 1, bars
        with suite.case("the log and the control socket stay English"):
            log = daemon.log.read_text(encoding="utf-8")
            assert log and not HAN.search(log), log
            answer = json.loads(re.search("(?m)^{.*", spoken(*ctl, "--json", "resume", env=CHINESE))[0])
            assert not HAN.search(answer["error"]), answer
            status = json.loads(spoken(*ctl, "--json", "status", env=CHINESE))
            assert status["state"] in ("OFF", "SETTLED", "RISING", "NEUTRAL", "ENGAGED"), status["state"]
        with suite.case("every request and refusal"):
            for request in ("status", "resume", "reset", "intensity 150", "intensity x", "torque 1 on", "jog 1 5", "home 1", "relay 1", "signal z sine 2 0.5 20", "dump", "incidents", "seen",
                            "acknowledge", "service-off", "counts", "hold", "engage", "park", "service", "torque 99 on", "torque all on", "counts", "selftest", "identify z", "scope no_such", "drive 1", "drive 7", "drive 99", "sdo 1 6041:00", "sdo 1 6041", "sdo x",
                            "service-off", "intensity 50", "status", "--for 1 watch", "--wait --for 0.2 engage", "--wait --for 0.1 park", "hold", "resume", "status"):
                judge.reads(*ctl, *request.split(), is_told=request not in ("scope",))
        with suite.case("by hand, in a terminal: a jog, the self-test, identify, watch, counts"):
            bench.ctl("park")
            bench.wait_state("SETTLED")
            bench.ctl("service")
            bench.wait_state("SERVICE")
            for command, key, until in ((["torque", "all", "on"], b"", "SERVICE"), (["home", "all"], b" ", "已结束"),
                                        (["jog", "z", "2mm/s", "1mm"], b" ", "已到达"), (["jog", "1", "2mm/s"], b"q", ""), (["--for", "1", "watch"], b"", "SERVICE"),
                                        (["--for", "0.5", "counts"], b"", "计数"), (["selftest"], b"n\ns\n", "自检"),):
                text = judge.types(bench, command, key)
                assert re.search(until, text), f"{command}: {text}"
            bench.wait_state("SERVICE", "OFF")
            bench.ctl("service")
            bench.wait_state("SERVICE")
            text = judge.types(bench, ["--band", "20-49", "--for", "1", "identify", "z"], b" ")
            assert "identify" in text, text
        with suite.case("refusals that only a client of the socket gets"):
            with harness.Line(bench.socket) as line:
                sentences = set()
                for request in ("nonsense", "watch 99", "by " + "x" * 40, "torque", "torque 9 on", "jog 1", "jog z 1 5", "beat 1 1 1", "release 7", "home all 5", "relay 1 5", "signal z sine 1 1 1 5",
                                "sdo", "sdo 1 6041:00", "sdo 1 2000:01 u99 5", "sdo 1 607B:01 99999999999", "operator-log", "incident-folder", "selftest passed", "intensity", "engage now"):
                    answer = line.ask(request)
                    if not answer["ok"]:
                        sentences.add(answer["error"])
            assert len(sentences) > 8, sentences
            for error in sorted(sentences):
                # heavectl shows what a socket answers: one that always answers this
                said = shown_by_heavectl(bench, error)
                found = left_in_english(said, judge.words)
                assert not found and HAN.search(said), f"{error} is shown as {said}"
        with suite.case("a fault, and the end of heaved"):
            bench.ctl("shutdown")
            daemon.wait(timeout=harness.WAIT_S)
            judge.reads(*ctl, "status")
            fault = {"ok": True, "state": "FAULT", "goal": "OFF", "fault": {"code": 1, "axis": 2, "text": "a drive reports a fault", "text_zh": "驱动器报告故障", "cause": "c",
                     "cause_zh": "原因", "remedy": "r", "remedy_zh": "处理", "device_code": 0x3210, "device_text": "over-voltage of the DC link", "off_mm": 1.5, "allowed_mm": 1.0},
                     "bus": {"trouble": "can: can0: the interface is down (as root: ip link set it up, with its bitrate)", "last_trouble": ""}, "flags": ["speed", "no-pose"],
                     "stream": {"sender": "even", "period_ms": 20}, "counters": {"rejected": {"A6": 3}, "spikes": 2, "faults": 1},
                     "cylinders": [{"number": 1, "sent_mm": 1, "actual_mm": 1, "stroke_mm": 10, "drive": "enabled", "homed": True, "period_ms": 10, "report": {
                         "node": 1, "phase": "waits for all drives to be switched on", "code": 9, "trouble": "sent no heartbeat in time, or did not answer to guarding", "detail": "value not allowed", "detail_code": 3,
                         "notes": ["warns: its manual and 603Fh say of what"], "emergency": {"code": 0x3210, "text": "over-voltage of the DC link", "register": 1, "manufacturer": "00"},
                         "telemetry": {"torque_percent": 5, "following_error_mm": 0.1, "inputs": 1}}}]}
            said = answered_by(bench, fault, "status")
            found = left_in_english(said, judge.words)
            assert not found, found
            assert max(map(columns, said.splitlines())) <= 80, said
            for words in ("直流母线过压", "心跳超时", "接口已关闭", "速度受限", "时间均匀", "尖峰 2", "由 heaved 发现：偏差 1.50 mm"):
                assert words in said, f"{words} is not in {said}"

    print(f"# figure {judge.lines} lines in Chinese without an English word beyond names")
    return suite.done()


def answered_by(bench, answer, command):
    """What heavectl shows of an answer."""
    import socket
    import threading
    path = bench.folder / "other.sock"
    path.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve():
            link, _ = listener.accept()
            with link:
                link.recv(4096)
                link.sendall(json.dumps(answer).encode() + b"\n")

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        text = spoken(BIN / "heavectl", "--socket", path, command, env=CHINESE)
        thread.join()
    return text


def shown_by_heavectl(bench, error):
    return answered_by(bench, {"ok": False, "error": error}, "engage")


if __name__ == "__main__":
    sys.exit(main())
