"""Marker sets: the named markers of a subject, with what is known of their arrangement."""

from __future__ import annotations

import re
from dataclasses import field, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np

from asterism.checks import check_kind, check_number, check_path, keep_array
from asterism.errors import FormatError, ParameterError
from asterism.model.marker_geometry import candidate_quads, heights, pose_distances, sides_of
from asterism.records import record

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = ["MarkerSet", "other_side", "side_of"]

_SIDE = re.compile(r"^(left|right|l|r)(?=.)|(?<=[_. ])(left|right|l|r)$", re.IGNORECASE)
_OTHER_SIDE = {"l": "r", "r": "l", "left": "right", "right": "left"}


def _none() -> NDArray[np.float64]:
    return np.zeros((0, 0))


@record(eq=False)
class MarkerSet:
    """Named markers with their distances, sides and places: what `name_tracks` names tracks by.

    Learn one with `learn_marker_set`, read one with `read_marker_set`, or give names and places;
    distances and sides then follow from the places.

    Parameters
    ----------
    names : sequence of str
        Names of the M markers, in the order of the files that are written.
    places : array_like of shape (M, 3)
        Positions in one typical posture, metres, NaN where unknown. The axis `up` points up.
    distances : array_like of shape (M, M), optional
        Usual distances, metres, NaN where unknown; by default those of `places`.
    movements : array_like of shape (M, M), optional
        Standard deviations of the distances within a subject who moves, metres. NaN, the default,
        where they are unknown, as after a static trial.
    variations : array_like of shape (M, M), optional
        Standard deviations of the distances between subjects of equal size, metres; 0 by default.
    quads : array_like of int, shape (Q, 4), optional
        A marker and three references, in whose plane the side of the marker is known.
    heights, height_spreads : array_like of shape (Q,), optional
        Signed height of the marker over the plane of its references, right-handed, and its
        standard deviation (NaN where unknown), metres.
    segments : sequence of (str or None), optional
        Rigid segment of each marker.
    presences : array_like of shape (M,), optional
        Share of the captures of moving subjects in which each marker occurs, in [0, 1]; 1 by
        default. Some markers are worn in the static trial alone.
    subject : str
        Name of the subject, which named tracks have before a colon, as in ``Ann:LKNE``; by
        default none.
    n_subjects : int
        Number of subjects from whom the set was learnt.
    up : {"x", "y", "z"}
        Axis of `places` that points up.

    Raises
    ------
    ParameterError
        If the arrays do not fit each other, or two markers have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> made = am.MarkerSet(names=("LKNE", "RKNE"), places=[[0, 0.1, 0.5], [0, -0.1, 0.5]])
    >>> made, made.sides, made.partners
    (MarkerSet(2 markers, 1 subject), ('left', 'right'), (1, 0))
    >>> float(made.distances[0, 1])
    0.2
    """

    names: tuple[str, ...]
    places: NDArray[np.float64]
    distances: NDArray[np.float64] = field(default_factory=_none)
    movements: NDArray[np.float64] = field(default_factory=_none)
    variations: NDArray[np.float64] = field(default_factory=_none)
    quads: NDArray[np.int64] | None = None
    heights: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    height_spreads: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    segments: tuple[str | None, ...] = ()
    presences: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    subject: str = ""
    n_subjects: int = 1
    up: Literal["x", "y", "z"] = "z"

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.names)
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ParameterError("names", "each name once", f"{twice[0]} twice")
        M = len(names)
        places = keep_array("places", self.places, (M, 3), finite=False)
        keep: dict[str, Any] = {"names": names, "places": places}
        given = np.asarray(self.distances)
        keep["distances"] = (
            keep_array("distances", given, (M, M), finite=False)
            if given.size or not M
            else pose_distances(places)
        )
        for name, default in (("movements", np.nan), ("variations", 0.0)):
            values = np.asarray(getattr(self, name))
            values = values if values.size or not M else np.full((M, M), default)
            keep[name] = keep_array(name, values, (M, M), finite=False)
        if self.quads is None:
            keep |= _quads_of(places, keep["distances"])
        else:
            quads = keep_array("quads", self.quads, ("Q", 4), dtype=np.int64)
            if quads.size and not 0 <= quads.min() <= quads.max() < M:
                raise ParameterError("quads", f"markers from 0 to {M - 1}", int(quads.max()))
            keep["quads"] = quads
            for name in ("heights", "height_spreads"):
                keep[name] = keep_array(name, getattr(self, name), (len(quads),), finite=False)
        presences = np.asarray(self.presences)
        presences = presences if presences.size or not M else np.ones(M)
        keep["presences"] = keep_array("presences", presences, (M,))
        if M and not 0 <= keep["presences"].min() <= keep["presences"].max() <= 1:
            raise ParameterError("presences", "shares from 0 to 1", keep["presences"].min())
        segments = tuple(self.segments) or (None,) * M
        if len(segments) != M:
            raise ParameterError("segments", f"one for each of {M} markers", len(segments))
        check_number("n_subjects", self.n_subjects, above=1, closed=True, integer=True)
        check_kind("subject", self.subject, str)
        if self.up not in ("x", "y", "z"):
            raise ParameterError("up", '"x", "y" or "z"', repr(self.up))
        for name, value in (keep | {"segments": segments}).items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        """Return the number of markers."""
        return len(self.names)

    @property
    def full_names(self) -> tuple[str, ...]:
        """Names with the subject before a colon, if it has a name."""
        return tuple(f"{self.subject}:{n}" if self.subject else n for n in self.names)

    @property
    def knows_movement(self) -> bool:
        """Whether the set was learnt from a subject who moved."""
        return bool(np.isfinite(self.movements[~np.eye(len(self), dtype=bool)]).any())

    @property
    def sides(self) -> tuple[str | None, ...]:
        """Side of each marker by its name: ``"left"``, ``"right"`` or None."""
        return tuple(side_of(name) for name in self.names)

    @property
    def partners(self) -> tuple[int, ...]:
        """Marker at the same place of the other side, by its name; -1 for none."""
        number = {name: k for k, name in enumerate(self.names)}
        return tuple(number.get(other_side(name) or "", -1) for name in self.names)

    def select(self, markers: list[int]) -> MarkerSet:
        """Return the set with some of its markers, in the order given.

        Parameters
        ----------
        markers : list of int
            Numbers of the markers, each once.

        Examples
        --------
        >>> import asterism as am
        >>> am.MarkerSet(names=("A", "B"), places=[[0, 0, 0], [1, 0, 0]]).select([1]).names
        ('B',)
        """
        number = np.full(len(self), -1)
        number[markers] = np.arange(len(markers))
        assert self.quads is not None
        kept = (number[self.quads] >= 0).all(axis=1)
        at = np.ix_(markers, markers)
        return MarkerSet(
            names=tuple(self.names[m] for m in markers),
            places=self.places[markers],
            distances=self.distances[at],
            movements=self.movements[at],
            variations=self.variations[at],
            quads=number[self.quads[kept]],
            heights=self.heights[kept],
            height_spreads=self.height_spreads[kept],
            segments=tuple(self.segments[m] for m in markers),
            presences=self.presences[markers],
            subject=self.subject,
            n_subjects=self.n_subjects,
            up=self.up,
        )

    def of_subject(self, subject: str) -> MarkerSet:
        """Return the set with another name of its subject.

        Parameters
        ----------
        subject : str
            Name of the subject, empty for none.

        Examples
        --------
        >>> import asterism as am
        >>> am.MarkerSet(names=("C7",), places=[[0, 0, 1]]).of_subject("Ann").full_names
        ('Ann:C7',)
        """
        return replace(self, subject=subject)

    def to_toml(self, path: str | Path | None = None) -> str:
        """Return the set as TOML text, and write it to `path` if one is given.

        Parameters
        ----------
        path : str or Path, optional
            File to write; it is replaced as a whole.

        Raises
        ------
        FormatError
            If the file cannot be written.

        Examples
        --------
        >>> import asterism as am
        >>> made = am.MarkerSet(names=("A", "B"), places=[[0, 0, 0], [1, 0, 0]])
        >>> made.to_toml().splitlines()[0]
        'format = "asterism marker set 1"'
        """
        from asterism.model.marker_set_file import to_text
        from asterism.model.toml_file import write_text

        return write_text(to_text(SimpleNamespace(**vars(self))), path)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a set from a TOML file: one that `to_toml` wrote, or names and places by hand.

        Parameters
        ----------
        path : str or Path
            File to read.

        Raises
        ------
        FormatError
            If the file cannot be read, is not TOML, or contains no marker set.

        Examples
        --------
        >>> import asterism as am
        >>> from tempfile import TemporaryDirectory
        >>> made = am.MarkerSet(names=("A", "B"), places=[[0, 0, 0], [1, 0, 0]])
        >>> with TemporaryDirectory() as folder:
        ...     text = made.to_toml(f"{folder}/set.toml")
        ...     am.MarkerSet.from_toml(f"{folder}/set.toml")
        MarkerSet(2 markers, 1 subject)
        """
        from asterism.model.marker_set_file import read_fields

        path = check_path("path", path)
        try:
            return cls(**read_fields(path))
        except ParameterError as error:
            raise FormatError(path, error.name, error.expected, error.got, error.hint) from error

    def __repr__(self) -> str:
        n = self.n_subjects
        return f"MarkerSet({len(self)} markers, {n} subject{'s' if n != 1 else ''})"


def _quads_of(places: NDArray[np.float64], distances: NDArray[np.float64]) -> dict[str, Any]:
    """Return quads, heights and their unknown spreads, from the places of one posture."""
    cost = np.where(np.eye(len(places), dtype=bool) | ~np.isfinite(distances), np.inf, distances)
    quads = candidate_quads(cost)
    middle = heights(places, quads)
    return sides_of(quads, middle, np.full(len(quads), np.nan), distances)


def side_of(name: str) -> str | None:
    """Return ``"left"`` or ``"right"`` for a name such as LKNE or knee_R, None for others.

    Examples
    --------
    >>> side_of("Ann:LKNE"), side_of("knee_R"), side_of("C7")
    ('left', 'right', None)
    """
    match = _SIDE.search(name.rpartition(":")[2])
    return None if match is None else "left" if match[0].lower()[0] == "l" else "right"


def other_side(name: str) -> str | None:
    """Return the name of the marker at the same place of the other side, None if it has no side.

    Examples
    --------
    >>> other_side("Ann:LKNE"), other_side("knee_right"), other_side("C7")
    ('Ann:RKNE', 'knee_left', None)
    """
    subject, colon, own = name.rpartition(":")
    match = _SIDE.search(own)
    if match is None:
        return None
    side = match[0]
    other = _OTHER_SIDE[side.lower()]
    other = other.upper() if side.isupper() else other.title() if side.istitle() else other
    return subject + colon + own[: match.start()] + other + own[match.end() :]
