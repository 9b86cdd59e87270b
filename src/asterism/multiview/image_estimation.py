"""Estimation of the image model of a capture from its image points alone.

Each round reconstructs points with the current model and re-estimates the model from them: the
noise from the residuals, the detection probability from the cameras that miss a visible point, the
clutter from the unused image points, and the density and the volume from the points.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Observations, Rig
from asterism.checks import check_number
from asterism.multiview.correspondence import match_views, matched_rig
from asterism.multiview.image_model import ImageModel, widest_base

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.multiview.reconstruction import Reconstruction

__all__ = ["estimate_images"]

_STARTS_PX = (0.5, 2.0, 8.0)  # initial noise, tried until enough image points match
_ENOUGH = 0.5  # smallest share of image points that belong to a point in space
_ROUNDS = (0.25, 0.25, 0.25, 1.0, 1.0)  # shares of the frames; early rounds are slow
_MIN_PX = 0.01
_TRIM = 3.0  # standard deviations beyond which image points are merged or wrongly matched
_KEPT = 1 - _TRIM**2 / 2 * np.exp(-(_TRIM**2) / 2) / -np.expm1(-(_TRIM**2) / 2)
"""Share of the mean square of two coordinates that remains after the trimming."""


def estimate_images(
    observations: Observations,
    rig: Rig,
    *,
    sigma_px: float | None = None,
    gate: float = 4.0,
    n_frames: int = 24,
) -> ImageModel:
    """Estimate the image model of a capture from its image points.

    Parameters
    ----------
    observations : Observations
        Image points of all cameras.
    rig : Rig
        Calibrated cameras, matched to the observations by name.
    sigma_px : float, optional
        Known standard deviation of an image point, pixels per axis, > 0; by default it is estimated
        for each camera.
    gate : float
        As for `reconstruct`.
    n_frames : int
        Number of frames used, ≥ 1, spread evenly over the frames with image points in two cameras.
        Larger values are more accurate and need more time.

    Returns
    -------
    ImageModel
        If no point could be reconstructed, the default model with the given `sigma_px`.

    Raises
    ------
    ParameterError
        If a number is out of range, a camera is not in the rig, or there are fewer than two.

    Examples
    --------
    >>> import asterism as am
    >>> rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    >>> seeing = am.simulate.Seeing(noise_px=0.5)
    >>> film = am.simulate.film(am.simulate.cube(seed=1, frames=20), rig, seeing=seeing, seed=1)
    >>> model = am.multiview.estimate_images(film.observations, rig)
    >>> [round(sigma, 1) for sigma in model.sigma_px]
    [0.5, 0.4, 0.6, 0.5]
    """
    used, _ = matched_rig(observations, rig)
    check_number("n_frames", n_frames, above=1, closed=True, integer=True)
    if sigma_px is not None:
        check_number("sigma_px", sigma_px, above=0)
    seen = _sample(observations, int(n_frames))
    base = max(widest_base(used), 1e-6)
    per_image = seen.n_points / max(seen.n_frames * len(used), 1)
    best, most = ImageModel() if sigma_px is None else ImageModel(sigma_px=sigma_px), 0.0
    for start in (sigma_px,) if sigma_px is not None else _STARTS_PX:
        model = ImageModel(
            sigma_px=start,
            p_detection=0.8,
            clutter=max(0.5, 0.1 * per_image),
            density=max(per_image, 1.0) / base**3,
        )
        share = 0.0
        for part in _ROUNDS:
            some = _sample(seen, max(round(part * seen.n_frames), 1))
            made = match_views(some, used, model, gate=gate, merge_px=0.0)
            share = len(made.views.blobs) / max(some.n_points, 1)
            if not made.detections.n_points:
                break
            model = _updated(made, some, used, base, is_noise_known=sigma_px is not None)
        if share > most:
            best, most = model, share
        if share >= _ENOUGH:
            break
    return best


def _sample(observations: Observations, n: int) -> Observations:
    """Select evenly spread frames with image points in at least two cameras."""
    o, C = observations, observations.n_cameras
    useful = np.flatnonzero((o.counts > 0).sum(axis=1) >= 2)
    n = min(n, len(useful))
    frames = useful[np.unique(np.linspace(0, max(len(useful) - 1, 0), n).round().astype(int))]
    starts = o.offsets[::C].tolist()
    rows = [np.arange(starts[t], starts[t + 1]) for t in frames.tolist()]
    chosen = np.concatenate([np.empty(0, dtype=np.int64), *rows])
    counts = o.counts[frames].ravel()
    return Observations(
        times=o.times[frames],
        cameras=o.cameras,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=o.pixels[chosen],
    )


def _updated(
    made: Reconstruction, seen: Observations, rig: Rig, base: float, *, is_noise_known: bool
) -> ImageModel:
    """Estimate the image model from a reconstruction."""
    d, views = made.detections, made.views
    assert d.covariances is not None
    n_views = views.counts
    low, high, volume = _where(d.points[n_views >= min(3, len(rig))], base)
    left = np.bincount(seen.camera_of, minlength=len(rig)) - np.bincount(
        views.cameras, minlength=len(rig)
    )
    model = replace(
        made.model,
        p_detection=_detection(made, rig),
        clutter=tuple(((left + 0.5) / seen.n_frames).tolist()),
        density=d.n_points / seen.n_frames / volume,
        volume=(low, high),
    )
    return model if is_noise_known else replace(model, sigma_px=_noise(made, seen, rig))


def _where(
    points: NDArray[np.float64], base: float
) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Return the bounding box of points, extended by its size on each side, and its volume."""
    if not len(points):
        points = np.zeros((1, 3))
    low, high = np.percentile(points, [1, 99], axis=0)
    margin = np.maximum(high - low, 0.1 * base)
    low, high = low - margin, high + margin
    return tuple(low.tolist()), tuple(high.tolist()), float(np.prod(high - low))


