"""Stone Soup: nearly constant velocity, global nearest neighbours on a k-d tree, or JPDA by EHM2.

Put together as its tutorials do: new tracks are held until they have several detections, and ended
after some frames without one.
"""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from peers import numpy_loop
from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["GNN", "JPDA"]


@dataclass
class _Parts:
    """What both associations need, all lengths in the clip's own."""

    sensor: Any
    predictor: Any
    updater: Any
    nearest: Any
    initiator: Any
    deleter: Any


def _parts(D: int, setting: Setting) -> _Parts:
    transition = module("stonesoup.models.transition.linear")
    sensor = module("stonesoup.models.measurement.linear").LinearGaussian(
        2 * D, list(range(0, 2 * D, 2)), setting["noise"] ** 2 * np.eye(D)
    )
    motion = transition.CombinedLinearGaussianTransitionModel(
        [transition.ConstantVelocity(setting["process"] ** 2)] * D
    )
    predictor = module("stonesoup.predictor.kalman").KalmanPredictor(motion)
    updater = module("stonesoup.updater.kalman").KalmanUpdater(sensor)
    hypothesiser = module("stonesoup.hypothesiser.distance").DistanceHypothesiser(
        predictor, updater, module("stonesoup.measures").Mahalanobis(), setting["gate"]
    )
    nearest = module("stonesoup.dataassociator.tree").DetectionKDTreeGNN2D(
        hypothesiser, predictor, updater, number_of_neighbours=5
    )
    deleter_of = module("stonesoup.deleter.time").UpdateTimeStepsDeleter
    covariance = np.diag([setting["noise"] ** 2, setting["speed"] ** 2] * D)
    initiator = module("stonesoup.initiator.simple").MultiMeasurementInitiator(
        prior_state=module("stonesoup.types.state").GaussianState(np.zeros((2 * D, 1)), covariance),
        deleter=deleter_of(2), data_associator=nearest, updater=updater,
        measurement_model=sensor, min_points=int(setting["least"]),
    )  # fmt: skip
    return _Parts(sensor, predictor, updater, nearest, initiator, deleter_of(setting["max_gap"]))


def _frames(d: am.Detections, sensor: Any) -> Any:
    """Give time and detections of every frame; each knows its own number."""
    Detection = module("stonesoup.types.detection").Detection
    start = datetime.datetime(2020, 1, 1)
    scale = length_of(d)
    for t, (_, points) in enumerate(d):
        now = start + datetime.timedelta(seconds=t)
        first = int(d.offsets[t])
        yield now, {
            Detection(p[:, None] / scale, timestamp=now, measurement_model=sensor,
                      metadata={"i": first + i})
            for i, p in enumerate(points)
        }  # fmt: skip


def _gnn(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    parts = _parts(d.n_axes, setting)
    Update = module("stonesoup.types.update").Update
    labels = np.full(d.n_points, -1)
    tracks: set[Any] = set()
    numbers: dict[str, int] = {}
    for now, found in _frames(d, parts.sensor):
        taken: set[Any] = set()
        for track, hypothesis in parts.nearest.associate(tracks, found, now).items():
            if hypothesis:
                track.append(parts.updater.update(hypothesis))
                labels[hypothesis.measurement.metadata["i"]] = numbers[track.id]
                taken.add(hypothesis.measurement)
            else:
                track.append(hypothesis.prediction)
        tracks -= parts.deleter.delete_tracks(tracks)
        for track in parts.initiator.initiate(found - taken, now):
            _begin(track, numbers, labels, Update)
            tracks.add(track)
    return drop_short(labels, 2)


def _jpda(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    parts = _parts(d.n_axes, setting)
    probable = module("stonesoup.hypothesiser.probability").PDAHypothesiser(
        parts.predictor, parts.updater, clutter_spatial_density=setting["clutter"],
        prob_detect=setting["detected"],
        # The library turns it back into a distance, which 1 would make infinite.
        prob_gate=min(float(chi2.cdf(setting["gate"] ** 2, d.n_axes)), 1 - 1e-12),
    )  # fmt: skip
    joint = module("stonesoup.dataassociator.probability").JPDAwithEHM2(probable)
    reduced = module("stonesoup.functions").gm_reduce_single
    StateVectors = module("stonesoup.types.array").StateVectors
    update = module("stonesoup.types.update")
    labels = np.full(d.n_points, -1)
    tracks: set[Any] = set()
    numbers: dict[str, int] = {}
    for now, found in _frames(d, parts.sensor):
        taken: set[Any] = set()
        # Two tracks may hold the same detection for their best: it goes to the more certain one.
        joined = joint.associate(tracks, found, now).items()
        for track, several in sorted(joined, key=lambda pair: -_greatest(pair[1])):
            states = [parts.updater.update(h) if h else h.prediction for h in several]
            mean, covariance = reduced(
                StateVectors([s.state_vector for s in states]),
                np.stack([s.covar for s in states], axis=2),
                np.array([h.probability for h in several]),
            )
            best = max(several, key=lambda h: float(h.probability))
            if best:
                state = update.GaussianStateUpdate(mean, covariance, several, now)
                track.append(state)
                if best.measurement not in taken:
                    labels[best.measurement.metadata["i"]] = numbers[track.id]
                taken.add(best.measurement)
            else:
                state_of = module("stonesoup.types.state").GaussianState
                track.append(state_of(mean, covariance, timestamp=now))
        tracks -= parts.deleter.delete_tracks(tracks)
        for track in parts.initiator.initiate(found - taken, now):
            _begin(track, numbers, labels, update.Update)
            tracks.add(track)
    return drop_short(labels, 2)


def _greatest(several: Any) -> float:
    """Give the probability of the most probable hypothesis."""
    return max(float(h.probability) for h in several)


def _begin(track: Any, numbers: dict[str, int], labels: NDArray[np.int64], update: Any) -> None:
    """Label the detections by which a track has come to be."""
    numbers[track.id] = len(numbers)
    for state in track:
        if isinstance(state, update):
            labels[state.hypothesis.measurement.metadata["i"]] = numbers[track.id]


_SPACE: dict[str, tuple[float, float]] = {
    "process": (0.02, 3.0), "noise": (0.01, 2.0), "speed": (0.5, 10.0), "gate": (3.0, 8.0),
    "max_gap": (3, 60), "least": (2, 8),
}  # fmt: skip

GNN = Peer(
    name="Stone Soup GNN", package="stonesoup", space=_SPACE, label=_gnn, like=numpy_loop.PEER
)
JPDA = Peer(
    name="Stone Soup JPDA",
    package="stonesoup",
    space=_SPACE | {"clutter": (1e-7, 1e-2), "detected": (0.7, 0.99)},
    label=_jpda,
    like=GNN,
)
