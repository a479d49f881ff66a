# SPDX-License-Identifier: MIT
"""modbus_peer.py - Modbus devices by pymodbus, on TCP or behind a pseudo terminal, and between them and the program a line that damages what passes.

    with Devices("serial", units=[1, 2]) as devices, FaultyLine(devices) as line:
        line.plan[5] = Fault.LATE          # the fifth question from now
        devices.set(1, 3, 40, 4711)        # unit, function that reads it, address, value
        ... a master on line.address ...
        devices.written                    # [(unit, address, [values])] as they came in, and when: devices.written_s

Faults are events, not times: what comes late comes after the next question.
"""
import asyncio
import contextlib
import enum
import os
import select
import socket
import tempfile
import termios
import threading
import time
import tty
from pathlib import Path

import tap
from pymodbus.framer import FramerType
from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

ANSWER_S = 20  # a device that should answer
TOO_LATE_S = 2  # an answer that this machine has held back for so long is not sent: no device is as late as that
REST_S = 0.2  # for the rest of a serial frame
VALUES = 128


def crc16(data):
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def terminal():
    """A raw pseudo terminal: (descriptor of our side, path of the other)."""
    ours, other = os.openpty()
    tty.setraw(other, termios.TCSANOW)
    path = os.ttyname(other)
    os.close(other)
    return ours, path


class Devices:
    """pymodbus servers in a thread of their own: units with 128 values of each kind, or holding registers at [(first, count)]; exception 2
    elsewhere."""

    def __init__(self, kind, units=(1, 2), holding=((0, VALUES),)):
        self.kind, self.units, self.holding, self.lock = kind, units, holding, threading.Lock()
        self.written, self.written_s = [], []
        self.loop = asyncio.new_event_loop()
        self.thread = threading.Thread(target=self.loop.run_forever, daemon=True)
        self.ours = None

    def __enter__(self):
        self.thread.start()
        if self.kind == "serial":
            self.ours, self.path = terminal()
        self.run(self.start())
        return self

    def __exit__(self, *_):
        self.run(self.server.shutdown())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self.thread.join(ANSWER_S)
        self.loop.close()
        if self.ours is not None:
            os.close(self.ours)

    def run(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self.loop).result(ANSWER_S)

    async def start(self):
        def block(kind, places=((0, VALUES),)):
            return [SimData(first, count=count, values=False if kind is DataType.BITS else 0, datatype=kind) for first, count in places]
        devices = [SimDevice(unit, simdata=(block(DataType.BITS), block(DataType.BITS), block(DataType.REGISTERS, self.holding), block(DataType.REGISTERS)))
                   for unit in self.units]
        common = {"ignore_missing_devices": True, "broadcast_enable": self.kind == "serial", "trace_pdu": self.trace}
        if self.kind == "serial":
            self.server = ModbusSerialServer(devices, framer=FramerType.RTU, port=self.path, baudrate=115200, **common)
        else:
            self.server = ModbusTcpServer(devices, address=("127.0.0.1", 0), **common)
        await self.server.serve_forever(background=True)
        if self.kind != "serial":
            self.port = self.server.transport.sockets[0].getsockname()[1]

    def trace(self, is_sending, pdu):
        if not is_sending and pdu.function_code in (5, 6, 15, 16):
            values = pdu.bits if pdu.function_code in (5, 15) else pdu.registers
            with self.lock:
                self.written.append((pdu.dev_id, pdu.address, list(values)))
                self.written_s.append(time.monotonic())
        return pdu

    def set(self, unit, function, address, *values):
        self.run(self.server.async_setValues(unit, function, address, list(values)))

    def get(self, unit, function, address):
        return self.run(self.server.async_getValues(unit, function, address, 1))[0]

    def written_since(self, count):
        """What came in after the first so many: [(when, unit, address, [values])]."""
        with self.lock:
            return [(at_s, *what) for at_s, what in zip(self.written_s[count:], self.written[count:])]

    def values_written(self, unit, address):
        with self.lock:
            return [values[0] for at, where, values in self.written if (at, where) == (unit, address)]


@contextlib.contextmanager
def judged_whatever():
    """Around what drives have received: what is wrong there is wrong however slow their line was."""
    try:
        yield
    except AssertionError as error:
        raise tap.Fault(str(error)) from error


