"""The motion that most markers have in common: what is removed, and tracks without it."""

from __future__ import annotations

import re

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.edit.session import Session
from asterism.errors import ParameterError
from asterism.tracking.estimation.common_motion import MIN_PAIRS
from asterism.tracking.motion_in_common import choice_without_common_motion
from tests.reporting.cases import text_of


def moved(shape, n_frames, *, seed=1, step=0.02, turn=0.05):
    """Positions (T, K, D) of a rigid shape (K, D) that moves and turns smoothly."""
    rng = np.random.default_rng(seed)
    D = shape.shape[1]
    t = np.arange(n_frames)[:, None]
    at = 10 * step * np.sin(0.1 * t + rng.uniform(0, 6, D))
    angle = 10 * turn * np.sin(0.1 * t[:, 0])
    R = np.zeros((n_frames, D, D))
    R[:] = np.eye(D)
    R[:, 0, 0] = R[:, 1, 1] = np.cos(angle)
    R[:, 1, 0], R[:, 0, 1] = np.sin(angle), -np.sin(angle)
    return np.einsum("tij,kj->tki", R, shape) + at[:, None]


def truth_of(positions, **corruption):
    times = np.arange(len(positions)) / 100
    return am.simulate.corrupt(am.Tracks.from_dense(times, positions), seed=1, **corruption)


def skin(seed=1, n_frames=250, size=0.12):
    """Markers that move together by more than their distances, and keep none of these."""
    rng = np.random.default_rng(seed)
    grid = 0.025 * np.stack(np.meshgrid(range(5), range(4), 0), axis=-1).reshape(-1, 3)
    rest = grid[:19] + rng.uniform(-0.005, 0.005, (19, 3))
    t = np.arange(n_frames)[:, None, None] / 100
    own = 0.006 * np.sin(2 * np.pi * (rng.uniform(1, 2, (19, 3)) * t + rng.uniform(size=(19, 3))))
    common = size * np.sin(2 * np.pi * (rng.uniform(1, 2, 3) * t + rng.uniform(size=3)))
    return truth_of(rest + own + common, missing=0.05, clutter=0.05, noise=3e-3)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_a_rigid_cloud_is_at_rest_and_keeps_its_distances(n_axes):
    rng = np.random.default_rng(n_axes)
    positions = moved(rng.uniform(-0.2, 0.2, (15, n_axes)), 200)
    truth = truth_of(positions, missing=0.2, clutter=0.2, noise=1e-3)
    d, still = truth.detections, am.tracking.without_common_motion(truth.detections)
    assert np.array_equal(still.offsets, d.offsets)
    for t in range(0, d.n_frames, 17):
        own = slice(d.offsets[t], d.offsets[t + 1])
        before, after = d.points[own], still.points[own]
        np.testing.assert_allclose(
            np.linalg.norm(after[:, None] - after, axis=2),
            np.linalg.norm(before[:, None] - before, axis=2),
            atol=1e-12,
        )
    for k in range(15):
        own = truth.labels == k
        assert d.points[own].std(axis=0).max() > 0.05
        assert still.points[own].std(axis=0).max() < 4e-3


def test_a_flat_cloud_is_never_mirrored():
    rng = np.random.default_rng(7)
    shape = rng.uniform(-0.2, 0.2, (8, 3)) * [1, 1, 0]
    truth = truth_of(moved(shape, 100), noise=1e-3)
    d, still = truth.detections, am.tracking.without_common_motion(truth.detections)
    for t in range(d.n_frames):
        before, after = (
            np.linalg.det(
                each.points[d.offsets[t] + 1 : d.offsets[t] + 4] - each.points[d.offsets[t]]
            )
            for each in (d, still)
        )
        assert after == pytest.approx(before, abs=1e-12)


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_turn_goes_on_for_as_long_as_a_frame_takes(n_axes, seed):
    rng = np.random.default_rng(seed)
    angle = 0.2 * np.minimum(np.arange(200) / 40, 1).cumsum()
    R = np.tile(np.eye(n_axes), (200, 1, 1))
    R[:, 0, 0] = R[:, 1, 1] = np.cos(angle)
    R[:, 1, 0], R[:, 0, 1] = np.sin(angle), -np.sin(angle)
    positions = np.einsum("tij,kj->tki", R, rng.uniform(-0.2, 0.2, (15, n_axes)))
    kept = np.flatnonzero((rng.random(200) < 0.6) | (np.arange(200) < 45))
    truth = am.Tracks.from_dense(kept / 100, positions[kept])
    truth = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=1e-3, seed=1)
    still = am.tracking.without_common_motion(truth.detections)
    for k in range(15):
        assert still.points[truth.labels == k].std(axis=0).max() < 2e-3


