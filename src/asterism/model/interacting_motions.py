"""Interacting multiple model: a marker that switches between motions."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from asterism.checks import keep_array
from asterism.errors import ParameterError
from asterism.model.linear_motion import LinearMotion
from asterism.model.motion import Motion, SingleMotion
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["InteractingMotions"]

MAX_OFF = 1e-5
"""Largest difference of a sum of probabilities from 1."""


@record(eq=False)
class InteractingMotions(Motion):
    """Interacting multiple model (IMM): a marker that switches between motions.

    Modes are for example rest, walking and free flight. The filter keeps one state for each mode
    and mixes them in every step (Blom & Bar-Shalom 1988). The likelihood of a detection is that of
    the mixture of the predictions, an approximation of the sum over all sequences of modes.

    Parameters
    ----------
    models : sequence of 2 or 3 motions
        The modes: single motions of the same class with different noise. New tracks start with
        the prior covariance of the first.
    transitions : array_like of shape (M, M)
        Probability of switching from mode (row) to mode (column) in a step; positive, rows sum
        to 1.

    Examples
    --------
    >>> import asterism as am
    >>> motion = am.InteractingMotions(
    ...     models=[am.DWNA(acceleration_sigma=1), am.DWNA(acceleration_sigma=50)],
    ...     transitions=[[0.98, 0.02], [0.05, 0.95]],
    ... )
    >>> len(motion.modes), motion.mode_transitions[0].tolist()
    (2, [0.98, 0.02])
    """

    models: tuple[SingleMotion, ...]
    transitions: NDArray[np.float64]

    kind: ClassVar[str] = "interacting"

    def __post_init__(self) -> None:
        given: Any = self.models
        if not isinstance(given, (tuple, list)) or not all(
            isinstance(model, Motion) for model in cast("list[Any]", given)
        ):
            raise ParameterError("models", "2 or 3 motion models", repr(given))
        models = tuple(self.models)
        M = len(models)
        if M not in (2, 3):
            raise ParameterError("models", "2 or 3 motion models", M)
        kinds = [model.kind for model in models]
        if len(set(kinds)) > 1 or InteractingMotions.kind in kinds:
            raise ParameterError("models", "single motions of one kind", kinds)
        linear = [model for model in models if isinstance(model, LinearMotion)]
        if any(m.step != linear[0].step or not np.array_equal(m.F, linear[0].F) for m in linear):
            raise ParameterError(
                "models", "motions with the same F and step", [m.F for m in linear]
            )
        observations = np.stack([model.observation for model in models])
        if not (observations == observations[0]).all():
            raise ParameterError("models", "motions with the same H", observations.tolist())
        transitions = keep_array("transitions", self.transitions, (M, M))
        off = np.abs(transitions.sum(axis=1) - 1)
        if (transitions <= 0).any() or (off > MAX_OFF).any():
            raise ParameterError("transitions", "positive rows that sum to 1", transitions.tolist())
        object.__setattr__(self, "models", models)
        object.__setattr__(self, "transitions", transitions)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, InteractingMotions)
            and self.models == other.models
            and np.array_equal(self.transitions, other.transitions)
        )

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:  # kept, because a stream looks the motion up in every frame
        return hash((self.models, self.transitions.tobytes()))

    @property
    def modes(self) -> tuple[SingleMotion, ...]:
        """The M modes, `models`."""
        return self.models

    @property
    def mode_transitions(self) -> NDArray[np.float64]:
        """Probability of switching from mode (row) to mode (column) in a step, shape (M, M)."""
        return self.transitions
