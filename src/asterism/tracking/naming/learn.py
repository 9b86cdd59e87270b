"""Marker sets from captures with named tracks, and one set from those of several subjects."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.errors import ParameterError
from asterism.io.captures.marker_names import is_unlabelled
from asterism.model import MarkerSet, Tracks
from asterism.model.marker_geometry import heights, sides_of, steady_quads
from asterism.model.upwards import up_axis
from asterism.tracking.rigidity.cliques import disjoint_cliques
from asterism.tracking.rigidity.distances import distances_between

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["learn_marker_set", "merge_marker_sets"]

MAX_FRAMES = 150
"""Number of frames of a capture in which distances are measured."""
HEIGHT_FRAMES = 20
"""Number of frames of a capture in which heights are measured."""
MIN_FRAMES = 5
"""Smallest number of common frames of two markers from which the movement of their distance is
known."""
MOVED = 0.03
"""Spread of a distance, metres, from which on a body has moved. In a static trial it sways less."""
RIGID = 0.06
"""Largest movement of a distance on a rigid segment, as a share of the distance."""


def learn_marker_set(*captures: Tracks) -> MarkerSet:
    """Learn the marker set of one subject from captures with named tracks.

    A static trial or a single labelled frame gives the distances of one posture. A capture of a
    moving subject also tells which distances are rigid, so that later naming is more certain. Sets
    of several subjects are merged by `merge_marker_sets`.

    Parameters
    ----------
    *captures : Tracks
        Captures of one subject. Tracks without a name, or with a placeholder of a capture software
        (``*12``, ``Unlabeled 7``), are left out; names of computed points never get here.

    Returns
    -------
    MarkerSet
        Markers in the order in which they first occur. A subject before a colon is the subject of
        the set; with several subjects it stays in the names.

    Raises
    ------
    ParameterError
        If no track has a name, or two tracks of a capture have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> made = am.learn_marker_set(am.simulate.person(frames=40, seed=1))
    >>> made, made.knows_movement
    (MarkerSet(53 markers, 1 subject), True)
    """
    if not captures:
        raise ParameterError("captures", "at least one capture with named tracks", "none")
    poses: list[NDArray[np.float64]] = []
    names: dict[str, int] = {}
    subject, own_names = _named(captures)
    for own in own_names:
        for name in own:
            names.setdefault(name, len(names))
    for capture, own in zip(captures, own_names, strict=True):
        dense = np.full((capture.detections.n_frames, len(names), 3), np.nan)
        columns = [names[name] for name in own]
        dense[:, columns, : capture.detections.n_axes] = capture.positions()[:, list(own.values())]
        if capture.detections.n_axes == 2:
            dense[..., 2] = np.where(np.isnan(dense[..., 0]), np.nan, 0.0)
        poses.append(dense[np.isfinite(dense[..., 0]).any(axis=1)])
    found = [distances_between(_spread_over(pose, MAX_FRAMES)) for pose in poses]
    middles = np.stack([np.where(own.n_frames > 0, own.middle, np.nan) for own in found])
    spreads = np.stack([np.where(own.n_frames >= MIN_FRAMES, own.spread, np.nan) for own in found])
    has_moved = [bool((np.nan_to_num(spread) > MOVED).any()) for spread in spreads]
    distances = _mean(middles)
    movements = np.full(distances.shape, np.nan)
    if any(has_moved):
        movements = np.sqrt(_mean(spreads[has_moved] ** 2) + _variance(middles))
    np.fill_diagonal(distances, 0.0)
    np.fill_diagonal(movements, 0.0)
    fullest = max(poses, key=lambda pose: int(np.isfinite(pose[..., 0]).sum(axis=1).max(initial=0)))
    return MarkerSet(
        names=tuple(names),
        places=_pose(fullest, distances),
        distances=distances,
        movements=movements,
        variations=np.zeros(distances.shape),
        segments=_segments(distances, movements),
        presences=_presences(poses, has_moved),
        subject=subject,
        up=up_axis(captures[0].detections)[0],
        **_sides(distances, movements, poses, moved=any(has_moved)),
    )


def merge_marker_sets(*sets: MarkerSet) -> MarkerSet:
    """Merge the marker sets of several subjects into one, for subjects who are in none of them.

    Each subject is brought to the mean size. Where three or more sets have a distance, its median
    is used, so that one subject with two exchanged names does not distort it.

    Parameters
    ----------
    *sets : MarkerSet
        Sets of different subjects; a marker may be missing from some.

    Returns
    -------
    MarkerSet
        All markers, with the variation of each distance and side between subjects.

    Raises
    ------
    ParameterError
        If no set is given.

    Examples
    --------
    >>> import asterism as am
    >>> one, other = (am.simulate.person(frames=40, seed=seed) for seed in (1, 2))
    >>> am.merge_marker_sets(am.learn_marker_set(one), am.learn_marker_set(other))
    MarkerSet(53 markers, 2 subjects)
    """
    for made in sets:
        check_kind("sets", made, MarkerSet, "am.learn_marker_set(tracks)")
    if len(sets) < 2:
        if not sets:
            raise ParameterError("sets", "at least one marker set", "none")
        return sets[0]
    names = tuple(dict.fromkeys(name for made in sets for name in made.names))
    number = {name: k for k, name in enumerate(names)}
    M = len(names)
    into = [np.array([number[name] for name in made.names]) for made in sets]
    tables = np.full((len(sets), 3, M, M), np.nan)
    for table, made, own in zip(tables, sets, into, strict=True):
        at = (slice(None), *np.ix_(own, own))
        table[at] = np.stack([made.distances, made.movements, made.variations])
    with np.errstate(divide="ignore"):
        logs = np.log(tables[:, 0])
    upper = np.triu(np.ones((M, M), dtype=bool), 1)
    off = np.where(upper, logs - _mean(logs), np.nan)
    sizes = np.exp([_median(own[np.isfinite(own)]) for own in off])
    tables /= sizes[:, None, None, None]
    distances = _center(tables[:, 0])
    movements = np.sqrt(_mean(tables[:, 1] ** 2))
    variations = np.sqrt(_mean(tables[:, 2] ** 2) + _variance(tables[:, 0]))
    for table in (distances, movements, variations):
        np.fill_diagonal(table, 0.0)
    best = max(range(len(sets)), key=lambda s: int(np.isfinite(sets[s].places[:, 0]).sum()))
    places = np.full((M, 3), np.nan)
    places[into[best]] = sets[best].places / sizes[best]
    presences = np.zeros(M)
    for made, own in zip(sets, into, strict=True):
        presences[own] += made.presences / len(sets)
    segments: list[str | None] = [None] * M
    for made, own in zip(sets, into, strict=True):
        for k, segment in zip(own, made.segments, strict=True):
            segments[k] = segments[k] or segment
    return MarkerSet(
        names=names,
        places=places,
        distances=distances,
        movements=movements,
        variations=variations,
        segments=tuple(segments),
        presences=presences,
        n_subjects=sum(made.n_subjects for made in sets),
        up=sets[best].up,
        **_merged_sides(sets, into, sizes, distances),
    )


def _named(captures: Sequence[Tracks]) -> tuple[str, list[dict[str, int]]]:
    """Return the subject, if there is only one, and the tracks of each capture by name."""
    all_named: list[dict[str, int]] = []
    for capture in captures:
        check_kind("captures", capture, Tracks, "am.read(path).tracks")
        own: dict[str, int] = {}
        for k, name in enumerate(capture.names):
            if not name or is_unlabelled(name) or not capture.lengths[k]:
                continue
            if name in own:
                raise ParameterError("captures", "each name once in a capture", f"{name} twice")
            own[name] = k
        if not own:
            got = f"none of {capture.n_tracks} named"
            raise ParameterError("captures", "tracks with names", got)
        all_named.append(own)
    subjects = {name.rpartition(":")[0] for own in all_named for name in own}
    if len(subjects - {""}) > 1:
        return "", all_named
    subject = next(iter(subjects - {""}), "")
    return subject, [{name.rpartition(":")[2]: k for name, k in own.items()} for own in all_named]


def _pose(poses: NDArray[np.float64], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the frame with the most markers, and of these the one nearest to usual distances."""
    counts = np.isfinite(poses[..., 0]).sum(axis=1)
    fullest = _spread_over(poses[counts == counts.max()], 30)
    off = [
        float(np.nansum(np.abs(np.linalg.norm(pose[:, None] - pose[None], axis=2) - distances)))
        for pose in fullest
    ]
    return fullest[int(np.argmin(off))]


