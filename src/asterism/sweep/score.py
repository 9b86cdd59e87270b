"""Scores of one case of a study."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING, Any

from asterism.camera import Rig
from asterism.io import read
from asterism.metrics import evaluate
from asterism.simulate import SCENES, Burst, Ghosts, Visits, corrupt
from asterism.sweep.study import RING
from asterism.tracking import method_by_name, track

if TYPE_CHECKING:
    from asterism.model import Tracks
    from asterism.sweep.study import Case

__all__ = ["score_case", "truth_of"]

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
    truth, method = truth_of(case), dict(case.settings["method"])
    name, stitch = method.pop("method", "auto"), method.pop("stitch", "auto")
    made = None if name == "auto" else method_by_name(name, **method)
    tracks = track(truth.detections, made, stitch=stitch, seed=case.seed)
    found = evaluate(tracks, truth)
    return {score: float(getattr(found, score)) for score in scores}


def truth_of(case: Case) -> Tracks:
    """Simulate or read the scene of a case, and corrupt it.

    Parameters
    ----------
    case : Case
        Settings.

    Returns
    -------
    Tracks
        True partition of the corrupted detections.

    Examples
    --------
    >>> import asterism as am
    >>> study = am.sweep.Study(
    ...     scenes={"cube": {"scene": "cube"}}, corruptions={"noise": {"noise": 0.01}},
    ...     methods={"gnn": {"method": "gnn"}})
    >>> truth_of(study.cases()[0]).n_tracks
    8
    """
    scene = dict(case.settings["scene"])
    if (path := scene.pop("capture", None)) is not None:
        truth = _capture(path)
    else:
        truth = SCENES[scene.pop("scene")].make(**scene, seed=case.seed)
    options: dict[str, Any] = {
        name: _RECORDS[name](**value) if name in _RECORDS else value
        for name, value in case.settings["corruption"].items()
    }
    n_cameras = options.pop(RING, None)
    rig = None if n_cameras is None else _ring(truth, n_cameras)
    return corrupt(truth, **options, rig=rig, seed=case.seed)


def _ring(truth: Tracks, n_cameras: int) -> Rig:
    """Return cameras 2.8 m high on a ring that leaves 3 m around the scene."""
    points = truth.detections.points
    low, high = points.min(axis=0), points.max(axis=0)
    radius = 3.0 + float((high - low)[:2].max())
    return Rig.ring(n_cameras, radius=radius, height=2.8, target=(low + high) / 2)


@functools.lru_cache(maxsize=4)
def _capture(path: str) -> Tracks:
    return read(path).tracks
