"""Markers that accelerate together: the density of detections given those of bonded markers.

The markers are ordered. The joint density of a frame is the product of one conditional density
each, given the past and the markers before it, so that the log posterior of a partition remains one
number:

    log π(ω) + Σ gain(y),  gain(y) = log Σ_c w_c p_c(y) - log p(y)

p is the density by the marker's own motion, which `track_scores` has, or anywhere in the volume for
the first detection of a track. p_c are the `COMPONENTS`: that density, two with a smaller variance,
one with a larger one for jolts, and those in which the position is also predicted by the
acceleration or by the rigid motion of neighbours (`engine/rigid/shared_acceleration.hpp` has the
formulas). The weights w_c are learnt for each marker. Those of a marker that moves independently
are of its own motion alone, the first `N_OWN`.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from asterism import _engine
from asterism.checks import check_array, check_kind
from asterism.errors import ParameterError
from asterism.model.compiled import motion_model, steps_of, with_noise
from asterism.model.tracking_model import TrackingModel
from asterism.model.tracks import Tracks
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["COMPONENTS", "SharedAcceleration", "shared_gains"]

COMPONENTS = (
    "own", "still 0.1", "still 0.5", "wide 8", "field 0.1", "field 0.5", "rigid 0.25", "rigid 1",
    "shape", "shape, rigid 0.25", "shape, rigid 1",
)  # fmt: skip
"""Predictions of a detection, with the factors of their variances.

own
    By the marker's own motion.
still
    By it, and by no acceleration.
wide
    By it, with a larger variance.
field
    By it, and by the acceleration of its neighbours: an affine field.
rigid
    By it, and by the rigid motion of its neighbours since the detection before.
shape
    By it, and by the place of the marker in the shape of its neighbours.

The first detection of a track is anywhere in the volume ("own"), or at its place in the shape.
"""
N_OWN = 4
"""Number of the first components: of own motion alone. Without a neighbour there is only "own"."""


@record(eq=False)
class SharedAcceleration:
    """How K markers accelerate together: their bonds, their shape, and the weights of predictions.

    Parameters
    ----------
    offsets : ndarray of int, shape (K + 1,)
        Bonds of marker k are those from ``offsets[k]`` to ``offsets[k + 1]``, the steadiest first.
    others : ndarray of int, shape (B,)
        Other marker of each bond, which comes before marker k.
    distances : ndarray of shape (B,)
        Usual distance, metres.
    variances : ndarray of shape (B,)
        Predictive variance of the distance, m².
    shape : ndarray of shape (B, D)
        Position of the other marker in a frame in which the distances of marker k were usual,
        metres; NaN if it was not detected there.
    own_shape : ndarray of shape (K, D)
        Position of the markers themselves in these frames.
    weights, begin_weights : ndarray of shape (K, C)
        Weight of each of the `COMPONENTS`, with the sum 1, and the same for the first detection of
        a track.
    volume : float
        Volume in which a track may begin, m³ (m² in 2-D).
    size, size_std : float
        Standard deviation of the acceleration that bonded markers have in common, as the σ of
        `DWNA`, m/s², and its standard error. They describe the capture; the density does not depend
        on them.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=60, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> shared = am.tracking.learn_shared_acceleration(truth, model)
    >>> shared
    SharedAcceleration(53 markers, 704 bonds, 10 m/s² in common, weight of own motion 0.10)
    """

    offsets: NDArray[np.int64]
    others: NDArray[np.int32]
    distances: NDArray[np.float64]
    variances: NDArray[np.float64]
    shape: NDArray[np.float64]
    own_shape: NDArray[np.float64]
    weights: NDArray[np.float64]
    begin_weights: NDArray[np.float64]
    volume: float
    size: float = 0.0
    size_std: float = math.nan

    def __repr__(self) -> str:
        own = float(self.weights[:, :N_OWN].sum(axis=1).mean()) if len(self.weights) else 1.0
        common = f"{self.size:.2g} m/s²" if self.size else "nothing"
        return (
            f"SharedAcceleration({len(self.weights)} markers, {len(self.others)} bonds, {common} "
            f"in common, weight of own motion {own:.2f})"
        )

    @cached_property
    def compiled(self) -> _engine.SharedAcceleration:
        """The same as an engine object."""
        with np.errstate(divide="ignore"):
            log_weights, log_begin_weights = np.log(self.weights), np.log(self.begin_weights)
        return _engine.SharedAcceleration(
            offsets=self.offsets, others=self.others, distances=self.distances,
            variances=self.variances, shape=self.shape, own_shape=self.own_shape,
            log_weights=log_weights, log_begin_weights=log_begin_weights, volume=self.volume,
        )  # fmt: skip

    def concerned(self, markers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return the markers whose gains depend on the detections of some markers.

        Parameters
        ----------
        markers : ndarray of int, shape (n,)
            Markers.

        Returns
        -------
        ndarray of bool, shape (K,)
            True for the markers themselves, and for those that they predict.
        """
        found = np.zeros(len(self.weights), dtype=bool)
        found[markers] = True
        later = np.repeat(np.arange(len(found)), np.diff(self.offsets))
        found[later[found[self.others]]] = True
        return found