def steps(setpoints):
    """[(step, s)] from each set-point to the next, of [(when it came in, set-point)]: how far, and within what time the gateway has asked for both at most.
    When it asked for one is not known; the one before that had come in by then."""
    for before, (_, last), (at_s, now) in zip([setpoints[0], *setpoints], setpoints, setpoints[1:]):
        yield abs(now - last), at_s - before[0]


class Fault(enum.Enum):
    """What happens to a question or its answer."""
    SILENT = "the device acts and its answer is lost"
    LOST = "the question is lost"
    LATE = "the answer comes right after the next question"
    HALF = "half of the answer comes, the rest never"
    HALF_LATE = "half of the answer comes, the rest right after the next question"
    DAMAGED = "a byte of the answer is wrong"
    MISLABELLED = "the answer bears another unit (serial) or another transaction (TCP)"
    FOREIGN = "the answer is one to another function"
    NOISE = "the answer comes behind bytes of noise"
    EXCEPTION = "the device answers with exception 6 and does nothing"
    CUT = "the connection is cut, or the adapter unplugged and plugged in again"


class FaultyLine:
    """Passes questions and answers on, one at a time, and applies the plan: {number of the question from 1: Fault}."""

    def __init__(self, devices):
        self.devices, self.plan, self.asked, self.held = devices, {}, 0, []
        self.delay_s = lambda number: 0.0
        self.silent = set()  # units that hear nothing
        self.is_serial = devices.kind == "serial"
        self.is_ending, self.is_unplugged = False, False
        self.client = None
        self.done = threading.Event()

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory(prefix="heave-")
        if self.is_serial:
            self.path = Path(self.folder.name) / "usb-adapter"
            self.address = (str(self.path), "115200")
            self.plug_in()
        else:
            self.listen(0)
            self.address = ("127.0.0.1", str(self.listener.getsockname()[1]))
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.is_ending = True
        self.thread.join(ANSWER_S)
        self.drop_client()
        if not self.is_serial:
            self.listener.close()
        self.folder.cleanup()

    # --- The master's side ---

    def listen(self, port):
        self.listener = socket.socket()
        self.listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.listener.bind(("127.0.0.1", port))
        self.listener.listen(4)

    def plug_in(self):
        self.client, path = terminal()
        fresh = self.path.with_suffix(".new")
        fresh.symlink_to(path)
        fresh.rename(self.path)

    def drop_client(self):
        if self.client is not None:
            if self.is_serial:
                with contextlib.suppress(FileNotFoundError):
                    self.path.unlink()
                os.close(self.client)
            else:
                self.client.close()
                self.server_side.close()
        self.client = None
        self.held = []

    def accept(self):
        """TCP: a master that comes takes the place of the one before."""
        if self.is_serial or not self.is_ready(self.listener, 0):
            return
        fresh, _ = self.listener.accept()
        self.drop_client()
        self.client = fresh
        self.server_side = socket.create_connection(("127.0.0.1", self.devices.port))

    def unplug(self):
        """From now on there is nothing to plug in; plug() brings it back."""
        self.is_unplugged = True
        self.wait_until(lambda: self.client is None)

    def plug(self):
        self.is_unplugged = False

    @staticmethod
    def wait_until(condition):
        end = time.monotonic() + ANSWER_S
        while not condition() and time.monotonic() < end:
            time.sleep(0.005)

    @staticmethod
    def is_ready(source, wait_s):
        poller = select.poll()
        poller.register(source, select.POLLIN)
        return any(event & select.POLLIN for _, event in poller.poll(wait_s * 1000))

    def read(self, side, count):
        """Exactly so many bytes; b"" where the other end is gone."""
        data = b""
        end = time.monotonic() + ANSWER_S
        while len(data) < count and not self.is_ending and time.monotonic() < end:
            if self.is_ready(side, 0.05):
                try:
                    more = os.read(side if isinstance(side, int) else side.fileno(), count - len(data))
                except OSError:
                    more = b""
                if not more:
                    return b""
                data += more
        return data if len(data) == count else b""

    def read_tcp(self, side):
        head = self.read(side, 6)
        return head and head + self.read(side, int.from_bytes(head[4:6], "big"))

    def read_question(self):
        if not self.is_serial:
            return self.read_tcp(self.client)
        return self.last_frame()

    def last_frame(self):
        """A master that has sent several has given all but the last up, and devices do not queue."""
        data, frame = b"", b""
        while self.is_ready(self.client, REST_S if data else 0):
            with contextlib.suppress(OSError):
                data += os.read(self.client, 4096)
            while len(data) >= 8 and len(data) >= (length := data[6] + 9 if data[1] in (15, 16) else 8):
                frame, data = data[:length], data[length:]
            if not data:
                return frame
        return b""

    def read_answer(self, question):
        if not self.is_serial:
            return self.read_tcp(self.server_side)
        if question[0] == 0:
            return b""
        head = self.read(self.devices.ours, 3)
        if not head:
            return b""
        return head + self.read(self.devices.ours, 2 if head[1] & 0x80 else head[2] + 2 if head[1] <= 4 else 5)

    @staticmethod
    def send(side, data):
        with contextlib.suppress(OSError):
            os.write(side if isinstance(side, int) else side.fileno(), data)

    # --- What is done to answers ---

    def relabel(self, answer, place, value):
        answer = bytearray(answer)
        answer[place] = value
        return bytes(answer[:-2]) + crc16(answer[:-2]) if self.is_serial else bytes(answer)

    def exception_to(self, question):
        if self.is_serial:
            body = bytes([question[0], question[1] | 0x80, 6])
            return body + crc16(body)
        return question[:4] + bytes([0, 3, question[6], question[7] | 0x80, 6])

    def deliver(self, fault, answer):
        """What arrives now; what arrives after the next question goes to held."""
        half = len(answer) // 2
        if fault in (Fault.SILENT, Fault.LOST):
            return b""
        if fault is Fault.LATE:
            self.held.append(answer)
            return b""
        if fault in (Fault.HALF, Fault.HALF_LATE):
            self.held += [answer[half:]] if fault is Fault.HALF_LATE else []
            return answer[:half]
        if fault is Fault.DAMAGED:
            return answer[:-1] + bytes([answer[-1] ^ 0x10]) if self.is_serial else answer[:7] + bytes([answer[7] ^ 0x40]) + answer[8:]
        if fault is Fault.MISLABELLED:
            return self.relabel(answer, 0, answer[0] + 1) if self.is_serial else self.relabel(answer, 1, answer[1] ^ 0x55)
        if fault is Fault.FOREIGN:
            return self.relabel(answer, 1 if self.is_serial else 7, {3: 4, 4: 3, 1: 2, 2: 1, 5: 6, 6: 5, 15: 16, 16: 15}.get(answer[1 if self.is_serial else 7], 3))
        if fault is Fault.NOISE:
            return b"\x00\xff\x13" + answer
        return answer

    def pass_on(self, question):
        self.asked += 1
        number, asked_s = self.asked, time.monotonic()
        fault = self.plan.pop(number, None)
        held, self.held = self.held, []
        for late in held:
            self.send(self.client, late)
        if fault is Fault.EXCEPTION:
            self.send(self.client, self.exception_to(question))
            return
        unit = question[0] if self.is_serial else question[6]
        if fault is Fault.LOST or unit in self.silent:
            return
        self.send(self.devices.ours if self.is_serial else self.server_side, question)
        answer = self.read_answer(question) if unit in self.devices.units else b""
        if time.monotonic() - asked_s > TOO_LATE_S:
            return
        time.sleep(self.delay_s(number))
        if fault is Fault.CUT:
            self.drop_client()
            if self.is_serial:
                self.plug_in()
        elif answer:
            self.send(self.client, self.deliver(fault, answer))

    def work(self):
        while not self.is_ending:
            if self.is_unplugged:
                if self.client is not None or not self.is_serial and self.listener.fileno() >= 0:
                    self.drop_client()
                    if not self.is_serial:
                        self.listener.close()
                time.sleep(0.005)
                continue
            if self.is_serial and self.client is None:
                self.plug_in()
            if not self.is_serial and self.listener.fileno() < 0:
                self.listen(int(self.address[1]))
            self.accept()
            if self.client is not None and self.is_ready(self.client, 0.02):
                question = self.read_question()
                if question:
                    self.pass_on(question)
                elif not self.is_serial:
                    self.drop_client()
            elif self.client is None:
                time.sleep(0.005)
            elif self.is_serial:
                time.sleep(0.001)  # a terminal that nobody has open is always ready
