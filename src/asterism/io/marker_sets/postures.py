"""Postures of a tree of segments: places of its markers at sampled joint angles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "N_POSTURES",
    "Posture",
    "Segment",
    "neutral",
    "place_markers",
    "postures",
    "relaxed",
    "rotation",
]

N_POSTURES = 64
"""Number of postures that are sampled."""
MIN_LIMB = 0.4
"""Smallest extent of a limb that is lowered from a T-pose, metres; a foot is shorter."""
LIMB_TURN = 0.3
"""Standard deviation of the first joint of a limb and of its hinges, per axis, radians."""
LOWERED = np.radians(80)
"""Angle by which a limb that stretches sideways is lowered."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Segment:
    """A segment with the joint to its parent.

    A point x of the segment is at ``pre + R_pre (J (R_post x + post) + error)`` of its parent,
    metres, where J turns about `axes` in turn.
    """

    name: str
    parent: int  # index in the list of segments, -1 for the root
    R_pre: NDArray[np.float64]  # (3, 3)
    pre: NDArray[np.float64]  # (3,)
    R_post: NDArray[np.float64]
    post: NDArray[np.float64]
    axes: NDArray[np.float64]  # (A, 3), unit vectors
    turns: NDArray[np.float64]  # (A,), standard deviation of each angle, radians
    shift: float  # error of the centre of the joint: standard deviation per axis, metres


@dataclass(frozen=True, eq=False, kw_only=True)
class Posture:
    """Values of all joints: angles in the order of the segments and their axes, and errors."""

    angles: NDArray[np.float64]  # (total,), radians
    errors: NDArray[np.float64]  # (S, 3), metres


def rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of a rotation vector: axis times angle, radians."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


def postures(
    segments: Sequence[Segment], *, angle: float = 0.0, error: float = 0.0
) -> list[Posture]:
    """Return `N_POSTURES` postures with normally distributed angles and errors.

    Parameters
    ----------
    segments : sequence of Segment
        Segments, with the standard deviations.
    angle, error : float
        Factors on these; 0 leaves the joints in the neutral posture, or without error.

    Notes
    -----
    The quantiles are those of a Kronecker sequence of the square roots of primes, which fills many
    dimensions evenly and is the same in each run.
    """
    from scipy.special import ndtri

    turns = np.concatenate([s.turns for s in segments])
    n, S = len(turns), len(segments)
    steps = np.arange(1, N_POSTURES + 1)
    shares = np.modf(steps[:, None] * np.sqrt(_primes(n + 3 * S)))[0]
    values = ndtri(np.clip(shares, 1e-3, 1 - 1e-3))
    shifts = np.array([s.shift for s in segments])[:, None]
    return [
        Posture(
            angles=angle * turns * own[:n],
            errors=error * shifts * own[n:].reshape(S, 3),
        )
        for own in values
    ]


def neutral(segments: Sequence[Segment]) -> Posture:
    """Return the neutral posture."""
    n = sum(len(s.turns) for s in segments)
    return Posture(angles=np.zeros(n), errors=np.zeros((len(segments), 3)))


def place_markers(
    segments: Sequence[Segment],
    owner: NDArray[np.int64],
    local: NDArray[np.float64],
    posture: Posture,
) -> NDArray[np.float64]:
    """Place markers in one posture.

    Parameters
    ----------
    segments : sequence of Segment
        Segments, each after its parent.
    owner : ndarray of int, shape (M,)
        Segment of each marker, -1 for none.
    local : ndarray of shape (M, 3)
        Position of each marker in its segment, metres.
    posture : Posture
        Values of the joints.

    Returns
    -------
    ndarray of shape (M, 3)
        Metres, NaN for markers without a segment.
    """
    places = np.full((len(owner), 3), np.nan)
    for s, (R, origin) in enumerate(_frames(segments, posture)):
        places[owner == s] = local[owner == s] @ R.T + origin
    return places


def relaxed(
    segments: Sequence[Segment], owner: NDArray[np.int64], local: NDArray[np.float64]
) -> list[Segment]:
    """Let limbs move widely, and lower those that stretch sideways, as the arms in a T-pose.

    A limb is a chain of segments without branches, from the joint of its longest bone on: for an
    arm from the shoulder, not the collar bone.
    """
    frames = _frames(segments, neutral(segments))
    origins = np.array([origin for _, origin in frames])
    places = place_markers(segments, owner, local, neutral(segments))
    children = [
        [k for k, own in enumerate(segments) if own.parent == s] for s in range(len(frames))
    ]
    result = list(segments)
    for s, segment in enumerate(segments):
        up = segment.parent
        if up < 0 or (len(children[up]) < 2 and segments[up].parent >= 0):
            continue  # a limb starts at the root or where the body branches
        chain = [s]
        while len(children[chain[-1]]) == 1:
            chain.append(children[chain[-1]][0])
        if children[chain[-1]] or len(chain) < 2:
            continue  # it branches again, as a trunk does, or has no bone
        bones = np.linalg.norm(np.diff(origins[chain], axis=0), axis=1)
        bones *= [len(segments[k].axes) >= 2 for k in chain[:-1]]
        first = int(np.argmax(bones))
        top, own = segments[chain[first]], np.isin(owner, chain[first:])
        levers = places[own] - origins[chain[first]]
        if bones[first] <= 0 or np.linalg.norm(levers, axis=1).max(initial=0) < MIN_LIMB:
            continue
        x, y, z = levers.mean(axis=0)
        across = float(np.hypot(x, y))
        angle = LOWERED if across > 2 * abs(z) else 0.0
        turn = rotation(angle / max(across, 1e-9) * np.array([-y, x, 0.0]))
        R_parent = frames[top.parent][0]
        for k in chain[first:]:
            if k == chain[first] or len(segments[k].axes) < 3:
                turns = np.where(segments[k].turns > 0, LIMB_TURN, 0.0)
                result[k] = replace(segments[k], turns=turns)
        R_pre = R_parent.T @ turn @ R_parent @ top.R_pre
        result[chain[first]] = replace(result[chain[first]], R_pre=R_pre)
    return result


def _frames(
    segments: Sequence[Segment], posture: Posture
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return rotation and origin of each segment in the world."""
    found: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    at = 0
    for segment, error in zip(segments, posture.errors, strict=True):
        R, origin = found[segment.parent] if segment.parent >= 0 else (np.eye(3), np.zeros(3))
        origin = origin + R @ segment.pre
        R = R @ segment.R_pre
        origin = origin + R @ error
        for axis in segment.axes:
            R = R @ rotation(axis * posture.angles[at])
            at += 1
        found.append((R @ segment.R_post, origin + R @ segment.post))
    return found


def _primes(n: int) -> NDArray[np.int64]:
    """Return the first n prime numbers."""
    is_prime = np.ones(30 + 20 * n, dtype=bool)  # more than enough for n below 10 000
    is_prime[:2] = False
    for p in range(2, int(len(is_prime) ** 0.5) + 1):
        is_prime[p * p :: p] &= not is_prime[p]
    return np.flatnonzero(is_prime)[:n]
