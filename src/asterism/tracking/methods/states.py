"""States of the tracks after a frame, as every method reports them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["TrackStates", "states_of"]


@record(eq=False)
class TrackStates:
    """States of the K confirmed tracks after a frame, occluded ones included.

    The state of an occluded track is its prediction to this frame: by its own motion, or by its
    rigid neighbours as well where the method uses them (`Rigidity`, `Stitched`). A method with a
    window reports the tracks as if all frames were decided now. Nothing that a method does not
    estimate is filled in: it is None, or NaN for single tracks.

    Parameters
    ----------
    ids : ndarray of int, shape (K,)
        Label of each track, in no particular order.
    means : ndarray of shape (K, D, n)
        Mean of the state of each axis: position, and velocity and acceleration if the motion has
        them; SI units. `JPDA` reports the mean over all associations of the frame, the other
        methods that of the selected association. NaN where nothing predicts an occluded marker;
        neighbours alone predict a position without a velocity.
    covariances : ndarray of shape (K, n, n)
        Covariance of this state, equal on every axis, SI units. `JPDA` includes the spread of the
        associations. For the other methods it is conditional on the selected association.
    gaps : ndarray of int, shape (K,)
        Number of frames since the last detection, 0 for a track detected in this frame.
    log_odds : ndarray of shape (K,), or None
        Log odds that the track exists. For `JPDA` these are the log odds of the existence
        probability of JIPDA: the marker exists and has not disappeared. For the other methods they
        are the score of the track: its detections are of one marker, against all of them being
        clutter. That score assumes the selected association and does not consider that the marker
        has disappeared since. It is NaN for `SMP` with ``strict=True``, which has no model of
        clutter, and for the occluded markers of `Stitched` after the end of their tracklet. None
        for whole captures.
    names : tuple of (str or None)
        Name of the marker of each track, None if it is unknown.
    identity_confidence : ndarray of shape (K,), or None
        Probability of the name, NaN for a track without one; None if the method does not name.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> method = am.GNN()
    >>> state = method.init(am.estimate_model(d).model)
    >>> state, labels, _ = method.run(state, d.part(0, 19))
    >>> state, update = method.step(state, d.times[19], d.frame(19)[1:])
    >>> tracks = update.tracks
    >>> tracks, tracks.ids[~tracks.is_seen].tolist(), tracks.positions.shape
    (TrackStates(8 tracks, 1 occluded), [0], (8, 3))
    >>> bool((tracks.existence > 0.99).all())
    True
    """

    ids: NDArray[np.int64]
    means: NDArray[np.float64]
    covariances: NDArray[np.float64]
    gaps: NDArray[np.int64]
    log_odds: NDArray[np.float64] | None = None
    names: tuple[str | None, ...] = ()
    identity_confidence: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if not self.names:
            object.__setattr__(self, "names", (None,) * len(self.ids))

    def __len__(self) -> int:
        """Return the number of tracks."""
        return len(self.ids)

    def __repr__(self) -> str:
        return f"TrackStates({len(self)} tracks, {int((self.gaps > 0).sum())} occluded)"

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions, shape (K, D), metres; predicted ones of occluded tracks."""
        return self.means[:, :, 0]

    @property
    def velocities(self) -> NDArray[np.float64] | None:
        """Velocities, shape (K, D), m/s; None for a motion without velocity, a random walk."""
        return self.means[:, :, 1] if self.means.shape[2] > 1 else None

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """Whether each track has a detection in the frame, shape (K,)."""
        return self.gaps == 0

    @property
    def existence(self) -> NDArray[np.float64] | None:
        """Existence probability of each track, shape (K,), ``1 / (1 + exp(-log_odds))``."""
        if self.log_odds is None:
            return None
        return 1 / (1 + np.exp(-np.maximum(self.log_odds, -700.0)))


def states_of(
    ids: NDArray[np.int64],
    gaps: NDArray[np.int64],
    log_odds: NDArray[np.float64] | None,
    means: NDArray[np.float64],
    covariances: NDArray[np.float64],
) -> TrackStates:
    """Return states in the order in which the engine returns them."""
    return TrackStates(
        ids=ids, means=means, covariances=covariances, gaps=gaps, log_odds=log_odds,
        names=(None,) * len(ids), identity_confidence=None,
    )  # fmt: skip
