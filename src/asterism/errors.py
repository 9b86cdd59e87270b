"""The errors of the library, and the checks that raise them.

Every message says what was expected, what was got and, where there is one, what to do about it.
Nothing here knows about tracking.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "AsterismError",
    "FormatError",
    "ParameterError",
    "SolverLimit",
    "check_array",
    "check_fields",
    "check_file",
    "check_kind",
    "check_number",
    "check_path",
    "clipped",
    "keep_array",
    "not_read",
    "not_written",
]

_MAX_VALUE = 160  # characters of what was found, in a message
_MAX_REPR = 200  # characters of the repr of an error


def clipped(text: str, limit: int) -> str:
    r"""Shorten a text to one line of at most `limit` characters.

    Parameters
    ----------
    text : str
        The text; each run of spaces and line breaks becomes one space.
    limit : int
        Its greatest length. A closing bracket or quotation mark is kept when it is cut.

    Returns
    -------
    str

    Examples
    --------
    >>> clipped("Rig(a, b,\n c)", 11)
    'Rig(a, b,…)'
    """
    text = " ".join(text.split())
    if len(text) <= limit:
        return text
    end = text[-1] if text[-1] in ")]}'\">" else ""
    return text[: limit - 1 - len(end)].rstrip() + "…" + end


def _message(place: str, expected: str, got: str, hint: str) -> str:
    """Give the one line that all messages are: where, what was expected, what was found, advice."""
    text = f"{place}: expected {expected}, found {got}" if expected else f"{place}: {got}"
    if hint:
        first, end = hint.split(" ", 1)[0], "" if hint[-1] in ".?!" else "."
        # A word of prose gets its capital, code (am.GNN(), bodies=True) stays as it is.
        text += f". {hint[0].upper() if first.strip(',:').isalpha() else hint[0]}{hint[1:]}{end}"
    return " ".join(text.split())


class AsterismError(Exception):
    """Base of every error that the library raises on purpose."""

    def __repr__(self) -> str:
        return clipped(f"{type(self).__name__}({str(self)!r})", _MAX_REPR)


class ParameterError(AsterismError, ValueError):
    """An argument is not what it must be.

    Parameters
    ----------
    name : str
        The argument.
    expected, got : str
        What it must be and what it was.
    hint : str, optional
        What to do about it.
    """

    def __init__(self, name: str, expected: str, got: object, hint: str = "") -> None:
        self.name, self.expected, self.hint = name, expected, hint
        self.got = clipped(str(got), _MAX_VALUE)
        super().__init__(_message(name, expected, self.got, hint))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.expected, self.got, self.hint)


class FormatError(AsterismError, ValueError):
    """A file is not what its format says.

    Parameters
    ----------
    path : str or Path
        The file.
    place : str
        Where in it: a line, a byte, a parameter.
    expected, got : str
        What should stand there and what does.
    hint : str, optional
        What to do about it.
    """

    def __init__(
        self, path: str | Path, place: str, expected: str, got: object, hint: str = ""
    ) -> None:
        self.path, self.place, self.expected = str(path), place, expected
        self.got, self.hint = clipped(str(got), _MAX_VALUE), hint
        where = f"{path}: {place}" if place else str(path)
        super().__init__(_message(where, expected, self.got, hint))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.path, self.place, self.expected, self.got, self.hint)


class SolverLimit(AsterismError, RuntimeError):
    """A problem is larger than a solver's stated limit.

    Parameters
    ----------
    what : str
        What was counted.
    size, limit : int
        The size that was met and the limit.
    hint : str
        The documented way out.
    """

    def __init__(self, what: str, size: int, limit: int, hint: str) -> None:
        self.what, self.size, self.limit, self.hint = what, size, limit, hint
        super().__init__(_message(what, f"at most {limit}", f"{size}", hint))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.what, self.size, self.limit, self.hint)


def check_number(
    name: str,
    value: object,
    *,
    above: float = -math.inf,
    below: float = math.inf,
    closed: bool = False,
    integer: bool = False,
    hint: str = "",
) -> None:
    """Raise unless `value` is a finite number in an interval.

    Parameters
    ----------
    name : str
        How the caller knows the value.
    value : object
        The value.
    above, below : float
        Ends of the interval: open, or closed with ``closed=True``.
    closed, integer : bool
        Whether the ends belong to it; whether the number must be whole.
    hint : str
        Added to the message.

    Raises
    ------
    ParameterError
        If it is not.

    Examples
    --------
    >>> check_number("p_detection", 1.5, above=0, below=1)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: p_detection: expected a number in (0, 1), found 1.5
    """
    kind = "a whole number" if integer else "a number"
    left, right = ("[", "]") if closed else ("(", ")")
    if math.isinf(above) and math.isinf(below):
        expected = f"a finite {kind[2:]}"
    elif math.isinf(below):
        expected = f"{kind} {'≥' if closed else '>'} {above:g}"
    elif math.isinf(above):
        expected = f"{kind} {'≤' if closed else '<'} {below:g}"
    else:
        expected = f"{kind} in {left}{above:g}, {below:g}{right}"
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ParameterError(name, expected, repr(value), hint)
    # A file may hold a whole number that no float can.
    number = math.inf if isinstance(value, int) and abs(value) > 1e300 else float(value)
    if integer and not number.is_integer():
        raise ParameterError(name, expected, f"{number:g}", hint)
    inside = above <= number <= below if closed else above < number < below
    if not (math.isfinite(number) and inside):
        raise ParameterError(name, expected, f"{number:g}", hint)


def check_kind(name: str, value: object, kind: type, hint: str = "") -> None:
    """Raise unless `value` is of a class.

    Parameters
    ----------
    name : str
        How the caller knows the value.
    value : object
        The value.
    kind : type
        The class.
    hint : str
        What to try instead. Where the value has what is wanted under one of the usual names, as the
        `Stitching` of `identify` has tracks, that name is the hint.

    Raises
    ------
    ParameterError
        If it is not.

    Examples
    --------
    >>> check_kind("radius", "3", float)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: radius: expected a float, found '3'
    """
    if isinstance(value, kind):
        return
    word = kind.__name__
    article = "an" if word[0] in "AEIOU" else "a"
    expected = word if word.endswith("s") else f"{article} {word}"
    got = f"{type(value).__name__}"
    if isinstance(value, str):
        got = repr(value)
    elif isinstance(value, type):
        got = f"the class {value.__name__}"
    for part in ("tracks", "detections", "model", "bonds", "observations"):
        if isinstance(getattr(value, part, None), kind):
            hint = f"its .{part}"
            break
    raise ParameterError(name, expected, got, f"try {hint}" if hint else "")


def check_path(name: str, value: object) -> Path:
    """Give `value` as a path, or raise.

    Parameters
    ----------
    name : str
        How the caller knows the value.
    value : object
        The value.

    Returns
    -------
    Path

    Raises
    ------
    ParameterError
        If it is neither text nor a path.

    Examples
    --------
    >>> check_path("path", 3)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: path: expected the name of a file, found int
    """
    if isinstance(value, (str, os.PathLike)):
        return Path(cast("str | os.PathLike[str]", value))
    raise ParameterError(name, "the name of a file", type(value).__name__)


def check_file(path: Path, expected: str = "a file") -> None:
    """Raise unless a path is that of a file.

    Parameters
    ----------
    path : Path
        The path.
    expected : str
        What it should be, for the message.

    Raises
    ------
    FormatError
        If there is nothing, a folder, or a device or pipe.

    Examples
    --------
    >>> check_file(Path("trial.c3d"))
    Traceback (most recent call last):
    ...
    asterism.errors.FormatError: trial.c3d: no such file
    """
    if path.is_file():
        return
    if not path.exists():
        raise FormatError(path, "", "", "no such file")
    raise FormatError(path, "", expected, "a folder" if path.is_dir() else "a device or pipe")


def not_read(path: str | Path, error: OSError) -> FormatError:
    """Give the error for a file that the system does not let be read."""
    if isinstance(error, FileNotFoundError):
        return FormatError(path, "", "", "no such file")
    if isinstance(error, IsADirectoryError):
        return FormatError(path, "", "a file", "a folder")
    return FormatError(path, "", "", f"cannot be read: {_reason(error)}")


def not_written(path: str | Path, error: OSError) -> FormatError:
    """Give the error for a file or folder that the system does not let be written."""
    hint = "choose a folder that exists, may be written to and has room"
    return FormatError(path, "", "", f"cannot be written: {_reason(error)}", hint)


def _reason(error: OSError) -> str:
    """Say why, without the name of a temporary file."""
    if isinstance(error, FileNotFoundError):
        return "no such folder"
    text = error.strerror or "the system refuses"
    return text[0].lower() + text[1:]


def check_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | str, ...],
    *,
    dtype: type = np.float64,
    finite: bool = True,
) -> NDArray[Any]:
    """Give `value` as a C-contiguous array of a shape and type, or raise.

    Parameters
    ----------
    name : str
        How the caller knows the value.
    value : array_like
        The value.
    shape : tuple of int or str
        A size per axis, or a letter where any size will do.
    dtype : type
        The type of the items.
    finite : bool
        Whether NaN and infinities are refused.

    Returns
    -------
    ndarray
        The array; the input itself where it already fits.

    Raises
    ------
    ParameterError
        If it does not fit.
    """
    wanted = f"an array of shape ({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    try:
        array = np.asarray(value)
        if array.dtype.kind not in ("biuf" if dtype is np.float64 else "biu") and array.size:
            raise ParameterError(name, f"{wanted} of numbers", f"type {array.dtype}")
        array = np.ascontiguousarray(array, dtype=dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(name, f"{wanted} of numbers", str(error)) from error
    fits = array.ndim == len(shape) and all(
        isinstance(want, str) or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        raise ParameterError(name, wanted, f"shape {array.shape}")
    if finite and array.dtype.kind == "f" and not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ParameterError(name, "finite numbers", f"{array[place]} at index {place}")
    return array


def keep_array(
    name: str, value: ArrayLike, shape: tuple[int | str, ...], *, dtype: type = np.float64
) -> NDArray[Any]:
    """Check an array as `check_array` does, for an object that keeps it and must not change.

    Returns
    -------
    ndarray
        Read-only. A copy, unless nobody else can write to the memory.

    Raises
    ------
    ParameterError
        If it does not fit.
    """
    array = check_array(name, value, shape, dtype=dtype)
    if array.flags.writeable and np.may_share_memory(array, np.asarray(value)):
        array = array.copy()
    array.flags.writeable = False
    return array


def check_fields(name: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Raise if a name is given that is not known, with the nearest known one as a hint.

    Parameters
    ----------
    name : str
        What the names belong to.
    given, known : iterable of str
        The names.

    Raises
    ------
    ParameterError
        At the first unknown name.
    """
    known = list(known)
    for field in given:
        if field not in known:
            near = _nearest(str(field), list(map(str, known)))
            hint = f"did you mean {near!r}?" if near else ""
            expected = f"one of {', '.join(known)}" if len(known) > 1 else "".join(known)
            raise ParameterError(name, expected, repr(field), hint)


def _nearest(name: str, known: list[str]) -> str:
    """Give the known name that was probably meant; "" if none comes near.

    A whole name that is near goes before one of whose words one is: gatee means gate_probability.
    """
    import difflib

    folded = {k.lower(): k for k in known}
    words = {word: k for k in reversed(known) for word in k.lower().split("_") if len(word) > 2}
    for names in (folded, words):
        near = difflib.get_close_matches(name.lower(), names, n=1)
        if near:
            return names[near[0]]
    return ""
