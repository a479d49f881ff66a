#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""test_modbus_line.py - the Modbus lines of hal/linux against pymodbus, with everything that can go wrong between the two.

usage: test_modbus_line.py PROGRAM [--guard LIBRARY] [--only WORDS]
PROGRAM is tests/peers/modbus_line. Runs itself again with the Python of tools/lib/venv.sh, which has pymodbus.

Whatever happens: what is reported as read is what the device had when it was asked; set-points arrive in order, none twice, none after a
newer one; the line works again by itself. Nothing here depends on how fast the machine is: what comes late comes
after the next question, and a question that a busy machine lets time out is asked again."""
import concurrent.futures
import os
import random
import socket
import subprocess
import sys
import time
from pathlib import Path

import tap

TOP = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(TOP / "tests/peers"))
LONG_US, SHORT_US = 500000, 50000
TRIES = 10
PATIENCE_S = 60
FINE, NO_DEVICE, REFUSED, UNREACHABLE = 0, 2, 7, 8
HOLDING, INPUT = 3, 4
KINDS = ("tcp", "serial")


def option(name, fallback):
    return sys.argv[sys.argv.index(name) + 1] if name in sys.argv else fallback


GUARD = option("--guard", None)


class Master:
    """The program under test."""

    def __init__(self, program, kind, address, timeout_us=LONG_US, **more):
        self.process = subprocess.Popen([program, kind, *address, str(timeout_us)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, **more)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        try:
            assert self.process.wait(PATIENCE_S) == 0, f"the program ended with {self.process.returncode}"
        finally:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()

    def order(self, text):
        self.process.stdin.write(text + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def ask(self, function, unit, address, count, *values, slot=0):
        """(status, exception, values)"""
        words = self.order(f"ask {slot} {function} {unit} {address} {count} {' '.join(map(str, values))}").split()
        assert len(words) >= 3, f"the program says {words}"
        return words[0], int(words[1]), [int(word) for word in words[3:]]

    def surely(self, function, unit, address, values):
        """Writes the next value until it is acknowledged: the machine may be busy for longer than the timeout."""
        end = time.monotonic() + PATIENCE_S
        for value in values:
            status = self.ask(function, unit, address, 1, value)
            if status[0] == "ok":
                return value
            assert time.monotonic() < end, f"no write works: {status}, {self.status()}"
            time.sleep(0.01)
        raise AssertionError("out of values")

    def flood(self, unit, address, first, last):
        return [int(word) for word in self.order(f"flood 0 {unit} {address} {first} {last}").split()]

    def status(self):
        """trouble, transactions, links, strays, probes, replaced, text"""
        words = self.order("status").split(None, 6)
        return [int(word) for word in words[:6]] + [words[6] if len(words) > 6 else ""]

    def wait_for_trouble(self, trouble):
        end = time.monotonic() + PATIENCE_S
        while self.status()[0] != trouble:
            assert time.monotonic() < end, f"not {trouble} but {self.status()}"
            time.sleep(0.02)
        return self.status()[6]


class Reader:
    """Reads a register that has another value each time, so that an old answer gives itself away."""

    def __init__(self, master, devices, unit=1, function=HOLDING):
        self.master, self.devices, self.unit, self.function, self.value = master, devices, unit, function, 1000

    def read(self):
        self.value += 1
        self.devices.set(self.unit, self.function, 40, self.value)
        status, exception, values = self.master.ask(self.function, self.unit, 40, 1)
        assert status != "ok" or values == [self.value], f"read {values} where the device has {self.value}: an old answer"
        assert status == "ok" or values == [], f"values of a failed read: {values}"
        return status, exception

    def recover(self):
        """Reads until it works; how often it did not."""
        failures, end = 0, time.monotonic() + PATIENCE_S
        while self.read()[0] != "ok":
            failures += 1
            assert time.monotonic() < end, f"no read works after the fault has passed: {self.master.status()}"
            time.sleep(0.01)
        return failures


def in_order(values, what):
    assert all(a < b for a, b in zip(values, values[1:])), f"{what}: a set-point twice or behind a newer one: {values}"


def every_function(program, kind):
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address, 9000000) as master:
        for unit in devices.units:
            for n, function in enumerate((1, 2, 3, 4)):
                devices.set(unit, function, 7, True if function < 3 else 300 * unit + n)
                assert master.ask(function, unit, 6, 2) == ("ok", 0, [0, 1 if function < 3 else 300 * unit + n]), (unit, function)
            assert master.ask(6, unit, 20, 1, 65535)[0] == "ok" and devices.get(unit, 3, 20) == 65535
            assert master.ask(16, unit, 21, 3, 1, 2, 40000)[0] == "ok" and [devices.get(unit, 3, 21 + i) for i in range(3)] == [1, 2, 40000]
            assert master.ask(5, unit, 30, 1, 1)[0] == "ok" and devices.get(unit, 1, 30)
            assert master.ask(15, unit, 31, 10, 1, 0, 1, 1, 0, 0, 0, 1, 1, 1)[0] == "ok"
            assert [int(devices.get(unit, 1, 31 + i)) for i in range(10)] == [1, 0, 1, 1, 0, 0, 0, 1, 1, 1]
            assert master.ask(3, unit, 127, 2) == ("state", 2, [])
        assert master.ask(3, 1, 0, 64)[0] == "ok" and master.ask(16, 2, 0, 64, *range(64))[0] == "ok"
        if kind == "serial":
            assert master.ask(16, 0, 50, 2, 11, 12)[0] == "ok"
            peer.FaultyLine.wait_until(lambda: len(devices.values_written(0, 50)) == 1 and all(devices.get(unit, 3, 50 + i) == 11 + i for unit in (1, 2) for i in (0, 1)))
            assert master.ask(5, 0, 60, 1, 1)[0] == "ok"
            peer.FaultyLine.wait_until(lambda: len(devices.values_written(0, 60)) == 1 and devices.get(2, 1, 60))
            assert master.ask(3, 1, 50, 2)[2] == [11, 12] and master.ask(3, 2, 50, 2)[2] == [11, 12] and master.ask(1, 2, 60, 1)[2] == [1]


def outcomes(fault):
    """What may be reported of the transaction that a fault hits."""
    return {peer.Fault.EXCEPTION: {"state"}, peer.Fault.DAMAGED: {"format"}, peer.Fault.MISLABELLED: {"format"}, peer.Fault.FOREIGN: {"format"},
            peer.Fault.CUT: {"io"}, peer.Fault.NOISE: {"format", "timeout"}}.get(fault, {"timeout"})


def one_fault(program, kind, fault):
    """Alone, on reads and on writes. A busy machine may add timeouts of its own; then once more."""
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address) as master:
        reader, other = Reader(master, devices), Reader(master, devices, unit=2)

        def inject(transaction, wanted):
            for _ in range(TRIES):
                reader.recover()
                line.plan = {line.asked + 1: fault}
                status, exception = transaction()[:2]
                if status in wanted:
                    assert exception == (6 if fault is peer.Fault.EXCEPTION else 0), exception
                    return
                assert status in ("timeout", "ok") and (status != "ok" or line.plan), f"reported as {status}"
            raise AssertionError(f"never reported as {wanted} in {TRIES} tries")

        for _ in range(2):
            inject(reader.read, outcomes(fault))
            other.recover()
            reader.recover()
        values = iter(range(1, 1000))
        inject(lambda: master.ask(16, 1, 70, 1, next(values)), outcomes(fault))
        reader.recover()
        master.surely(16, 1, 70, values)
        in_order(devices.values_written(1, 70), "writes")


def late_for_ever(program, kind):
    """Every answer comes right after the next question: none may be taken for that one's."""
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address, 100000) as master:
        reader = Reader(master, devices)
        reader.read()
        for number in range(line.asked + 1, line.asked + 200):
            line.plan[number] = peer.Fault.LATE
        assert {reader.read()[0] for _ in range(12)} <= {"timeout", "format", "io"}
        for value in range(1, 9):
            assert master.ask(6, 1, 70, 1, value)[0] != "ok", "an answer to an earlier write was taken for this one's"
        in_order(devices.values_written(1, 70), "late")
        line.plan.clear()
        reader.recover()


