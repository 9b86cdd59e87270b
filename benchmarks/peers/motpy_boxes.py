"""motpy: boxes of videos, here cubes about the points, by the share that they overlap."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from peers import numpy_loop
from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    motpy, tracker_of = module("motpy"), module("motpy.tracker")
    D, half = d.n_axes, setting["box"] / 2
    match = tracker_of.IOUAndFeatureMatchingFunction(min_iou=setting["overlap"])
    pairs: list[tuple[Any, int]] = []

    def matching(trackers: Any, detections: Any) -> Any:
        # It does not tell which detection is whose, so its pairs are noted as they are made.
        found = match(trackers, detections)
        pairs[:] = [(trackers[i].id, j) for i, j in found]
        return found

    tracker = motpy.MultiObjectTracker(
        dt=1.0,
        model_spec={
            "order_pos": 1, "dim_pos": D, "order_size": 0, "dim_size": D,
            "q_var_pos": setting["process"] ** 2, "r_var_pos": setting["noise"] ** 2,
            "q_var_size": 1e-4, "r_var_size": 1e-2, "p_cov_p0": setting["speed"] ** 2,
        },
        matching_fn=matching,
        tracker_kwargs={"max_staleness": setting["max_gap"]},
    )  # fmt: skip
    labels = np.full(d.n_points, -1)
    number: dict[Any, int] = {}
    scale = length_of(d)
    for t, (_, points) in enumerate(d):
        here = points / scale
        pairs.clear()
        tracker.step([motpy.Detection(box=np.concatenate([p - half, p + half])) for p in here])
        free = set(range(len(here))) - {j for _, j in pairs}
        for one in tracker.trackers:
            if one.id not in number:  # begun at one of the free points
                box = np.asarray(one.box())
                middle = (box[:D] + box[D:]) / 2
                j = min(free, key=lambda j: float(np.abs(here[j] - middle).sum()))
                free.discard(j)
                pairs.append((one.id, j))
        for who, j in pairs:
            labels[d.offsets[t] + j] = number.setdefault(who, len(number))
    return drop_short(labels, setting["least"])


PEER = Peer(
    name="motpy",
    package="motpy",
    space={
        "box": (1.0, 30.0), "overlap": (0.01, 0.3), "process": (0.02, 3.0), "noise": (0.01, 2.0),
        "speed": (0.5, 10.0), "max_gap": (3, 60), "least": (2, 10),
    },
    label=label,
    like=numpy_loop.PEER,
)  # fmt: skip
