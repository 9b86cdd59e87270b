"""btrack: cells, by a belief matrix over Kalman filters; its linking, without its later repair."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

import numpy as np

from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    btrack, types = module("btrack"), module("btrack.btypes")
    logging.getLogger("btrack").setLevel(logging.CRITICAL)
    points = d.points / length_of(d)
    if d.n_axes == 2:
        points = np.column_stack([points, np.zeros(d.n_points)])
    one, zero = np.eye(3), np.zeros((3, 3))
    q = setting["process"] ** 2
    model = module("btrack.models").MotionModel(
        measurements=3,
        states=6,
        A=np.block([[one, one], [zero, one]]),
        H=np.hstack([one, zero]),
        P=np.kron(np.diag([setting["noise"] ** 2, setting["speed"] ** 2]), one),
        Q=q * np.kron([[1 / 4, 1 / 2], [1 / 2, 1]], one),
        R=setting["noise"] ** 2 * one,
        accuracy=setting["accuracy"],
        max_lost=int(setting["max_gap"]),
        prob_not_assign=setting["not_assigned"],
    )
    labels = np.full(d.n_points, -1)
    frames = d.frame_of
    with btrack.BayesianTracker(verbose=False) as tracker:
        tracker.configure(
            module("btrack.config").TrackerConfig(
                motion_model=model, max_search_radius=setting["reach"], enable_optimisation=False
            )
        )
        low, high = points.min(axis=0) - 1, points.max(axis=0) + 1
        objects = []
        for point, frame in zip(points, frames, strict=True):
            one_object = types.PyTrackObject()
            one_object.x, one_object.y, one_object.z = point
            one_object.t = int(frame)
            objects.append(one_object)
        tracker.append(objects)
        tracker.volume = tuple(zip(low, high, strict=True))
        tracker.track(step_size=1000)
        for i, refs in enumerate(tracker.refs):
            seen = np.array([r for r in refs if r >= 0], dtype=np.int64)  # the others fill gaps
            labels[seen] = i
    return drop_short(labels, setting["least"])


PEER = Peer(
    name="btrack",
    package="btrack",
    space={
        "process": (0.05, 5.0), "noise": (0.05, 3.0), "speed": (1.0, 30.0), "reach": (3.0, 60.0),
        "accuracy": (1.0, 15.0), "not_assigned": (0.001, 0.3), "max_gap": (1, 60), "least": (2, 10),
    },
    label=label,
)  # fmt: skip
