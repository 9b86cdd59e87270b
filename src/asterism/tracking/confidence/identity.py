"""Confidence of identity: whether a detection is of the marker that holds most of its track."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.model.decision import Alternative, Decision
from asterism.records import record
from asterism.tracking.confidence.calibration import (
    IDENTITY,
    PART,
    WHOLE,
    part_features,
    part_probability,
    track_probability,
)
from asterism.tracking.confidence.links import Exchanges, find_exchanges
from asterism.tracking.confidence.parts import Evidence, Parts, compare, part_tracks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["Examined", "assess", "examine", "expected_right", "with_confidence"]

CERTAIN = 0.98
"""Probability of a link from which a track is not cut into parts there."""
DECIDED = 0.99
"""Probability of an identity from which no alternatives are listed."""
MIN_ALTERNATIVE = 1e-3
"""Smallest probability of an alternative that is listed."""
OTHER_JOIN = 0.95
"""Probability of a join of tracklets that stitching did not make, as by names."""
LEAP, RELATIVE, LEAP_FRAMES = 0.04, 0.5, 3
"""Deviation from straight motion, metres and relative to the length of the link, and frames from
one detection to the next, from which on a link is uncertain by its motion alone."""
LEAPING = 0.84
"""Probability of such a link, as measured on simulated people."""


def assess(
    tracks: Tracks,
    model: TrackingModel,
    stitching: Stitching | None = None,
    *,
    threads: int = 1,
) -> Tracks:
    """Estimate how certain links and identities are, and list the uncertain ones.

    The identity of a detection is right if its track is there on the same marker as in most of its
    detections. Tracks are cut into parts at uncertain links and at joins. The distances of each
    part to other tracks are compared with those that its own track keeps, that absent tracks keep,
    and with an unknown marker. The margin, the probabilities of the links at both ends and the
    length of the part give the probability, by a logistic function fitted on simulated people.
    Where tracks keep no distances, it is the product of the probabilities of the links between the
    part and the longest part of the track. A track without an uncertain link is of one marker with
    a probability that rises with its length, because ghosts make short tracks.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    model : TrackingModel
        Model of motion and noise with which they were tracked.
    stitching : Stitching, optional
        Stitching that made the tracks of the same detections.
    threads : int
        Number of threads; it has no influence on the result.

    Returns
    -------
    Tracks
        The same tracks with ``identity_confidence`` and with the uncertain parts in ``decisions``.
        ``confidence`` is that of the method, or that of the motion model for a method without.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=40, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> tracks = am.tracking.assess(truth, model)
    >>> float(tracks.identity_confidence.min()) > 0.99, tracks.decisions
    (True, ())
    """
    return with_confidence(tracks, examine(tracks, model, stitching, threads=threads))


def expected_right(tracks: Tracks, found: Examined) -> float:
    """Return the number of detections whose identity is expected to be right, to compare results.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    found : Examined
        Result of `examine` for them.
    """
    return float(found.parts.n_detections @ _probability(found, tracks.n_tracks, in_range=False))


def with_confidence(tracks: Tracks, found: Examined) -> Tracks:
    """Return tracks with the confidences and decisions of `assess`.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    found : Examined
        Result of `examine` for them.
    """
    parts, order = found.parts, tracks.by_track[0]
    probability = _probability(found, tracks.n_tracks, in_range=True)
    identity = np.where(tracks.labels >= 0, WHOLE, 0.0)
    for p in np.flatnonzero(probability < WHOLE):
        identity[order[parts.offsets[p] : parts.offsets[p + 1]]] = probability[p]
    identity.flags.writeable = False  # no other object refers to it: no need to copy
    confidence = tracks.confidence
    if confidence is None:
        confidence = np.where(tracks.labels >= 0, 1.0, 0.0)
        confidence[found.uncertain] = found.link
        confidence.flags.writeable = False
    return replace(
        tracks,
        confidence=confidence,
        identity_confidence=identity,
        decisions=(*tracks.decisions, *_decisions(tracks, found, probability)),
    )


@record(eq=False)
class Examined:
    """What the confidence of identity is computed from.

    Parameters
    ----------
    exchanges : Exchanges
        Exchanges of tracks that the motion model allows.
    uncertain : ndarray of int, shape (n,)
        Detections whose link another track could have, rising.
    link : ndarray of shape (n,)
        Probability of their links.
    parts : Parts
        Parts of the tracks.
    partners : ndarray of int, shape (P, 2)
        Tracks that may have exchanged a part at its ends, -1 for none.
    evidence : Evidence
        Comparison of the distances of the parts.
    """

    exchanges: Exchanges
    uncertain: NDArray[np.int64]
    link: NDArray[np.float64]
    parts: Parts
    partners: NDArray[np.int64]
    evidence: Evidence


def examine(
    tracks: Tracks,
    model: TrackingModel,
    stitching: Stitching | None = None,
    *,
    threads: int = 1,
) -> Examined:
    """Find the uncertain links and parts of tracks, with the evidence for each.

    Parameters
    ----------
    tracks, model, stitching, threads
        As for `assess`.
    """
    tracklets = tracks.labels if stitching is None else stitching.tracklets
    exchanges = find_exchanges(tracks, tracklets, model, threads=threads)
    uncertain, link, partner = _after_exchanges(exchanges, tracks.labels)
    cuts = [(uncertain, link)]
    if tracks.confidence is not None:
        own = np.flatnonzero((tracks.confidence <= CERTAIN) & (tracks.labels >= 0))
        cuts.append((own, tracks.confidence[own]))
    leaps = _leaps(tracks)
    cuts.append((leaps, np.full(len(leaps), LEAPING)))
    if stitching is not None:
        cuts.append(_joins(tracks, stitching))
    parts = part_tracks(
        tracks, *_least(*(np.concatenate(each) for each in zip(*cuts, strict=True)))
    )
    starts = tracks.by_track[0][parts.offsets[:-1]]
    at = np.searchsorted(uncertain, starts)
    has = at < len(uncertain)
    has[has] = uncertain[at[has]] == starts[has]
    other = np.full(len(starts) + 1, -1)
    other[:-1][has] = partner[at[has]]
    partners = np.stack([other[:-1], other[1:]], axis=1)
    evidence = compare(tracks, parts, partners, model.sensor.noise_sigma, threads=threads)
    return Examined(
        exchanges=exchanges, uncertain=uncertain, link=link, parts=parts, partners=partners,
        evidence=evidence,
    )  # fmt: skip


def _least(
    detections: NDArray[np.int64], probabilities: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the detections once, rising, with the smallest probability of each."""
    order = np.lexsort((probabilities, detections))
    detections, probabilities = detections[order], probabilities[order]
    is_first = np.ones(len(detections), dtype=bool)
    is_first[1:] = detections[1:] != detections[:-1]
    return detections[is_first], probabilities[is_first]


