"""Sinks of text: JSON lines to a file, to standard output or over UDP, and CSV to a file."""

from __future__ import annotations

import os
import queue
import sys
import threading
from typing import TYPE_CHECKING, ClassVar

from asterism.checks import check_extra
from asterism.errors import SinkError
from asterism.live.protocols.json_lines import encode_line
from asterism.live.sinks.datagrams import DatagramSink

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.live.frame import LiveFrame, StreamHeader

__all__ = ["CsvSink", "JsonFileSink", "JsonUdpSink", "StandardOutput", "opened"]

_QUEUE = 512  # frames


class JsonFileSink:
    """Sink that writes JSON lines to a file; every line is on its way when `send` returns.

    Parameters
    ----------
    path : Path
        File to create; an existing one is refused.
    """

    _packages: ClassVar[tuple[str, ...]] = ("orjson",)

    def __init__(self, path: Path) -> None:
        check_extra(str(path), "live", *self._packages)
        self.name, self._path = str(path), path
        self.faults: dict[str, int] = {}
        self._file: int | None = None

    def open(self, header: StreamHeader) -> None:
        """Create the file.

        Raises
        ------
        SinkError
            If it exists or cannot be written.
        """
        del header
        self._file = opened(self._path)

    def send(self, frame: LiveFrame) -> None:
        """Write a frame."""
        if self._file is not None:
            written(self, self._file, encode_line(frame))

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            os.close(self._file)
            self._file = None


class CsvSink(JsonFileSink):
    """Sink that writes the CSV that `asterism.read` reads, one row a point.

    Parameters
    ----------
    path : Path
        File to create; an existing one is refused.
    """

    _packages = ()

    def open(self, header: StreamHeader) -> None:
        """Create the file.

        Raises
        ------
        SinkError
            If it exists or cannot be written.
        """
        super().open(header)
        assert self._file is not None
        written(self, self._file, b"frame,time_s,x_m,y_m,z_m,track,name\n")

    def send(self, frame: LiveFrame) -> None:
        """Write a frame."""
        if self._file is None:
            return
        head = f"{int(frame.number)},{float(frame.time)!r},"
        names = frame.names or ("",) * len(frame.points)
        lines = [
            f"{head}{x!r},{y!r},{z!r},{label},{_cell(name)}\n"
            for (x, y, z), label, name in zip(
                frame.points.tolist(), frame.labels.tolist(), names, strict=True
            )
        ]
        written(self, self._file, "".join(lines or [f"{head},,,-1,\n"]).encode())


class JsonUdpSink(DatagramSink):
    """Sink that sends each JSON line as a datagram.

    Parameters
    ----------
    name : str
        The sink, as the user wrote it.
    host, port : str and int
        Receiver.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        check_extra(name, "live", "orjson")
        super().__init__(name, host, port)

    def send(self, frame: LiveFrame) -> None:
        """Send a frame."""
        self._send(encode_line(frame))


class StandardOutput:
    """Sink that writes JSON lines to standard output; a reader that falls behind misses frames."""

    def __init__(self) -> None:
        check_extra("JSON lines", "live", "orjson")
        self.name = "-"
        self.faults: dict[str, int] = {}
        self._lines: queue.Queue[bytes | None] = queue.Queue(_QUEUE)
        self._thread: threading.Thread | None = None

    def open(self, header: StreamHeader) -> None:
        """Begin."""
        del header
        self._thread = threading.Thread(target=self._write, name="standard-output", daemon=True)
        self._thread.start()

    def send(self, frame: LiveFrame) -> None:
        """Hand a frame to the thread that writes, because a pipe may block."""
        try:
            self._lines.put_nowait(encode_line(frame))
        except queue.Full:
            self.faults["slow reader"] = self.faults.get("slow reader", 0) + 1

    def close(self) -> None:
        """Write what is left, for at most two seconds."""
        if self._thread is None:
            return
        try:
            self._lines.put(None, timeout=2.0)
            self._thread.join(2.0)
        except queue.Full:
            self.faults["slow reader"] = self.faults.get("slow reader", 0) + self._lines.qsize()
        self._thread = None

    def _write(self) -> None:
        while (line := self._lines.get()) is not None:
            try:
                sys.stdout.buffer.write(line)
                sys.stdout.buffer.flush()
            except OSError:
                self.faults["no reader"] = self.faults.get("no reader", 0) + 1


def opened(path: Path) -> int:
    """Create a file that does not exist, and return its descriptor.

    Raises
    ------
    SinkError
        If it exists or cannot be created.
    """
    try:
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
    except FileExistsError:
        raise SinkError(f"{path}: exists already. Choose another name, or remove it.") from None
    except OSError as error:
        raise SinkError(f"{path}: cannot be written: {error.strerror}.") from error


def written(sink: JsonFileSink, file: int, data: bytes) -> None:
    """Write all bytes, or count the frame as lost."""
    view = memoryview(data)
    try:
        while view:
            view = view[os.write(file, view) :]
    except OSError as error:
        reason = f"not written: {error.strerror}"
        sink.faults[reason] = sink.faults.get(reason, 0) + 1


def _cell(name: str | None) -> str:
    """Return a name as a cell of CSV."""
    text = " ".join((name or "").split())
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"') else text
