"""A jump on the spot: crouch, push and swing of the arms, flight on a parabola, landing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from asterism.simulate.people.curves import about_y, about_z, through
from asterism.simulate.people.gait import GRAVITY, arm_turns
from asterism.simulate.people.skeleton import SIDES
from asterism.simulate.people.steps import REACH, rolled

if TYPE_CHECKING:
    from asterism.simulate.people.curves import Array, Knot
    from asterism.simulate.people.gait import Style
    from asterism.simulate.people.skeleton import Body, Pose

__all__ = ["jump"]

_PERIOD = 3.0  # smallest duration of a jump, seconds
_DIP, _PUSH, _SINK, _RISE = 0.62, 0.32, 0.26, 0.75  # seconds before and after the flight
_TOE_OUT = 5.0  # degrees
_LEAVE, _LAND = (-48.0, -360.0), (-34.0, 200.0)  # pitch of the feet and its rate, degrees


def jump(t: Array, body: Body, style: Style, rng: np.random.Generator) -> Pose:
    """Jump on the spot: once in the middle of the scene, or once every three seconds.

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
    """
    facing, rise = rng.uniform(-180, 180), rng.uniform(0.26, 0.42) * body.height / 1.75
    depth = rng.uniform(0.14, 0.17) * body.height
    duration = float(t[-1])
    n = max(1, int((duration + 1e-9) // _PERIOD))
    slot = duration / n
    i = np.clip(np.floor(t / slot), 0, n - 1) if slot else np.zeros(len(t))
    one = _Jump(body=body, style=style, rise=rise, depth=depth)
    return one.pose(t - (i + 0.5) * slot, about_z(np.full(len(t), facing)))


@dataclass(frozen=True, kw_only=True)
class _Jump:
    """One jump; time 0 is the top of the flight."""

    body: Body
    style: Style
    rise: float
    depth: float

    @property
    def up(self) -> float:
        """Time from take-off to the top of the flight, seconds."""
        return float(np.sqrt(2 * self.rise / GRAVITY))

    @property
    def down(self) -> float:
        """Time from the top to the landing, seconds; it is longer, as the legs land bent."""
        leave, land = self._edges
        return float(np.sqrt(2 * (self.rise + leave - land) / GRAVITY))

    @property
    def _edges(self) -> tuple[float, float]:
        """Heights of the root at take-off and at landing, metres."""
        ankle = [
            float(rolled(np.array([[pitch, 0.0, 0.0]]), self.body.height)[0][0, 1])
            for pitch in (_LEAVE[0], _LAND[0])
        ]
        return ankle[0] + 0.93 * self._leg, ankle[1] + 0.91 * self._leg

    @property
    def _leg(self) -> float:
        return self.body["thigh"] + self.body["shank"]

    def pose(self, t: Array, facing: Array) -> Pose:
        """Return the pose; `facing` (T, 3, 3) rotates the person to the world."""

        def turned(local: Array) -> Array:
            return np.einsum("tij,tj->ti", facing, local)

        root, ankles = self.root(t), self.ankles(t)
        trunk = facing @ about_y(self._along(t, 2.0, 38.0, 0.0, 2.0, 26.0))
        swing = self._along(t, 0.0, -44.0, 112.0, 66.0, 25.0, ahead=0.16)
        bend = self._along(t, 16.0, 22.0, 30.0, 34.0, 40.0) + self.style.elbows
        return self.body.pose(
            root=turned(root),
            pelvis=facing @ about_y(self._along(t, 1.0, 20.0, -2.0, 3.0, 14.0)),
            trunk=trunk,
            head=facing @ about_y(self._along(t, 1.0, 14.0, -10.0, 8.0, 14.0)),
            ankles={s: turned(ankles[s]) for s in SIDES},
            feet={
                s: facing @ about_z(sign * _TOE_OUT) @ about_y(-self._pitch(t)[:, 0])
                for s, sign in SIDES.items()
            },
            arms={
                s: arm_turns(
                    trunk, sign, swing * self.style.arms**0.5 * (1 + sign * self.style.asymmetry),
                    13.0, 4.0, bend,
                )
                for s, sign in SIDES.items()
            },
        )  # fmt: skip

    def root(self, t: Array) -> Array:
        """Return the middle of the hips in the person's frame, (T, 3): a parabola in flight."""
        stand = self.body["ankle"] + REACH * self._leg - 0.005 * self.body.height
        leave, land = self._edges
        knots: list[Knot] = [
            (-self.up - _PUSH - _DIP, stand, 0, 0),
            (-self.up - _PUSH, stand - self.depth, 0, 9.0),
            (-self.up, leave, GRAVITY * self.up, -GRAVITY),
            (self.down, land, -GRAVITY * self.down, -GRAVITY),
            (self.down + _SINK, stand - 0.62 * self.depth, 0, 7.0),
            (self.down + _SINK + _RISE, stand, 0, 0),
        ]
        back = self._along(t, 0.0, -0.055, 0.012, 0.0, -0.040) * self.body.height
        return np.column_stack([back, np.zeros(len(t)), through(t, knots)])

    def ankles(self, t: Array) -> dict[str, Array]:
        """Return the ankle joints in the person's frame, (T, 3) each; in flight the legs hang."""
        flat = self._standing(t)[0]
        in_air = (t > -self.up) & (t < self.down)
        if in_air.any():
            flat[in_air] = self._hanging(t[in_air])
        along, up = flat.T
        out, width = np.radians(_TOE_OUT), 0.062 * self.body.height
        return {
            s: np.column_stack([along * np.cos(out), sign * (width + along * np.sin(out)), up])
            for s, sign in SIDES.items()
        }

    def _standing(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the ankle over the standing foot and its derivatives, forward and up, (T, 2)."""
        return rolled(self._pitch(t), self.body.height)

    def _hanging(self, t: Array) -> Array:
        """Return the ankle in flight, forward and up, (T, 2); the leg moves smoothly."""
        knots: list[tuple[float, Array, Array, Array]] = []
        for edge in (-self.up, self.down):
            e = 1e-3
            near = np.array([edge + e * k for k in (-2, -1, 0, 1, 2)])
            across = self._standing(near)[0] - self.root(near)[:, [0, 2]]
            polar = np.column_stack(
                [np.linalg.norm(across, axis=1), np.arctan2(across[:, 0], -across[:, 1])]
            )
            rate = np.array([1, -8, 0, 8, -1]) @ polar / (12 * e)
            bend = np.array([-1, 16, -30, 16, -1]) @ polar / (12 * e**2)
            knots.append((edge, polar[2], rate, bend))
        long, rest = np.array([0.985 * self._leg, 0.02]), np.zeros(2)
        inner = [(-self.up + 0.08, long, rest, rest), (self.down - 0.09, long, rest, rest)]
        polar = through(t, [knots[0], *inner, knots[1]])
        across = polar[:, :1] * np.column_stack([np.sin(polar[:, 1]), -np.cos(polar[:, 1])])
        return self.root(t)[:, [0, 2]] + across

    def _pitch(self, t: Array) -> Array:
        """Return the pitch of the feet, its rate and acceleration, degrees, toes up: (T, 3)."""
        knots: list[Knot] = [
            (-self.up - 0.20, 0, 0, 0),
            (-self.up, *_LEAVE, 0),
            (-self.up + 0.09, -62, 0, 0),
            (self.down - 0.09, -44, 0, 0),
            (self.down, *_LAND, 0),
            (self.down + 0.14, 0, 0, 0),
        ]
        return through(t, knots, derivatives=2)

    def _along(
        self,
        t: Array,
        rest: float,
        crouch: float,
        leave: float,
        land: float,
        sink: float,
        ahead: float = 0.0,
    ) -> Array:
        """Interpolate values at rest, crouch, take-off, landing, sinking, and rest again.

        The crouch is reached `ahead` seconds before the legs reach it.
        """
        knots: list[Knot] = [
            (-self.up - _PUSH - _DIP - ahead, rest, 0, 0),
            (-self.up - _PUSH - ahead, crouch, 0, 0),
            (-self.up + 0.06, leave, 0, 0),
            (self.down, land, 0, 0),
            (self.down + _SINK + 0.05, sink, 0, 0),
            (self.down + _SINK + _RISE + 0.1, rest, 0, 0),
        ]
        return through(t, knots)
