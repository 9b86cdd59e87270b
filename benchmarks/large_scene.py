"""Large scenes as Parquet, written and scored frame by frame, so that no scene fills the memory.

The motion is that of `simulate.dense`: smooth Lissajous paths that cross. The density is set so
that the mean distance of a marker to its nearest neighbour is a given multiple of the mean
displacement from one frame to the next. Both are measured on the first two frames.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.spatial import KDTree

from asterism import _engine

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["Scene", "idf1", "make", "write"]

_NEAREST_OF = 20_000  # markers whose nearest neighbour is measured


@dataclass(frozen=True)
class Scene:
    """Curves of all markers."""

    centre: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    omega: NDArray[np.float64]
    phase: NDArray[np.float64]
    ratio: float

    def positions(self, frame: int) -> NDArray[np.float64]:
        """Return the true positions in a frame, (N, 3)."""
        return self.centre + self.amplitude * np.sin(self.omega * frame + self.phase)


def make(n: int, *, ratio: float = 1.5, seed: int = 1) -> Scene:
    """Return a scene of n markers with the ratio of spacing to displacement."""
    density = 8 * (3.75 / ratio) ** 3
    scene = _curves(n, density, seed)
    for _ in range(8):
        density *= (scene.ratio / ratio) ** 3
        scene = _curves(n, density, seed)
        if abs(scene.ratio / ratio - 1) < 0.003:
            break
    return scene


def _curves(n: int, density: float, seed: int) -> Scene:
    rng = np.random.default_rng(seed)
    shape = (n, 3)
    centre = rng.uniform(0.0, (n / density) ** (1 / 3), shape)
    omega = rng.uniform(0.08, 0.18, shape)
    amplitude = rng.uniform(0.048, 0.0866, shape) / omega
    phase = rng.uniform(0, 2 * math.pi, shape)
    scene = Scene(centre, amplitude, omega, phase, math.nan)
    first, second = scene.positions(0), scene.positions(1)
    some = first[:: max(1, n // _NEAREST_OF)]
    nearest = KDTree(first).query(some, k=2)[0][:, 1].mean()
    displacement = np.linalg.norm(second - first, axis=1).mean()
    return Scene(centre, amplitude, omega, phase, float(nearest / displacement))


def write(
    scene: Scene,
    path: Path,
    frames: int,
    *,
    missing: float = 0.05,
    clutter: float = 0.05,
    noise: float = 0.005,
    seed: int = 2,
) -> None:
    """Write the detections of a scene: frame, x, y, z and the true marker, -1 for clutter.

    A detection is missing with probability `missing`. The number of false alarms of a frame is
    Poisson with the mean `clutter` times the number of markers, uniform over the bounding box.
    """
    n = len(scene.centre)
    names = ["frame", "x", "y", "z", "marker"]
    schema = pa.schema([(c, pa.float64() if c in "xyz" else pa.int64()) for c in names])
    with pq.ParquetWriter(path, schema) as writer:
        for t in range(frames):
            rng = np.random.default_rng([seed, t])
            true = scene.positions(t)
            seen = np.flatnonzero(rng.random(n) >= missing)
            false = rng.uniform(true.min(0), true.max(0), (rng.poisson(clutter * n), 3))
            points = np.concatenate([true[seen] + rng.normal(0, noise, (len(seen), 3)), false])
            marker = np.concatenate([seen, np.full(len(false), -1)])
            order = rng.permutation(len(points))
            points, marker = points[order], marker[order]
            columns = [np.full(len(points), t), *points.T, marker]
            writer.write_table(pa.table(columns, schema=schema))


def idf1(path: Path) -> float:
    """Return IDF1 of the columns marker and track of a table: 2 IDTP / (true + labelled)."""
    counts: dict[str, Any] = {"pairs": np.zeros(0, np.int64), "n": np.zeros(0, np.int64)}
    n_true = n_labelled = 0
    for batch in pq.ParquetFile(path).iter_batches(columns=["marker", "track"]):
        marker, track = (batch.column(i).to_numpy() for i in range(2))
        n_true, n_labelled = n_true + (marker >= 0).sum(), n_labelled + (track >= 0).sum()
        both = (marker >= 0) & (track >= 0)
        pairs = np.concatenate([counts["pairs"], marker[both] << 32 | track[both]])
        weights = np.concatenate([counts["n"], np.ones(both.sum(), np.int64)])
        pairs, at = np.unique(pairs, return_inverse=True)
        counts = {"pairs": pairs, "n": np.bincount(at, weights).astype(np.int64)}
    rows, columns = counts["pairs"] >> 32, counts["pairs"] & 0xFFFFFFFF
    if not len(rows):
        return 0.0
    match, _ = _engine.solve_joined(
        rows=rows.astype(np.int32), columns=columns.astype(np.int32),
        gains=counts["n"].astype(np.float64), n_tracks=int(rows.max()) + 1,
        n_points=int(columns.max()) + 1,
    )  # fmt: skip
    shared = counts["n"][match[rows] == columns].sum()
    return float(2 * shared / (n_true + n_labelled))