def _detection(made: Reconstruction, rig: Rig) -> tuple[float, ...]:
    """Return each camera's share of detected points among those that two others see."""
    visible = rig.project(made.detections.points).visible
    views = made.views
    has = np.zeros(visible.shape, dtype=bool)
    has[views.cameras, views.point_of] = True
    visible = visible | has
    others = views.counts - has
    counted = visible & (others >= 2)
    # The prior share is one half.
    shares = ((counted & has).sum(axis=1) + 1) / (counted.sum(axis=1) + 2)
    return tuple(np.clip(shares, 0.05, 0.995).tolist())


def _noise(made: Reconstruction, seen: Observations, rig: Rig) -> tuple[float, ...]:
    """Return the noise of each camera from its residuals, corrected for degrees of freedom."""
    d, views = made.detections, made.views
    assert d.covariances is not None
    sigma, _, _ = made.model.of(rig)
    of = views.point_of
    squares, freedom = np.zeros(len(of)), np.zeros(len(of))
    for c, camera in enumerate(rig):
        own = views.cameras == c
        at = d.points[of[own]]
        off = seen.pixels[views.blobs[own]] - camera.project(at).pixels
        J = camera.jacobian(at)
        bent = np.einsum("nij,njk,nik->n", J, d.covariances[of[own]], J)
        squares[own] = (off**2).sum(axis=1) / sigma[c] ** 2
        freedom[own] = np.maximum(2 - bent / sigma[c] ** 2, 0.0)
    usable = np.isfinite(squares) & (squares < _TRIM**2)
    usable &= (views.counts[of] >= 3) | (len(rig) == 2)
    total = np.bincount(views.cameras, np.where(usable, squares, 0), len(rig))
    free = np.bincount(views.cameras, np.where(usable, freedom, 0), len(rig))
    everywhere = total.sum() / max(free.sum(), 1e-9)
    # A camera with few image points gets the value of the others.
    ratio = (total + 4 * everywhere) / (free + 4) / _KEPT
    return tuple(np.maximum(sigma * np.sqrt(ratio), _MIN_PX).tolist())
