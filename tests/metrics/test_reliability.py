"""Calibration of confidence."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from asterism.errors import ParameterError
from asterism.metrics import calibration_curve


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 20).map(lambda k: k / 20), st.booleans()), max_size=40),
    st.integers(1, 12),
)
def test_equal_to_counting(pairs, bins):
    p, right = [c for c, _ in pairs], [r for _, r in pairs]
    found = calibration_curve(p, np.array(right, dtype=bool), bins)
    ece = 0.0
    for k in range(bins):
        low, high = found.edges[k], found.edges[k + 1]
        own = [(c, r) for c, r in pairs if low <= c < high or (k == bins - 1 and c == 1)]
        assert found.counts[k] == len(own)
        if own:
            mean, share = (sum(x) / len(own) for x in zip(*own, strict=True))
            assert found.confidence[k] == pytest.approx(mean)
            assert found.right[k] == pytest.approx(share)
            ece += len(own) * abs(mean - share) / len(pairs)
        else:
            assert math.isnan(found.confidence[k])
            assert math.isnan(found.right[k])
    wins = [(a > b) + (a == b) / 2 for a, r in pairs if r for b, s in pairs if not s]
    auc = sum(wins) / len(wins) if wins else math.nan
    assert found.auc == pytest.approx(auc, nan_ok=True)
    assert found.ece == pytest.approx(ece if pairs else math.nan, nan_ok=True)


def test_honest_confidence_is_calibrated_and_a_boast_is_not():
    rng = np.random.default_rng(1)
    p = rng.random(100_000)
    right = rng.random(100_000) < p
    # In each of ten bins the share right has a standard error of at most 0.005.
    assert calibration_curve(p, right).ece < 0.01
    assert calibration_curve(np.ones(100_000), right).ece == pytest.approx(0.5, abs=0.01)
    assert calibration_curve(p, right).auc == pytest.approx(5 / 6, abs=0.01)


def test_reads_as_a_table():
    text = str(calibration_curve([0.95, 0.9, 0.1], [True, False, False]))
    assert "0.90 to 1.00          2      0.9250   0.5000" in text
    assert text.endswith("AUC 1.0000")
    assert len(text.splitlines()) == 4  # a head, two bins that are used, the summary


@pytest.mark.parametrize(
    ("p", "right", "bins", "what"),
    [
        ([1.2], [True], 10, "confidence"),
        ([-0.1], [True], 10, "confidence"),
        ([float("nan")], [True], 10, "confidence"),
        ([0.5], [True, False], 10, "is_right"),
        ([0.5], [True], 0, "bins"),
    ],
)
def test_what_is_no_confidence_is_refused(p, right, bins, what):
    with pytest.raises(ParameterError, match=what):
        calibration_curve(p, right, bins)
