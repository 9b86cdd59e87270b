"""trackpy: particles, nearest by subnetworks, with the velocity of the neighbours as prediction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from peers.peer import Peer, Setting, drop_short, length_of, module

if TYPE_CHECKING:
    from numpy.typing import NDArray

    import asterism as am

__all__ = ["PEER"]


def label(d: am.Detections, setting: Setting) -> NDArray[np.int64]:
    trackpy, pandas = module("trackpy"), module("pandas")
    trackpy.quiet()
    names = list("xyz"[: d.n_axes])
    table = pandas.DataFrame(d.points, columns=names)
    table["frame"] = d.frame_of
    reach = setting["reach"] * length_of(d)
    options = {
        "search_range": reach, "memory": int(setting["memory"]), "pos_columns": names,
        # Without these, a crowd ends in an error.
        "adaptive_stop": 0.05 * reach, "adaptive_step": 0.8,
    }  # fmt: skip
    link = trackpy.link
    if setting["velocity"] > 0.5:
        link = trackpy.predict.NearestVelocityPredict().link_df
    found = link(table, **options).sort_index()
    return drop_short(found["particle"].to_numpy().astype(np.int64), setting["least"])


PEER = Peer(
    name="trackpy",
    package="trackpy",
    space={"reach": (1.0, 30.0), "memory": (1, 60), "velocity": (0.1, 2.5), "least": (2, 10)},
    label=label,
)
