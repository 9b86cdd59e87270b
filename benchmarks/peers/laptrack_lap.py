"""laptrack: frame to frame by linear assignment, then gaps closed by another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    reach = setting["reach"] * length_of(d)
    tracker = module("laptrack").LapTrack(
        cutoff=reach**2,
        gap_closing_cutoff=(reach * setting["gap_reach"]) ** 2,
        gap_closing_max_frame_count=int(setting["max_gap"]),
        # What a link may cost beside others; 90 by itself, with which one link in ten is refused.
        alternative_cost_percentile=setting["percentile"],
    )
    graph = tracker.predict([points for _, points in d])
    labels = np.full(d.n_points, -1)
    for i, nodes in enumerate(module("networkx").weakly_connected_components(graph)):
        for frame, index in nodes:
            labels[d.offsets[frame] + index] = i
    return drop_short(labels, setting["least"])


PEER = Peer(
    name="laptrack",
    package="laptrack",
    space={
        "reach": (1.0, 30.0), "gap_reach": (0.5, 5.0), "max_gap": (1, 60), "least": (2, 10),
        "percentile": (80.0, 100.0),
    },
    label=label,
)  # fmt: skip