def _after_exchanges(
    exchanges: Exchanges, labels: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.int64]]:
    """Return the detections after exchanges, the probability of none, and one other track."""
    sides = exchanges.tracks(labels)
    has = exchanges.after >= 0
    detections, index = np.unique(exchanges.after[has], return_inverse=True)
    link, partner = np.ones(len(detections)), np.full(len(detections), -1)
    np.multiply.at(link, index, 1 - np.stack([exchanges.probabilities] * 2, axis=1)[has])
    partner[index] = sides[:, ::-1][has]
    is_link = (exchanges.before[has] >= 0) & (partner[index] >= -1)
    linked = np.zeros(len(detections), dtype=bool)
    linked[index[is_link]] = True
    return detections[linked], link[linked], partner[linked]


def _leaps(tracks: Tracks) -> NDArray[np.int64]:
    """Return the first detection after each link over missed frames that is far from straight."""
    order, _ = tracks.by_track
    d = tracks.detections
    frame, label = d.frame_of[order].astype(np.int64), tracks.labels[order]
    n = np.diff(frame)
    links = np.flatnonzero((np.diff(label) == 0) & (n >= LEAP_FRAMES))
    step = d.points[order[links + 1]] - d.points[order[links]]
    off2 = np.zeros(len(links))
    for side in (-1, 1):  # the velocity before, and that after the link
        at = np.clip(links + side, 0, len(n) - 1)
        has = (label[at] == label[at + 1]) & (label[at] == label[links]) & (at != links)
        other = d.points[order[at + 1]] - d.points[order[at]]
        off = step - other * (n[links] / np.maximum(n[at], 1))[:, None]
        off2 = np.maximum(off2, np.where(has, (off**2).sum(axis=1), 0))
    least2 = np.maximum(LEAP**2, (RELATIVE * step) ** 2 @ np.ones(d.n_axes))
    return order[links[off2 > least2] + 1]


