"""Which method a clip needs, told from the clip.

GNN goes over it once, which takes a fraction of any other method's time. Its tracks show whether
markers sit on bodies, the number of detections within their gates how often it had to choose. The
rules are few and their thresholds wide apart; what each is worth is measured in the docs
(`Which method when`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_kind
from asterism.model import Detections, RandomWalk, TrackingModel, Tracks
from asterism.records import record
from asterism.tracking.methods.gnn import GNN
from asterism.tracking.methods.mcmcda import MCMCDA
from asterism.tracking.methods.smp import SMP
from asterism.tracking.rigidity.distances import MIN_TOGETHER, distances_from

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.tracking.methods.base import Method

__all__ = ["AUTO", "Choice", "choose_method"]

AUTO = "auto"
"""The name, on the command line, of the method that the clip chooses."""

SAMPLES = 200
"""Frames, spread over the clip, in which distances are compared."""
MOST_TRACKS = 150
"""Tracks, the longest, that are compared."""
RIGID = 0.05
"""Greatest spread of a bond on a rigid segment, as a share of the spread of its markers' positions.
Markers at rest keep their distances too, and so do all markers in a fraction of a second."""
NEAREST = 6
"""Partners are looked for among so many that were nearest: of a thousand independent markers over a
few frames some pair always keeps its distance."""
ON_BODIES = 0.2
"""Share of tracks with such a partner from which on the clip is one of bodies: wrong tracks, which
bursts make, have none."""
CLEAR = 0.01
"""Detections in a gate beside the right one, for each link, up to which nothing is in doubt."""


@record
class Choice:
    """The method for a clip, and why.

    Parameters
    ----------
    method : Method
        With all its options.
    stitch : bool
        Whether its tracks are to be made into markers, as `identify` does.
    reason : str
        What was measured and what follows, one line.
    """

    method: Method[Any]
    stitch: bool
    reason: str


def choose_method(
    detections: Detections, model: TrackingModel, *, has_start: bool = False
) -> Choice:
    """Choose a method by the clip.

    - Tracks to begin with are for `MCMCDA`, which alone repairs them.
    - Where markers keep their distance to another, they sit on bodies: `SMP` over three frames,
      stitched, for a hidden marker comes back where its neighbours carry it.
    - Markers that walk at random, or that come into each other's gates: `MCMCDA`.
    - Anything else is clear: `GNN`.

    Parameters
    ----------
    detections : Detections
        The clip.
    model : TrackingModel
        Its model.
    has_start : bool
        Whether there are tracks to begin with.

    Returns
    -------
    Choice
        The same for the same clip and model: nothing is drawn.

    Raises
    ------
    ParameterError
        If an argument has the wrong type.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.person(seed=1)
    >>> model = am.estimate_model(truth.detections).model
    >>> choice = am.tracking.choose_method(truth.detections, model)
    >>> choice.method.name, choice.stitch
    ('smp', True)
    """
    check_kind("detections", detections, Detections)
    check_kind("model", model, TrackingModel, "am.estimate_model(detections).model")
    if has_start:
        return Choice(method=MCMCDA(), stitch=False, reason="there are tracks to begin with")
    detections = detections.measured()
    method = GNN()
    state, labels, _ = method.run(method.init(model, n_axes=detections.n_axes), detections)
    tracks = Tracks(detections=detections, labels=labels)
    n_rigid, n_compared = partners(tracks, model.sensor.noise_sigma)
    if n_compared and n_rigid >= ON_BODIES * n_compared:
        reason = f"{n_rigid} of {n_compared} markers keep their distance to another: bodies"
        return Choice(method=SMP(window=3), stitch=True, reason=reason)
    if any(isinstance(mode, RandomWalk) for mode in model.motion.modes):
        return Choice(method=MCMCDA(), stitch=False, reason="markers walk at random, no bodies")
    # Of links, not of detections: the first of a track is in no gate, and short clips are full of
    # first ones.
    n_links = int(tracks.lengths.sum()) - tracks.n_tracks
    rivals = max(state.info["candidates"] / max(n_links, 1) - 1, 0.0)
    doubt = f"{100 * rivals:.1f} rivals within the gates for 100 links, no bodies"
    if rivals > CLEAR:
        return Choice(method=MCMCDA(), stitch=False, reason=doubt)
    return Choice(method=method, stitch=False, reason=doubt)


def partners(tracks: Tracks, noise_sigma: float) -> tuple[int, int]:
    """Count the tracks that keep their distance to a neighbour, and those that can be compared.

    Parameters
    ----------
    tracks : Tracks
        The tracks; the longest `MOST_TRACKS` are compared, in `SAMPLES` frames.
    noise_sigma : float
        Standard deviation of a coordinate, metres: so much no distance can tell.

    Returns
    -------
    n_rigid, n_compared : int
    """
    positions = _sampled(tracks)
    n_rigid = n_compared = 0
    for i in range(positions.shape[1]):
        found = distances_from(positions[:, i], positions)
        others = np.flatnonzero(found.n_frames >= MIN_TOGETHER)
        others = others[others != i]
        if not len(others):
            continue
        n_compared += 1
        nearest = others[np.argsort(found.middle[others], kind="stable")[:NEAREST]]
        moved = np.sqrt(np.nanvar(positions[:, i], axis=0).sum())
        is_rigid = found.is_bond & (found.spread < max(RIGID * moved, 3 * noise_sigma))
        n_rigid += bool(is_rigid[nearest].any())
    return n_rigid, n_compared


def _sampled(tracks: Tracks) -> NDArray[np.float64]:
    """Positions of the longest tracks in frames spread over the clip, (S, K, D)."""
    d = tracks.detections
    frames = np.unique(np.linspace(0, d.n_frames - 1, SAMPLES).astype(np.int64))
    longest = np.argsort(-tracks.lengths, kind="stable")[:MOST_TRACKS]
    row = np.full(d.n_frames, -1)
    row[frames] = np.arange(len(frames))
    column = np.full(tracks.n_tracks + 1, -1)  # the last is clutter's
    column[longest] = np.arange(len(longest))
    i, j = row[d.frame_of], column[tracks.labels]
    is_in = (i >= 0) & (j >= 0)
    sampled = np.full((len(frames), len(longest), d.n_axes), np.nan)
    sampled[i[is_in], j[is_in]] = d.points[is_in]
    return sampled