def test_turns_do_not_grow_by_rounding_over_thousands_of_frames():
    rng = np.random.default_rng(3)
    positions = moved(rng.uniform(-0.2, 0.2, (8, 3)), 4000)
    still = am.tracking.without_common_motion(truth_of(positions, noise=1e-3).detections)
    assert np.linalg.norm(still.points, axis=1).max() < 0.5


def test_the_largest_group_is_at_rest_where_others_move_otherwise():
    rng = np.random.default_rng(4)
    body = moved(rng.uniform(-0.2, 0.2, (14, 3)), 150)
    other = moved(rng.uniform(-0.2, 0.2, (4, 3)), 150, seed=9, turn=0.1) + 0.8
    truth = truth_of(np.concatenate([body, other], axis=1), noise=1e-3)
    still = am.tracking.without_common_motion(truth.detections)
    paths = [still.points[truth.labels == k] for k in range(18)]
    steps = [np.median(np.linalg.norm(np.diff(path, axis=0), axis=1)) for path in paths]
    assert max(steps[:14]) < 0.004 < 0.008 < min(steps[14:])


def test_too_few_points_stay_where_they_are_relative_to_the_first_frame():
    rng = np.random.default_rng(5)
    positions = moved(rng.uniform(-0.2, 0.2, (MIN_PAIRS - 1, 3)), 20)
    d = truth_of(positions).detections
    still = am.tracking.without_common_motion(d)
    np.testing.assert_allclose(
        still.points, d.points - np.median(d.points[: MIN_PAIRS - 1], axis=0)
    )


def test_frames_with_few_points_change_nothing():
    rng = np.random.default_rng(8)
    positions = moved(rng.uniform(-0.2, 0.2, (5, 3)), 200, step=0.05, turn=0.0)
    for t, n in ((50, 3), (90, 0), (130, 1), (170, 2)):
        positions[t, n:] = np.nan
    truth = truth_of(positions)
    still = am.tracking.without_common_motion(truth.detections)
    for k in range(5):
        assert np.ptp(still.points[truth.labels == k], axis=0).max() < 0.02


def test_a_motion_ends_where_it_cannot_be_fitted_for_long():
    rng = np.random.default_rng(9)
    positions = moved(rng.uniform(-0.2, 0.2, (10, 3)), 600, turn=0.3)
    positions[20:500, 3:] = np.nan  # three markers are too few
    positions[100:300] = np.nan
    truth = truth_of(positions, noise=1e-3)
    still = am.tracking.without_common_motion(truth.detections)
    assert np.abs(still.points).max() < 2.0
    for k in range(10):
        for some in ((truth.detections.frame_of < 20), (truth.detections.frame_of >= 500)):
            own = (truth.labels == k) & some
            assert np.ptp(still.points[own], axis=0).max() < 0.02


def test_empty_frames_and_a_cloud_that_jumps_are_a_new_beginning():
    rng = np.random.default_rng(6)
    positions = moved(rng.uniform(-0.2, 0.2, (10, 3)), 60)
    positions[:5] = np.nan
    positions[20:24] = np.nan
    positions[40:] += 500.0
    truth = truth_of(positions)
    still = am.tracking.without_common_motion(truth.detections)
    assert np.isfinite(still.points).all()
    for k in range(10):  # also across the jump, which no velocity expects
        assert np.ptp(still.points[truth.labels == k], axis=0).max() < 0.05
    nothing = am.Detections.from_frames([0.0, 0.1], [[], []])
    assert am.tracking.without_common_motion(nothing).n_points == 0


def test_markers_that_cannot_be_followed_as_they_are_are_tracked_without_it():
    truth = skin(size=0.25)
    with pytest.raises(ParameterError, match="followed"):
        am.estimate_model(truth.detections)
    found = am.track(truth.detections)
    assert found.recipe.common_motion
    assert am.evaluate(found, truth).idf1 > 0.9
    assert found.recipe.reason.startswith("without the motion that most markers have in common")
    for given in ({"method": "gnn"}, {"start": truth}):
        with pytest.raises(ParameterError, match="followed"):
            am.tracking.plan_tracking(truth.detections, **given)


