"""The current tracks of a large scene, as plain arrays with one entry for each track."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["LiveTracks"]


@record(eq=False)
class LiveTracks:
    """Confirmed and tentative tracks after a frame, ordered by their keys.

    Attributes
    ----------
    keys : ndarray of int64, shape (K,)
        Number of each track in order of initiation, increasing.
    ids : ndarray of int64, shape (K,)
        Label in order of confirmation, -1 while the track is tentative.
    firsts : ndarray of int64, shape (K,)
        Frame of the first detection.
    states : ndarray of shape (K, width)
        Means and covariances, packed by the engine.
    last : ndarray of shape (K, D)
        Position of the last detection, metres.
    last_times, scores, best_scores : ndarray of shape (K,)
        Its time, seconds; log odds of marker against clutter, now and at their maximum.
    gaps : ndarray of int32, shape (K,)
        Frames since the last detection.

    Examples
    --------
    >>> LiveTracks.none(n_axes=3, width=10)
    LiveTracks(0 confirmed, 0 tentative)
    """

    keys: NDArray[np.int64]
    ids: NDArray[np.int64]
    firsts: NDArray[np.int64]
    states: NDArray[np.float64]
    last: NDArray[np.float64]
    last_times: NDArray[np.float64]
    scores: NDArray[np.float64]
    best_scores: NDArray[np.float64]
    gaps: NDArray[np.int32]

    @classmethod
    def none(cls, *, n_axes: int, width: int) -> LiveTracks:
        """Return no tracks.

        Parameters
        ----------
        n_axes : int
            Number of coordinates D, 2 or 3.
        width : int
            Numbers of a packed state.
        """
        whole, some = np.zeros(0, np.int64), np.zeros(0)
        return cls(
            keys=whole, ids=whole, firsts=whole, states=np.zeros((0, width)),
            last=np.zeros((0, n_axes)), last_times=some, scores=some, best_scores=some,
            gaps=np.zeros(0, np.int32),
        )  # fmt: skip

    @property
    def is_confirmed(self) -> NDArray[np.bool_]:
        """Whether each track is confirmed, shape (K,)."""
        return self.ids >= 0

    def keep(self, is_kept: NDArray[np.bool_]) -> LiveTracks:
        """Return the tracks for which `is_kept` (K,) holds."""
        if is_kept.all():
            return self
        return LiveTracks(**{f.name: getattr(self, f.name)[is_kept] for f in fields(self)})

    def and_also(self, more: LiveTracks) -> LiveTracks:
        """Return these tracks and further ones, whose keys are larger."""
        return LiveTracks(
            **{
                f.name: np.concatenate([getattr(self, f.name), getattr(more, f.name)])
                for f in fields(self)
            }
        )

    def __len__(self) -> int:
        return len(self.keys)

    def __repr__(self) -> str:
        n = int(self.is_confirmed.sum())
        return f"LiveTracks({n} confirmed, {len(self) - n} tentative)"
