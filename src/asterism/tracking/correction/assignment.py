"""Assignment of uncertain detections once more, which a person confirms."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.confidence.reassign import (
    EVEN_ODDS,
    PROBABLE,
    ROUNDS,
    UNCERTAIN,
    gains,
    reassigned,
)
from asterism.tracking.correction.change import without_improbable
from asterism.tracking.correction.segments import with_lost_segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Tracks

__all__ = ["assigned_again"]


def assigned_again(
    tracks: Tracks,
    identity: NDArray[np.float64],
    is_open: NDArray[np.bool_],
    ghost: NDArray[np.float64],
    noise_sigma: float,
    *,
    is_even: bool,
) -> NDArray[np.int64]:
    """Assign the open detections once more, first those of lost segments.

    Parameters
    ----------
    tracks : Tracks
        Tracks under correction.
    identity : ndarray of shape (N,)
        Confidence of the identity of each detection.
    is_open : ndarray of bool, shape (N,)
        Detections that may change.
    ghost, noise_sigma
        As for `reassigned`.
    is_even : bool
        Whether detections without a track are taken at even odds. Changes that depend on each other
        are then made if they gain together.

    Returns
    -------
    ndarray of int, shape (N,)
        Track of each detection, -1 for clutter.
    """
    before, frame_of = tracks.labels, tracks.detections.frame_of
    labels, is_placed = with_lost_segments(tracks, is_open)
    placed = replace(tracks, labels=labels)
    rounds = EVEN_ODDS if is_even else ROUNDS
    labels = reassigned(placed, is_open & ~is_placed, ghost, noise_sigma, rounds)
    # Without distances at its best, a marker is no clutter: its identity must be improbable.
    slots = frame_of * tracks.n_tracks
    is_back = (before >= 0) & (labels < 0) & (identity > 1 - UNCERTAIN)
    is_back &= ~np.isin(slots + before, (slots + labels)[labels >= 0])
    labels = np.where(is_back, before, labels)
    if not is_even:
        return labels
    odds = gains(tracks, labels, ghost, noise_sigma)
    odds[is_placed] = PROBABLE  # at least, by the distances among them
    return without_improbable(before, labels, odds, frame_of)
