"""Bonds: stable distances between markers, used by stitching, naming and filling."""

from asterism.tracking.rigidity.bonds import Bonds, learn_bonds

__all__ = ["Bonds", "learn_bonds"]
