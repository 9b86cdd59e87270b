"""Corruption of a scene or a capture with known truth: missed detections, clutter and noise.

Real failures come in kinds, and trackers fail on them differently: points missing here and there,
markers hidden for a while, false points anywhere, ghosts near a marker, noise, a low rate. Each is
a switch of `corrupt`. What remains is the truth of the recording.
"""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.model import Capture, Detections, Tracks
from asterism.simulate.corrupted_points import Points
from asterism.simulate.episodes import Burst, Ghosts, Visits
from asterism.simulate.false_points import anywhere, beside, ghost_points
from asterism.simulate.missed_points import come_and_go, in_runs, merge, seen_by_rig, shadowed
from asterism.simulate.sampling import kept_frames, shaken
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["corrupt"]


def corrupt(
    truth: Tracks,
    *,
    missing: float = 0.0,
    missing_run: float = 0.0,
    clutter: float = 0.0,
    noise: float = 0.0,
    noise_spread: float = 0.0,
    burst: Burst | None = None,
    visits: Visits | None = None,
    rig: Rig | None = None,
    views: int = 2,
    ghosts: Ghosts | None = None,
    nearby: float = 0.0,
    nearby_within: float = 0.05,
    doubled: float = 0.0,
    doubled_apart: float = 0.01,
    merged: float = 0.0,
    stride: int = 1,
    dropped: float = 0.0,
    jitter: float = 0.0,
    margin: float = 0.3,
    keep_unnamed: bool = False,
    seed: int = 0,
) -> Truth:
    """Record a scene or a capture whose truth is known, and keep the truth of what is left.

    Each switch draws from a stream of its own, so turning one on or off leaves the others' choices
    as they were: with and without clutter, the same detections are missing.

    Parameters
    ----------
    truth : Tracks
        Who is whom. If any track has a name, the named tracks are the markers; otherwise all are.
    missing : float
        Probability that a detection is dropped, each on its own.
    missing_run : float
        Not each on its own, but in runs of so many frames in the mean (Gilbert 1960): the model's
        P_r is one over this. 0 for each on its own.
    clutter : float
        Expected false points a frame, as a share of the mean number of markers seen in a frame of
        the original; their number is Poisson, their place uniform over its bounding box.
    noise : float
        Standard deviation of isotropic normal noise on every point of the original, metres.
    noise_spread : float
        Markers differ in their noise: the logarithm of the factor of each is normal with this
        standard deviation.
    burst : Burst, optional
        Markers hidden for a while.
    visits : Visits, optional
        Markers that enter and leave; each visit is a marker of its own.
    rig : Rig, optional
        A marker is missing where fewer than `views` of these cameras see it, past the surfaces of
        the truth. For 3-D.
    views : int
        How many cameras must see it.
    ghosts : Ghosts, optional
        False points beside markers that last for a while.
    nearby : float
        Probability that a marker that is seen has a false point beside it in that frame.
    nearby_within : float
        Greatest distance of such a point, metres.
    doubled : float
        Probability that a marker is seen as two points; the second is false.
    doubled_apart : float
        Distance between the two, metres.
    merged : float
        Points of one frame nearer than this, metres, become one in their middle; it is of the
        first of their markers. 0 for never.
    stride : int
        Keep frames 0, `stride`, 2 `stride` …
    dropped : float
        Probability that a frame is lost, as if it had never been.
    jitter : float
        Frames come early or late by up to half of this share of the time between two, in [0, 1).
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
    Truth
        Truth of the recording: `detections` holds its points in random order within each frame,
        `labels` the marker of each, or -1 for what is false. Every marker stays in `names`, seen or
        not. `record` says which switches were on. With a rig, the detections know which cameras
        saw them. If the source was a `Capture`, so are these
        detections, with the same file and units, no channels, and rate and first frame as befits
        the stride; where frames are left out or shaken it has no format, because the rest of the
        file no longer goes with it.

    Raises
    ------
    ParameterError
        If a number is out of range, or a rig is given for a 2-D scene.

    Examples
    --------
    >>> from asterism.simulate import cube, corrupt
    >>> corrupted = corrupt(cube(), missing=0.1, clutter=0.1, noise=0.005, seed=1)
    >>> corrupted
    Truth(8 tracks, 723 detections in them, 74 clutter, 100 frames)
    >>> corrupted.record
    {'missing': 0.1, 'clutter': 0.1, 'noise': 0.005, 'seed': 1}
    """
    switches = {name: value for name, value in locals().items() if name != "truth"}
    _check(truth, switches)
    truth = truth.measured()
    (
        rng_missing, rng_burst, rng_noise, rng_clutter, rng_ghosts, rng_order,
        rng_spread, rng_visits, rng_nearby, rng_doubled, rng_dropped, rng_jitter, rng_views,
    ) = map(np.random.default_rng, np.random.SeedSequence(int(seed)).spawn(13))  # fmt: skip

    chosen = kept_frames(rng_dropped, truth.detections.n_frames, stride, dropped)
    whole, origin = _markers(truth, chosen, keep_unnamed)
    n_frames, times = len(chosen), truth.detections.times[chosen]
    surfaces = [s.during(chosen) for s in getattr(truth, "surfaces", ()) if n_frames]
    if visits is not None and len(origin):
        whole, again = come_and_go(rng_visits, visits, whole, n_frames, len(origin))
        origin = origin[again]
    n_markers = len(origin)

    is_kept = _not_missed(rng_missing, whole, missing, missing_run, n_frames, n_markers)
    if burst is not None and n_markers:
        is_kept &= ~shadowed(rng_burst, burst, whole, n_frames, n_markers)
    by_cameras = None
    if rig is not None:
        by_cameras = seen_by_rig(whole, rig, surfaces, n_frames)
        n_views = sum((by_cameras >> i) & 1 for i in range(len(rig)))
        is_kept &= (whole.markers < 0) | (n_views >= views)
    clean = whole
    if jitter:
        times, places = shaken(rng_jitter, jitter, times, whole)
        clean = whole._replace(places=places)
    factor = np.append(np.exp(noise_spread * rng_spread.standard_normal(n_markers)), 1.0)
    noisy = clean
    if noise:
        off = rng_noise.normal(0.0, noise, clean.places.shape)
        noisy = clean._replace(places=clean.places + off * factor[clean.markers, None])
    seen = noisy if is_kept.all() else noisy.where(is_kept)
    if merged:
        seen = merge(seen, merged)

    parts = [seen]
    if clutter and (whole.markers >= 0).any():
        parts.append(anywhere(rng_clutter, clutter, margin, clean, n_frames))
    if ghosts is not None and n_markers:
        parts += ghost_points(rng_ghosts, ghosts, clean, n_frames, n_markers)
    if nearby:
        parts.append(beside(rng_nearby, nearby, 0.0, nearby_within, noisy, is_kept))
    if doubled:
        apart = doubled_apart
        parts.append(beside(rng_doubled, doubled, apart, apart, noisy, is_kept))

    mixed = _shuffled(rng_order, parts)
    names = _names(truth, origin, is_anew=visits is not None)
    lines = truth.connections[np.ix_(origin, origin)] if isinstance(truth, Truth) else ()
    return Truth(
        detections=replace(
            _detections(truth.detections, chosen, times, mixed, names, stride, switches),
            **_views(rng_views, mixed, clean, by_cameras, noise * factor),
        ),
        labels=mixed.markers,
        names=names,
        connections=np.asarray(lines, dtype=np.int64),
        colours=np.asarray(truth.colours[origin] if isinstance(truth, Truth) else (), np.int64),
        surfaces=tuple(surfaces),
        record=_record(switches),
    )


