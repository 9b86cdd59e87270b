"""How the peers of `field.py` are tuned: a random search, each within the same CPU time."""

from __future__ import annotations

import inspect
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from field_cache import digest
from measured import measured
from peers import Peer, Setting, in_frames

if TYPE_CHECKING:
    import argparse

    from field_cache import Cache
    from field_clips import Kind

__all__ = ["setting_of", "source_of", "tuned", "unloadable"]

HERE = Path(__file__).resolve().parent


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


def unloadable(peer: Peer) -> str:
    """Try a peer, so that all of it is loaded and compiled; why it fails, if it does.

    In a child first: what ends its process must not end the benchmark.
    """
    truth = am.simulate.smooth(n_markers=30, frames=12, seed=1)
    truth = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=0.005, seed=1)
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
