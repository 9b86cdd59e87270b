"""The parts of the reproduction, in the report's order; each is loaded when it is wanted."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asterism.reproduction.part import Part

__all__ = ["PARTS", "load"]

PARTS = (
    "gates",
    "splitting",
    "assignment",
    "projection",
    "distortion",
    "visibility",
    "occlusion",
    "moves",
    "fix",
    "mcmcda",
    "bonds",
    "groups",
    "marriage",
    "preferences",
    "smp",
)
"""Names of the parts; each is a module of this package with a `PART`."""


def load(name: str) -> Part:
    """Give a part by its name."""
    return importlib.import_module(f"asterism.reproduction.{name}").PART
