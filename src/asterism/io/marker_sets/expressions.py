"""Sizes in Vicon's files: numbers, names of parameters and arithmetic, evaluated without `eval`."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from asterism.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path
    from xml.etree.ElementTree import Element

__all__ = ["Parameters", "evaluate", "fields"]

_TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)|([^\W\d]\w*)|'([^']*)'|([-+*/()]))"
)
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt,
}  # fmt: skip
_LONGEST, _DEEPEST = 1000, 20  # characters, and levels of brackets or of names within names


class Parameters:
    """The parameters of a file by name: VALUE, else EXPRESSION, else PRIOR.

    Parameters
    ----------
    path : Path
        File for the errors.
    elements : list of Element
        Elements with the attributes of a parameter; the first of a name counts.
    """

    def __init__(self, path: Path, elements: list[Element]) -> None:
        self.path = path
        self.texts: dict[str, str] = {}
        for element in elements:
            stated = (element.get(key, "").strip() for key in ("VALUE", "EXPRESSION", "PRIOR"))
            text = next((text for text in stated if text), "")
            self.texts.setdefault(element.get("NAME", "").strip(), text)
        self.known: dict[str, float] = {}
        self.depth = 0

    def __call__(self, name: str) -> float:
        """Return the value of a parameter, in the unit of the file."""
        if name not in self.known:
            text, place = self.texts.get(name, ""), f"parameter {name[:60]!r}"
            if not text:
                hint = "export the file again" if name in self.texts else "check the name"
                raise FormatError(self.path, place, "a VALUE, EXPRESSION or PRIOR", "none", hint)
            self.depth += 1
            if self.depth > _DEEPEST:
                got = "a name that refers to itself, or a longer chain"
                raise FormatError(self.path, place, f"at most {_DEEPEST} names in turn", got)
            self.known[name] = self.number(place, text)
            self.depth -= 1
        return self.known[name]

    def number(self, place: str, text: str) -> float:
        """Return the value of an expression at a place in the file."""
        try:
            value = evaluate(text, self)
        except FormatError:
            raise
        except (ValueError, ArithmeticError) as error:
            expected = "a number, or parameters with + - * / ( ) sin cos sqrt"
            raise FormatError(self.path, place, expected, f"{text[:60]!r} ({error})") from None
        if not math.isfinite(value):
            raise FormatError(self.path, place, "a finite number", repr(text[:60]))
        return value


def evaluate(text: str, value_of: Callable[[str], float]) -> float:
    """Return the value of an arithmetic expression.

    Parameters
    ----------
    text : str
        Numbers, names (also in single quotes), ``+ - * /``, brackets, ``sin``, ``cos``, ``sqrt``.
    value_of : callable
        Returns the value of a name.

    Raises
    ------
    ValueError, ArithmeticError
        If the text is no expression, or has no value.

    Examples
    --------
    >>> evaluate("-(Width + 'Ball size') / 2", {"Width": 8.0, "Ball size": 2.0}.__getitem__)
    -5.0
    """
    return _Parser(_tokens(text), value_of).whole()


def fields(text: str) -> list[str]:
    """Split a vector of expressions at blanks outside of quotes and brackets.

    Examples
    --------
    >>> fields("0 -Height/2 'Left x' ( A + B )")
    ['0', '-Height/2', "'Left x'", '( A + B )']
    """
    parts, own, depth, is_quoted = [], "", 0, False
    for letter in text:
        is_quoted ^= letter == "'"
        depth += 0 if is_quoted else (letter == "(") - (letter == ")")
        if letter.isspace() and not is_quoted and depth == 0:
            parts, own = [*parts, own], ""
        else:
            own += letter
    return [part for part in [*parts, own] if part]


def _tokens(text: str) -> list[tuple[str, str]]:
    if len(text) > _LONGEST:
        raise ValueError(f"more than {_LONGEST} characters")
    found: list[tuple[str, str]] = []
    at, end = 0, len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None:
            raise ValueError(f"unexpected {text[at : at + 10].strip()!r}")
        number, name, quoted, sign = match.groups()
        kind = "number" if number else "sign" if sign else "name"
        found.append((kind, number or name or sign or quoted or ""))
        at = match.end()
    return found


class _Parser:
    """Recursive descent: sum, product, signed, atom."""

    def __init__(self, tokens: list[tuple[str, str]], value_of: Callable[[str], float]) -> None:
        self.tokens, self.value_of = tokens, value_of
        self.at = self.depth = 0

    def whole(self) -> float:
        value = self.sum()
        if self.at < len(self.tokens):
            raise ValueError(f"unexpected {self.tokens[self.at][1]!r}")
        return value

    def taken(self, *signs: str) -> str | None:
        """Return the next token and step over it if it is one of some signs."""
        if self.at < len(self.tokens) and self.tokens[self.at] in [("sign", s) for s in signs]:
            self.at += 1
            return self.tokens[self.at - 1][1]
        return None

    def sum(self) -> float:
        value = self.product()
        while sign := self.taken("+", "-"):
            other = self.product()
            value = value + other if sign == "+" else value - other
        return value

    def product(self) -> float:
        value = self.signed()
        while sign := self.taken("*", "/"):
            other = self.signed()
            value = value * other if sign == "*" else value / other
        return value

    def signed(self) -> float:
        factor = 1
        while sign := self.taken("+", "-"):
            factor *= -1 if sign == "-" else 1
        return factor * self.atom()

    def atom(self) -> float:
        if self.taken("("):
            return self.bracket()
        if self.at >= len(self.tokens):
            raise ValueError("it ends too early")
        kind, text = self.tokens[self.at]
        self.at += 1
        if kind == "number":
            return float(text)
        if kind == "sign":
            raise ValueError(f"unexpected {text!r}")
        if text in _FUNCTIONS and self.taken("("):
            return _FUNCTIONS[text](self.bracket())
        return self.value_of(text)

    def bracket(self) -> float:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise ValueError(f"more than {_DEEPEST} levels of brackets")
        value = self.sum()
        if not self.taken(")"):
            raise ValueError("a bracket is not closed")
        self.depth -= 1
        return value
