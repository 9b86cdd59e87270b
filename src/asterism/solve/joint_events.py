"""Marginals of joint association events, as in joint probabilistic data association (JPDA).

The caller does the gating, computes the densities and uses the marginals.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from asterism import _engine
from asterism.checks import check_array, check_number
from asterism.errors import ParameterError, SolverLimit
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["JointMarginals", "joint_marginals"]

_MAX_LOG = 1e100
_MAX_STATES = 2**30


@record(eq=False)
class JointMarginals:
    """Result of `joint_marginals`.

    Attributes
    ----------
    marginals : ndarray of shape (n, m + 1)
        ``marginals[i, j]`` is the probability that track i has detection j, ``marginals[i, -1]``
        that it has none. Rows sum to 1, the columns of detections to at most 1.
    log_total : float
        Log of the total weight of the summed joint events. With a beam it is too small by at most
        ``-log(1 - bound)``.
    best : ndarray of int, shape (n,)
        Detection of each track in the most probable joint event, -1 for a missed detection; one
        of them if several are equally probable. Exact also with a beam.
    method : {"exact", "beam"}
        "exact" if every joint event was summed, "beam" if not.
    bound : float
        Upper bound of the total variation between the distribution behind the marginals and the
        true one; it holds for each marginal too. 0 when exact. If the weights exceed the range
        of doubles, which takes a group of hundreds of tracks, it is 1 and the marginals are
        those of `best` alone.
    n_states : int
        Largest number of states held after a step.

    Examples
    --------
    >>> found = joint_marginals([[0.0]], [0.0])
    >>> found.method, found.n_states
    ('exact', 1)
    """

    marginals: NDArray[np.float64]
    log_total: float
    best: NDArray[np.int64]
    method: Literal["exact", "beam"]
    bound: float
    n_states: int


def joint_marginals(
    log_weights: ArrayLike, log_miss: ArrayLike, *, max_states: int = 2**20
) -> JointMarginals:
    """Compute association probabilities of n tracks and m detections over all joint events.

    A joint event assigns to every track one detection or a missed detection, ``θ_i ∈ {1..m, 0}``,
    and no detection to two tracks. Its probability is

    ``P(θ) = Π_i w_{i θ_i} / Σ_θ' Π_i w_{i θ'_i}``

    and the marginals are ``β_ij = P(θ_i = j)``. In joint probabilistic data association [1]
    ``w_ij = N(y_j; ŷ_i, S_i) P_d / λ_f`` within the gate and ``w_i0 = 1 - P_d``.

    Groups of tracks that share no detection, directly or through others, are summed separately.
    In each group tracks and detections are eliminated one by one, forward and backward. A state is
    the used subset of the *frontier*: the remaining nodes with an eliminated neighbour. A group of
    n tracks that share the same m detections needs ``2^min(n, m)`` states, a chain of any length
    needs two. Efficient hypothesis management [2] is another way to share work between events.

    A group whose frontier exceeds `max_states` is summed over a *beam*: the states with the
    largest upper bounds. The mass F(s) of each dropped state, times a bound U(s) of the remaining
    weight, adds to a bound D of the missing weight. With the summed weight Z, the total variation
    between the returned distribution and the true one is at most ``D / (Z + D)``, and over all
    groups ``1 - Π (1 - D / (Z + D))``.

    Parameters
    ----------
    log_weights : array_like of shape (n, m)
        ``log w_ij``; -inf where track i cannot have detection j.
    log_miss : array_like of shape (n,)
        ``log w_i0``, finite.
    max_states : int
        Largest number of states of a layer, 1 to 2^30. Larger values keep larger groups exact,
        at the cost of memory: an exact sum of 2^20 states takes about 90 MB for 20 tracks, a beam
        of 2^20 states about 110 MB for 60. Both grow with the square root of the number of tracks
        in the group.

    Returns
    -------
    JointMarginals

    Raises
    ------
    ParameterError
        If the arrays do not fit each other or hold NaN, +inf, or logs beyond ±1e100.
    SolverLimit
        If more than 1024 tracks or detections compete at once.

    References
    ----------
    1. Y. Bar-Shalom, X.-R. Li: Multitarget-Multisensor Tracking: Principles and Techniques.
       YBS, 1995.
    2. P. Horridge, S. Maskell: Real-time tracking of hundreds of targets with efficient exact
       JPDAF implementation. FUSION, 2006.

    Examples
    --------
    Two tracks compete for one detection; its weight for the first is twice that for the second.

    >>> found = joint_marginals(np.log([[2.0], [1.0]]), [0.0, 0.0])
    >>> found.marginals
    array([[0.5 , 0.5 ],
           [0.25, 0.75]])
    >>> found.best
    array([ 0, -1])
    """
    check_number("max_states", max_states, above=1, below=_MAX_STATES, closed=True, integer=True)
    miss = check_array("log_miss", log_miss, ("n",))
    weights = check_array("log_weights", log_weights, (len(miss), "m"), finite=False)
    for name, logs in (("log_weights", weights), ("log_miss", miss)):
        # The comparison is False for NaN too. Sums of larger logs could exceed the range of
        # doubles.
        fits = (np.abs(logs) <= _MAX_LOG) | (np.isneginf(logs) & (name == "log_weights"))
        if not fits.all():
            place = tuple(int(i) for i in np.argwhere(~fits)[0])
            expected = f"logs of at most {_MAX_LOG:g} in size"
            hint = "give -inf for what lies outside the gate" if name == "log_weights" else ""
            raise ParameterError(name, expected, f"{logs[place]} at index {place}", hint)
    try:
        marginals, log_total, best, bound, n_states = _engine.joint_marginals(
            weights, miss, int(max_states)
        )
    except _engine.FrontierLimit as error:
        raise SolverLimit(
            "tracks and detections that compete at once", max(weights.shape), 1024,
            "gate more narrowly",
        ) from error  # fmt: skip
    return JointMarginals(
        marginals=marginals,
        log_total=log_total,
        best=best.astype(np.int64),
        method="beam" if bound > 0 else "exact",
        bound=bound,
        n_states=n_states,
    )
