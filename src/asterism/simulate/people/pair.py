"""Scenes with two people: they walk past each other, or meet, hug and part."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from asterism.checks import check_fields
from asterism.errors import ParameterError
from asterism.simulate.clock import clock
from asterism.simulate.people.activities import Walker
from asterism.simulate.people.course import Course
from asterism.simulate.people.curves import about_x, about_y, about_z, blend, unit
from asterism.simulate.people.gait import Style, walking
from asterism.simulate.people.marker_set import MarkerSet, lines_between
from asterism.simulate.people.person import check_person
from asterism.simulate.people.skeleton import SIDES, Body, Limb, two_bones
from asterism.simulate.people.steps import swings_of
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from asterism.camera import Capsule
    from asterism.simulate.people.curves import Array
    from asterism.simulate.people.skeleton import Pose

__all__ = ["PAIR_ACTIVITIES", "two_people"]


def two_people(
    *,
    activity: str = "cross",
    frames: int = 600,
    rate: float = 100.0,
    seed: int = 0,
    n_markers: int = 53,
    heights: tuple[float, float] = (1.66, 1.82),
) -> Truth:
    """Simulate two people who walk past each other, or meet, hug and part.

    They meet at the origin at half time. In "cross" their arms pass at a distance of about 0.1 m.
    In "hug" they stop in front of each other. The taller person's arms go over the other's
    shoulders, and the other's arms round the taller person's waist. They let go, step back, turn
    round and leave. A hug takes 6 s: a shorter scene shows its middle, a longer one has a longer
    hug. No marker is inside a body.

    Parameters
    ----------
    activity : {"cross", "hug"}
        Motion of the two people.
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed of the styles, the phases and the direction of both persons.
    n_markers : int
        Number of markers on each person, 40 to 90.
    heights : (float, float)
        Heights of the persons, metres, 1.2 to 2.2, with a ratio of at most 1.2.

    Returns
    -------
    Truth
        Markers ``A:LFHD`` and so on, then ``B:LFHD`` and so on; metres, z up. Colours 1 to 3 are
        the left, the right and the middle of A, 4 to 6 those of B.

    Raises
    ------
    ParameterError
        If a number is out of range or the activity unknown.

    Examples
    --------
    >>> two_people(activity="hug", frames=10, n_markers=40).n_tracks
    80
    """
    t = clock(frames, rate, seed)
    if np.shape(heights) != (2,):
        raise ParameterError("heights", "two heights", repr(heights))
    for i, height in enumerate(heights):
        check_person(n_markers, **{f"heights[{i}]": height})
    if max(heights) > 1.2 * min(heights) + 1e-9:
        raise ParameterError("heights", "heights with a ratio of at most 1.2", repr(heights))
    check_fields("activity", [activity], PAIR_ACTIVITIES)
    rng = np.random.default_rng(seed)
    bodies = [Body(height=float(height)) for height in heights]
    poses = PAIR_ACTIVITIES[activity](t, bodies, rng)
    names: list[str] = []
    colours: list[int] = []
    lines: list[tuple[int, int, int]] = []
    surfaces: list[Capsule] = []
    positions: list[Array] = []
    for i, (body, pose) in enumerate(zip(bodies, poses, strict=True)):
        markers = MarkerSet(body=body, n_markers=int(n_markers))
        first = len(names)
        lines += [(a + first, b + first, c + 3 * i) for a, b, c in lines_between(markers.names)]
        names += ["AB"[i] + ":" + name for name in markers.names]
        colours += [c + 3 * i for c in markers.colours]
        surfaces += body.capsules(pose, "AB"[i] + ":")
        positions.append(markers.at(pose))
    return Truth.of(
        t,
        np.concatenate(positions, axis=1),
        names,
        lines=lines,
        colours=colours,
        surfaces=surfaces,
    )


def _cross(t: Array, bodies: list[Body], rng: np.random.Generator) -> list[Pose]:
    """Pass each other, left side to left side."""
    direction = rng.uniform(-np.pi, np.pi)
    apart = 0.36 * (bodies[0].height + bodies[1].height) / 2 + rng.uniform(0.04, 0.10)
    poses: list[Pose] = []
    for i, body in enumerate(bodies):
        style = Style.drawn(rng)
        gait = walking(body.height, style)
        heading = direction + i * np.pi
        course = Course(
            duration=float(t[-1]),
            speed=lambda x, v=gait.speed: np.full(x.shape, v),
            heading=lambda x, h=heading: np.full(x.shape, h),
            middle=(apart / 2 * np.sin(heading), -apart / 2 * np.cos(heading)),
            usual=gait.speed,
        )
        swings = swings_of(course, gait, style.phase)
        walker = Walker(body=body, style=style, gait=gait, course=course, swings=swings)
        poses.append(walker.pose(t))
    return poses


def _hug(t: Array, bodies: list[Body], rng: np.random.Generator) -> list[Pose]:
    """Meet, hug and part."""
    direction, duration = rng.uniform(-np.pi, np.pi), float(t[-1])
    mean = (bodies[0].height + bodies[1].height) / 2
    between, aside = 0.235 * mean, 0.030 * mean
    times = _Times.of(duration)
    parts: list[_Part] = []
    for i, body in enumerate(bodies):
        heading = direction + i * np.pi
        ahead = np.array([np.cos(heading), np.sin(heading)])
        left = np.array([-ahead[1], ahead[0]])
        x, y = (-between / 2 * ahead + aside * left).tolist()
        parts.append(_Part.of(t, body, Style.drawn(rng), times, heading, (x, y)))
    return [
        part.pose(t, times, parts[1 - i], is_over=_is_taller(bodies, i))
        for i, part in enumerate(parts)
    ]


def _is_taller(bodies: list[Body], i: int) -> bool:
    """Whether a person is the taller of two; the second one if they are the same."""
    return bodies[i].height > bodies[1 - i].height or (
        i == 1 and bodies[0].height == bodies[1].height
    )


@dataclass(frozen=True, kw_only=True)
class _Times:
    """Times at which the two people stop and start to leave, seconds."""

    stop: float
    go: float

    @classmethod
    def of(cls, duration: float) -> _Times:
        half = duration / 2
        hold = 1.0 + max(0.0, 0.15 * (duration - 6.0))
        return cls(stop=half - hold, go=half + hold)


@dataclass(frozen=True, eq=False, kw_only=True)
class _Part:
    """One person of a hug: the pose without the arms, which depend on the other person."""

    body: Body
    walker: Walker
    root: Array
    pelvis: Array
    trunk: Array
    head: Array
    arms: dict[str, Limb]

    @classmethod
    def of(
        cls,
        t: Array,
        body: Body,
        style: Style,
        times: _Times,
        heading: float,
        middle: tuple[float, float],
    ) -> _Part:
        gait = walking(body.height, style)
        # The phase is chosen so that a foot lands at the stop.
        style = replace(style, phase=-times.stop * gait.cadence)
        stop, go = times.stop, times.go

        slow = np.sqrt(body.height / 1.75)  # longer legs take longer steps

        def speed(x: Array) -> Array:
            walks = 1 - blend(x, stop - 1.0, stop + 0.15)
            backs = blend(x, go, go + 0.5, go + 0.8, go + 1.3)
            leaves = blend(x, go + 1.5, go + 2.6)
            return gait.speed * (walks + 0.95 * leaves) - 0.50 * backs

        def turned(x: Array) -> Array:
            return heading - np.pi * blend(x, go + 0.7, go + 0.7 + 2.3 * slow)

        course = Course(
            duration=float(t[-1]), speed=speed, heading=turned, middle=middle, usual=gait.speed
        )
        swings = {
            side: steady[(steady[:, 1] < stop + 0.01) | (steady[:, 0] > go)]
            for side, steady in swings_of(course, gait, style.phase).items()
        }
        walker = Walker(body=body, style=style, gait=gait, course=course, swings=swings)
        c = walker.carriage(t)
        close = blend(t, stop - 0.4, stop + 0.4, go - 0.5, go + 0.3)
        root = walker.root(t, c)
        return cls(
            body=body,
            walker=walker,
            root=root,
            pelvis=c.pelvis,
            trunk=c.trunk @ about_y(6.0 * close) @ about_z(-6.0 * close),
            head=c.head @ about_z(-12.0 * close) @ about_x(-5.0 * close),
            arms=c.arms,
        )

    def pose(self, t: Array, times: _Times, other: _Part, *, is_over: bool) -> Pose:
        """Return the pose with the arms around the other person's shoulders or waist."""
        stop, go, h, of = times.stop, times.go, self.body.height, other.body.height
        # The taller person's arms rise before the other's arms and fall after them.
        early = 0.15 if is_over else 0.0
        up = blend(t, stop - 1.1 - early, stop - 0.2 - early, go + 0.3 + early, go + 1.2 + early)
        close = blend(t, stop - 0.25, stop + 0.5, go - 0.85, go - 0.05)
        shoulders = self.body.shoulders(self.root, self.pelvis, self.trunk)
        feet = self.walker.feet(t)
        own = self.root + self.body["waist"] * self.pelvis[:, :, 2]
        theirs = other.root + other.body["waist"] * other.pelvis[:, :, 2]
        arms: dict[str, Limb] = {}
        for side, sign in SIDES.items():
            # One hand lies above the other.
            step = 0.022 * sign * of
            if is_over:
                opened = np.array([0.26, 0.20 * sign, 0.285])
                wrapped = np.array([-0.072 * of - 0.020 * h, -0.060 * sign * of, 0.275 * of + step])
            else:
                opened = np.array([0.24, 0.21 * sign, 0.12])
                wrapped = np.array([-0.060 * of - 0.026 * h, -0.080 * sign * of, 0.105 * of + step])
            outside = own + np.einsum("tij,j->ti", self.trunk, opened * h)
            around = theirs + np.einsum("tij,j->ti", other.trunk, wrapped)
            target = outside + close[:, None] * (around - outside)
            elbow = np.array([0.1, 0.9 * sign, 0.1] if is_over else [-0.1, 0.75 * sign, -0.6])
            pole = -np.einsum("tij,j->ti", self.trunk, elbow)
            arms[side] = _laid(
                self.body, self.arms[side], shoulders[side], target, pole, up[:, None]
            )
        return self.body.pose(
            root=self.root, pelvis=self.pelvis, trunk=self.trunk, head=self.head,
            ankles=feet.ankles, feet=feet.turns, arms=arms,
        )  # fmt: skip


def _laid(
    body: Body, hanging: Limb, shoulder: Array, target: Array, pole: Array, share: Array
) -> Limb:
    """Move the wrist of a hanging arm to a target by a share (T, 1) of the way."""
    wrist = (
        shoulder - body["arm"] * hanging.arm[:, :, 2] - body["forearm"] * hanging.forearm[:, :, 2]
    )
    front = unit((1 - share) * hanging.arm[:, :, 0] + share * pole)
    arm, forearm = two_bones(
        shoulder, wrist + share * (target - wrist), body["arm"], body["forearm"], front, -1.0
    )
    hand = forearm @ np.swapaxes(hanging.forearm, 1, 2) @ hanging.hand
    return Limb(arm=arm, forearm=forearm, hand=hand)


PAIR_ACTIVITIES = {"cross": _cross, "hug": _hug}
"""Activities of two people by name."""
