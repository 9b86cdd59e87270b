"""States of the tracks of a whole capture, frame by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.filter import States, smooth_states
from asterism.model import TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation import model_of
from asterism.tracking.methods import TrackStates

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["TrackHistory", "track_states"]


@record(eq=False)
class TrackHistory:
    """Smoothed states of tracks, from the first detection of each to its last, gaps included.

    Parameters
    ----------
    tracks : Tracks
        The tracks.
    states : States
        Their smoothed states.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> history = am.tracking.track_states(truth, model=am.estimate_model(truth.detections).model)
    >>> history, history.velocities.shape
    (TrackHistory(8 tracks, 20 frames), (20, 8, 3))
    """

    tracks: Tracks
    states: States

    def __repr__(self) -> str:
        return (
            f"TrackHistory({self.tracks.n_tracks} tracks, {self.tracks.detections.n_frames} frames)"
        )

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions, shape (T, K, D), metres; NaN before a track and after it."""
        return self._dense(0)

    @property
    def velocities(self) -> NDArray[np.float64] | None:
        """Velocities, shape (T, K, D), m/s; None for a motion without velocity."""
        return self._dense(1) if self.states.means.shape[2] > 1 else None

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """Whether each track has a detection in each frame, shape (T, K)."""
        d = self.tracks.detections
        seen = np.zeros((d.n_frames, self.tracks.n_tracks), dtype=bool)
        own = self.tracks.labels >= 0
        seen[d.frame_of[own], self.tracks.labels[own]] = True
        return seen

    def at(self, frame: int) -> TrackStates:
        """Return the states in one frame, of the tracks that span it.

        Parameters
        ----------
        frame : int
            Number of the frame, counted from the end if negative.

        Returns
        -------
        TrackStates
            As the steps of a stream return it, with later detections used as well. The confidence
            of identities is that of the detection in the frame, NaN without one; existence is None.

        Raises
        ------
        IndexError
            If there is no such frame.

        Examples
        --------
        >>> import asterism as am
        >>> tracks = am.track(am.simulate.cube(frames=20, seed=1).detections)
        >>> am.tracking.track_states(tracks).at(7)
        TrackStates(8 tracks, 0 occluded)
        """
        d = self.tracks.detections
        t = range(d.n_frames)[frame]
        states = self.states
        lengths = np.diff(states.offsets)
        first = states.first_frames
        ids = np.flatnonzero((first <= t) & (t < first + lengths))
        rows = states.offsets[ids] + t - first[ids]
        now = slice(d.offsets[t], d.offsets[t + 1])
        labels, sure = self.tracks.labels[now], self.tracks.identity_confidence
        order, offsets = self.tracks.by_track
        frames = d.frame_of[order]
        ends = [offsets[k] + np.searchsorted(frames[offsets[k] : offsets[k + 1]], t, "right")
                for k in ids]  # fmt: skip
        gaps = np.array([t - frames[end - 1] for end in ends], dtype=np.int64)
        confidence = None
        if sure is not None:
            confidence = np.full(self.tracks.n_tracks, np.nan)
            confidence[labels[labels >= 0]] = sure[now][labels >= 0]
            confidence = confidence[ids]
        return TrackStates(
            ids=ids, means=states.means[rows], covariances=states.covariances[rows], gaps=gaps,
            names=tuple(self.tracks.names[k] for k in ids), identity_confidence=confidence,
        )  # fmt: skip

    def _dense(self, state: int) -> NDArray[np.float64]:
        states, d = self.states, self.tracks.detections
        dense = np.full((d.n_frames, self.tracks.n_tracks, d.n_axes), np.nan)
        track = np.repeat(np.arange(self.tracks.n_tracks), np.diff(states.offsets))
        row = np.arange(len(states.means))
        frame = states.first_frames[track] + row - states.offsets[track]
        dense[frame, track] = states.means[:, :, state]
        return dense


def track_states(tracks: Tracks, *, model: TrackingModel | None = None) -> TrackHistory:
    """Estimate position, velocity and covariance of every track in every frame of a capture.

    Parameters
    ----------
    tracks : Tracks
        Tracks, smoothed by the whole capture (`smooth_states`).
    model : TrackingModel, optional
        Model whose motion and noise are used; that of the tracks' recipe by default.

    Returns
    -------
    TrackHistory

    Raises
    ------
    ParameterError
        If there is no model, neither given nor in a recipe.

    Examples
    --------
    >>> import asterism as am
    >>> tracks = am.track(am.simulate.cube(frames=20, seed=1).detections)
    >>> history = am.tracking.track_states(tracks)
    >>> history.at(10).velocities.shape
    (8, 3)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    if model is None:
        if tracks.recipe is None:
            hint = "pass am.estimate_model(tracks.detections).model"
            raise ParameterError("model", "a model, as the tracks have no recipe", "none", hint)
        model = model_of(tracks, tracks.recipe)
    return TrackHistory(tracks=tracks, states=smooth_states(tracks, model))
