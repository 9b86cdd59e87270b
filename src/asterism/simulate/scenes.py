"""Registry of scenes: ground truth in which every marker is detected in every frame.

A scene is a function with keyword-only arguments, among them `frames`, `rate` and `seed`, that
returns a `Truth`. `asterism.simulate.corrupt` adds noise, missed detections and clutter;
`asterism.simulate.film` projects the scene into cameras.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import ParameterError
from asterism.model import Capture, Tracks
from asterism.records import Registry, record
from asterism.simulate.lissajous import dense, smooth
from asterism.simulate.people.hand import fingers
from asterism.simulate.people.juggler import juggler
from asterism.simulate.people.pair import two_people
from asterism.simulate.people.person import person
from asterism.simulate.points import attracted, crossing, cube, walk, wander
from asterism.simulate.swarm import swarm
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["SCENES", "Scene", "from_capture"]


@record(kw_only=False)
class Scene:
    """Entry of the registry `SCENES`.

    Attributes
    ----------
    make : callable
        Function that returns the truth, with the arguments `frames`, `rate` and `seed` and others.
    about : str
        Description in one line.

    Examples
    --------
    >>> import asterism as am
    >>> scene = am.simulate.SCENES["cube"]
    >>> scene.about
    '8 markers on a cube that rotates and travels'
    >>> scene.make(frames=10, seed=1).n_tracks
    8
    """

    make: Callable[..., Truth]
    about: str


SCENES: dict[str, Scene] = Registry(
    {
        "cube": Scene(cube, "8 markers on a cube that rotates and travels"),
        "crossing": Scene(crossing, "16 markers: a rotating cube flies through a stationary one"),
        "wander": Scene(wander, "markers that continually change speed and direction"),
        "walk": Scene(walk, "markers on a random walk, without a velocity to predict from"),
        "attracted": Scene(attracted, "8 markers on a random walk that crowd about the origin"),
        "smooth": Scene(smooth, "any number of markers on smooth paths, at constant density"),
        "dense": Scene(dense, "any number of fast markers on smooth paths that cross"),
        "swarm": Scene(swarm, "drones that spread out, gather and change places"),
        "person": Scene(person, "a person who walks, runs, jumps or turns, with occluding limbs"),
        "two_people": Scene(two_people, "two people who pass each other closely, or hug"),
        "fingers": Scene(fingers, "a hand with bending fingers"),
        "juggler": Scene(juggler, "a person who juggles balls"),
    }
)
"""Every scene by name."""


def from_capture(capture: Capture | Tracks) -> Truth:
    """Make a scene from a labelled capture, with its named markers where they were detected.

    Parameters
    ----------
    capture : Capture or Tracks
        Capture from a file, or its tracks. If any track has a name, only named tracks are used.

    Returns
    -------
    Truth
        Truth without clutter, and without unnamed tracks if there are named ones.

    Raises
    ------
    ParameterError
        If the capture has no tracks.

    Examples
    --------
    >>> import asterism as am
    >>> tracks = am.Tracks.from_dense([0, 0.01], [[[0, 0, 1]], [[0, 0, 2]]], ["LKNE"])
    >>> am.simulate.from_capture(tracks).names
    ('LKNE',)
    """
    tracks = capture.tracks if isinstance(capture, Capture) else capture
    if not tracks.n_tracks:
        raise ParameterError("capture", "a labelled capture", "one without tracks")
    named = np.array([name is not None for name in tracks.names])
    if not named.any():
        named[:] = True
    chosen = np.flatnonzero(named)
    positions = tracks.positions()[:, chosen]
    positions.flags.writeable = False
    names = [tracks.names[k] or f"T{k:03d}" for k in chosen]
    return Truth.of(tracks.detections.times, positions, names)
