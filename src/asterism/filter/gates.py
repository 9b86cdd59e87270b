"""Which tracks compete: groups of tracks and detections that gates link, frame by frame.

Symbols: D axes, ŷ where a track is foreseen, S its covariance on each axis.
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
    """What `gate_groups` found: G groups, in the order of their frames.

    Attributes
    ----------
    times : ndarray, shape (T,)
        Of the frames, seconds.
    frames : ndarray of int, shape (G,)
        Frame of each group.
    n_tracks, n_detections : ndarray of int, shape (G,)
        Its size. A track without a detection in its gate is a group of its own; detections that no
        track reaches are in none.
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
        """Tracks in the largest group of each frame, shape (T,); 0 where there is none."""
        found = np.zeros(len(self.times), dtype=np.int64)
        np.maximum.at(found, self.frames, self.n_tracks)
        return found


def gate_groups(
    tracks: Tracks, model: TrackingModel, *, gate_probability: float = 1e-9
) -> GateGroups:
    """Group the tracks and detections of each frame that gates link, directly or through others.

    A track reaches the detections within its gate ``(y - ŷ)ᵀ (y - ŷ) / S < γ``, where it is
    foreseen from its own detections before that frame; with several motions, within the gate of any
    of them. Groups are independent: what belongs to whom can be decided in each alone.

    Parameters
    ----------
    tracks : Tracks
        Who is foreseen: each from the frame after its first detection to that of its last.
    model : TrackingModel
        Its motion and its noise are used.
    gate_probability : float
        Probability that a gate misses the detection of its own track; gives γ.

    Returns
    -------
    GateGroups

    Raises
    ------
    ParameterError
        If the probability is not between 0 and 1.
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
    rows = np.flatnonzero(goes_on)  # each foresees its track in the frame after its own
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
            foreseen = means @ F_m.T @ h
            S = h @ (F_m @ P @ F_m.T + Q_m) @ h + noise
            away = ((points[None] - foreseen[:, None]) ** 2).sum(axis=2)
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
