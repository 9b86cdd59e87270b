"""btrack: cells, by a belief matrix over Kalman filters, then tracks joined by an optimisation."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from peers import numpy_loop
from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def _config(setting: Setting) -> Any:
    """Both steps that its guide describes: motion for the tracks, hypotheses for joining them."""
    models = module("btrack.models")
    one, zero = np.eye(3), np.zeros((3, 3))
    motion = models.MotionModel(
        measurements=3,
        states=6,
        A=np.block([[one, one], [zero, one]]),
        H=np.hstack([one, zero]),
        P=np.kron(np.diag([setting["noise"] ** 2, setting["speed"] ** 2]), one),
        Q=setting["process"] ** 2 * np.kron([[1 / 4, 1 / 2], [1 / 2, 1]], one),
        R=setting["noise"] ** 2 * one,
        accuracy=setting["accuracy"],
        max_lost=int(setting["max_gap"]),
        prob_not_assign=setting["not_assigned"],
    )
    joining = models.HypothesisModel(
        hypotheses=["P_FP", "P_init", "P_term", "P_link"],
        lambda_time=5.0, lambda_dist=5.0, lambda_link=setting["join"], lambda_branch=50.0,
        eta=1e-10, theta_dist=5.0, theta_time=5.0,
        dist_thresh=3 * setting["join"], time_thresh=setting["join_gap"], apop_thresh=1,
        segmentation_miss_rate=0.1, apoptosis_rate=1e-3, relax=True,
    )  # fmt: skip
    return module("btrack.config").TrackerConfig(
        motion_model=motion, hypothesis_model=joining, max_search_radius=setting["reach"]
    )


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    btrack, types = module("btrack"), module("btrack.btypes")
    logging.getLogger("btrack").setLevel(logging.CRITICAL)
    points = d.points / length_of(d)
    if d.n_axes == 2:
        points = np.column_stack([points, np.zeros(d.n_points)])
    labels = np.full(d.n_points, -1)
    with btrack.BayesianTracker(verbose=False) as tracker:
        tracker.configure(_config(setting))
        objects: list[Any] = []
        for point, frame in zip(points, d.frame_of, strict=True):
            thing = types.PyTrackObject()
            thing.x, thing.y, thing.z = point
            thing.t = int(frame)
            objects.append(thing)
        tracker.append(objects)
        tracker.volume = tuple(zip(points.min(axis=0) - 1, points.max(axis=0) + 1, strict=True))
        tracker.track(step_size=1000)
        tracker.optimise(options={"tm_lim": 60_000, "msg_lev": "GLP_MSG_OFF"})
        for i, refs in enumerate(tracker.refs):
            seen = np.array([r for r in refs if r >= 0], dtype=np.int64)  # the others fill gaps
            labels[seen] = i
    return drop_short(labels, setting["least"])


PEER = Peer(
    name="btrack",
    package="btrack",
    # With a longer gap than 8 its library ends the process; gaps are for the joining.
    space={
        "process": (0.02, 3.0), "noise": (0.05, 3.0), "speed": (0.5, 10.0), "reach": (1.0, 15.0),
        "accuracy": (0.3, 8.0), "not_assigned": (0.001, 0.3), "max_gap": (1, 8),
        "join": (0.5, 20.0), "join_gap": (1, 60), "least": (2, 10),
    },
    label=label,
    like=numpy_loop.PEER,
)  # fmt: skip
