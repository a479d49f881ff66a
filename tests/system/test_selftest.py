#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_selftest.py BIN - heavectl selftest as a person makes it, in a terminal: what passes, what is found, what it takes to engage afterwards."""
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import harness
import tap

from heave import Heaved, Twin
from heave.configuration import changed

BIN = Path(sys.argv[1])
KEY_S = 1 / 30
DUE = "a self-test is due: `heavectl selftest`, with nobody on board, has to pass today with this configuration"
KEYS = "\n[service]\njog_mm_s = 50\nselftest = daily\n"


class Person:
    """Answers questions, and holds the space bar where it is asked for. answers: {pattern: what is typed}; the last question that matches counts. acts: {what
    is asked for: what the person does then}; it may return what is typed."""

    def __init__(self, bench, report, acts=(), **answers):
        self.acts = dict(acts)
        self.answers = {"Relay 1:": "y\n", "Relay [0-9]+:": "n\n", "Did it switch": "y\n", "Go on": "y\n", **answers}
        self.master, slave = pty.openpty()
        self.process = subprocess.Popen([BIN / "heavectl", "--socket", str(bench.socket), "selftest", str(report)], stdin=slave, stdout=slave,
                                        stderr=slave, start_new_session=True)
        os.close(slave)
        self.text, self.read, self.is_held, self.relay = "", 0, False, False

    def look(self):
        """Reads, and does what is asked for. Returns False at the end."""
        if select.select([self.master], [], [], KEY_S)[0]:
            try:
                self.text += os.read(self.master, 4096).decode(errors="replace")
            except OSError:
                return False
        new = self.text[self.read:]
        self.act(new)
        found = re.search(r"Relay 1:|Relay \d+:|Did it switch|Go on\?|hold a key, the space bar|goes on while|hold a key to go on|there: let go|let go of the key", new)
        if found:
            self.read += found.end()
            word = found[0]
            if word.startswith(("Relay", "Did", "Go on?")):
                self.relay = word.startswith("Relay")
                answer = next(text for pattern, text in self.answers.items() if re.match(pattern, word))
                time.sleep(0.2)  # what is typed while a question is asked is thrown away
                os.write(self.master, answer.encode())
            elif word.startswith(("hold a key,", "let go of")):  # the second: the machine was too busy to see that the key was let go
                time.sleep(0.4)
                self.is_held = True
            elif word.startswith("hold a key to") and self.relay:
                self.is_held = False
                os.write(self.master, b"q")
            elif word.startswith("hold a key to"):  # a busy machine took the key for let go
                time.sleep(0.4)
                self.is_held = True
            elif word.startswith("there") or self.relay:
                self.is_held = False
        elif self.is_held:
            os.write(self.master, b" ")
        return self.process.poll() is None

    def act(self, new):
        for asked in [asked for asked in self.acts if asked in new]:
            typed = self.acts.pop(asked)()
            if typed:
                time.sleep(0.2)
                os.write(self.master, typed.encode())

    def run(self):
        end = time.monotonic() + 120
        while self.look() and time.monotonic() < end:
            pass
        code = self.process.wait(timeout=10)
        os.close(self.master)
        return code, self.text


def bench_with(keys="", **changes):
    bench = harness.Bench(BIN, platform__engage="manual", **changes)
    text = bench.config.read_text(encoding="utf-8")
    bench.config.write_text(re.sub(r"\[service\][^\[]*", "", text) + KEYS + keys, encoding="utf-8")
    return bench


def tick(bench):
    with harness.Line(bench.socket) as line:
        return line.good("tick")


def clock_is_trusted():
    chip = Path("/sys/class/rtc/rtc0/since_epoch")
    return Path("/run/systemd/timesync/synchronized").exists() or (chip.exists() and abs(int(chip.read_text()) - time.time()) < 54000)


def passes():
    """Refused before it, allowed after it; not forgotten by a restart; asked for again with another configuration."""
    with bench_with() as bench:
        life = bench.folder / "life"
        bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("[platform]\n", f"[platform]\nlife_file = {life}\n", 1))
        report = bench.folder / "report.json"
        daemon = bench.start()
        answer, code = bench.ask("engage")
        assert code == 1 and answer["error"] == DUE and answer["state"] == "OFF", answer
        status = bench.ask("status")[0]
        assert status["selftest"] == {"when": "daily", "due": True, "day": None, "passed": None, "configuration": None}, status["selftest"]
        code, text = Person(bench, report).run()
        assert code == 0 and "self-test: passed" in text, text
        found = json.loads(report.read_text(encoding="utf-8"))
        names = [item["name"] for item in found["items"]]
        assert found["passed"] and names[0] == "relay 1" and names[-5:] == ["torque", "upper end", "lower end", "off the lower end", "brakes"], found
        assert found["configuration"] == status["configuration"]["hash"] and re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", found["when"]), found
        assert bench.ask("status")[0]["selftest"]["due"] is False
        bench.stop(daemon)
        daemon = bench.start()
        assert bench.ask("engage")[1] == 0, "it passed today"
        bench.stop(daemon)
        if not clock_is_trusted():
            daemon = bench.start(environment={"HEAVE_BOOT_ID": "0123456789abcdef" * 2})
            assert bench.ask("engage")[0]["error"] == DUE, "the machine has been started anew, and its date may be that of before"
            bench.stop(daemon)
        bench.config.write_text(bench.config.read_text(encoding="utf-8").replace("jog_mm_s = 50", "jog_mm_s = 40"))
        daemon = bench.start()
        assert bench.ask("engage")[0]["error"] == DUE, "it was another configuration"
        assert bench.ask("park")[1] == 0
        answer = bench.ask("engage")[0]
        assert answer["error"] == DUE and answer["state"] == "HOMING", f"who comes up to board does not go on from there: {answer}"
        bench.stop(daemon)


