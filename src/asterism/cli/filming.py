"""Film a capture of any length in pieces, and count its visible markers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations, Reason
from asterism.io.text_table import plain
from asterism.model import Detections
from asterism.simulate import Truth, film

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from asterism.camera import Rig
    from asterism.model import Tracks
    from asterism.simulate import Seeing

__all__ = ["Footage", "film_all", "frames_between", "names_apart"]

_MAX_FRAMES, _MAX_SAMPLES = 256, 2_000_000  # of one piece


@dataclass(frozen=True, eq=False, kw_only=True)
class Footage:
    """Image points of a whole capture, with counts of visible markers.

    Parameters
    ----------
    observations : Observations
        Image points with their true markers.
    counts : ndarray of int, shape (C, 8)
        Number of samples (a marker in a frame) of each camera by `Reason`, without absent ones.
    n_cameras : ndarray of int, shape (C + 1,)
        Number of samples that 0, 1, … C cameras see.
    """

    observations: Observations
    counts: NDArray[np.int64]
    n_cameras: NDArray[np.int64]

    @property
    def n_samples(self) -> int:
        """Number of samples: markers that are present, over all frames."""
        return int(self.n_cameras.sum())

    def share_seen_by(self, n: int) -> float:
        """Return the share of the samples that `n` cameras or more see."""
        return float(self.n_cameras[n:].sum()) / max(self.n_samples, 1)


def film_all(
    truth: Tracks,
    rig: Rig,
    advance: Callable[[int], None],
    seeing: Seeing | None = None,
    seed: int = 0,
) -> Footage:
    """Film tracks in pieces, so that memory use does not depend on their length.

    Parameters
    ----------
    truth : Tracks
        Tracks in 3-D. Clutter is not filmed.
    rig : Rig
        The cameras.
    advance : callable
        Called with the number of finished frames.
    seeing : Seeing, optional
        Noise, missing and false points of the images. By default images are ideal.
    seed : int
        Random seed of `seeing`. With `seeing` the film is one piece, so that the random numbers do
        not depend on the size of pieces.

    Returns
    -------
    Footage

    Raises
    ------
    ParameterError
        If the tracks are not 3-D.
    """
    d = truth.detections
    most = max(int(d.counts.max(initial=0)), 1) * len(rig)
    step = int(np.clip(_MAX_SAMPLES // most, 1, _MAX_FRAMES))
    if seeing is not None:
        step = max(d.n_frames, 1)
    counts = np.zeros((len(rig), len(Reason)), dtype=np.int64)
    n_cameras = np.zeros(len(rig) + 1, dtype=np.int64)
    cells: list[NDArray[np.int64]] = []
    pixels: list[NDArray[np.float64]] = [np.empty((0, 2))]
    markers: list[NDArray[np.int64]] = [np.empty(0, np.int64)]
    for begin in range(0, d.n_frames, step):
        end = min(begin + step, d.n_frames)
        numbers, piece = _piece(truth, begin, end)
        shot = film(piece, rig, seeing=seeing, seed=seed)
        seen = shot.observations
        assert seen.markers is not None
        cells.append(np.diff(seen.offsets))
        pixels.append(seen.pixels)
        markers.append(np.append(numbers, -1)[seen.markers])
        is_there = shot.projection.reason != Reason.ABSENT
        for reason in Reason:
            if reason != Reason.ABSENT:
                counts[:, reason] += (shot.projection.reason == reason).sum(axis=(1, 2))
        by_sample = shot.projection.visible.sum(axis=0)[is_there[0]]
        n_cameras += np.bincount(by_sample, minlength=len(n_cameras))
        advance(end)
    return Footage(
        observations=Observations(
            times=d.times,
            cameras=rig.names,
            offsets=np.cumsum(np.concatenate([[0], *cells])).astype(np.int64),
            pixels=np.concatenate(pixels),
            markers=np.concatenate(markers),
            marker_names=names_apart(truth.names),
        ),
        counts=counts,
        n_cameras=n_cameras,
    )


def _piece(truth: Tracks, begin: int, end: int) -> tuple[NDArray[np.int64], Tracks]:
    """Return a range of frames: the numbers of its tracks, and these tracks."""
    d = truth.detections
    offsets = d.offsets[begin : end + 1]
    rows = slice(int(offsets[0]), int(offsets[-1]))
    labels = truth.labels[rows].copy()
    is_track = labels >= 0
    numbers, labels[is_track] = np.unique(labels[is_track], return_inverse=True)
    cut = Detections(times=d.times[begin:end], offsets=offsets - offsets[0], points=d.points[rows])
    surfaces = truth.surfaces if isinstance(truth, Truth) else ()
    frames = np.arange(begin, end)
    piece = Truth(
        detections=cut,
        labels=labels,
        names=(None,) * len(numbers),
        surfaces=tuple(s.during(frames) for s in surfaces),
    )
    return numbers, piece


def names_apart(names: Sequence[str | None]) -> tuple[str, ...]:
    """Return a unique name for each track that a table can hold: ``T007`` without a name."""
    width = max(3, len(str(len(names) - 1)))
    taken = {name for name in names if name}
    found: dict[str, None] = {}
    for k, name in enumerate(names):
        base = plain(name or "").strip() or f"T{k:0{width}d}"
        chosen, n = base, 1
        while chosen in found or (chosen in taken and chosen != name):
            n += 1
            chosen = f"{base} ({n})"
        found[chosen] = None
    return tuple(found)


def frames_between(n_frames: int, n: int) -> list[int]:
    """Return up to `n` different frames, evenly spaced from the first to the last."""
    if not n_frames or not n:
        return []
    if n == 1:
        return [n_frames // 2]
    return np.unique(np.linspace(0, n_frames - 1, n).round().astype(int)).tolist()
