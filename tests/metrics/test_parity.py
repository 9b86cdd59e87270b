"""Scores equal those of the reference tools on the same random input."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.metrics import clear_scores, hota_scores, identity_scores


def _case(seed):
    """Draw 40 frames of detections with imperfect labels: (labels, truth, frames)."""
    rng = np.random.default_rng(seed)
    n_markers, n_tracks = rng.integers(2, 8, 2)
    labels, truth, frames = [], [], []
    track_of = rng.permutation(max(n_markers, n_tracks) + 2)
    for t in range(40):
        if rng.random() < 0.3:  # some tracks change their marker
            i, j = rng.integers(len(track_of), size=2)
            track_of[[i, j]] = track_of[[j, i]]
        is_seen = rng.random(n_markers) < 0.85
        is_seen[0] = True  # no tool agrees with another on frames without any
        for marker in np.flatnonzero(is_seen):
            track = track_of[marker]
            is_labelled = marker == 0 or rng.random() < 0.8
            truth.append(marker)
            labels.append(track if is_labelled else -1)
            frames.append(t)
        spare = np.setdiff1d(track_of, track_of[:n_markers])
        for track in spare[rng.random(len(spare)) < 0.2]:  # labelled clutter
            truth.append(-1)
            labels.append(track)
            frames.append(t)
        for _ in range(rng.integers(2)):  # clutter without a label
            truth.append(-1)
            labels.append(-1)
            frames.append(t)
    return np.array(labels), np.array(truth), np.array(frames)


def _trackeval_data(labels, truth, frames):
    """Lay the case out as TrackEval's metrics take it, without its files and data sets."""
    true_names, gt = np.unique(truth[truth >= 0], return_inverse=True)
    track_names, own = np.unique(labels[labels >= 0], return_inverse=True)
    i_gt, i_own = np.full(len(truth), -1), np.full(len(labels), -1)
    i_gt[truth >= 0], i_own[labels >= 0] = gt, own
    data = {
        "gt_ids": [],
        "tracker_ids": [],
        "similarity_scores": [],
        "num_timesteps": int(frames[-1]) + 1,
        "num_gt_ids": len(true_names),
        "num_tracker_ids": len(track_names),
        "num_gt_dets": int((truth >= 0).sum()),
        "num_tracker_dets": int((labels >= 0).sum()),
    }
    for t in range(frames[-1] + 1):
        here = np.flatnonzero(frames == t)
        a, b = here[truth[here] >= 0], here[labels[here] >= 0]
        data["gt_ids"].append(i_gt[a])
        data["tracker_ids"].append(i_own[b])
        data["similarity_scores"].append((a[:, None] == b[None, :]).astype(float))
    return data


@pytest.mark.parametrize("seed", range(25))
def test_equal_to_trackeval(seed):
    from trackeval.metrics import CLEAR, HOTA, Identity

    labels, truth, frames = _case(seed)
    data = _trackeval_data(labels, truth, frames)
    clear = CLEAR({"PRINT_CONFIG": False, "THRESHOLD": 0.5}).eval_sequence(data)
    ours = clear_scores(labels, truth, frames)
    assert ours.mota == pytest.approx(clear["MOTA"], abs=1e-12)
    assert ours.switches == clear["IDSW"] > 0
    assert (ours.missed, ours.false_labels) == (clear["CLR_FN"], clear["CLR_FP"])
    assert ours.mostly_lost == clear["ML"]

    identity = Identity({"PRINT_CONFIG": False, "THRESHOLD": 0.5}).eval_sequence(data)
    ours = identity_scores(labels, truth)
    assert ours.idf1 == pytest.approx(identity["IDF1"], abs=1e-12)
    assert ours.idp == pytest.approx(identity["IDP"], abs=1e-12)
    assert ours.idr == pytest.approx(identity["IDR"], abs=1e-12)
    assert ours.n_identified == identity["IDTP"]

    hota = HOTA().eval_sequence(data)
    ours = hota_scores(labels, truth)
    for name in ("HOTA", "DetA", "AssA"):
        assert getattr(ours, name.lower()) == pytest.approx(hota[name].mean(), abs=1e-12)


@pytest.mark.parametrize("seed", range(25))
def test_fragments_equal_to_trackeval_where_no_marker_leaves(seed):
    # TrackEval also calls it a fragment when a marker itself was away; here each is always there.
    from trackeval.metrics import CLEAR

    rng = np.random.default_rng(seed)
    truth = np.tile(np.arange(5), 40)
    labels = np.where(rng.random(200) < 0.7, truth, -1)
    labels[::5] = 0
    frames = np.repeat(np.arange(40), 5)
    data = _trackeval_data(labels, truth, frames)
    theirs = CLEAR({"PRINT_CONFIG": False, "THRESHOLD": 0.5}).eval_sequence(data)
    assert clear_scores(labels, truth, frames).fragments == theirs["Frag"] > 0


@pytest.mark.parametrize("seed", range(8))
def test_equal_to_motmetrics(seed):
    import motmetrics

    labels, truth, frames = _case(seed)
    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    for t in range(frames[-1] + 1):
        here = np.flatnonzero(frames == t)
        a, b = here[truth[here] >= 0], here[labels[here] >= 0]
        distances = np.where(a[:, None] == b[None, :], 0.0, np.nan)
        accumulator.update(truth[a].tolist(), labels[b].tolist(), distances)
    names = [
        "mota", "idf1", "idp", "idr", "num_switches", "num_fragmentations", "num_misses",
        "num_false_positives", "mostly_tracked", "mostly_lost",
    ]  # fmt: skip
    theirs = motmetrics.metrics.create().compute(accumulator, metrics=names).iloc[0]
    clear, identity = clear_scores(labels, truth, frames), identity_scores(labels, truth)
    assert clear.mota == pytest.approx(theirs["mota"], abs=1e-12)
    assert identity.idf1 == pytest.approx(theirs["idf1"], abs=1e-12)
    assert identity.idp == pytest.approx(theirs["idp"], abs=1e-12)
    assert identity.idr == pytest.approx(theirs["idr"], abs=1e-12)
    assert clear.switches == theirs["num_switches"] > 0
    assert clear.fragments == theirs["num_fragmentations"]
    assert (clear.missed, clear.false_labels) == (
        theirs["num_misses"],
        theirs["num_false_positives"],
    )
    assert clear.mostly_tracked == theirs["mostly_tracked"]
    assert clear.mostly_lost == theirs["mostly_lost"]
