"""Value types of the library: frozen dataclasses with checked names and a short ``repr``.

Nothing here knows about tracking. See `asterism.errors` for the errors that are raised.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import TYPE_CHECKING, Any, TypeVar, cast, dataclass_transform, overload

import numpy as np

from asterism.checks import check_fields
from asterism.errors import ParameterError, clipped

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["MAX_REPR", "Registry", "brief", "record"]

MAX_REPR = 200
"""Characters of the ``repr`` of a public object, which is one line."""

_MAX_ITEMS = 4  # of a sequence or mapping that is written out

C = TypeVar("C", bound=type)
V = TypeVar("V")


@overload
def record(cls: C) -> C: ...
@overload
def record(*, eq: bool = True, kw_only: bool = True) -> Callable[[C], C]: ...
@dataclass_transform(
    frozen_default=True, kw_only_default=True, field_specifiers=(dataclasses.field,)
)
def record(cls: Any = None, *, eq: bool = True, kw_only: bool = True) -> Any:
    """Make a class a frozen dataclass with checked names and a short ``repr``.

    A misspelt, missing or surplus argument raises `ParameterError` with the nearest name, where a
    plain dataclass raises `TypeError`. The ``repr`` of an instance is one line of at most
    `MAX_REPR` characters: the class's own `__repr__`, clipped, or the fields that differ from their
    defaults, arrays by their shape.

    Parameters
    ----------
    cls : type
        The class, with annotated fields.
    eq : bool
        Whether instances are compared field by field; False for those that hold arrays.
    kw_only : bool
        Whether fields are given by name alone.

    Examples
    --------
    >>> @record
    ... class Options:
    ...     gate: float = 3.0
    >>> Options(), Options(gate=4)
    (Options(), Options(gate=4))
    >>> Options(gatee=4)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: Options: expected gate, found 'gatee'. Did you mean ...
    """
    if cls is None:
        return functools.partial(record, eq=eq, kw_only=kw_only)
    made = dataclasses.dataclass(frozen=True, eq=eq, kw_only=kw_only, repr=False)(cls)
    _check_names(made)
    _shorten(made)
    return made


def _check_names(cls: Any) -> None:
    """Let the constructor name the argument at fault, and be fast where all are given by name."""
    make = cls.__init__
    fields = dataclasses.fields(cls)
    names = {f.name for f in fields}
    is_plain = all(f.init for f in fields)
    check = getattr(cls, "__post_init__", None)

    @functools.wraps(make)
    def init(self: Any, *args: Any, **options: Any) -> None:
        if is_plain and not args and options.keys() == names:
            # As the constructor of a frozen dataclass does, in a third of the time.
            self.__dict__.update(options)
            if check is not None:
                check(self)
            return
        try:
            make(self, *args, **options)
        except TypeError:
            _diagnose(cls, args, options)
            raise

    cls.__init__ = init


def _diagnose(cls: Any, args: tuple[Any, ...], options: dict[str, Any]) -> None:
    """Raise `ParameterError` if the names of the arguments are what is wrong."""
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}
    name = cls.__name__
    if options and not fields:
        raise ParameterError(name, "no options", repr(next(iter(options))))
    check_fields(name, options, fields)
    by_place = [f.name for f in fields.values() if not f.kw_only]
    if len(args) > len(by_place):
        most = f"{len(by_place)} values without a name" if by_place else "options by name"
        hint = f"{name}({next(iter(fields))}=…)" if fields else ""
        raise ParameterError(name, most, f"{len(args)} without one", hint and f"Write {hint}")
    for twice in options.keys() & set(by_place[: len(args)]):
        raise ParameterError(f"{name}.{twice}", "one value", "two")
    for field in list(fields.values()):
        is_given = field.name in options or field.name in by_place[: len(args)]
        if not is_given and not _has_default(field):
            raise ParameterError(f"{name}.{field.name}", "a value", "nothing")


def _has_default(field: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return field.default is not missing or field.default_factory is not missing


def _shorten(cls: Any) -> None:
    """Let the ``repr`` fit one line."""
    if cls.__repr__ is object.__repr__ or cls.__repr__ is tuple.__repr__:
        raw: Callable[[Any], str] = _fields_text
    elif "__repr__" in vars(cls):
        raw = cls.__repr__
    else:
        return  # inherited, and short already

    @functools.wraps(cls.__repr__)
    def short(self: Any) -> str:
        return clipped(raw(self), MAX_REPR)

    cls.__repr__ = short


def _fields_text(value: Any) -> str:
    shown = [
        f"{f.name}={brief(getattr(value, f.name))}"
        for f in dataclasses.fields(value)
        if not _is_default(f, getattr(value, f.name))
    ]
    return f"{type(value).__name__}({', '.join(shown)})"


def _is_default(field: dataclasses.Field[Any], value: Any) -> bool:
    default = field.default
    plain = (bool, int, float, str, type(None))
    if dataclasses.is_dataclass(default):
        return bool(default == value)
    if isinstance(default, plain) and isinstance(value, plain):
        return type(default) is type(value) and default == value
    if field.default_factory is dataclasses.MISSING:
        return False
    if isinstance(value, np.ndarray):
        return not cast("np.ndarray[Any, Any]", value).size
    return bool(value == field.default_factory())


def brief(value: object) -> str:
    """Write a value in a few words, for a ``repr``: an array by its shape, a number by four digits.

    Parameters
    ----------
    value : object
        The value.

    Returns
    -------
    str

    Examples
    --------
    >>> brief(np.zeros((20, 3))), brief(0.1234567), brief(range(9)), brief((1, 2.0))
    ('array (20, 3)', '0.1235', '9 items', '(1, 2)')
    """
    if isinstance(value, np.ndarray):
        array = cast("np.ndarray[Any, Any]", value)
        if array.ndim == 0 or (array.ndim == 1 and 0 < array.size <= _MAX_ITEMS):
            return brief(array.tolist())
        return f"array {array.shape}"
    if isinstance(value, (float, np.floating)):
        return f"{float(value):.4g}"
    if isinstance(value, (tuple, list)) and len(cast("list[Any]", value)) <= _MAX_ITEMS:
        inside = ", ".join(map(brief, cast("list[Any]", value)))
        return f"[{inside}]" if isinstance(value, list) else f"({inside})"
    if isinstance(value, dict) and len(cast("dict[Any, Any]", value)) <= _MAX_ITEMS:
        pairs = cast("dict[Any, Any]", value).items()
        return f"{{{', '.join(f'{key!r}: {brief(item)}' for key, item in pairs)}}}"
    if isinstance(value, (tuple, list, dict, set, frozenset, range)):
        return f"{len(cast('list[Any]', value))} items"
    if isinstance(value, str):
        return repr(clipped(value, 60))
    if callable(value) and hasattr(value, "__name__"):
        return str(value.__name__)
    return clipped(repr(value), MAX_REPR)


class Registry(dict[str, V]):
    """What can be chosen by name; its ``repr`` is the names."""

    def __repr__(self) -> str:
        return clipped(f"{len(self)} by name: {', '.join(self)}", MAX_REPR)
