"""Confidence of corrected tracks: what a person stated is certain."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.calibration import WHOLE
from asterism.tracking.correction.constraints import Constraints

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.model import Decision, Edit, Tracks

__all__ = ["settled"]


def settled(tracks: Tracks, edits: Sequence[Edit]) -> Tracks:
    """Return tracks without the uncertainty that edits settle.

    Parameters
    ----------
    tracks : Tracks
        Corrected tracks with identity confidences and decisions.
    edits : sequence of Edit
        Edits that they respect. The identity of a part with one of their detections is certain.
    """
    pinned = sorted(Constraints.of(edits, tracks.detections).pinned)
    if not pinned or tracks.identity_confidence is None:
        return tracks
    frames = tracks.detections.frame_of
    stated: dict[int, list[int]] = {}
    for i in pinned:
        stated.setdefault(int(tracks.labels[i]), []).append(int(frames[i]))
    identity = tracks.identity_confidence.copy()
    kept: list[Decision] = []
    for each in tracks.decisions:
        own = stated.get(each.track, [])
        if each.kind != "identity" or not any(each.first <= t <= each.last for t in own):
            kept.append(each)
            continue
        part = np.flatnonzero(tracks.labels == each.track)
        part = part[(frames[part] >= each.first) & (frames[part] <= each.last)]
        identity[part] = WHOLE
    return replace(tracks, identity_confidence=identity, decisions=tuple(kept))
