"""Make the pictures of docs/guides/figures.md: ``python docs/make_figures.py [NAME…]``."""

from __future__ import annotations

import io
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PIL import Image

import asterism as am

if TYPE_CHECKING:
    from collections.abc import Callable

SEED = 3
METHODS = ("gnn", "smp", "jpda", "mht", "mcmcda")
MOVES = (0.3, 1, 3, 10, 30, 100)


def experiment(noise: float) -> am.Tracks:
    """Two cubes that pass through each other, with misses and clutter; the truth."""
    scene = am.simulate.crossing(seed=SEED)
    return am.simulate.corrupt(scene, missing=0.1, clutter=0.1, noise=noise, seed=1)


def by_segment(plot: Callable[..., Any]) -> Any:
    """Draw a walking person in the colours of the rigid segments."""
    truth = am.simulate.person(activity="walk", seed=2)
    segments = am.tracking.learn_bonds(truth).segments(truth.names)
    return plot(truth.part(0, 150), segments=segments)


def film() -> Any:
    """Draw a person who runs, through six cameras."""
    truth = am.simulate.person(activity="run", frames=200, rate=100, seed=2)
    points = truth.detections.points
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    rig = am.Rig.ring(6, radius=5, height=2.2, target=middle)
    return am.plot.plot_projections(am.simulate.film(truth, rig).observations, rig)


def posterior(d: am.Detections, model: am.TrackingModel, gnn: float) -> Any:
    """Draw how far walks of different lengths climb."""
    climbs = [
        [
            am.track(d, am.MCMCDA(moves=n, confidence=0, end_odds=1), model=model, seed=seed)
            .info["log_posterior"]
            for n in MOVES
        ]
        for seed in range(3)
    ]  # fmt: skip
    return am.plot.plot_posterior(MOVES, climbs, others={"gnn": gnn})


def main() -> None:
    """Draw all of them."""
    truth = experiment(0.025)
    d = truth.detections
    model = am.estimate_model(d).model
    found: dict[str, am.Tracks] = {}
    milliseconds: dict[str, float] = {}
    for name in METHODS:
        start = time.process_time()
        found[name] = am.track(d, am.tracking.method_by_name(name), model=model, seed=1)
        milliseconds[name] = 1e3 * (time.process_time() - start) / d.n_frames
    scores = {name: am.evaluate(tracks, truth) for name, tracks in found.items()}
    reliability: dict[str, Any] = {}
    for name in ("jpda", "mht", "mcmcda"):
        tracks = found[name]
        links, is_right = am.metrics.right_links(tracks.labels, truth.labels)
        assert tracks.confidence is not None
        reliability[name] = am.metrics.calibration_curve(tracks.confidence[links], is_right)
    gnn, best = found["gnn"], found["mcmcda"]
    calm = experiment(0.015)
    figures: dict[str, Callable[[], Any]] = {
        "trajectories": lambda: by_segment(am.plot.plot_trajectories),
        "axes": lambda: by_segment(am.plot.plot_axes),
        "presence": lambda: am.plot.plot_presence(best),
        "confidence": lambda: am.plot.plot_confidence(best),
        "errors": lambda: am.plot.plot_errors(gnn, truth),
        "reliability": lambda: am.plot.plot_reliability(reliability),
        "compare": lambda: am.plot.plot_compare(scores, milliseconds=milliseconds),
        "projections": film,
        "posterior": lambda: posterior(d, model, gnn.info["log_posterior"]),
        "groups": lambda: am.plot.plot_groups(
            am.filter.gate_groups(calm, am.estimate_model(calm.detections).model)
        ),
    }
    images = Path(__file__).parent / "images"
    for name in sys.argv[1:] or figures:
        # Few colours are enough, and a third of the bytes.
        picture = Image.open(io.BytesIO(am.plot.figure_bytes(figures[name](), "png")))
        small = picture.convert("RGB").quantize(128)
        small.save(images / f"figure_{name}.png", optimize=True)


if __name__ == "__main__":
    main()
