"""Sink that records a C3D, of which a crash loses nothing but the frame that is being written.

A C3D states its number of points and frames at the beginning, so it cannot grow. The frames go to a
journal beside it, which becomes the C3D when the sink is closed. After a crash the journal is
there, and the next recording with the same name, or `recover`, makes a C3D of it.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from typing import TYPE_CHECKING

from asterism.errors import AsterismError, FormatError, SinkError
from asterism.io import write
from asterism.live.sinks.journal import frame_record, header_record, read_journal
from asterism.live.sinks.text import opened

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.live.frame import LiveFrame, StreamHeader

__all__ = ["RecordingSink", "journal_of", "recover"]

log = logging.getLogger(__name__)


class RecordingSink:
    """Sink that records a C3D.

    Parameters
    ----------
    path : Path
        C3D to create; an existing one is refused.
    """

    def __init__(self, path: Path) -> None:
        self.name, self._path = str(path), path
        self.faults: dict[str, int] = {}
        self._file: int | None = None
        self._names: dict[int, str] = {}
        self._size = 0

    def open(self, header: StreamHeader) -> None:
        """Begin the journal; one that a crash has left is recovered first.

        Raises
        ------
        SinkError
            If the C3D exists, another process records it now, or the folder cannot be written.
        """
        if self._path.exists():
            raise SinkError(f"{self._path}: exists already. Choose another name, or remove it.")
        journal = journal_of(self._path)
        if journal.exists():
            _recover_beside(self._path, journal)
        self._file = opened(journal)
        _lock(self._file, self._path)
        self._names, self._size = {}, 0
        self._write(header_record(header))

    def send(self, frame: LiveFrame) -> None:
        """Write a frame to the journal."""
        if self._file is None:
            return
        self._write(frame_record(frame, self._names))

    def close(self) -> None:
        """Make the C3D; the journal stays if that fails."""
        if self._file is None:
            return
        os.close(self._file)
        self._file = None
        try:
            recover(self._path)
        except AsterismError as error:
            self.faults["no C3D"] = 1
            log.error("%s The frames are in %s.", error, journal_of(self._path))

    def _write(self, data: bytes) -> None:
        """Append to the journal; of a frame for which there is no room nothing stays."""
        assert self._file is not None
        view = memoryview(data)
        try:
            while view:
                view = view[os.write(self._file, view) :]
        except OSError as error:
            os.ftruncate(self._file, self._size)
            reason = f"not written: {error.strerror}"
            self.faults[reason] = self.faults.get(reason, 0) + 1
        else:
            self._size += len(data)


def journal_of(path: Path) -> Path:
    """Return the journal of a C3D, beside it."""
    return path.with_name(f"{path.name}.journal")


def recover(path: Path, target: Path | None = None) -> None:
    """Make a C3D of the journal that an interrupted recording has left, and remove the journal.

    Parameters
    ----------
    path : Path
        The C3D that was to be recorded; its journal is beside it.
    target : Path, optional
        File to write; by default `path`.

    Raises
    ------
    FormatError
        If there is no journal, or the C3D cannot be written.
    """
    journal = journal_of(path)
    write(read_journal(journal), path if target is None else target)
    journal.unlink()


def _recover_beside(path: Path, journal: Path) -> None:
    """Recover a journal under a name that is free."""
    file = os.open(journal, os.O_RDONLY)
    _lock(file, path)
    os.close(file)
    n, target = 1, path.with_name(f"{path.stem}.recovered{path.suffix}")
    while target.exists():
        n += 1
        target = path.with_name(f"{path.stem}.recovered{n}{path.suffix}")
    try:
        recover(path, target)
    except FormatError as error:
        raise SinkError(f"{error} Move {journal} away, or choose another name.") from error
    log.warning("%s: an interrupted recording has been recovered as %s", path, target)


def _lock(file: int, path: Path) -> None:
    """Mark a journal as being written by this process; the mark ends with the process."""
    if sys.platform == "win32":
        return  # an open file cannot be removed there
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        with contextlib.suppress(OSError):
            os.close(file)
        raise SinkError(f"{path}: another process records it. Choose another name.") from None
