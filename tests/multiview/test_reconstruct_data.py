"""Real cameras: flydra's five with their points shuffled, MyPTV's three with particles."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import asterism as am
from tests.paths import DATA, ROOT

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}"),
]


@pytest.fixture(scope="module")
def bench():
    sys.path.insert(0, str(ROOT / "benchmarks"))
    try:
        import reconstruction
    finally:
        sys.path.remove(str(ROOT / "benchmarks"))
    return reconstruction


@pytest.mark.parametrize("at_once", [1, 25, 100])
def test_flydras_points_shuffled(bench, at_once):
    folder = DATA / bench.FLYDRA
    o, truth = bench.flydra_shuffled(folder, at_once)
    made = am.reconstruct(o, am.read_rig(folder))
    scores = am.metrics.point_scores(made.detections, truth, radius=0.002)
    assert scores.recall > 0.99
    assert scores.ghosts < 0.01
    assert scores.median_mm < 0.12
    # No point is made of image points of two.
    markers = o.markers[made.views.blobs]
    first = markers[made.views.offsets[:-1]][made.views.point_of]
    assert (markers == first).mean() > 0.995


def test_myptvs_particles(bench):
    folder = DATA / bench.MYPTV
    o = bench.myptv_blobs(folder)
    made = am.reconstruct(o, am.read_rig(folder), min_views=3)
    n, n_same = bench.myptv_matches(folder, o, made)
    assert n == 281
    assert made.detections.n_points >= n
    # One of the others is a blob of theirs that we give to another particle, one is beyond 4 σ.
    assert n_same >= 278
    theirs = np.loadtxt(folder / "particles")
    for t in range(7):
        X = theirs[theirs[:, 7] == t, :3] / 1000
        near = np.linalg.norm(X[:, None] - made.detections.frame(t), axis=-1).min(axis=1)
        assert np.median(near) < 1e-4
