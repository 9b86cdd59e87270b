"""Calibration of the confidences of each method, alone and stitched, on simulated people.

The scenes of ``calibration.py`` with seeds that the fit does not use, 10 % missing and 10 %
clutter, and bursts. A row is marked where the calibration error of links or of identities exceeds
0.02.

    python benchmarks/identity_methods.py [--seeds N …] [--methods NAME …] [--markdown FILE]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import asterism as am
from asterism.metrics import right_identities, right_links
from calibration import CORRUPTED, SCENES, loosened
from report import conditions, publish, table

FRAMES = 250
MAX_ERROR = 0.02
HEAD = (
    "method", "wrong links", "ECE", "AUC", "wrong identities", "ECE ", "AUC ", "calibrated",
)  # fmt: skip


class Confidences:
    """Confidences of a method, and whether each label is right."""

    def __init__(self) -> None:
        self.links: list[np.ndarray] = []
        self.identities: list[np.ndarray] = []

    def add(self, tracks: am.Tracks, truth: am.Tracks) -> None:
        """Count one result."""
        assert tracks.confidence is not None
        assert tracks.identity_confidence is not None
        links, right = right_links(tracks.labels, truth.labels)
        self.links.append(np.stack([tracks.confidence[links], right]))
        inside, right = right_identities(tracks.labels, truth.labels)
        self.identities.append(np.stack([tracks.identity_confidence[inside], right]))

    def row(self, name: str) -> list[str]:
        """Return the row of a table."""
        cells: list[str] = [name]
        worst = 0.0
        for parts in (self.links, self.identities):
            sure, right = np.concatenate(parts, axis=1)
            c = am.metrics.calibration_curve(sure, right > 0)
            cells += [f"{100 * (1 - right.mean()):.2f} %", f"{c.ece:.4f}", f"{c.auc:.3f}"]
            worst = max(worst, c.ece)
        return [*cells, "yes" if worst <= MAX_ERROR else "**no**"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="*", default=[41, 42])
    parser.add_argument("--methods", nargs="*", default=list(am.tracking.METHODS))
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    found: dict[str, dict[str, Confidences]] = {}
    for condition in ("10 %/10 %", "bursts"):
        for seed in options.seeds:
            for scene, make in SCENES.items():
                whole = make(seed) if seed % 2 else loosened(make(seed), seed)
                truth = CORRUPTED[condition](whole.part(0, FRAMES), seed)
                d = truth.detections
                model = am.estimate_model(d).model
                for name in options.methods:
                    for stitch in (False, True):
                        tracks = am.track(d, name, model=model, stitch=stitch, seed=0)
                        way = f"{name}, stitched" if stitch else name
                        rows = found.setdefault(condition, {})
                        rows.setdefault(way, Confidences()).add(tracks, truth)
                print(condition, seed, scene, flush=True)
    lines: list[str] = []
    for condition, rows in found.items():
        lines += [f"{condition}:", "", *table(HEAD, [c.row(way) for way, c in rows.items()]), ""]
    publish([*lines, f"{conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
