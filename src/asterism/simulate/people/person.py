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
"""Activities of a person by name."""


def person(
    *,
    activity: str = "walk",
    frames: int = 300,
    rate: float = 100.0,
    seed: int = 0,
    n_markers: int = 53,
    height: float = 1.75,
) -> Truth:
    """Simulate one person with markers on the body, who walks, runs, jumps or turns round.

    The limbs are capsules that occlude markers. Markers are fixed 2 mm above the skin, and are
    never inside another part of the body. Feet on the ground do not slide. "walk" and "run" lead
    straight through the origin at half time. "turn" walks on a circle, turns round at half time and
    walks back. "jump" jumps on the spot, once every three seconds.

    Parameters
    ----------
    activity : {"walk", "run", "jump", "turn"}
        Motion of the person.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed of the person's style, the phase of the gait and the direction.
    n_markers : int
        Number of markers, 40 to 90; the default is a common full-body set. A smaller set is the
        beginning of a larger one.
    height : float
        Height of the person, metres, 1.2 to 2.2.

    Returns
    -------
    Truth
        Markers in metres, z up, with the ground at 0. Colour 1 is left, 2 right, 3 the middle.

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
    """Raise `ParameterError` if a number of markers or a height is out of range.

    Parameters
    ----------
    n_markers : int
        Number of markers, 40 to 90.
    **heights : float
        Heights by the names of their arguments, metres, 1.2 to 2.2.

    Examples
    --------
    >>> check_person(53, height=0.5)
    Traceback (most recent call last):
    ...
    asterism.errors.ParameterError: height: expected a number in [1.2, 2.2], found 0.5
    """
    check_number("n_markers", n_markers, above=FEWEST, below=MOST, closed=True, integer=True)
    for name, height in heights.items():
        check_number(name, height, above=1.2, below=2.2, closed=True)
