"""What goes wrong in a recording, done to a capture whose truth is known.

Real failures come in kinds, and trackers fail on them differently: points missing here and there,
markers hidden for a while, false points anywhere, ghosts near a marker, noise, a low rate. Each is
a switch of `corrupt`. What remains is the truth of the corrupted capture.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism.errors import check_number
from asterism.model import Capture, Detections, Tracks
from asterism.simulate.episodes import episodes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.simulate.episodes import Burst, Ghosts

__all__ = ["corrupt"]


def corrupt(
    truth: Tracks,
    *,
    missing: float = 0.0,
    clutter: float = 0.0,
    noise: float = 0.0,
    burst: Burst | None = None,
    ghosts: Ghosts | None = None,
    stride: int = 1,
    margin: float = 0.3,
    keep_unnamed: bool = False,
    seed: int = 0,
) -> Tracks:
    """Corrupt a capture whose truth is known, and keep the truth of what is left.

    Each switch draws from a stream of its own, so turning one on or off leaves the others' choices
    as they were: with and without clutter, the same detections are missing.

    Parameters
    ----------
    truth : Tracks
        Who is whom. If any track has a name, the named tracks are the markers; otherwise all are.
    missing : float
        Probability that a detection is dropped, each on its own.
    clutter : float
        Expected false points a frame, as a share of the mean number of markers seen in a frame of
        the uncorrupted capture; their number is Poisson, their place uniform over its bounding box.
    noise : float
        Standard deviation of isotropic normal noise on every point of the capture, metres.
    burst : Burst, optional
        Markers hidden for a while.
    ghosts : Ghosts, optional
        Short-lived false points beside markers.
    stride : int
        Keep frames 0, `stride`, 2 `stride` …
    margin : float
        The bounding box for clutter is larger by this on every side, metres.
    keep_unnamed : bool
        Whether points that belong to no marker (clutter, and tracks without a name among named
        ones) stay, as clutter. By default they go: nobody knows whose they are, so nothing can be
        judged by them.
    seed : int
        Chooses everything that is random.

    Returns
    -------
    Tracks
        Truth of the corrupted capture: `detections` holds its points in random order within each
        frame, `labels` the marker of each, or -1 for clutter and ghosts. Every marker stays in
        `names`, seen or not. If the source was a `Capture`, so are these detections, with the same
        file and units, no channels, and rate and first frame as befits the stride; where frames
        are left out it has no format, because the rest of the file no longer goes with it.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> from asterism.simulate import corrupt, cube
    >>> corrupt(cube(), missing=0.1, clutter=0.1, noise=0.005, seed=1)
    Tracks(8 tracks, 723 detections in them, 74 clutter, 100 frames)
    """
    check_number("missing", missing, above=0, below=1, closed=True)
    for name, value in (("clutter", clutter), ("noise", noise), ("margin", margin)):
        check_number(name, value, above=0, closed=True)
    check_number("stride", stride, above=1, closed=True, integer=True)
    check_number("seed", seed, above=0, closed=True, integer=True)
    rng_missing, rng_burst, rng_noise, rng_clutter, rng_ghosts, rng_order = map(
        np.random.default_rng, np.random.SeedSequence(seed).spawn(6)
    )

    whole, names = _markers(truth, stride, keep_unnamed)
    n_frames = len(truth.detections.times[::stride])
    is_marker = whole.labels >= 0

    is_kept = ~is_marker | (rng_missing.random(len(is_marker)) >= missing)
    if burst is not None and names:
        is_hidden = np.zeros((n_frames, len(names)), dtype=bool)
        for start, stop in episodes(rng_burst, burst, n_frames):
            is_hidden[start:stop, rng_burst.integers(len(names))] = True
        is_kept[is_marker] &= ~is_hidden[whole.frames[is_marker], whole.labels[is_marker]]
    noisy = whole.points + (rng_noise.normal(0.0, noise, whole.points.shape) if noise else 0.0)

    parts = [_Points(whole.frames[is_kept], noisy[is_kept], whole.labels[is_kept])]
    if clutter and is_marker.any():
        n_false = rng_clutter.poisson(clutter * is_marker.sum() / n_frames, n_frames)
        low, high = whole.points.min(axis=0) - margin, whole.points.max(axis=0) + margin
        places = rng_clutter.uniform(low, high, (int(n_false.sum()), len(low)))
        parts.append(_false(np.repeat(np.arange(n_frames), n_false), places))
    if ghosts is not None and names:
        where = np.full((n_frames, len(names)), -1)
        where[whole.frames[is_marker], whole.labels[is_marker]] = np.flatnonzero(is_marker)
        for start, stop in episodes(rng_ghosts, ghosts, n_frames):
            beside = where[start:stop, rng_ghosts.integers(len(names))]
            beside = beside[beside >= 0]
            offset = ghosts.within * _in_unit_ball(rng_ghosts, whole.points.shape[1])
            parts.append(_false(whole.frames[beside], whole.points[beside] + offset))

    frames = np.concatenate([part.frames for part in parts])
    # One integer key sorts by frame and shuffles within it, several times faster than two keys.
    dice = rng_order.integers(2**32, size=len(frames))
    order = np.argsort((frames << 32) | dice, kind="stable")
    mixed = _Points(
        frames[order],
        np.concatenate([part.points for part in parts])[order],
        np.concatenate([part.labels for part in parts])[order],
    )
    return Tracks(
        detections=_detections(truth.detections, stride, mixed, names),
        labels=mixed.labels,
        names=names,
    )


class _Points(NamedTuple):
    """Frame (N,), position (N, D) and marker (N,) of some points."""

    frames: NDArray[np.int64]
    points: NDArray[np.float64]
    labels: NDArray[np.int64]


def _false(frames: NDArray[np.int64], points: NDArray[np.float64]) -> _Points:
    return _Points(frames, points, np.full(len(frames), -1))


def _markers(
    truth: Tracks, stride: int, keep_unnamed: bool
) -> tuple[_Points, tuple[str | None, ...]]:
    """Give the points that take part, in the frames that stay, and the names of the markers."""
    has_name = np.array([name is not None for name in truth.names], dtype=bool)
    if not has_name.any():
        has_name[:] = True
    number = np.append(np.where(has_name, np.cumsum(has_name) - 1, -1), -1)  # [-1] is clutter
    labels, frames = number[truth.labels], truth.detections.frame_of
    is_in = frames % stride == 0
    if not keep_unnamed:
        is_in &= labels >= 0
    points = _Points(frames[is_in] // stride, truth.detections.points[is_in], labels[is_in])
    return points, tuple(truth.names[i] for i in np.flatnonzero(has_name))


def _detections(
    source: Detections, stride: int, mixed: _Points, names: tuple[str | None, ...]
) -> Detections:
    """Give the points as detections that know of their file what `source` knew."""
    times = source.times[::stride]
    counts = np.bincount(mixed.frames, minlength=len(times))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    if not isinstance(source, Capture):
        return Detections(times=times, offsets=offsets, points=mixed.points)
    return replace(
        source,
        times=times,
        offsets=offsets,
        points=mixed.points,
        # The rest of the file (analog channels, events) goes by its own frames: at another rate a
        # writer must not take it over.
        format=source.format if stride == 1 else "",
        rate=source.rate / stride,
        # Frame n of a file stands for the time (n - 1) / rate.
        first_frame=(source.first_frame - 1) // stride + 1,
        channels=np.full(len(mixed.labels), -1),
        labels=mixed.labels,
        names=names,
    )


def _in_unit_ball(rng: np.random.Generator, n_axes: int) -> NDArray[np.float64]:
    direction = rng.standard_normal(n_axes)
    return direction / np.linalg.norm(direction) * rng.random() ** (1 / n_axes)
