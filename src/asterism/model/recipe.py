"""Recipe of a tracking result, from which it is repeated bit for bit."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self, cast

import numpy as np

from asterism.checks import check_fields, check_number
from asterism.errors import ParameterError
from asterism.model.tracking_model import TrackingModel
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model.detections import Detections
    from asterism.model.edit import Edit

__all__ = ["InputHash", "Recipe", "hash_of_edits", "sha256_of", "versions"]

NONE = "none"
"""Text for an option that is None, here and on the command line."""


class InputHash:
    """SHA-256 of the input of a tracking, computed when it is first read.

    Most results are never repeated, and the hash of a large capture takes longer than its
    association. Detections and labels are read-only, so the time at which it is computed has no
    effect.

    Parameters
    ----------
    source : str or tuple of Detections and ndarray or None
        Hash in hexadecimal, or the detections and the initial labels, if any.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.Detections.from_frames([0.0], [[[0, 0, 1]]])
    >>> InputHash((d, None)) == InputHash(sha256_of(d))
    True
    """

    def __init__(self, source: str | tuple[Detections, NDArray[np.int64] | None]) -> None:
        self._source = source

    @property
    def sha256(self) -> str:
        """Hash in hexadecimal."""
        if not isinstance(self._source, str):
            self._source = sha256_of(*self._source)
        return self._source

    def __eq__(self, other: object) -> bool:
        return isinstance(other, InputHash) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __repr__(self) -> str:
        return f"InputHash({self.sha256!r})"

    def __reduce__(self) -> tuple[type[InputHash], tuple[str]]:
        return InputHash, (self.sha256,)  # a stored recipe does not contain the capture


@record
class Recipe:
    """Complete settings of a tracking; ``am.track(detections, recipe=recipe)`` repeats it.

    Parameters
    ----------
    method : str
        Name of the method.
    options : dict
        All options of the method.
    model : TrackingModel
        Model whose posterior is searched.
    stitch : bool
        Whether tracklets are stitched after the association.
    seed : int, optional
        Seed of the methods that draw random numbers, None for the others.
    has_start : bool
        Whether the method starts from given tracks, which are then needed to repeat it.
    reason : str
        Reason why this method was selected; empty if the caller named the method.
    markers : str
        SHA-256 of the marker sets by which the tracks are named, or of the own names of the
        capture; either is then needed to repeat the recipe. Empty if no track is named.
    edits : str
        SHA-256 of the edits, which are then needed to repeat the recipe. Empty without edits.
    fill : bool
        Whether gaps are filled.
    input_hash : InputHash
        Hash of the detections and of the initial labels.
    versions : dict of str
        Versions of the software on which the result can depend.
    retry : bool
        Whether identities that are uncertain are estimated in further ways: by another method, and
        by a marker set learnt from the tracks. The most certain result is kept, and its recipe
        names the method that made it. `MCMCDA` searches with ever more moves, until two independent
        searches agree; the recipe is that of the most probable result.
    passes : int
        Number of passes of the method over the capture. Before each further pass it learns bonds
        from the tracks of the pass before.
    common_motion : bool
        Whether the motion that most markers have in common is removed before (
        `asterism.tracking.without_common_motion`). The model then holds without it.

    Examples
    --------
    >>> import asterism as am
    >>> d = am.simulate.cube(frames=20, seed=1).detections
    >>> recipe = am.track(d, "gnn").recipe
    >>> recipe.method
    'gnn'
    >>> am.track(d, recipe=recipe).recipe == recipe
    True
    >>> recipe.chosen  # the caller named the method
    ''
    """

    method: str
    options: dict[str, Any]
    model: TrackingModel
    stitch: bool
    seed: int | None
    has_start: bool
    reason: str
    markers: str
    edits: str
    fill: bool
    input_hash: InputHash
    versions: dict[str, str]
    retry: bool = False
    passes: int = 1
    common_motion: bool = False

    @property
    def sha256(self) -> str:
        """Hash of the detections and of the initial labels (`sha256_of`)."""
        return self.input_hash.sha256

    @property
    def label(self) -> str:
        """Method in a few words, with the number of frames of `SMP` and of several passes."""
        window = self.options.get("window")
        frames = f", window={window}" if self.method == "smp" and window else ""
        return self.method + frames + (f", {self.passes} passes" if self.passes > 1 else "")

    @property
    def chosen(self) -> str:
        """Method and reason in one line; empty if the caller named the method."""
        stitched = ", then stitched" if self.stitch else ""
        return f"{self.label}{stitched}: {self.reason}" if self.reason else ""

    def to_dict(self) -> dict[str, dict[str, Any]]:
        """Return the recipe as nested plain values, in the form of a TOML file.

        Examples
        --------
        >>> import asterism as am
        >>> recipe = am.track(am.simulate.cube(frames=20, seed=1).detections, "gnn").recipe
        >>> list(recipe.to_dict())
        ['input', 'method', 'names', 'model', 'versions']
        """
        return {
            "input": {"sha256": self.sha256},
            "method": {
                "name": self.method,
                **({} if self.seed is None else {"seed": self.seed}),
                "start": self.has_start,
                "stitch": self.stitch,
                "retry": self.retry,
                "passes": self.passes,
                "common_motion": self.common_motion,
                **({"reason": self.reason} if self.reason else {}),
                # TOML has no null value.
                "options": _replaced(self.options, None, NONE),
            },
            "names": {"markers": self.markers, "edits": self.edits, "fill": self.fill},
            "model": self.model.to_dict(),
            "versions": self.versions,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Build a recipe from nested plain values; the inverse of `to_dict`.

        Parameters
        ----------
        values : mapping
            Content of a recipe file by section.

        Raises
        ------
        ParameterError
            If a value is unknown, missing or impossible.

        Examples
        --------
        >>> import asterism as am
        >>> recipe = am.track(am.simulate.cube(frames=20, seed=1).detections, "gnn").recipe
        >>> am.model.Recipe.from_dict(recipe.to_dict()) == recipe
        True
        """
        sections = ("input", "method", "names", "model", "versions")
        check_fields("recipe", map(str, values), sections)
        method, names = _table(values, "method"), _table(values, "names")
        check_fields("names", map(str, names), ("markers", "edits", "fill"))
        keys = (
            "name",
            "seed",
            "start",
            "stitch",
            "retry",
            "passes",
            "common_motion",
            "reason",
            "options",
        )
        check_fields("method", map(str, method), keys)
        if (seed := method.get("seed")) is not None:
            check_number("method.seed", seed, above=0, closed=True, integer=True)
        passes = method.get("passes", 1)
        check_number("method.passes", passes, above=1, closed=True, integer=True)
        return cls(
            method=_value(method, "method.name", str),
            options=_replaced(_table(method, "options"), NONE, None),
            model=TrackingModel.from_dict(_table(values, "model")),
            stitch=_value(method, "method.stitch", bool),
            seed=seed,
            has_start=_value(method, "method.start", bool),
            reason=_value({"reason": "", **method}, "method.reason", str),
            markers=_value(names, "names.markers", str),
            edits=_value({"edits": "", **names}, "names.edits", str),
            fill=_value(names, "names.fill", bool),
            input_hash=InputHash(_value(_table(values, "input"), "input.sha256", str)),
            versions={str(k): str(v) for k, v in _table(values, "versions").items()},
            retry=_value({"retry": False, **method}, "method.retry", bool),
            passes=passes,
            common_motion=_value({"common_motion": False, **method}, "method.common_motion", bool),
        )