def _sides(
    distances: NDArray[np.float64],
    movements: NDArray[np.float64],
    poses: list[NDArray[np.float64]],
    *,
    moved: bool,
) -> dict[str, Any]:
    """Choose reference planes for each marker, with its heights over them."""
    quads = steady_quads(distances, movements)
    all_heights = [heights(_spread_over(pose, HEIGHT_FRAMES), quads) for pose in poses]
    stacked = np.concatenate(all_heights) if all_heights else np.zeros((0, len(quads)))
    sides = sides_of(quads, _mean(stacked), np.sqrt(_variance(stacked)), distances)
    return sides if moved else sides | {"height_spreads": np.full(len(sides["quads"]), np.nan)}


def _merged_sides(
    sets: Sequence[MarkerSet],
    into: list[NDArray[np.int64]],
    sizes: NDArray[np.float64],
    distances: NDArray[np.float64],
) -> dict[str, Any]:
    """Merge the reference planes of several sets; a set without one measures it in its posture."""
    M = len(distances)
    quads = np.unique(
        np.concatenate([own[made.quads] for made, own in zip(sets, into, strict=True)]), axis=0
    )
    place_of = {tuple(quad): q for q, quad in enumerate(quads.tolist())}
    values = np.full((len(sets), 2, len(quads)), np.nan)
    for table, made, own, size in zip(values, sets, into, sizes, strict=True):
        places = np.full((M, 3), np.nan)
        places[own] = made.places
        table[0] = heights(places, quads)
        at = [place_of[tuple(quad)] for quad in own[made.quads].tolist()]
        table[:, at] = made.heights, made.height_spreads
        table /= size
    middle = _center(values[:, 0])
    spread = np.sqrt(np.nan_to_num(_mean(values[:, 1] ** 2)) + _variance(values[:, 0]))
    return sides_of(quads, middle, spread, distances)


