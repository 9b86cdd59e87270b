"""The method that a clip chooses: bodies, walkers, rivals, and clips without any doubt."""

from __future__ import annotations

import dataclasses
import functools
import json
import tomllib
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.simulate import Burst
from asterism.tracking.attempts.most_certain import attempt, carried_out, most_certain
from asterism.tracking.attempts.own_distances import (
    _reassigned,
    assigned_again,
    exchanged_by_spreads,
    refined_by_own_distances,
)
from asterism.tracking.attempts.uncorrected import Uncorrected
from asterism.tracking.choose import ON_BODIES, partners
from asterism.tracking.methods import options_of
from asterism.tracking.stitching.exchanged import with_markers
from tests.scenes import exchanged, steady_and_loose

MOST_CERTAIN = "asterism.tracking.attempts.most_certain"
OWN_DISTANCES = "asterism.tracking.attempts.own_distances"
DOUBTFUL = "asterism.tracking.attempts.uncorrected.DOUBTFUL"


def sensed(truth, noise=0.005, **more):
    more = {"missing": 0.1, "clutter": 0.1} | more
    return am.simulate.corrupt(truth, noise=noise, seed=1, **more)


CLIPS = {
    "bodies": (lambda: sensed(am.simulate.cube(seed=1)), "smp", True, "8 of 8 tracks have"),
    "a person in bursts": (
        lambda: am.simulate.corrupt(
            am.simulate.person(seed=1), burst=Burst(), noise=3e-4, seed=1
        ),
        "smp",
        True,
        "bodies",
    ),
    "walkers": (lambda: sensed(am.simulate.SCENES["walk"].make(seed=1)), "mcmcda", False, "random"),
    "independent and sparse": (
        lambda: sensed(am.simulate.SCENES["wander"].make(seed=1)), "gnn", False, "rival"
    ),
    "independent and dense": (
        lambda: sensed(am.simulate.smooth(n_markers=200, frames=50, seed=1)),
        "mcmcda",
        False,
        "rival detections in the gates",
    ),
}  # fmt: skip


@functools.cache
def clip(name):
    truth = CLIPS[name][0]()
    return truth, am.estimate_model(truth.detections).model


@pytest.mark.parametrize("name", CLIPS)
def test_the_method_is_chosen_by_the_capture_with_a_reason(name):
    _, method, stitch, why = CLIPS[name]
    truth, model = clip(name)
    choice = am.tracking.choose_method(truth.detections, model)
    assert (choice.method.name, choice.stitch) == (method, stitch)
    assert why in choice.reason
    assert "\n" not in choice.reason
    assert choice == am.tracking.choose_method(truth.detections, model)


@pytest.mark.parametrize("stitch", [True, np.True_, 1])
@pytest.mark.parametrize("name", ["bodies", "independent and dense"])
def test_requested_stitching_decides_without_a_measurement(name, stitch, monkeypatch):
    truth, model = clip(name)
    monkeypatch.setattr("asterism.tracking.plan.choose_method", None)
    recipe = am.tracking.plan_tracking(truth.detections, model=model, stitch=stitch).recipe
    assert (recipe.method, recipe.stitch, recipe.retry) == ("smp", True, True)
    assert (type(recipe.stitch), recipe.reason) == (bool, "stitching is requested")


def test_no_method_is_the_one_that_was_chosen():
    truth, model = clip("bodies")
    tracks = am.track(truth.detections, model=model, seed=1)
    assert tracks.recipe.reason == am.tracking.choose_method(truth.detections, model).reason
    stitched = am.track(truth.detections, am.SMP(window=3), model=model, seed=1, stitch=True)
    np.testing.assert_array_equal(tracks.labels, stitched.labels)
    assert "log_posterior" not in tracks.info  # the model knows no gap so long
    walkers, model = clip("walkers")
    tracks = am.track(walkers.detections, model=model, seed=1)
    named = am.track(walkers.detections, am.MCMCDA(), model=model, seed=1)
    np.testing.assert_array_equal(tracks.labels, named.labels)
    assert tracks.info["log_posterior"] == named.info["log_posterior"]
    assert named.recipe.chosen == ""


@pytest.fixture(scope="module")
def fast():
    """A walk at a quarter of the rate, in which SMP exchanges markers, and its tracks."""
    walk = am.simulate.person(activity="walk", frames=300, seed=12)
    truth = am.simulate.corrupt(walk, missing=0.1, clutter=0.1, noise=3e-4, stride=4, seed=12)
    return truth, am.track(truth.detections)


