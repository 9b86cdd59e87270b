"""Correspondence of image points in several cameras, and their triangulation, by frame."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from asterism import _engine
from asterism.camera import Observations, Rig
from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.model import Detections
from asterism.model.compiled import with_noise
from asterism.model.detections import FARTHEST
from asterism.multiview.reconstruction import Reconstruction, Views
from asterism.multiview.triangulation import triangulate

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.multiview.image_model import ImageModel

__all__ = ["match_views", "matched_rig"]

_CHUNK = 128  # frames of one call, between which progress is reported and an interrupt is handled


def match_views(
    observations: Observations,
    rig: Rig,
    model: ImageModel,
    *,
    min_views: int = 2,
    gate: float = 4.0,
    merge_px: float = 1.0,
    prior: Detections | None = None,
    max_nodes: int = 2000,
    n_threads: int = 1,
    advance: Callable[[int], None] | None = None,
) -> Reconstruction:
    """Match and triangulate image points with a given image model.

    Parameters
    ----------
    observations, rig, min_views, gate, merge_px, prior, max_nodes, n_threads, advance
        As for `reconstruct`.
    model : ImageModel
        Noise, missed detections and clutter of the images.

    Returns
    -------
    Reconstruction
    """
    used, numbers = matched_rig(observations, rig)
    check_number("min_views", min_views, above=2, below=len(used), closed=True, integer=True)
    check_number("gate", gate, above=0)
    check_number("merge_px", merge_px, above=0, closed=True)
    check_number("max_nodes", max_nodes, above=1, closed=True, integer=True)
    check_number("n_threads", n_threads, above=1, below=1024, closed=True, integer=True)
    sigma, p_detection, clutter = model.of(used)
    low, high = model.box(used)
    solver = _engine.ViewSolver(
        cameras=[camera.engine for camera in used],
        sigma=sigma,
        p_detection=p_detection,
        clutter=clutter,
        log_density=float(np.log(model.density)),
        gate=float(gate),
        min_views=int(min_views),
        low=low,
        high=high,
    )
    expected = _expected(prior, observations)
    places = with_noise(expected.points, expected.covariances)
    pieces: list[_Piece] = []
    figures, gap = np.zeros(3, dtype=np.int64), 0.0
    C, T = observations.n_cameras, observations.n_frames
    for begin in range(0, max(T, 1), _CHUNK):
        end = min(begin + _CHUNK, T)
        first, last = int(expected.offsets[begin]), int(expected.offsets[end])
        points, scores, counts, starts, blobs, counted, open_ = solver.reconstruct(
            observations.pixels,
            np.ascontiguousarray(observations.offsets[begin * C : end * C + 1]),
            places[first:last],
            np.ascontiguousarray(expected.offsets[begin : end + 1] - first),
            float(merge_px),
            int(max_nodes),
            int(n_threads),
        )
        figures, gap = figures + counted, gap + open_
        found = _Found(points, scores, counts, starts, blobs)
        pieces.append(_piece(found, observations, used, sigma, float(merge_px)))
        if advance is not None:
            advance(end)
    n_candidates, n_searched, n_cut = (int(n) for n in figures)
    info = {
        "n_candidates": n_candidates,
        "n_searched": n_searched,
        "n_cut": n_cut,
        "gap": gap,
    }
    return _joined(pieces, observations, numbers, model, info)


def matched_rig(observations: Observations, rig: Rig) -> tuple[Rig, NDArray[np.int64]]:
    """Return the cameras of the observations, in their order, and their numbers in the rig.

    Parameters
    ----------
    observations : Observations
        Image points of C cameras.
    rig : Rig
        Calibrated cameras.

    Returns
    -------
    rig : Rig
        The C cameras of the observations.
    numbers : ndarray of int, shape (C,)
        Their numbers in the given rig.

    Raises
    ------
    ParameterError
        If one is not in the rig, or there are fewer than two.
    """
    check_kind("observations", observations, Observations, "am.io.read_observations(path)")
    check_kind("rig", rig, Rig, "am.read_rig(path)")
    names = observations.cameras
    unknown = [name for name in names if name not in rig.names]
    if unknown:
        expected = f"the cameras of the observations ({', '.join(names)})"
        got = f"{', '.join(rig.names)}: no {', '.join(unknown)}"
        raise ParameterError("rig", expected, got)
    if len(names) < 2:
        hint = "add a second camera, without which there is no depth"
        raise ParameterError("observations", "two cameras or more", len(names), hint)
    numbers = np.array([rig.names.index(name) for name in names])
    return Rig(tuple(rig[int(i)] for i in numbers)), numbers


class _Found(NamedTuple):
    """Matches of the engine: points, scores, number of points by frame, and views (CSR)."""

    points: NDArray[np.float64]
    scores: NDArray[np.float64]
    counts: NDArray[np.int64]
    starts: NDArray[np.int64]
    blobs: NDArray[np.int64]


class _Piece(NamedTuple):
    """Result for some frames, with an entry for each point, frame or view."""

    points: NDArray[np.float64]
    covariances: NDArray[np.float64]
    residuals: NDArray[np.float64]
    scores: NDArray[np.float64]
    n_views: NDArray[np.int64]
    counts: NDArray[np.int64]
    cameras: NDArray[np.int64]
    blobs: NDArray[np.int64]


def _expected(prior: Detections | None, observations: Observations) -> Detections:
    if prior is None:
        offsets = np.zeros(observations.n_frames + 1, dtype=np.int64)
        return Detections(
            times=observations.times,
            offsets=offsets,
            points=np.empty((0, 3)),
            covariances=np.empty((0, 3, 3)),
        )
    check_kind("prior", prior, Detections, "am.filter.expected_positions(tracks, model)")
    if prior.n_axes != 3:
        raise ParameterError("prior", "3-D positions", f"{prior.n_axes}-D positions")
    if not np.array_equal(prior.times, observations.times):
        raise ParameterError("prior", "the times of the observations", "other times")
    if prior.covariances is None:
        raise ParameterError(
            "prior", "positions with covariances", "none", "try expected_positions(tracks, model)"
        )
    return prior


def _piece(
    found: _Found, observations: Observations, rig: Rig, sigma: NDArray[np.float64], merge_px: float
) -> _Piece:
    """Triangulate the engine's matches from the measured pixels."""
    points, scores, counts, starts, blobs = found
    cameras = observations.camera_of[blobs]
    views = Views(offsets=starts, cameras=cameras, blobs=blobs)
    of = views.point_of
    pixels = np.full((len(rig), len(points), 2), np.nan)
    pixels[cameras, of] = observations.pixels[blobs]
    noise = np.repeat(sigma[:, None], len(points), axis=1)
    merged = (cameras[views.is_shared], of[views.is_shared])
    noise[merged] = np.maximum(noise[merged], merge_px)
    solved = triangulate(pixels, rig, sigma_px=noise, start=points)
    squares = np.zeros(len(points))
    for c, camera in enumerate(rig):
        own = cameras == c
        away = solved.points[of[own]] - camera.center
        rays = camera.rays(observations.pixels[blobs[own]])
        squares[of[own]] += (np.cross(away, rays) ** 2).sum(axis=1)
    return _Piece(
        points=solved.points,
        covariances=solved.covariances,
        residuals=np.sqrt(squares / np.maximum(views.counts, 1)),
        scores=scores,
        n_views=views.counts,
        counts=counts,
        cameras=cameras,
        blobs=blobs,
    )


