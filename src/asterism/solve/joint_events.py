"""Joint association events: who has which detection, over all the ways of sharing them out.

This is the sum at the heart of joint probabilistic data association. Gating and densities are the
caller's; so is what to do with the marginals.
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

_LARGEST_LOG = 1e100
_MOST_STATES = 2**30


@record(eq=False)
class JointMarginals:
    """What `joint_marginals` found.

    Attributes
    ----------
    marginals : ndarray, shape (n, m + 1)
        ``marginals[i, j]`` is the probability that track i has detection j, ``marginals[i, -1]``
        that it has none. Rows sum to 1, the columns of detections to at most 1.
    log_total : float
        Log of the weight of all joint events that were summed. With a beam it is too small by at
        most ``-log(1 - bound)``.
    best : ndarray of int, shape (n,)
        Detection of each track in the heaviest joint event, -1 for a miss; one of them where
        several weigh the same. Exact, also with a beam.
    method : {"exact", "beam"}
        Whether every joint event was summed.
    bound : float
        The distribution over joint events that the marginals belong to differs from the true one
        by at most this in total variation, and so does every marginal; 0 when exact. It is 1,
        and the marginals those of `best` alone, where the range of doubles does not do, which
        takes a group of hundreds of tracks.
    n_states : int
        Most states that were held after a step.
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
    """Sum over all joint events of n tracks and m detections.

    A joint event gives every track one detection or a miss, ``θ_i ∈ {1..m, 0}``, and no detection
    to two tracks. It has the probability

    ``P(θ) = Π_i w_{i θ_i} / Σ_θ' Π_i w_{i θ'_i}``

    and wanted are the marginals ``β_ij = P(θ_i = j)``. In joint probabilistic data association [1]_
    ``w_ij = N(y_j; ŷ_i, S_i) P_d / λ_f`` within the gate and ``w_i0 = 1 - P_d``.

    Tracks that share no detection, directly or through others, are summed apart. In each group
    tracks and detections are summed out one after the other, forward and backward, over the sets
    that may be used of the *frontier*: those left that have a neighbour already gone. A group of n
    tracks that all want the same m detections takes ``2^min(n, m)`` states, a chain of any length
    two. Efficient hypothesis management [2]_ is another way to share work between events.

    A group whose frontier exceeds `max_states` is summed over a *beam*, the states that can weigh
    most. The mass F(s) of each state dropped, times a bound U(s) of what could follow it, adds to
    a bound D of the missing weight; with Z the weight that was summed, the total variation between
    the distribution returned and the true one is at most ``D / (Z + D)``, and over groups
    ``1 - Π (1 - D / (Z + D))``.

    Parameters
    ----------
    log_weights : array_like, shape (n, m)
        ``log w_ij``; -inf where track i cannot have detection j.
    log_miss : array_like, shape (n,)
        ``log w_i0``, finite.
    max_states : int
        Most states of a layer, 1 to 2^30. An exact sum of 2^20 states takes about 90 MB for 20
        tracks, a beam of as many about 110 MB for 60; both grow with the square root of the
        number of tracks in the group.

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
    .. [1] Y. Bar-Shalom, X.-R. Li: Multitarget-Multisensor Tracking: Principles and Techniques.
       YBS, 1995.
    .. [2] P. Horridge, S. Maskell: Real-time tracking of hundreds of targets with efficient exact
       JPDAF implementation. FUSION, 2006.

    Examples
    --------
    Two tracks want one detection; the first weighs it twice as much as the second does.

    >>> found = joint_marginals(np.log([[2.0], [1.0]]), [0.0, 0.0])
    >>> found.marginals
    array([[0.5 , 0.5 ],
           [0.25, 0.75]])
    >>> found.best
    array([ 0, -1])
    """
    check_number("max_states", max_states, above=1, below=_MOST_STATES, closed=True, integer=True)
    miss = check_array("log_miss", log_miss, ("n",))
    weights = check_array("log_weights", log_weights, (len(miss), "m"), finite=False)
    for name, logs in (("log_weights", weights), ("log_miss", miss)):
        # False for NaN too. Beyond this sums of logs could leave the doubles.
        fits = (np.abs(logs) <= _LARGEST_LOG) | (np.isneginf(logs) & (name == "log_weights"))
        if not fits.all():
            place = tuple(int(i) for i in np.argwhere(~fits)[0])
            expected = f"logs of at most {_LARGEST_LOG:g} in size"
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
