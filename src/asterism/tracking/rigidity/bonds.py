"""Bonds: stable distances between markers, estimated from one capture and used in the next."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from asterism.checks import check_kind, check_number, keep_array
from asterism.errors import FormatError, ParameterError
from asterism.io.captures.marker_names import is_unlabelled
from asterism.model import Tracks
from asterism.model.toml_file import read_toml, write_toml
from asterism.records import record
from asterism.tracking.rigidity.cliques import disjoint_cliques
from asterism.tracking.rigidity.distances import (
    BEND,
    MIN_TOGETHER,
    Distances,
    distances_between,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

__all__ = ["Bonds", "learn_bonds"]

MAX_FRAMES = 1000
"""Number of evenly spread frames of a capture in which distances are measured."""
LOOSE = 2.5
"""Largest spread of a rigid pair, as a multiple of that of the steadiest pairs of the capture. The
share `BEND` of its distance is the other bound. Other bonds may vary more than a segment does."""
FORMAT = "asterism bonds"


@record(eq=False)
class Bonds:
    """Pairs of markers with a stable distance (bonds), and one pose of all markers.

    Parameters
    ----------
    names : tuple of str
        Names of the K markers, all different.
    places : array_like of shape (K, D)
        Positions in one pose, metres, relative to its centre; NaN for markers missing in it.
    pairs : array_like of int, shape (M, 2)
        Bonded markers, the lower index first.
    distances : array_like of shape (M,)
        Median distance of each pair, metres.
    spreads : array_like of shape (M,)
        Standard deviation of each distance, metres.
    frames : array_like of int, shape (M,)
        Number of frames from which each distance was measured.

    Raises
    ------
    ParameterError
        If the arrays do not fit each other.

    Examples
    --------
    >>> import asterism as am
    >>> bonds = am.learn_bonds(am.simulate.person(frames=60, seed=1))
    >>> bonds
    Bonds(53 markers, 412 pairs, 206 rigid, 10 clusters)
    >>> trunk = bonds.clusters[0]  # the largest rigid cluster
    >>> [bonds.names[k] for k in trunk]
    ['RFHD', 'RBHD', 'C7', 'T10', 'CLAV', 'STRN', 'RBAK', 'LSHO', 'ARIEL']
    >>> int(bonds.steady.sum()), int(bonds.rigid.sum())
    (409, 206)
    """

    names: tuple[str, ...]
    places: NDArray[np.float64]
    pairs: NDArray[np.int64]
    distances: NDArray[np.float64]
    spreads: NDArray[np.float64]
    frames: NDArray[np.int64]

    def __post_init__(self) -> None:
        names = tuple(self.names)
        if len(set(names)) < len(names) or not all(names):
            got = next((name for i, name in enumerate(names) if name in ("", *names[:i])), "")
            raise ParameterError("names", "names that are all different", repr(got))
        places = np.asarray(self.places, dtype=np.float64)
        if places.ndim != 2 or len(places) != len(names) or places.shape[1] not in (2, 3):
            raise ParameterError("places", f"shape ({len(names)}, 2 or 3)", places.shape)
        pairs = keep_array("pairs", self.pairs, ("M", 2), dtype=np.int64)
        M = len(pairs)
        if M and (pairs.min() < 0 or pairs.max() >= len(names)):
            raise ParameterError("pairs", f"markers from 0 to {len(names) - 1}", pairs.max())
        first = np.unique(pairs, axis=0, return_index=True)[1]
        wrong = np.append(np.flatnonzero(pairs[:, 0] >= pairs[:, 1]), np.setdiff1d(range(M), first))
        if len(wrong):
            expected = "two different markers, the lower first, once"
            raise ParameterError("pairs", expected, tuple(pairs[wrong[0]].tolist()))
        object.__setattr__(self, "names", names)
        object.__setattr__(self, "places", places)
        object.__setattr__(self, "pairs", pairs)
        for name, kind in (
            ("distances", np.float64),
            ("spreads", np.float64),
            ("frames", np.int64),
        ):
            array = keep_array(name, getattr(self, name), (M,), dtype=kind)
            if M and array.min() < 0:
                raise ParameterError(name, "numbers ≥ 0", array.min())
            object.__setattr__(self, name, array)

    @cached_property
    def steady(self) -> NDArray[np.bool_]:
        """True for pairs that are bonds by the engine's criterion, shape (M,)."""
        return Distances(middle=self.distances, spread=self.spreads, n_frames=self.frames).is_bond

    @cached_property
    def rigid(self) -> NDArray[np.bool_]:
        """True for pairs that are as rigid as the steadiest pairs of the capture, shape (M,)."""
        if not len(self.pairs):
            return np.zeros(0, dtype=bool)
        steadiest = np.full(len(self.names), np.inf)
        for side in self.pairs.T:
            np.minimum.at(steadiest, side, self.spreads)
        usual = float(np.quantile(steadiest[np.isfinite(steadiest)], 0.25))
        return self.spreads <= LOOSE * usual + BEND * self.distances

    @cached_property
    def clusters(self) -> tuple[tuple[int, ...], ...]:
        """Rigid clusters: disjoint groups of at least three markers with rigid pairs only."""
        return disjoint_cliques(len(self.names), self.pairs[self.rigid])

    def segments(self, names: Sequence[str | None]) -> NDArray[np.int64]:
        """Return the rigid cluster of each marker name, -1 for a name in none.

        Parameters
        ----------
        names : sequence of (str or None), length K
            For example `Tracks.names`.

        Returns
        -------
        ndarray of int, shape (K,)
            Indices in `clusters`.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.person(seed=1)
        >>> am.learn_bonds(truth).segments(["LFHD", "RFHD", "LKNE", None]).tolist()
        [0, 0, 5, -1]
        """
        of = {self.names[k]: s for s, cluster in enumerate(self.clusters) for k in cluster}
        return np.array([of.get(name or "", -1) for name in names], dtype=np.int64)

    def to_toml(self, path: str | Path | None = None) -> str:
        """Return the bonds as TOML text, and write it to a file if a path is given.

        Parameters
        ----------
        path : str or Path, optional
            File to write; an existing one is replaced.

        Returns
        -------
        str
            Text of the file; distances are rounded to micrometres.

        Raises
        ------
        FormatError
            If the file cannot be written.

        Examples
        --------
        >>> import asterism as am
        >>> bonds = am.learn_bonds(am.simulate.cube(frames=40, seed=1))
        >>> print(bonds.to_toml()[:26])
        format = "asterism bonds"
        """
        markers: list[dict[str, Any]] = []
        for name, place in zip(self.names, self.places, strict=True):
            own: dict[str, Any] = {"name": name}
            if np.isfinite(place).all():
                own["place"] = [round(float(x), 6) for x in place]
            markers.append(own)
        bonds = [
            {
                "between": [self.names[i], self.names[j]],
                "distance": round(float(distance), 6),
                "spread": round(float(spread), 6),
                "frames": int(n),
            }
            for (i, j), distance, spread, n in zip(
                self.pairs, self.distances, self.spreads, self.frames, strict=True
            )
        ]
        content = {"format": FORMAT, "axes": self.places.shape[1], "marker": markers, "bond": bonds}
        return write_toml(content, path)

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read bonds from a TOML file, as `to_toml` writes it.

        Parameters
        ----------
        path : str or Path
            File to read.

        Returns
        -------
        Bonds

        Raises
        ------
        FormatError
            If the file cannot be read, is not TOML, or contains no bonds.

        Examples
        --------
        >>> import asterism as am
        >>> from tempfile import TemporaryDirectory
        >>> bonds = am.learn_bonds(am.simulate.cube(frames=40, seed=1))
        >>> with TemporaryDirectory() as folder:
        ...     text = bonds.to_toml(f"{folder}/cube.toml")
        ...     am.tracking.Bonds.from_toml(f"{folder}/cube.toml")
        Bonds(8 markers, 28 pairs, 28 rigid, 1 clusters)
        """
        content = read_toml(path, "bonds in TOML")
        path = Path(path)
        if content.get("format") != FORMAT:
            got = content.get("format", "none")
            raise FormatError(
                path, "format", f'"{FORMAT}"', got, "write such a file with asterism bonds"
            )
        try:
            return cls(**_from_plain(content))
        except ParameterError as error:
            raise FormatError(path, error.name, error.expected, error.got, error.hint) from error

    def __repr__(self) -> str:
        return (
            f"Bonds({len(self.names)} markers, {len(self.pairs)} pairs, {int(self.rigid.sum())} "
            f"rigid, {len(self.clusters)} clusters)"
        )


def learn_bonds(tracks: Tracks, *, neighbours: int = 12, min_frames: int = MIN_TOGETHER) -> Bonds:
    """Learn the bonds of a capture: the pairs of markers with stable distances.

    For each marker the `neighbours` steadiest pairs are kept: those whose distance has the
    smallest predictive variance.

    Parameters
    ----------
    tracks : Tracks
        Tracks with the names of the markers. Tracks without a name, or with a placeholder of a
        capture software (``*12``, ``Unlabeled 7``), are left out. If no track has a name, all
        are used under the names ``T000``, ``T001`` … by their number.
    neighbours : int
        Smallest number of pairs of each marker, if there are that many, 1 to 1000. The default of
        12 is several times the number of markers on a segment. Larger values add pairs of
        different segments, which identify a marker less.
    min_frames : int
        Smallest number of frames in which both markers of a pair are detected, ≥ 2. With fewer
        frames a distance can be stable by chance.

    Returns
    -------
    Bonds
        Pairs with their distances, and one pose of all markers.

    Raises
    ------
    ParameterError
        If an option is out of range, or two tracks have the same name.

    Examples
    --------
    >>> import asterism as am
    >>> bonds = am.learn_bonds(am.simulate.cube(frames=40, seed=1))
    >>> bonds
    Bonds(8 markers, 28 pairs, 28 rigid, 1 clusters)
    >>> bonds.pairs[0].tolist(), round(float(bonds.distances[0]), 3)
    ([0, 1], 0.3)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_number("neighbours", neighbours, above=1, below=1000, closed=True, integer=True)
    check_number("min_frames", min_frames, above=2, below=1e6, closed=True, integer=True)
    tracks = tracks.measured()
    d = tracks.detections
    every = max(1, -(-d.n_frames // MAX_FRAMES))
    named = [k for k, name in enumerate(tracks.names) if name and not is_unlabelled(name)]
    names = [str(tracks.names[k]) for k in named]
    if not named:
        named, names = list(range(tracks.n_tracks)), [f"T{k:03d}" for k in range(tracks.n_tracks)]
    positions = tracks.positions()[::every, named]
    between = distances_between(positions)
    K = len(named)
    cost = between.predictive_variance
    cost[(between.n_frames * every < min_frames) | np.eye(K, dtype=bool)] = np.inf
    order = np.argsort(cost, axis=1, kind="stable")[:, :neighbours]
    chosen = np.zeros((K, K), dtype=bool)
    np.put_along_axis(chosen, order, values=True, axis=1)
    chosen = (chosen | chosen.T) & np.isfinite(cost)
    i, j = np.nonzero(np.triu(chosen))
    return Bonds(
        names=tuple(names),
        places=_pose(positions, between.middle),
        pairs=np.stack([i, j], axis=1),
        distances=between.middle[i, j],
        spreads=between.spread[i, j],
        frames=between.n_frames[i, j] * every,
    )


def _pose(positions: NDArray[np.float64], usual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the frame with the most markers, and of these the one nearest to usual distances."""
    if not positions.size:
        return np.zeros(positions.shape[1:])
    counts = np.isfinite(positions[..., 0]).sum(axis=1)
    fullest = np.flatnonzero(counts == counts.max())
    fullest = fullest[:: max(1, len(fullest) // 100)]
    off: list[float] = []
    for pose in positions[fullest]:
        distance = np.linalg.norm(pose[:, None] - pose[None], axis=2)
        off.append(float(np.nan_to_num(np.abs(distance - usual)).sum()))
    pose = positions[fullest[int(np.argmin(off))]]
    return pose - np.nanmean(pose, axis=0) if counts.max() else np.full(pose.shape, np.nan)


def _from_plain(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `Bonds` from the content of a file."""
    axes = content.get("axes")
    if type(axes) is not int or axes not in (2, 3):  # 3.0 is equal to 3, and no length
        raise ParameterError("axes", "2 or 3", axes)
    markers, bonds = _tables(content, "marker"), _tables(content, "bond")
    names = [str(_get(own, f"marker {n}", "name")) for n, own in enumerate(markers, 1)]
    number = {name: k for k, name in enumerate(names)}
    places = np.full((len(names), axes), np.nan)
    for n, own in enumerate(markers):
        if "place" in own:
            places[n] = keep_array(f"place of {names[n]}", own["place"], (axes,))
    pairs: list[list[int]] = []
    values: dict[str, list[float]] = {"distance": [], "spread": [], "frames": []}
    for n, own in enumerate(bonds, 1):
        between = _get(own, f"bond {n}", "between")
        if not isinstance(between, list) or len(cast("list[Any]", between)) != 2:
            raise ParameterError(f"bond {n}", "between = two names", repr(between))
        ends = [str(name) for name in cast("list[Any]", between)]
        for name in ends:
            if name not in number:
                raise ParameterError(f"bond {n}", "the names of two markers", name)
        pairs.append(sorted(number[name] for name in ends))
        for key, all_ in values.items():
            value = _get(own, f"bond {n}", key)
            check_number(
                f"{key} of bond {n}", value, above=0, below=2**53, closed=True,
                integer=key == "frames",
            )  # fmt: skip
            all_.append(value)
    return {
        "names": tuple(names),
        "places": places,
        "pairs": np.array(pairs, dtype=np.int64).reshape(-1, 2),
        "distances": np.array(values["distance"], dtype=np.float64),
        "spreads": np.array(values["spread"], dtype=np.float64),
        "frames": np.array(values["frames"], dtype=np.int64),
    }


def _tables(content: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    value = content.get(name, [])
    if not isinstance(value, list) or not all(
        isinstance(own, dict) for own in cast("list[Any]", value)
    ):
        raise ParameterError(name, f"tables [[{name}]]", type(value).__name__)
    return cast("list[dict[str, Any]]", value)


def _get(table: Mapping[str, Any], where: str, key: str) -> Any:
    if key not in table:
        raise ParameterError(where, f"a {key}", "none")
    return table[key]
