"""Body of fifteen rigid segments: lengths, thickness, and poses for given joints.

A person stands upright with hanging arms in the neutral pose; x is forward, y left, z up, in the
world and in the frame of every segment. Lengths are shares of the height.

References
----------
R. Drillis, R. Contini, *Body Segment Parameters*, New York University, 1966; as given in
D. A. Winter, *Biomechanics and Motor Control of Human Movement*, 4th ed., fig. 4.1, 2009.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from asterism.camera import Capsule
from asterism.simulate.people.curves import unit

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from asterism.simulate.people.curves import Array

    Point: TypeAlias = tuple[float, float, float]
    Tube: TypeAlias = tuple[Point, Point, float]

__all__ = ["FLESH", "LENGTHS", "SEGMENTS", "SIDES", "Body", "Limb", "Pose", "two_bones"]

LENGTHS = {
    "ankle": 0.039,  # above the ground
    "shank": 0.246,
    "thigh": 0.245,
    "hip": 0.050,  # half the distance of the hip joints
    "waist": 0.060,  # above the hips: where the trunk bends
    "shoulder": 0.228,  # above the waist, so that shoulders are at 0.818
    "shoulder_half": 0.105,  # half the distance of the shoulder joints, 0.259 of bones less flesh
    "arm": 0.186,
    "forearm": 0.146,
    "head": 0.295,  # above the waist: where the head nods
}
"""Lengths as shares of the height."""

SIDES = {"L": 1.0, "R": -1.0}
"""Sides of the body, with the sign of y."""

# Capsules of each segment: two ends and a radius, shares of the height. Those of the left side.
FLESH: dict[str, tuple[Tube, ...]] = {
    "pelvis": (((0, -0.037, 0.045), (0, 0.037, 0.045), 0.060),),
    "trunk": (
        ((0.006, 0, 0.020), (0, 0, 0.175), 0.060),
        ((0, 0.020, 0.050), (0, 0.034, 0.165), 0.054),
        ((0, -0.020, 0.050), (0, -0.034, 0.165), 0.054),
        ((0, -0.085, 0.224), (0, 0.085, 0.224), 0.027),
        ((-0.002, 0, 0.220), (0.006, 0, 0.300), 0.032),
    ),
    "head": (
        ((0.006, 0, 0.034), (0.004, 0, 0.066), 0.047),
        ((0.018, 0, 0.022), (0.016, 0, 0.062), 0.038),
    ),
    "thigh": (((0, 0, -0.010), (0, 0, -0.140), 0.044), ((0, 0, -0.110), (0, 0, -0.245), 0.036)),
    "shank": (((-0.006, 0, -0.03), (-0.004, 0, -0.110), 0.030), ((0, 0, 0), (0, 0, -0.246), 0.022)),
    "foot": (((-0.014, 0, -0.019), (0.077, 0, -0.019), 0.020),),
    "arm": (((0, 0, 0), (0, 0, -0.186), 0.026),),
    "forearm": (((0, 0, 0), (0, 0, -0.090), 0.022), ((0, 0, -0.06), (0, 0, -0.146), 0.018)),
    "hand": (((0, 0, -0.020), (0.004, 0, -0.075), 0.016),),
}
"""Capsules of each kind of segment."""

_MIDDLE = ("pelvis", "trunk", "head")
SEGMENTS = (*_MIDDLE, *(s + k for s in SIDES for k in FLESH if k not in _MIDDLE))
"""Names of the fifteen segments: ``pelvis``, ``trunk``, ``head``, ``Lthigh`` …"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Limb:
    """Rotations of an arm from the frame of each segment to the world.

    Parameters
    ----------
    arm, forearm, hand : ndarray of shape (T, 3, 3)
        Rotation of each segment.
    """

    arm: Array
    forearm: Array
    hand: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Pose:
    """Positions and orientations of the segments in T frames.

    Attributes
    ----------
    origins : dict of ndarray of shape (T, 3)
        Upper joint of each segment, world metres.
    turns : dict of ndarray of shape (T, 3, 3)
        Rotation from the frame of the segment to the world.
    """

    origins: dict[str, Array]
    turns: dict[str, Array]

    def place(self, segment: str, points: ArrayLike) -> Array:
        """Transform points that are fixed to a segment to the world.

        Parameters
        ----------
        segment : str
            Name of the segment.
        points : array_like of shape (K, 3)
            Points in the frame of the segment, metres.

        Returns
        -------
        ndarray of shape (T, K, 3)
        """
        local = np.asarray(points, dtype=np.float64)
        return self.origins[segment][:, None] + np.einsum("tij,kj->tki", self.turns[segment], local)


