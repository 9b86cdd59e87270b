"""Gaps of tracks filled: where a marker was while nobody saw it, and how sure that is.

Three estimators (`estimates.py`) are tried where the truth is known, on stretches
of the same take in which as much is hidden on purpose; their errors there decide how they are
weighed, and how far the fill may be off.

What this file is not: a guess of what came before a track, or after it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.model import TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation import estimate_model
from asterism.tracking.filling.estimates import Take, estimate
from asterism.tracking.filling.scores import Fill, settle
from asterism.tracking.filling.spans import Span, find_gaps

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from asterism.tracking.filling.estimates import Estimates

__all__ = ["ESTIMATORS", "FilledGap", "Filling", "fill_gaps"]

ESTIMATORS = ("smoother", "body", "pattern")


@record
class FilledGap:
    """A gap of a track, and what was made of it.

    Parameters
    ----------
    track : int
        The track.
    first, last : int
        Frames that are missing, the first and the last.
    seconds : float
        From the detection before to the one after.
    weights : mapping of str to float
        What each estimator counted for, adding to 1; empty where the gap was left.
    rms : mapping of str to float
        How far each estimator was off where as much was hidden on purpose: root of the mean square
        distance, metres. Empty where the take is too short to tell.
    n_windows : int
        Stretches, none overlapping another, that this was measured on; 0 where the take is too
        short. Then the estimator that is surest of itself was taken, at its word.
    std : float
        Largest standard deviation of a coordinate, metres; NaN where the gap was left.
    n_neighbours : int
        Markers of the body that carried it.
    reason : str
        Why the gap was left, "" where it was filled.
    """

    track: int
    first: int
    last: int
    seconds: float
    weights: Mapping[str, float]
    rms: Mapping[str, float]
    n_windows: int
    std: float
    n_neighbours: int
    reason: str

    @property
    def is_filled(self) -> bool:
        """Whether it was filled."""
        return not self.reason

    @property
    def estimator(self) -> str:
        """The estimator that counted for most, "" where the gap was left."""
        return max(self.weights, key=lambda name: self.weights[name], default="")

    def __len__(self) -> int:
        return self.last - self.first + 1


@record(eq=False)
class Filling:
    """Tracks with their gaps filled.

    Parameters
    ----------
    tracks : Tracks
        Over what was measured, unchanged, and what was filled: flagged in ``detections.filled``,
        with ``detections.stds``.
    gaps : tuple of FilledGap
        Every gap, by track and time, those that were left too.
    """

    tracks: Tracks
    gaps: tuple[FilledGap, ...]

    @property
    def n_filled(self) -> int:
        """Number of gaps that were filled."""
        return sum(gap.is_filled for gap in self.gaps)

    def __repr__(self) -> str:
        n = sum(len(gap) for gap in self.gaps if gap.is_filled)
        return f"Filling({self.n_filled} of {len(self.gaps)} gaps, {n} points)"


def fill_gaps(
    tracks: Tracks,
    *,
    model: TrackingModel | None = None,
    longest: float = 1.0,
    progress: Callable[[int], Any] | None = None,
) -> Filling:
    """Fill the gaps of tracks from their own motion, the body they sit on, and all that is seen.

    *smoother*: the motion of the model through the gap (Rauch-Tung-Striebel). *body*: neighbours
    that keep their distance are fitted rigidly in every frame [1]_ and carry the marker along.
    *pattern*: within that body, ridge regression on the places of up to 14 markers, learnt where
    all were seen [2]_ [3]_. What the last two miss at the ends of the gap is carried through it by
    a Gaussian process, so that a fill meets its ends without a kink.

    Stretches of the take in which the marker and the same helpers were seen are hidden on purpose.
    The mean of the three that has the least error there fills the gap, and that error, frame by
    frame from end to end, is its standard deviation: larger where the three disagree more than in
    the stretches.

    Parameters
    ----------
    tracks : Tracks
        Points that were filled before are left out first, and filled anew.
    model : TrackingModel, optional
        Its motion and its noise are used; estimated from the detections where none is given.
    longest : float
        Longer gaps are left, seconds from the detection before to the one after.
    progress : callable, optional
        Called with the number of gaps done.

    Returns
    -------
    Filling

    Raises
    ------
    ParameterError
        If an argument is out of range, or a model is needed and cannot be estimated.

    References
    ----------
    .. [1] Horn, Closed-form solution of absolute orientation using unit quaternions, 1987.
    .. [2] Gløersen & Federolf, Predicting missing marker trajectories in human motion data using
       marker intercorrelations, PLoS ONE 11(3), 2016.
    .. [3] Liu & McMillan, Estimation of missing markers in human motion capture, 2006.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1)
    >>> hidden = am.simulate.corrupt(truth, burst=am.simulate.Burst(), seed=1)
    >>> filling = am.fill_gaps(hidden, longest=0.5)
    >>> filling  # doctest: +ELLIPSIS
    Filling(... of ... gaps, ... points)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    if model is not None:
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    check_number("longest", longest, above=0, below=1e9)
    tracks = tracks.measured()
    d = tracks.detections
    positions = tracks.positions()
    spans = find_gaps(np.isfinite(positions[..., 0]))
    # To the nanosecond: times such as k / 120 differ in their last bits.
    seconds = [round(float(d.times[s.last + 1] - d.times[s.first - 1]), 9) for s in spans]
    is_short = [value <= longest for value in seconds]
    if model is None and any(is_short):
        model = estimate_model(d).model
    take = None if model is None else Take(times=d.times, positions=positions, model=model)
    gaps: list[FilledGap] = []
    fills: list[tuple[Span, Fill]] = []
    for n, (span, length) in enumerate(zip(spans, seconds, strict=True), start=1):
        if take is None or length > longest:
            gaps.append(_gap(span, length, None, f"longer than {longest:g} s"))
        else:
            found = estimate(take, span)
            fills.append((span, settle(found)))
            gaps.append(_gap(span, length, (found, fills[-1][1]), ""))
        if progress is not None:
            progress(n)
    return Filling(tracks=_with(tracks, fills), gaps=tuple(gaps))


