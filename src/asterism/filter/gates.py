"""Groups of tracks and detections that compete, because gates link them, frame by frame.

Symbols: D axes, ŷ the predicted position of a track, S its innovation covariance on each axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.filter.kalman import filter_states
from asterism.model.compiled import steps_of
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks

__all__ = ["GateGroups", "gate_groups"]


@record(eq=False)
class GateGroups:
    """Result of `gate_groups`: G groups, in the order of their frames.

    Attributes
    ----------
    times : ndarray of shape (T,)
        Times of the frames, seconds.
    frames : ndarray of int, shape (G,)
        Frame of each group.
    n_tracks, n_detections : ndarray of int, shape (G,)
        Numbers of tracks and detections in each group. A track without a detection in its gate is
        a group of its own; detections outside all gates belong to no group.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> groups = gate_groups(truth, am.estimate_model(truth.detections).model)
    >>> groups
    GateGroups(150 groups in 20 frames, the largest of 2 tracks)
    >>> groups.largest.tolist()[:3]
    [0, 2, 1]
    """

    times: NDArray[np.float64]
    frames: NDArray[np.int64]
    n_tracks: NDArray[np.int64]
    n_detections: NDArray[np.int64]

    def __repr__(self) -> str:
        return (
            f"GateGroups({len(self.frames)} groups in {len(self.times)} frames, the largest of "
            f"{int(self.n_tracks.max(initial=0))} tracks)"
        )

    @property
    def largest(self) -> NDArray[np.int64]:
        """Number of tracks in the largest group of each frame, shape (T,); 0 if there is none."""
        found = np.zeros(len(self.times), dtype=np.int64)
        np.maximum.at(found, self.frames, self.n_tracks)
        return found


def gate_groups(
    tracks: Tracks, model: TrackingModel, *, gate_probability: float = 1e-9
) -> GateGroups:
    """Group the tracks and detections of each frame that are linked by gates.

    The gate of a track holds the detections with ``(y - ŷ)ᵀ (y - ŷ) / S < γ``, predicted from the
    track's detections before that frame. With several motions it is the union of their gates.
    Association can be solved in each group alone, because groups share no track or detection.

    Parameters
    ----------
    tracks : Tracks
        Tracks to predict, each from the frame after its first detection to that of its last.
    model : TrackingModel
        Model whose motion and noise are used.
    gate_probability : float
        Probability that a gate misses the detection of its own track, in (0, 1); it sets γ.
        Smaller values make larger gates and groups. The default is that of the methods.

    Returns
    -------
    GateGroups
        Number of tracks and detections in each group.

    Raises
    ------
    ParameterError
        If the probability is not between 0 and 1.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> groups = gate_groups(truth, am.estimate_model(truth.detections).model)
    >>> int(groups.largest.max())  # at most so many tracks compete for detections
    2
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.special import chdtri

    check_number("gate_probability", gate_probability, above=0, below=1)
    states = filter_states(tracks, model)
    d = tracks.detections
    gate = float(chdtri(d.n_axes, gate_probability))
    h = model.motion.modes[0].observation
    noise = model.sensor.noise_sigma**2
    kind, F, Q = steps_of(model.motion, d.times)
    lengths = np.diff(states.offsets)
    ends = states.offsets[1:][lengths > 0] - 1
    goes_on = np.ones(len(states.means), dtype=bool)
    goes_on[ends] = False
    rows = np.flatnonzero(goes_on)  # each predicts its track into the next frame
    place = np.arange(len(states.means)) - np.repeat(states.offsets[:-1], lengths)
    frame = (np.repeat(states.first_frames, lengths) + place)[rows] + 1
    by_frame = np.argsort(frame, kind="stable")
    begins = np.searchsorted(frame[by_frame], np.arange(d.n_frames + 1))
    ours: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    theirs: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    for t in range(d.n_frames):
        here = by_frame[begins[t] : begins[t + 1]]
        points = d.points[d.offsets[t] : d.offsets[t + 1]]
        if not len(here) or not len(points):
            continue
        means, P = states.means[rows[here]], states.covariances[rows[here]]
        is_in = np.zeros((len(here), len(points)), dtype=bool)
        for F_m, Q_m in zip(F[kind[t]], Q[kind[t]], strict=True):
            predicted = means @ F_m.T @ h
            S = h @ (F_m @ P @ F_m.T + Q_m) @ h + noise
            away = ((points[None] - predicted[:, None]) ** 2).sum(axis=2)
            is_in |= away < gate * S[:, None]
        i, j = np.nonzero(is_in)
        ours.append(here[i])
        theirs.append(len(rows) + d.offsets[t] + j)
    a, b = np.concatenate(ours), np.concatenate(theirs)
    n = len(rows) + d.n_points
    links = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
    n_groups, group = connected_components(links, directed=False)
    n_tracks = np.bincount(group[: len(rows)], minlength=n_groups)
    n_detections = np.bincount(group[len(rows) :], minlength=n_groups)
    frame_of = np.zeros(n_groups, dtype=np.int64)
    frame_of[group[: len(rows)]] = frame
    kept = np.flatnonzero(n_tracks)
    kept = kept[np.argsort(frame_of[kept], kind="stable")]
    return GateGroups(
        times=d.times,
        frames=frame_of[kept],
        n_tracks=n_tracks[kept],
        n_detections=n_detections[kept],
    )
