"""A method that continues its tracks when model or method is replaced during a stream."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from asterism.records import record
from asterism.tracking.methods import Method, TrackStates, Update

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from asterism.model import TrackingModel
    from asterism.tracking.methods.base import MethodState

__all__ = ["Switchable", "SwitchableState", "ids_by_votes"]


@record(eq=False)
class SwitchableState:
    """State of the method in use, and the identity of each of its labels.

    Parameters
    ----------
    inner : MethodState
        State of the method.
    ids : ndarray of int, optional
        Identity of each label so far; None while labels are identities, before a replacement.
    next_id : int
        Identity of the next track.
    n_before : int
        Detections that earlier methods took and the present one did not.
    """

    inner: MethodState
    ids: NDArray[np.int64] | None = None
    next_id: int = 0
    n_before: int = 0

    @property
    def n_seen(self) -> int:
        """Number of detections processed so far."""
        return self.n_before + self.inner.n_seen

    @property
    def info(self) -> dict[str, float]:
        """Counts of the method in use."""
        return dict(self.inner.info)


@record
class Switchable(Method[SwitchableState]):
    """Method whose labels are identities that outlast a replacement of its state.

    Parameters
    ----------
    method : Method
        Method that tracks.
    """

    name: ClassVar[str] = "switchable"

    method: Method[Any]

    def init(
        self, model: TrackingModel, *, n_axes: int = 3, seed: int | None = None
    ) -> SwitchableState:
        """Return the state before the first frame; see `Method.init`."""
        inner = self.method.init(model, n_axes=n_axes, seed=seed)
        return SwitchableState(inner=inner)

    def step(
        self,
        state: SwitchableState,
        time: float,
        points: ArrayLike,
        *,
        covariances: ArrayLike | None = None,
    ) -> tuple[SwitchableState, Update]:
        """Process the next frame; see `Method.step`."""
        inner, found = self.method.step(state.inner, time, points, covariances=covariances)
        ids, next_id = state.ids, state.next_id
        highest = max(found.labels.tolist(), default=-1)  # faster than by NumPy
        if len(found.revised_labels):
            highest = max(highest, int(found.revised_labels.max()))
        if ids is None:
            next_id = max(next_id, highest + 1)
            after = SwitchableState(inner=inner, ids=None, next_id=next_id, n_before=state.n_before)
            return after, found
        if highest >= len(ids):
            n_new = highest + 1 - len(ids)
            ids = np.concatenate([ids, np.arange(next_id, next_id + n_new)])
            next_id += n_new
        after = replace(state, inner=inner, ids=ids, next_id=next_id)
        return after, replace(
            found,
            labels=_mapped(found.labels, ids),
            revised=found.revised + state.n_before,
            revised_labels=_mapped(found.revised_labels, ids),
            read_tracks=partial(_tracks_of, found, ids),
        )

    def prepare(self, state: SwitchableState) -> None:
        """Prepare the next step of the method; see `Method.prepare`."""
        self.method.prepare(state.inner)


def _mapped(labels: NDArray[np.int64], ids: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.where(labels >= 0, ids[labels], -1) if len(ids) else labels


def _tracks_of(found: Update, ids: NDArray[np.int64]) -> TrackStates | None:
    tracks = found.tracks
    if tracks is None:
        return None
    known = tracks.ids < len(ids)
    if known.all():
        return replace(tracks, ids=_mapped(tracks.ids, ids))
    return TrackStates(
        ids=ids[tracks.ids[known]], means=tracks.means[known],
        covariances=tracks.covariances[known], gaps=tracks.gaps[known],
        log_odds=None if tracks.log_odds is None else tracks.log_odds[known],
    )  # fmt: skip


def ids_by_votes(
    labels: NDArray[np.int64], old: NDArray[np.int64], next_id: int
) -> tuple[NDArray[np.int64], int]:
    """Return the identity of each label of a new method, by detections that both have labelled.

    Parameters
    ----------
    labels : ndarray of int, shape (N,)
        Labels by the new method, -1 for none.
    old : ndarray of int, shape (N,)
        Identities of the same detections, -1 for none.
    next_id : int
        Identity of the next new track.

    Returns
    -------
    ids, next_id
        Identity of each label, shape (largest label + 1,). Labels and identities with the most
        common detections are paired first; what is left over gets new identities.

    Examples
    --------
    >>> labels, old = np.array([0, 0, 1, 1, 2]), np.array([5, 5, 5, 7, -1])
    >>> ids_by_votes(labels, old, 9)
    (array([5, 7, 9]), 10)
    """
    n = int(labels.max(initial=-1)) + 1
    ids = np.full(n, -1, dtype=np.int64)
    both = (labels >= 0) & (old >= 0)
    if both.any():
        pairs, votes = np.unique(np.stack([labels[both], old[both]]), axis=1, return_counts=True)
        taken: set[int] = set()
        for i in np.argsort(-votes, kind="stable"):
            label, identity = int(pairs[0, i]), int(pairs[1, i])
            if ids[label] < 0 and identity not in taken:
                ids[label] = identity
                taken.add(identity)
    free = ids < 0
    ids[free] = np.arange(next_id, next_id + int(free.sum()))
    return ids, next_id + int(free.sum())
