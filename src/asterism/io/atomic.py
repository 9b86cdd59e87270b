"""Writing a file so that it is either there as a whole or not touched at all."""

from __future__ import annotations

import os
import secrets
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING

from asterism.errors import not_written

if TYPE_CHECKING:
    from collections.abc import Generator
    from pathlib import Path

__all__ = ["replacing", "write_text"]


@contextmanager
def replacing(path: Path) -> Generator[IO[bytes], None, None]:
    """Open a file to write that takes the place of `path` when the block ends well.

    The bytes go to a temporary name in the same folder, are forced to the disk and renamed: who is
    killed on the way leaves the old file as it was. On an error the temporary file is removed.

    Parameters
    ----------
    path : Path
        The file to make or replace.

    Yields
    ------
    binary file

    Raises
    ------
    FormatError
        If the system refuses: no such folder, no permission, disk full.
    """
    try:
        # A device or a pipe (/dev/stdout) cannot be renamed over: it is written as it stands.
        if path.exists() and not path.is_file() and not path.is_dir():
            with path.open("wb") as device:
                yield device
            return
        target = path.resolve()  # a symbolic link stays one, and its target is replaced
        if target.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        temporary = target.with_name(f".{secrets.token_hex(8)}.part")
        try:
            # The file's name is that of its target: some formats hold it.
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


def write_text(path: Path, text: str) -> None:
    """Write a text file as a whole or not at all."""
    with replacing(path) as file:
        file.write(text.encode())