def slow_devices(program, kind):
    """Answers later than the timeout by the clock, 20 to 500 ms: what counts is that no answer is taken for another question's."""
    delays = [0.02, 0.1, 0.06, 0.5, 0.045, 0.2, 0.055, 0.3, 0.05, 0.4]
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address, SHORT_US) as master:
        reader = Reader(master, devices)
        line.delay_s = lambda number: delays[number % len(delays)] if number < 40 else 0.0
        for value in range(1, 25):
            reader.read()
            master.ask(16, 1, 70, 1, value)
        in_order(devices.values_written(1, 70), "slow")
        line.delay_s = lambda number: 0.0
        reader.recover()


def storm(program, kind):
    """Faults at random, reads and writes to two units by turns."""
    chance = random.Random(4711)
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address, 150000) as master:
        faults = [fault for fault in peer.Fault if fault is not peer.Fault.CUT] + [peer.Fault.CUT]
        readers = [Reader(master, devices, unit, function) for unit in devices.units for function in (HOLDING, INPUT)]
        for number in range(1, 1000):
            if chance.random() < 0.2:
                line.plan[number] = chance.choice(faults)
        good = 0
        for value in range(1, 41):
            good += chance.choice(readers).read()[0] == "ok"
            unit = chance.choice(devices.units)
            if master.ask(16, unit, 70, 1, value)[0] == "ok":
                assert devices.get(unit, 3, 70) == value, "a write that was acknowledged is not there"
        assert good > 0, "not one of 40 reads worked"
        for unit in devices.units:
            in_order(devices.values_written(unit, 70), "storm")
        line.plan.clear()
        for reader in readers:
            reader.recover()


