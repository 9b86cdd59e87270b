"""Filling of gaps: positions of occluded markers with their standard deviations.

Three estimators (`estimates.py`) are evaluated on stretches of the same capture in which the marker
is withheld. Their errors there determine the weights and the standard deviation of the fill.

Frames before the first and after the last detection of a track are not filled.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind, check_number
from asterism.model import TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.estimation import estimate_model
from asterism.tracking.filling.estimates import DenseTracks, estimate
from asterism.tracking.filling.scores import Fill, settle
from asterism.tracking.filling.spans import Span, find_gaps

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from asterism.model import Edit
    from asterism.tracking.filling.estimates import Estimates

__all__ = ["ESTIMATORS", "LONGEST", "FilledGap", "Filling", "fill_gaps"]

ESTIMATORS = ("smoother", "body", "pattern")
LONGEST = 1.0
"""Default of the longest gap that is filled, seconds."""


@record
class FilledGap:
    """Gap of a track and the result of its filling.

    Parameters
    ----------
    track : int
        Number of the track.
    first, last : int
        First and last missing frame.
    seconds : float
        Time between the detections before and after the gap.
    weights : mapping of str to float
        Weight of each estimator, with sum 1; empty for a gap that was not filled.
    rms : mapping of str to float
        Root mean square distance of each estimator from withheld detections in stretches of
        the same length, metres. Empty if the capture is too short.
    n_windows : int
        Number of disjoint stretches on which this was measured. 0 if the capture is too short;
        then the estimator with the smallest variance of its own is used.
    std : float
        Largest standard deviation of a coordinate, metres; NaN for a gap that was not filled.
    n_neighbours : int
        Number of markers of the rigid body from which the gap was filled.
    reason : str
        Reason why the gap was not filled, "" for a filled gap.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, rate=100, seed=1)
    >>> filling = am.fill_gaps(am.simulate.corrupt(truth, missing=0.05, seed=1))
    >>> gap = filling.gaps[0]
    >>> gap.track, gap.first, len(gap), gap.is_filled, gap.estimator
    (0, 46, 1, True, 'pattern')
    >>> gap.std < 1e-3  # metres
    True
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
        """Whether the gap was filled."""
        return not self.reason

    @property
    def estimator(self) -> str:
        """Name of the estimator with the largest weight, "" for a gap that was not filled."""
        return max(self.weights, key=lambda name: self.weights[name], default="")

    def __len__(self) -> int:
        return self.last - self.first + 1


@record(eq=False)
class Filling:
    """Tracks with filled gaps, and a report of every gap.

    Parameters
    ----------
    tracks : Tracks
        Tracks with the measured detections, unchanged, and the filled ones, which are marked in
        ``detections.filled`` and have standard deviations in ``detections.stds``.
    gaps : tuple of FilledGap
        Every gap, by track and time, including those that were not filled.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, rate=100, seed=1)
    >>> filling = am.fill_gaps(am.simulate.corrupt(truth, missing=0.05, seed=1))
    >>> filling.n_filled, len(filling.gaps)
    (18, 18)
    >>> int(filling.tracks.detections.filled.sum())
    19
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
    longest: float = LONGEST,
    edits: Sequence[Edit] = (),
    progress: Callable[[int], Any] | None = None,
) -> Filling:
    """Fill the gaps of tracks from their own motion, their rigid body and the other markers.

    *smoother*: the motion of the model through the gap (Rauch-Tung-Striebel). *body*: neighbours
    at stable distances are fitted as a rigid body in every frame [1], which predicts the marker.
    *pattern*: in the frame of that body, ridge regression on the positions of up to 14 markers,
    estimated from frames in which all were detected [2], [3]. A Gaussian process interpolates the
    residuals of body and pattern at the ends of the gap, so that the fill joins them smoothly.

    For validation the marker is withheld in stretches of the capture in which it and its helpers
    were detected. The weighted mean of the three with the smallest error there fills the gap. That
    error, frame by frame, is the standard deviation of the fill; it is inflated if the three
    disagree more in the gap than in the stretches.

    Parameters
    ----------
    tracks : Tracks
        Tracks to fill. Filled points of an earlier call are removed first.
    model : TrackingModel, optional
        Model whose motion and noise are used. By default it is estimated from the detections.
    longest : float
        Longest gap that is filled, seconds between the detections before and after it, ≥ 0.
        Larger values fill more gaps, with larger standard deviations.
    edits : sequence of Edit
        Edits that state of single gaps that they are filled, whatever their length, or left open.
    progress : callable, optional
        Called with the number of finished gaps.

    Returns
    -------
    Filling
        Filled tracks and a report of every gap.

    Raises
    ------
    ParameterError
        If an argument is out of range, or a model is needed and cannot be estimated.

    References
    ----------
    1. Horn, Closed-form solution of absolute orientation using unit quaternions, 1987.
    2. Gløersen & Federolf, Predicting missing marker trajectories in human motion data using
       marker intercorrelations, PLoS ONE 11(3), 2016.
    3. Liu & McMillan, Estimation of missing markers in human motion capture, 2006.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=60, rate=100, seed=1)
    >>> corrupted = am.simulate.corrupt(truth, missing=0.1, seed=1)
    >>> filling = am.fill_gaps(corrupted, longest=0.02)
    >>> filling
    Filling(39 of 40 gaps, 39 points)
    >>> {gap.reason for gap in filling.gaps}
    {'', 'longer than 0.02 s'}
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    if model is not None:
        check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    check_number("longest", longest, above=0, below=1e9, closed=True)
    tracks = tracks.measured()
    d = tracks.detections
    positions = tracks.positions()
    spans = find_gaps(np.isfinite(positions[..., 0]))
    # Rounded to nanoseconds, because times such as k / 120 differ in their last bits.
    seconds = [round(float(d.times[s.last + 1] - d.times[s.first - 1]), 9) for s in spans]
    stated = _stated(tracks, edits)
    reasons = [
        "" if is_filled else "left open by an edit" if is_filled is False else
        f"longer than {longest:g} s" if value > longest else ""
        for value, is_filled in zip(seconds, map(stated.get, map(_key, spans)), strict=True)
    ]  # fmt: skip
    if model is None and not all(reasons):
        model = estimate_model(d).model
    dense = None if model is None else DenseTracks(times=d.times, positions=positions, model=model)
    gaps: list[FilledGap] = []
    fills: list[tuple[Span, Fill]] = []
    for n, (span, length, reason) in enumerate(zip(spans, seconds, reasons, strict=True), start=1):
        if dense is None or reason:
            gaps.append(_gap(span, length, None, reason))
        else:
            found = estimate(dense, span)
            fills.append((span, settle(found)))
            gaps.append(_gap(span, length, (found, fills[-1][1]), ""))
        if progress is not None:
            progress(n)
    return Filling(tracks=_with(tracks, fills), gaps=tuple(gaps))


