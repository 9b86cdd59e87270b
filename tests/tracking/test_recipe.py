"""A recipe repeats a tracking bit for bit, after it was written to TOML and read again too."""

from __future__ import annotations

import pickle
import tomllib

import numpy as np
import pytest

import asterism as am
from asterism.model import Recipe
from asterism.model.recipe import sha256_of
from asterism.model.toml_file import write_toml
from asterism.tracking import ChainOptions, Gate, Lifecycle, Rigidity, method_by_name
from tests.contracts.methods import METHODS
from tests.scenes import small_model, wanderers

DETECTIONS = wanderers(np.random.default_rng(4), n_frames=25).detections
CASES = METHODS | {
    "records": am.GNN(
        gate=Gate(probability=1e-6), lifecycle=Lifecycle(delete_odds=50), rigid=Rigidity(max_gap=9)
    ),
    "cells": am.MCMCDA(moves=5, chain=ChainOptions(groups="cells", distance=0.5)),
    "weights": am.MCMCDA(
        window=None, moves=5, chain=ChainOptions(move_weights={"birth": 1, "death": 1})
    ),
    "report": am.MCMCDA.report_2010(moves=5),
}


@pytest.mark.parametrize("method", CASES.values(), ids=CASES)
def test_a_recipe_in_toml_repeats_the_tracking(method):
    tracks = am.track(DETECTIONS, method, model=small_model(), seed=3)
    written = write_toml(tracks.recipe.to_dict(), None)
    recipe = Recipe.from_dict(tomllib.loads(written))
    assert recipe == tracks.recipe
    assert method_by_name(recipe.method, **recipe.options) == method
    again = am.track(DETECTIONS, recipe=recipe)
    assert again.labels.tobytes() == tracks.labels.tobytes()
    if tracks.confidence is not None:
        assert again.confidence.tobytes() == tracks.confidence.tobytes()


def test_a_recipe_stands_alone_and_is_of_one_input():
    recipe = am.track(DETECTIONS, "gnn", model=small_model()).recipe
    with pytest.raises(am.ParameterError, match="recipe: expected no setting beside it"):
        am.track(DETECTIONS, "gnn", recipe=recipe)
    with pytest.raises(am.ParameterError, match="detections: expected SHA-256"):
        am.track(DETECTIONS.part(0, 20), recipe=recipe)
    start = am.Tracks(detections=DETECTIONS, labels=np.full(DETECTIONS.n_points, -1))
    with pytest.raises(am.ParameterError, match="start: expected none"):
        am.track(DETECTIONS, recipe=recipe, start=start)


def test_the_hash_of_the_input_is_computed_when_it_is_read(monkeypatch):
    recipe = am.track(DETECTIONS, "gnn", model=small_model()).recipe
    stored = pickle.loads(pickle.dumps(recipe))
    assert len(pickle.dumps(recipe)) < DETECTIONS.points.nbytes
    other = am.track(DETECTIONS.part(0, 20), "gnn", model=small_model()).recipe
    assert recipe == stored
    assert recipe != other
    with monkeypatch.context() as patch:
        patch.setattr("asterism.model.recipe.sha256_of", None)
        lazy = am.track(DETECTIONS, "gnn", model=small_model()).recipe
    assert lazy.sha256 == recipe.sha256 == sha256_of(DETECTIONS)


def test_names_and_filled_gaps_are_repeated():
    truth = am.simulate.person(frames=120, seed=3)
    made = am.learn_marker_set(truth)
    capture = am.simulate.corrupt(truth, missing=0.05, clutter=0.05, noise=3e-4, seed=1).detections
    tracks = am.track(capture, marker_set=made, fill=True)
    assert set(filter(None, tracks.names)) == set(truth.names)
    assert tracks.names[: len(made)] == made.names
    assert tracks.detections.filled.any()
    again = am.track(capture, marker_set=[made], recipe=tracks.recipe)
    assert (again.labels == tracks.labels).all()
    assert (again.detections.points == tracks.detections.points).all()
    assert am.model.Recipe.from_dict(tracks.recipe.to_dict()) == tracks.recipe
    with pytest.raises(am.ParameterError, match="marker_set: expected the marker sets of that run"):
        am.track(capture, recipe=tracks.recipe)
    other = made.of_subject("Ann")
    with pytest.raises(am.ParameterError, match="marker_set"):
        am.track(capture, marker_set=other, recipe=tracks.recipe)
    with pytest.raises(am.ParameterError, match="no setting beside it, found fill"):
        am.track(capture, marker_set=made, fill=True, recipe=tracks.recipe)
