"""nrl-tracker (pytcl): its tracker by global nearest neighbours, with M-of-N confirmation."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import chi2

from peers import numpy_loop
from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    D, one = d.n_axes, np.eye(d.n_axes)
    q = setting["process"] ** 2
    least = int(setting["least"])
    tracker = module("pytcl.trackers").MultiTargetTracker(
        2 * D, D,
        F=np.kron([[1, 1], [0, 1]], one),
        H=np.kron([[1, 0]], one),
        Q=q * np.kron([[1 / 4, 1 / 2], [1 / 2, 1]], one),
        R=setting["noise"] ** 2 * one,
        gate_probability=float(chi2.cdf(setting["gate"] ** 2, D)),
        confirm_hits=least, confirm_window=least + 2, max_misses=int(setting["max_gap"]),
        init_covariance=np.kron(np.diag([setting["noise"] ** 2, setting["speed"] ** 2]), one),
    )  # fmt: skip
    pairs: dict[int, int] = {}
    associate = tracker._associate

    def noted(*arguments: Any) -> dict[int, int]:
        # It does not tell which detection is whose, so its pairs are noted as they are made.
        found = associate(*arguments)
        pairs.update({int(j): tracker._tracks[i].id for i, j in found.items()})
        return found

    tracker._associate = noted
    labels = np.full(d.n_points, -1)
    scale = length_of(d)
    for t, (_, points) in enumerate(d):
        pairs.clear()
        new = tracker._next_id
        tracker.process(list(points / scale), dt=1.0)
        for j in range(len(points)):
            if j not in pairs:  # begins a track, in this order
                pairs[j], new = new, new + 1
            labels[d.offsets[t] + j] = pairs[j]
    return drop_short(labels, least)


PEER = Peer(
    name="nrl-tracker",
    package="nrl-tracker",
    space={
        "process": (0.02, 3.0), "noise": (0.01, 2.0), "speed": (0.5, 10.0), "gate": (3.0, 8.0),
        "max_gap": (3, 60), "least": (2, 8),
    },
    label=label,
    like=numpy_loop.PEER,
)  # fmt: skip
