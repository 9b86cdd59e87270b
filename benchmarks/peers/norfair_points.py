"""norfair: points of videos in three dimensions, greedily by distance to a Kalman filter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from peers import numpy_loop
from peers.peer import Peer, Setting, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    norfair = module("norfair")
    scale = length_of(d)
    most = int(setting["max_gap"])
    tracker = norfair.Tracker(
        distance_function="euclidean",
        distance_threshold=setting["reach"],
        hit_counter_max=most,
        initialization_delay=min(int(setting["delay"]), most - 1),
        filter_factory=module("norfair.filter").OptimizedKalmanFilterFactory(
            R=setting["noise"] ** 2,
            Q=setting["process"] ** 2,
            pos_variance=setting["noise"] ** 2,
            vel_variance=setting["speed"] ** 2,
        ),
    )
    owner: list[tuple[int, Any]] = []
    for t, (_, points) in enumerate(d):
        first = int(d.offsets[t])
        found = [
            norfair.Detection(points=point[None] / scale, data=first + i)
            for i, point in enumerate(points)
        ]
        tracker.update(detections=found)
        owner += [
            (thing.last_detection.data, thing)
            for thing in tracker.tracked_objects
            if thing.last_detection.data >= first
        ]
    labels = np.full(d.n_points, -1)
    for i, thing in owner:
        # None if the track was never confirmed.
        labels[i] = -1 if thing.id is None else thing.id
    return labels


PEER = Peer(
    name="norfair",
    package="norfair",
    space={
        "reach": (1.0, 20.0), "max_gap": (3, 60), "delay": (1, 8),
        "noise": (0.01, 2.0), "process": (0.02, 3.0), "speed": (0.5, 10.0),
    },
    label=label,
    like=numpy_loop.PEER,
)  # fmt: skip
