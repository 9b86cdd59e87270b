"""Options common to several methods: gate, confirmation and deletion, rigid bodies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol

from asterism.checks import check_kind, check_number
from asterism.errors import ParameterError
from asterism.records import record

if TYPE_CHECKING:
    from asterism import _engine
    from asterism.model import TrackingModel

__all__ = [
    "MAX_CANDIDATES",
    "Gate",
    "Lifecycle",
    "Rigidity",
    "SharedOptions",
    "carry_options",
    "check_flags",
    "check_shared",
    "engine_model",
    "shared_counts",
]

MAX_CANDIDATES = 50_000_000
"""Largest number of pairs of track and detection in the gates of one frame (1.2 GB)."""


@record
class Gate:
    """Gate, the region in which a track can be assigned a detection.

    Parameters
    ----------
    probability : float
        Probability in (0, 1) that a detection of the track lies outside the gate, if the model is
        exact: the level of the χ² test. Smaller values make larger gates, with more candidates
        and more time. The default is small so that motion that exceeds the model stays in
        the gate.

    Examples
    --------
    >>> import asterism as am
    >>> am.GNN(gate=am.tracking.Gate(probability=1e-4))
    GNN(gate=Gate(probability=0.0001))
    """

    probability: float = 1e-9

    def __post_init__(self) -> None:
        check_number("gate.probability", self.probability, above=0, below=1)


@record
class Lifecycle:
    """Confirmation and deletion of tentative tracks.

    A tentative track starts at a detection that is assigned to no track. Its score is the log odds
    of marker against clutter. A confirmed track gets the next label, which all its detections so
    far receive; the detections of a deleted track become clutter. A confirmed track is terminated
    when its gap exceeds the model's `max_gap`.

    Parameters
    ----------
    confirm_probability : float
        Existence probability at which a tentative track is confirmed, in (0.5, 1). Larger values
        delay the confirmation and prevent false tracks; at the default at most one confirmed track
        in a thousand is false, under the model.
    delete_odds : float
        A tentative track is deleted when its odds have fallen by this factor from their maximum,
        > 1. Larger values keep tentative tracks for longer.

    Examples
    --------
    >>> import asterism as am
    >>> am.GNN(lifecycle=am.tracking.Lifecycle(confirm_probability=0.99))
    GNN(lifecycle=Lifecycle(confirm_probability=0.99))
    """

    confirm_probability: float = 0.999
    delete_odds: float = 300.0

    def __post_init__(self) -> None:
        check_number("lifecycle.confirm_probability", self.confirm_probability, above=0.5, below=1)
        check_number("lifecycle.delete_odds", self.delete_odds, above=1)


@record
class Rigidity:
    """Association and prediction by neighbours at stable distances, frame by frame.

    Stable distances are estimated while both markers are detected. Which detections the markers
    of a body have is decided jointly by these distances. An occluded track is predicted by a rigid
    fit of its neighbours, also beyond the model's `max_gap`.

    Parameters
    ----------
    max_gap : int
        Longest occlusion through which neighbours predict a track, frames, 1 to 100000. Beyond it
        the model's `max_gap` applies. Larger values keep tracks through longer occlusions.

    Examples
    --------
    >>> import asterism as am
    >>> am.GNN(rigid=am.tracking.Rigidity(max_gap=120))
    GNN(rigid=Rigidity(max_gap=120))
    """

    max_gap: int = 60

    def __post_init__(self) -> None:
        max_frames = 100_000
        check_number(
            "rigid.max_gap", self.max_gap, above=1, below=max_frames, closed=True, integer=True
        )


class SharedOptions(Protocol):
    """Options of every method that predicts, gates and confirms tracks frame by frame.

    Examples
    --------
    >>> import asterism as am
    >>> am.SMP().gate, am.SMP().lifecycle, am.SMP().rigid
    (Gate(), Lifecycle(), None)
    """

    @property
    def gate(self) -> Gate:
        """Region in which a track can be assigned a detection."""
        ...

    @property
    def lifecycle(self) -> Lifecycle:
        """Confirmation and deletion of tentative tracks."""
        ...

    @property
    def rigid(self) -> Rigidity | None:
        """Prediction of occluded markers by their neighbours; None for no such prediction."""
        ...


def check_shared(options: SharedOptions) -> None:
    """Raise `ParameterError` if an option is not a record of its class.

    Parameters
    ----------
    options : SharedOptions
        Method, or any object with these options.

    Examples
    --------
    >>> import asterism as am
    >>> am.GNN(gate=0.99)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: gate: expected a Gate, found float. Try am.tracking.Gate().
    """
    check_kind("gate", options.gate, Gate, "am.tracking.Gate()")
    check_kind("lifecycle", options.lifecycle, Lifecycle, "am.tracking.Lifecycle()")
    if options.rigid is not None:
        check_kind("rigid", options.rigid, Rigidity, "am.tracking.Rigidity(), or None")


def check_flags(options: object, *names: str) -> None:
    """Raise `ParameterError` if an option is neither True nor False.

    Parameters
    ----------
    options : object
        Record of options.
    *names : str
        Names of the options to check.

    Examples
    --------
    >>> import asterism as am
    >>> am.SMP(strict="yes")
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: strict: expected True or False, found 'yes'
    """
    for name in names:
        value = getattr(options, name)
        if not isinstance(value, bool):
            raise ParameterError(name, "True or False", repr(value))


def engine_model(
    options: SharedOptions, model: TrackingModel, n_axes: int
) -> tuple[_engine.MotionModel, _engine.ScoreModel, _engine.LifeOptions]:
    """Return the first arguments of each of the engine's trackers.

    Parameters
    ----------
    options : SharedOptions
        Gate and lifecycle of the method.
    model : TrackingModel
        Model whose posterior is searched.
    n_axes : int
        Number of coordinates, 2 or 3.

    Returns
    -------
    motion, score, life
        Motion model, score model, and options of the gate and the lifecycle.

    Examples
    --------
    >>> import asterism as am
    >>> model = am.estimate_model(am.simulate.cube(frames=20, seed=1).detections).model
    >>> [type(part).__name__ for part in engine_model(am.GNN(), model, 3)]
    ['MotionModel', 'ScoreModel', 'LifeOptions']
    """
    from scipy.special import chdtri

    from asterism import _engine
    from asterism.model.compiled import motion_model, score_model

    p = options.lifecycle.confirm_probability
    life = _engine.LifeOptions(
        gate=float(chdtri(n_axes, options.gate.probability)),
        confirm_score=math.log(p / (1 - p)),
        delete_drop=math.log(options.lifecycle.delete_odds),
        max_candidates=MAX_CANDIDATES,
    )
    return motion_model(model, n_axes), score_model(model), life


def carry_options(rigid: Rigidity | None) -> _engine.CarryOptions:
    """Return the engine's options of the prediction by neighbours.

    Parameters
    ----------
    rigid : Rigidity or None
        Options of the method; None switches the prediction off.

    Returns
    -------
    CarryOptions

    Examples
    --------
    >>> type(carry_options(Rigidity())).__name__
    'CarryOptions'
    """
    from asterism import _engine

    if rigid is None:
        return _engine.CarryOptions()
    return _engine.CarryOptions(is_on=True, max_carried=int(rigid.max_gap))


def shared_counts(options: SharedOptions, stats: _engine.FrameStats) -> dict[str, float]:
    """Return the counts that all frame-by-frame methods have.

    Parameters
    ----------
    options : SharedOptions
        Options of the method.
    stats : FrameStats
        Counts of the engine, of one frame or summed over several.

    Returns
    -------
    dict of str to float
        Counts by name, as in ``tracks.info``.

    Examples
    --------
    >>> import asterism as am
    >>> tracks = am.track(am.simulate.cube(frames=20, seed=1).detections, am.GNN())
    >>> tracks.info["tracks"], tracks.info["largest_group"]
    (8, 1)
    """
    counts: dict[str, float] = {
        "tracks": stats.n_confirmed,
        "tentative": stats.n_tentative,
        "pending": stats.n_pending,
        "candidates": stats.n_candidates,
        "groups": stats.n_groups,
        "largest_group": stats.largest_group,
    }
    if options.rigid is not None:
        counts |= {
            "carried": stats.n_carried,
            "returned": stats.n_returned,
            "refused": stats.n_refused,
        }
    return counts
