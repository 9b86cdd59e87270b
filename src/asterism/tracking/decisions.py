"""Decisions of stitching, naming and filling, as data."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model.decision import Alternative, Decision

if TYPE_CHECKING:
    from asterism.model import Tracks
    from asterism.tracking.filling import Filling
    from asterism.tracking.naming import Naming
    from asterism.tracking.stitching import Stitching

__all__ = ["of_filling", "of_naming", "of_stitching"]


def of_stitching(stitching: Stitching, tracks: Tracks) -> tuple[Decision, ...]:
    """Return the joins, cuts and ghosts of a stitching.

    Parameters
    ----------
    stitching : Stitching
        Result of `stitch`.
    tracks : Tracks
        Tracks of the same detections, with the numbers that the decisions have; those of the
        stitching, or named ones.
    """
    frame = tracks.detections.frame_of
    found: list[Decision] = []
    first, last, count = stitching.extents
    for tracklet in np.flatnonzero((stitching.after >= 0) & (stitching.markers >= 0)):
        before = stitching.after[tracklet]
        if tracks.labels[last[before]] != tracks.labels[first[tracklet]]:
            continue  # naming or an edit parted them
        found.append(
            Decision(
                kind="join",
                track=int(tracks.labels[first[tracklet]]),
                first=int(frame[last[before]]),
                last=int(frame[first[tracklet]]),
                n_detections=0,
                probability=float(stitching.probabilities[tracklet]),
            )
        )
    found += [
        Decision(
            kind="cut", track=int(tracks.labels[after]), first=int(frame[before]),
            last=int(frame[after]), n_detections=0,
        )
        for before, after in stitching.cuts
        if tracks.labels[before] != tracks.labels[after]
    ]  # fmt: skip
    found += [
        Decision(
            kind="ghost", track=-1, first=int(frame[first[ghost]]), last=int(frame[last[ghost]]),
            n_detections=int(count[ghost]), probability=float(stitching.probabilities[ghost]),
        )
        for ghost in stitching.ghosts
        if tracks.labels[first[ghost]] < 0
    ]  # fmt: skip
    return tuple(found)


def of_naming(naming: Naming, tracks: Tracks) -> tuple[Decision, ...]:
    """Return the names of tracks, each with its best alternative.

    Parameters
    ----------
    naming : Naming
        Result of `name_tracks`.
    tracks : Tracks
        Its tracks, corrected or not, which the decisions are about.
    """
    order, offsets = tracks.by_track
    frame = tracks.detections.frame_of
    found: list[Decision] = []
    for marker, probability, other, of_other in zip(
        naming.markers, naming.probabilities, naming.alternatives,
        naming.alternative_probabilities, strict=True,
    ):  # fmt: skip
        if marker is None or marker not in tracks.names:
            continue
        k = tracks.names.index(marker)
        own = frame[order[offsets[k] : offsets[k + 1]]]
        if not len(own):
            continue  # an edit gave its detections to other tracks
        track = tracks.names.index(other) if other in tracks.names else None
        alternative = Alternative(track=track, probability=float(of_other), name=other or "")
        found.append(
            Decision(
                kind="name", track=k, first=int(own[0]), last=int(own[-1]), n_detections=len(own),
                probability=float(probability), alternatives=(alternative,), name=marker,
            )
        )  # fmt: skip
    return tuple(found)


def of_filling(filling: Filling) -> tuple[Decision, ...]:
    """Return the gaps that were filled.

    Parameters
    ----------
    filling : Filling
        Result of `fill_gaps`.
    """
    return tuple(
        Decision(
            kind="fill", track=gap.track, first=gap.first, last=gap.last, n_detections=len(gap)
        )
        for gap in filling.gaps
        if gap.is_filled
    )
