"""Side by side: other trackers and ours, on scenes and on real captures corrupted in four ways.

The peers are tuned: the same number of random settings each, within the same CPU time, scored by
IDF1 on other seeds of the same kind of scene, or on other captures corrupted in the same way. Ours
estimate their model from the clip, and nothing is tuned. Rows are kept in build/field.jsonl as they
come, so that a long run can be stopped and gone on with.

    python benchmarks/field.py [--quick] [--only NAME] [--seeds N] [--trials N] [--markdown FOLDER]
"""

from __future__ import annotations

import argparse
import hashlib
import inspect
import itertools
import json
import os
import re
import time
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: one core for all

import numpy as np

import asterism as am
from field_clips import Clip, Kind, kinds
from field_tables import NOT_RUN, page
from measured import measured
from peers import PEERS, Peer, Setting, in_frames
from report import publish

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

HERE = Path(__file__).resolve().parent
OURS: dict[str, tuple[am.Method[Any] | None, bool]] = {
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
    """What a tracker made of a clip; `error` where nothing."""

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


class Cache:
    """Answers kept by all that they depend on, a line of JSON each.

    Nothing is made where it is closed: `get` raises `KeyError` at what is not known.
    """

    def __init__(self, path: Path, *, is_closed: bool) -> None:
        self.is_closed = is_closed
        path.parent.mkdir(exist_ok=True)
        self.path = path
        lines = path.read_text().splitlines() if path.exists() else []
        self.known: dict[str, Any] = {}
        for line in lines:
            entry = json.loads(line)
            self.known[entry["key"]] = entry["value"]

    def get(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """Give what is known, or make it and keep it."""
        text = json.dumps(key)
        if text not in self.known:
            if self.is_closed:
                raise KeyError(text)
            self.known[text] = make()
            with self.path.open("a") as file:
                file.write(json.dumps({"key": text, "value": self.known[text]}) + "\n")
        return self.known[text]


def digest(*paths: Path) -> str:
    """Give a word for the bytes of files."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.read_bytes())
    return found.hexdigest()[:12]


def scored(
    clip: str, truth: am.Tracks, work: Callable[[], NDArray[np.int64]], limit: float,
    prepared: float,
) -> Score:  # fmt: skip
    d = truth.detections
    run = measured(work, limit)
    row = Score(clip=clip, prepared=prepared, points=d.n_points, frames=d.n_frames, error=run.error)
    if run.labels is None:
        return row
    e = am.evaluate(am.Tracks(detections=d, labels=run.labels), truth)
    return replace(
        row, idf1=e.idf1, switches=e.switches_per_1000, wrong=e.wrong_links, broken=e.broken_links,
        tracks_per_true=e.n_tracks / e.n_markers, ms=1e3 * run.seconds / d.n_frames,
        megabytes=run.megabytes,
    )  # fmt: skip


def tuned(
    peer: Peer, first: Setting | None, truths: list[am.Tracks], trials: int, budget: float
) -> dict[str, Any]:
    """Search for the setting of the greatest mean IDF1.

    The first trial is what was found for a peer of the same motion, if there is one, the next is
    the middle, all others are drawn. None is begun when the budget is spent; one that was may take
    as long again. A trial ends where the clips left could not make it the best.
    """
    rng = np.random.default_rng(0)
    known = [peer.middle()] if first is None else [peer.near(first), peer.middle()]
    best: dict[str, Any] = {"setting": known[0], "idf1": -1.0, "trials": 0, "seconds": 0.0}
    error = ""
    while best["trials"] < trials and best["seconds"] < budget:
        setting = known.pop(0) if known else peer.draw(rng)
        left, total = budget, 0.0
        for n_left, truth in zip(range(len(truths))[::-1], truths, strict=True):
            run = measured(partial(peer.label, in_frames(truth.detections), setting), left)
            best["seconds"] += run.seconds
            left = max(left - run.seconds, 1.0)
            if run.labels is None:
                error, total = run.error, 0.0
                break  # as bad as can be, whatever it would make of the others
            tracks = am.Tracks(detections=truth.detections, labels=run.labels)
            total += am.evaluate(tracks, truth).idf1
            if total + n_left <= best["idf1"] * len(truths):
                break
        best["trials"] += 1
        if total / len(truths) > max(best["idf1"], 0.0):
            best |= {"setting": setting, "idf1": total / len(truths)}
    return best | {"error": error if best["idf1"] <= 0 else ""}


def unloadable(peer: Peer) -> str:
    """Try a peer, so that all of it is loaded and compiled; why it fails, if it does.

    In a child first: what ends its process must not end the benchmark.
    """
    truth = am.simulate.smooth(n_markers=30, frames=12, seed=1)
    truth = am.simulate.sense(truth, missing=0.1, clutter=0.1, noise=0.005, seed=1)
    rng = np.random.default_rng(1)
    for setting in (peer.middle(), *(peer.draw(rng) for _ in range(3))):
        work = partial(peer.label, in_frames(truth.detections), setting)
        run = measured(work, 20)
        if run.labels is not None:
            work()
        elif setting == peer.middle():
            text = re.sub(r"/\S*/", "", run.error)  # names of files, without where they are here
            return f"does not load: {text}"[:120]
    return ""


def setting_of(kind: Kind, peer: Peer, options: argparse.Namespace, cache: Cache) -> dict[str, Any]:
    """Search, after the peer whose motion is the same; or give what was found before."""
    first = setting_of(kind, peer.like, options, cache)["setting"] if peer.like else None
    budget = (options.trials, options.budget, options.tuning_frames)
    return cache.get(
        ("tuned", kind.tuned_as, peer.name, first, *budget, source_of(peer)),
        lambda: tuned(peer, first, [c.make() for c in kind.tuning], options.trials, options.budget),
    )


def source_of(peer: Peer) -> str:
    """Give a word for what a peer's row depends on, beside its setting."""
    own = Path(inspect.getfile(peer.label))
    return digest(own, HERE / "peers" / "peer.py", HERE / "field_clips.py")


def of_peer(kind: Kind, peer: Peer, options: argparse.Namespace, cache: Cache) -> list[Score]:
    setting = setting_of(kind, peer, options, cache)
    found: list[Score] = []
    for clip in kind.scored:

        def make(clip: Clip = clip) -> dict[str, Any]:
            truth = clip.make()
            d = truth.detections
            late = [s for s in found if s.error.startswith("more than") and s.points <= d.n_points]
            if late:  # no need to wait for it a second time
                row = replace(late[0], clip=clip.name, points=d.n_points, frames=d.n_frames)
                return asdict(row)
            work = partial(peer.label, in_frames(d), Setting(setting["setting"]))
            return asdict(scored(clip.name, truth, work, options.limit, setting["seconds"]))

        key = ("scored", clip.name, options.frames, peer.name, setting["setting"], options.limit)
        score = Score(**cache.get((*key, source_of(peer)), make))
        # Where no trial came to its end, the setting is that with which the search began.
        trials = 0 if setting["error"] else setting["trials"]
        found.append(replace(score, trials=trials))
    return found


def of_floor(kind: Kind, gap: int, options: argparse.Namespace, cache: Cache) -> list[Score]:
    """Score the truth, broken where a marker is hidden for long: who bridges less can do no better.

    Its switches are those that no such tracker avoids.
    """

    def make(clip: Clip) -> dict[str, Any]:
        truth = clip.make()
        d = truth.detections
        e = am.evaluate(am.floor(truth, gap), truth)
        return asdict(
            Score(
                clip=clip.name, idf1=e.idf1, switches=e.switches_per_1000, wrong=e.wrong_links,
                broken=e.broken_links, tracks_per_true=e.n_tracks / e.n_markers,
                points=d.n_points, frames=d.n_frames,
            )
        )  # fmt: skip

    source = digest(HERE / "field_clips.py")
    return [
        Score(**cache.get(("floor", c.name, options.frames, gap, source), partial(make, c)))
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

    def make(clip: Clip) -> dict[str, Any]:
        truth, model, prepared = estimated(clip)

        def work() -> NDArray[np.int64]:
            if is_stitched:
                return am.identify(truth.detections, method, model=model, seed=0).tracks.labels
            return am.track(truth.detections, method, model=model, seed=0).labels

        return asdict(scored(clip.name, truth, work, options.limit, prepared))

    return [
        Score(**cache.get(("ours", c.name, options.frames, name, source), partial(make, c)))
        for c in kind.scored
    ]


def warm() -> None:
    """Run ours once, for what they load on first use is not theirs alone to pay."""
    truth = am.simulate.sense(am.simulate.cube(frames=30, seed=1), clutter=0.1, seed=1)
    model = am.estimate_model(truth.detections).model
    for method, _ in OURS.values():
        am.track(truth.detections, method, model=model, seed=0)
        am.identify(truth.detections, method, model=model, seed=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = HERE.parents[1] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="", help="kinds or trackers with this in their name")
    parser.add_argument(
        "--without", nargs="*", default=[], help="leave out trackers with this in their name"
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--budget", type=float, default=300, help="CPU seconds of a search")
    parser.add_argument("--limit", type=float, default=300, help="CPU seconds of a run")
    parser.add_argument("--frames", type=int, default=600, help="at most, of a clip")
    parser.add_argument("--tuning-frames", type=int, default=200, help="at most, of one to tune on")
    parser.add_argument("--files", type=int, default=9, help="captures at most, to be scored on")
    parser.add_argument("--known", action="store_true", help="run nothing, show what there is")
    parser.add_argument("--quick", action="store_true", help="one seed, 2 trials, 60 frames")
    parser.add_argument("--markdown", type=Path, help="folder of the tables")
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.trials, options.frames, options.tuning_frames = 1, 2, 60, 40
        options.budget, options.limit, options.files = 10, 20, 2
    cache = Cache(HERE.parent / "build" / "field.jsonl", is_closed=options.known)
    every = kinds(
        options.data, seeds=options.seeds, frames=options.frames,
        tuning_frames=options.tuning_frames, files=options.files,
    )  # fmt: skip
    names = [n for n in (*PEERS, *OURS) if not any(part in n for part in options.without)]
    if any(options.only in kind.name for kind in every):
        every = [kind for kind in every if options.only in kind.name]
    else:
        names = [name for name in names if options.only in name]
    why_not = {
        name: "" if options.known else unloadable(PEERS[name]) for name in names if name in PEERS
    }
    if not options.known and any(name in OURS for name in names):
        warm()
    found: dict[tuple[str, str], list[Score]] = {}
    for kind in every:
        for name in names:
            if why_not.get(name):
                scores = [Score(clip=c.name, error=why_not[name]) for c in kind.scored]
            else:
                try:
                    if name in PEERS:
                        scores = of_peer(kind, PEERS[name], options, cache)
                    else:
                        scores = of_ours(kind, name, options, cache)
                except KeyError:
                    scores = [Score(clip=c.name, error=NOT_RUN) for c in kind.scored]
            found.setdefault((kind.name, name), []).extend(scores)
            values = [s.idf1 for s in scores]
            value = f"{np.mean(values):.3f}"
            print(kind.name, name, value, scores[-1].error, sep=" | ", flush=True)
    publish(page(found, names, list(OURS), options), options.markdown)


if __name__ == "__main__":
    main()
