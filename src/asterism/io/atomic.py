"""Atomic writing: a file is replaced completely or not at all."""

from __future__ import annotations

import os
import re
import secrets
import time
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING

from asterism.errors import not_written

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

__all__ = ["holds_files", "remove_leftovers", "replacing", "write_text"]

_LEFTOVER = re.compile(r"\.[0-9a-f]{16}\.part")
_STALE = 60.0  # seconds after which a temporary file is no longer being written


@contextmanager
def replacing(path: Path) -> Generator[IO[bytes], None, None]:
    """Open a file to write that replaces `path` if the block ends without an error.

    The bytes are written to a temporary file in the same folder, flushed to the disk, and the file
    is renamed. A killed process leaves the old file unchanged. On an error the temporary file is
    removed.

    Parameters
    ----------
    path : Path
        File to create or replace.

    Yields
    ------
    binary file
        Open temporary file.

    Raises
    ------
    FormatError
        If the folder does not exist, permission is denied, or the disk is full.
    """
    try:
        # A device or a pipe (/dev/stdout) cannot be replaced, so it is written directly.
        if path.exists() and not path.is_file() and not path.is_dir():
            with path.open("wb") as device:
                yield device
            return
        target = path.resolve()  # a symbolic link stays one, and its target is replaced
        if target.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        temporary = target.with_name(f".{secrets.token_hex(8)}.part")
        try:
            # The file object has the name of the target, because some formats store it.
            with open(
                str(target), "xb", opener=lambda _, flags: os.open(temporary, flags, 0o666)
            ) as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if target.exists():
                temporary.chmod(target.stat().st_mode & 0o777)
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise not_written(path, error) from error


def holds_files(folder: Path) -> bool:
    """Return whether a folder holds anything but temporary files of killed processes."""
    return any(not _LEFTOVER.fullmatch(path.name) for path in folder.iterdir())


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of killed processes from a folder and all below it."""
    for path in folder.rglob(".*.part"):
        with suppress(FileNotFoundError):  # it is of a process that has just renamed it
            if _LEFTOVER.fullmatch(path.name) and time.time() - path.stat().st_mtime > _STALE:
                path.unlink()


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8, completely or not at all."""
    with replacing(path) as file:
        file.write(text.encode())