def _gap(span: Span, seconds: float, made: tuple[Estimates, Fill] | None, reason: str) -> FilledGap:
    """Say what was made of a gap."""
    weights: dict[str, float] = {}
    rms: dict[str, float] = {}
    if made is not None:
        names = [one.name for one in made[0].each]
        weights = dict(zip(names, made[1].weights.tolist(), strict=True))
        if made[1].n_windows:
            rms = dict(zip(names, made[1].rms.tolist(), strict=True))
    return FilledGap(
        track=span.track,
        first=span.first,
        last=span.last,
        seconds=seconds,
        weights=weights,
        rms=rms,
        n_windows=0 if made is None else made[1].n_windows,
        std=np.nan if made is None else float(made[1].stds.max()),
        n_neighbours=0 if made is None else made[0].n_neighbours,
        reason=reason,
    )


def _with(tracks: Tracks, fills: Sequence[tuple[Span, Fill]]) -> Tracks:
    """Add filled points to tracks, in each frame after those that were measured."""
    if not fills:
        return tracks
    d = tracks.detections
    D, n = d.n_axes, d.n_points
    frames = np.concatenate([span.hidden for span, _ in fills])
    labels = np.repeat([span.track for span, _ in fills], [span.length for span, _ in fills])
    before, after = _ends(tracks, fills)
    stds = np.concatenate([made.stds for _, made in fills])
    new: dict[str, Any] = {
        "points": np.concatenate([made.points for _, made in fills]).reshape(-1, D),
        "filled": np.ones(len(frames), dtype=bool),
        "stds": stds,
        "covariances": stds[:, None, None] ** 2 * np.eye(D),
        "cameras": np.zeros(len(frames), dtype=np.int64),
        "residuals": np.zeros(len(frames)),
        "channels": np.full(len(frames), -1),
    }
    old: dict[str, Any] = {
        name: getattr(d, name) for name in d.PER_POINT if getattr(d, name) is not None
    }
    old = {"filled": np.zeros(n, dtype=bool), "stds": np.zeros(n)} | old
    if "labels" in old:
        # What the file itself calls the marker, if it does so on both sides.
        own = old["labels"]
        new["labels"] = np.where(own[before] == own[after], own[before], -1)
    order = np.argsort(np.concatenate([d.frame_of, frames]), kind="stable")
    counts = d.counts + np.bincount(frames, minlength=d.n_frames)
    detections = replace(
        d,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        **{name: np.concatenate([values, new[name]])[order] for name, values in old.items()},
    )
    confidence = tracks.confidence
    if confidence is not None:
        surest = np.minimum(confidence[before], confidence[after])
        confidence = np.concatenate([confidence, surest])[order]
    return replace(
        tracks,
        detections=detections,
        labels=np.concatenate([tracks.labels, labels])[order],
        confidence=confidence,
    )


def _ends(
    tracks: Tracks, fills: Sequence[tuple[Span, Fill]]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the detections at both ends of the gap, for every filled point."""
    order, offsets = tracks.by_track
    frame_of = tracks.detections.frame_of
    before: list[int] = []
    for span, _ in fills:
        own = order[offsets[span.track] : offsets[span.track + 1]]
        at = int(np.searchsorted(frame_of[own], span.first)) - 1
        before.append(offsets[span.track] + at)
    rows = np.repeat(before, [span.length for span, _ in fills])
    return order[rows], order[rows + 1]
