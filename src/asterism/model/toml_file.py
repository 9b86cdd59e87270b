"""Reading and writing of TOML files, with errors that name the file."""

from __future__ import annotations

import tomllib
from typing import TYPE_CHECKING, Any

from asterism.checks import check_file, check_path
from asterism.errors import FormatError, not_read, not_written

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["read_toml", "write_text", "write_toml"]


def write_toml(content: Mapping[str, Any], path: str | Path | None) -> str:
    """Return `content` as TOML text, and write it to `path` if one is given."""
    import tomli_w

    return write_text(tomli_w.dumps(content), path)


def write_text(text: str, path: str | Path | None) -> str:
    """Write a text to `path`, as a whole, if one is given; return the text."""
    if path is not None:
        path = check_path("path", path)
        unfinished = path.with_name(f".{path.name}.part")
        try:
            unfinished.write_text(text, encoding="utf-8")
            unfinished.replace(path)
        except OSError as error:
            raise not_written(path, error) from error
        finally:
            unfinished.unlink(missing_ok=True)
    return text


def read_toml(path: str | Path, what: str) -> dict[str, Any]:
    """Read a TOML file; errors name `what` it should contain.

    Raises
    ------
    ParameterError
        If `path` is not a path.
    FormatError
        If the file cannot be read or is not TOML.
    """
    path = check_path("path", path)
    check_file(path, what)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise not_read(path, error) from error
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "UTF-8 text", error.reason) from error
    except tomllib.TOMLDecodeError as error:
        raise FormatError(path, "the file", "TOML", str(error)) from error