def _joins(tracks: Tracks, stitching: Stitching) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the first detection after each join, and the probability of the join."""
    order, offsets = tracks.by_track
    of = stitching.tracklets
    after: list[NDArray[np.int64]] = [np.empty(0, dtype=np.int64)]
    for k in range(tracks.n_tracks):
        own = order[offsets[k] : offsets[k + 1]]
        after.append(own[np.flatnonzero(np.diff(of[own])) + 1])
    then = np.concatenate(after)
    is_own = stitching.after[of[then]] >= 0
    p = np.where(is_own, np.minimum(stitching.probabilities[of[then]], CERTAIN), OTHER_JOIN)
    return then, p


def _probability(found: Examined, n_tracks: int, *, in_range: bool) -> NDArray[np.float64]:
    """Return the probability that each part is on the marker of its track.

    An unknown marker is compared by the ranges of the distances, or by their median deviations.
    """
    parts = found.parts
    features = part_features(found.evidence, parts.weakest, parts.n_detections, in_range=in_range)
    known = part_probability(features, IDENTITY if in_range else PART)
    probability = np.where(found.evidence.is_known, known, _chained(parts, n_tracks))
    whole = track_probability(parts.n_detections)
    return np.minimum(np.where(parts.is_whole(n_tracks), whole, probability), WHOLE)


def _chained(parts: Parts, n_tracks: int) -> NDArray[np.float64]:
    """Return the probability that each part is on the marker of the longest part of its track.

    It is the product of the links between both, and of the probability that the longest one is of
    one marker.
    """
    logs = np.cumsum(np.log(np.maximum(parts.before, 1e-12)))
    longest = np.zeros(n_tracks, dtype=np.int64)
    order = np.argsort(parts.n_detections, kind="stable")
    longest[parts.track[order]] = order  # the last assignment is of the longest part
    other = longest[parts.track]
    return np.exp(-np.abs(logs - logs[other])) * track_probability(parts.n_detections[other])


def _decisions(tracks: Tracks, found: Examined, probability: NDArray[np.float64]) -> list[Decision]:
    """Return the parts whose identity is uncertain, in the order of tracks and time."""
    frames = tracks.detections.frame_of[tracks.by_track[0]]
    uncertain = np.flatnonzero(probability < DECIDED)
    starts, ends = found.parts.offsets[uncertain], found.parts.offsets[uncertain + 1]
    return [
        Decision(
            kind="identity",
            track=int(found.parts.track[p]),
            first=int(frames[start]),
            last=int(frames[end - 1]),
            n_detections=int(end - start),
            probability=float(probability[p]),
            alternatives=_alternatives(
                found.evidence, found.partners[p], int(p), 1 - float(probability[p])
            ),
        )
        for p, start, end in zip(uncertain, starts, ends, strict=True)
    ]


def _alternatives(
    evidence: Evidence, partners: NDArray[np.int64], p: int, share: float
) -> tuple[Alternative, ...]:
    """Return the alternatives of a part, which share the complement of its probability."""
    if evidence.is_known[p]:
        others = np.append(evidence.alternatives[p], -1)
        log_weights = np.append(
            IDENTITY[2] * evidence.densities[p], IDENTITY[1] * evidence.in_range[p]
        )
        weights = np.exp(log_weights - log_weights.max())
    else:
        others = np.unique(partners[partners >= 0])
        others = np.array([-1]) if not len(others) else others
        weights = np.ones(len(others))
    weights *= share / weights.sum()
    return tuple(
        Alternative(track=None if others[i] < 0 else int(others[i]), probability=float(weights[i]))
        for i in np.argsort(-weights, kind="stable")
        if weights[i] >= MIN_ALTERNATIVE
    )