def _not_missed(
    rng: np.random.Generator,
    whole: Points,
    missing: float,
    run: float,
    n_frames: int,
    n_markers: int,
) -> NDArray[np.bool_]:
    """Draw which points are detected; `run` is the mean length of missed detections on end."""
    if not run:
        return (whole.markers < 0) | (rng.random(len(whole.markers)) >= missing)
    is_missed = in_runs(rng, missing, run, n_frames, n_markers)
    is_missed = np.column_stack([is_missed, np.zeros(n_frames, dtype=bool)])  # [-1] is clutter
    return ~is_missed[whole.frames, whole.markers]


def _check(truth: Tracks, switches: dict[str, Any]) -> None:
    check_kind("truth", truth, Tracks)
    for name, kind in (("burst", Burst), ("visits", Visits), ("ghosts", Ghosts), ("rig", Rig)):
        if not isinstance(switches[name], (kind, type(None))):
            got = type(switches[name]).__name__
            raise ParameterError(name, f"a {kind.__name__} or None", got)
    check_number("clutter", switches["clutter"], below=1e6)
    for name in ("missing", "nearby", "doubled", "dropped"):
        check_number(name, switches[name], above=0, below=1, closed=True)
    for name in ("clutter", "noise", "noise_spread", "margin", "merged"):
        check_number(name, switches[name], above=0, closed=True)
    for name in ("nearby_within", "doubled_apart"):
        check_number(name, switches[name], above=0)
    if switches["missing_run"]:
        if not 0 < switches["missing"] < 1:
            raise ParameterError("missing_run", "missing in (0, 1) beside it", switches["missing"])
        # As long as misses each on their own are, at least; the longest hold for all frames.
        least = 1 / (1 - switches["missing"])
        check_number("missing_run", switches["missing_run"], above=least, below=1e6, closed=True)
    check_number("jitter", switches["jitter"], above=0, closed=True)
    if switches["jitter"] >= 1:
        raise ParameterError("jitter", "a number in [0, 1)", switches["jitter"])
    for name in ("stride", "views"):
        check_number(name, switches[name], above=1, closed=True, integer=True)
    check_number("seed", switches["seed"], above=0, closed=True, integer=True)
    if switches["rig"] is not None and truth.detections.n_axes != 3:
        raise ParameterError("rig", "a 3-D scene", f"{truth.detections.n_axes}-D")
    if switches["rig"] is None:
        if switches["views"] != 2:
            raise ParameterError("views", "a rig beside it", "none")
    elif len(switches["rig"]) > 62:
        raise ParameterError("rig", "at most 62 cameras", len(switches["rig"]))
    elif switches["views"] > len(switches["rig"]):
        n = len(switches["rig"])
        raise ParameterError("views", f"at most {n}, the cameras of the rig", switches["views"])


