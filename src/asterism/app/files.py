"""Where commands may write, and the files that several of them read."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.errors import FormatError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    import asterism as am

__all__ = ["check_outputs", "read_model"]


def check_outputs(outputs: Mapping[str, Path | None], inputs: Iterable[Path | None]) -> None:
    """Raise before any work if a file would be written that is read, two into one, or nowhere.

    Parameters
    ----------
    outputs : mapping
        Files to write, by the option that names them.
    inputs : iterable
        Files that are read.

    Raises
    ------
    ParameterError
        With the option at fault.
    """
    seen = {_identity(path): f"the input {path}" for path in inputs if path is not None}
    for option, path in outputs.items():
        if path is None:
            continue
        identity = _identity(path)
        if identity in seen:
            raise ParameterError(option, "a file of its own", f"{path}, {seen[identity]}")
        seen[identity] = f"which {option} names too"
        if not path.resolve().parent.is_dir():
            raise ParameterError(option, "a file in a folder that exists", path)


def _identity(path: Path) -> object:
    """Give what two paths share if they lead to one file, by other names or links too."""
    if path.exists() and path.is_file():
        status = path.stat()
        return status.st_dev, status.st_ino
    return path.resolve()


def read_model(path: Path) -> am.TrackingModel:
    """Read a model from TOML.

    Raises
    ------
    FormatError
        If the file cannot be read, or is no model.
    """
    import asterism as am

    try:
        return am.TrackingModel.from_toml(path)
    except OSError as error:
        raise FormatError(path, "opening", "a model in TOML", error.strerror) from error
