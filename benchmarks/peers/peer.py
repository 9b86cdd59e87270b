"""What a peer is to the benchmark: a name, what may be searched, and a way to label detections.

Every peer gets the clip in frames (one unit of time each) and in its own length: all lengths of a
setting are shares of `length_of` the clip. So one setting can serve clips of one kind that differ
in speed, for the sake of the peers: ours know nothing of it.
"""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial import KDTree

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    import asterism as am

__all__ = ["Peer", "Setting", "drop_short", "in_frames", "length_of", "module"]

Setting = dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Peer:
    """A tracker beside ours.

    Parameters
    ----------
    name : str
        As in the table.
    package : str
        What must be installed, by its name in `benchmarks`' extra; "" where nothing need be.
    space : mapping
        Least and greatest value of each parameter, drawn evenly in their logarithm; whole numbers
        where both ends are.
    label : callable
        Gives the label of every detection, -1 for none, from the clip and a setting.
    like : Peer, optional
        Another with the same kind of motion: the search begins with what was found for it, which
        is the best chance of those that are too slow for many trials.
    """

    name: str
    package: str
    space: Mapping[str, tuple[float, float]]
    label: Callable[[am.Detections, Setting], NDArray[np.int64]]
    like: Peer | None = None

    def near(self, setting: Setting) -> Setting:
        """Give the middle, with what another peer's setting says of the same parameters."""
        found = self.middle()
        for name, (low, high) in self.space.items():
            if name in setting:
                value = min(max(setting[name], low), high)
                is_whole = isinstance(low, int) and isinstance(high, int)
                found[name] = round(value) if is_whole else float(value)
        return found

    def draw(self, rng: np.random.Generator) -> Setting:
        """Draw a setting."""
        setting: Setting = {}
        for name, (low, high) in self.space.items():
            value = float(np.exp(rng.uniform(np.log(low), np.log(high))))
            is_whole = isinstance(low, int) and isinstance(high, int)
            setting[name] = round(value) if is_whole else value
        return setting

    def middle(self) -> Setting:
        """Give the middle of the space: the first trial of every search."""
        ends = self.space.items()
        value = {name: float(np.sqrt(low * high)) for name, (low, high) in ends}
        return {
            name: round(value[name]) if isinstance(low, int) and isinstance(high, int)
            else value[name]
            for name, (low, high) in ends
        }  # fmt: skip


def module(name: str) -> Any:
    """Give a module of a peer, which has no types and need not be there."""
    return import_module(name)


def in_frames(detections: am.Detections) -> am.Detections:
    """Give the same points, a unit of time for a frame."""
    return dataclasses.replace(detections, times=np.arange(detections.n_frames, dtype=float))


def length_of(detections: am.Detections) -> float:
    """Return the upper quartile of the distance to the nearest point of the next frame, metres.

    Over all captures and conditions, the longest steps are 1.2 to 6 times this value (99 of 100,
    one capture at rest left out). They are 1.7 to 9.5 times the median, because half the markers
    may rest, and the ninetieth percentile is that of clutter if there is any. The value is at
    least a millimetre, so that a tracker also searches around markers that rest.
    """
    frames = [points for _, points in detections if len(points)]
    apart = [KDTree(b).query(a)[0] for a, b in itertools.pairwise(frames)]
    return max(float(np.quantile(np.concatenate(apart), 0.75)), 1e-3) if apart else 1.0


def drop_short(labels: NDArray[np.int64], least: float) -> NDArray[np.int64]:
    """Make clutter of tracks with fewer detections than `least`."""
    counts = np.bincount(labels + 1, minlength=1)
    counts[0] = 0
    return np.where(counts[labels + 1] >= least, labels, -1)
