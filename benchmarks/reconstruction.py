"""From many views to points, measured: without noise, with noise, a person, real cameras, speed.

Every row is made by `am.reconstruct` with nothing given but the image points and the rig, unless it
says otherwise; the time of the estimate is not counted in the speeds, which are of one thread.

    python benchmarks/reconstruction.py [--data FOLDER] [--frames N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.cli.commands.reconstruct import true_tracks
from asterism.simulate.rig_presets import place_preset
from report import best_of, conditions, publish, table

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLYDRA = "strawlab__flydra/flydra_analysis/tests/sample_calibration"
MYPTV = "ronshnapp__MyPTV/example"
SHARP = am.simulate.Seeing(noise_px=0.0, merge=False, marker_radius=0.0)
REAL = am.simulate.Seeing(noise_px=0.3, missing=0.01, false=0.5)


def cloud(
    n_cameras: int, n_markers: int, n_frames: int, seeing: am.simulate.Seeing, seed: int = 0
) -> tuple[am.Rig, am.Tracks, am.simulate.Film]:
    """Markers anywhere in 2 × 2 × 2 m, other places in each frame, in a ring of cameras."""
    rng = np.random.default_rng([seed, n_cameras, n_markers])
    rig = am.Rig.ring(n_cameras, radius=4, height=2.5)
    X = rng.uniform((-1, -1, 0), (1, 1, 2), (n_frames, n_markers, 3))
    truth = am.Tracks.from_dense(np.arange(n_frames) / 100, X)
    return rig, truth, am.simulate.film(truth, rig, seeing=seeing, seed=seed)


def scored(
    rig: am.Rig, truth: am.Tracks, shot: am.simulate.Film, radius: float = 0.02
) -> tuple[am.multiview.Reconstruction, am.metrics.PointScores]:
    made = am.reconstruct(shot.observations, rig)
    seen = (shot.blob_of >= 0).sum(axis=0) >= 2
    return made, am.metrics.point_scores(made.detections, truth, counted=seen, radius=radius)


def row_of(name: str, made: am.multiview.Reconstruction, s: am.metrics.PointScores) -> list[str]:
    return [
        name, str(s.n_markers), f"{100 * s.recall:.2f}", f"{100 * s.ghosts:.2f}",
        f"{s.median_mm:.3g}", f"{s.p95_mm:.3g}", f"{s.nees:.2f}", f"{made.info['gap']:.3g}",
    ]  # fmt: skip


HEAD = ("scene", "markers seen by two", "found, %", "ghosts, %", "median error, mm",
        "95 %, mm", "NEES by axis", "gap, nats")  # fmt: skip


def clouds() -> list[str]:
    rows: list[list[str]] = []
    for n_cameras, n_markers in ((2, 20), (3, 60), (8, 60), (16, 100)):
        for noise in (0.0, 0.3, 1.0):
            seeing = replace(SHARP, noise_px=noise)
            rig, truth, shot = cloud(n_cameras, n_markers, 40, seeing)
            made, s = scored(rig, truth, shot, radius=0.05)
            name = f"{n_cameras} cameras, {n_markers} markers, {noise:g} px"
            rows.append(row_of(name, made, s))
    return table(HEAD, rows)


def people(n_frames: int) -> tuple[list[str], list[str]]:
    rows: list[list[str]] = []
    identities: list[list[str]] = []
    for scene, activity, preset in (
        ("person", "walk", "ring8"), ("person", "run", "ring8"), ("person", "jump", "ring8"),
        ("person", "turn", "ring8"), ("two_people", "hug", "ring8"),
        ("two_people", "hug", "ring12"), ("person", "walk", "ring6"), ("person", "walk", "ring4"),
    ):  # fmt: skip
        truth = am.simulate.SCENES[scene].make(frames=n_frames, seed=0, activity=activity)
        points = truth.detections.points
        rig, _ = place_preset(preset, points.min(axis=0), points.max(axis=0))
        shot = am.simulate.film(truth, rig, seeing=REAL)
        made, s = scored(rig, truth, shot)
        name = f"{scene}, {activity}, {preset}"
        rows.append(row_of(name, made, s))
        who = true_tracks(made, shot.observations)
        model = am.estimate_model(made.detections).model
        row = [name]
        for method in (am.GNN(), am.MCMCDA()):
            e = am.evaluate(am.track(made.detections, method, model=model), who)
            row += [f"{e.idf1:.4f}", str(e.switches)]
        identities.append(row)
    head = ("scene", "GNN, IDF1", "switches", "MCMCDA, IDF1", "switches")
    return table(HEAD, rows), table(head, identities)


def speeds() -> list[str]:
    rows: list[list[str]] = []
    for n_cameras in (4, 8, 16):
        for n_markers in (20, 60, 100):
            rig, _, shot = cloud(n_cameras, n_markers, 30, replace(SHARP, noise_px=0.3))
            o = shot.observations
            model = am.multiview.estimate_images(o, rig)
            pace = 30 / best_of(3, lambda o=o, r=rig, m=model: am.reconstruct(o, r, m))
            made = am.reconstruct(o, rig, model)
            rows.append([
                str(n_cameras), str(n_markers), f"{pace:.0f}",
                f"{made.info['n_candidates'] / 30:.0f}",
            ])  # fmt: skip
    return table(("cameras", "markers", "frames/s", "sets weighed a frame"), rows)


def flydra_points(folder: Path) -> tuple[NDArray[np.float64], list[dict[int, NDArray[np.float64]]]]:
    """Give the places of the calibration, metres, and where each camera saw them."""
    seen: dict[tuple[float, ...], dict[int, NDArray[np.float64]]] = {}
    for c in range(5):
        for row in np.loadtxt(folder / f"cam{c + 1}.points4cal.dat"):
            seen.setdefault(tuple(row[:3].tolist()), {})[c] = row[4:6]
    return np.array(list(seen)) / 1000, list(seen.values())


def flydra_shuffled(folder: Path, at_once: int, seed: int = 0) -> tuple[am.Observations, am.Tracks]:
    """Put so many of the points into a frame at a time, those of each camera in any order."""
    X, seen = flydra_points(folder)
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(X))
    n_frames = len(X) // at_once
    pixels: list[NDArray[np.float64]] = []
    counts: list[int] = []
    markers: list[int] = []
    places = np.full((n_frames, len(X), 3), np.nan)
    for t in range(n_frames):
        chosen = order[t * at_once : (t + 1) * at_once]
        places[t, chosen] = X[chosen]
        for c in range(5):
            there = [int(k) for k in rng.permutation(chosen) if c in seen[int(k)]]
            pixels += [seen[k][c] for k in there]
            markers += there
            counts.append(len(there))
    rig = am.read_rig(folder)
    observations = am.Observations(
        times=np.arange(n_frames, dtype=float),
        cameras=rig.names,
        offsets=np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        pixels=np.array(pixels),
        markers=np.array(markers),
    )
    return observations, am.Tracks.from_dense(observations.times, places)


def flydra(folder: Path) -> list[str]:
    rig = am.read_rig(folder)
    rows: list[list[str]] = []
    for at_once in (1, 25, 100, 253):
        o, truth = flydra_shuffled(folder, at_once)
        made = am.reconstruct(o, rig)
        s = am.metrics.point_scores(made.detections, truth, radius=0.002)
        rows.append(row_of(f"{at_once} points a frame", made, s))
    return table(HEAD, rows)


def myptv_blobs(folder: Path) -> am.Observations:
    """Give the blobs of the three cameras; the files have row before column."""
    rig = am.read_rig(folder)
    blobs = [np.loadtxt(folder / f"blobs_{name}") for name in rig.names]
    frames = np.unique(blobs[0][:, 5])
    cells = [b[b[:, 5] == t][:, 1::-1] for t in frames for b in blobs]
    return am.Observations(
        times=frames / 100,
        cameras=rig.names,
        offsets=np.cumsum([0, *map(len, cells)]),
        pixels=np.concatenate(cells),
    )


def myptv_matches(
    folder: Path, o: am.Observations, made: am.multiview.Reconstruction
) -> tuple[int, int]:
    """Count the matches that the files list, and those of them found, blob for blob."""
    theirs = np.loadtxt(folder / "particles")
    d, views = made.detections, made.views
    of = np.full((d.n_points, 3), -1)
    cell = d.frame_of[views.point_of] * 3 + views.cameras
    of[views.point_of, views.cameras] = views.blobs - o.offsets[cell]
    ours = {(int(t), *row) for t, row in zip(d.frame_of, of.tolist(), strict=True)}
    listed = [(int(r[7]), int(r[3]), int(r[4]), int(r[5])) for r in theirs]
    return len(listed), sum(match in ours for match in listed)


def myptv(folder: Path) -> list[str]:
    rig, o = am.read_rig(folder), myptv_blobs(folder)
    rows: list[list[str]] = []
    theirs = np.loadtxt(folder / "particles")
    listed = am.Detections.from_frames(
        o.times, [theirs[theirs[:, 7] == t, :3] / 1000 for t in np.unique(theirs[:, 7])]
    )
    rows.append(
        ["its own, 3 cameras", str(listed.n_points), "", "", f"{100 * lasting(listed):.1f}"]
    )
    for least in (3, 2):
        start = time.perf_counter()
        made = am.reconstruct(o, rig, min_views=least)
        seconds = time.perf_counter() - start
        n, n_same = myptv_matches(folder, o, made)
        stds = made.detections.stds
        assert stds is not None
        three = int((made.views.counts == 3).sum())
        rows.append([
            f"min_views={least} ({seconds:.2f} s)", f"{made.detections.n_points}, {three} of 3",
            f"{n_same} of {n}", f"{1e3 * float(np.median(stds)):.3f}",
            f"{100 * lasting(made.detections):.1f}",
        ])  # fmt: skip
    return table(
        ("points", "number", "of those listed", "σ, mm", "in tracks of 4 frames and more, %"), rows
    )


def lasting(points: am.Detections) -> float:
    """Share of the points in tracks of at least four frames: ghosts seldom last."""
    tracks = am.track(points, am.GNN())
    long = np.flatnonzero(tracks.lengths >= 4)
    return float(np.isin(tracks.labels, long).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=default)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--markdown", type=Path)
    given = parser.parse_args()
    points, identities = people(given.frames)
    lines = [
        "Markers anywhere in 2 × 2 × 2 m, a ring of cameras 4 m away:",
        "",
        *clouds(),
        "",
        f"People whose limbs hide their markers, {given.frames} frames, 0.3 px, 1 % of the blobs "
        "missed, 0.5 false ones a camera and frame, blobs that touch are one:",
        "",
        *points,
        "",
        "The same, tracked:",
        "",
        *identities,
        "",
    ]
    if (given.data / FLYDRA).is_dir():
        lines += [
            "The 506 calibration points of flydra's five real cameras, shuffled (found: within "
            "2 mm):",
            "",
            *flydra(given.data / FLYDRA),
            "",
            "Particles before MyPTV's three real cameras, some 75 blobs each, seven frames:",
            "",
            *myptv(given.data / MYPTV),
            "",
        ]
    lines += ["Speed, one thread, 0.3 px:", "", *speeds(), "", conditions()]
    publish(lines, given.markdown)


if __name__ == "__main__":
    main()
