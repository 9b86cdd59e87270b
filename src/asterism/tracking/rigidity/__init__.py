"""Bonds: stable distances between markers, used by stitching, naming and filling."""

from asterism.tracking.rigidity.bonds import Bonds, learn_bonds
from asterism.tracking.rigidity.shared import learn_shared_acceleration
from asterism.tracking.rigidity.shared_size import shared_size

__all__ = ["Bonds", "learn_bonds", "learn_shared_acceleration", "shared_size"]
