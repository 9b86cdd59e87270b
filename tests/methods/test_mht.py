"""Reid's multiple hypotheses: all partitions, their probabilities, clusters, what is dropped."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

import asterism as am
from asterism.tracking import Gate, Lifecycle
from tests.references.partitions import every_partition, tiny_model, tiny_problem
from tests.scenes import calibration_in_crowds, crowd, small_model, wanderers

# Nothing is dropped, and what is more likely than not is confirmed.
WHOLE = am.MHT(
    window=16, max_hypotheses=10**6, prune_odds=1e300, new_track_odds=1e300,
    gate=Gate(probability=1e-300),
    lifecycle=Lifecycle(confirm_probability=0.5 + 1e-12, delete_odds=1e300),
)  # fmt: skip


def crowd_model(**changes):
    return small_model(
        **{
            "motion": am.DWNA(acceleration_sigma=1.2, velocity_sigma=0.3), "noise_sigma": 0.01,
            "max_speed": 1.5, "clutter_density": 5.0, "birth_density": 0.5, "p_disappear": 1e-3,
            "max_gap": 6,
        } | changes
    )  # fmt: skip


def after_all(method, d: am.Detections, model: am.TrackingModel):
    state = method.init(model, n_axes=d.points.shape[1])
    for time, points in d:
        state, _ = method.step(state, time, points)
    return state


def as_partitions(clusters) -> dict[frozenset[tuple[int, ...]], float]:
    """Every choice of one hypothesis of each cluster, as a partition, with its probability."""
    found: dict[frozenset[tuple[int, ...]], float] = {}
    each = [
        list(zip(map(tracks_of, itertools.repeat(c), c.origins), c.probabilities, strict=False))
        for c in clusters
    ]
    for choice in itertools.product(*each):
        key = frozenset(itertools.chain.from_iterable(tracks for tracks, _ in choice))
        assert key not in found  # each partition is one hypothesis
        found[key] = math.prod(p for _, p in choice)
    return found


def tracks_of(cluster, origins) -> list[tuple[int, ...]]:
    tracks: dict[int, tuple[int, ...]] = {}
    for i, k in zip(cluster.detections.tolist(), origins.tolist(), strict=True):
        tracks[k] = (*tracks.get(k, ()), i)
    return [track for k, track in tracks.items() if k >= 0]


@pytest.mark.parametrize("seed", range(7))
def test_all_hypotheses_are_all_partitions_with_their_probabilities(seed):
    rng = np.random.default_rng(seed)
    n_tracks = 0
    for _ in range(15):
        n_frames, most = ((5, 2), (4, 3), (3, 4))[rng.integers(3)]
        d, model = tiny_problem(rng, n_frames, most, int(rng.integers(2, 4))), tiny_model(rng)
        partitions, totals = every_partition(d, model)
        wanted = np.exp(totals - totals.max())
        wanted /= wanted.sum()
        found = as_partitions(WHOLE.hypotheses(after_all(WHOLE, d, model)))
        assert set(found) <= {frozenset(tracks) for tracks in partitions}
        p = np.array([found.get(frozenset(tracks), 0.0) for tracks in partitions])
        np.testing.assert_allclose(p, wanted, rtol=0, atol=1e-9)

        tracks = am.track(d, WHOLE, model=model)
        assert (tracks.info["limited"], tracks.info["merged"]) == (0, 0)
        assert am.log_posterior(tracks, model) == pytest.approx(totals.max(), abs=1e-9)
        n_tracks += tracks.n_tracks
        # All frames are open: how sure is it of each label? A target is its first detection.
        owners = [{i: track[0] for track in tracks_ for i in track} for tracks_ in partitions]
        best = owners[int(totals.argmax())]
        for i, label in enumerate(tracks.labels):
            first = best.get(i)
            if label < 0 and first is not None:
                continue  # of a target that is tentative still
            says = [owner.get(i) == first for owner in owners]
            assert tracks.confidence[i] == pytest.approx(wanted[says].sum(), abs=1e-9)
    assert n_tracks >= 5


@pytest.mark.parametrize("seed", range(4))
def test_clusters_apart_and_what_is_dropped_hardly_change_the_probabilities(seed):
    rng = np.random.default_rng(50 + seed)
    method = dataclasses.replace(WHOLE, prune_odds=1e8)
    n_apart = 0
    for _ in range(40):
        d, model = tiny_problem(rng, *((5, 2), (4, 3), (3, 4))[rng.integers(3)]), tiny_model(rng)
        partitions, totals = every_partition(d, model)
        wanted = np.exp(totals - totals.max())
        wanted /= wanted.sum()
        clusters = method.hypotheses(after_all(method, d, model))
        n_apart += len(clusters) > 1
        found = as_partitions(clusters)
        p = np.array([found.get(frozenset(tracks), 0.0) for tracks in partitions])
        np.testing.assert_allclose(p, wanted, rtol=0, atol=1e-4)
    assert n_apart > 5


@pytest.mark.parametrize("prune_odds", [2.0, 1e6])
@pytest.mark.parametrize("seed", range(3))
def test_the_truth_is_found_where_no_link_is_ambiguous(seed, prune_odds):
    truth = wanderers(np.random.default_rng(seed), n_frames=80)
    tracks = am.track(truth.detections, am.MHT(prune_odds=prune_odds), model=small_model())
    assert am.evaluate(tracks, truth).idf1 > 0.98
    assert tracks.info["limited"] == 0


def test_more_frames_and_more_hypotheses_explain_a_crowd_better():
    gains, more = [], []
    for seed in range(8):
        d, model = crowd(seed, spread=0.08).detections, crowd_model()
        value = {
            name: am.log_posterior(am.track(d, method, model=model), model)
            for name, method in (
                ("gnn", am.GNN()),
                ("one", am.MHT(window=5, max_hypotheses=1)),
                ("many", am.MHT(window=5)),
            )
        }
        gains.append(value["many"] - value["gnn"])
        more.append(value["many"] - value["one"])
    assert np.mean(gains) > 5
    assert np.mean(more) > 5


def test_clusters_join_where_targets_compete_and_part_again():
    # Two markers that come near each other; far from there each is a cluster of its own.
    t = np.arange(60) * 0.02
    frames = [
        np.array([[s / 5, y, 0.0], [s / 5, -y, 0.0]])
        for s, y in zip(t, 0.01 + 0.6 * (t - 0.6) ** 2, strict=True)
    ]
    d = am.Detections.from_frames(t, frames)
    method, model = am.MHT(window=4), crowd_model()
    state = method.init(model)
    sizes = []
    for time, points in d:
        state, _ = method.step(state, time, points)
        likeliest = [c.origins[0] for c in method.hypotheses(state)]
        sizes.append(max(np.unique(origins[origins >= 0]).size for origins in likeliest))
        for c in method.hypotheses(state):
            assert c.probabilities.sum() == pytest.approx(1)
            assert (np.diff(c.probabilities) <= 1e-12).all()
    assert max(sizes[24:36]) == 2
    assert max(sizes[8:20]) == max(sizes[45:]) == 1


def test_what_is_left_out_is_reported():
    d, model = crowd(3, spread=0.04).detections, crowd_model(birth_density=1.0, clutter_density=1.0)
    few, many = (
        am.track(d, am.MHT(max_hypotheses=3), model=model),
        am.track(d, am.MHT(), model=model),
    )
    assert few.info["limited"] > many.info["limited"]
    assert few.info["most_hypotheses"] == 3
    assert few.info["max_dropped_odds"] > many.info["max_dropped_odds"]
    assert am.log_posterior(few, model) < am.log_posterior(many, model)


def test_similar_hypotheses_are_merged():
    # Two points side by side, nearer to each other than the noise: who has which makes no odds.
    rng = np.random.default_rng(0)
    t = np.arange(12) * 0.02
    frames = [np.array([[s, 0, 0]]) + rng.normal(0, 1e-3, (1, 3)) for s in t]
    frames[6] = np.concatenate([frames[6], frames[6] + 1e-6])
    d = am.Detections.from_frames(t, frames)
    model = crowd_model(max_speed=10.0)
    counts, sure, missed = {}, {}, {}
    for within in (0.0, 0.1):
        method = am.MHT(merged_within=within, window=8)
        state = after_all(method, am.Detections.from_frames(t[:7], frames[:7]), model)
        counts[within] = sum(len(c.probabilities) for c in method.hypotheses(state))
        # Hypotheses in which the track has neither: as probable as without merging.
        (own,) = [c for c in method.hypotheses(state) if 5 in c.detections]
        neither = (own.origins[:, np.isin(own.detections, [6, 7])] < 0).all(axis=1)
        missed[within] = own.probabilities[neither].sum()
        tracks = am.track(d, method, model=model)
        assert tracks.n_tracks == 1
        assert (tracks.info["merged"] > 0) == (within > 0)
        sure[within] = tracks.confidence[8:].min()
    assert counts[0.1] < counts[0.0]
    # What was merged still counts: of the rest it is as sure as without.
    assert missed[0.1] == pytest.approx(missed[0.0], rel=1e-3)
    assert sure[0.1] == pytest.approx(sure[0.0], abs=1e-3)


def test_merging_again_and_again_stays_probable():
    # Clusters that join, merge and part for long: what was merged counts once, in its own part.
    d = crowd(1, spread=0.03, n_frames=300).detections
    method, model = am.MHT(merged_within=2.0, window=5), crowd_model()
    state = method.init(model)
    for time, points in d:
        state, _ = method.step(state, time, points)
        for *_, log_weights in state.tracker.clusters():
            assert np.ptp(log_weights) < math.log(method.prune_odds) + 1
    tracks = am.track(d, method, model=model)
    assert tracks.info["merged"] > 300
    plain = am.track(d, am.MHT(window=5), model=model)
    assert (tracks.labels >= 0).sum() == pytest.approx((plain.labels >= 0).sum(), rel=0.02)


def test_confidence_is_calibrated_where_the_model_is_right():
    found = calibration_in_crowds(am.MHT())
    assert found.auc > 0.8
    assert found.ece < 0.01


def test_hypotheses_of_another_method_are_refused():
    with pytest.raises(am.ParameterError, match="a state of MHT"):
        am.MHT().hypotheses(am.GNN().init(small_model()))


def test_options_are_checked():
    for wrong in (
        {"window": 1}, {"window": 17}, {"max_hypotheses": 0}, {"prune_odds": 1},
        {"merged_within": -1}, {"merged_within": math.nan}, {"new_track_odds": 0},
    ):  # fmt: skip
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            am.MHT(**wrong)
