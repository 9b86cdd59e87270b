"""Markers on a body: names, segments, positions, and the lines of the stick figure.

The first 39 are those of the conventional gait model (Davis et al., *A gait analysis data
collection and reduction technique*, Hum. Mov. Sci. 10, 1991, and its full-body successors). Each
marker lies where a ray from inside the segment leaves its capsules.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from asterism.simulate.people.skeleton import SIDES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.simulate.people.curves import Array
    from asterism.simulate.people.skeleton import Body, Pose

    Point: TypeAlias = tuple[float, float, float]

__all__ = ["FEWEST", "LIFT", "MOST", "MarkerSet", "lines_between", "on_skin"]

FEWEST, MOST = 40, 90
LIFT = 0.002
"""Distance of the centre of a marker from the skin, metres."""

# Name, segment, where the ray starts and where it points: shares of the height, frame of the
# segment. With "?" for the side it stands for two, of which the left is given.
_CORE: tuple[tuple[str, str, Point, Point], ...] = (
    ("?FHD", "head", (0.0, 0, 0.055), (1, 0.75, 0.05)),
    ("?BHD", "head", (0.0, 0, 0.055), (-1, 0.75, 0.05)),
    ("C7", "trunk", (0, 0, 0.243), (-1, 0, 0.12)),
    ("T10", "trunk", (0, 0, 0.120), (-1, 0, 0)),
    ("CLAV", "trunk", (0, 0, 0.200), (1, 0, 0.15)),
    ("STRN", "trunk", (0, 0, 0.125), (1, 0, 0)),
    ("RBAK", "trunk", (0, -0.040, 0.165), (-1, -0.3, 0)),
    ("?SHO", "trunk", (0, 0.070, 0.224), (0.05, 0, 1)),
    ("?UPA", "?arm", (0, 0, -0.100), (-0.15, 1, 0)),
    ("?ELB", "?arm", (0, 0, -0.183), (-0.1, 1, 0)),
    ("?FRM", "?forearm", (0, 0, -0.070), (-0.4, 1, 0)),
    ("?WRA", "?forearm", (0, 0, -0.140), (1, 0.25, 0)),
    ("?WRB", "?forearm", (0, 0, -0.140), (-1, 0.25, 0)),
    ("?FIN", "?hand", (0.003, 0, -0.060), (0.15, 1, 0)),
    ("?ASI", "pelvis", (0, 0.050, 0.070), (1, 0.35, 0.05)),
    ("?PSI", "pelvis", (0, 0.034, 0.068), (-1, 0, 0.05)),
    ("?THI", "?thigh", (0, 0, -0.130), (0.05, 1, 0)),
    ("?KNE", "?thigh", (0, 0, -0.240), (-0.1, 1, 0)),
    ("?TIB", "?shank", (0, 0, -0.125), (0.1, 1, 0)),
    ("?ANK", "?shank", (0, 0, -0.243), (-0.1, 1, 0)),
    ("?HEE", "?foot", (-0.014, 0, -0.019), (-1, 0, 0.1)),
    ("?TOE", "?foot", (0.070, 0, -0.019), (0, 0, 1)),
    ("SACR", "pelvis", (0, 0, 0.040), (-1, 0, 0)),
)
_MORE: tuple[tuple[str, str, Point, Point], ...] = (
    ("?MT5", "?foot", (0.062, 0, -0.019), (0, 1, 0.35)),
    ("?MT1", "?foot", (0.070, 0, -0.019), (0, -1, 0.45)),
    ("?KNM", "?thigh", (0, 0, -0.240), (-0.1, -1, 0)),
    ("?ANM", "?shank", (0, 0, -0.240), (0.1, -1, 0)),
    ("?ELM", "?arm", (0, 0, -0.183), (-0.2, -1, 0)),
    ("?TRO", "?thigh", (0, 0, -0.012), (-0.1, 1, 0)),
    ("ARIEL", "head", (0.004, 0, 0.066), (0, 0, 1)),
    ("?TH1", "?thigh", (0, 0, -0.085), (0.7, 1, 0)),
    ("?SH1", "?shank", (0, 0, -0.090), (0.9, 1, 0)),
    ("?TH2", "?thigh", (0, 0, -0.165), (0.8, 1, 0)),
    ("?SH2", "?shank", (0, 0, -0.165), (0.8, 1, 0)),
    ("?TH3", "?thigh", (0, 0, -0.175), (-0.5, 1, 0)),
    ("?SH3", "?shank", (0, 0, -0.185), (-0.6, 1, 0)),
    ("?UA1", "?arm", (0, 0, -0.080), (0.9, 1, 0)),
    ("?UA2", "?arm", (0, 0, -0.135), (0.6, 1, 0)),
    ("?UA3", "?arm", (0, 0, -0.130), (-0.9, 1, 0)),
    ("?FA1", "?forearm", (0, 0, -0.050), (0.7, 1, 0)),
    ("?FA2", "?forearm", (0, 0, -0.100), (0.5, 1, 0)),
    ("?FA3", "?forearm", (0, 0, -0.095), (-0.9, 1, 0)),
    ("?TH4", "?thigh", (0, 0, -0.105), (-0.4, 1, 0)),
    ("?SH4", "?shank", (0, 0, -0.085), (-0.3, 1, 0)),
    ("?IDX", "?hand", (0.003, 0, -0.068), (1, 0.55, 0)),
    ("?PNK", "?hand", (0.003, 0, -0.066), (-1, 0.55, 0)),
    ("?ILC", "pelvis", (0, 0.037, 0.062), (0, 1, 0.3)),
    ("L3", "trunk", (0, 0, 0.045), (-1, 0, 0)),
    ("LBAK", "trunk", (0, 0.040, 0.165), (-1, 0.3, 0)),
    ("T4", "trunk", (0, 0, 0.185), (-1, 0, 0.1)),
)

_LINES = (
    "?FHD ?BHD", "LFHD RFHD", "LBHD RBHD", "?BHD C7", "?FHD ARIEL", "?BHD ARIEL",
    "C7 CLAV", "CLAV STRN", "C7 T10", "?SHO C7", "?SHO CLAV", "T10 SACR",
    "?SHO ?UPA", "?UPA ?ELB", "?ELB ?FRM", "?FRM ?WRB", "?ELB ?WRA", "?WRA ?WRB", "?WRA ?FIN",
    "?WRB ?FIN", "LASI RASI", "?ASI ?PSI", "?PSI SACR", "STRN ?ASI",
    "?ASI ?THI", "?THI ?KNE", "?KNE ?TIB", "?TIB ?ANK", "?ANK ?HEE", "?HEE ?TOE", "?ANK ?TOE",
    "?MT5 ?HEE", "?MT5 ?TOE", "?MT1 ?TOE", "?MT1 ?HEE", "?KNE ?KNM", "?ANK ?ANM", "?KNM ?ANM",
    "?ELB ?ELM", "?TRO ?THI", "?TH1 ?TH2", "?TH2 ?TH3", "?TH3 ?TH4", "?TH4 ?TH1", "?SH1 ?SH2",
    "?SH2 ?SH3", "?SH3 ?SH4", "?SH4 ?SH1", "?UA1 ?UA2", "?UA2 ?UA3", "?UA3 ?UA1", "?FA1 ?FA2",
    "?FA2 ?FA3", "?FA3 ?FA1", "?FIN ?IDX", "?FIN ?PNK", "?ASI ?ILC", "?ILC ?PSI", "RBAK LBAK",
)  # fmt: skip
_COLOURS = {"L": 1, "R": 2, "": 3}


@dataclass(frozen=True, eq=False, kw_only=True)
class MarkerSet:
    """Markers of a body.

    Parameters
    ----------
    body : Body
        Body that carries the markers.
    n_markers : int
        Number of markers, 40 to 90; the markers of a smaller set are the first of a larger one.

    Attributes
    ----------
    names : tuple of str
        Names of the markers.
    segments : tuple of str
        Segment of each marker.
    places : ndarray of shape (K, 3)
        Position of each marker in the frame of its segment, metres.
    """

    body: Body
    n_markers: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers."""
        return tuple(name for name, *_ in _both(_CORE) + _both(_MORE))[: self.n_markers]

    @property
    def segments(self) -> tuple[str, ...]:
        """Segments of the markers."""
        return tuple(segment for _, segment, *_ in _both(_CORE) + _both(_MORE))[: self.n_markers]

    @property
    def places(self) -> Array:
        """Positions of the markers in the frames of their segments, shape (K, 3)."""
        return _places(self.body)[: self.n_markers]

    @property
    def colours(self) -> list[int]:
        """Colour of each marker: 1 on the left, 2 on the right, 3 in the middle."""
        return [_COLOURS[_side(name)] for name in self.names]

    def at(self, pose: Pose) -> Array:
        """Return the markers of a pose.

        Parameters
        ----------
        pose : Pose
            Pose of the body in T frames.

        Returns
        -------
        ndarray of shape (T, K, 3)
            World metres.
        """
        places, segments = self.places, self.segments
        out = np.empty((len(pose.origins["pelvis"]), self.n_markers, 3))
        for segment in dict.fromkeys(segments):
            chosen = [k for k, s in enumerate(segments) if s == segment]
            out[:, chosen] = pose.place(segment, places[chosen])
        return out


