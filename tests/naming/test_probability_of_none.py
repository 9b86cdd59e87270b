"""The probability of a name counts the chance that the track is no marker at all."""

import numpy as np
import pytest

from asterism.tracking.naming.probabilities import TEMPERATURE, probabilities_of

NEVER = -1e3


@pytest.mark.parametrize("log_odds", [-8.0, -2.0, 0.0, 3.0])
def test_no_name_takes_its_share(log_odds: float) -> None:
    of_markers = np.full((2, 2), NEVER)
    of_tracks = np.full((1, 2), NEVER)
    probability, _, other_probability, none = probabilities_of(
        np.array([0]), of_markers, of_tracks, np.array([log_odds])
    )
    odds = np.exp(log_odds / TEMPERATURE)
    assert none[0] == pytest.approx(odds / (1 + odds))
    assert probability[0] == pytest.approx(1 / (1 + odds))
    assert probability[0] + other_probability[0] + none[0] == pytest.approx(1.0)


def test_no_name_and_another_name_share_the_rest() -> None:
    of_markers = np.full((2, 2), NEVER)
    of_tracks = np.array([[0.0, 0.0]])
    probability, other, other_probability, none = probabilities_of(
        np.array([0]), of_markers, of_tracks, np.array([0.0])
    )
    assert other[0] == 1
    assert [probability[0], other_probability[0], none[0]] == pytest.approx([1 / 3, 1 / 3, 1 / 3])


def test_a_track_without_a_name_has_none() -> None:
    probability, other, _, none = probabilities_of(
        np.array([-1]), np.zeros((2, 2)), np.zeros((1, 2)), np.array([0.0])
    )
    assert (probability[0], other[0], none[0]) == (0.0, -1, 1.0)
