"""Links by which the scales of a capture are found."""

import numpy as np
import pytest

from asterism._engine import NearestPoints
from asterism.tracking.estimation.scales import _sure_links


@pytest.mark.parametrize(
    ("now", "following", "link"),
    [
        ([[0, 0]], [[0.004, 0]], 1),
        ([[0, 0], [0.1, 0]], [[0.004, 0]], 2),
        ([[0, 0], [0.01, 0]], [[0.004, 0]], -1),  # a neighbour, which may have moved there
        ([[0, 0]], [[0.004, 0], [0, 0.008]], -1),  # two points near the first
        ([[0, 0]], [[0.004, 0], [0, 0.1]], 1),
        ([[0, 0], [0.1, 0], [0.0041, 0.015]], [[0.0041, 0.001]], 3),
    ],
)
def test_links_are_sure_if_no_other_point_is_near(now, following, link):
    points = np.array(now + following, dtype=float)
    frame = np.repeat([0, 1], [len(now), len(following)])
    nearest = NearestPoints(points, np.array([0, len(now), len(points)]))
    found, distance = _sure_links(nearest, points, frame, np.array([0]))
    assert found.tolist() == [link]
    steps = np.linalg.norm(np.array(following) - now[0], axis=1)
    np.testing.assert_allclose(distance, steps.min())