def lines_between(names: Sequence[str]) -> list[tuple[int, int, int]]:
    """Return the lines of the stick figure between the given markers.

    Parameters
    ----------
    names : sequence of str
        Names of the markers.

    Returns
    -------
    list of (marker, marker, colour)
        Numbers of the markers, and colours from 1.
    """
    number = {name: k for k, name in enumerate(names)}
    lines: list[tuple[int, int, int]] = []
    for line in _LINES:
        for side in SIDES if "?" in line else ("",):
            first, second = line.replace("?", side).split()
            if first in number and second in number:
                lines.append((number[first], number[second], _COLOURS[side]))
    return lines


def on_skin(tubes: Sequence[tuple[Array, float]], start: Array, towards: Array) -> Array:
    """Return the position at `LIFT` above the capsules where a ray from inside leaves them.

    Parameters
    ----------
    tubes : sequence of (ends, radius)
        Capsules: ends (2, 3), metres.
    start, towards : ndarray of shape (3,)
        Origin and direction of the ray.

    Returns
    -------
    ndarray of shape (3,)
        Metres.
    """
    direction = towards / np.linalg.norm(towards)

    def above(s: Array) -> Array:
        points = start + s[:, None] * direction
        gaps: list[Array] = []
        for ends, radius in tubes:
            axis = ends[1] - ends[0]
            share = np.clip((points - ends[0]) @ axis / max(float(axis @ axis), 1e-12), 0, 1)
            away = points - ends[0] - share[:, None] * axis
            gaps.append(np.linalg.norm(away, axis=1) - radius)
        return np.min(gaps, axis=0) - LIFT

    s = np.linspace(0.0, 0.4, 401)
    for _ in range(5):  # each time a hundredth of the interval in which the sign changes last
        i = int(np.flatnonzero(above(s) < 0)[-1])
        s = np.linspace(s[i], s[i + 1], 101)
    return start + s[50] * direction


@lru_cache(maxsize=16)
def _places(body: Body) -> Array:
    """Return the positions of all markers in the frames of their segments, shape (90, 3)."""
    places = np.array(
        [
            on_skin(
                body.tubes(segment),
                np.array(start) * body.height,
                np.array(towards, dtype=np.float64),
            )
            for _, segment, start, towards in _both(_CORE) + _both(_MORE)
        ]
    )
    places.flags.writeable = False
    return places


def _side(name: str) -> str:
    return name[0] if any(("?" + name[1:]) == row[0] for row in _CORE + _MORE) else ""


def _both(
    rows: tuple[tuple[str, str, Point, Point], ...],
) -> list[tuple[str, str, Point, Point]]:
    out: list[tuple[str, str, Point, Point]] = []
    for name, segment, (x, y, z), (u, v, w) in rows:
        if "?" not in name:
            out.append((name, segment, (x, y, z), (u, v, w)))
            continue
        for side, sign in SIDES.items():
            at, to = (x, sign * y, z), (u, sign * v, w)
            out.append((name.replace("?", side), segment.replace("?", side), at, to))
    return out
