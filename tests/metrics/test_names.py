"""Scores of names against a slow count by name, and partners on the other side of the body."""

from __future__ import annotations

import math

import numpy as np
import pytest

import asterism as am
from asterism.errors import ParameterError
from asterism.metrics import name_scores

NAMES = ["LKNE", "RKNE", "C7", "LASI", "RASI", None]


def slow_scores(given: list[str | None], true: list[str | None]) -> tuple[float, ...]:
    """Return accuracy, and precision, recall and F1 averaged over the names that occur."""
    rows = []
    for name in {*given, *true}:
        hits = sum(g == t == name for g, t in zip(given, true, strict=True))
        precision = hits / given.count(name) if name in given else 0.0
        recall = hits / true.count(name) if name in true else 0.0
        total = precision + recall
        rows.append((precision, recall, 2 * precision * recall / total if total else 0.0))
    accuracy = np.mean([g == t for g, t in zip(given, true, strict=True)])
    return float(accuracy), *np.mean(rows, axis=0)


@pytest.mark.parametrize("seed", range(20))
def test_equals_the_count_by_name(seed: int) -> None:
    rng = np.random.default_rng(seed)
    labels = rng.integers(-1, len(NAMES), size=60)
    truth = np.where(rng.random(60) < 0.7, labels, rng.integers(-1, len(NAMES), size=60))
    names = list(rng.permutation(np.array([*NAMES[:-1], "T10"], dtype=object)))
    scores = name_scores(labels, truth, names, NAMES)
    given = [names[k] if k >= 0 else None for k in labels]
    true = [NAMES[k] if k >= 0 else None for k in truth]
    found = (scores.name_accuracy, scores.name_precision, scores.name_recall, scores.name_f1)
    assert found == pytest.approx(slow_scores(given, true), rel=1e-12)


@pytest.mark.parametrize(
    ("given", "true", "swapped"),
    [
        ("LKNE", "RKNE", True),
        ("Left Knee", "Right Knee", True),
        ("knee_l", "knee_r", True),
        ("Ann:LKNE", "Ann:RKNE", True),
        ("Ann:LKNE", "RKNE", True),
        ("Ann:LKNE", "Bob:RKNE", False),
        ("LKNE", "LASI", False),
        ("C7", "T10", False),
    ],
)
def test_partner_on_the_other_side(given: str, true: str, swapped: bool) -> None:
    scores = name_scores([0, 0], [0, 0], [given], [true])
    assert scores.swapped_sides_percent == (100.0 if swapped else 0.0)
    assert scores.name_accuracy == 0.0


def test_subjects_count_only_where_both_sides_have_them() -> None:
    assert name_scores([0], [0], ["Ann:LKNE"], ["LKNE"]).name_f1 == 1.0
    assert name_scores([0], [0], ["Ann:LKNE"], ["Ann:LKNE"]).name_f1 == 1.0
    assert name_scores([0], [0], ["Ann:LKNE"], ["Bob:LKNE"]).name_f1 == 0.0


def test_evaluation_says_when_names_are_not_scored() -> None:
    truth = am.simulate.person(frames=30, seed=1)
    tracks = am.track(truth.detections, am.GNN())
    scores = am.evaluate(tracks, truth)
    assert scores.idf1 > 0.9
    assert math.isnan(scores.name_f1)
    assert "not scored" in str(scores)
    assert am.evaluate(truth, truth).name_f1 == 1.0


def test_exchanged_sides_are_seen_by_the_names_alone() -> None:
    truth = am.simulate.person(frames=30, seed=1)
    sides = {"L": "R", "R": "L"}
    mirrored = [sides.get(n[0], n[0]) + n[1:] if n else n for n in truth.names]
    exchanged = am.Tracks(detections=truth.detections, labels=truth.labels, names=tuple(mirrored))
    scores = am.evaluate(exchanged, truth)
    assert scores.idf1 == 1.0
    assert scores.name_f1 < 0.5
    assert scores.swapped_sides_percent > 50


def test_a_label_without_an_entry_is_refused() -> None:
    with pytest.raises(ParameterError, match="at least 2 entries"):
        name_scores([1], [0], ["C7"], ["C7"])