@dataclass(frozen=True, kw_only=True)
class Body:
    """Body of a given height.

    Parameters
    ----------
    height : float
        Height, metres.
    """

    height: float

    def __getitem__(self, length: str) -> float:
        """Return one of `LENGTHS` in metres."""
        return LENGTHS[length] * self.height

    def tubes(self, segment: str) -> list[tuple[Array, float]]:
        """Return the capsules of a segment.

        Parameters
        ----------
        segment : str
            Name of the segment.

        Returns
        -------
        list of (ndarray, float)
            Ends (2, 3) in the frame of the segment, and radius, metres.
        """
        return [
            (np.array([start, end]) * self.height, radius * self.height)
            for start, end, radius in FLESH[segment.lstrip("LR")]
        ]

    def hips(self, root: Array, pelvis: Array) -> dict[str, Array]:
        """Return the hip joints.

        Parameters
        ----------
        root : ndarray of shape (T, 3)
            Middle of the hip joints, world metres.
        pelvis : ndarray of shape (T, 3, 3)
            Rotation of the pelvis.

        Returns
        -------
        dict of ndarray of shape (T, 3)
            By side.
        """
        return {s: root + sign * self["hip"] * pelvis[:, :, 1] for s, sign in SIDES.items()}

    def shoulders(self, root: Array, pelvis: Array, trunk: Array) -> dict[str, Array]:
        """Return the shoulder joints.

        Parameters
        ----------
        root, pelvis
            As for `hips`.
        trunk : ndarray of shape (T, 3, 3)
            Rotation of the trunk.

        Returns
        -------
        dict of ndarray of shape (T, 3)
            By side.
        """
        waist = root + self["waist"] * pelvis[:, :, 2]
        middle = waist + self["shoulder"] * trunk[:, :, 2]
        return {
            s: middle + sign * self["shoulder_half"] * trunk[:, :, 1] for s, sign in SIDES.items()
        }

    def pose(
        self,
        *,
        root: Array,
        pelvis: Array,
        trunk: Array,
        head: Array,
        ankles: Mapping[str, Array],
        feet: Mapping[str, Array],
        arms: Mapping[str, Limb],
    ) -> Pose:
        """Compose the pose: trunk and arms from rotations, legs from the positions of the feet.

        Parameters
        ----------
        root : ndarray of shape (T, 3)
            Middle of the hip joints, world metres.
        pelvis, trunk, head : ndarray of shape (T, 3, 3)
            Rotations to the world.
        ankles : mapping of ndarray of shape (T, 3)
            Ankle joints by side, within reach of the legs.
        feet : mapping of ndarray of shape (T, 3, 3)
            Rotations of the feet.
        arms : mapping of Limb
            Rotations of the arms.

        Returns
        -------
        Pose
        """
        waist = root + self["waist"] * pelvis[:, :, 2]
        origins = {"pelvis": root, "trunk": waist, "head": waist + self["head"] * trunk[:, :, 2]}
        turns = {"pelvis": pelvis, "trunk": trunk, "head": head}
        hips = self.hips(root, pelvis)
        shoulders = self.shoulders(root, pelvis, trunk)
        for s in SIDES:
            knee_towards = unit(pelvis[:, :, 0] + feet[s][:, :, 0] * [1, 1, 0])
            thigh, shank = two_bones(
                hips[s], ankles[s], self["thigh"], self["shank"], knee_towards, 1.0
            )
            turns |= {s + "thigh": thigh, s + "shank": shank, s + "foot": feet[s]}
            knee = hips[s] - self["thigh"] * thigh[:, :, 2]
            ankle = knee - self["shank"] * shank[:, :, 2]
            origins |= {s + "thigh": hips[s], s + "shank": knee, s + "foot": ankle}
            arm, forearm = arms[s].arm, arms[s].forearm
            turns |= {s + "arm": arm, s + "forearm": forearm, s + "hand": arms[s].hand}
            elbow = shoulders[s] - self["arm"] * arm[:, :, 2]
            wrist = elbow - self["forearm"] * forearm[:, :, 2]
            origins |= {s + "arm": shoulders[s], s + "forearm": elbow, s + "hand": wrist}
        return Pose(origins=origins, turns=turns)

    def capsules(self, pose: Pose, prefix: str = "") -> list[Capsule]:
        """Return the capsules of a pose, named after their segments.

        Parameters
        ----------
        pose : Pose
            Pose of the body.
        prefix : str
            Beginning of every name.

        Returns
        -------
        list of Capsule
        """
        return [
            Capsule(ends=pose.place(segment, ends), radius=radius, name=prefix + segment)
            for segment in SEGMENTS
            for ends, radius in self.tubes(segment)
        ]


def two_bones(
    start: Array, end: Array, upper: float, lower: float, front: Array, bend: float
) -> tuple[Array, Array]:
    """Return the rotations of two bones between two joints, such as thigh and shank.

    Parameters
    ----------
    start, end : ndarray of shape (T, 3)
        Hip and ankle, or shoulder and wrist, metres. If they are too far apart the bones are
        straight and do not reach the end; if too near, they are folded.
    upper, lower : float
        Lengths of the bones, metres.
    front : ndarray of shape (T, 3)
        Approximate direction of the x axes of the bones.
    bend : float
        1 if the joint between them moves forward on flexion (knee), -1 if backward (elbow).

    Returns
    -------
    tuple of ndarray of shape (T, 3, 3)
        Rotations of the bones, which lie along -z with the hinge along y.
    """
    line = end - start
    distance = np.clip(
        np.linalg.norm(line, axis=-1, keepdims=True), abs(upper - lower) + 1e-6, upper + lower
    )
    up = -unit(line)
    hinge = unit(np.cross(up, front))
    forward = np.cross(hinge, up)
    along = (distance**2 + upper**2 - lower**2) / (2 * distance)
    aside = bend * np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    first: Array = (up * along - forward * aside) / upper
    second: Array = (up * (distance - along) + forward * aside) / lower
    ahead, then = np.cross(hinge, first), np.cross(hinge, second)
    return np.stack([ahead, hinge, first], axis=-1), np.stack([then, hinge, second], axis=-1)
