"""Confidence of identity: whether a detection is of the marker that holds most of its track."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.model.decision import Alternative, Decision
from asterism.records import record
from asterism.tracking.confidence.calibration import (
    PART,
    WHOLE,
    part_features,
    part_probability,
)
from asterism.tracking.confidence.links import Exchanges, find_exchanges
from asterism.tracking.confidence.parts import Evidence, Parts, compare, part_tracks

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import TrackingModel, Tracks
    from asterism.tracking.stitching import Stitching

__all__ = ["Examined", "assess", "examine"]

CERTAIN = 0.98
"""Probability of a link from which a track is not cut into parts there."""
DECIDED = 0.99
"""Probability of an identity from which no alternatives are listed."""
MIN_ALTERNATIVE = 1e-3
"""Smallest probability of an alternative that is listed."""
OTHER_JOIN = 0.95
"""Probability of a join of tracklets that stitching did not make, as by names."""


def assess(tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None) -> Tracks:
    """Estimate how certain links and identities are, and list the uncertain ones.

    The identity of a detection is right if its track is there on the same marker as in most of its
    detections. Tracks are cut into parts at uncertain links and at joins. The distances of each
    part to other tracks are compared with those that its own track keeps, that absent tracks keep,
    and with an unknown marker. The margin, the probabilities of the links at both ends and the
    length of the part give the probability, by a logistic function fitted on simulated people.
    Where tracks keep no distances, it is the product of the probabilities of the links between the
    part and the longest part of the track.

    Parameters
    ----------
    tracks : Tracks
        Tracks of a capture.
    model : TrackingModel
        Model of motion and noise with which they were tracked.
    stitching : Stitching, optional
        Stitching that made the tracks of the same detections.

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
    found = examine(tracks, model, stitching)
    parts = found.parts
    probability = _probability(parts, found.evidence, tracks.n_tracks)
    confidence = np.zeros(tracks.detections.n_points)
    confidence[tracks.by_track[0]] = np.repeat(probability, parts.n_detections)
    return replace(
        tracks,
        confidence=found.confidence,
        identity_confidence=confidence,
        decisions=(*tracks.decisions, *_decisions(tracks, found, probability)),
    )


@record(eq=False)
class Examined:
    """What the confidence of identity is computed from.

    Parameters
    ----------
    confidence : ndarray of shape (N,)
        Confidence of the links.
    exchanges : Exchanges
        Exchanges that the motion model allows, of `tracklets`.
    tracklets : ndarray of int, shape (N,)
        Tracklet of each detection, -1 for none.
    parts : Parts
        Parts of the tracks.
    partners : ndarray of int, shape (P, 2)
        Tracks that may have exchanged a part at its ends, -1 for none.
    evidence : Evidence
        Comparison of the distances of the parts.
    """

    confidence: NDArray[np.float64]
    exchanges: Exchanges
    tracklets: NDArray[np.int64]
    parts: Parts
    partners: NDArray[np.int64]
    evidence: Evidence


def examine(tracks: Tracks, model: TrackingModel, stitching: Stitching | None = None) -> Examined:
    """Find the uncertain links and parts of tracks, with the evidence for each.

    Parameters
    ----------
    tracks, model, stitching
        As for `assess`.
    """
    d = tracks.detections
    tracklets = _tracklets(tracks, stitching)
    exchanges = find_exchanges(d, tracklets, model)
    link, partner = _after_exchanges(exchanges, tracks, tracklets)
    own = tracks.confidence
    confidence = np.where(tracks.labels < 0, 0.0, link) if own is None else own
    link = link if own is None else np.minimum(link, own)
    if stitching is not None:
        _limit_by_joins(link, tracks, tracklets, stitching)
    parts = part_tracks(tracks, link, CERTAIN)
    starts = partner[tracks.by_track[0][parts.offsets[:-1]]]
    partners = np.stack([starts, np.append(starts, -1)[1:]], axis=1)
    evidence = compare(tracks, parts, partners, model.sensor.noise_sigma)
    return Examined(
        confidence=confidence, exchanges=exchanges, tracklets=tracklets, parts=parts,
        partners=partners, evidence=evidence,
    )  # fmt: skip


def _tracklets(tracks: Tracks, stitching: Stitching | None) -> NDArray[np.int64]:
    """Return the pieces of tracks that no join made, one number each, -1 for no tracklet."""
    if stitching is None:
        return tracks.labels
    both = stitching.tracklets.astype(np.int64) * (tracks.n_tracks + 1) + tracks.labels + 1
    both[stitching.tracklets < 0] = -1
    numbers, found = np.unique(both, return_inverse=True)
    return found - int(len(numbers) > 0 and numbers[0] == -1)


def _after_exchanges(
    exchanges: Exchanges, tracks: Tracks, tracklets: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return for each detection the probability of no exchange before it, and the other track."""
    d = tracks.detections
    link, partner = np.ones(d.n_points), np.full(d.n_points, -1)
    track_of = np.full(int(tracklets.max(initial=-1)) + 1, -1)
    inside = tracklets >= 0
    track_of[tracklets[inside]] = tracks.labels[inside]
    pairs = track_of[exchanges.pairs]
    differ = pairs[:, 0] != pairs[:, 1]
    order = np.lexsort((d.frame_of, tracklets))
    keys = tracklets[order] * d.n_frames + d.frame_of[order]
    for side in (0, 1):
        own = exchanges.pairs[:, side]
        at = np.searchsorted(keys, own * d.n_frames + exchanges.frames)
        has = differ & (at < len(keys))
        has[has] = tracklets[order[at[has]]] == own[has]
        detection = order[at[has]]
        np.multiply.at(link, detection, 1 - exchanges.probabilities[has])
        partner[detection] = pairs[has, 1 - side]
    return link, partner


def _limit_by_joins(
    link: NDArray[np.float64], tracks: Tracks, tracklets: NDArray[np.int64], stitching: Stitching
) -> None:
    """Limit the probability of the first detection after each join to that of the join."""
    order, _ = tracks.by_track
    labels = tracks.labels[order]
    joined = (labels[1:] == labels[:-1]) & (tracklets[order[1:]] != tracklets[order[:-1]])
    after, before = order[1:][joined], order[:-1][joined]
    of = stitching.tracklets
    is_own = (of[after] != of[before]) & (stitching.after[of[after]] >= 0)
    p = np.where(is_own, np.minimum(stitching.probabilities[of[after]], CERTAIN), OTHER_JOIN)
    link[after] = np.minimum(link[after], p)


def _probability(parts: Parts, evidence: Evidence, n_tracks: int) -> NDArray[np.float64]:
    """Return the probability that each part is on the marker of its track."""
    known = part_probability(part_features(evidence, parts.weakest, parts.n_detections))
    probability = np.where(evidence.is_known, known, _chained(parts, n_tracks))
    return np.where(parts.is_whole(n_tracks), WHOLE, np.minimum(probability, WHOLE))


def _chained(parts: Parts, n_tracks: int) -> NDArray[np.float64]:
    """Return the product of the links between each part and the longest part of its track."""
    logs = np.cumsum(np.log(np.maximum(parts.before, 1e-12)))
    longest = np.zeros(n_tracks, dtype=np.int64)
    order = np.argsort(parts.n_detections, kind="stable")
    longest[parts.track[order]] = order  # the last assignment is of the longest part
    return np.exp(-np.abs(logs - logs[longest[parts.track]]))


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
        log_weights = np.append(PART[2] * evidence.densities[p], PART[1] * evidence.unknown[p])
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
