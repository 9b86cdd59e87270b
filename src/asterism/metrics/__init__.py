"""Scores of tracks against ground truth, and the calibration of their confidence."""

from __future__ import annotations

from asterism.metrics.alignment import Alignment, align
from asterism.metrics.association import (
    AssociationScores,
    association_scores,
    right_identities,
    right_links,
)
from asterism.metrics.clear import ClearScores, clear_scores
from asterism.metrics.evaluation import Evaluation, evaluate
from asterism.metrics.gospa import GospaScores, gospa_scores
from asterism.metrics.hota import HotaScores, hota_scores
from asterism.metrics.identity import IdentityScores, identity_scores
from asterism.metrics.names import NameScores, name_scores
from asterism.metrics.oracle import oracle_tracks
from asterism.metrics.points import PointScores, point_scores
from asterism.metrics.reliability import CalibrationCurve, calibration_curve

__all__ = [
    "Alignment",
    "AssociationScores",
    "CalibrationCurve",
    "ClearScores",
    "Evaluation",
    "GospaScores",
    "HotaScores",
    "IdentityScores",
    "NameScores",
    "PointScores",
    "align",
    "association_scores",
    "calibration_curve",
    "clear_scores",
    "evaluate",
    "gospa_scores",
    "hota_scores",
    "identity_scores",
    "name_scores",
    "oracle_tracks",
    "point_scores",
    "right_identities",
    "right_links",
]