def _record(switches: dict[str, Any]) -> dict[str, Any]:
    """Return the corruptions that were applied, as plain words and numbers."""
    defaults: dict[str, Any] = corrupt.__kwdefaults__ or {}
    # What only says how another switch works is worth telling when that one is on.
    details = {"nearby_within": "nearby", "doubled_apart": "doubled", "views": "rig"}
    record = {
        name: value
        for name, value in switches.items()
        if name == "seed" or value != defaults[name] or switches.get(details.get(name, ""))
    }
    for name in record.keys() & {"burst", "visits", "ghosts"}:
        record[name] = dataclasses.asdict(record[name])
    if "rig" in record:
        record["rig"] = list(record["rig"].names)
    return record


def _views(
    rng: np.random.Generator,
    mixed: Points,
    clean: Points,
    by_cameras: NDArray[np.int64] | None,
    sigma: NDArray[np.float64],
) -> dict[str, Any]:
    """Find which cameras saw each point, and how far their rays pass by it.

    The misfit of n rays, each off by `sigma` across, that were fitted by least squares has 2 n - 3
    degrees of freedom and is independent of the error of the point: so it is drawn, and tells
    nothing of the truth. A false point has what a true one has, drawn at random.
    """
    if by_cameras is None or not len(clean.frames):
        return {"cameras": None, "residuals": None}
    index = np.full((int(clean.frames.max()) + 1, int(clean.markers.max()) + 2), -1)
    index[clean.frames, clean.markers] = np.arange(len(clean.frames))
    index[:, -1] = -1  # where clutter of the original went
    at = index[np.minimum(mixed.frames, len(index) - 1), mixed.markers]
    cameras = by_cameras[at]
    is_false = np.flatnonzero(at < 0)
    if len(is_false) == len(at):
        return {"cameras": None, "residuals": None}
    like = rng.choice(np.flatnonzero(at >= 0), len(is_false))
    cameras[is_false] = cameras[like]
    markers = mixed.markers.copy()
    markers[is_false] = markers[like]
    n = sum((cameras >> i) & 1 for i in range(63))
    misfit = rng.chisquare(np.maximum(2 * n - 3, 1)) / np.maximum(n, 1)
    return {"cameras": cameras, "residuals": sigma[markers] * np.sqrt(misfit)}


