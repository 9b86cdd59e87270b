"""One pass of stitching through a take, forward or backward in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel

__all__ = ["Pass", "go_through"]

LEAST_ADVICE, MOST_ADVICE = 1.0, 5.0
"""Log odds that a join of the pass before is worth to the next."""


@record(eq=False)
class Pass:
    """What a pass found.

    Parameters
    ----------
    fragments : ndarray of int, shape (N,)
        Fragment of each detection, -1 for clutter.
    markers : ndarray of int, shape (F,)
        Marker of each fragment, -2 for a ghost.
    after : ndarray of int, shape (F,)
        The fragment that each goes on with in the pass's direction, -1 where a marker begins.
    probabilities : ndarray, shape (F,)
        Of what was decided of each fragment.
    n_cuts : int
        Links that the neighbours contradict.
    """

    fragments: NDArray[np.int32]
    markers: NDArray[np.int32]
    after: NDArray[np.int32]
    probabilities: NDArray[np.float64]
    n_cuts: int

    def advise(self, stitcher: _engine.Stitcher) -> None:
        """Tell a pass in the other direction, over these fragments, which of them were joined."""
        joined = np.flatnonzero((self.after >= 0) & (self.markers >= 0))
        p = np.clip(self.probabilities[joined], 1e-9, 1 - 1e-9)
        weights = np.clip(
            np.log(p / (1 - p)) / _engine.Stitcher.ODDS_FACTOR, LEAST_ADVICE, MOST_ADVICE
        )
        stitcher.advise(self.after[joined].astype(np.int64), joined.astype(np.int64), weights)


def go_through(
    detections: Detections,
    labels: NDArray[np.int64] | NDArray[np.int32],
    model: TrackingModel,
    options: _engine.StitchOptions,
    *,
    before: Pass | None = None,
    backward: bool = False,
) -> Pass:
    """Stitch once.

    Parameters
    ----------
    detections : Detections
        The take.
    labels : ndarray of int, shape (N,)
        Tracks to make markers of; the fragments of `before`, where that is given.
    model : TrackingModel
        Motion and noise.
    options : StitchOptions
        Of the engine.
    before : Pass, optional
        What was found in the other direction.
    backward : bool
        Begin at the end.

    Returns
    -------
    Pass
    """
    times, offsets, points = detections.times, detections.offsets, detections.points
    labels = labels.astype(np.int64)
    if backward:
        times = np.ascontiguousarray(-times[::-1])
        offsets = np.ascontiguousarray(detections.n_points - offsets[::-1])
        points = np.ascontiguousarray(points[::-1])
        labels = np.ascontiguousarray(labels[::-1])
    motion = motion_model(model, detections.n_axes)
    stitcher = _engine.Stitcher(motion, options)
    if before is not None:
        before.advise(stitcher)
    kind, F, Q = steps_of(model.motion, times)
    fragments, markers, after, probabilities = stitcher.run(
        motion, times, kind, F, Q, offsets, points, labels
    )
    return Pass(
        fragments=fragments[::-1] if backward else fragments,
        markers=markers, after=after, probabilities=probabilities, n_cuts=stitcher.n_cuts,
    )  # fmt: skip
