"""Walking and running: cadence, stance, and the motion of pelvis, trunk, head and arms.

The angles over the cycle are sums of one or two harmonics that follow the normative curves. The
angles of the legs follow from the positions of the feet (`steps`).

References
----------
M. P. Murray, A. B. Drought, R. C. Kory, *Walking patterns of normal men*, J. Bone Joint Surg. 46-A,
1964; M. P. Murray, S. B. Sepic, E. J. Barnard, *Patterns of sagittal rotation of the upper limbs in
walking*, Physical Therapy 47, 1967; J. Perry, *Gait Analysis*, 1992; T. F. Novacheck, *The
biomechanics of running*, Gait & Posture 7, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from asterism.simulate.people.curves import about_x, about_y, about_z, harmonics
from asterism.simulate.people.skeleton import SIDES, Limb
from asterism.simulate.people.steps import Gait

if TYPE_CHECKING:
    from asterism.simulate.people.curves import Array

__all__ = ["GRAVITY", "Carriage", "Style", "arm_turns", "bounce", "running", "upright", "walking"]

GRAVITY = 9.81


@dataclass(frozen=True, kw_only=True)
class Style:
    """Individual variation of the motion of a person, drawn once from the seed.

    Parameters
    ----------
    phase : float
        Phase of the cycle at time 0, cycles.
    pace, length : float
        Cadence and step length relative to the population mean, about 1.
    arms, turns : float
        Amplitudes of the arm swing, and of the rotation of pelvis and trunk, about 1.
    lean, elbows : float
        Additional lean of the trunk and flexion of the elbows, degrees.
    asymmetry : float
        Additional swing of the left arm relative to the right one, as a share.
    sway : float
        Lateral displacement of the body towards the stance foot, metres.
    """

    phase: float
    pace: float
    length: float
    arms: float
    turns: float
    lean: float
    elbows: float
    asymmetry: float
    sway: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Self:
        """Draw the variation of a person.

        Parameters
        ----------
        rng : Generator
            Generator of random numbers.

        Returns
        -------
        Style
        """
        return cls(
            phase=rng.uniform(0, 1),
            pace=rng.uniform(0.96, 1.04),
            length=rng.uniform(0.96, 1.04),
            arms=rng.uniform(0.8, 1.2),
            turns=rng.uniform(0.8, 1.2),
            lean=rng.uniform(-1.5, 2.0),
            elbows=rng.uniform(-5.0, 8.0),
            asymmetry=rng.uniform(-0.08, 0.08),
            sway=rng.uniform(0.016, 0.024),
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Carriage:
    """Orientations of the upper body over time.

    Parameters
    ----------
    pelvis, trunk, head : ndarray of shape (T, 3, 3)
        Rotations to the world.
    arms : dict of Limb
        Rotations of the arms, by side.
    sway : ndarray of shape (T,)
        Displacement of the root to the left, metres.
    """

    pelvis: Array
    trunk: Array
    head: Array
    arms: dict[str, Limb]
    sway: Array


def walking(height: float, style: Style) -> Gait:
    """Return the gait of a walk.

    Steps of 0.40 of the height, 112 a minute (Perry 1992: strides of 1.41 m, 113 steps a minute,
    1.36 m/s). Time scales with the square root of the length.

    Parameters
    ----------
    height : float
        Height of the person, metres.
    style : Style
        Individual variation.

    Returns
    -------
    Gait
    """
    cadence = 56 / 60 * style.pace * np.sqrt(1.75 / height)
    return Gait(
        cadence=cadence,
        stance=0.61,
        under=0.345,
        landing=(18.0, -60.0),
        leaving=(-58.0, -330.0),
        flat=(0.17, 0.45),
        swing=((0.27, 9.0, 62.0), (0.55, 25.0, 55.0), (0.80, 25.0, 18.0)),
        hips=0.515 * height,
        speed=0.80 * height * style.length * cadence,
        width=0.055 * height,
        toe_out=6.0,
    )


def running(height: float, style: Style) -> Gait:
    """Return the gait of a run.

    About 3 m/s at 172 steps a minute, with a foot on the ground for 36 % of the cycle (Novacheck
    1998: 3.2 m/s, and under 40 %).

    Parameters
    ----------
    height : float
        Height of the person, metres.
    style : Style
        Individual variation.

    Returns
    -------
    Gait
    """
    cadence = 86 / 60 * style.pace * np.sqrt(1.75 / height)
    return Gait(
        cadence=cadence,
        stance=0.36,
        under=0.31,
        landing=(8.0, -120.0),
        leaving=(-60.0, -680.0),
        flat=(0.16, 0.45),
        swing=((0.15, -10.0, 46.0), (0.46, 26.0, 100.0), (0.72, 43.0, 78.0), (0.93, 38.0, 44.0)),
        hips=0.485 * height,
        speed=1.20 * height * style.length * cadence,
        width=0.064 * height,
        toe_out=4.0,
    )


def upright(
    phase: Array, heading: Array, vigour: Array, style: Style, *, is_run: bool = False
) -> Carriage:
    """Return the motion of pelvis, trunk, head and arms that belongs to that of the legs.

    Parameters
    ----------
    phase : ndarray of shape (T,)
        Phase in cycles; whole numbers where the left foot lands.
    heading : ndarray of shape (T,)
        Direction, radians.
    vigour : ndarray of shape (T,)
        Amplitude of the motion, from 0, standing, to 1.
    style : Style
        Individual variation.
    is_run : bool
        Whether the person runs.

    Returns
    -------
    Carriage
    """
    yaw, turn = np.degrees(heading), style.turns * vigour
    about, lean, twist = (6.0, 7.0, 13.0) if is_run else (4.0, 1.5, 4.0)
    # The left side of the pelvis is in front as the left foot lands; the trunk turns against it,
    # the side of the swinging leg drops.
    pelvis = (
        about_z(yaw - about * turn * harmonics(phase, 0, (1, 0.02)))
        @ about_y(0.6 * lean + vigour * harmonics(phase, 0, (0, 0), (1.2, 0.05)))
        @ about_x(4.0 * turn * harmonics(phase, 0, (1, 0.16)))
    )
    trunk = (
        about_z(yaw + twist * turn * harmonics(phase, 0, (1, 0.0)))
        @ about_y(lean + style.lean + vigour * harmonics(phase, 0, (0, 0), (1.5, 0.1)))
        @ about_x(-1.5 * turn * harmonics(phase, 0, (1, 0.2)))
    )
    head = about_z(yaw) @ about_y(0.4 * lean + vigour * harmonics(phase, 0, (0, 0), (-1.0, 0.1)))
    arms: dict[str, Limb] = {}
    for side, sign in SIDES.items():
        of_side = phase - (0.5 if side == "R" else 0.0)  # back as the foot of the side lands
        amount = vigour * style.arms * (1 + sign * style.asymmetry)
        if is_run:
            swing = -14.0 + amount * harmonics(of_side, 0, (33.0, 0.5))
            bend = 88.0 + style.elbows + amount * harmonics(of_side, 0, (14.0, 0.47))
            aside, inward = 14.0, 14.0
        else:
            swing = -3.0 * vigour + amount * harmonics(of_side, 0, (17.0, 0.52))
            bend = 15.0 + style.elbows + vigour * 9.0 + amount * harmonics(of_side, 0, (10, 0.55))
            aside, inward = 9.0, 8.0
        arms[side] = arm_turns(trunk, sign, swing, aside, inward, bend)
    sway = style.sway * (0.5 if is_run else 1.0) * vigour * harmonics(phase, 0, (1, 0.30))
    return Carriage(pelvis=pelvis, trunk=trunk, head=head, arms=arms, sway=sway)


def arm_turns(
    trunk: Array, sign: float, swing: Array, aside: float, inward: float, bend: Array
) -> Limb:
    """Return the rotations of an arm from the angles of its joints, degrees.

    Parameters
    ----------
    trunk : ndarray of shape (T, 3, 3)
        Rotation of the trunk.
    sign : float
        1 for the left arm, -1 for the right.
    swing, bend : ndarray of shape (T,)
        Flexion of shoulder and elbow, forwards positive.
    aside, inward : float
        Abduction and inward rotation of the upper arm.

    Returns
    -------
    Limb
    """
    arm = trunk @ about_x(sign * aside) @ about_y(-swing) @ about_z(-sign * inward)
    forearm = arm @ about_y(-bend)
    hand = forearm @ about_z(-sign * 10.0) @ about_x(-sign * 4.0)
    return Limb(arm=arm, forearm=forearm, hand=hand)


def bounce(phase: Array, gait: Gait) -> Array:
    """Return the height of a runner's hips, up to a constant: a parabola while no foot stands.

    The ground force over the stance is ``A sin²`` and carries the weight over the step: ``A
    T_stance / 2 = g T_step``.

    Parameters
    ----------
    phase : ndarray of shape (T,)
        Phase in cycles.
    gait : Gait
        Cadence and stance.

    Returns
    -------
    ndarray of shape (T,)
        Metres.
    """
    step, stance = 0.5 / gait.cadence, gait.stance / gait.cadence
    push = 2 * GRAVITY * step / stance
    v = GRAVITY * stance / 2 - push * stance / 4
    s = (2 * phase % 1.0) * step
    w = 2 * np.pi / stance
    standing = v * s - GRAVITY * s**2 / 2 + push * (s**2 / 4 + (np.cos(w * s) - 1) / (2 * w**2))
    end = v * stance - GRAVITY * stance**2 / 2 + push * stance**2 / 4
    up = v - GRAVITY * stance + push * stance / 2
    flight = end + up * (s - stance) - GRAVITY * (s - stance) ** 2 / 2
    return np.where(s < stance, standing, flight)
