# SPDX-License-Identifier: MIT
"""web_socket.py - a WebSocket client (RFC 6455) that can also misbehave, and with it a browser (Chrome DevTools Protocol).

    with WebSocket("127.0.0.1", 9801, "/ws", protocol="heave-panel.1") as link:
        link.send({"id": 1, "op": "status", "platform": "ride"})
        link.receive(lambda message: message.get("event") == "status")
"""
import base64
import contextlib
import itertools
import json
import os
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
import time
import urllib.request
from pathlib import Path

WAIT_S = 60  # for what comes as soon as the machine has time
NUMBERS = itertools.count(1)
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10


class Refused(Exception):
    """The server's status line."""


class WebSocket:
    def __init__(self, host, port, path, protocol=None, origin=None, host_header=None, cookie=None, timeout=WAIT_S, context=None, source=None):
        self.blocks, self.waiting = [], b""
        self.socket = socket.create_connection((host, port), timeout=timeout, source_address=source and (source, 0))
        if context is not None:
            self.socket = context.wrap_socket(self.socket, server_hostname=host)
        name = host_header or f"{host}:{port}"
        rows = [f"GET {path} HTTP/1.1", f"Host: {name}", "Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}",
                "Sec-WebSocket-Version: 13"]
        rows += [f"Sec-WebSocket-Protocol: {protocol}"] if protocol else []
        rows += [f"Origin: {origin}"] if origin else []
        rows += [f"Cookie: {cookie}"] if cookie else []
        self.socket.sendall("\r\n".join([*rows, "", ""]).encode())
        head = b""
        while b"\r\n\r\n" not in head:
            more = self.socket.recv(4096)
            if not more:
                raise Refused(head.decode(errors="replace").split("\r\n", maxsplit=1)[0] or "closed")
            head += more
        head, self.waiting = head.split(b"\r\n\r\n", 1)
        if b" 101 " not in head.split(b"\r\n", 1)[0]:
            raise Refused(head.decode(errors="replace").split("\r\n", maxsplit=1)[0])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def frame(self, opcode, data, final=True):
        mask = os.urandom(4)
        length = len(data)
        size = bytes([0x80 | length]) if length < 126 else b"\xfe" + struct.pack(">H", length) if length < 65536 else b"\xff" + struct.pack(">Q", length)
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(data))
        self.socket.sendall(bytes([(0x80 if final else 0) | opcode]) + size + mask + masked)

    def send(self, message):
        self.frame(TEXT, json.dumps(message).encode())

    def _read(self, count):
        while len(self.waiting) < count:
            more = self.socket.recv(65536)
            if not more:
                raise ConnectionError("closed by the server")
            self.waiting += more
        data, self.waiting = self.waiting[:count], self.waiting[count:]
        return data

    def next(self):
        """(opcode, data) of the next message that is no control frame."""
        data, opcode = b"", 0
        while True:
            first, second = self._read(2)
            length = second & 0x7F
            length = struct.unpack(">H", self._read(2))[0] if length == 126 else struct.unpack(">Q", self._read(8))[0] if length == 127 else length
            part = self._read(length)
            if first & 0x0F == PING:
                self.frame(PONG, part)
            elif first & 0x0F == CLOSE:
                raise ConnectionError("closed by the server")
            elif first & 0x0F != PONG:
                data, opcode = data + part, opcode or first & 0x0F
                if first & 0x80:
                    return opcode, data

    def receive(self, wanted=lambda message: True, timeout=WAIT_S):
        """The next text message of that kind; binary ones are kept in blocks."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            opcode, data = self.next()
            if opcode == BINARY:
                self.blocks.append(data)
                continue
            message = json.loads(data)
            if wanted(message):
                return message
        raise TimeoutError("no such message")

    def ask(self, message):
        number = next(NUMBERS)  # one count for all: several threads may ask, each for its own answer
        self.send({"id": number, **message})
        return self.receive(lambda answer: answer.get("id") == number)


def browser():
    """Debian's Chromium, or None."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


class Page:
    """A page in a browser of its own."""

    def __init__(self, url, width=390, height=844, language="en", more=()):
        self.folder = tempfile.TemporaryDirectory(prefix="heave-browser-")
        self.process = subprocess.Popen([browser(), "--headless=new", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run", "--remote-debugging-port=0", "--remote-allow-origins=*",
                                         f"--lang={language}", f"--user-data-dir={self.folder.name}", f"--window-size={width},{height}", *more, url], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                        env={**os.environ, "TMPDIR": self.folder.name}, start_new_session=True)  # it leaves folders there where it is killed
        port_file = Path(self.folder.name) / "DevToolsActivePort"
        end = time.monotonic() + 60
        while (not port_file.exists() or not port_file.read_text(encoding="ascii").strip()) and time.monotonic() < end:
            time.sleep(0.1)
        self.port = int(port_file.read_text(encoding="ascii").split()[0])
        target = None
        while target is None and time.monotonic() < end:
            with contextlib.suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{self.port}/json", timeout=5) as answer:
                target = next((one for one in json.load(answer) if one["type"] == "page"), None)
        self.link = WebSocket("127.0.0.1", self.port, "/" + target["webSocketDebuggerUrl"].split("/", 3)[3], timeout=60)
        self.count, self.problems = 0, []
        self.do("Runtime.enable")
        self.do("Log.enable")
        self.do("Page.enable")
        self.do("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.link.socket.close()
        self.kill()
        with contextlib.suppress(OSError):
            self.folder.cleanup()

    def kill(self, number=signal.SIGKILL):
        """All of the browser at once: it is many processes."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, number)
        if number == signal.SIGKILL:
            self.process.wait()

    def do(self, method, **parameters):
        end = time.monotonic() + WAIT_S
        while True:
            message = self.answer(method, parameters)
            # nothing can be asked of a page that is just being replaced by the next one
            if message.get("error", {}).get("message") != "Not attached to an active page" or time.monotonic() > end:
                assert "error" not in message, message
                return message["result"]

    def answer(self, method, parameters):
        self.count += 1
        self.link.send({"id": self.count, "method": method, "params": parameters})
        while True:
            message = json.loads(self.link.next()[1])
            if message.get("id") == self.count:
                return message
            if message.get("method") == "Runtime.exceptionThrown":
                self.problems.append(message["params"]["exceptionDetails"].get("exception", {}).get("description", "an exception"))
            if message.get("method") == "Log.entryAdded" and message["params"]["entry"]["level"] == "error":
                self.problems.append(message["params"]["entry"]["text"])

    def run(self, script):
        """The value of an expression in the page; a promise is waited for."""
        result = self.do("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"].get("exception", {}).get("description", result)
        return result["result"].get("value")

    def wait(self, script, what, timeout=WAIT_S):
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            with contextlib.suppress(AssertionError):  # the page is not there yet
                if self.run(script):
                    return
            time.sleep(0.1)
        raise AssertionError(f"{what}: not within {timeout} s; the page says {self.run('document.body.innerText')[:600]!r}")

    def picture(self, path):
        Path(path).write_bytes(base64.b64decode(self.do("Page.captureScreenshot", format="png")["data"]))
