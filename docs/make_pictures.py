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
    figure = Figure(figsize=(11, 4), layout="constrained", dpi=110)
    for i, (shown, title) in enumerate(
        ((unnamed, "what the cameras give: points"), (tracks, "what Asterism makes of them"))
    ):
        axes: Any = figure.add_subplot(1, 2, i + 1, projection="3d")
        am.plot_trajectories(shown, ax=axes)
        axes.set_title(title, loc="left", fontsize=12)
        axes.set_axis_off()
        marked = truth.detections.points[truth.labels >= 0]
        low, high = marked.min(axis=0), marked.max(axis=0)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect(high - low, zoom=1.3)
    figure.savefig(path)


if __name__ == "__main__":
    images = Path(__file__).parent / "images"
    images.mkdir(exist_ok=True)
    crossing(images / "crossing.png")
