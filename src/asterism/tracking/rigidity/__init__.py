"""Which markers keep their distance: learnt from tracks, used by stitching, naming and filling."""

from asterism.tracking.rigidity.bonds import Bonds, learn_bonds

__all__ = ["Bonds", "learn_bonds"]
