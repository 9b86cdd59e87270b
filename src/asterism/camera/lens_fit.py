"""From one lens model to another: by fit, with what it leaves over."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from asterism.camera.lens import BrownConrady, Lens, ReportRadial, ViconRadial
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera.camera import Camera

__all__ = ["LensFit", "fit_lens"]

FITTED, JUDGED = 31, 151
"""Pixels along the longer side of the image at which two lenses are fitted, and compared."""

_NUMBERS = {"k1": 2, "k2": 4, "k3": 6, "a1": 2, "a2": 4, "p1": 1, "p2": 1}
"""Power of the radius that each coefficient comes with."""


@dataclass(frozen=True, kw_only=True)
class LensFit:
    """A camera with another lens, and how far it is from the old one.

    Parameters
    ----------
    camera : Camera
        The camera with the fitted lens.
    rms_px, max_px : float
        Root mean square and greatest distance between where the two see the same ray, over the
        image, pixels.
    """

    camera: Camera
    rms_px: float
    max_px: float


def fit_lens(camera: Camera, kind: type[Lens] | None, *, refit_camera: bool = False) -> LensFit:
    """Fit a lens of another kind to the one that a camera has; see `Camera.with_lens`."""
    if kind not in (BrownConrady, ReportRadial, ViconRadial, None):
        raise ParameterError("kind", "BrownConrady, ReportRadial, ViconRadial or None", kind)
    pixels, rays = _image(camera, FITTED)
    free = _Free(camera, kind, refit_camera, rays)
    start = free.first_guess(pixels, rays)

    def residual(x: NDArray[np.float64]) -> NDArray[np.float64]:
        try:
            trial = free.camera(x)
        except ParameterError:  # a focal length below zero, say: far from anything
            return np.full(pixels.size, 1e3)
        seen = trial.distort(free.turned(x, rays))
        return np.nan_to_num(seen - pixels, nan=1e3).ravel()

    fitted = start
    if len(start):
        fitted = np.asarray(least_squares(residual, start, x_scale="jac", xtol=1e-15, ftol=1e-15).x)
    # Where a lens that bends at all would not reach the corners, a straight one may be better.
    tries = (fitted, np.zeros(len(start)))
    best = tries[int(np.argmin([np.sum(residual(x) ** 2) for x in tries]))]
    pixels, rays = _image(camera, JUDGED)
    distance = np.linalg.norm(residual(best).reshape(-1, 2), axis=1)
    return LensFit(
        camera=free.camera(best),
        rms_px=float(np.sqrt(np.mean(distance**2))),
        max_px=float(distance.max()),
    )


def _image(camera: Camera, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give pixels all over the image that the lens reaches, and their normalised coordinates."""
    w, h = camera.size_px
    step = (max(w, h) - 1) / (n - 1)
    across, down = (
        np.linspace(0, side - 1, max(2, round((side - 1) / step) + 1)) for side in (w, h)
    )
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    rays = camera.undistort(pixels)
    is_reached = np.isfinite(rays).all(axis=1)
    return pixels[is_reached], rays[is_reached]


class _Free:
    """What may change: the coefficients, and on request K and the direction of sight.

    A coefficient is counted by what it does at the corner of the image, so that all are alike.
    """

    def __init__(
        self, camera: Camera, kind: type[Lens] | None, refit: bool, rays: NDArray[np.float64]
    ) -> None:
        self.old, self.kind, self.refit = camera, kind, refit
        self.names = [] if kind is None else [field.name for field in fields(kind)]  # pyright: ignore[reportArgumentType]
        radius = float(np.linalg.norm(rays, axis=1).max())
        if kind is not None and kind.in_pixels:
            radius *= float(camera.K[0, 0])
        self.scale = np.array([radius ** -_NUMBERS[name] for name in self.names])
        self.focal = float(camera.K[0, 0])

    def first_guess(
        self, pixels: NDArray[np.float64], rays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Solve for the coefficients in lens coordinates, in which every model is linear."""
        n_free = len(self.names) + (8 if self.refit else 0)
        if self.kind is None:
            return np.zeros(n_free)
        matrix = self.old.replace(K_lens=None, lens=self.kind()).lens_matrix
        bent, ideal = (
            (np.column_stack([p, np.ones(len(p))]) @ np.linalg.solve(matrix, M).T)[:, :2]
            for p, M in ((pixels, np.eye(3)), (rays, self.old.K))
        )
        source, target = (bent, ideal) if self.kind.is_backward else (ideal, bent)
        x, y = source.T
        q = x**2 + y**2
        basis: list[NDArray[np.float64]] = []
        for name, scale in zip(self.names, self.scale, strict=True):
            if name == "p1":
                column = np.stack([2 * x * y, q + 2 * y**2], axis=1)
            elif name == "p2":
                column = np.stack([q + 2 * x**2, 2 * x * y], axis=1)
            else:
                column = source * (q ** (_NUMBERS[name] / 2))[:, None]
            basis.append(scale * column.ravel())
        solved = np.linalg.lstsq(np.stack(basis, axis=1), (target - source).ravel())[0]
        return np.concatenate([solved, np.zeros(n_free - len(solved))]).astype(np.float64)

    def camera(self, x: NDArray[np.float64]) -> Camera:
        n = len(self.names)
        values: dict[str, Any] = dict(
            zip(self.names, (float(v) for v in x[:n] * self.scale), strict=True)
        )
        changes: dict[str, Any] = {"lens": None if self.kind is None else self.kind(**values)}
        if self.refit:
            K = self.old.K.copy()
            K[0, 0] *= np.exp(x[n])
            K[1, 1] *= np.exp(x[n + 1])
            K[[0, 0, 1], [1, 2, 2]] += x[n + 2 : n + 5] * self.focal
            T = self.old.T_camera_world.copy()
            T[:3] = self._turn(x) @ T[:3]
            changes |= {"K": K, "T_camera_world": T}
        return self.old.replace(K_lens=None, **changes)

    def turned(self, x: NDArray[np.float64], rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """Give the old camera's normalised coordinates in the new camera's frame."""
        if not self.refit:
            return rays
        d = np.column_stack([rays, np.ones(len(rays))]) @ self._turn(x).T
        return d[:, :2] / d[:, 2:]

    def _turn(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(Rotation.from_rotvec(x[-3:]).as_matrix(), dtype=np.float64)