def _joined(
    pieces: list[_Piece],
    observations: Observations,
    numbers: NDArray[np.int64],
    model: ImageModel,
    info: dict[str, float],
) -> Reconstruction:
    all_of = _Piece(*(np.concatenate(parts) for parts in zip(*pieces, strict=True)))
    # Points without a position or a depth in the measured pixels are left out.
    is_known = np.isfinite(all_of.covariances).reshape(-1, 9).all(axis=-1)
    is_sound = np.logical_and(is_known, (np.abs(all_of.points) <= FARTHEST).all(axis=-1))
    of = np.repeat(np.arange(len(is_sound)), all_of.n_views)
    kept = is_sound[of]
    before = np.concatenate([[0], np.cumsum(is_sound)])
    masks = np.zeros(len(is_sound), dtype=np.int64)
    np.bitwise_or.at(masks, of, 1 << np.minimum(numbers[all_of.cameras], 62))
    P = all_of.covariances[is_sound]
    detections = Detections(
        times=observations.times,
        offsets=before[np.append(0, np.cumsum(all_of.counts))],
        points=all_of.points[is_sound],
        cameras=masks[is_sound] if numbers.max() <= 62 else None,
        residuals=all_of.residuals[is_sound],
        stds=np.sqrt(np.trace(P, axis1=1, axis2=2) / 3),
        covariances=(P + np.swapaxes(P, 1, 2)) / 2,
    )
    views = Views(
        offsets=np.append(0, np.cumsum(all_of.n_views[is_sound])),
        cameras=all_of.cameras[kept],
        blobs=all_of.blobs[kept],
    )
    return Reconstruction(
        detections=detections, views=views, scores=all_of.scores[is_sound], model=model, info=info
    )
