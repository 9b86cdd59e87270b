"""Filming a capture of any length piece by piece, and counting what is seen."""

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

_MOST_FRAMES, _MOST_SAMPLES = 256, 2_000_000  # of one piece


@dataclass(frozen=True, eq=False, kw_only=True)
class Footage:
    """What a rig made of a whole capture.

    Parameters
    ----------
    observations : Observations
        The image points, with the truth.
    counts : ndarray of int, shape (C, 8)
        Samples (a marker in a frame) of each camera by `Reason`; those that are absent are none.
    n_cameras : ndarray of int, shape (C + 1,)
        How many samples so many cameras see.
    """

    observations: Observations
    counts: NDArray[np.int64]
    n_cameras: NDArray[np.int64]

    @property
    def n_samples(self) -> int:
        """Number of samples that there were to film."""
        return int(self.n_cameras.sum())

    def share_seen_by(self, least: int) -> float:
        """Share of the samples that `least` cameras or more see."""
        return float(self.n_cameras[least:].sum()) / max(self.n_samples, 1)


def film_all(
    truth: Tracks,
    rig: Rig,
    advance: Callable[[int], None],
    seeing: Seeing | None = None,
    seed: int = 0,
) -> Footage:
    """Film tracks in pieces, so that the memory does not depend on their length.

    Parameters
    ----------
    truth : Tracks
        3-D. Clutter is not filmed.
    rig : Rig
        The cameras.
    advance : callable
        Told the number of frames that are done.
    seeing : Seeing, optional
        What the cameras make of the markers; ideal by default.
    seed : int
        Chooses what is random in that. With `seeing` the film is one piece, as all that is random
        belongs to the whole.

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
    step = int(np.clip(_MOST_SAMPLES // most, 1, _MOST_FRAMES))
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
    """Cut some frames out: the numbers of the tracks that are there, and these alone."""
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
    """Give every track a name of its own that a table can hold: ``T007`` where it has none."""
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
    """Give up to `n` different frames, spread evenly from the first to the last."""
    if not n_frames or not n:
        return []
    if n == 1:
        return [n_frames // 2]
    return np.unique(np.linspace(0, n_frames - 1, n).round().astype(int)).tolist()
