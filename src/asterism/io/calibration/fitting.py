"""Fitting cameras to what a format can hold, with what that leaves over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from asterism.camera import BrownConrady, Lens, QuadraticCorrection, ReportRadial, Rig, ViconRadial
from asterism.camera.lens_fit import LensFit
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Camera
    from asterism.io.calibration.formats import Calibration

__all__ = ["fit_kind", "fit_to_format"]

_SIDE = 31  # pixels along the longer side of the image at which two cameras are compared
_FEWEST = 25  # of these, or there is nothing to fit a lens to
_KINDS: dict[str, type[Lens]] = {
    "BrownConrady": BrownConrady,
    "ViconRadial": ViconRadial,
    "QuadraticCorrection": QuadraticCorrection,
}
_POWERS: dict[type[Lens] | None, dict[str, int]] = {
    BrownConrady: {"k1": 2, "k2": 4, "p1": 1, "p2": 1, "k3": 6},
    ViconRadial: {"k1": 2, "k2": 4, "k3": 6},
    ReportRadial: {"a1": 2, "a2": 4},
}


@dataclass(frozen=True, kw_only=True)
class _Limits:
    has_skew: bool
    has_k3: bool


def fit_to_format(camera: Camera, format: Calibration) -> LensFit | None:
    """Give a camera the lens, and if need be the K, that a format can hold.

    Parameters
    ----------
    camera : Camera
        The camera.
    format : Calibration
        Where it is to go.

    Returns
    -------
    LensFit or None
        The new camera and its distance from this one; None if this one fits as it is.
    """
    try:
        format.write(Rig((camera.replace(name="camera"),)))
    except ParameterError:
        kind = None if camera.lens is None else _KINDS[format.lens]
        return fit_kind(camera, kind, has_skew=format.has_skew, has_k3=format.has_k3)
    return None


def fit_kind(
    camera: Camera, kind: type[Lens] | None, *, has_skew: bool = True, has_k3: bool = True
) -> LensFit:
    """Give a camera another kind of lens, fitted over the image.

    Where the lens has coordinates of its own (``K_lens``), or K a skew that must go, K and the
    direction of sight are fitted as well. The place of the camera never changes.

    Parameters
    ----------
    camera : Camera
        The camera.
    kind : type of Lens or None
        The lens it shall have. A `QuadraticCorrection` will be one of raw pixels.
    has_skew, has_k3 : bool
        Whether K may keep a skew, and the lens a k3.

    Returns
    -------
    LensFit
        The new camera and its distance from this one.
    """
    if kind is QuadraticCorrection:
        return _quadratic(camera)
    limits = _Limits(has_skew=has_skew, has_k3=has_k3)
    drops_skew = not has_skew and camera.K[0, 1] != 0
    refit = camera.K_lens is not None or drops_skew
    fits = [_Model(camera, kind, refit, limits).solve()]
    if fits[0].max_px >= max(camera.size_px) and kind is not None:
        # The best polynomial folds over within the image. One that does not is farther off where
        # it is seen, and nearer where the other sees nothing.
        fits.append(_Model(camera, None, refit, limits).solve())
        if has_k3 and not refit:
            fits.append(camera.with_lens(kind, refit_camera=refit))
    return min(fits, key=lambda fit: fit.rms_px)


def _grid(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixels all over the image, and their rays in the camera's frame; where the lens reaches."""
    width, height = camera.size_px
    step = max(width, height) / (_SIDE - 1)
    u, v = (np.linspace(0, n - 1, max(2, round(n / step) + 1)) for n in (width, height))
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    normalised = camera.undistort(pixels)
    is_reached = np.isfinite(normalised).all(axis=1)
    if is_reached.sum() < _FEWEST or not np.abs(normalised[is_reached]).max() > 0:
        expected = "one that reaches a part of the image, to fit another to"
        raise ParameterError(f"the lens of camera {camera.name!r}", expected, camera.lens)
    return pixels[is_reached], np.insert(normalised[is_reached], 2, 1.0, axis=1)


