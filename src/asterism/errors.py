"""The errors of the library.

Every message says what was expected, what was got and, where there is one, what to do about it.
Nothing here knows about tracking.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

__all__ = [
    "AsterismError",
    "FormatError",
    "ParameterError",
    "SinkError",
    "SolverLimit",
    "SourceError",
    "SourceLost",
    "clipped",
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
    """Return a message in one line: place, expectation, finding and advice."""
    text = f"{place}: expected {expected}, found {got}" if expected else f"{place}: {got}"
    if hint:
        first, end = hint.split(" ", 1)[0], "" if hint[-1] in ".?!" else "."
        # A word of prose gets its capital, code (am.GNN(), window=3) stays as it is.
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


class SourceError(AsterismError):
    """A source of a stream cannot be reached, or refuses.

    Parameters
    ----------
    message : str
        The source, what is wrong, and what to do about it.
    """


class SourceLost(SourceError):
    """The connection to a source of a stream is gone.

    Parameters
    ----------
    message : str
        What is wrong, without the name of the source: the log message begins with it.
    """


class SinkError(AsterismError):
    """A sink of a stream is not available.

    Parameters
    ----------
    message : str
        The sink, what is wrong, and what to do about it.
    """


def not_read(path: str | Path, error: OSError) -> FormatError:
    """Return the error for a file that cannot be read."""
    if isinstance(error, FileNotFoundError):
        return FormatError(path, "", "", "no such file")
    if isinstance(error, IsADirectoryError):
        return FormatError(path, "", "a file", "a folder")
    return FormatError(path, "", "", f"cannot be read: {_reason(error)}")


def not_written(path: str | Path, error: OSError) -> FormatError:
    """Return the error for a file or folder that cannot be written."""
    hint = "choose a folder that exists, may be written to and has room"
    return FormatError(path, "", "", f"cannot be written: {_reason(error)}", hint)


def _reason(error: OSError) -> str:
    """Return the reason without the name of a temporary file."""
    if isinstance(error, FileNotFoundError):
        return "no such folder"
    text = error.strerror or "the system refuses"
    return text[0].lower() + text[1:]
