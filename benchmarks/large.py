"""Large scenes: time, memory and identity from 1000 to 1 000 000 markers, beside other programs.

Scene: smooth paths that cross (benchmarks/large_scene.py), 5 % missing, 5 % clutter, noise 5 mm;
the mean distance to the nearest neighbour is 1.5 times the mean displacement in a frame. Each run
is a process of its own, whose memory is its peak. The model is estimated from the first frames; its
time is not counted. Times are processor times with one thread and include reading and writing.

    python benchmarks/large.py [--parts growth memory tilings peers] [--sizes N …]
        [--markdown FILE] [--figure FILE] [--folder FOLDER]

Results of finished runs are kept in FOLDER, so an interrupted benchmark goes on where it ended.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from large_scene import idf1, make, write
from report import conditions, publish, table

if TYPE_CHECKING:
    from collections.abc import Sequence

RATIO = 1.5
FRAMES = {1000: 100, 10_000: 100, 100_000: 100, 1_000_000: 8}
MEMORY = (50, 100, 200)  # frames of a scene of MEMORY_SIZE markers
MEMORY_SIZE = 100_000
TILINGS: tuple[dict[str, Any], ...] = (
    {"tile": float("inf")}, {"tile": 5.3}, {"tile": 2.7}, {"tile": 1.37},
    {"tile": 2.7, "threads": 2}, {"tile": 2.7, "threads": 5},
)  # fmt: skip
PEERS = ("trackpy", "trackpy, velocity", "laptrack")
PEER_FRAMES = {1000: 100, 10_000: 30, 100_000: 10}  # the others are slow
MAX_SECONDS = 600  # processor time of another program
TOP_DISPLACEMENT = 0.15  # metres a frame, of the fastest marker; given to the other programs


def scene_file(folder: Path, n: int, frames: int) -> Path:
    """Return the file of a scene, written if there is none."""
    path = folder / f"scene_{n}_{frames}.parquet"
    if not path.exists():
        scene = make(n, ratio=RATIO)
        unfinished = path.with_suffix(".part")
        write(scene, unfinished, frames)
        path.with_suffix(".json").write_text(json.dumps({"ratio": scene.ratio}))
        unfinished.rename(path)
    return path


def tracked(folder: Path, n: int, frames: int, options: dict[str, Any]) -> dict[str, Any]:
    """Track a scene and return the figures of the run."""
    from asterism.large.rows import frames_of
    from asterism.large.track import open_table

    source = scene_file(folder, n, frames)
    saved = folder / f"model_{n}.toml"
    estimation = None
    if not saved.exists():
        start = time.process_time()
        table_ = open_table(source)
        frames_ = frames_of(source, table_.chunks())
        pairs = ((frame.time, frame.points) for frame in frames_)
        am.large.estimate_from_start(pairs).to_toml(saved)
        estimation = time.process_time() - start
    model = am.TrackingModel.from_toml(saved)
    out = folder / f"tracked_{n}_{frames}.parquet"
    steps: list[float] = [time.process_time()]

    def progress(_: int) -> None:
        steps.append(time.process_time())

    run = am.large.track(source, out, model=model, progress=progress, **options)
    steps.append(time.process_time())
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    taken = np.diff(steps)
    found = {
        "n": n, "frames": frames, "options": {k: str(v) for k, v in options.items()},
        "seconds": float(steps[-1] - steps[0]) / frames, "median": float(np.median(taken)),
        "slowest": float(taken.max()), "rss": peak, "tracks": run.n_tracks,
        "tiles": run.n_tiles, "joined": run.n_joined, "largest_group": run.largest_group,
        "idf1": idf1(out), "estimation": estimation,
        "ratio": json.loads(source.with_suffix(".json").read_text())["ratio"],
        "bytes": hashlib.sha256(out.read_bytes()).hexdigest(),
    }  # fmt: skip
    out.unlink()
    return found


def by_peer(folder: Path, n: int, frames: int, peer: str) -> dict[str, Any]:
    """Track a scene with another program, within `MAX_SECONDS` of processor time."""
    import pandas as pd
    import pyarrow.parquet as pq

    source = scene_file(folder, n, frames)
    data: Any = pq.read_table(source).to_pandas()
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_SECONDS, MAX_SECONDS))
    start = time.process_time()
    axes = ["x", "y", "z"]
    if peer.startswith("trackpy"):
        import trackpy  # pyright: ignore[reportMissingImports]

        trackpy.quiet()
        link: Any = trackpy.link
        if "velocity" in peer:
            predict: Any = trackpy.predict.NearestVelocityPredict()
            link = predict.link_df
        found: Any = link(
            data[["frame", *axes]], search_range=TOP_DISPLACEMENT, memory=3, pos_columns=axes,
            adaptive_stop=0.05 * TOP_DISPLACEMENT, adaptive_step=0.8,
        )  # fmt: skip
        marker, track = data["marker"], found.sort_index()["particle"]
    else:
        import laptrack  # pyright: ignore[reportMissingImports]

        make_tracker: Any = laptrack.LapTrack
        tracker: Any = make_tracker(
            cutoff=TOP_DISPLACEMENT**2, gap_closing_cutoff=(2 * TOP_DISPLACEMENT) ** 2,
            gap_closing_max_frame_count=3, alternative_cost_percentile=100,
        )  # fmt: skip
        found, _, _ = tracker.predict_dataframe(data, axes, only_coordinate_cols=False)
        marker, track = found["marker"], found["track_id"]
    seconds = (time.process_time() - start) / frames
    out = folder / f"{peer}_{n}.parquet"
    columns = {"marker": marker.to_numpy(), "track": track.to_numpy()}
    pd.DataFrame(columns).astype(np.int64).to_parquet(out)
    score = idf1(out)
    out.unlink()
    return {
        "n": n, "frames": frames, "peer": peer, "seconds": seconds, "idf1": score,
        "rss": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }  # fmt: skip


def result(folder: Path, **job: Any) -> dict[str, Any]:
    """Return the figures of a run, from a process of its own or from an earlier benchmark."""
    key = hashlib.sha256(json.dumps(job, sort_keys=True).encode()).hexdigest()[:16]
    kept = folder / f"result_{key}.json"
    if not kept.exists():
        if "peer" not in job:  # writing the scene is not the tracker's memory
            scene_file(folder, job["n"], job["frames"])
        command = [sys.executable, __file__, "--folder", str(folder), "--child", json.dumps(job)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        lines = done.stdout.strip().splitlines()
        if done.returncode or not lines:
            if "peer" not in job:
                raise RuntimeError(done.stderr)
            why = (done.stderr.strip().splitlines() or [""])[-1]
            lines = [json.dumps({**job, "failed": done.returncode, "why": why})]
        kept.write_text(lines[-1])
        print(lines[-1], flush=True)
    return json.loads(kept.read_text())


def memory(bytes_: float) -> str:
    """Write a memory in GB."""
    return f"{bytes_ / 1e9:.2f} GB"


def growth(folder: Path, sizes: Sequence[int]) -> tuple[list[str], list[dict[str, Any]]]:
    """Measure scenes of several sizes."""
    runs = [result(folder, n=n, frames=FRAMES[n]) for n in sizes]
    rows = [
        [
            f"{r['n']:,}", str(r["frames"]), f"{r['ratio']:.3f}", f"{r['median']:.3g} s",
            f"{r['slowest']:.3g} s", f"{1e6 * r['median'] / r['n']:.2f} µs", memory(r["rss"]),
            str(r["largest_group"]), f"{r['idf1']:.4f}",
        ]
        for r in runs
    ]  # fmt: skip
    head = ["markers", "frames", "spacing / displacement", "median frame", "slowest frame",
            "median per marker", "peak memory", "largest group", "IDF1"]  # fmt: skip
    return ["### Growth", "", *table(head, rows), ""], runs


def memories(folder: Path) -> list[str]:
    """Measure the memory of scenes of several lengths."""
    runs = [result(folder, n=MEMORY_SIZE, frames=frames) for frames in MEMORY]
    rows = [
        [str(r["frames"]), memory(r["rss"]), f"{r['seconds']:.3g} s", f"{r['idf1']:.4f}"]
        for r in runs
    ]
    about = f"{MEMORY_SIZE:,} markers. Time is the mean of a frame, with reading and writing."
    head = ["frames", "peak memory", "time a frame", "IDF1"]
    return ["### Memory", "", *table(head, rows), "", about, ""]


def tilings(folder: Path) -> list[str]:
    """Track one scene with several tilings and compare the bytes of the files."""
    n, frames = 100_000, 20
    runs = [result(folder, n=n, frames=frames, options=options) for options in TILINGS]
    same = "the same" if len({r["bytes"] for r in runs}) == 1 else "DIFFERENT"
    rows = [
        [
            r["options"]["tile"], r["options"].get("threads", "1"), str(r["tiles"]),
            f"{r['joined']:,}", f"{r['seconds']:.3g} s", r["bytes"][:12],
        ]
        for r in runs
    ]  # fmt: skip
    head = ["side of a tile, m", "threads", "tiles", "candidates joined at seams",
            "time a frame", "SHA-256 of the file"]  # fmt: skip
    about = f"{n:,} markers, {frames} frames. The bytes of all files are {same}."
    return ["### Tilings", "", *table(head, rows), "", about, ""]


def peers(folder: Path, sizes: Sequence[int]) -> list[str]:
    """Compare with other programs on the same files."""
    rows: list[list[str]] = []
    for n in sizes:
        frames = PEER_FRAMES[n]
        own = result(folder, n=n, frames=frames)
        runs = [result(folder, n=n, frames=frames, peer=peer) for peer in PEERS]
        for name, r in zip(("asterism", *PEERS), (own, *runs), strict=True):
            if "failed" in r:
                reason = f"not within {MAX_SECONDS} s" if r["failed"] < 0 else r["why"][:60]
                if "MemoryError" in r["why"]:
                    reason = "not within the memory"
                rows.append([f"{n:,}", str(frames), name, reason, "–", "–"])
                continue
            figures = [f"{r['seconds']:.3g} s", memory(r["rss"]), f"{r['idf1']:.4f}"]
            rows.append([f"{n:,}", str(frames), name, *figures])
    about = (
        "The other programs are given the largest displacement of a marker, 0.15 m, as their "
        "search range and a memory of 3 frames. “Velocity”: with the velocity of the nearest "
        "particle as prediction. They hold the whole scene in memory."
    )
    head = ["markers", "frames", "program", "time a frame", "peak memory", "IDF1"]
    return ["### Beside other programs", "", *table(head, rows), "", about, ""]


def draw(runs: Sequence[dict[str, Any]], path: Path) -> None:
    """Draw time and memory against the number of markers."""
    import matplotlib.pyplot as plt

    n = np.array([r["n"] for r in runs])
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    for name, label in (("median", "median frame"), ("slowest", "slowest frame")):
        axes[0].loglog(n, [r[name] for r in runs], "o-", label=label)
    axes[0].loglog(n, n * runs[-1]["median"] / n[-1], "--", color="grey", label="linear")
    axes[0].set(xlabel="markers", ylabel="processor time, s")
    axes[0].legend(frameon=False)
    axes[1].loglog(n, [r["rss"] / 1e9 for r in runs], "o-")
    axes[1].set(xlabel="markers", ylabel="peak memory, GB")
    for ax in axes:
        ax.grid(alpha=0.3)
    figure.savefig(path, metadata={"Date": None})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    every = ("growth", "memory", "tilings", "peers")
    parser.add_argument("--parts", nargs="+", choices=every, default=every)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(FRAMES))
    parser.add_argument("--folder", type=Path, default=Path("build/large"))
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--child", type=json.loads, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    if options.child is not None:
        job: dict[str, Any] = options.child
        if "peer" in job:
            print(json.dumps(by_peer(options.folder, job["n"], job["frames"], job["peer"])))
        else:
            own = job.get("options", {})
            print(json.dumps(tracked(options.folder, job["n"], job["frames"], own)))
        return
    lines: list[str] = []
    if "growth" in options.parts:
        own, runs = growth(options.folder, options.sizes)
        lines += own
        if options.figure:
            draw(runs, options.figure)
    if "memory" in options.parts:
        lines += memories(options.folder)
    if "tilings" in options.parts:
        lines += tilings(options.folder)
    if "peers" in options.parts:
        lines += peers(options.folder, [n for n in options.sizes if n in PEER_FRAMES])
    publish([*lines, f"{conditions()}; one thread, processor time."], options.markdown)


if __name__ == "__main__":
    main()
