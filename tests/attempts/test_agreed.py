"""Searches by MCMCDA until two independent ones agree, and the progress of attempts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am
from asterism.tracking.attempts import agreed, most_certain
from asterism.tracking.attempts.halves import Halves
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.choose import CONFUSED


def crowded(seed=1):
    """Markers that attract each other, so that most links have rivals."""
    take = am.simulate.attracted(frames=100, seed=seed)
    return am.simulate.corrupt(take, missing=0.1, clutter=0.1, seed=seed)


def scripted(monkeypatch, log_posteriors, n_frames=20):
    """Replace attempts by results with these log posteriors; return the recipes they get."""
    take, made = am.simulate.cube(frames=n_frames, seed=1), []
    values = iter(log_posteriors)

    def attempt(recipe, *_, **__):
        made.append(recipe)
        tracks = dataclasses.replace(take, info={"log_posterior": next(values)}, recipe=recipe)
        return Uncorrected(tracks=tracks, recipe=recipe, model=recipe.model)

    monkeypatch.setattr(agreed, "attempt", attempt)
    plan = am.tracking.plan_tracking(take.detections, "mcmcda", seed=7)
    recipe = dataclasses.replace(plan.recipe, reason="many rivals", retry=True)
    return agreed.until_agreed(recipe, take.detections), made


@pytest.mark.parametrize(
    ("log_posteriors", "moves", "best", "how"),
    [
        ([10.0, 10.5], [100], (100, 8), "with 100 moves agree within 0.5 nats"),
        ([10.0, 12.0, 14.0, 13.5], [100, 400], (400, 7), "with 400 moves agree within 0.5 nats"),
        ([10.0, 20.0, 11.0, 11.0], [100, 400], (100, 8), "with 400 moves agree within 0.0 nats"),
        ([1, 3, 5, 9, 30, 4.5], [100, 400, 1600], (1600, 7), "moves still differ by 25.5 nats"),
    ],
)
def test_moves_grow_until_two_searches_agree(log_posteriors, moves, best, how, monkeypatch):
    found, made = scripted(monkeypatch, log_posteriors)
    expected = [(each, seed) for each in moves for seed in (7, 8)]
    assert [(each.options["moves"], each.seed) for each in made] == expected
    recipe = found.recipe
    assert (recipe.options["moves"], recipe.seed) == best
    assert found.tracks.info["log_posterior"] == max(log_posteriors)
    assert found.tracks.recipe == recipe
    assert recipe.reason.startswith("many rivals; two searches")
    assert recipe.reason.endswith(how)
    assert not recipe.retry


def test_searches_of_more_detections_may_differ_by_more(monkeypatch):
    found, made = scripted(monkeypatch, [10.0, 13.0], n_frames=400)
    assert len(made) == 2
    assert found.recipe.reason.endswith("agree within 3.0 nats")


def test_a_crowded_capture_is_searched_until_searches_agree_and_its_recipe_repeats_it():
    truth = crowded()
    plan = am.tracking.plan_tracking(truth.detections)
    assert (plan.recipe.method, plan.recipe.retry) == ("mcmcda", True)
    reported = []
    found = am.track(truth.detections, progress=reported.append)
    assert "two searches" in found.recipe.reason
    assert reported == sorted(reported)
    assert reported[-1] == truth.detections.n_frames
    again = am.track(truth.detections, recipe=found.recipe)
    assert again.recipe == found.recipe
    np.testing.assert_array_equal(again.labels, found.labels)
    np.testing.assert_array_equal(again.confidence, found.confidence)


def test_few_rivals_need_one_search(monkeypatch):
    truth = am.simulate.smooth(n_markers=200, frames=50, seed=1)
    d = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=0.005, seed=1).detections
    plan = am.tracking.plan_tracking(d)
    choice = am.tracking.choose_method(d, plan.recipe.model)
    assert 0 < choice.rivals < CONFUSED
    assert (plan.recipe.method, plan.recipe.retry) == ("mcmcda", False)
    made = []
    kept = most_certain.attempt
    monkeypatch.setattr(
        most_certain,
        "attempt",
        lambda recipe, *a, **k: made.append(recipe) or kept(recipe, *a, **k),
    )
    monkeypatch.setattr(agreed, "attempt", None)
    tracks = am.track(d)
    assert made == [plan.recipe]
    assert tracks.recipe == dataclasses.replace(plan.recipe, passes=1)


def test_progress_grows_over_attempts_and_ends_with_the_last_frame():
    reported = []
    parts = Halves(80, reported.append)
    for _ in range(3):
        advance = parts.next()
        for done in (0, 40, 80):
            advance(done)
    parts.end()
    assert reported == [0, 20, 40, 40, 50, 60, 60, 65, 70, 80]
    Halves(80, None).next()(3)
