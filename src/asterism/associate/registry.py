"""Every method by its name: the one place to register a new one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.associate.gnn import GNN
from asterism.associate.jpda import JPDA
from asterism.associate.mcmcda import MCMCDA
from asterism.associate.mda import MDA
from asterism.associate.mht import MHT
from asterism.associate.smp import SMP
from asterism.associate.tomht import TOMHT
from asterism.associate.track_splitting import TrackSplitting
from asterism.errors import check_fields
from asterism.records import Registry

if TYPE_CHECKING:
    from asterism.associate.method import Method

__all__ = ["METHODS", "method_by_name"]

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
    import dataclasses

    check_fields("method", [name], METHODS)
    method = METHODS[name]
    known = [f.name for f in dataclasses.fields(method)] if dataclasses.is_dataclass(method) else []
    check_fields(f"method {name}", options, known)
    return method(**options)
