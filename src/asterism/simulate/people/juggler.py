"""Scene of a juggler: balls on parabolas from hand to hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_number
from asterism.errors import ParameterError
from asterism.simulate.clock import clock
from asterism.simulate.people.activities import Walker
from asterism.simulate.people.course import Course
from asterism.simulate.people.curves import about_x, about_y, about_z, through, unit
from asterism.simulate.people.gait import GRAVITY, Style, walking
from asterism.simulate.people.marker_set import MarkerSet, lines_between
from asterism.simulate.people.person import check_person
from asterism.simulate.people.skeleton import SIDES, Body, Limb, two_bones
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from asterism.simulate.people.curves import Array, Knot

__all__ = ["juggler"]

_BEATS = {3: 0.25, 5: 0.20, 7: 0.18}  # seconds from throw to throw, by the number of balls
_DWELL = 0.62  # share of the time between two throws of a hand in which it holds a ball
_BALL = 0.034  # radius of a ball, metres
_BALL_COLOUR = 4


def juggler(
    *,
    n_balls: int = 3,
    frames: int = 300,
    rate: float = 100.0,
    seed: int = 0,
    n_markers: int = 53,
    height: float = 1.75,
) -> Truth:
    """Simulate a standing person with markers who juggles balls in a cascade.

    Each ball is wrapped in reflective tape and is a marker at its centre; it occludes nothing. It
    flies on a parabola from a throw at the inner side of one hand to a catch at the outer side of
    the other, and lies in the hand in between; hand and ball have one velocity and one acceleration
    as they part and meet. Every hand throws every second beat, and n balls share n beats (C.
    Shannon, *Scientific aspects of juggling*, about 1980).

    Parameters
    ----------
    n_balls : int
        Number of balls: 3, 5 or 7, because a cascade has an odd number.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed of the person's style, the phase and the direction of view.
    n_markers : int
        Number of markers on the person, 40 to 90; the balls follow them.
    height : float
        Height of the person, metres, 1.2 to 2.2.

    Returns
    -------
    Truth
        Markers of the person, then ``BALL1`` and so on; metres, z up. The balls have colour 4.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> juggler(frames=10, n_markers=40).names[-1]
    'BALL3'
    """
    t = clock(frames, rate, seed)
    check_person(n_markers, height=height)
    check_number("n_balls", n_balls, integer=True)
    if n_balls not in _BEATS:
        raise ParameterError(
            "n_balls", "3, 5 or 7", n_balls, "choose an odd number, as a cascade needs"
        )
    rng = np.random.default_rng(seed)
    body, style = Body(height=float(height)), Style.drawn(rng)
    facing, start = rng.uniform(-np.pi, np.pi), rng.uniform(0, 2 * n_balls)
    slow, late = rng.uniform(0.2, 0.4, 2), rng.uniform(0, 1, 2)
    sway = np.radians(1.2) * np.sin(2 * np.pi * (t[:, None] * slow + late))

    course = Course(
        duration=float(t[-1]),
        speed=np.zeros_like,
        heading=lambda x: np.full(x.shape, facing),
        usual=1.0,
    )
    none = np.zeros((0, 2))
    walker = Walker(
        body=body, style=style, gait=walking(body.height, style), course=course,
        swings=dict.fromkeys(SIDES, none),
    )  # fmt: skip
    carriage, feet = walker.carriage(t), walker.feet(t)
    root = walker.root(t, carriage) - [0, 0, 0.012 * body.height]
    trunk = carriage.trunk @ about_z(np.degrees(sway[:, 0])) @ about_x(np.degrees(sway[:, 1]))

    pattern = _Cascade(n_balls=int(n_balls), body=body, start=start)
    world = about_z(np.full(1, np.degrees(facing)))[0]
    centre = np.array([0.0, 0.0, float(root[:, 2].mean())])
    shoulders = body.shoulders(root, carriage.pelvis, trunk)
    arms = {
        side: _reaching(
            body, shoulders[side], centre + pattern.hand(t, side) @ world.T, world, sign
        )
        for side, sign in SIDES.items()
    }
    # The head is raised slightly, because the eyes follow the balls.
    head = trunk @ about_y(-12.0 + 1.5 * np.sin(2 * np.pi * t / (2 * pattern.beat)))
    pose = body.pose(
        root=root, pelvis=carriage.pelvis, trunk=trunk, head=head,
        ankles=feet.ankles, feet=feet.turns, arms=arms,
    )  # fmt: skip
    markers = MarkerSet(body=body, n_markers=int(n_markers))
    balls = np.stack([centre + pattern.ball(t, k) @ world.T for k in range(n_balls)], axis=1)
    return Truth.of(
        t,
        np.concatenate([markers.at(pose), balls], axis=1),
        [*markers.names, *(f"BALL{k + 1}" for k in range(n_balls))],
        lines=lines_between(markers.names),
        colours=[*markers.colours, *([_BALL_COLOUR] * n_balls)],
        surfaces=body.capsules(pose),
    )


@dataclass(frozen=True, kw_only=True)
class _Cascade:
    """Motion of the balls in a frame between the hips, with x forward and y left."""

    n_balls: int
    body: Body
    start: float

    @property
    def beat(self) -> float:
        return _BEATS[self.n_balls]

    @property
    def held(self) -> float:
        """Time for which a hand holds a ball, seconds."""
        return 2 * self.beat * _DWELL

    @property
    def flight(self) -> float:
        return self.n_balls * self.beat - self.held

    def ball(self, t: Array, k: int) -> Array:
        """Return the centre of a ball, (T, 3): the left hand throws it at beat 0 of 2n."""
        n = self.n_balls
        beats = (t / self.beat + self.start - 2 * k) % (2 * n)  # ball k is thrown at beat 2k
        sign = np.where(beats < n, 1.0, -1.0)  # side of the hand that threw it last
        since = (beats % n) * self.beat
        throw, _, velocity = self._ends()
        mirror = np.stack([np.ones_like(sign), sign, np.ones_like(sign)], axis=-1)
        s = np.minimum(since, self.flight)[:, None]
        air = throw + velocity * s - [0, 0, GRAVITY / 2] * s**2
        carried = self._carry(since - self.flight)
        carried[:, 1] *= -1  # the other hand holds it
        return mirror * np.where(since[:, None] < self.flight, air, carried)

    def hand(self, t: Array, side: str) -> Array:
        """Return the centre of the hand's grip, (T, 3): the hand throws every second beat."""
        beats = (t / self.beat + self.start - (0 if side == "L" else self.n_balls)) % 2
        since = beats * self.beat
        throw, catch, velocity = self._ends()
        empty = 2 * self.beat - self.held
        # The hand brakes faster than the thrown ball, and falls ahead of the one that it catches.
        brake = [0.0, 0.0, -2 * velocity[2] / empty]
        to_catch: list[Knot] = [
            (0.0, throw, velocity, brake),
            (empty, catch, self._landing(), brake),
        ]
        back = through(since, to_catch)
        place = np.where(since[:, None] < empty, back, self._carry(since - empty))
        return place * [1.0, SIDES[side], 1.0]

    def _ends(self) -> tuple[Array, Array, Array]:
        """Return throw and catch of the left hand, and the velocity of the throw."""
        h = self.body.height
        # A deep path between catch and throw needs both to be high, within reach of the arms.
        scoop = 3 / 16 * GRAVITY * self.flight / 2 * self.held
        up = 0.150 * h + max(0.0, scoop - 0.110 * h)
        throw, catch = np.array([0.200 * h, 0.065 * h, up]), np.array([0.190 * h, 0.165 * h, up])
        velocity = (catch * [1, -1, 1] - throw) / self.flight
        velocity[2] = GRAVITY * self.flight / 2
        return throw, catch, velocity

    def _landing(self) -> Array:
        """Return the velocity of a ball that the left hand catches."""
        velocity = self._ends()[2] * [1, -1, 1]
        velocity[2] = -velocity[2]
        return velocity

    def _carry(self, since: Array) -> Array:
        """Return the centre of a ball in the left hand, (T, 3), from the catch to the throw."""
        throw, catch, velocity = self._ends()
        # The acceleration at both ends is twice the mean, which keeps the path flat.
        push = [0.0, 0.0, 4 * velocity[2] / self.held]
        knots: list[Knot] = [
            (0.0, catch, self._landing(), push),
            (self.held, throw, velocity, push),
        ]
        return through(since, knots)