def test_gaps_and_states_need_no_model_that_cannot_be_estimated(tmp_path):
    truth = skin(size=0.25)
    found = am.track(truth.detections, fill=True)
    filled = found.detections.filled
    assert filled.sum() > 20
    assert np.linalg.norm(found.detections.stds[filled], axis=-1).max() < 0.1
    low, high = truth.detections.points.min(axis=0), truth.detections.points.max(axis=0)
    points = found.detections.points[filled]
    assert ((points > low - 0.02) & (points < high + 0.02)).all()
    assert am.tracking.track_states(found.measured()).at(100).positions.shape == (19, 3)
    session = Session.open(truth.detections, tmp_path / "edits.csv")
    gap = session.tracks.gaps()[0]
    positions, _ = session.fill_preview(session.fill(gap.track, gap.first, gap.last))
    assert np.isfinite(positions).all()


@pytest.mark.parametrize("n_frames", [4, 12, 19])
def test_short_captures_can_be_tracked(n_frames):
    person = am.simulate.person(frames=n_frames, seed=1)
    d = am.simulate.corrupt(person, missing=0.2, clutter=0.2, noise=3e-3, seed=1).detections
    model = am.estimate_model(person.detections).model
    assert len(am.track(d, model=model, stitch=True).labels) == d.n_points
    assert len(am.track(d, model=model).labels) == d.n_points


def test_requested_stitching_is_the_reason_for_the_method():
    recipe = am.tracking.plan_tracking(skin(size=0.25).detections, stitch=True).recipe
    assert (recipe.method, recipe.stitch, recipe.common_motion) == ("smp", True, True)
    assert recipe.reason.endswith("stitching is requested")


def test_few_points_at_the_beginning_have_the_same_origin():
    rng = np.random.default_rng(10)
    positions = moved(rng.uniform(-0.2, 0.2, (10, 3)), 40, turn=0.0, step=0.005)
    positions[:6, 3:] = np.nan
    truth = truth_of(positions)
    still = am.tracking.without_common_motion(truth.detections)
    for k in range(3):
        steps = np.diff(still.points[truth.labels == k], axis=0)
        assert np.linalg.norm(steps, axis=1).max() < 0.02


def test_what_is_no_capture_is_told():
    with pytest.raises(ParameterError, match="detections"):
        am.tracking.without_common_motion(3)


def test_markers_on_skin_are_tracked_without_the_motion_in_common():
    truth = skin()
    d = truth.detections
    found = am.track(d)
    assert found.recipe.common_motion
    assert "raises the log density" in found.recipe.reason
    assert found.detections is d
    model = am.estimate_model(d).model
    as_it_is = am.track(d, model=model)  # a given model holds for the capture as it is
    assert not as_it_is.recipe.common_motion
    assert am.evaluate(found, truth).idf1 > am.evaluate(as_it_is, truth).idf1 + 0.02
    assert am.evaluate(found, truth).idf1 > 0.97
    # The confidence is that of the coordinates in which they were tracked.
    taken = found.labels >= 0
    assert found.identity_confidence[taken].mean() > 0.95


def test_a_recipe_without_the_motion_in_common_repeats_the_result():
    truth = skin(seed=2)
    found = am.track(truth.detections, fill=True)
    recipe = am.model.Recipe.from_dict(found.recipe.to_dict())
    assert recipe.common_motion
    assert recipe == found.recipe
    again = am.track(truth.detections, recipe=recipe)
    assert np.array_equal(again.labels, found.labels)
    np.testing.assert_array_equal(again.detections.points, found.detections.points)


def test_gaps_are_filled_and_states_are_estimated_where_the_markers_are():
    truth = skin(seed=3)
    found = am.track(truth.detections, fill=True)
    assert found.recipe.common_motion
    d = found.detections
    assert d.filled.sum() > 20
    low, high = truth.detections.points.min(axis=0), truth.detections.points.max(axis=0)
    filled = d.points[d.filled]
    assert ((filled > low - 0.02) & (filled < high + 0.02)).all()
    states = am.tracking.track_states(found.measured())
    at = states.at(100)
    own = slice(*found.measured().detections.offsets[100:102])
    points = found.measured().detections.points[own]
    nearest = np.linalg.norm(points[:, None] - at.positions, axis=2).min(axis=1)
    assert np.median(nearest) < 5e-3


def test_edits_are_made_in_the_coordinates_of_the_capture(tmp_path):
    truth = skin(seed=2)
    d = truth.detections
    session = Session.open(d, tmp_path / "edits.csv")
    assert session.begun.recipe.common_motion
    assert session.tracks.detections is d
    # The page shows the confidence of the coordinates in which they were tracked.
    shown, whole = session.assessed(session.tracks, ()), session.result().tracks
    assert np.array_equal(shown.identity_confidence, whole.identity_confidence)
    assert shown.detections is d
    i = int(np.flatnonzero(session.tracks.labels >= 0)[40])
    edit = session.edit("clutter", i)
    session.apply(edit)
    assert session.tracks.labels[i] == -1
    result = session.result().tracks
    assert result.detections is d
    again = am.track(d, edits=session.edits)
    assert np.array_equal(again.labels, result.labels)