def _shuffled(rng: np.random.Generator, parts: list[Points]) -> Points:
    frames = np.concatenate([part.frames for part in parts])
    # One integer key sorts by frame and shuffles within it, several times faster than two keys.
    dice = rng.integers(2**32, size=len(frames))
    order = np.argsort((frames << 32) | dice, kind="stable")
    del dice
    return Points(
        frames[order],
        np.concatenate([part.places for part in parts])[order],
        np.concatenate([part.markers for part in parts])[order],
    )


def _markers(
    truth: Tracks, chosen: NDArray[np.int64], keep_unnamed: bool
) -> tuple[Points, NDArray[np.int64]]:
    """Return the points that take part, in the frames that stay, and the tracks of the markers."""
    has_name = np.array([name is not None for name in truth.names], dtype=bool)
    if not has_name.any():
        has_name[:] = True
    number = np.append(np.where(has_name, np.cumsum(has_name) - 1, -1), -1)  # [-1] is clutter
    new_frame = np.full(truth.detections.n_frames, -1)
    new_frame[chosen] = np.arange(len(chosen))
    markers, frames = number[truth.labels], new_frame[truth.detections.frame_of]
    is_in = frames >= 0
    if not keep_unnamed:
        is_in &= markers >= 0
    points = Points(frames, truth.detections.points, markers)
    return points if is_in.all() else points.where(is_in), np.flatnonzero(has_name)


def _names(truth: Tracks, origin: NDArray[np.int64], *, is_anew: bool) -> tuple[str | None, ...]:
    """Return the names of the markers, with the number of the visit for successive visitors."""
    names = [truth.names[i] for i in origin]
    if not is_anew:
        return tuple(names)
    count: dict[int, int] = {}
    for k, i in enumerate(origin.tolist()):
        count[i] = count.get(i, 0) + 1
        names[k] = f"{names[k] if names[k] is not None else i}/{count[i]}"
    return tuple(names)


def _detections(
    source: Detections,
    chosen: NDArray[np.int64],
    times: NDArray[np.float64],
    mixed: Points,
    names: tuple[str | None, ...],
    stride: int,
    switches: dict[str, Any],
) -> Detections:
    """Return the points as detections that know of their file what `source` knew."""
    counts = np.bincount(mixed.frames, minlength=len(times))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    if not isinstance(source, Capture):
        return Detections(times=times, offsets=offsets, points=mixed.places)
    is_whole = len(chosen) == source.n_frames and not switches["jitter"]
    return replace(
        source,
        times=times,
        offsets=offsets,
        points=mixed.places,
        cameras=None,
        residuals=None,
        stds=None,
        covariances=None,
        # The rest of the file (analog channels, events) goes by its own frames: at another rate a
        # writer must not take it over.
        format=source.format if is_whole else "",
        rate=source.rate / stride,
        # Frame n of a file stands for the time (n - 1) / rate.
        first_frame=(source.first_frame - 1) // stride + 1,
        channels=np.full(len(mixed.markers), -1),
        labels=mixed.markers,
        names=names,
    )
