"""Whether the markers of a capture accelerate together, and how strongly.

The evidence is of frames that were left out. Shared accelerations are learnt in every other block
of frames, and the densities of the detections in the blocks between are compared with those by own
motion. Both are mixtures with learnt weights, so that the gain is that of the neighbours alone, and
not that of a better fit to the own motion. The size is that of all tracks with rigid neighbours.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Tracks
from asterism.model.shared_acceleration import N_OWN, shared_densities, shared_gains
from asterism.records import record
from asterism.tracking import learn_bonds, learn_shared_acceleration, shared_size
from asterism.tracking.estimation import fit_body_motion
from asterism.tracking.estimation.sampling import Runs
from asterism.tracking.rigidity.distances import MIN_TOGETHER
from asterism.tracking.rigidity.shared import fitted_weights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Capture, Detections, SharedAcceleration, TrackingModel

__all__ = ["SharedEvidence", "capture_evidence", "found_tracks", "shared_evidence"]

MAX_TRACKS = 120
"""Number of the longest tracks that are compared."""
N_BLOCKS, MIN_BLOCKS = 20, 8
"""Number of blocks, half of which are left out, and the smallest. Fewer blocks do not give the
standard error of the gain."""
MAX_BLOCK, MIN_BLOCK = 30, 10
"""Number of frames in a block."""
MAX_POINTS = 20_000
"""Number of detections in all blocks, about, which bounds the time to half a second."""
FIND_POINTS = 100_000
"""Number of detections, about, in which the tracks of an unlabelled capture are found."""
MIN_GAIN = 0.03
"""Smallest gain that counts, nats per detection. Independent drones that gather and part gain up to
0.02 with noise of 1 mm, because those near each other brake alike."""
KNOWN = 2
"""Number of detections of a track in a block that are known before the first that is compared."""


@record
class SharedEvidence:
    """Size of the acceleration that markers have in common, and the evidence for it.

    Parameters
    ----------
    size, std : float
        Standard deviation of the common acceleration, as the σ of `DWNA`, m/s², and its standard
        error; 0 and NaN if there is none.
    n_tracks : int
        Number of tracks with rigid neighbours; 0 without a common acceleration.
    gain, gain_std : float
        Increase of the log density of a detection by its neighbours, on frames left out, and its
        standard error, nats per detection.
    """

    size: float
    std: float
    n_tracks: int
    gain: float
    gain_std: float

    @property
    def value(self) -> str:
        """The size in words."""
        if not self.size:
            return "nothing in common"
        return f"{self.size:.3g} ± {self.std:.1g} m/s², of {self.n_tracks} tracks"

    @property
    def why(self) -> str:
        """The evidence in words."""
        if not self.size:
            return "neighbours do not predict frames left out better than own motion"
        gain = f"{self.gain:.2g} ± {self.gain_std:.1g} nats"
        return f"on frames left out, neighbours gain {gain} per detection"

    def rows(self) -> list[tuple[str, str]]:
        """Return the row of a printed table."""
        return [("shared acceleration", f"{self.value}; {self.why}" if self.size else self.value)]


def shared_evidence(tracks: Tracks, model: TrackingModel) -> SharedEvidence | None:
    """Measure how strongly markers accelerate together, by frames that were left out.

    Parameters
    ----------
    tracks : Tracks
        Tracks, most of whose identities are right.
    model : TrackingModel
        Model of their own motion.

    Returns
    -------
    SharedEvidence or None
        None with fewer than two tracks, or in captures that are too short for bonds. The size is 0
        if the gain does not exceed its standard error and `MIN_GAIN`.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=200, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> shared_evidence(truth, model).value
    '7.23 ± 0.6 m/s², of 53 tracks'
    >>> truth = am.simulate.swarm(frames=200, seed=1)  # independent markers
    >>> shared_evidence(truth, am.estimate_model(truth.detections).model).value
    'nothing in common'
    """
    tracks = _longest(tracks.measured())
    blocks = _blocks(tracks)
    if tracks.n_tracks < 2 or len(blocks) < MIN_BLOCKS:
        return None
    learnt, _ = _joined(tracks, blocks[::2], is_one=True)
    shared = learn_shared_acceleration(learnt, model)
    left_out, block = _joined(tracks, blocks[1::2], is_one=False)
    gains = _gains_by_neighbours(learnt, left_out, model, shared)
    order, offsets = left_out.by_track
    rank = np.arange(len(order)) - offsets[left_out.labels[order]]
    compared = order[rank >= KNOWN]
    gain, gain_std = _mean(gains[compared], block[compared])
    if not gain > max(gain_std, MIN_GAIN):
        return SharedEvidence(size=0.0, std=np.nan, n_tracks=0, gain=gain, gain_std=gain_std)
    bonds = learn_bonds(tracks)
    pairs = bonds.pairs[bonds.rigid]
    size, std = shared_size(tracks, *pairs.T)
    n_tracks = len(np.unique(pairs)) if size else 0
    return SharedEvidence(size=size, std=std, n_tracks=n_tracks, gain=gain, gain_std=gain_std)


def capture_evidence(capture: Capture, model: TrackingModel) -> SharedEvidence | None:
    """Measure how strongly the markers of a capture accelerate together.

    Parameters
    ----------
    capture : Capture
        Capture, of which the tracks of the file are used. Without any they are found.
    model : TrackingModel
        Estimated model.

    Returns
    -------
    SharedEvidence or None
        As of `shared_evidence`.
    """
    found = capture.tracks if capture.tracks.n_tracks else found_tracks(capture, model)
    return None if found is None else shared_evidence(found, model)


def found_tracks(detections: Detections, model: TrackingModel) -> Tracks | None:
    """Find the tracks of unlabelled detections by their bonds, in the middle of a long capture.

    Parameters
    ----------
    detections : Detections
        Capture.
    model : TrackingModel
        Estimated model.

    Returns
    -------
    Tracks or None
        None for random walks, and for captures that are too short for `shared_evidence`.
    """
    d = detections.measured()
    T = d.n_frames
    n_frames = min(T, T * FIND_POINTS // max(d.n_points, 1))
    if n_frames < MIN_BLOCKS * MIN_BLOCK:
        return None
    first = (T - n_frames) // 2
    fitted = fit_body_motion(d.part(first, first + n_frames), model)
    return None if fitted is None else fitted[1]


def _longest(tracks: Tracks) -> Tracks:
    """Return the longest tracks, without their names: bonds are learnt of all."""
    order = np.argsort(-tracks.lengths, kind="stable")[:MAX_TRACKS]
    chosen = tracks.select(order[tracks.lengths[order] >= MIN_TOGETHER].tolist())
    return dataclasses.replace(chosen, names=(None,) * chosen.n_tracks)


def _blocks(tracks: Tracks) -> list[tuple[int, int]]:
    """Return the first frame of evenly spread blocks and the frame after their last."""
    T = tracks.detections.n_frames
    n_frames = min(T, T * MAX_POINTS // max(tracks.detections.n_points, 1))
    length = min(max(n_frames // N_BLOCKS, MIN_BLOCK), MAX_BLOCK)
    n = min(n_frames // length, N_BLOCKS) // 2 * 2
    starts = np.arange(n) * (T - length) // max(n - 1, 1)
    return [(first, first + length) for first in starts.tolist()]


def _joined(
    tracks: Tracks, blocks: list[tuple[int, int]], *, is_one: bool
) -> tuple[Tracks, NDArray[np.int64]]:
    """Join blocks of frames, and return their tracks and the block of each detection.

    With `is_one` a track goes on from block to block; else it is another one in each block: track
    ``k + b * K`` is track k in block b.
    """
    K = tracks.n_tracks
    parts = [tracks.part(first, end) for first, end in blocks]
    joined = Runs(pieces=[part.detections for part in parts]).joined
    labels = np.concatenate([part.labels for part in parts])
    block = np.repeat(np.arange(len(parts)), [len(part.labels) for part in parts])
    if not is_one:
        labels = labels + K * block
    names = (None,) * (K if is_one else K * len(parts))
    return Tracks(detections=joined, labels=labels, names=names), block


def _gains_by_neighbours(
    learnt: Tracks, left_out: Tracks, model: TrackingModel, shared: SharedAcceleration
) -> NDArray[np.float64]:
    """Return what neighbours add to the log density of each detection that was left out, nats."""
    densities, _ = shared_densities(learnt, model, shared)
    densities[:, N_OWN:] = -np.inf
    K = learnt.n_tracks
    own = dataclasses.replace(shared, weights=fitted_weights(densities, learnt.labels, K))
    markers = np.arange(left_out.n_tracks) % K
    with_neighbours = shared_gains(left_out, model, shared, markers)
    return with_neighbours - shared_gains(left_out, model, own, markers)


def _mean(values: NDArray[np.float64], block: NDArray[np.int64]) -> tuple[float, float]:
    """Return the mean of values, and its standard error by the differences between blocks."""
    counts, sums = np.bincount(block), np.bincount(block, values)
    counts, sums = counts[counts > 0], sums[counts > 0]
    k = len(counts)
    if k < 2:
        return 0.0, np.nan
    mean = sums.sum() / counts.sum()
    std = np.sqrt(k / (k - 1) * ((sums - mean * counts) ** 2).sum()) / counts.sum()
    return float(mean), float(std)
