"""Files by path, or by URL through fsspec."""

from __future__ import annotations

import os
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from asterism.errors import FormatError, ParameterError, not_read
from asterism.io.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["deliver", "fetch", "files_below", "inside", "is_url", "read_bytes"]


def is_url(place: str | Path) -> bool:
    """Return whether a place is a URL, such as ``s3://bucket/trial.c3d``."""
    return isinstance(place, str) and "://" in place


def inside(folder: str, name: str) -> str:
    """Return the place of a name, with ``/`` between its parts, inside a folder or URL."""
    return f"{folder.rstrip('/')}/{name}" if is_url(folder) else str(Path(folder, name))


def read_bytes(place: str) -> bytes:
    """Read a file.

    Parameters
    ----------
    place : str
        Path or URL.

    Raises
    ------
    FormatError
        If the file does not exist or cannot be read.
    """
    try:
        if is_url(place):
            system, path = _remote(place)
            return system.cat_file(path)
        return Path(place).read_bytes()
    except FileNotFoundError:
        raise FormatError(Path(place), "", "", "no such file") from None
    except OSError as error:
        raise not_read(Path(place), error) from error


def fetch(place: str, folder: Path) -> Path:
    """Return the path of a file; a URL is copied into a local folder first."""
    if not is_url(place):
        return Path(place)
    path = folder / PurePosixPath(place).name
    path.write_bytes(read_bytes(place))
    return path


def deliver(place: str, content: bytes, *, overwrite: bool) -> None:
    """Write a file completely or not at all; a file with the same bytes is left alone.

    Parameters
    ----------
    place : str
        Path or URL; missing folders are made.
    content : bytes
        Bytes of the file.
    overwrite : bool
        Whether a file with other bytes may be replaced.

    Raises
    ------
    FormatError
        If the file cannot be written, or exists with other bytes.
    """
    path = Path(place)
    if is_url(place):
        system, inner = _remote(place)
        if not overwrite and system.exists(inner) and system.cat_file(inner) != content:
            raise _exists(path)
        system.makedirs(str(PurePosixPath(inner).parent), exist_ok=True)
        system.pipe_file(inner, content)  # object stores replace an object as a whole
        return
    if path.is_file():
        if path.read_bytes() == content:
            return
        if not overwrite:
            raise _exists(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_read(path.parent, error) from error
    with replacing(path) as file:
        file.write(content)


def files_below(folder: str) -> Iterator[tuple[str, OSError | None]]:
    """Iterate over all files below a folder or URL, sorted, without hidden ones.

    Parameters
    ----------
    folder : str
        Path or URL of a folder.

    Yields
    ------
    name : str
        Name relative to the folder, with ``/`` between its parts.
    error : OSError or None
        Error, if the name is a folder that cannot be listed.
    """
    if is_url(folder):
        system, root = _remote(folder)
        for path in sorted(system.find(root)):
            name = str(PurePosixPath(path).relative_to(PurePosixPath(root)))
            if not any(part.startswith(".") for part in name.split("/")):
                yield name, None
        return
    failed: list[OSError] = []
    for at, folders, names in os.walk(folder, onerror=failed.append):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            if not name.startswith("."):
                yield Path(at, name).relative_to(folder).as_posix(), None
    for error in failed:
        yield Path(os.fsdecode(error.filename)).relative_to(folder).as_posix(), error


def _exists(path: Path) -> FormatError:
    return FormatError(
        path, "the file", "none, or one with the same bytes", "another one",
        "give overwrite to replace it",
    )  # fmt: skip


def _remote(url: str) -> tuple[Any, str]:
    """Return the file system of a URL, and the path in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        hint = "run pip install 'asterism[cluster]'"
        raise ParameterError("URL", "fsspec, which is optional", "not installed", hint) from None
    try:
        return url_to_fs(url)
    except (ImportError, ValueError) as error:
        raise ParameterError("URL", "a protocol of fsspec", f"{url}: {error}") from error
