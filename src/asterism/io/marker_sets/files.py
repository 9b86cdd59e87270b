"""Reading of marker sets, by the ending of the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.checks import check_path
from asterism.model import MarkerSet

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["read_marker_set"]


def read_marker_set(path: str | Path) -> MarkerSet:
    """Read a marker set.

    Parameters
    ----------
    path : str or Path
        TOML file.

    Returns
    -------
    MarkerSet

    Raises
    ------
    FormatError
        If the file cannot be read or contains no marker set.

    Examples
    --------
    >>> import asterism as am
    >>> from tempfile import TemporaryDirectory
    >>> made = am.MarkerSet(names=("A", "B"), places=[[0, 0, 0], [1, 0, 0]])
    >>> with TemporaryDirectory() as folder:
    ...     text = made.to_toml(f"{folder}/set.toml")
    ...     am.read_marker_set(f"{folder}/set.toml")
    MarkerSet(2 markers, 1 subject)
    """
    return MarkerSet.from_toml(check_path("path", path))
