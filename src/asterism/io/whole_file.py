"""Reading a whole file of limited length."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.errors import FormatError

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_bytes"]

_LARGEST = 64 << 20  # bytes; a calibration of a thousand cameras with all thresholds takes less


def read_bytes(path: Path, *, most: int = _LARGEST) -> bytes:
    """Read a whole file, unless it is larger than any of its kind.

    Parameters
    ----------
    path : Path
        File to read.
    most : int
        Largest length, bytes.

    Returns
    -------
    bytes
        Content of the file.

    Raises
    ------
    FormatError
        If the file is longer.
    """
    with path.open("rb") as file:
        raw = file.read(most + 1)
    if len(raw) > most:
        raise FormatError(path, "its length", f"at most {most} bytes", "more")
    return raw
