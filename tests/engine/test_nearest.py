"""The two nearest points of a frame, against SciPy's tree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from asterism._engine import NearestPoints


@pytest.mark.parametrize("n_axes", [2, 3])
@pytest.mark.parametrize("sparse", [False, True])
def test_the_two_nearest_points_are_those_of_a_tree(n_axes, sparse):
    rng = np.random.default_rng(4)
    counts = rng.integers(0, 3, 60) if sparse else np.array([1, 2, 30, 400])
    offsets = np.concatenate([[0], np.cumsum(counts)])
    points = rng.normal(size=(offsets[-1], n_axes)) * [1.0, 3.0, 0.1][:n_axes]
    places = rng.normal(size=(300, n_axes))
    frames = rng.integers(0, len(counts), 300)
    index, distance = NearestPoints(points, offsets).two(places, frames)
    for q, t in enumerate(frames):
        if counts[t] == 0:
            assert (index[q] == -1).all()
            assert np.isinf(distance[q]).all()
            continue
        expected, nearest = KDTree(points[offsets[t] : offsets[t + 1]]).query(places[q], k=2)
        np.testing.assert_allclose(distance[q], expected, rtol=1e-12)
        nearest = np.where(np.isinf(expected), -1, nearest + offsets[t])
        np.testing.assert_array_equal(index[q], nearest)


def test_of_equally_near_points_the_first_counts():
    points = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.0, -1.0]])
    index, distance = NearestPoints(points, np.array([0, 5])).two(np.zeros((1, 2)), np.array([0]))
    np.testing.assert_array_equal(index, [[0, 1]])
    np.testing.assert_array_equal(distance, [[1.0, 1.0]])


@pytest.mark.parametrize(
    ("places", "frames", "what"),
    [
        (np.zeros((1, 3)), np.array([0]), "axes"),
        (np.zeros((1, 2)), np.array([1]), "frames"),
        (np.zeros((1, 2)), np.array([-1]), "frames"),
        (np.zeros((2, 2)), np.array([0]), "frames"),
    ],
)
def test_wrong_arrays_are_refused(places, frames, what):
    with pytest.raises(ValueError, match=what):
        NearestPoints(np.zeros((4, 2)), np.array([0, 4])).two(places, frames)
