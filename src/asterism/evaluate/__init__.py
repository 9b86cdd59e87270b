"""How good a result is: identities, misses, false labels, and whether confidence means anything.

The package may be called: ``asterism.evaluate(tracks, truth)`` is `evaluate.evaluate`.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from asterism.evaluate.alignment import Alignment, align
from asterism.evaluate.association import AssociationScores, association_scores, right_links
from asterism.evaluate.clear import ClearScores, clear_scores
from asterism.evaluate.evaluation import Evaluation, evaluate
from asterism.evaluate.gospa import GospaScores, gospa_scores
from asterism.evaluate.hota import HotaScores, hota_scores
from asterism.evaluate.ideal import floor
from asterism.evaluate.identity import IdentityScores, identity_scores
from asterism.evaluate.points import PointScores, point_scores
from asterism.evaluate.reliability import Calibration, calibration

__all__ = [
    "Alignment",
    "AssociationScores",
    "Calibration",
    "ClearScores",
    "Evaluation",
    "GospaScores",
    "HotaScores",
    "IdentityScores",
    "PointScores",
    "align",
    "association_scores",
    "calibration",
    "clear_scores",
    "evaluate",
    "floor",
    "gospa_scores",
    "hota_scores",
    "identity_scores",
    "point_scores",
    "right_links",
]


class _CallablePackage(ModuleType):
    # Importing a submodule binds this package to the name `asterism.evaluate`, over the function of
    # that name: which of the two a user gets must not depend on what was imported before.
    def __call__(self, *args: Any, **kwargs: Any) -> Evaluation:
        return evaluate(*args, **kwargs)


sys.modules[__name__].__class__ = _CallablePackage
