"""Side by side: other trackers and ours, on scenes and on real captures corrupted in four ways.

The peers are tuned: the same number of random settings each, within the same CPU time, scored by
IDF1 on other seeds of the same kind of scene, or on other captures corrupted in the same way. Ours
estimate their model from the clip, and nothing is tuned. Rows are kept in build/field.jsonl as they
come, so that a long run can be stopped and gone on with.

    python benchmarks/field.py [--quick] [--only NAME] [--seeds N] [--trials N] [--markdown FOLDER]
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before NumPy is loaded: one core for all

import numpy as np

import asterism as am
from asterism.io.atomic import replacing
from field_cache import Cache
from field_clips import kinds
from field_growth import growth
from field_rows import ORACLES, OURS, Found, Score, rows_of, warm
from field_search import unloadable
from field_tables import pages
from peers import PEERS
from report import publish

HERE = Path(__file__).resolve().parent


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
    parser.add_argument(
        "--own", action="store_true", help="tune on the clips that are scored: more than is fair"
    )
    parser.add_argument("--known", action="store_true", help="run nothing, show what there is")
    parser.add_argument("--quick", action="store_true", help="one seed, 2 trials, 60 frames")
    parser.add_argument("--markdown", type=Path, help="folder of the tables")
    parser.add_argument("--figure", type=Path, help="of time by the number of markers")
    options = parser.parse_args()
    if options.quick:
        options.seeds, options.trials, options.frames, options.tuning_frames = 1, 2, 60, 40
        options.budget, options.limit, options.files = 10, 20, 2
    cache = Cache(HERE.parent / "build" / "field.jsonl", is_closed=options.known)
    every = kinds(
        options.data, seeds=options.seeds, frames=options.frames,
        tuning_frames=options.tuning_frames, files=options.files,
    )  # fmt: skip
    if options.own:
        every = [replace(k, tuned_as=f"{k.name}, its own", tuning=k.scored) for k in every]
    names = [n for n in (*ORACLES, *PEERS, *OURS) if not any(part in n for part in options.without)]
    if any(options.only in kind.name for kind in every):
        every = [kind for kind in every if options.only in kind.name]
    else:
        names = [name for name in names if options.only in name]
    why_not = {
        name: "" if options.known else unloadable(PEERS[name]) for name in names if name in PEERS
    }
    if not options.known and any(name in OURS for name in names):
        warm()
    found: Found = {}
    for kind in every:
        for name in names:
            if why_not.get(name):
                scores = [Score(clip=c.name, error=why_not[name]) for c in kind.scored]
            else:
                scores = rows_of(kind, name, options, cache)
            found[kind.name, name] = scores
            value = f"{np.mean([s.idf1 for s in scores]):.3f}"
            print(kind.name, name, value, scores[-1].error, sep=" | ", flush=True)
    for name, lines in pages(found, options).items():
        publish(lines, options.markdown / f"{name}.md" if options.markdown else None)
    if options.figure:
        with replacing(options.figure) as file:
            file.write(am.plot.figure_bytes(growth(found), options.figure.suffix[1:]))


if __name__ == "__main__":
    main()
