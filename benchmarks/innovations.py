"""Prediction errors of markers with and without bonds, and how they compare with their variance.

The true tracks of captures as recorded, and with every second frame. Each detection is predicted
from the detections of its marker in earlier frames, by the estimated model and by that of
`fit_body_motion`. With bonds, the prediction by the latter is combined, like a measurement, with
the position that the six steadiest bonded neighbours predict by their motion since the frame
before; at least three are needed. The NIS is the squared error of an axis over its predicted
variance, 1 in the mean if calibrated. A marker is predicted from its third detection in a row on.

    python benchmarks/innovations.py [--data FOLDER] [--only NAME] [--markdown FILE]
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism import _engine
from asterism.model.compiled import transition
from asterism.tracking.estimation import fit_body_motion
from captures import captures, options_of_the_run
from report import conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

MIN_TOGETHER, MAX_DEVIATION, MIN_NEIGHBOURS, MAX_NEIGHBOURS = 20, 0.1, 3, 6
"""A bond: frames together, and deviation as a share of the distance. Neighbours that predict."""
WAYS = ("own motion", "own motion, of bodies", "with bonds")


class Filters:
    """A filter with several motions for each of K markers, written out in NumPy."""

    def __init__(self, model: am.TrackingModel, n: int, n_axes: int, step: float) -> None:
        self.F, self.Q = transition(model.motion, step)
        self.T = np.asarray(model.motion.mode_transitions)
        self.r = model.sensor.noise_sigma**2
        self.P0 = model.initial_covariance(n_axes)
        n_modes, size = len(self.T), len(self.P0)
        self.weight = np.full((n, n_modes), 1 / n_modes)
        self.x = np.zeros((n, n_modes, size, n_axes))
        self.P = np.zeros((n, n_modes, size, size))

    def begin(self, markers: NDArray[np.int64], y: NDArray[np.float64]) -> None:
        """Start markers at their detections."""
        self.weight[markers] = 1 / self.weight.shape[1]
        self.x[markers] = 0
        self.x[markers, :, 0] = y[:, None]
        self.P[markers] = self.P0

    def predict(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Predict all markers by a step; return positions (K, D), and variances along an axis."""
        mixed = self.weight[:, :, None] * self.T
        self.weight = mixed.sum(axis=1)
        share = mixed / np.maximum(self.weight, 1e-300)[:, None]
        x = np.einsum("kij,kisd->kjsd", share, self.x)
        off = self.x[:, :, None] - x[:, None]
        D = self.x.shape[-1]
        P = np.einsum("kij,kist->kjst", share, self.P)
        P += np.einsum("kij,kijsd,kijtd->kjst", share, off, off) / D
        self.x = self.F @ x
        self.P = self.F @ P @ self.F.transpose(0, 2, 1) + self.Q
        at = np.einsum("kj,kjd->kd", self.weight, self.x[:, :, 0])
        off2 = ((self.x[:, :, 0] - at[:, None]) ** 2).sum(axis=2) / D
        return at, (self.weight * (self.P[:, :, 0, 0] + off2)).sum(axis=1)

    def update(self, markers: NDArray[np.int64], y: NDArray[np.float64]) -> None:
        """Update markers by their detections."""
        x, P = self.x[markers], self.P[markers]
        S = P[:, :, 0, 0] + self.r
        off = y[:, None] - x[:, :, 0]
        gain = P[:, :, :, 0] / S[:, :, None]
        self.x[markers] = x + gain[..., None] * off[:, :, None]
        self.P[markers] = P - gain[..., None] * P[:, :, None, 0]
        logs = -0.5 * ((off**2).sum(axis=2) / S + y.shape[1] * np.log(S))
        weight = self.weight[markers] * np.exp(logs - logs.max(axis=1, keepdims=True))
        self.weight[markers] = weight / weight.sum(axis=1, keepdims=True)


