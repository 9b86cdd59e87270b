"""The tables and figures of the 2010 report, reproduced; each part is a module with a `PART`."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asterism.reproduction.part import Part

__all__ = ["PARTS", "load"]

PARTS = (
    "gates", "splitting", "assignment", "projection", "distortion", "visibility", "occlusion",
    "moves", "fix", "mcmcda", "bonds", "groups", "marriage", "preferences", "smp",
)  # fmt: skip
"""Names of the parts, in the order of the report."""


def load(name: str) -> Part:
    """Import a part by its name."""
    return importlib.import_module(f"asterism.reproduction.{name}").PART