def _presences(poses: list[NDArray[np.float64]], has_moved: list[bool]) -> NDArray[np.float64]:
    """Return the share of the moving captures in which each marker occurs; 1 without any."""
    seen = [np.isfinite(pose[..., 0]).any(axis=0) for pose in poses]
    moving = [own for own, moved in zip(seen, has_moved, strict=True) if moved]
    return np.mean(moving, axis=0) if moving else np.ones(poses[0].shape[1])


def _segments(
    distances: NDArray[np.float64], movements: NDArray[np.float64]
) -> tuple[str | None, ...]:
    """Return the rigid segments by which distances move together, numbered from the largest."""
    i, j = np.nonzero(np.triu(movements < RIGID * distances, 1))
    segments: list[str | None] = [None] * len(distances)
    for n, cluster in enumerate(disjoint_cliques(len(distances), np.stack([i, j], axis=1)), 1):
        for k in cluster:
            segments[k] = f"segment {n}"
    return tuple(segments)


def _spread_over(poses: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Return at most n frames, spread evenly."""
    if len(poses) <= n:
        return poses
    return poses[np.unique(np.linspace(0, len(poses) - 1, n).astype(np.int64))]


def _mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over the first axis, without NaN; NaN where there are no others."""
    known = np.isfinite(values)
    n = known.sum(axis=0)
    total = np.where(known, values, 0).sum(axis=0)
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)


def _variance(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.maximum(_mean(values**2) - _mean(values) ** 2, 0)


def _center(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median over the first axis of three or more known values, else their mean."""
    ordered = np.sort(values, axis=0)  # NaN is sorted last
    n = np.isfinite(values).sum(axis=0)
    low, high = (
        np.take_along_axis(ordered, np.maximum(at, 0)[None], axis=0)[0]
        for at in ((n - 1) // 2, n // 2)
    )
    high = np.where(n > 0, high, low)
    return np.where(n >= 3, (low + high) / 2, _mean(values))


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if len(values) else 0.0
