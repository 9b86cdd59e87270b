"""TOML of calibrations: guarded reading, and writing with one row of a matrix per line."""

from __future__ import annotations

import json
import re
import tomllib
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.errors import FormatError
from asterism.io.whole_file import read_bytes

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

__all__ = ["load", "table"]

_LARGEST = 4 << 20  # bytes, some thousand cameras
_MOST_PARTS = 100


def load(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        TOML file in UTF-8, of at most 4 MB.

    Returns
    -------
    dict
        Content as of `tomllib.loads`.

    Raises
    ------
    FormatError
        If the file is not TOML, is too large, or has keys of more than 100 parts.
    """
    try:
        text = read_bytes(path, most=_LARGEST).decode("utf-8-sig")
        _check_keys(path, text)
        return tomllib.loads(text)
    except UnicodeDecodeError as error:
        raise FormatError(path, f"byte {error.start}", "text in UTF-8", error.reason) from error
    except RecursionError:
        raise FormatError(
            path, "its nesting", "tables and matrices", "thousands of levels"
        ) from None
    except ValueError as error:  # TOMLDecodeError, and numbers of too many digits
        raise FormatError(path, "its text", "TOML", str(error)) from error


def _check_keys(path: Path, text: str) -> None:
    """Refuse keys of hundreds of parts: the parser's time grows with the square of the number."""
    bare = re.sub(r"\"[^\"\n]*\"|'[^'\n]*'", "", text)
    longest = max(piece.count(".") for piece in re.split(r"[,=\[\]{}\n#]", bare))
    if longest > _MOST_PARTS:
        raise FormatError(path, "its keys", f"at most {_MOST_PARTS} parts in one", longest + 1)


def table(header: str, values: Mapping[str, Any]) -> str:
    """Write a table.

    Parameters
    ----------
    header : str
        Header with its brackets, "" for the top level.
    values : mapping
        Strings, booleans, numbers, and arrays of one or two axes, by key.

    Returns
    -------
    str
        Lines of the table, followed by an empty one.
    """
    lines = [header] if header else []
    lines += [f"{key} = {_value(value)}" for key, value in values.items()]
    return "\n".join(lines) + "\n\n"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # of printable text: the same in TOML
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, np.ndarray):
        if value.ndim == 2:
            return "[\n" + "".join(f"  {_value(row)},\n" for row in value) + "]"
        return _value(value.tolist())
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    return repr(value)  # the shortest digits that round back to the same float; TOML knows inf