def test_where_identities_are_uncertain_the_more_certain_result_is_kept(fast):
    truth, tracks = fast
    d, recipe = truth.detections, tracks.recipe
    assert (recipe.method, recipe.retry) == ("tomht", True)
    alone = {
        method.name: attempt(
            am.tracking.plan_tracking(d, method, model=recipe.model, seed=0, stitch=True).recipe, d
        )
        for method in (am.SMP(window=3), am.TOMHT())
    }
    shares = {name: 100 * each.expected_right / d.n_points for name, each in alone.items()}
    assert shares["smp"] < shares["tomht"]
    for name, share in shares.items():
        assert f"{share:.1f} %" in recipe.reason, name
    idf1 = {name: am.evaluate(each.tracks, truth).idf1 for name, each in alone.items()}
    assert idf1["smp"] < idf1["tomht"] - 0.001
    assert idf1["smp"] < am.evaluate(tracks, truth).idf1 - 0.002


def test_a_recipe_repeats_what_was_kept(fast):
    truth, tracks = fast
    again = am.track(truth.detections, recipe=tracks.recipe)
    assert again.recipe == tracks.recipe
    np.testing.assert_array_equal(again.labels, tracks.labels)
    np.testing.assert_array_equal(again.identity_confidence, tracks.identity_confidence)
    plan = am.tracking.plan_tracking(truth.detections)
    assert am.model.Recipe.from_dict(plan.recipe.to_dict()) == plan.recipe
    planned = am.track(truth.detections, recipe=plan.recipe)
    assert planned.recipe == tracks.recipe
    np.testing.assert_array_equal(planned.labels, tracks.labels)


def test_parts_that_moved_by_their_own_distances_are_joins():
    run = am.simulate.person(activity="run", frames=200, seed=13)
    truth = am.simulate.corrupt(run, missing=0.1, clutter=0.1, noise=3e-4, stride=3, seed=13)
    tracks = am.track(truth.detections)
    assert tracks.info["refinements"] > 0
    before = attempt(tracks.recipe, truth.detections).tracks
    order, offsets = before.by_track
    then = np.split(tracks.labels[order], offsets[1:-1])
    main = np.array([np.bincount(own[own >= 0]).argmax() for own in then])
    moved = order[main[before.labels[order]] != tracks.labels[order]]
    assert len(moved) > 5
    joins = {(each.track, each.last) for each in tracks.decisions if each.kind == "join"}
    assert len(joins) == tracks.info["joins"]
    for k in np.unique(tracks.labels[moved]):
        own = np.flatnonzero(tracks.labels == k)
        begins = own[1:][np.diff(np.isin(own, moved).astype(int)) != 0]
        assert {(k, each) for each in truth.detections.frame_of[begins]} <= joins


def test_detections_of_a_doubtful_result_are_assigned_again(monkeypatch):
    run = am.simulate.person(activity="run", frames=150, seed=12)
    truth = am.simulate.corrupt(run, missing=0.1, clutter=0.1, noise=3e-4, stride=3, seed=12)
    made = []
    name = f"{OWN_DISTANCES}._reassigned"
    monkeypatch.setattr(name, lambda found: made.append(found) or found)
    am.track(truth.detections)
    monkeypatch.undo()
    before = made[0]
    after = _reassigned(before)
    assert after.expected_right > before.expected_right
    assert am.evaluate(after.tracks, truth).idf1 > am.evaluate(before.tracks, truth).idf1 + 0.005
    assert after.tracks.info["refinements"] > before.tracks.info.get("refinements", 0)
    alone = dataclasses.replace(before, recipe=dataclasses.replace(before.recipe, options={}))
    np.testing.assert_array_equal(_reassigned(alone).tracks.labels, after.tracks.labels)


def test_ghosts_beside_the_markers_of_a_cube_are_left_alone(monkeypatch):
    made, name = [], f"{OWN_DISTANCES}._reassigned"
    monkeypatch.setattr(name, lambda found: made.append(found) or found)
    truths, firsts = [], []
    for seed in (51, 53, 54):
        cube = am.simulate.cube(frames=400, seed=seed)
        truths.append(
            am.simulate.corrupt(
                cube, burst=am.simulate.Burst(), ghosts=am.simulate.Ghosts(), noise=3e-4, seed=seed
            )
        )
        made.clear()
        am.track(truths[-1].detections)
        firsts.append(made[0])
    monkeypatch.undo()
    assert all(before.is_doubtful for before in firsts)
    for before, truth in zip(firsts, truths, strict=True):
        after = am.evaluate(_reassigned(before).tracks, truth).idf1
        assert after > am.evaluate(before.tracks, truth).idf1 - 0.001


