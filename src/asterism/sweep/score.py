"""Scores of one case of a study."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from asterism.io import read
from asterism.metrics import evaluate
from asterism.simulate import SCENES, Burst, Ghosts, Visits, corrupt
from asterism.tracking import method_by_name, track

if TYPE_CHECKING:
    from asterism.model import Tracks
    from asterism.sweep.study import Case

__all__ = ["score_case"]

_RECORDS = {"burst": Burst, "ghosts": Ghosts, "visits": Visits}


def score_case(case: Case, scores: tuple[str, ...], *, progress: Any = None) -> dict[str, float]:
    """Simulate or read the scene of a case, corrupt it, track it, and score the tracks.

    Parameters
    ----------
    case : Case
        Settings.
    scores : tuple of str
        Fields of `asterism.metrics.Evaluation`.
    progress : None
        Not used: a case is short.

    Returns
    -------
    dict of float
        Scores by name.

    Raises
    ------
    ParameterError, FormatError
        If a setting is impossible, or the capture cannot be read.
    """
    del progress
    scene, method = dict(case.settings["scene"]), dict(case.settings["method"])
    if (path := scene.pop("capture", None)) is not None:
        truth = _capture(path)
    else:
        truth = SCENES[scene.pop("scene")].make(**scene, seed=case.seed)
    options: dict[str, Any] = {
        name: _RECORDS[name](**value) if name in _RECORDS else value
        for name, value in case.settings["corruption"].items()
    }
    truth = corrupt(truth, **options, seed=case.seed)
    name, stitch = method.pop("method", "auto"), method.pop("stitch", "auto")
    made = None if name == "auto" else method_by_name(name, **method)
    tracks = track(truth.detections, made, stitch=stitch, seed=case.seed)
    found = evaluate(tracks, truth)
    return {score: float(getattr(found, score)) for score in scores}


@functools.lru_cache(maxsize=4)
def _capture(path: str) -> Tracks:
    return read(path).tracks
