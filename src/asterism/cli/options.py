"""Options derived from the library, with the names, types, defaults and texts of the API."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import re
import types
import typing
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Union

import typer

from asterism.checks import check_fields
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Mapping, Sequence

__all__ = [
    "Option",
    "as_options",
    "nested",
    "parsed",
    "record_options",
    "scene_options",
    "with_option_names",
]


@dataclass(frozen=True, kw_only=True)
class Option:
    """One option of a method or a scene.

    Parameters
    ----------
    name : str
        Name of the option.
    kind : object
        Annotated type.
    default : object
        Default value.
    about : str
        Text of the docstring about it.
    """

    name: str
    kind: Any
    default: Any
    about: str

    @property
    def type_text(self) -> str:
        """Type of the option, as the lists of options print it."""
        return _type_text(self.kind)

    def parse(self, text: str) -> Any:
        """Read a value of this option.

        Raises
        ------
        ParameterError
            If the text is not of the type. The library checks the range.
        """
        return _parse(self.name, self.kind, text)


def record_options(kind: type) -> dict[str, Option]:
    """Return the options of a method, or of another record, by name.

    Options of a nested record have its name and a dot before theirs. A record that may be None is
    also an option itself, true or false.
    """
    from asterism.tracking.methods.registry import record_in

    if not dataclasses.is_dataclass(kind):
        return {}
    kinds = typing.get_type_hints(kind)
    about: dict[str, str] = {}
    for base in kind.__mro__:  # a subclass may refer to the text of its base
        about |= _about_parameters(base)
    options: dict[str, Option] = {}
    for f in dataclasses.fields(kind):
        inner = record_in(kinds[f.name])
        text = about.get(f.name, "")
        if inner is None:
            options[f.name] = Option(name=f.name, kind=kinds[f.name], default=f.default, about=text)
            continue
        if f.default is None:
            options[f.name] = Option(name=f.name, kind=bool, default=False, about=text)
        for option in record_options(inner).values():
            name = f"{f.name}.{option.name}"
            options[name] = dataclasses.replace(option, name=name)
    return options


def nested(values: Mapping[str, Any], known: Mapping[str, Option]) -> dict[str, Any]:
    """Return options with dotted names as tables, as `asterism.tracking.method_by_name` takes them.

    Raises
    ------
    ParameterError
        If a record is switched off and its options are given.
    """
    switches = {n for n in values if any(other.startswith(f"{n}.") for other in known)}
    made = {n: v for n, v in values.items() if "." not in n and n not in switches}
    made |= {n: {} if values[n] else None for n in switches}
    for name, value in values.items():
        table, dot, key = name.partition(".")
        if not dot:
            continue
        if made.setdefault(table, {}) is None:
            raise ParameterError(table, f"true, as {name} is given", "false")
        made[table][key] = value
    return made


def scene_options(scene: Callable[..., Any]) -> dict[str, Option]:
    """Return the options of a scene by name: the arguments of its function."""
    about = _about_parameters(scene)
    kinds = typing.get_type_hints(scene)
    arguments = inspect.signature(scene).parameters
    return {
        a.name: Option(
            name=a.name,
            kind=kinds[a.name],
            default=a.default,
            about=about.get(a.name, ""),
        )
        for a in arguments.values()
    }


def parsed(
    option: str, owner: str, texts: Sequence[str], known: dict[str, Option]
) -> dict[str, Any]:
    """Read ``NAME=VALUE`` texts.

    Parameters
    ----------
    option : str
        Option of the command line that has the texts as values, for the messages.
    owner : str
        Method or scene that has the options, for the messages.
    texts : sequence of str
        Texts of the command line. If a name is repeated, the last value is used.
    known : dict
        Known options by name.

    Returns
    -------
    dict
        Values by name.

    Raises
    ------
    ParameterError
        At a text without ``=``, an unknown name, or a value of another type.
    """
    values: dict[str, Any] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().replace("-", "_")
        if not equals:
            raise ParameterError(option, f"NAME=VALUE for {owner}", repr(text))
        if not known:
            raise ParameterError(option, f"no option, as {owner} has none", repr(name))
        check_fields(f"{option} ({owner})", [name], known)
        with as_options({name: f"{option} {name}"}):
            values[name] = known[name].parse(value.strip())
    return values


@contextmanager
def as_options(names: Mapping[str, str]) -> Generator[None, None, None]:
    """Replace the argument in an error of the library by its option of the command line.

    Parameters
    ----------
    names : mapping of str to str
        Option by argument. Errors about other arguments stay unchanged.
    """
    try:
        yield
    except ParameterError as error:
        if error.name not in names:
            raise
        raise ParameterError(names[error.name], error.expected, error.got, error.hint) from error


def with_option_names(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with option names in its errors, in place of arguments of the library."""
    names: dict[str, str] = {}
    for name, kind in typing.get_type_hints(command, include_extras=True).items():
        for info in getattr(kind, "__metadata__", ()):
            if isinstance(info, typer.models.OptionInfo):
                long = [text for text in info.param_decls or () if text.startswith("--")]
                names[name] = long[0] if long else f"--{name.replace('_', '-')}"

    @functools.wraps(command)
    def named(*arguments: Any, **options: Any) -> None:
        with as_options(names):
            command(*arguments, **options)

    return named


def _type_text(kind: Any) -> str:
    if typing.get_origin(kind) is Literal:
        return "|".join(map(str, typing.get_args(kind)))
    if typing.get_origin(kind) in (Union, types.UnionType):
        # A user can type a value of the first type, or none.
        inner = [k for k in typing.get_args(kind) if k is not type(None)]
        is_optional = len(inner) < len(typing.get_args(kind))
        return _type_text(inner[0]) + (" | None" if is_optional else "")
    return getattr(kind, "__name__", str(kind))


def _parse(name: str, kind: Any, text: str) -> Any:
    if kind is bool:
        words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
        if text.lower() not in words:
            raise ParameterError(name, "true or false", repr(text))
        return words[text.lower()]
    if kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            what = "a whole number" if kind is int else "a number"
            raise ParameterError(name, what, repr(text)) from None
    if typing.get_origin(kind) in (Union, types.UnionType):
        inner = [k for k in typing.get_args(kind) if k is not type(None)]
        return None if text.lower() == "none" else _parse(name, inner[0], text)
    if typing.get_origin(kind) is tuple:
        parts = [part.strip() for part in text.strip("() ").split(",")]
        inner = typing.get_args(kind)
        if Ellipsis not in inner and len(parts) != len(inner):
            raise ParameterError(name, f"{len(inner)} values separated by commas", repr(text))
        return tuple(_parse(name, inner[0], part) for part in parts)
    if typing.get_origin(kind) is Literal:
        choices = [str(choice) for choice in typing.get_args(kind)]
        check_fields(name, [text], choices)
        return typing.get_args(kind)[choices.index(text)]
    return text


def _about_parameters(documented: object) -> dict[str, str]:
    """Read the section ``Parameters`` of a NumPy-style docstring."""
    doc = inspect.cleandoc(getattr(documented, "__doc__", None) or "")
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\S[^\n]*\n---|\Z)", doc, re.M | re.S)
    about: dict[str, str] = {}
    if section is None:
        return about
    for entry in re.finditer(r"^(\S[^\n]*?) : [^\n]*\n((?:[ \t]+[^\n]*\n?|\n)*)", section[1], re.M):
        text = " ".join(entry[2].split())
        about |= {name.strip(): text for name in entry[1].split(",")}
    return about
