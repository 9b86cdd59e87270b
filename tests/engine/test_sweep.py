"""Every method with its main options on short pieces of hard captures and scenes.

The labels are only held to be tracks at all: this is what the sanitizers watch the engine do.
"""

from __future__ import annotations

import functools

import numpy as np
import pytest

import asterism as am
from asterism.tracking import ChainOptions, Rigidity
from tests.paths import DATA
from tests.scenes import crowd, interacting, sized, small_model

METHODS = {
    "gnn": am.GNN(),
    "gnn with bodies": am.GNN(rigid=Rigidity()),
    "smp": am.SMP(),
    "smp, three frames": am.SMP(window=3),
    "jpda": am.JPDA(),
    "jpda with bodies": am.JPDA(rigid=Rigidity()),
    "splitting": am.TrackSplitting(),
    "mht": am.MHT(),
    "mht, five frames": am.MHT(window=5),
    "tomht": am.TOMHT(),
    "tomht, eight frames, few branches": am.TOMHT(window=8, max_branches=4),
    "tomht with bodies": am.TOMHT(rigid=Rigidity()),
    "mda": am.MDA(),
    "mda, relaxed": am.MDA(window=2, solver="relaxed"),
    "mcmcda": am.MCMCDA(moves=10, confidence=10),
    "mcmcda, one frame": am.MCMCDA(window=1, moves=10, confidence=10),
    "mcmcda, whole": am.MCMCDA(window=None, moves=10, confidence=10),
    "mcmcda, chains": am.MCMCDA(moves=5, confidence=5, chains=3, threads=2),
    "mcmcda, cells": am.MCMCDA(
        moves=5, chain=ChainOptions(groups="cells", distance=0.5)
    ),
    "mcmcda, clusters": am.MCMCDA(
        moves=5, chain=ChainOptions(groups="clusters", distance=0.5)
    ),
    "mcmcda, sure tracks": am.MCMCDA(moves=5, chain=ChainOptions(bonds=3)),
    "mcmcda, a draw": am.MCMCDA(moves=5, keep="draw", end_odds=1),
    "mcmcda, the report's": am.MCMCDA.report_2010(moves=10),
}  # fmt: skip
CAPTURES = {  # file, and one of how many of its frames
    "racing": ("kinematics_racing_full.c3d", 2),
    "fingers": ("recording.tsv", 1),
    "free-form": ("nick_freeform_001.c3d", 1),
}


@functools.cache
def piece(name: str) -> tuple[am.Detections, am.TrackingModel]:
    """Detections with misses, clutter and noise, and a model of one motion."""
    if name == "crowd":
        return crowd(3, spread=0.04, n_frames=sized(16, 12)).detections, small_model(
            motion=am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), noise_sigma=0.01,
            max_speed=1.5, clutter_density=5.0, birth_density=0.5, p_disappear=1e-3, max_gap=6,
        )  # fmt: skip
    if name == "dense":
        truth = am.simulate.smooth(n_markers=60, frames=sized(8, 5), seed=2)
    else:
        file, stride = CAPTURES[name]
        found = sorted(DATA.rglob(file))
        if not found:
            pytest.skip(f"no {file} in {DATA}")
        truth = am.simulate.corrupt(am.read(found[0]).tracks, stride=stride)
    d = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=1).detections
    first, n, about = d.n_frames // 2, sized(11, 8), sized(60, 20)
    model = am.estimate_model(d.part(max(first - about, 0), min(first + about, d.n_frames))).model
    motion = am.DWNA(
        acceleration_sigma=model.motion.modes[-1].acceleration_sigma,
        velocity_sigma=model.motion.modes[-1].velocity_sigma,
    )
    one = am.TrackingModel(motion=motion, sensor=model.sensor, population=model.population)
    return d.part(first, min(first + n, d.n_frames)) if name != "dense" else d, one


@pytest.mark.parametrize("several", [False, True], ids=["one motion", "several"])
@pytest.mark.parametrize("name", ["crowd", "dense", *CAPTURES])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS.keys())
def test_a_hard_piece_is_tracked(name, method, several):
    d, model = piece(name)
    if several:
        model = am.TrackingModel(
            motion=interacting(), sensor=model.sensor, population=model.population
        )
    tracks = am.track(d, method, model=model, seed=1)
    order, _ = tracks.by_track
    same_track = np.diff(tracks.labels[order]) == 0
    assert (np.diff(d.frame_of[order])[same_track] >= 1).all()
    if tracks.confidence is not None:
        assert ((tracks.confidence >= 0) & (tracks.confidence <= 1)).all()