def hand(seed):
    """A hand with moving fingers, 3 mm of noise, that moves as a whole by 11 mm a frame."""
    fingers = am.simulate.fingers(frames=150, rate=120, seed=seed)
    rng = np.random.default_rng(seed)
    t = np.arange(150)[:, None, None] / 120
    common = 0.2 * np.sin(2 * np.pi * (rng.uniform(1, 2, 3) * t + rng.uniform(size=3)))
    take = am.Tracks.from_dense(t[:, 0, 0], fingers.positions() + common)
    return am.simulate.corrupt(take, missing=0.1, clutter=0.1, noise=3e-3, seed=seed)


def test_uncertain_bodies_are_tracked_without_it_if_that_is_more_certain():
    truth = hand(2)
    plan = am.tracking.plan_tracking(truth.detections)
    assert plan.recipe.stitch
    assert not plan.recipe.common_motion  # it has bodies
    tracked = am.tracking.carry_out(plan.recipe, truth.detections)
    found = tracked.tracks
    assert found.recipe.common_motion
    assert found.recipe.reason.startswith("without the motion that most markers have in common")
    assert "with this motion, by" in found.recipe.reason
    assert found.recipe.reason.count("are expected to have") == 1
    without = am.tracking.without_common_motion(truth.detections)
    assert tracked.estimate.model == am.estimate_model(without).model
    assert am.evaluate(found, truth).idf1 > 0.99
    again = am.track(truth.detections, recipe=found.recipe)
    assert again.recipe == found.recipe
    assert np.array_equal(again.labels, found.labels)
    with pytest.MonkeyPatch.context() as patch:
        name = "asterism.tracking.attempts.most_certain.choice_without_common_motion"
        patch.setattr(name, lambda *_: None)
        with_it = am.track(truth.detections)
    assert am.evaluate(found, truth).idf1 > am.evaluate(with_it, truth).idf1


def test_page_and_terminal_state_the_model_of_a_late_choice(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    d = hand(2).detections
    am.write(d, "hand.csv")
    assert main(["track", "hand.csv", "-o", "out.csv", "--report", "page.html"]) == 0
    printed = capsys.readouterr().out
    models = [each.split("\n\n")[0] for each in printed.split("\nModel")[1:]]
    assert models[1].startswith(", without the motion in common")
    noise = re.search(r"noise σ +(\S+) ±", models[1])[1]
    assert f"noise σ {noise}" not in models[0]
    page = re.sub(r"\s+", " ", text_of((tmp_path / "page.html").read_bytes()))
    assert f"without the motion that most markers have in common (noise σ {noise} " in page


def test_a_motion_that_explains_less_than_it_costs_stays(monkeypatch):
    take = am.simulate.fingers(frames=300, rate=120, seed=1)  # its wrist moves by 1 mm a frame
    d = am.simulate.corrupt(take, noise=3e-3, seed=1).detections
    model = am.estimate_model(d).model
    assert choice_without_common_motion(d, model) is None
    monkeypatch.setattr("asterism.tracking.motion_in_common.COST", 0.0)
    assert choice_without_common_motion(d, model) is not None


def test_independent_markers_and_people_are_tracked_as_they_are(monkeypatch):
    monkeypatch.setattr("asterism.tracking.choose.CONFUSED", 0.0)
    monkeypatch.setattr("asterism.tracking.plan.CONFUSED", -1.0)
    person = am.simulate.person(frames=120, seed=1)
    for take in (am.simulate.swarm(frames=150, seed=1), am.simulate.smooth(seed=1), person):
        d = am.simulate.corrupt(take, missing=0.1, clutter=0.1, noise=1e-3, seed=1).detections
        assert not am.tracking.plan_tracking(d).recipe.common_motion


def test_a_choice_without_it_is_not_offered_for_a_given_model():
    truth = skin()
    model = am.estimate_model(truth.detections).model
    plans = [am.tracking.plan_tracking(truth.detections, model=each) for each in (None, model)]
    assert [each.recipe.common_motion for each in plans] == [True, False]
    assert plans[1].recipe.model == model
    assert plans[1].estimate is None
    for method, stitch, is_removed in (("mcmcda", "auto", 0), (None, False, 1), (None, True, 0)):
        plan = am.tracking.plan_tracking(truth.detections, method, stitch=stitch)
        assert plan.recipe.common_motion == is_removed