def test_bonds_track_fast_motion_at_a_low_rate():
    run = am.simulate.person(activity="run", frames=600, seed=11)
    truth = am.simulate.corrupt(run, missing=0.1, clutter=0.1, noise=3e-4, stride=2, seed=11)
    tracks = am.track(truth.detections)
    assert (tracks.recipe.method, "rigid" in str(tracks.recipe.options)) == ("tomht", True)
    motion = am.estimate_model(truth.detections).model.motion
    assert tracks.recipe.model.motion.models[-1].acceleration_sigma > 2 * max(
        each.acceleration_sigma for each in getattr(motion, "models", (motion,))
    )
    assert am.evaluate(tracks, truth).idf1 > 0.99
    alone = am.track(truth.detections, am.TOMHT(), stitch=True)
    assert am.evaluate(alone, truth).idf1 < 0.95
    again = am.tracking.carry_out(tracks.recipe, truth.detections).tracks
    assert np.array_equal(again.labels, tracks.labels)


@pytest.mark.parametrize("stride", [4, 6])
def test_bodies_are_seen_where_markers_move_beyond_their_neighbours(stride):
    run = am.simulate.person(activity="run", frames=600, seed=13)
    truth = am.simulate.corrupt(run, missing=0.1, clutter=0.1, noise=3e-4, stride=stride, seed=13)
    model = am.estimate_model(truth.detections).model
    alone = am.track(truth.detections, am.GNN(), model=model)
    n_rigid, n_compared = partners(alone, model.sensor.noise_sigma)
    choice = am.tracking.choose_method(truth.detections, model)
    assert (choice.method.name, choice.stitch) == ("smp", True)
    is_seen_alone = n_rigid >= ON_BODIES * n_compared
    assert ("rigid" in str(choice.method)) != is_seen_alone
    assert not (stride == 6 and is_seen_alone)


def test_bonds_find_no_bodies_among_independent_markers(monkeypatch):
    monkeypatch.setattr("asterism.tracking.choose.CONFUSED", 0.0)
    truth, model = clip("independent and dense")
    choice = am.tracking.choose_method(truth.detections, model)
    assert (choice.method.name, choice.stitch) == ("mcmcda", False)


class Planned(Uncorrected):
    """Tracks of which a share is expected to be right that depends on the method alone."""

    shares: ClassVar[dict[str, float]] = {}

    @property
    def expected_right(self):
        way = "bonds" if self.recipe.options.get("rigid") else self.recipe.method
        way = "still" if self.recipe.common_motion else way
        return self.shares[way] * len(self.tracks.labels)


class InTurn(Uncorrected):
    """Tracks of which a share is expected to be right that is theirs."""

    @property
    def expected_right(self):
        return self.tracks.info["share"] * len(self.tracks.labels)


@pytest.mark.parametrize(("gain", "is_kept"), [(0.001, False), (0.003, True)])
def test_bonds_must_make_identities_more_certain_by_a_margin(gain, is_kept, monkeypatch):
    walk = am.simulate.person(activity="walk", frames=60, seed=1)
    plan = am.tracking.plan_tracking(walk.detections)
    monkeypatch.setattr(Planned, "shares", {"smp": 0.8, "tomht": 0.7, "bonds": 0.8 + gain})

    def planned(recipe, *_, **__):
        return Planned(tracks=walk, recipe=recipe, model=recipe.model)

    monkeypatch.setattr(f"{MOST_CERTAIN}.attempt", planned)
    monkeypatch.setattr(f"{MOST_CERTAIN}.next_pass", lambda found, _: found)
    monkeypatch.setattr(f"{MOST_CERTAIN}.refined_by_own_distances", lambda found: found)
    best = most_certain(plan.recipe, walk.detections)
    assert (best.recipe.method == "tomht", best.has_bonds) == (is_kept, is_kept)