def _compared(
    old: Camera, new: Camera, pixels: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Where the new camera sees the rays of the old one, less where that saw them."""
    turned = rays @ old.T_camera_world[:3, :3] @ new.T_camera_world[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        return new.distort(turned[:, :2] / turned[:, 2:]) - pixels


def _result(
    old: Camera, new: Camera, pixels: NDArray[np.float64], rays: NDArray[np.float64]
) -> LensFit:
    distance = np.linalg.norm(_compared(old, new, pixels, rays), axis=1)
    # A ray that the new lens does not reach at all counts as far as the image is wide.
    distance = np.nan_to_num(distance, nan=float(max(old.size_px)))
    return LensFit(
        camera=new, rms_px=float(np.sqrt(np.mean(distance**2))), max_px=float(distance.max())
    )


def _quadratic(camera: Camera) -> LensFit:
    """Fit a correction of raw pixels, which is linear in its coefficients."""
    pixels, rays = _grid(camera)
    u, v = pixels.T
    size = float(max(camera.size_px))
    terms = np.stack([u, v, u * u, v * v, u * v, np.ones(len(u))], axis=1)
    scale = np.array([size, size, size**2, size**2, size**2, 1.0])
    ideal = (rays @ camera.K.T)[:, :2]
    solved = np.linalg.lstsq(terms / scale, ideal - pixels)[0].T / scale
    K = camera.K.copy()
    K[:2, 2] -= solved[:, 5]
    ex, ey = ((float(a), float(b), float(c), float(d), float(e)) for a, b, c, d, e, _ in solved)
    new = camera.replace(K=K, K_lens=np.eye(3), lens=QuadraticCorrection(ex=ex, ey=ey))
    return _result(camera, new, pixels, rays)


class _Model:
    """The pin-hole with a lens, as formulas of what is free: fast, and with no end of its domain.

    The free numbers are the coefficients, each counted by what it does at the corner of the image;
    then, where K and the direction of sight are free, the logarithms of the focal lengths, the
    principal point and the skew in focal lengths, and a rotation vector.
    """

    def __init__(self, old: Camera, kind: type[Lens] | None, refit: bool, limits: _Limits) -> None:
        self.old, self.kind, self.refit, self.limits = old, kind, refit, limits
        self.pixels, self.rays = _grid(old)
        reach = float(np.linalg.norm(self.rays[:, :2], axis=1).max())
        if kind is ViconRadial:
            reach *= float(old.K[0, 0])
        powers = dict(_POWERS[kind]) if kind in _POWERS else {}
        if not limits.has_k3:
            powers.pop("k3", None)
        self.scales = {name: reach**-power for name, power in powers.items()}
        self.n_free = len(powers) + (8 if refit else 0)

    def coefficients(self, x: NDArray[np.float64]) -> dict[str, float]:
        return {name: float(v * s) for v, (name, s) in zip(x, self.scales.items(), strict=False)}

    def matrices(self, x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give K and the rotation from the old camera's frame."""
        K = self.old.K.copy()
        if not self.limits.has_skew:
            K[0, 1] = 0.0
        if not self.refit:
            return K, np.eye(3)
        focal, free = K[0, 0], x[len(self.scales) :]
        K[0, 0] *= np.exp(free[0])
        K[1, 1] *= np.exp(free[1])
        K[:2, 2] += free[2:4] * focal
        if K[0, 1] != 0:
            K[0, 1] += free[4] * focal
        return K, np.asarray(Rotation.from_rotvec(free[5:]).as_matrix(), dtype=np.float64)

    def residual(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances in the image, of bent or of ideal pixels, whichever is the lens's direction."""
        K, R = self.matrices(x)
        k = self.coefficients(x)
        turned = self.rays @ R.T
        ideal = turned[:, :2] / turned[:, 2:]
        if self.kind is None or self.kind is BrownConrady:
            bent = _brown(ideal, **k) if k else ideal
            return (bent @ K[:2, :2].T + K[:2, 2] - self.pixels).ravel()
        if self.kind is ViconRadial:
            straight = _radial(self.pixels - K[:2, 2], [k["k1"], k["k2"], k["k3"]])
            return (ideal @ K[:2, :2].T - straight).ravel()
        bent = (self.pixels - K[:2, 2]) @ np.linalg.inv(K[:2, :2]).T
        return ((ideal - _radial(bent, [k["a1"], k["a2"]])) @ K[:2, :2].T).ravel()

    def solve(self) -> LensFit:
        x = np.zeros(self.n_free)
        if self.n_free:
            x = least_squares(self.residual, x, method="lm", x_scale="jac", max_nfev=4000).x
        K, R = self.matrices(x)
        T = self.old.T_camera_world.copy()
        T[:3] = R @ T[:3]
        values: dict[str, Any] = dict(self.coefficients(x))
        lens = None if self.kind is None else self.kind(**values)
        new = self.old.replace(K=K, T_camera_world=T, lens=lens, K_lens=None)
        return _result(self.old, new, self.pixels, self.rays)


def _brown(
    ideal: NDArray[np.float64], k1: float, k2: float, p1: float, p2: float, k3: float = 0.0
) -> NDArray[np.float64]:
    x, y = ideal.T
    q = x * x + y * y
    radial = 1 + q * (k1 + q * (k2 + q * k3))
    return np.stack(
        [x * radial + 2 * p1 * x * y + p2 * (q + 2 * x * x),
         y * radial + p1 * (q + 2 * y * y) + 2 * p2 * x * y],
        axis=1,
    )  # fmt: skip


def _radial(bent: NDArray[np.float64], k: list[float]) -> NDArray[np.float64]:
    q = (bent**2).sum(axis=1, keepdims=True)
    return bent * (1 + sum(c * q ** (i + 1) for i, c in enumerate(k)))
