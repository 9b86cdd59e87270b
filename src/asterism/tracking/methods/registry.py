"""Every method by its name: the one place to register a new one."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

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

__all__ = ["METHODS", "method_by_name", "options_of"]

METHODS: dict[str, type[Method[Any]]] = Registry(
    {method.name: method for method in (GNN, SMP, JPDA, TrackSplitting, TOMHT, MDA, MHT, MCMCDA)}
)
"""Method by name, as the command line knows it."""


def method_by_name(name: str, **options: Any) -> Method[Any]:
    """Make a method from its name and options.

    Raises
    ------
    ParameterError
        At an unknown name or option.
    """
    check_fields("method", [name], METHODS)
    method = METHODS[name]
    known = [f.name for f in dataclasses.fields(method)] if dataclasses.is_dataclass(method) else []
    check_fields(f"method {name}", options, known)
    return method(**options)


def options_of(method: Method[Any]) -> dict[str, Any]:
    """Return all options of a method by name; none of one that is no dataclass."""
    if not dataclasses.is_dataclass(method):
        return {}
    return {field.name: getattr(method, field.name) for field in dataclasses.fields(method)}