def sha256_of(detections: Detections, start: NDArray[np.int64] | None = None) -> str:
    """Return the SHA-256 of detections and of optional initial labels, in hexadecimal.

    Examples
    --------
    >>> import asterism as am
    >>> len(sha256_of(am.Detections.from_frames([0.0], [[[0, 0, 1]]])))
    64
    """
    d = detections.measured()
    arrays = [d.times, d.offsets, d.points, d.covariances, start]
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(b"-" if array is None else f"{array.dtype.str}{array.shape}".encode())
        if array is not None:
            digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def hash_of_edits(edits: Sequence[Edit]) -> str:
    """Return the SHA-256 of what edits state, in hexadecimal; empty for none.

    Examples
    --------
    >>> from asterism.model import Edit
    >>> hash_of_edits([]), len(hash_of_edits([Edit(kind="clutter", at=((3, 0),))]))
    ('', 64)
    """
    lines = "".join(f"{each.kind} {each.at} {each.name}\n" for each in edits)
    return hashlib.sha256(lines.encode()).hexdigest() if lines else ""


def versions() -> dict[str, str]:
    """Return the versions of the software on which a result can depend.

    Examples
    --------
    >>> "asterism" in versions()
    True
    """
    import scipy

    from asterism import __version__

    return {
        "asterism": __version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "platform": platform.platform(),
    }


def _replaced(options: Mapping[str, Any], old: object, new: object) -> dict[str, Any]:
    """Return options, including nested tables, with one value replaced by another."""
    return {
        str(name): _replaced(cast("Mapping[str, Any]", value), old, new)
        if isinstance(value, Mapping)
        else new
        if type(value) is type(old) and value == old
        else value
        for name, value in options.items()
    }


def _table(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    return _value(values, name, dict)


def _value(values: Mapping[str, Any], name: str, kind: type) -> Any:
    value = values.get(name.rpartition(".")[2])
    if not isinstance(value, kind):
        expected = {dict: "a table", str: "a text", bool: "true or false"}[kind]
        raise ParameterError(name, expected, repr(value))
    return value
