"""Steps of a person: feet that do not slide, and the height of the hips above them.

A `Course` is the position of a person over time, a `Gait` the manner of walking. Each foot is
placed where the pelvis passes over it, rolls over its heel and its ball without sliding, and swings
to the next position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.simulate.people.course import STEP
from asterism.simulate.people.curves import about_y, about_z, through
from asterism.simulate.people.skeleton import FLESH, LENGTHS, SIDES

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from asterism.simulate.people.course import Course
    from asterism.simulate.people.curves import Array, Knot
    from asterism.simulate.people.skeleton import Body

__all__ = [
    "REACH",
    "Feet",
    "Gait",
    "carried",
    "feet_on",
    "reached",
    "rolled",
    "swings_of",
]

REACH = 0.994  # share of the length of a leg that it stretches to: the knee keeps 13°
_HEEL, _BALL = (np.array(end)[[0, 2]] for end in FLESH["foot"][0][:2])


@dataclass(frozen=True, kw_only=True)
class Gait:
    """Manner of walking or running.

    Parameters
    ----------
    cadence : float
        Cycles (two steps) a second.
    stance : float
        Share of the cycle that a foot is on the ground.
    under : float
        Share of the stance after which the ankle is under the hip.
    landing, leaving : (angle, rate)
        Pitch of the foot as it lands and leaves, toes up positive: degrees, degrees a second.
    flat : (float, float)
        Shares of the stance between which the sole lies flat.
    swing : tuple of (share, hip, knee)
        Flexion of the joints at shares of the swing, degrees.
    hips : float
        Usual height of the hips, metres.
    speed : float
        Usual speed, m/s.
    width : float
        Distance between the lines of left and right footprints, metres.
    toe_out : float
        Outward rotation of the feet, degrees.
    """

    cadence: float
    stance: float
    under: float
    landing: tuple[float, float]
    leaving: tuple[float, float]
    flat: tuple[float, float]
    swing: tuple[tuple[float, float, float], ...]
    hips: float
    speed: float
    width: float
    toe_out: float

    def way(self, body: Body) -> Array:
        """Return the path of the ankle during a swing at the usual speed.

        Parameters
        ----------
        body : Body
            Body of the person.

        Returns
        -------
        ndarray of shape (n, 3)
            Share of the swing, share of the distance between the footprints, and height above the
            ground, metres.
        """
        share, hip, knee = np.array(self.swing).T
        hip, shank = np.radians(hip), np.radians(hip - knee)
        thighs, shanks = body["thigh"], body["shank"]
        ahead = thighs * np.sin(hip) + shanks * np.sin(shank)
        down = thighs * np.cos(hip) + shanks * np.cos(shank)
        passed = (
            self.stance * (1 - self.under) + (1 - self.stance) * share
        )  # by the hips, in cycles
        return np.column_stack(
            [share, passed + ahead * self.cadence / self.speed, self.hips - down]
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Feet:
    """Positions and orientations of the feet, by side.

    Attributes
    ----------
    ankles : dict of ndarray of shape (T, 3)
        Ankle joints, world metres.
    turns : dict of ndarray of shape (T, 3, 3)
        Rotations from the foot to the world.
    """

    ankles: dict[str, Array]
    turns: dict[str, Array]


def swings_of(course: Course, gait: Gait, phase: float) -> dict[str, Array]:
    """Return the swings of a steady gait, by side: times of leaving and landing, (n, 2).

    Parameters
    ----------
    course, gait
        Position over time, and manner of walking.
    phase : float
        Phase at time 0, cycles; 0 where the left foot lands.

    Returns
    -------
    dict of ndarray of shape (n, 2)
    """
    span = 1.5 / gait.cadence
    swings = {}
    for side, offset in (("L", 0.0), ("R", 0.5)):
        first, last = ((t * gait.cadence + phase - offset) for t in (-span, course.duration + span))
        landings = (np.arange(np.floor(first), np.ceil(last) + 1) + offset - phase) / gait.cadence
        swings[side] = np.stack([landings - (1 - gait.stance) / gait.cadence, landings], axis=-1)
    return swings


def feet_on(t: Array, body: Body, course: Course, gait: Gait, swings: dict[str, Array]) -> Feet:
    """Move the feet along a course.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds.
    body, course, gait
        Person, position over time, and manner of walking.
    swings : dict of ndarray of shape (n, 2)
        Times at which each foot leaves the ground and lands, ascending; it stands otherwise.

    Returns
    -------
    Feet
    """
    ankles, turns = {}, {}
    for side in SIDES:
        plan = _Plan(body, course, gait, swings[side], SIDES[side])
        pitch, yaw = plan.pitch(t), plan.yaw(t)
        turns[side] = about_z(np.degrees(yaw)) @ about_y(-pitch[:, 0])
        ankles[side] = plan.ankle(t, pitch)
    return Feet(ankles=ankles, turns=turns)


class _Plan:
    """Stances of one foot between its swings, and the resulting motion."""

    def __init__(self, body: Body, course: Course, gait: Gait, swings: Array, sign: float) -> None:
        self.gait, self.height, self.way = gait, body.height, gait.way(body)
        self.sign = sign
        self.leave, self.land = swings.T
        length = gait.stance / gait.cadence
        start = np.concatenate([[-np.inf], self.land])  # start of stance i, which ends with swing i
        end = np.concatenate([self.leave, [np.inf]])
        is_long = end - start > 1.3 * length  # the pelvis is over neither end
        edges = np.clip([start, end], *course.times[[0, -1]])
        passing = np.where(is_long, edges.mean(axis=0), start + gait.under * length)
        yaw = course.heading(passing)
        # In a turn the feet are wider apart, because they would meet otherwise.
        turning = np.abs(course.heading(passing + 0.05) - course.heading(passing - 0.05)) / 0.1
        spread = 0.055 * body.height * np.clip(turning / 1.2, 0.0, 1.0)
        aside = sign * (gait.width / 2 + spread)[:, None]
        left = np.stack([-np.sin(yaw), np.cos(yaw)], axis=-1)
        self.places = course.place(passing) + aside * left
        self.yaws = yaw + np.radians(sign * gait.toe_out)
        self.vigour_land = course.vigour(self.land)
        self.vigour_leave = course.vigour(self.leave)

    def yaw(self, t: Array) -> Array:
        """Return the direction of the foot, radians (T,)."""
        knots: list[Knot] = [(-1e3, self.yaws[0], 0, 0)]
        for i, (leave, land) in enumerate(zip(self.leave, self.land, strict=True)):
            knots += [(leave, self.yaws[i], 0, 0), (land, self.yaws[i + 1], 0, 0)]
        return through(t, knots if len(knots) > 1 else [*knots, (1e3, self.yaws[0], 0, 0)])

    def pitch(self, t: Array) -> Array:
        """Return pitch of the foot, its rate and acceleration, degrees, toes up: (T, 3)."""
        gait, length = self.gait, self.gait.stance / self.gait.cadence
        knots: list[Knot] = [(-1e3, 0, 0, 0)]
        for i, (leave, land) in enumerate(zip(self.leave, self.land, strict=True)):
            off, on = self.vigour_leave[i], self.vigour_land[i]
            knots += [
                (leave - (1 - gait.flat[1]) * length, 0, 0, 0),
                (leave, gait.leaving[0] * off, gait.leaving[1] * off, 0),
                (land, gait.landing[0] * on, gait.landing[1] * on, 0),
                (land + gait.flat[0] * length, 0, 0, 0),
            ]
        return through(t, [*knots, (1e4, 0, 0, 0)], derivatives=2)

    def ankle(self, t: Array, pitch: Array) -> Array:
        """Return the ankle joint at ascending times, world metres (T, 3)."""
        from scipy.interpolate import make_interp_spline

        stance = np.searchsorted(self.land, t, side="right")
        value = self._standing(stance, pitch)[0]
        share, along, height = self.way.T
        rest = LENGTHS["ankle"] * self.height
        swing = np.arange(len(self.leave))
        first = self._standing(swing, self.pitch(self.leave))
        last = self._standing(swing + 1, self.pitch(self.land))
        start, stop = np.searchsorted(t, self.leave, side="right"), np.searchsorted(t, self.land)
        for i in np.flatnonzero(stop > start).tolist():
            leave, land, inside = self.leave[i], self.land[i], slice(start[i], stop[i])
            vigour = 0.3 + 0.35 * (self.vigour_leave[i] + self.vigour_land[i])
            step = self.places[i + 1] - self.places[i]
            ground = self.places[i] + along[:, None] * step
            # In a turn a foot moves round the other one, not through it.
            bend, middle = self.yaws[i + 1] - self.yaws[i], self.yaws[i : i + 2].mean()
            round_it = 0.16 * self.height * np.sin(np.pi * share) ** 2 * (1 - np.cos(bend / 2))
            ground += self.sign * round_it[:, None] * [-np.sin(middle), np.cos(middle)]
            passed = np.column_stack([ground, rest + vigour * (height - rest)])
            curve = make_interp_spline(
                np.concatenate([[leave], leave + share * (land - leave), [land]]),
                np.concatenate([first[0][[i]], passed, last[0][[i]]]),
                k=5,
                bc_type=tuple([(1, end[1][i]), (2, end[2][i])] for end in (first, last)),
            )
            value[inside] = curve(t[inside])
        return value

    def _standing(self, stance: NDArray[np.int64], pitch: Array) -> tuple[Array, ...]:
        """Position, velocity and acceleration of the ankle over a planted foot, (T, 3) each."""
        yaw = self.yaws[stance]
        ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)
        moves = [
            np.concatenate([move[:, :1] * ahead, move[:, 1:]], axis=-1)
            for move in rolled(pitch, self.height)
        ]
        moves[0][:, :2] += self.places[stance]
        return tuple(moves)


def rolled(pitch: Array, height: float) -> tuple[Array, Array, Array]:
    """Roll a planted foot over its heel or its ball, which stays where it is.

    Parameters
    ----------
    pitch : ndarray of shape (T, 3)
        Angle, its rate and acceleration, degrees, toes up.
    height : float
        Height of the person, metres.

    Returns
    -------
    tuple of ndarray of shape (T, 2)
        Ankle forward of its place over the flat foot and above the ground, velocity, acceleration.
    """
    angle, rate, bend = (np.radians(pitch[:, k, None]) for k in range(3))
    lever = -height * np.where(angle > 0, _HEEL, _BALL)  # from the pivot to the ankle
    across = np.stack([-lever[:, 1], lever[:, 0]], axis=-1)
    cos, sin = np.cos(angle), np.sin(angle)
    along, aside = lever * cos + across * sin, across * cos - lever * sin
    place = along - lever + [0.0, LENGTHS["ankle"] * height]
    return place, rate * aside, bend * aside - rate**2 * along


def reached(
    course: Course,
    body: Body,
    hips_at: Callable[[Array], dict[str, Array]],
    feet_at: Callable[[Array], Feet],
) -> Array:
    """Return the greatest height of the hips at which both legs reach the feet, at `course.times`.

    Parameters
    ----------
    course, body
        Position over time, and person.
    hips_at : callable
        Function from times (T,) to the hip joints by side, (T, 3), for a root at height 0.
    feet_at : callable
        Function from times (T,) to the feet.

    Returns
    -------
    ndarray of shape (n,)
        Metres.
    """
    hips, feet = hips_at(course.times), feet_at(course.times)
    leg = REACH * (body["thigh"] + body["shank"])
    highest = np.full(len(course.times), np.inf)
    for side in SIDES:
        across = feet.ankles[side] - hips[side]
        flat = np.minimum((across[:, :2] ** 2).sum(axis=1), 0.9 * leg**2)
        highest = np.minimum(highest, across[:, 2] + np.sqrt(leg**2 - flat))
    return highest


def carried(t: Array, course: Course, highest: Array, smoothing: float = 0.15) -> Array:
    """Return the height of the hips over time, smooth and always within reach of the legs.

    Parameters
    ----------
    t : ndarray of shape (T,)
        Times, seconds.
    course : Course
        Position over time.
    highest : ndarray of shape (n,)
        Result of `reached`.
    smoothing : float
        Width of the smoothing, seconds.

    Returns
    -------
    ndarray of shape (T,)
        Metres.
    """
    from scipy.interpolate import CubicSpline
    from scipy.ndimage import convolve1d, minimum_filter1d

    # The mean over a window of the minima over the same window is below every value in it.
    box = np.ones(2 * round(smoothing / 6 / STEP) + 1)
    kernel = np.convolve(np.convolve(box, box), box)
    lowest = minimum_filter1d(highest, len(kernel), mode="nearest")
    even = convolve1d(lowest, kernel / kernel.sum(), mode="nearest")
    return np.asarray(CubicSpline(course.times, even)(t), dtype=np.float64)
