"""Tracks that respect edits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.tracking.correction.correction import Correction

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Edit, TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["correct"]


def correct(
    tracks: Tracks,
    edits: Sequence[Edit],
    model: TrackingModel,
    stitching: Stitching | None = None,
) -> Tracks:
    """Change tracks so that they respect the edits of a person.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture, from any method, stitched and named or not.
    edits : sequence of Edit
        Edits, which are solved in their order.
    model : TrackingModel
        Model of motion and noise with which they were tracked.
    stitching : Stitching, optional
        Stitching that made the tracks.

    Returns
    -------
    Tracks
        Tracks with the same numbers; those that lost all their detections are left out.

    Raises
    ------
    ParameterError
        If edits contradict each other or do not belong to these detections.

    Examples
    --------
    >>> import asterism as am
    >>> from asterism.model import Edit
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> d = truth.detections
    >>> ghost = Edit(kind="clutter", at=((0, 0),))
    >>> am.tracking.correct(truth, [ghost], model)
    Tracks(7 tracks, 280 detections in them, 40 clutter, 40 frames)
    """
    correction = Correction(tracks, model, stitching)
    for edit in edits:
        correction.apply(edit)
    found = correction.tracks
    return found if found.lengths.all() or not edits else _without_empty(found, tracks.lengths)


def _without_empty(tracks: Tracks, before: NDArray[np.int64]) -> Tracks:
    """Leave out the tracks that edits emptied."""
    old = np.zeros(tracks.n_tracks, dtype=bool)
    old[: len(before)] = before == 0
    kept = (tracks.lengths > 0) | old
    numbers = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)
    return replace(
        tracks, labels=numbers[tracks.labels],
        names=tuple(name for name, keep in zip(tracks.names, kept, strict=True) if keep),
    )  # fmt: skip
