# SPDX-License-Identifier: MIT
"""sender.py - sends frames to a platform over UDP, one by one, as a stream, or as they were recorded."""
from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from heave import recording
from heave.errors import FrameError
from heave.frames import frame

if TYPE_CHECKING:
    from heave.platform import Platform

RATE_MAX_HZ = 1000.0
BACKLOG_US = 20_000  # a recording that is further behind goes on later instead of all at once


@dataclass
class Sent:
    """What became of a stream or a recording."""
    frames: int = 0        # datagrams that went out
    skipped: int = 0       # samples of a stream whose time had passed: never made up for in a burst
    latest_ms: float = 0.0  # how late the latest one that went out was
    held_ms: float = 0.0   # a recording: by how much it went on later, in all
    requests: int = 0      # of a recording, made
    passed_over: int = 0   # of a recording, without a platform to make them to


class Sender:
    """A sender of frames. Each has a port of its own: to heaved, two are two senders."""

    def __init__(self, host: str = "127.0.0.1", port: int = 9800):
        if not 0 < port < 65536:
            raise FrameError(f"port: {port!r} is not within 1 and 65535")
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self.link = socket.socket(family, socket.SOCK_DGRAM)
        self.link.connect(address)

    def __enter__(self) -> Sender:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.link.close()

    def send(self, text: str | bytes) -> None:
        """One datagram, whatever is in it. Where nobody listens nothing is said: the protocol goes one way."""
        try:
            self.link.send(text if isinstance(text, bytes) else text.encode("latin-1"))
        except ConnectionRefusedError:  # the answer to an earlier one: it took the place of this one
            try:
                self.link.send(text if isinstance(text, bytes) else text.encode("latin-1"))
            except ConnectionRefusedError:
                pass

    def command(self, name: str, values: Sequence[float], *, mask: int | None = None, time_ms: float | None = None) -> None:
        """One frame: `command("A6", (0, 0, 0, 0, 0, 20), time_ms=2000)`."""
        self.send(frame(name, values, mask=mask, time_ms=time_ms))

    def a3(self, roll: float = 0, pitch: float = 0, z: float = 0, *, mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("A3", (roll, pitch, z), mask=mask, time_ms=time_ms)

    def a4(self, roll: float = 0, pitch: float = 0, z: float = 0, angle: float = 0, *, mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("A4", (roll, pitch, z, angle), mask=mask, time_ms=time_ms)

    def a6(self, roll: float = 0, pitch: float = 0, yaw: float = 0, x: float = 0, y: float = 0, z: float = 0, *,
           mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("A6", (roll, pitch, yaw, x, y, z), mask=mask, time_ms=time_ms)

    def a7(self, roll: float = 0, pitch: float = 0, yaw: float = 0, x: float = 0, y: float = 0, z: float = 0, angle: float = 0, *,
           mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("A7", (roll, pitch, yaw, x, y, z, angle), mask=mask, time_ms=time_ms)

    def c3(self, c1: float, c2: float, c3: float, *, mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("C3", (c1, c2, c3), mask=mask, time_ms=time_ms)

    def c6(self, c1: float, c2: float, c3: float, c4: float, c5: float, c6: float, *, mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("C6", (c1, c2, c3, c4, c5, c6), mask=mask, time_ms=time_ms)

    def c7(self, c1: float, c2: float, c3: float, c4: float, c5: float, c6: float, angle: float, *,
           mask: int | None = None, time_ms: float | None = None) -> None:
        self.command("C7", (c1, c2, c3, c4, c5, c6, angle), mask=mask, time_ms=time_ms)

    def stream(self, source: Callable[[float], str] | Iterable[str], rate_hz: float, seconds: float | None = None) -> Sent:
        """A frame each 1 / rate_hz s. source: a function of the time in s since the start, or the frames themselves, which end it.

        The nth frame is due n periods after the first, by the monotonic clock: nothing adds up. What is a period late or more is left out and
        counted, never sent in a burst; a function is asked for the time at which its frame was due."""
        if not 0 < rate_hz <= RATE_MAX_HZ:
            raise FrameError(f"rate_hz: {rate_hz!r} is not above 0 and up to {RATE_MAX_HZ:g}")
        if seconds is None and callable(source):
            raise FrameError("seconds: how long is needed where the frames are a function")
        count = None if seconds is None else max(0, round(seconds * rate_hz))
        frames = None if callable(source) else iter(source)
        sent, start, n = Sent(), time.monotonic(), 0
        while count is None or n < count:
            due = start + n / rate_hz
            wait_until(due)
            text = source(n / rate_hz) if frames is None else next(frames, None)  # type: ignore[operator]
            if text is None:
                break
            late_s = time.monotonic() - due  # what took long may have been the source
            n += 1
            if late_s * rate_hz >= 1:
                sent.skipped += 1
                continue
            self.send(text)
            sent.frames += 1
            sent.latest_ms = max(sent.latest_ms, late_s * 1000)
        return sent

    def play(self, recorded: str | os.PathLike[str] | Iterable[recording.Line], *, speed: float = 1.0, platform: Platform | None = None) -> Sent:
        """A recording (FRAMES, or CSV by its name, or lines) at its own times, by the monotonic clock. Nothing is left out; where this machine
        was held up, the rest comes later with the times between frames as they are, not in a burst.

        platform: the requests in it (!engage, !hold, ...) are made there; without one they are passed over."""
        if not 0 < speed <= 100:
            raise FrameError(f"speed: {speed!r} is not above 0 and up to 100")
        lines = recording.read(recorded) if isinstance(recorded, (str, os.PathLike)) else list(recorded)
        sent, start = Sent(), time.monotonic()
        for line in lines:
            due = start + line.t_us / 1e6 / speed
            wait_until(due)
            late_s = time.monotonic() - due
            if late_s * 1e6 > BACKLOG_US:
                start += late_s
                sent.held_ms += late_s * 1000
            sent.latest_ms = max(sent.latest_ms, late_s * 1000)
            if not line.is_request:
                self.send(line.text)
                sent.frames += 1
            elif platform is not None:
                platform.request(line.text[1:])
                sent.requests += 1
            else:
                sent.passed_over += 1
        return sent


def wait_until(due: float) -> None:
    """Until then on the monotonic clock."""
    while (left := due - time.monotonic()) > 0:
        time.sleep(left)