def _key(span: Span) -> tuple[int, int, int]:
    return span.track, span.first, span.last


def _stated(tracks: Tracks, edits: Sequence[Edit]) -> dict[tuple[int, int, int], bool]:
    """Return the gaps of which an edit states that they are filled, or left open."""
    stated: dict[tuple[int, int, int], bool] = {}
    for edit in edits:
        if edit.kind in ("fill", "no_fill"):
            (first, i), (last, j) = sorted(edit.at)
            offsets = tracks.detections.offsets
            track, other = (int(tracks.labels[offsets[t] + n]) for t, n in ((first, i), (last, j)))
            if track == other:  # otherwise it is a gap no longer
                stated[track, first + 1, last - 1] = edit.kind == "fill"
    return stated


def _gap(span: Span, seconds: float, made: tuple[Estimates, Fill] | None, reason: str) -> FilledGap:
    """Return the report of a gap."""
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
    """Add filled points to tracks, after the measured points of each frame."""
    if not fills:
        return tracks
    d = tracks.detections
    D, n = d.n_axes, d.n_points
    frames = np.concatenate([span.frames for span, _ in fills])
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
        # The file's own label of the marker, if it is the same on both sides of the gap.
        own = old["labels"]
        new["labels"] = np.where(own[before] == own[after], own[before], -1)
    order = np.argsort(np.concatenate([d.frame_of, frames]), kind="stable")
    counts = d.counts + np.bincount(frames, minlength=d.n_frames)
    detections = replace(
        d,
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        **{name: np.concatenate([values, new[name]])[order] for name, values in old.items()},
    )

    def of_both_ends(confidence: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        if confidence is None:
            return None
        of_ends = np.minimum(confidence[before], confidence[after])
        return np.concatenate([confidence, of_ends])[order]

    return replace(
        tracks,
        detections=detections,
        labels=np.concatenate([tracks.labels, labels])[order],
        confidence=of_both_ends(tracks.confidence),
        identity_confidence=of_both_ends(tracks.identity_confidence),
    )


def _ends(
    tracks: Tracks, fills: Sequence[tuple[Span, Fill]]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Find the detections at both ends of the gap for every filled point."""
    order, offsets = tracks.by_track
    frame_of = tracks.detections.frame_of
    before: list[int] = []
    for span, _ in fills:
        own = order[offsets[span.track] : offsets[span.track + 1]]
        at = int(np.searchsorted(frame_of[own], span.first)) - 1
        before.append(offsets[span.track] + at)
    rows = np.repeat(before, [span.length for span, _ in fills])
    return order[rows], order[rows + 1]
