"""Side by side: other trackers and ours, on scenes and on real captures corrupted in four ways.

The peers are tuned: the same number of random settings each, within the same CPU time, scored by
IDF1 on other seeds of the same kind of scene, or on other captures corrupted in the same way. Ours
estimate their model from the clip, and nothing is tuned. Rows are kept in build/field.jsonl as they
come, so that a long run can be stopped and gone on with.

    python benchmarks/field.py [--quick] [--only NAME] [--seeds N] [--trials N] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import os
import re
import time
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
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
    tracks_per_true: float = float("nan")
    ms: float = float("nan")
    megabytes: float = float("nan")
    prepared: float = float("nan")
    trials: int | None = None
    error: str = ""


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
    run = measured(work, limit)
    if run.labels is None:
        return Score(clip=clip, error=run.error, prepared=prepared)
    e = am.evaluate(am.Tracks(detections=truth.detections, labels=run.labels), truth)
    return Score(
        clip=clip, idf1=e.idf1, switches=e.switches_per_1000, wrong=e.wrong_links,
        tracks_per_true=e.n_tracks / e.n_markers, ms=1e3 * run.seconds / truth.detections.n_frames,
        megabytes=run.megabytes, prepared=prepared,
    )  # fmt: skip


def tuned(peer: Peer, truths: list[am.Tracks], trials: int, budget: float) -> dict[str, Any]:
    """Search for the setting of the greatest mean IDF1; the first trial is the middle."""
    rng = np.random.default_rng(0)
    best: dict[str, Any] = {"setting": peer.middle(), "idf1": -1.0, "trials": 0, "seconds": 0.0}
    error = ""
    while best["trials"] < trials and best["seconds"] < budget:
        setting = peer.draw(rng) if best["trials"] else peer.middle()
        values: list[float] = []
        for truth in truths:
            left = max(budget - best["seconds"], 1.0)
            run = measured(partial(peer.label, in_frames(truth.detections), setting), left)
            best["seconds"] += run.seconds
            if run.labels is None:
                error = run.error
                values.append(0.0)
                break  # as bad as can be, whatever it would make of the others
            tracks = am.Tracks(detections=truth.detections, labels=run.labels)
            values.append(am.evaluate(tracks, truth).idf1)
        best["trials"] += 1
        mean = float(np.mean(values)) if len(values) == len(truths) else 0.0
        if mean > best["idf1"]:
            best |= {"setting": setting, "idf1": mean}
    return best | {"error": error if best["idf1"] <= 0 else ""}


def unloadable(peer: Peer) -> str:
    """Try a peer on a few frames, which loads and compiles all of it; why it fails, if it does."""
    truth = am.simulate.cube(frames=12, seed=1)
    try:
        peer.label(in_frames(truth.detections), peer.middle())
    except Exception as error:  # whatever a peer raises is its row
        reason: BaseException = error
        while reason.__cause__ is not None:
            reason = reason.__cause__
        text = re.sub(r"/\S*/", "", str(reason))  # names of files, without where they are here
        return f"does not load: {text}"[:120]
    return ""


def of_peer(kind: Kind, peer: Peer, options: argparse.Namespace, cache: Cache) -> list[Score]:
    source = digest(*sorted((HERE / "peers").glob("*.py")), HERE / "field_clips.py")
    budget = (options.trials, options.budget, options.tuning_frames, options.points, options.files)
    setting: dict[str, Any] = cache.get(
        ("tuned", kind.tuned_as, peer.name, *budget, source),
        lambda: tuned(peer, [c.make() for c in kind.tuning], options.trials, options.budget),
    )
    found: list[Score] = []
    for clip in kind.scored:
        if found and found[-1].error:  # a clip of the same size again
            found.append(Score(clip=clip.name, error=found[-1].error))
            continue

        def make(clip: Any = clip) -> dict[str, Any]:
            truth = clip.make()
            work = partial(peer.label, in_frames(truth.detections), Setting(setting["setting"]))
            return asdict(scored(clip.name, truth, work, options.limit, setting["seconds"]))

        key = ("scored", clip.name, options.frames, peer.name, setting["setting"], options.limit)
        score = Score(**cache.get((*key, source), make))
        # Where no trial came to its end, the middle is what there is.
        trials = 0 if setting["error"] else setting["trials"]
        found.append(replace(score, trials=trials))
    return found


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
    source = digest(*itertools.chain(*parts), HERE / "field_clips.py")
    method, is_stitched = OURS[name]

    def make(clip: Any) -> dict[str, Any]:
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    beside = HERE.parents[1] / "shared" / "data"
    parser.add_argument("--data", type=Path, default=beside)
    parser.add_argument("--only", default="", help="kinds or trackers with this in their name")
    parser.add_argument(
        "--without", default="\n", help="leave out trackers with this in their name"
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--budget", type=float, default=300, help="CPU seconds of a search")
    parser.add_argument("--limit", type=float, default=300, help="CPU seconds of a run")
    parser.add_argument("--frames", type=int, default=600, help="at most, of a clip")
    parser.add_argument("--tuning-frames", type=int, default=200, help="at most, of one to tune on")
    parser.add_argument("--points", type=int, default=30_000, help="at most, of a capture")
    parser.add_argument("--files", type=int, default=8, help="captures at most")
    parser.add_argument("--known", action="store_true", help="run nothing, show what there is")
    parser.add_argument("--quick", action="store_true", help="one seed, 2 trials, 60 frames")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.trials, options.frames, options.tuning_frames = 1, 2, 60, 40
        options.budget, options.limit, options.files = 10, 20, 2
    cache = Cache(HERE.parent / "build" / "field.jsonl", is_closed=options.known)
    every = kinds(
        options.data, seeds=options.seeds, frames=options.frames,
        tuning_frames=options.tuning_frames, points=options.points, files=options.files,
    )  # fmt: skip
    names = [name for name in (*PEERS, *OURS) if options.without not in name]
    if any(options.only in kind.name for kind in every):
        every = [kind for kind in every if options.only in kind.name]
    else:
        names = [name for name in names if options.only in name]
    why_not = {name: unloadable(PEERS[name]) for name in names if name in PEERS}
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
