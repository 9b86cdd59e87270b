"""Options that several methods share: the gate, the life of a track, rigid bodies."""

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
"""Pairs of track and detection within the gates of one frame (1.2 GB of them)."""


@record
class Gate:
    """Which detections a track may take.

    Parameters
    ----------
    probability : float
        Probability that the gate misses the detection of its own track, were the model exact; the
        level of the χ² test.
    """

    probability: float = 1e-9

    def __post_init__(self) -> None:
        check_number("gate.probability", self.probability, above=0, below=1)


@record
class Lifecycle:
    """When a tentative track is confirmed or deleted.

    A track begins tentative at a detection that no track took. Its score is the log odds of marker
    against clutter. Once confirmed it gets the next identity, together with all its detections so
    far; a deleted track leaves its detections as clutter. A confirmed track ends when its gap
    exceeds the model's maximal gap.

    Parameters
    ----------
    confirm_probability : float
        Probability of a marker at which a tentative track is confirmed.
    delete_odds : float
        A tentative track is deleted when its odds fall by this factor from their best.
    """

    confirm_probability: float = 0.999
    delete_odds: float = 300.0

    def __post_init__(self) -> None:
        check_number("lifecycle.confirm_probability", self.confirm_probability, above=0.5, below=1)
        check_number("lifecycle.delete_odds", self.delete_odds, above=1)


@record
class Rigidity:
    """How markers that keep their distances predict an occluded one, while frames arrive.

    Which tracks keep their distances is learnt while they are seen. An occluded track is expected
    where its neighbours carry it, for longer than the model's maximal gap too, and a detection that
    disagrees with the neighbours counts for less.

    Parameters
    ----------
    max_gap : int
        Most frames of an occlusion that neighbours carry a track through, 1 to 100000; after that
        the model's maximal gap counts.
    bond_weight : float
        Greatest effect, in nats, of the neighbours on an ambiguous pairing, 0 to 100; at 0 they
        carry occluded tracks only.
    """

    max_gap: int = 60
    bond_weight: float = 2.0

    def __post_init__(self) -> None:
        at_most = 100_000
        check_number(
            "rigid.max_gap", self.max_gap, above=1, below=at_most, closed=True, integer=True
        )
        check_number("rigid.bond_weight", self.bond_weight, above=0, below=100, closed=True)


class SharedOptions(Protocol):
    """What every method has that predicts, gates and confirms tracks frame by frame."""

    @property
    def gate(self) -> Gate: ...  # noqa: D102
    @property
    def lifecycle(self) -> Lifecycle: ...  # noqa: D102
    @property
    def rigid(self) -> Rigidity | None: ...  # noqa: D102


def check_shared(options: SharedOptions) -> None:
    """Raise `ParameterError` where an option is none of its record."""
    check_kind("gate", options.gate, Gate, "am.tracking.Gate()")
    check_kind("lifecycle", options.lifecycle, Lifecycle, "am.tracking.Lifecycle()")
    if options.rigid is not None:
        check_kind("rigid", options.rigid, Rigidity, "am.tracking.Rigidity(), or None")


def check_flags(options: object, *names: str) -> None:
    """Raise `ParameterError` where an option is neither True nor False."""
    for name in names:
        value = getattr(options, name)
        if not isinstance(value, bool):
            raise ParameterError(name, "True or False", repr(value))


def engine_model(
    options: SharedOptions, model: TrackingModel, n_axes: int
) -> tuple[_engine.MotionModel, _engine.ScoreModel, _engine.LifeOptions]:
    """Make what each of the engine's trackers takes first."""
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
    """Make the engine's options of rigid bodies."""
    from asterism import _engine

    if rigid is None:
        return _engine.CarryOptions()
    return _engine.CarryOptions(
        is_on=True, max_carried=int(rigid.max_gap), bond_weight=float(rigid.bond_weight)
    )


def shared_counts(options: SharedOptions, stats: _engine.FrameStats) -> dict[str, float]:
    """Tell what a frame, or a run of them, took, as far as all these methods count it."""
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
            "bonds": stats.n_bonds,
            "carried": stats.n_carried,
            "returned": stats.n_returned,
            "refused": stats.n_refused,
        }
    return counts