def test_a_method_with_bonds_needs_no_attempt_without_them(monkeypatch):
    walk = am.simulate.person(activity="walk", frames=60, seed=1)
    recipe = am.tracking.plan_tracking(walk.detections).recipe
    recipe = dataclasses.replace(recipe, options={**recipe.options, "rigid": {}})
    monkeypatch.setattr(Planned, "shares", {"smp": 0.8, "tomht": 0.9, "bonds": 0.9})
    made = []

    def planned(recipe, *_, **__):
        made.append((recipe.method, recipe.options.get("rigid") is not None))
        return Planned(tracks=walk, recipe=recipe, model=recipe.model)

    monkeypatch.setattr(f"{MOST_CERTAIN}.attempt", planned)
    monkeypatch.setattr(f"{MOST_CERTAIN}.next_pass", lambda found, _: found)
    monkeypatch.setattr(f"{MOST_CERTAIN}.refined_by_own_distances", lambda found: found)
    most_certain(recipe, walk.detections)
    assert made == [("smp", True), ("tomht", True), ("tomht", True)]  # two motions
    made.clear()
    most_certain(dataclasses.replace(recipe, passes=2), walk.detections)
    assert made == [("smp", True)]


@pytest.mark.parametrize(("has_bonds", "kept"), [(True, 0.9), (False, 0.7)])
def test_labels_change_until_identities_are_no_more_certain_where_bonds_hold(
    has_bonds, kept, monkeypatch
):
    walk = am.simulate.person(activity="walk", frames=60, seed=1)
    recipe = am.tracking.plan_tracking(walk.detections).recipe
    recipe = dataclasses.replace(recipe, options={"rigid": {}} if has_bonds else {})
    shares = iter([0.7, 0.8, 0.9, 0.85])

    def assigned(found):
        tracks = dataclasses.replace(walk, info={"share": next(shares)})
        return dataclasses.replace(found, tracks=tracks)

    monkeypatch.setattr(f"{OWN_DISTANCES}._reassigned", assigned)
    for name in ("exchanged_by_spreads", "_with_lost_markers"):
        monkeypatch.setattr(f"{OWN_DISTANCES}.{name}", lambda found: found)
    tracks = dataclasses.replace(walk, info={"share": 0.75})
    found = InTurn(tracks=tracks, recipe=recipe, model=recipe.model)
    assert assigned_again(found).tracks.info["share"] == kept


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        # Each list: first, bonds and then either TOMHT alone or bonds with the other motion.
        ([0.8, 0.8, 0.9], [False, True, False]),
        ([0.8, 0.9, 0.85], [False, True, True]),
        ([0.8, 0.9, 0.95], [False, True, True]),
    ],
)
def test_tomht_alone_or_the_other_motion_is_the_third_attempt(shares, expected, monkeypatch):
    walk = am.simulate.person(activity="walk", frames=60, seed=1)
    recipe = am.tracking.plan_tracking(walk.detections).recipe
    made = []

    def planned(recipe, *_, **__):
        tracks = dataclasses.replace(walk, info={"share": shares[len(made)]})
        made.append(recipe.options.get("rigid") is not None)
        return InTurn(tracks=tracks, recipe=recipe, model=recipe.model)

    monkeypatch.setattr(f"{MOST_CERTAIN}.attempt", planned)
    monkeypatch.setattr(f"{MOST_CERTAIN}.next_pass", lambda found, _: found)
    monkeypatch.setattr(f"{MOST_CERTAIN}.refined_by_own_distances", lambda found: found)
    best = most_certain(recipe, walk.detections)
    assert made == expected
    assert best.tracks.info["share"] == max(shares)


