"""Reproduction of the tables and figures of the 2010 report, one module with a `PART` each."""

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
    """Import a part of the reproduction.

    Parameters
    ----------
    name : str
        Entry of `PARTS`.

    Returns
    -------
    Part
        Texts and function of the part.

    Examples
    --------
    >>> from asterism.reproduction import load
    >>> load("gates").section
    '§2.1'
    """
    return importlib.import_module(f"asterism.reproduction.{name}").PART
