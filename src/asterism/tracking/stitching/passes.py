"""One pass of stitching through a capture, forward or backward in time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, TrackingModel

__all__ = ["GHOST", "Pass", "go_through"]

GHOST = -2
"""Marker of a tracklet that is a ghost."""
FRAMES_A_CALL = 1000
"""Number of frames of one call. The engine's copy of their points takes little memory."""
MIN_ADVICE, MAX_ADVICE = 1.0, 5.0
"""Bounds of the log odds that a join of one pass adds in the next."""


@record(eq=False)
class Pass:
    """Result of a pass.

    Parameters
    ----------
    tracklets : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for clutter.
    markers : ndarray of int, shape (F,)
        Marker of each tracklet, `GHOST` for a ghost.
    after : ndarray of int, shape (F,)
        Predecessor of each tracklet in the direction of the pass, -1 for the first of a
        marker.
    probabilities : ndarray of shape (F,)
        Probability of the decision about each tracklet.
    """

    tracklets: NDArray[np.int32]
    markers: NDArray[np.int32]
    after: NDArray[np.int32]
    probabilities: NDArray[np.float64]

    def advise(self, stitcher: _engine.Stitcher) -> None:
        """Pass the joins of these tracklets as prior log odds to a pass in the other direction.

        Parameters
        ----------
        stitcher : Stitcher
            Engine object of the other pass.
        """
        joined = np.flatnonzero((self.after >= 0) & (self.markers >= 0))
        p = np.clip(self.probabilities[joined], 1e-9, 1 - 1e-9)
        log_odds = np.log(p / (1 - p)) / _engine.Stitcher.ODDS_FACTOR
        weights = np.clip(log_odds, MIN_ADVICE, MAX_ADVICE)
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
    """Run one pass of stitching.

    Parameters
    ----------
    detections : Detections
        Detections of the capture.
    labels : ndarray of int, shape (N,)
        Tracklets to stitch; those of `before`, if it is given.
    model : TrackingModel
        Model whose motion and noise are used.
    options : StitchOptions
        Options of the engine.
    before : Pass, optional
        Result of the pass in the other direction.
    backward : bool
        Whether to go backward in time.

    Returns
    -------
    Pass
    """
    d = detections
    stitcher = _engine.Stitcher(motion_model(model, d.n_axes), options)
    if before is not None:
        before.advise(stitcher)
    way = -1 if backward else 1
    times = np.ascontiguousarray((way * d.times)[::way])
    kind, F, Q = steps_of(model.motion, times)
    tracklets = np.full(d.n_points, -1, dtype=np.int32)
    for t in range(0, d.n_frames, FRAMES_A_CALL):
        end = min(t + FRAMES_A_CALL, d.n_frames)
        offsets = d.offsets[t : end + 1] if way > 0 else d.offsets[::-1][t : end + 1]
        own = slice(offsets[0], offsets[-1]) if way > 0 else slice(offsets[-1], offsets[0])
        tracklets[own][::way] = stitcher.run(
            times[t:end], kind[t:end], F, Q, np.abs(offsets - offsets[0]),
            np.ascontiguousarray(d.points[own][::way]),
            np.ascontiguousarray(labels[own][::way], dtype=np.int64),
        )  # fmt: skip
    markers, after, probabilities = stitcher.finish()
    return Pass(tracklets=tracklets, markers=markers, after=after, probabilities=probabilities)
