"""Corruption of a scene or a capture with known truth: missed detections, clutter and noise.

Each kind of failure of real captures is an option of `corrupt`, because trackers fail on them
differently: isolated missed detections, occlusions, clutter, ghosts, noise, a low frame rate.
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
from asterism.simulate.missed_points import come_and_go, in_bursts, merge, seen_by_rig, shadowed
from asterism.simulate.sampling import jittered, kept_frames
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
    """Corrupt a scene or a capture with known truth, and return the truth of the result.

    Each option draws from its own stream of random numbers. Changing one option leaves the random
    choices of the others unchanged: with and without clutter, the same detections are missing.

    Parameters
    ----------
    truth : Tracks
        Ground truth. If any track has a name, the named tracks are the markers; otherwise all are.
    missing : float
        Probability that a detection is missing, in [0, 1]; independent unless `missing_run` is set.
    missing_run : float
        Mean length of bursts of missed detections, frames (Gilbert 1960): the model's P_r is its
        inverse. 0 for independent missed detections.
    clutter : float
        Expected number of false alarms per frame, ≥ 0, as a share of the mean number of markers in
        a frame of the original. The number is Poisson; positions are uniform over the bounding box.
    noise : float
        Standard deviation of isotropic normal noise on every point, metres, ≥ 0.
    noise_spread : float
        Variation of the noise between markers, ≥ 0: the standard deviation of the logarithm of each
        marker's noise factor.
    burst : Burst, optional
        Occlusions: bursts of missed detections.
    visits : Visits, optional
        Markers that enter and leave; each visit is a marker of its own.
    rig : Rig, optional
        Cameras; a marker that fewer than `views` of them see past the surfaces of the truth is
        missing. 3-D only.
    views : int
        Smallest number of cameras that must see a marker, ≥ 1.
    ghosts : Ghosts, optional
        False points that accompany a marker for some frames.
    nearby : float
        Probability that a detected marker has a false point beside it for one frame, in [0, 1].
    nearby_within : float
        Largest distance of such a point, metres, > 0.
    doubled : float
        Probability that a marker is detected as two points, in [0, 1]; the second one is false.
    doubled_apart : float
        Distance between the two points, metres, > 0.
    merged : float
        Distance below which points of a frame become one point at their mean, metres, of the marker
        with the lowest number; 0 for never.
    stride : int
        Step between kept frames, ≥ 1; larger values lower the frame rate.
    dropped : float
        Probability that a frame is lost, in [0, 1].
    jitter : float
        Largest shift of a frame's time, in either direction, is half of this share of the frame
        interval, in [0, 1).
    margin : float
        Extension of the bounding box for clutter on every side, metres, ≥ 0.
    keep_unnamed : bool
        Whether points of no marker (clutter, and unnamed tracks beside named ones) stay as clutter.
        By default they are removed, because their true markers are unknown.
    seed : int
        Seed of all random numbers.

    Returns
    -------
    Truth
        Truth of the result. `detections` holds the points in random order within each frame,
        `labels` the marker of each, -1 for false points. `names` lists every marker, detected or
        not, and `record` the options that were set. With a rig, detections have their cameras. The
        detections of a `Capture` are a `Capture` with the same file and units, no channels, labels
        or names, and rate and first frame according to the stride. Its format is empty if frames
        were left out or shifted, because the rest of the file no longer matches.

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
        times, places = jittered(rng_jitter, jitter, times, whole)
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
            _detections(truth.detections, chosen, times, mixed, stride, switches),
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
    """Draw which points are detected; `run` is the mean length of a burst, or 0."""
    if not run:
        return (whole.markers < 0) | (rng.random(len(whole.markers)) >= missing)
    is_missed = in_bursts(rng, missing, run, n_frames, n_markers)
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
            raise ParameterError(
                "missing_run", "missing in (0, 1) to go with it", switches["missing"]
            )
        # The lower bound is the mean length of runs of independent missed detections.
        shortest = 1 / (1 - switches["missing"])
        check_number("missing_run", switches["missing_run"], above=shortest, below=1e6, closed=True)
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
            raise ParameterError("views", "2, or a rig to go with it", switches["views"])
    elif len(switches["rig"]) > 62:
        raise ParameterError("rig", "at most 62 cameras", len(switches["rig"]))
    elif switches["views"] > len(switches["rig"]):
        n = len(switches["rig"])
        raise ParameterError(
            "views", f"at most {n}, the number of cameras of the rig", switches["views"]
        )


def _record(switches: dict[str, Any]) -> dict[str, Any]:
    """Return the corruptions that were applied, as plain words and numbers."""
    defaults: dict[str, Any] = corrupt.__kwdefaults__ or {}
    # A detail of another option is recorded if that option is set.
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
    """Return the cameras of each point, and its residual distance from their rays.

    The residual of n rays, each with an error of `sigma` across, has 2 n - 3 degrees of freedom
    after a least-squares fit and is independent of the error of the point. It is drawn, so it does
    not reveal the truth. A false point has the values of a random true point.
    """
    if by_cameras is None or not len(clean.frames):
        return {"cameras": None, "residuals": None}
    index = np.full((int(clean.frames.max()) + 1, int(clean.markers.max()) + 2), -1)
    index[clean.frames, clean.markers] = np.arange(len(clean.frames))
    index[:, -1] = -1  # clutter of the original has no marker
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
    """Return the points used in the kept frames, and the track of each marker."""
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
    stride: int,
    switches: dict[str, Any],
) -> Detections:
    """Return the points as detections with the file information of `source`."""
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
        # Analog channels and events of the file have the original frames, so a writer must not
        # copy them at another rate.
        format=source.format if is_whole else "",
        rate=source.rate / stride,
        # Frame n of a file has the time (n - 1) / rate.
        first_frame=(source.first_frame - 1) // stride + 1,
        channels=np.full(len(mixed.markers), -1),
        labels=np.full(len(mixed.markers), -1),
        names=(),
    )
