"""The one list of scenes: truth in motion, in which every marker is seen in every frame.

A scene is a function of keyword-only arguments, among them `frames`, `rate` and `seed`, that gives
a `Truth`. Noise, misses and clutter come afterwards, from `asterism.simulate.corrupt`; cameras from
`asterism.simulate.film`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model import Capture, Tracks
from asterism.records import Registry, record
from asterism.simulate.people.hand import fingers
from asterism.simulate.people.juggler import juggler
from asterism.simulate.people.pair import two_people
from asterism.simulate.people.person import person
from asterism.simulate.points import attracted, crossing, cube, smooth, walk, wander
from asterism.simulate.swarm import swarm
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["SCENES", "Scene", "from_capture"]


@record(kw_only=False)
class Scene:
    """A scene as a list shows it.

    Attributes
    ----------
    make : callable
        Gives the truth; takes `frames`, `rate`, `seed` and what its docstring says.
    about : str
        One line on what is in it.
    """

    make: Callable[..., Truth]
    about: str


SCENES: dict[str, Scene] = Registry(
    {
        "cube": Scene(cube, "8 markers on a cube that turns and travels"),
        "crossing": Scene(crossing, "16 markers: a turning cube flies through a still one"),
        "wander": Scene(wander, "markers that change speed and direction all the time"),
        "walk": Scene(walk, "markers that walk at random, with no velocity to predict from"),
        "attracted": Scene(attracted, "8 markers that walk at random and crowd about the origin"),
        "smooth": Scene(smooth, "any number of markers on smooth paths, at constant density"),
        "swarm": Scene(swarm, "drones that spread out, bunch up and change places"),
        "person": Scene(person, "a person who walks, runs, jumps or turns, with limbs that hide"),
        "two_people": Scene(two_people, "two people who pass each other closely, or hug"),
        "fingers": Scene(fingers, "a hand whose fingers bend and open"),
        "juggler": Scene(juggler, "a person who juggles balls"),
    }
)
"""Every scene by name."""


def from_capture(capture: Capture | Tracks) -> Truth:
    """Make a scene of a labelled capture: its named markers, where they were seen.

    Parameters
    ----------
    capture : Capture or Tracks
        From a file, or its tracks. If any track has a name, the named ones are the markers.

    Returns
    -------
    Truth
        Without clutter and without tracks that have no name among named ones.

    Raises
    ------
    ParameterError
        If nothing is labelled.
    """
    tracks = capture.tracks if isinstance(capture, Capture) else capture
    if not tracks.n_tracks:
        raise ParameterError("capture", "a labelled one", "one without tracks")
    named = np.array([name is not None for name in tracks.names])
    if not named.any():
        named[:] = True
    chosen = np.flatnonzero(named)
    positions = tracks.positions()[:, chosen]
    positions.flags.writeable = False
    names = [tracks.names[k] or f"T{k:03d}" for k in chosen]
    return Truth.of(tracks.detections.times, positions, names)
