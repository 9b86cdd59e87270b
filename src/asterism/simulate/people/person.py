"""A scene with one person."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_fields, check_number
from asterism.simulate.clock import clock
from asterism.simulate.people.activities import run, turn, walk
from asterism.simulate.people.gait import Style
from asterism.simulate.people.jump import jump
from asterism.simulate.people.marker_set import FEWEST, MOST, MarkerSet, lines_between
from asterism.simulate.people.skeleton import Body
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.simulate.people.curves import Array
    from asterism.simulate.people.skeleton import Pose

__all__ = ["ACTIVITIES", "check_person", "person"]

ACTIVITIES: dict[str, Callable[[Array, Body, Style, np.random.Generator], Pose]] = {
    "walk": walk,
    "run": run,
    "jump": jump,
    "turn": turn,
}
"""What a person can do."""


def person(
    *,
    activity: str = "walk",
    frames: int = 300,
    rate: float = 100.0,
    seed: int = 0,
    n_markers: int = 53,
    height: float = 1.75,
) -> Truth:
    """Make one person with markers on the body, who walks, runs, jumps or turns round.

    The limbs are capsules that hide markers. Markers are fixed to the skin, 2 mm above it, and
    never inside another part of the body. Feet on the ground do not slide. Walkers and runners go
    straight through the origin at half time; `turn` walks on a circle, turns round at half time
    and walks back; `jump` jumps once in every three seconds, on the spot.

    Parameters
    ----------
    activity : str
        ``walk``, ``run``, ``jump`` or ``turn``.
    frames : int
        Number of frames.
    rate : float
        Frames a second.
    seed : int
        Chooses the person's style, the phase of the gait and the direction.
    n_markers : int
        40 to 90. A smaller set is the beginning of a larger.
    height : float
        Of the person, metres, 1.2 to 2.2.

    Returns
    -------
    Truth
        Metres, z up, the ground at 0. Colour 1 is left, 2 right, 3 the middle.

    Raises
    ------
    ParameterError
        If a number is out of range or the activity unknown.

    Examples
    --------
    >>> person(activity="run", frames=10).names[:3]
    ('LFHD', 'RFHD', 'LBHD')
    """
    t = clock(frames, rate, seed)
    check_person(n_markers, height=height)
    check_fields("activity", [activity], ACTIVITIES)
    rng = np.random.default_rng(seed)
    body = Body(height=float(height))
    pose = ACTIVITIES[activity](t, body, Style.drawn(rng), rng)
    markers = MarkerSet(body=body, n_markers=int(n_markers))
    return Truth.of(
        t,
        markers.at(pose),
        markers.names,
        lines=lines_between(markers.names),
        colours=markers.colours,
        surfaces=body.capsules(pose),
    )


def check_person(n_markers: int, **heights: float) -> None:
    """Raise a ParameterError if nobody has that number of markers or that height."""
    check_number("n_markers", n_markers, above=FEWEST, below=MOST, closed=True, integer=True)
    for name, height in heights.items():
        check_number(name, height, above=1.2, below=2.2, closed=True)
