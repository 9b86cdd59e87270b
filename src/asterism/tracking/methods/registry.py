"""Registry of all methods by name; a new method is added here."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

from asterism.checks import check_fields
from asterism.records import Registry
from asterism.tracking.methods.gnn import GNN
from asterism.tracking.methods.jpda import JPDA
from asterism.tracking.methods.mcmcda import MCMCDA
from asterism.tracking.methods.mda import MDA
from asterism.tracking.methods.mht import MHT
from asterism.tracking.methods.smp import SMP
from asterism.tracking.methods.tomht import TOMHT
from asterism.tracking.methods.track_splitting import TrackSplitting

if TYPE_CHECKING:
    from asterism.tracking.methods.base import Method

__all__ = ["METHODS", "method_by_name", "options_of", "record_in"]

METHODS: dict[str, type[Method[Any]]] = Registry(
    {method.name: method for method in (GNN, SMP, JPDA, TrackSplitting, TOMHT, MDA, MHT, MCMCDA)}
)
"""Method classes by their names on the command line."""


def method_by_name(name: str, **options: Any) -> Method[Any]:
    """Return a method by its name and options.

    Parameters
    ----------
    name : str
        Name on the command line, a key of `METHODS`.
    **options
        Options of the method by name; an option that is a record may be given as a mapping.

    Returns
    -------
    Method

    Raises
    ------
    ParameterError
        If the name or an option is unknown.

    Examples
    --------
    >>> import asterism as am
    >>> am.tracking.method_by_name("smp", window=3, gate={"probability": 1e-6})
    SMP(window=3, gate=Gate(probability=1e-06))
    >>> sorted(am.tracking.METHODS)
    ['gnn', 'jpda', 'mcmcda', 'mda', 'mht', 'smp', 'splitting', 'tomht']
    """
    check_fields("method", [name], METHODS)
    kind: type[Any] = METHODS[name]
    check_fields(f"method {name}", options, [f.name for f in dataclasses.fields(kind)])
    return _made(kind, options)


def _made(kind: type[Any], options: Mapping[str, Any]) -> Any:
    """Return a record made from its options; nested records may be given as tables."""
    kinds = typing.get_type_hints(kind)
    made = dict(options)
    for name, value in options.items():
        inner = record_in(kinds.get(name))
        if inner is not None and isinstance(value, Mapping):
            made[name] = _made(inner, cast("Mapping[str, Any]", value))
    return kind(**made)


def record_in(kind: Any) -> type[Any] | None:
    """Return the record class among an option's types, None if there is none.

    Parameters
    ----------
    kind : type
        Annotation of the option, such as ``Rigidity | None``.

    Returns
    -------
    type or None

    Examples
    --------
    >>> import asterism as am
    >>> record_in(am.tracking.Rigidity | None).__name__
    'Rigidity'
    """
    for inner in (kind, *typing.get_args(kind)):
        if isinstance(inner, type) and dataclasses.is_dataclass(inner):
            return inner
    return None


def options_of(method: object) -> dict[str, Any]:
    """Return all options of a method by name, those that are records as dictionaries.

    Parameters
    ----------
    method : object
        Method, or one of its records of options.

    Returns
    -------
    dict
        Options by name, as in ``tracks.recipe.options``; empty if `method` is not a record.

    Examples
    --------
    >>> import asterism as am
    >>> options_of(am.GNN())["gate"]
    {'probability': 1e-09}
    """
    if not dataclasses.is_dataclass(method):
        return {}
    options = {field.name: getattr(method, field.name) for field in dataclasses.fields(method)}
    return {
        name: options_of(value) if dataclasses.is_dataclass(value) else value
        for name, value in options.items()
    }
