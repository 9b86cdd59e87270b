"""Walking, running and turning round: the pose in every frame of a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.simulate.people.course import Course
from asterism.simulate.people.gait import (
    Carriage,
    Style,
    bounce,
    running,
    upright,
    walking,
)
from asterism.simulate.people.steps import (
    Feet,
    Gait,
    carried,
    feet_on,
    reached,
    swings_of,
)

if TYPE_CHECKING:
    from asterism.simulate.people.curves import Array
    from asterism.simulate.people.skeleton import Body, Pose

__all__ = ["Walker", "run", "turn", "walk"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Walker:
    """Person who follows a course.

    Parameters
    ----------
    body : Body
        Body of the person.
    style, gait
        Motion of the person.
    course : Course
        Position and heading over time.
    swings : dict of ndarray of shape (n, 2)
        Start and end of each swing, by side, seconds.
    is_run : bool
        Whether both feet leave the ground between steps.
    """

    body: Body
    style: Style
    gait: Gait
    course: Course
    swings: dict[str, Array]
    is_run: bool = False

    def carriage(self, t: Array) -> Carriage:
        """Return pelvis, trunk, head and arms.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        Carriage
        """
        phase = t * self.gait.cadence + self.style.phase
        heading, vigour = self.course.heading(t), self.course.vigour(t)
        return upright(phase, heading, vigour, self.style, is_run=self.is_run)

    def feet(self, t: Array) -> Feet:
        """Return positions and orientations of the feet.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        Feet
        """
        return feet_on(t, self.body, self.course, self.gait, self.swings)

    def root(self, t: Array, carriage: Carriage) -> Array:
        """Return the middle of the hip joints.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.
        carriage : Carriage
            Upper body at these times.

        Returns
        -------
        ndarray of shape (T, 3)
            World metres.
        """
        root = self._flat(t, carriage)
        highest = reached(self.course, self.body, self._hips, self.feet)
        if not self.is_run:
            root[:, 2] = carried(t, self.course, highest)
            return root
        grid = self.course.times
        is_in = (grid > -0.1) & (grid < self.course.duration + 0.1)
        room = highest - self._bounce(grid)
        root[:, 2] = self._bounce(t) + room[is_in].min() - 0.004 * self.body.height
        return root

    def pose(self, t: Array) -> Pose:
        """Return the pose of the whole body.

        Parameters
        ----------
        t : ndarray of shape (T,)
            Times, seconds.

        Returns
        -------
        Pose
        """
        c, feet = self.carriage(t), self.feet(t)
        return self.body.pose(
            root=self.root(t, c), pelvis=c.pelvis, trunk=c.trunk, head=c.head,
            ankles=feet.ankles, feet=feet.turns, arms=c.arms,
        )  # fmt: skip

    def _bounce(self, t: Array) -> Array:
        return bounce(t * self.gait.cadence + self.style.phase, self.gait)

    def _flat(self, t: Array, carriage: Carriage) -> Array:
        heading = self.course.heading(t)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=-1)
        ground = self.course.place(t) + carriage.sway[:, None] * left
        return np.column_stack([ground, np.zeros(len(t))])

    def _hips(self, t: Array) -> dict[str, Array]:
        carriage = self.carriage(t)
        return self.body.hips(self._flat(t, carriage), carriage.pelvis)


def walk(t: Array, body: Body, style: Style, rng: np.random.Generator) -> Pose:
    """Walk straight on, through the origin at half time.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds.
    body : Body
        Body of the person.
    style : Style
        Individual variation.
    rng : Generator
        Generator of random numbers.

    Returns
    -------
    Pose

    Examples
    --------
    >>> from asterism.simulate.people.gait import Style
    >>> from asterism.simulate.people.skeleton import Body
    >>> rng = np.random.default_rng(1)
    >>> pose = walk(np.linspace(0, 1, 5), Body(height=1.75), Style.drawn(rng), rng)
    >>> pose.origins["pelvis"].shape
    (5, 3)
    """
    return _straight(t, body, style, rng, is_run=False)


def run(t: Array, body: Body, style: Style, rng: np.random.Generator) -> Pose:
    """Run straight on, through the origin at half time.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds.
    body : Body
        Body of the person.
    style : Style
        Individual variation.
    rng : Generator
        Generator of random numbers.

    Returns
    -------
    Pose

    Examples
    --------
    >>> from asterism.simulate.people.gait import Style
    >>> from asterism.simulate.people.skeleton import Body
    >>> rng = np.random.default_rng(1)
    >>> pose = run(np.linspace(0, 1, 5), Body(height=1.75), Style.drawn(rng), rng)
    >>> pose.origins["pelvis"].shape
    (5, 3)
    """
    return _straight(t, body, style, rng, is_run=True)


def _straight(
    t: Array, body: Body, style: Style, rng: np.random.Generator, *, is_run: bool
) -> Pose:
    gait = (running if is_run else walking)(body.height, style)
    direction = rng.uniform(-np.pi, np.pi)
    course = Course(
        duration=float(t[-1]),
        speed=lambda x: np.full(x.shape, gait.speed),
        heading=lambda x: np.full(x.shape, direction),
        usual=gait.speed,
    )
    swings = swings_of(course, gait, style.phase)
    walker = Walker(body=body, style=style, gait=gait, course=course, swings=swings, is_run=is_run)
    return walker.pose(t)


def turn(t: Array, body: Body, style: Style, rng: np.random.Generator) -> Pose:
    """Walk on a circle, turn round at half time, and walk back on a circle.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds.
    body : Body
        Body of the person.
    style : Style
        Individual variation.
    rng : Generator
        Generator of random numbers.

    Returns
    -------
    Pose

    Examples
    --------
    >>> from asterism.simulate.people.gait import Style
    >>> from asterism.simulate.people.skeleton import Body
    >>> rng = np.random.default_rng(1)
    >>> pose = turn(np.linspace(0, 1, 5), Body(height=1.75), Style.drawn(rng), rng)
    >>> pose.origins["pelvis"].shape
    (5, 3)
    """
    gait = walking(body.height, style)
    usual = gait.speed
    direction, side = rng.uniform(-np.pi, np.pi), rng.choice([-1.0, 1.0])
    duration, radius = float(t[-1]), rng.uniform(1.8, 2.4)
    about = 1.7 * np.sqrt(body.height / 1.75)  # longer legs take longer steps
    bend = side * 0.8 * usual / radius

    def passage(x: Array) -> Array:  # from -1 to 1 over the turn, with constant rate in its middle
        s = np.clip((x - duration / 2) / about, -1, 1)
        return s * (15 - 10 * s**2 + 3 * s**4) / 8

    def speed(x: Array) -> Array:
        s = np.clip(np.abs(x - duration / 2) / about, 0, 1)
        return usual * (0.35 + 0.50 * s**3 * (10 - 15 * s + 6 * s**2))

    def heading(x: Array) -> Array:
        return direction + bend * (x - duration / 2) + side * np.pi / 2 * passage(x)

    course = Course(duration=duration, speed=speed, heading=heading, usual=usual)
    swings = swings_of(course, gait, style.phase)
    walker = Walker(body=body, style=style, gait=gait, course=course, swings=swings)
    return walker.pose(t)
