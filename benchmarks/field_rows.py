"""Rows of `field.py`: what a tracker made of each clip of a kind."""

from __future__ import annotations

import inspect
import itertools
import time
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import asterism as am
from field_cache import digest
from field_search import setting_of, source_of
from measured import measured
from peers import PEERS, Peer, Setting, in_frames

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from field_cache import Cache
    from field_clips import Clip, Kind

__all__ = ["LATE", "NOT_RUN", "ORACLES", "OURS", "Found", "Score", "rows_of", "warm"]

HERE = Path(__file__).resolve().parent
NOT_RUN = "not run"
LATE = "more than"
"""How an error begins where time ran out."""
ORACLES = {"the truth, broken at gaps > 10": 10, "the truth, broken at gaps > 60": 60}
OURS: dict[str, tuple[am.tracking.Method[Any] | None, bool]] = {
    "gnn": (am.GNN(), False),
    "gnn, stitched": (am.GNN(), True),
    "smp, window=3": (am.SMP(window=3), False),
    "smp, window=3, stitched": (am.SMP(window=3), True),
    "mcmcda": (am.MCMCDA(), False),
    "mcmcda, stitched": (am.MCMCDA(), True),
    "auto": (None, False),
}


@dataclass(frozen=True, kw_only=True)
class Score:
    """What a tracker made of a clip; `error` where nothing.

    Parameters
    ----------
    clip : str
        Its name.
    idf1, switches, wrong, broken, tracks_per_true : float or int
        As `asterism.metrics` counts; switches for 1000 detections.
    ms, megabytes : float
        CPU time for a frame, and memory.
    prepared : float
        Seconds of tuning, or of estimating the model.
    trials : int, optional
        Settings tried; None for ours.
    error : str
        Why there is no result, "" where there is.
    points, frames : int
        Size of the clip.
    """

    clip: str
    idf1: float = 0.0
    switches: float = float("nan")
    wrong: int = 0
    broken: int = 0
    tracks_per_true: float = float("nan")
    ms: float = float("nan")
    megabytes: float = float("nan")
    prepared: float = float("nan")
    trials: int | None = None
    error: str = ""
    points: int = 0
    frames: int = 0


Found = dict[tuple[str, str], list[Score]]
"""Rows by kind and tracker."""


def scored(
    clip: str, truth: am.Tracks, work: Callable[[], NDArray[np.int64]], limit: float,
    prepared: float,
) -> Score:  # fmt: skip
    d = truth.detections
    run = measured(work, limit)
    row = Score(clip=clip, prepared=prepared, points=d.n_points, frames=d.n_frames, error=run.error)
    if run.labels is None:
        return row
    row = replace(row, ms=1e3 * run.seconds / d.n_frames, megabytes=run.megabytes)
    return judged(row, am.Tracks(detections=d, labels=run.labels), truth)


def judged(row: Score, tracks: am.Tracks, truth: am.Tracks) -> Score:
    """Write into a row how good the tracks are."""
    e = am.evaluate(tracks, truth)
    return replace(
        row, idf1=e.idf1, switches=e.switches_per_1000, wrong=e.wrong_links, broken=e.broken_links,
        tracks_per_true=e.n_tracks / e.n_markers,
    )  # fmt: skip


def kept(cache: Cache, key: tuple[Any, ...], clip: Clip, make: Callable[[], Score]) -> Score:
    """Give a row that is known or make it; say so where it is not to be made."""
    try:
        return Score(**cache.get(key, lambda: asdict(make())))
    except KeyError:
        return Score(clip=clip.name, error=NOT_RUN)


def of_peer(kind: Kind, peer: Peer, options: argparse.Namespace, cache: Cache) -> list[Score]:
    try:
        setting = setting_of(kind, peer, options, cache)
    except KeyError:
        return [Score(clip=clip.name, error=NOT_RUN) for clip in kind.scored]
    found: list[Score] = []
    for clip in kind.scored:

        def make(clip: Clip = clip) -> Score:
            truth = clip.make()
            d = truth.detections
            late = [s for s in found if s.error.startswith(LATE) and s.points <= d.n_points]
            if late:  # no need to wait for it a second time
                return replace(late[0], clip=clip.name, points=d.n_points, frames=d.n_frames)
            work = partial(peer.label, in_frames(d), Setting(setting["setting"]))
            return scored(clip.name, truth, work, options.limit, setting["seconds"])

        key = ("scored", clip.name, options.frames, peer.name, setting["setting"], options.limit)
        row = kept(cache, (*key, source_of(peer)), clip, make)
        # Where no trial came to its end, the setting is that with which the search began.
        found.append(replace(row, trials=0 if setting["error"] else setting["trials"]))
    return found


def of_oracle(kind: Kind, gap: int, options: argparse.Namespace, cache: Cache) -> list[Score]:
    """Score the truth, broken at long occlusions: a tracker that fills no more cannot score higher.

    Its switches are those that no such tracker avoids.
    """

    def make(clip: Clip) -> Score:
        truth = clip.make()
        d = truth.detections
        row = Score(clip=clip.name, points=d.n_points, frames=d.n_frames)
        return judged(row, am.metrics.oracle_tracks(truth, gap), truth)

    source = digest(HERE / "field_clips.py")
    return [
        kept(cache, ("oracle", c.name, options.frames, gap, source), c, partial(make, c))
        for c in kind.scored
    ]


@lru_cache(maxsize=16)
def estimated(clip: Clip) -> tuple[am.Tracks, am.TrackingModel, float]:
    """Give a clip, its model, and the CPU seconds of estimating it."""
    truth = clip.make()
    start = time.process_time()
    model = am.estimate_model(truth.detections).model
    return truth, model, time.process_time() - start


def of_ours(kind: Kind, name: str, options: argparse.Namespace, cache: Cache) -> list[Score]:
    package = Path(am.__file__).parent
    parts = [sorted((package / part).rglob("*.py")) for part in ("associate", "label", "model")]
    engine = Path(inspect.getfile(import_module("asterism._engine")))
    source = digest(*itertools.chain(*parts), engine, HERE / "field_clips.py")
    method, is_stitched = OURS[name]

    def make(clip: Clip) -> Score:
        truth, model, prepared = estimated(clip)

        def work() -> NDArray[np.int64]:
            if is_stitched:
                return am.track(truth.detections, method, model=model, seed=0, stitch=True).labels
            return am.track(truth.detections, method, model=model, seed=0).labels

        return scored(clip.name, truth, work, options.limit, prepared)

    return [
        kept(cache, ("ours", c.name, options.frames, name, source), c, partial(make, c))
        for c in kind.scored
    ]


def rows_of(kind: Kind, name: str, options: argparse.Namespace, cache: Cache) -> list[Score]:
    """Give a row for each clip of a kind, whichever tracker it is."""
    if name in PEERS:
        return of_peer(kind, PEERS[name], options, cache)
    if name in OURS:
        return of_ours(kind, name, options, cache)
    return of_oracle(kind, ORACLES[name], options, cache)


def warm() -> None:
    """Run ours once, for what they load on first use is not theirs alone to pay."""
    truth = am.simulate.corrupt(am.simulate.cube(frames=30, seed=1), clutter=0.1, seed=1)
    model = am.estimate_model(truth.detections).model
    for method, _ in OURS.values():
        am.track(truth.detections, method, model=model, seed=0)
        am.track(truth.detections, method, model=model, seed=0, stitch=True)
