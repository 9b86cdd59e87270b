"""Scene of one hand whose five fingers bend and stretch, each at its own frequency.

In the frame of the palm, with its origin at the wrist, x points to the fingers, y to the thumb's
side and z out of the back of the hand. It is a right hand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Capsule
from asterism.simulate.clock import clock
from asterism.simulate.people.curves import about_x, about_y, about_z
from asterism.simulate.people.marker_set import on_skin
from asterism.simulate.people.skeleton import Pose
from asterism.simulate.truth import Truth

if TYPE_CHECKING:
    from asterism.simulate.people.curves import Array

__all__ = ["fingers"]


@dataclass(frozen=True, kw_only=True)
class _Finger:
    """Finger: position and lengths of its bones, metres, and directions, degrees.

    The first bone of the thumb is that of its palm, which moves too.
    """

    start: tuple[float, float, float]
    bones: tuple[float, float, float]
    radii: tuple[float, float, float]
    aside: float
    stretched: tuple[float, float, float]
    bent: tuple[float, float, float]


# Lengths of the bones: means of A. Buryanov & V. Kotiuk, *Proportions of hand segments*,
# Int. J. Morphol. 28(3), 2010; the last bone includes 4 mm of pulp.
_FINGERS = {
    "T": _Finger(
        start=(0.020, 0.022, -0.008), bones=(0.046, 0.032, 0.026), radii=(0.0105, 0.0095, 0.0085),
        aside=46, stretched=(-6, 2, -4), bent=(6, 28, 34),
    ),
    "I": _Finger(
        start=(0.092, 0.024, 0.000), bones=(0.040, 0.022, 0.020), radii=(0.0088, 0.0078, 0.0070),
        aside=5, stretched=(0, 4, 2), bent=(62, 78, 46),
    ),
    "M": _Finger(
        start=(0.094, 0.003, 0.002), bones=(0.045, 0.026, 0.021), radii=(0.0088, 0.0078, 0.0070),
        aside=1, stretched=(0, 4, 2), bent=(66, 80, 48),
    ),
    "R": _Finger(
        start=(0.088, -0.017, 0.000), bones=(0.041, 0.026, 0.021), radii=(0.0084, 0.0074, 0.0067),
        aside=-4, stretched=(0, 4, 2), bent=(66, 80, 48),
    ),
    "L": _Finger(
        start=(0.079, -0.035, -0.005), bones=(0.033, 0.018, 0.020), radii=(0.0076, 0.0066, 0.0060),
        aside=-10, stretched=(0, 4, 2), bent=(70, 78, 46),
    ),
}  # fmt: skip
_COLOURS = {"T": 1, "I": 2, "M": 3, "R": 4, "L": 5, "palm": 6}

# Capsules of the palm: its bones, the ball of the thumb, the wrist.
_PALM = (
    ((0.012, 0.014, 0.000), (0.090, 0.024, 0.000), 0.0105),
    ((0.010, 0.003, 0.001), (0.092, 0.003, 0.002), 0.0105),
    ((0.010, -0.009, 0.000), (0.086, -0.017, 0.000), 0.0105),
    ((0.012, -0.018, -0.003), (0.077, -0.035, -0.005), 0.0100),
    ((-0.050, 0.010, 0.000), (0.005, 0.010, 0.000), 0.0180),
    ((-0.050, -0.010, 0.000), (0.005, -0.010, 0.000), 0.0180),
)
_ON_PALM = {
    "WRT": ((-0.008, 0.010, 0.0), (0.0, 1.0, 0.25)),
    "WRL": ((-0.008, -0.010, 0.0), (0.0, -1.0, 0.25)),
    "BACK": ((0.042, 0.003, 0.001), (0.0, 0.0, 1.0)),
}  # rays, as in `marker_set`


def fingers(*, frames: int = 300, rate: float = 100.0, seed: int = 0) -> Truth:
    """Simulate a right hand with 23 markers and moving fingers.

    Four markers are on the back of each finger (``T1`` … ``T4`` on the thumb, ``I`` index, ``M``
    middle, ``R`` ring, ``L`` little finger): on its knuckle and near the end of each bone. Two
    are on the wrist and one on the back of the hand. Fingers bend 0.5 to 1.1 times a second and
    spread meanwhile; the wrist moves by some centimetres and turns. Bones and palm are capsules.

    Parameters
    ----------
    frames : int
        Number of frames, ≥ 1.
    rate : float
        Frame rate, frames per second, > 0.
    seed : int
        Seed of the size of the hand, the frequencies of the fingers and the motion of the wrist.

    Returns
    -------
    Truth
        Markers in metres, z up; the hand is about 1 m above the ground. Colours 1 to 5 are the
        fingers from the thumb, 6 the palm.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> fingers(frames=10).n_tracks
    23
    """
    t = clock(frames, rate, seed)
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.94, 1.06)
    pose = _moving(t, size, rng)
    tubes = _tubes(size)
    names, positions, colours = _markers(pose, tubes)
    capsules = [
        Capsule(ends=pose.place(segment, ends), radius=radius, name=segment)
        for segment, parts in tubes.items()
        for ends, radius in parts
    ]
    lines = _lines(names)
    return Truth.of(t, positions, names, lines=lines, colours=colours, surfaces=capsules)


def _moving(t: Array, size: float, rng: np.random.Generator) -> Pose:
    """Return the pose of palm and bones; segments are ``palm`` and ``T1`` to ``L3``."""
    facing = rng.uniform(-180, 180)
    hertz, start = rng.uniform(0.15, 0.35, 6), rng.uniform(0, 1, 6)
    swing = np.sin(2 * np.pi * (t[:, None] * hertz + start))
    origin = [0.0, 0.0, 1.0] + swing[:, :3] * [0.06, 0.06, 0.04]
    palm = (
        about_z(facing + 25 * swing[:, 3]) @ about_y(18 * swing[:, 4]) @ about_x(30 * swing[:, 5])
    )
    origins, turns = {"palm": origin}, {"palm": palm}
    for name, finger in _FINGERS.items():
        pace, first = rng.uniform(0.5, 1.1), rng.uniform(0, 1)
        bend = 0.5 - 0.5 * np.cos(2 * np.pi * (pace * t + first))
        spread = np.sin(2 * np.pi * (rng.uniform(0.25, 0.5) * t + rng.uniform(0, 1)))
        angles = [a + (b - a) * bend for a, b in zip(finger.stretched, finger.bent, strict=True)]
        # Bent fingers do not spread.
        aside = finger.aside * (1 + 0.35 * spread) * (1 - 0.75 * bend)
        if name == "T":  # the thumb points to the side, and bends towards the fingers
            turn = palm @ about_z(finger.aside + 7 * spread) @ about_y(34.0) @ about_x(-62.0)
        else:
            turn = palm @ about_z(aside)
        place = origin + size * np.einsum("tij,j->ti", palm, np.array(finger.start))
        for k, angle in enumerate(angles):
            turn = turn @ about_y(angle)
            origins[f"{name}{k + 1}"], turns[f"{name}{k + 1}"] = place, turn
            place = place + size * finger.bones[k] * turn[:, :, 0]
    return Pose(origins=origins, turns=turns)


def _tubes(size: float) -> dict[str, list[tuple[Array, float]]]:
    """Return the capsules of each segment in its frame, metres."""
    tubes = {"palm": [(np.array([a, b]) * size, r * size) for a, b, r in _PALM]}
    for name, finger in _FINGERS.items():
        for k, (bone, radius) in enumerate(zip(finger.bones, finger.radii, strict=True)):
            end = bone - radius if k == 2 else bone  # the length includes the tip
            tubes[f"{name}{k + 1}"] = [(np.array([[0, 0, 0], [end, 0, 0]]) * size, radius * size)]
    return tubes


def _markers(
    pose: Pose, tubes: dict[str, list[tuple[Array, float]]]
) -> tuple[list[str], Array, list[int]]:
    """Return the markers on the skin: names, positions (T, K, 3) and colours."""
    rows: list[tuple[str, str, Array, Array, int]] = []
    out = np.array([0.0, 0.0, 1.0])
    for name in _FINGERS:
        colour = _COLOURS[name]
        if name == "T":
            rows.append(("T1", "T1", tubes["T1"][0][0][1] * 0.35, out, colour))
        else:
            knuckle = tubes["palm"]["IMRL".index(name)][0][1]
            rows.append((name + "1", "palm", knuckle, out, colour))
        for k, share in enumerate((0.86, 0.80, 0.72)):
            segment = f"{name}{k + 1}"
            rows.append((f"{name}{k + 2}", segment, tubes[segment][0][0][1] * share, out, colour))
    scale = tubes["palm"][0][1] / _PALM[0][2]
    for name, (start, towards) in _ON_PALM.items():
        rows.append((name, "palm", np.array(start) * scale, np.array(towards), _COLOURS["palm"]))
    places = [
        pose.place(segment, on_skin(tubes[segment], start, towards)[None])
        for _, segment, start, towards, _ in rows
    ]
    return [row[0] for row in rows], np.concatenate(places, axis=1), [row[4] for row in rows]


def _lines(names: list[str]) -> list[tuple[int, int, int]]:
    pairs = [
        (f"{finger}{k}", f"{finger}{k + 1}", _COLOURS[finger])
        for finger in _FINGERS
        for k in (1, 2, 3)
    ]
    palm = "WRT WRL, WRT T1, WRT I1, I1 M1, M1 R1, R1 L1, L1 WRL, M1 BACK, BACK WRT, BACK WRL"
    pairs += [(*pair.split(), _COLOURS["palm"]) for pair in palm.split(", ")]
    return [(names.index(a), names.index(b), colour) for a, b, colour in pairs]