def finds():
    """A relay that does not switch; a cylinder that lags; what is left out."""
    with bench_with("selftest_following_mm = 0.05\n") as bench:
        daemon = bench.start()
        report = bench.folder / "report.json"
        code, text = Person(bench, report, **{"Did it switch": "n\n", "Go on": "s\n"}).run()
        found = {item["name"]: item for item in json.loads(report.read_text(encoding="utf-8"))["items"]}
        assert code == 1 and found["relay 1"]["result"] == "failed" and found["ends"]["result"] == "skipped", text
        code, text = Person(bench, report, **{"Relay 1:": "n\n"}).run()
        found = {item["name"]: item for item in json.loads(report.read_text(encoding="utf-8"))["items"]}
        assert code == 1 and re.fullmatch(r"cylinder \d was [0-9.]+ mm off its set-point, allowed are 0.05", found["upper end"]["note"]), found
        assert bench.ask("engage")[0]["error"] == DUE
        code, text = Person(bench, bench.folder / "missing" / "report.json", **{"Relay 1:": "n\n", "Go on": "s\n"}).run()
        assert code == 74 and "report.json: No such file or directory" in text and "self-test: failed" in text, text
        bench.stop(daemon)


def on_drives_of_a_bus():
    """CiA 402 drives of heave-twin: it passes; a brake that slips and a cylinder that is stuck are found."""
    text = (harness.TOP / "config/hexapod-cia402.ini").read_text(encoding="utf-8")
    changes = {"can.interface": f"twin{os.getpid() % 1000000}", "platform.engage": "manual", "platform.late_hold_cycles": 0}
    with tempfile.TemporaryDirectory() as folder:
        config, report = Path(folder) / "twin.ini", Path(folder) / "report.json"
        config.write_text(changed(text, changes) + KEYS, encoding="utf-8")
        with Twin(config, program=BIN / "heave-twin") as twin, Heaved(config, program=BIN / "heaved") as heaved:
            bench = SimpleNamespace(socket=heaved.socket)
            for fault, answers, item, words in ((None, {"Relay 1:": "n\n"}, None, ""), ("slip 2 0.3", {"Relay 1:": "n\n"}, "brakes", "cylinder 2 moved"),
                                                ("jam 3", {"Relay 1:": "n\n"}, "upper end", "it was not led there")):
                if fault is not None:
                    twin.fault(fault)
                code, said = Person(bench, report, **answers).run()
                found = {one["name"]: one for one in json.loads(report.read_text(encoding="utf-8"))["items"]}
                assert code == (0 if item is None else 1), said
                assert item is None or (found[item]["result"] == "failed" and words in found[item]["note"]), (item, found, said)
                twin.mend()


def nobody_there():
    """Without a terminal; killed while it moves: it comes to rest, and nothing has passed."""
    with bench_with() as bench:
        daemon = bench.start()
        done = subprocess.run([BIN / "heavectl", "--socket", str(bench.socket), "selftest"], stdin=subprocess.DEVNULL, capture_output=True, check=False)
        assert done.returncode == 64 and b"takes a terminal" in done.stderr, done
        person = Person(bench, bench.folder / "report.json", **{"Relay 1:": "n\n"})
        harness.wait_for(lambda: person.look() and tick(bench)["doing"] == "jog", "jogs")
        person.process.send_signal(signal.SIGKILL)
        person.process.wait()
        harness.wait_for(lambda: tick(bench)["doing"] == "nothing", "lets go by itself")
        status = bench.ask("status")[0]
        assert status["state"] == "SERVICE" and status["selftest"]["due"], status["selftest"]
        bench.stop(daemon)


def main():
    suite = tap.Suite()
    for name, case in (("it passes, and is kept for the day and the configuration", passes),
                       ("what it finds has failed", finds),
                       ("CiA 402 drives: it passes; a brake that slips, a cylinder that is stuck", on_drives_of_a_bus),
                       ("nobody at the terminal, or no more", nobody_there)):
        with suite.case(name):
            case()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
