"""Make the pictures of the docs: ``python docs/make_pictures.py``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import asterism as am


def crossing(path: Path) -> None:
    """Draw what goes in and what comes out: a turning cube flies through a still one."""
    scene = am.simulate.crossing(seed=3, rate=100)
    truth = am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=0.002, seed=4)
    unnamed = am.Tracks(detections=truth.detections, labels=np.full(truth.detections.n_points, -1))
    tracks = am.track(truth.detections, am.GNN())
    figure = Figure(figsize=(11, 3.6), dpi=110)
    for i, (shown, title) in enumerate(
        ((unnamed, "what the cameras give: points"), (tracks, "what Asterism makes of them"))
    ):
        # 3-D axes leave wide margins, which are let run out of the picture.
        axes: Any = figure.add_axes((0.5 * i - 0.09, -0.42, 0.68, 1.75), projection="3d")
        am.plot_trajectories(shown, ax=axes)
        axes.set_title("")
        figure.text(0.5 * i + 0.02, 0.93, title, fontsize=12)
        if not i:
            axes.collections[0].set(color="#444444", alpha=0.8)
        axes.set_axis_off()
        marked = truth.detections.points[truth.labels >= 0]
        low, high = marked.min(axis=0), marked.max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1.12)
    figure.savefig(path)


if __name__ == "__main__":
    images = Path(__file__).parent / "images"
    images.mkdir(exist_ok=True)
    crossing(images / "crossing.png")
