# SPDX-License-Identifier: MIT
"""samples.py - every cycle of a heaved, out of the memory that it shares: views of the ring without a copy, and whole records. docs/samples.md is the layout.

    with platform.samples() as samples:
        run = samples.read(["t_ms", "sent_z_mm", "actual_z_mm"])    # what has come since the last read, as arrays
        samples.view("sent_z_mm")                                   # the ring itself, raw counts; heaved goes on writing into it

A reader that is slow loses records and is told how many: samples.lost. It never holds heaved up.
"""
from __future__ import annotations

import json
import mmap
import os
import socket
import struct
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from heave.errors import HeaveError, NotRunning, Refused

if TYPE_CHECKING:
    import numpy
    import numpy.typing

    Array = numpy.typing.NDArray[Any]

MAGIC, VERSION = b"HEAVESMP", 1
HEADER = struct.Struct("=8s7I4x2Q")  # up to start_realtime_ns
HEADER_BYTES, WRITTEN_AT = 128, 56
COLUMN = struct.Struct("=32s12s4sI4xd")
TYPES = {"u1", "u2", "u4", "u8", "i2", "i4", "i8"}
SEQUENCE = "sequence number"  # no column has a blank in its name


class SamplesError(HeaveError):
    """The memory is not as this reader knows it, or a column is not there."""


def receive(path: str | os.PathLike[str], timeout: float) -> int:
    """The descriptor that heaved hands out; the caller closes it."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(timeout)
        try:
            link.connect(os.fspath(path))
            link.sendall(b"samples\n")
            text, descriptors, _, _ = socket.recv_fds(link, 4096, 1)
            while not text.endswith(b"\n"):
                more = link.recv(4096)
                if not more:
                    raise NotRunning(f"heaved at {path} has closed the connection")
                text += more
        except OSError as error:
            raise NotRunning(f"heaved cannot be asked at {path}: {error.strerror or error}") from error
    answer = json.loads(text)
    if answer.get("ok") and descriptors:
        return descriptors[0]
    for descriptor in descriptors:
        os.close(descriptor)
    raise Refused("samples", str(answer.get("error", "heaved gives no samples: [samples] seconds is 0")), answer.get("state"))


class Samples:
    """A reader of a heaved's samples. It begins with the next record to come."""

    def __init__(self, socket_path: str | os.PathLike[str], *, timeout: float = 5.0):
        try:
            import numpy  # noqa: F401  the rest of the package works without it
        except ImportError as error:
            raise SamplesError(f"samples need numpy: apt-get install python3-numpy, or pip install numpy ({error})") from error
        descriptor = receive(socket_path, timeout)
        try:
            self._memory: mmap.mmap | None = mmap.mmap(descriptor, os.fstat(descriptor).st_size, mmap.MAP_SHARED, mmap.PROT_READ)
        finally:
            os.close(descriptor)
        self._ring: Array | None = None
        self._header: Array | None = None
        self.lost = 0  # records that were overwritten before they were read
        self._read_layout()
        self.next = self.written

    def __enter__(self) -> Samples:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Gives the memory back; views that somebody still has stay what they are."""
        self._memory = None
        self._ring = self._header = None

    # ---- the layout ----
    def _read_layout(self) -> None:
        import numpy
        memory = self._memory
        assert memory is not None
        if len(memory) < HEADER_BYTES or memory[:8] != MAGIC:
            raise SamplesError("these are no samples of heaved")
        _, version, header_bytes, record_bytes, self.capacity, columns, column_bytes, self.cycle_us, self.start_monotonic_ns, self.start_realtime_ns = HEADER.unpack_from(memory)
        if version != VERSION:
            raise SamplesError(f"samples of version {version}: this reader knows {VERSION}")
        is_sound = (self.capacity > 0 and record_bytes >= 8 and record_bytes % 8 == 0 and column_bytes >= COLUMN.size and
                    HEADER_BYTES + columns * column_bytes <= header_bytes and header_bytes + self.capacity * record_bytes <= len(memory))
        if not is_sound:
            raise SamplesError("samples with a header that contradicts itself")
        names, formats, offsets = [SEQUENCE], ["u8"], [0]
        self.units: dict[str, str] = {}
        self.scales: dict[str, float] = {}
        for i in range(columns):
            name, unit, kind, at, scale = COLUMN.unpack_from(memory, HEADER_BYTES + i * column_bytes)
            text, form = (part.split(b"\0")[0].decode("ascii") for part in (name, kind))
            if form not in TYPES or at + int(form[1]) > record_bytes:
                raise SamplesError(f"column {text}: {form} at {at}")
            names.append(text)
            formats.append(form)
            offsets.append(at)
            self.units[text], self.scales[text] = unit.split(b"\0")[0].decode("ascii"), scale
        record = numpy.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": record_bytes})
        self._ring = numpy.frombuffer(memory, dtype=record, count=self.capacity, offset=header_bytes)
        self._header = numpy.frombuffer(memory, dtype="u8", count=1, offset=WRITTEN_AT)

    @property
    def columns(self) -> list[str]:
        return list(self.units)

    @property
    def written(self) -> int:
        """Records since heaved began."""
        if self._header is None:
            raise SamplesError("the samples are closed")
        return int(self._header[0])

    def _known(self, name: str) -> str:
        if name not in self.units:
            raise SamplesError(f"there is no column {name}; there are {' '.join(self.units)}")
        return name

    @property
    def ring(self) -> Array:
        """The memory itself as a structured array; record n is at n % capacity. It cannot be written to."""
        if self._ring is None:
            raise SamplesError("the samples are closed")
        return self._ring

    def view(self, name: str) -> Array:
        """A column of the ring without a copy, as it stands there: times scales[name] it has its unit. heaved goes on writing meanwhile."""
        view: Array = self.ring[self._known(name)]
        return view

    # ---- whole records ----
    def records(self) -> Array:
        """What has come since the last call, as it stands in the ring; whole records in their order. Those that are gone are counted in `lost`."""
        import numpy
        ring, written = self.ring, self.written
        first = max(self.next, written - self.capacity + 1)
        numbers = numpy.arange(first, written, dtype="u8")
        places = (numbers % self.capacity).astype("i8")
        copy = ring[places]
        # a record that heaved came to meanwhile bears another number before, in or after the copy
        is_whole = (copy[SEQUENCE] == numbers + 1) & (ring[SEQUENCE][places] == numbers + 1)
        is_whole &= numbers + self.capacity > self.written
        self.lost += first - self.next + int(len(numbers) - is_whole.sum())
        self.next = max(first, written)
        whole: Array = copy[is_whole]
        return whole

    def read(self, names: Sequence[str] | None = None) -> dict[str, Array]:
        """The same, in units: arrays of float64 by the names of columns."""
        wanted = [self._known(name) for name in (names if names is not None else self.columns)]
        records = self.records()
        return {name: records[name] * self.scales[name] for name in wanted}