def newest_wins(program, kind):
    """A set-point every millisecond, a slow device, answers missing, a cut: those that arrive arrive in order, and the last one does."""
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address, 100000) as master:
        line.delay_s = lambda number: 0.005
        line.plan.update({5: peer.Fault.SILENT, 12: peer.Fault.LOST, 20: peer.Fault.LATE, 28: peer.Fault.CUT, 36: peer.Fault.DAMAGED})
        results, failures = master.flood(1, 80, 1, 1000)
        arrived = devices.values_written(1, 80)
        replaced = master.status()[5]
        in_order(arrived, "flood")
        assert failures <= results <= 1000 - replaced, (results, failures, replaced)
        assert len(arrived) <= 1000 - replaced < 1000, f"{len(arrived)} arrived, {replaced} were replaced by newer ones"
        line.plan.clear()
        last = master.surely(16, 1, 80, range(1001, 2000))
        assert devices.get(1, 3, 80) == last, "what was acknowledged is not the newest"
        in_order(devices.values_written(1, 80), "flood")


def comes_back(program, kind):
    """Unplugged, or the host gone: named, every request fails at once, and when it is back nothing old is sent."""
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line, Master(program, kind, line.address) as master:
        reader = Reader(master, devices)
        reader.read()
        for _ in range(2):
            line.unplug()
            text = master.wait_for_trouble(NO_DEVICE if kind == "serial" else REFUSED)
            assert line.address[0] in text and ("plugged in" in text if kind == "serial" else "refused" in text), text
            before = len(devices.written)
            assert master.flood(1, 80, 1, 50)[1] > 0 and master.ask(3, 1, 0, 1)[0] == "io"
            line.plug()
            assert master.wait_for_trouble(FINE) == ""
            reader.recover()
            assert devices.written[before:] == [], f"sent after the return: {devices.written[before:]}"


def allocates_nothing(program, kind):
    """Neither side of the hand-over, whatever happens to the link."""
    if GUARD is None:
        raise tap.Skip("no allocator of our own under the sanitizers")
    with peer.Devices(kind) as devices, peer.FaultyLine(devices) as line:
        with Master(program, kind, line.address, 100000, env={**os.environ, "LD_PRELOAD": GUARD}) as master:
            reader = Reader(master, devices)
            reader.recover()
            assert master.order("started") == "started"
            for fault in (peer.Fault.SILENT, peer.Fault.DAMAGED, peer.Fault.LATE, peer.Fault.CUT):
                line.plan[line.asked + 1] = fault
                reader.read()
                reader.recover()
            line.unplug()
            master.wait_for_trouble(NO_DEVICE if kind == "serial" else REFUSED)
            line.plug()
            reader.recover()


def nobody_answers(program, _kind):
    """A host that takes no connection: a full listener drops what knocks, as a host does that is switched off."""
    with socket.socket() as listener, socket.socket() as first, socket.socket() as second:
        listener.bind(("127.0.0.1", 0))
        listener.listen(0)
        for knock in (first, second):
            knock.setblocking(False)
            knock.connect_ex(listener.getsockname())
        with Master(program, "tcp", ("127.0.0.1", str(listener.getsockname()[1])), 100000) as master:
            text = master.wait_for_trouble(UNREACHABLE)
            assert "switched on" in text, text
            assert master.ask(3, 1, 0, 1)[0] == "io"


CASES = [
    ("every function brings and sends what it should", every_function, KINDS),
    ("an answer that is always late is never taken for the next one's", late_for_ever, KINDS),
    ("answers 20 to 500 ms late", slow_devices, KINDS),
    ("faults at random: no old value, no set-point out of order", storm, KINDS),
    ("the newest set-point wins, none arrives behind a newer one", newest_wins, KINDS),
    ("gone and back: named, at once an error, nothing old is sent", comes_back, KINDS),
    ("nothing is allocated after the start", allocates_nothing, KINDS),
    ("a host that does not answer is named", nobody_answers, ("tcp",)),
]


def main():
    tap.needs_package("pymodbus")
    globals()["peer"] = __import__("modbus_peer")
    cases = [(f"{name}, {kind}", case, (kind,)) for name, case, kinds in CASES for kind in kinds]
    cases += [(f"once {fault.value}: it hits that transaction alone, {kind}", one_fault, (kind, fault)) for fault in peer.Fault for kind in KINDS]
    chosen = [row for row in cases if option("--only", "") in row[0]]
    suite = tap.Suite()
    with concurrent.futures.ThreadPoolExecutor(6) as pool:  # they mostly wait
        running = [(name, pool.submit(case, sys.argv[1], *rest)) for name, case, rest in chosen]
        for name, future in running:
            with suite.case(name):
                future.result()
    return suite.done()


if __name__ == "__main__":
    sys.exit(main())
