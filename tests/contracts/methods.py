"""Every method that the shared tests go through; a new method is one entry."""

from __future__ import annotations

import pytest

import asterism as am
from asterism.tracking import Rigidity

METHODS = {
    "gnn": am.GNN(),
    "smp": am.SMP(),
    "smp by detections": am.SMP(proposers="detections"),
    "jpda": am.JPDA(),
    "jpda without guard": am.JPDA(guard=False),
    "smp of the past": am.SMP(window=3),
    "splitting": am.TrackSplitting(),
    "independent trees": am.TrackSplitting(independent=True, window=4),
    "tomht": am.TOMHT(),
    "mht": am.MHT(),
    "mcmcda": am.MCMCDA(),
    "mda": am.MDA(),
    "tomht with bodies": am.TOMHT(rigid=Rigidity()),
    "mht with bodies": am.MHT(rigid=Rigidity()),
}
each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