def test_the_progress_of_both_methods_is_one(fast):
    truth, _ = fast
    n, done = truth.detections.n_frames, []
    am.track(truth.detections, progress=done.append)
    assert done == sorted(done)
    assert (n // 2 in done, done[-1]) == (True, n)


def test_certain_identities_need_no_further_attempt(monkeypatch):
    truth, model = clip("bodies")

    def never(*_, **__):
        raise AssertionError("a further attempt")

    monkeypatch.setattr("asterism.tracking.methods.tomht.TOMHT._tracker", never)
    monkeypatch.setattr(f"{OWN_DISTANCES}.learn_marker_set", never)
    tracks = am.track(truth.detections, model=model)
    assert (tracks.recipe.method, "refinements" in tracks.info) == ("smp", False)


@pytest.mark.parametrize(("seed", "marker"), [(12, 3), (12, 30), (13, 10)])
def test_own_distances_undo_exchanges_of_three_markers(seed, marker):
    # Exchanges of three markers in turn, of which no pair of tracks can be exchanged back.
    walk = am.simulate.person(activity="walk", frames=300, seed=seed)
    labels, frame = walk.labels.copy(), walk.detections.frame_of
    places = walk.positions()[100]
    near = np.argsort(np.linalg.norm(places - places[marker], axis=1))[:3]
    inside = (frame >= 100) & (frame < 160)
    for old, new in zip(near, np.roll(near, 1), strict=True):
        labels[inside & (walk.labels == old)] = new
    turned = am.Tracks(detections=walk.detections, labels=labels)
    plan = am.tracking.plan_tracking(walk.detections)
    found = Uncorrected(tracks=turned, recipe=plan.recipe, model=plan.recipe.model)
    assert am.evaluate(turned, walk).idf1 < 0.99
    assert found.expected_right / len(labels) == pytest.approx(0.989, abs=0.003)
    refined = refined_by_own_distances(found)
    assert am.evaluate(refined.tracks, walk).idf1 == 1
    assert refined.expected_right > found.expected_right
    assert not any(refined.tracks.names)


def test_names_that_make_identities_less_certain_are_not_kept(fast, monkeypatch):
    truth, tracks = fast
    plan = am.tracking.plan_tracking(truth.detections)
    model = am.tracking.tracklet_model(plan.recipe.model)
    tracks = am.Tracks(detections=truth.detections, labels=tracks.labels)
    found = Uncorrected(tracks=tracks, recipe=plan.recipe, model=model)

    def exchanged(given, _):
        """Give two tracks of one segment each other's marker for half of the capture."""
        labels, late = given.labels.copy(), truth.detections.frame_of >= 37
        labels[late & (given.labels == 0)], labels[late & (given.labels == 1)] = 1, 0
        return SimpleNamespace(tracks=dataclasses.replace(given, labels=labels))

    monkeypatch.setattr(f"{OWN_DISTANCES}.name_tracks", exchanged)
    assert found.is_doubtful
    assert refined_by_own_distances(found) is found


@pytest.mark.parametrize("is_doubtful", [True, False])
def test_tracks_in_doubt_are_exchanged_back_by_the_spreads_of_distances(is_doubtful, monkeypatch):
    monkeypatch.setattr(DOUBTFUL, -1.0 if is_doubtful else 1.0)
    truth = steady_and_loose(seed=1)
    recipe = am.tracking.plan_tracking(truth.detections).recipe
    model = am.tracking.tracklet_model(recipe.model)
    right = am.stitch(truth, model)
    pair = [int(right.tracks.labels[truth.labels == k][0]) for k in (5, 6)]
    wrong = exchanged(right.tracks, pair, range(105, 305))
    stitching = with_markers(right, wrong.labels, np.full(len(wrong.labels), 0.95))
    found = Uncorrected(tracks=wrong, recipe=recipe, model=model, stitching=stitching)
    assert am.evaluate(wrong, truth).idf1 < 0.98
    after = exchanged_by_spreads(found)
    assert (after is not found) == is_doubtful
    if is_doubtful:
        assert am.evaluate(after.tracks, truth).idf1 == 1
        assert after.stitching.tracks is after.tracks
        assert len(after.stitching.joins) == 4  # at both ends, of both tracks


@pytest.mark.parametrize("kept", [3, 0])
def test_too_few_tracks_are_not_named_by_their_own_distances(kept, monkeypatch):
    monkeypatch.setattr(DOUBTFUL, -1.0)
    walk = am.simulate.person(activity="walk", frames=60, seed=1)
    few = am.Tracks(
        detections=walk.detections, labels=np.where(walk.labels < kept, walk.labels, -1)
    )
    plan = am.tracking.plan_tracking(walk.detections)
    found = Uncorrected(tracks=few, recipe=plan.recipe, model=plan.recipe.model)
    assert refined_by_own_distances(found) is found


def test_tracks_to_begin_with_are_for_mcmcda():
    truth = CLIPS["bodies"][0]()
    tracks = am.track(truth.detections, start=truth, seed=1)
    assert tracks.recipe.chosen.startswith("mcmcda: initial tracks are given")
    assert am.evaluate(tracks, truth).idf1 > 0.99


def test_partners_are_counted_by_distances_alone():
    rng = np.random.default_rng(1)
    t = np.linspace(0, 1, 60)[:, None]
    one = np.concatenate([np.sin(5 * t), np.cos(3 * t), t], axis=1)
    other = one + np.array([0.1, 0, 0])
    free = np.cumsum(rng.normal(0, 0.1, (60, 3)), axis=0)
    brief = np.where(
        t > 0.8, one + np.array([0, 0.1, 0]), np.nan
    )  # seen in too few frames to be compared
    dense = np.stack([one, other, free, brief], axis=1)
    times = np.arange(60) / 100
    assert partners(am.Tracks.from_dense(times, dense), 1e-4) == (2, 3)
    # Noise must not part a body: a distance can be no steadier than its ends.
    little = np.stack([0.01 * one, 0.01 * one + 0.1], axis=1)
    noisy = little + rng.normal(0, 0.002, (60, 2, 3))
    assert partners(am.Tracks.from_dense(times, noisy), 0.002) == (2, 2)
    assert partners(am.Tracks.from_dense(times, noisy), 1e-5) == (0, 2)


def test_many_markers_in_a_short_capture_are_no_segments():
    # Of some ten thousand pairs, over a second, many keep their distance by chance.
    moving = am.simulate.smooth(n_markers=200, frames=24, seed=1)
    truth = am.simulate.corrupt(moving, missing=0.1, clutter=0.1, noise=0.005, seed=1)
    d = truth.detections
    assert not am.tracking.choose_method(d, am.estimate_model(d).model).stitch


@pytest.mark.parametrize("frames", [20, 80])
def test_the_first_detections_of_tracks_hide_no_rivals(frames):
    # They are in no gate; in a short clip they are a good part of all.
    truth = sensed(am.simulate.smooth(n_markers=200, frames=frames, seed=2))
    d = truth.detections
    choice = am.tracking.choose_method(d, am.estimate_model(d).model)
    assert choice.method.name == "mcmcda"
    assert 2 < float(choice.reason.split()[0]) < 5


def test_captures_of_nothing_and_of_one_point():
    model = am.estimate_model(am.simulate.cube(seed=1).detections).model
    for frames in ([np.empty((0, 3))] * 3, [np.zeros((1, 3))] * 3):
        d = am.Detections.from_frames(np.arange(3.0), frames)
        choice = am.tracking.choose_method(d, model)
        assert (choice.method.name, choice.stitch) == ("gnn", False)
    flat = np.random.default_rng(1).normal(size=(4, 2)) + np.arange(30)[:, None, None] * 0.01
    d = am.Tracks.from_dense(np.arange(30) / 100, flat).detections
    assert (
        am.tracking.choose_method(d, am.estimate_model(d).model).method.name in am.tracking.METHODS
    )
    with pytest.raises(am.ParameterError, match="detections"):
        am.tracking.choose_method(flat, model)
    with pytest.raises(am.ParameterError, match="TrackingModel"):
        am.tracking.choose_method(d, None)


@pytest.fixture
def person(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    truth = am.simulate.corrupt(
        am.simulate.person(seed=1, frames=150), burst=Burst(), noise=3e-4, seed=1
    )
    am.write(am.Tracks(detections=truth.detections, labels=np.full(len(truth.labels), -1)), "p.csv")
    return tmp_path


def test_the_files_of_a_run_name_the_method_that_was_kept(tmp_path, monkeypatch, capsys, fast):
    monkeypatch.chdir(tmp_path)
    truth, _ = fast
    am.write(am.Tracks(detections=truth.detections, labels=np.full(len(truth.labels), -1)), "p.csv")
    assert main(["track", "p.csv", "--run", "run", "--report", "p.html"]) == 0
    out = capsys.readouterr().out
    assert "Tracked with tomht" in out
    job = tomllib.loads((tmp_path / "run/run.toml").read_text())
    assert job["method"]["name"] == "tomht"
    assert json.loads((tmp_path / "run/summary.json").read_text())["method"] == "tomht"
    assert "Tracked with tomht" in (tmp_path / "p.html").read_text()
    capsys.readouterr()
    assert main(["track", "--from", "run/run.toml", "--run", "again", "--out", "q.csv"]) == 0
    assert (tmp_path / "run/run.toml").read_bytes() == (tmp_path / "again/run.toml").read_bytes()


def test_the_command_line_says_why_and_a_repeat_does_not_choose_again(person, capsys, monkeypatch):
    assert main(["track", "p.csv", "--run", "first"]) == 0
    out = capsys.readouterr().out
    assert "smp, window=3, then stitched:" in out
    assert "have a stable distance" in out
    job = tomllib.loads((person / "first/run.toml").read_text())
    assert job["method"]["name"] == "smp"
    assert job["method"]["options"]["window"] == 3
    assert job["method"]["stitch"] is True
    assert "bodies" in job["method"]["reason"]
    assert job["model"]["population"]["max_gap"] > 4  # of the capture; tracklets have their own
    assert "bodies" in (person / "first/log.txt").read_text()

    def never(*_, **__):
        raise AssertionError("a repeat chose again")

    monkeypatch.setattr("asterism.tracking.plan.choose_method", never)
    assert main(["track", "--from", "first/run.toml", "--run", "second"]) == 0
    for name in ("run.toml", "p.tracked.csv"):
        assert (person / "first" / name).read_bytes() == (person / "second" / name).read_bytes()


def test_json_holds_the_choice_and_auto_may_be_named(person, capsys):
    assert main(["track", "p.csv", "-o", "a.csv", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert "bodies" in report["chosen"]
    assert (report["method"], report["stitch"]) == ("smp", True)
    assert main(["track", "p.csv", "-o", "b.csv", "--method", "auto", "-q"]) == 0
    assert (person / "a.csv").read_bytes() == (person / "b.csv").read_bytes()
    assert main(["track", "p.csv", "-o", "c.csv", "--method", "gnn", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert "chosen" not in report
    assert (report["method"], report["stitch"]) == ("gnn", False)


@pytest.fixture
def walk_planned(monkeypatch):
    """A walk, its recipe, and the methods of its attempts, which return `Planned` tracks."""
    walk, made = am.simulate.person(activity="walk", frames=60, seed=1), []

    def planned(recipe, *_, **__):
        made.append("bonds" if recipe.options.get("rigid") else recipe.method)
        return Planned(tracks=walk, recipe=recipe, model=recipe.model)

    monkeypatch.setattr(f"{MOST_CERTAIN}.attempt", planned)
    monkeypatch.setattr(f"{MOST_CERTAIN}.refined_by_own_distances", lambda found: found)
    monkeypatch.setattr(f"{MOST_CERTAIN}.assigned_again", lambda found: found)
    monkeypatch.setattr(f"{MOST_CERTAIN}.choice_without_common_motion", lambda *_: None)
    shares = {"smp": 0.7, "tomht": 0.8, "bonds": 0.7, "gnn": 0.1}
    monkeypatch.setattr(Planned, "shares", shares)
    return walk, am.tracking.plan_tracking(walk.detections).recipe, made


@pytest.mark.parametrize(
    ("gain", "has_bodies", "is_kept"),
    [(0.001, True, False), (0.003, True, True), (0.003, False, False)],
)
def test_the_motion_in_common_is_removed_from_bodies_that_are_more_certain_without_it(
    gain, has_bodies, is_kept, walk_planned, monkeypatch
):
    walk, recipe, _ = walk_planned
    monkeypatch.setitem(Planned.shares, "still", 0.8 + gain)
    choice = am.tracking.choose_method(walk.detections, recipe.model)
    noisy = am.simulate.corrupt(walk, noise=2e-3, seed=1)
    estimate = am.estimate_model(noisy.detections)
    choice = dataclasses.replace(
        choice, estimate=estimate, common_motion=True, stitch=has_bodies, reason="without it"
    )
    monkeypatch.setattr(f"{MOST_CERTAIN}.choice_without_common_motion", lambda *_: choice)
    best = most_certain(recipe, walk.detections)
    assert best.recipe.common_motion == is_kept
    assert best.recipe.reason.startswith("without it; 80.3 %") == is_kept
    assert (best.estimate is estimate) == (best.recipe.model == estimate.model) == is_kept
    assert (best.still is not None) == is_kept


def test_a_recipe_of_a_further_attempt_is_attempted_once(walk_planned):
    walk, recipe, made = walk_planned
    assert recipe.retry
    kept = dataclasses.replace(recipe, method="gnn", options=options_of(am.GNN()))
    assert carried_out(kept, walk.detections).recipe.method == "gnn"
    assert made == ["gnn"]
