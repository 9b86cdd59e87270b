"""Files on disk, and through fsspec at URLs. A *place* is the path or the URL of a file."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from asterism.checks import check_extra
from asterism.errors import AsterismError, FormatError, ParameterError, not_read, not_written
from asterism.io.atomic import replacing

if TYPE_CHECKING:
    from collections.abc import Generator, Iterator

__all__ = [
    "deliver", "fetch", "files_below", "files_beside", "inside", "is_file", "is_url", "read_bytes",
    "split",
]  # fmt: skip


def is_url(place: str) -> bool:
    """Return whether a place is a URL, such as ``s3://bucket/trial.c3d``."""
    return "://" in place


def inside(folder: str, name: str) -> str:
    """Return the place of a name, with ``/`` between its parts, inside a folder or URL."""
    return f"{folder.rstrip('/')}/{name}" if is_url(folder) else str(Path(folder, name))


def split(place: str) -> tuple[str, str]:
    """Return the folder and the name of a file."""
    if is_url(place):
        folder, _, name = place.rpartition("/")
        return folder, name
    return str(Path(place).parent), Path(place).name


def is_file(place: str) -> bool:
    """Return whether a place is a file; False for a folder.

    Raises
    ------
    ParameterError
        If nothing is there.
    """
    if is_url(place):
        with _remote(place) as (system, path):
            if not system.exists(path):
                raise ParameterError("sources", "captures or folders that exist", place)
            return system.isfile(path)
    if not Path(place).exists():
        raise ParameterError("sources", "captures or folders that exist", place)
    return Path(place).is_file()


def read_bytes(place: str, n: int | None = None) -> bytes:
    """Read a file, or its first `n` bytes.

    Parameters
    ----------
    place : str
        Path or URL.
    n : int, optional
        Number of bytes; by default all.

    Raises
    ------
    FormatError
        If the file does not exist or cannot be read.
    """
    if is_url(place):
        with _remote(place) as (system, path):
            return system.cat_file(path, end=n)
    try:
        with Path(place).open("rb") as file:
            return file.read(n)
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
    if is_url(place):
        with _remote(place) as (system, path):
            if not overwrite and system.exists(path) and system.cat_file(path) != content:
                raise _exists(place)
            system.makedirs(str(PurePosixPath(path).parent), exist_ok=True)
            system.pipe_file(path, content)  # object stores replace an object as a whole
        return
    path = Path(place)
    if path.is_file():
        if path.read_bytes() == content:
            return
        if not overwrite:
            raise _exists(place)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise not_written(path, error) from error
    with replacing(path) as file:
        file.write(content)


def files_beside(place: str) -> set[str]:
    """Return the names of the files in the folder of a file."""
    folder, _ = split(place)
    if is_url(folder):
        with _remote(folder) as (system, path):
            return {PurePosixPath(each).name for each in system.ls(path, detail=False)}
    return {path.name for path in Path(folder).iterdir() if path.is_file()}


def files_below(folder: str) -> Iterator[tuple[str, str]]:
    """Iterate over all files below a folder or URL, sorted, without hidden ones.

    Parameters
    ----------
    folder : str
        Path or URL of a folder.

    Yields
    ------
    name : str
        Name relative to the folder, with ``/`` between its parts.
    reason : str
        Reason why the name, a folder, cannot be listed; empty for a file.
    """
    if is_url(folder):
        with _remote(folder) as (system, root):
            names = [
                str(PurePosixPath(path).relative_to(PurePosixPath(root)))
                for path in sorted(system.find(root))
            ]
        for name in names:
            if not any(part.startswith(".") for part in name.split("/")):
                yield name, ""
        return
    failed: list[OSError] = []
    for at, folders, names in os.walk(folder, onerror=failed.append):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            if not name.startswith("."):
                yield Path(at, name).relative_to(folder).as_posix(), ""
    for error in failed:
        path = Path(os.fsdecode(error.filename))
        yield path.relative_to(folder).as_posix(), f"{path}: {error.strerror or error}"


def _exists(place: str) -> FormatError:
    return FormatError(
        place, "the file", "none, or one with the same bytes", "another one",
        "give overwrite=True (--overwrite) to replace it",
    )  # fmt: skip


@contextmanager
def _remote(url: str) -> Generator[tuple[Any, str], None, None]:
    """Open the file system of a URL, with the path in it; its errors name the URL."""
    check_extra("URL", "cluster", "fsspec")
    from fsspec.core import url_to_fs

    try:
        yield url_to_fs(url)
    except AsterismError:
        raise
    except FileNotFoundError:
        raise FormatError(url, "", "", "no such file") from None
    except Exception as error:  # each file system of fsspec has errors of its own
        raise FormatError(url, "", "", f"{type(error).__name__}: {error}") from error