def _reaching(body: Body, shoulder: Array, ball: Array, world: Array, sign: float) -> Limb:
    """Return an arm with a ball on the palm, which faces up with the fingers forward."""
    elbow_down = world @ [0.5, 0.0, 0.9]
    side = world @ [0.0, sign, 0.0]
    # The ball lies beside the middle of the palm, 1 mm above the skin of the hand.
    on_palm = np.array([0.002, 0, -0.050]) * body.height
    on_palm[1] = -sign * (0.016 * body.height + _BALL + 0.001)
    fingers = world @ unit(np.array([1.0, -0.25 * sign, -0.05]))
    thumb = unit(side - fingers * (side @ fingers))
    hand = np.stack([thumb, np.cross(-fingers, thumb), -fingers], axis=-1)
    wrist = ball - hand @ on_palm
    front = np.broadcast_to(elbow_down - 0.35 * side, shoulder.shape)
    arm, forearm = two_bones(shoulder, wrist, body["arm"], body["forearm"], front, -1.0)
    # The forearm rotates about its axis with the hand.
    along = forearm[:, :, 2]
    across = unit(thumb - along * (along @ thumb)[:, None])
    forearm = np.stack([across, np.cross(along, across), along], axis=-1)
    return Limb(arm=arm, forearm=forearm, hand=np.broadcast_to(hand, forearm.shape))