def with_bonds(
    bonds: tuple[NDArray[Any], ...], k: int, before: NDArray[np.float64],
    now: NDArray[np.float64], own: tuple[NDArray[np.float64], float], r: float,
) -> tuple[NDArray[np.float64], float]:  # fmt: skip
    """Combine the prediction of marker k with that of its bonded neighbours: position, variance."""
    others, n, mean, _, variance = bonds
    is_bond = (n >= MIN_TOGETHER) & (variance <= (MAX_DEVIATION * mean) ** 2)
    is_bond &= np.isfinite(before[others] + now[others]).all(axis=1)
    used = np.flatnonzero(is_bond)
    used = used[np.argsort(variance[used], kind="stable")][:MAX_NEIGHBOURS]
    if len(used) < MIN_NEIGHBOURS:
        return own
    ids = others[used]
    then = before[[k]]
    place, v, _ = _engine.carried(before[ids], now[ids], 1 / variance[used], then, r, then)
    place = place[: now.shape[1]]
    share = own[1] / (own[1] + v)
    return own[0] + share * (place - own[0]), share * v


def innovations(
    at: NDArray[np.float64], model: am.TrackingModel, step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return error and NIS of an axis of each prediction, (n, 2): by own motion, and with bonds.

    Parameters
    ----------
    at : ndarray of shape (T, K, D)
        Detections of the markers, NaN where there is none.
    model : TrackingModel
        Model of motion and noise.
    step : float
        Time between two frames, seconds.
    """
    _, n, n_axes = at.shape
    filters = Filters(model, n, n_axes, step)
    neighbours = _engine.Neighbours(n_axes, filters.r)
    age = np.zeros(n, dtype=np.int64)  # frames in a row in which the marker was detected
    before = at[0]
    found: list[list[tuple[float, float]]] = [[], []]
    for y in at:
        places, variances = filters.predict()
        is_seen = np.isfinite(y).all(axis=1)
        for k in np.flatnonzero(is_seen & (age >= 2)):
            own = places[k], float(variances[k])
            bonds = neighbours.of(int(k))
            both = with_bonds(bonds, int(k), before, y, own, filters.r)
            for each, (place, v) in zip(found, (own, both), strict=True):
                error2 = float(((y[k] - place) ** 2).sum())
                each.append((error2**0.5, error2 / n_axes / (v + filters.r)))
        new = np.flatnonzero(is_seen & (age == 0))
        filters.begin(new, y[new])
        old = np.flatnonzero(is_seen & (age > 0))
        filters.update(old, y[old])
        seen = np.flatnonzero(is_seen)
        neighbours.add(seen, np.ascontiguousarray(y[seen]))
        age, before = np.where(is_seen, age + 1, 0), y
    return np.array(found[0]), np.array(found[1])


def main() -> None:
    options = options_of_the_run(__doc__)
    rows: list[list[str]] = []
    for path in captures(options.data):
        capture = am.read(path) if options.only in path.name else None
        if capture is None or not any(capture.names):
            continue
        for rate, stride in (("as captured", 1), ("half rate", 2)):
            truth = am.simulate.corrupt(capture.tracks, stride=stride)
            d = truth.detections
            model = am.estimate_model(d).model
            fitted = fit_body_motion(d, model)
            at, step = truth.positions(), d.step or 1.0
            found = [innovations(at, model, step)[0]]
            if fitted is not None:
                found += innovations(at, fitted[0], step)
            row = [path.name, rate]
            for each in found:
                size = 1e3 * np.quantile(each[:, 0], [0.5, 0.99])
                row += [f"{size[0]:.1f} / {size[1]:.0f}", f"{each[:, 1].mean():.2f}"]
            rows.append(row + ["–"] * (2 + 2 * len(WAYS) - len(row)))
            print(*rows[-1], sep=" | ", flush=True)
    head = ["capture", "rate"]
    for way in WAYS:
        head += [f"{way}: median / 99 %, mm", "NIS"]
    publish([*table(head, rows), "", f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
