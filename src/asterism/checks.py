"""Checks of arguments: each returns the checked value or raises the error that names it."""

from __future__ import annotations

import importlib.util
import math
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from asterism.errors import FormatError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike, NDArray

__all__ = [
    "check_array",
    "check_extra",
    "check_fields",
    "check_file",
    "check_kind",
    "check_number",
    "check_path",
    "keep_array",
]

_MAX_LISTED = 25  # known names in a message


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

    def expected() -> str:
        kind = "a whole number" if integer else "a number"
        left, right = ("[", "]") if closed else ("(", ")")
        if math.isinf(above) and math.isinf(below):
            return f"a finite {kind[2:]}"
        if math.isinf(below):
            return f"{kind} {'≥' if closed else '>'} {above:g}"
        if math.isinf(above):
            return f"{kind} {'≤' if closed else '<'} {below:g}"
        return f"{kind} in {left}{above:g}, {below:g}{right}"

    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ParameterError(name, expected(), repr(value), hint)
    # A file may hold a whole number that no float can.
    number = math.inf if isinstance(value, int) and abs(value) > 1e300 else float(value)
    if integer and not number.is_integer():
        raise ParameterError(name, expected(), f"{number:g}", hint)
    inside = above <= number <= below if closed else above < number < below
    if not (math.isfinite(number) and inside):
        raise ParameterError(name, expected(), f"{number:g}", hint)


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
    """Return `value` as a path, or raise.

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


def check_extra(name: str, extra: str, *packages: str) -> None:
    """Raise unless packages that are optional are installed.

    Parameters
    ----------
    name : str
        What needs them, for the message.
    extra : str
        Extra of the project that installs them.
    *packages : str
        Names under which they are imported.

    Raises
    ------
    ParameterError
        If one is missing.

    Examples
    --------
    >>> check_extra("format", "parquet", "parquet_of_nowhere")
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: format: expected parquet_of_nowhere, which is optional, ...
    """
    missing = [each for each in packages if importlib.util.find_spec(each) is None]
    if missing:
        expected = f"{' and '.join(missing)}, which {'is' if len(missing) == 1 else 'are'} optional"
        hint = f"run pip install 'asterism[{extra}]'"
        raise ParameterError(name, expected, "not installed", hint)


def check_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | str, ...],
    *,
    dtype: type = np.float64,
    finite: bool = True,
) -> NDArray[Any]:
    """Return `value` as a C-contiguous array of a shape and type, or raise.

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

    def wanted() -> str:  # streams check every frame, and need no text for it
        return f"an array of shape ({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"

    try:
        array = np.asarray(value)
        if array.dtype.kind not in ("biuf" if dtype is np.float64 else "biu") and array.size:
            raise ParameterError(name, f"{wanted()} of numbers", f"type {array.dtype}")
        array = np.ascontiguousarray(array, dtype=dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(name, f"{wanted()} of numbers", str(error)) from error
    fits = len(array.shape) == len(shape)
    for want, have in zip(shape, array.shape, strict=False):  # faster than a generator
        fits = fits and (want == have or isinstance(want, str))
    if not fits:
        raise ParameterError(name, wanted(), f"shape {array.shape}")
    # Counting is faster than `all`.
    if finite and array.dtype.kind == "f" and np.count_nonzero(np.isfinite(array)) < array.size:
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ParameterError(name, "finite numbers", f"{array[place]} at index {place}")
    return array


def keep_array(
    name: str,
    value: ArrayLike,
    shape: tuple[int | str, ...],
    *,
    dtype: type = np.float64,
    finite: bool = True,
) -> NDArray[Any]:
    """Check an array as `check_array` does, for an object that keeps it and must not change.

    Returns
    -------
    ndarray
        Read-only. A copy, unless no other object can write to the memory.

    Raises
    ------
    ParameterError
        If it does not fit.
    """
    array = check_array(name, value, shape, dtype=dtype, finite=finite)
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
            more = f" and {len(known) - _MAX_LISTED} more" if len(known) > _MAX_LISTED else ""
            those = ", ".join(known[:_MAX_LISTED]) + more
            expected = f"one of {those}" if len(known) > 1 else those
            raise ParameterError(name, expected, repr(field), hint)


def _nearest(name: str, known: list[str]) -> str:
    """Return the known name that was probably meant, or "" if none is similar.

    The first name that begins with the text goes before a similar name ("fil" means fill, not
    film), and that before a name with a similar word.
    """
    import difflib

    begun = [k for k in known if name and k.lower().startswith(name.lower())]
    if begun:
        return begun[0]

    folded = {k.lower(): k for k in known}
    words: dict[str, str] = {}
    for k in reversed(known):
        words |= {word: k for word in re.split(r"[_.]", k.lower()) if len(word) > 2}
    for names in (folded, words):
        near = difflib.get_close_matches(name.lower(), names, n=1)
        if near:
            return names[near[0]]
    return ""