def shared_densities(
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration,
    markers: NDArray[np.int64] | None = None,
    is_counted: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the log density of each detection by each component, and the predictions.

    Parameters
    ----------
    tracks, model, shared, markers, is_counted
        As for `shared_gains`.

    Returns
    -------
    densities : ndarray of shape (N, C)
        -inf for a component without neighbours, or that the first detection of a track does not
        have; NaN for clutter, and for a track that is of no marker or not counted.
    predicted : ndarray of shape (N, D + 1)
        Mean of the mixture, metres, and variance of a measured coordinate, m²; NaN as above, and
        for the first detection of a track.

    Raises
    ------
    ParameterError
        As for `shared_gains`.
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    check_kind("shared", shared, SharedAcceleration, "am.tracking.learn_shared_acceleration(…)")
    d, of = tracks.detections, _marker_of(tracks, shared, markers)
    if is_counted is None:
        is_counted = np.ones(tracks.n_tracks, dtype=bool)
    elif is_counted.shape != of.shape:
        raise ParameterError("is_counted", f"{tracks.n_tracks} truth values", is_counted)
    order, offsets = tracks.by_track
    kind, F, Q = steps_of(model.motion, d.times)
    points = with_noise(d.points, d.covariances)
    found = np.full((d.n_points, len(COMPONENTS)), np.nan)
    predicted = np.full((d.n_points, d.n_axes + 1), np.nan)
    found[order], predicted[order] = _engine.shared_densities(
        shared.compiled, motion_model(model, d.n_axes), of.astype(np.int32), is_counted,
        points[order], d.frame_of[order], offsets, d.times, kind, F, Q,
    )  # fmt: skip
    return found, predicted


def shared_gains(
    tracks: Tracks,
    model: TrackingModel,
    shared: SharedAcceleration,
    markers: NDArray[np.int64] | None = None,
    is_counted: NDArray[np.bool_] | None = None,
) -> NDArray[np.float64]:
    """Compute what shared accelerations add to the log density of each detection, in nats.

    Parameters
    ----------
    tracks : Tracks
        Partition of the detections into tracks and clutter.
    model : TrackingModel
        Model of the markers' own motion.
    shared : SharedAcceleration
        How markers accelerate together.
    markers : array_like of int, shape (K,), optional
        Marker of each track, -1 for none; by default track k is of marker k. A marker that has
        detections of two tracks in a frame is no neighbour there.
    is_counted : ndarray of bool, shape (K,), optional
        Tracks whose gains are computed, all by default. The others are neighbours only.

    Returns
    -------
    ndarray of shape (N,)
        0 for clutter, and for a track that is of no marker or not counted.

    Raises
    ------
    ParameterError
        If there is not one marker, or one truth value, for each track.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(frames=60, seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> shared = am.tracking.learn_shared_acceleration(truth, model)
    >>> bool(am.model.shared_gains(truth, model, shared).sum() > 1000)
    True
    """
    densities, predicted = shared_densities(tracks, model, shared, markers, is_counted)
    of = _marker_of(tracks, shared, markers)
    gains = np.zeros(len(densities))
    has = np.flatnonzero(np.isfinite(densities[:, 0]))
    is_first, marker = np.isnan(predicted[has, 0]), of[tracks.labels[has]]
    weights = np.where(is_first[:, None], shared.begin_weights[marker], shared.weights[marker])
    log_weights = _log_weights(densities[has], weights)
    gains[has] = _log_sum(log_weights + densities[has]) - densities[has, 0]
    return gains


def _marker_of(
    tracks: Tracks, shared: SharedAcceleration, markers: NDArray[np.int64] | None
) -> NDArray[np.int64]:
    """Return the marker of each track, -1 for none."""
    K, of = len(shared.weights), np.arange(tracks.n_tracks)
    if markers is not None:
        of = check_array("markers", markers, ("K",), dtype=np.int64)
    if len(of) != tracks.n_tracks or (len(of) and not -1 <= of.min() <= of.max() < K):
        raise ParameterError("markers", f"one of {K} markers for each track, or -1", markers)
    return of


def _log_weights(
    densities: NDArray[np.float64], weights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the logarithms of weights, with the sum 1 for the components that there are."""
    with np.errstate(divide="ignore"):
        logs = np.where(np.isfinite(densities), np.log(weights), -np.inf)
    return logs - _log_sum(logs)[:, None]


def _log_sum(logs: NDArray[np.float64]) -> NDArray[np.float64]:
    highest = logs.max(axis=1, initial=-np.inf)
    return highest + np.log(np.exp(logs - highest[:, None]).sum(axis=1))
