"""A study: scenes or captures × corruptions × methods × seeds, from a TOML file."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import itertools
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from asterism.checks import check_fields, check_number
from asterism.errors import FormatError, ParameterError
from asterism.metrics import Evaluation
from asterism.model.recipe import versions
from asterism.model.toml_file import read_toml
from asterism.records import record
from asterism.simulate import SCENES, corrupt
from asterism.tracking.methods import METHODS, options_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

__all__ = ["Case", "Study", "read_study"]

SCORES = ("idf1", "mota", "hota", "switches")
"""Default scores of a study."""
_GIVEN = ("truth", "seed", "rig")  # arguments of `corrupt` that no study sets
RING = "cameras"
"""Option of a corruption in place of a rig: the number of cameras around the scene."""
_SECTIONS = ("scenes", "corruptions", "methods", "seeds", "scores")
_KNOWN_SCORES = tuple(
    field.name
    for field in dataclasses.fields(Evaluation)
    if str(field.type) in ("float", "int") and not field.name.startswith("frame_")
)


@record
class Case:
    """One case of a study: one result, and its scores.

    Parameters
    ----------
    scene, corruption, method : str
        Names in the study.
    seed : int
        Seed of the scene, the corruption and the method.
    varied : dict
        Values of the options that the study varies, by ``table.option``.
    settings : dict
        All settings by table: ``scene``, ``corruption`` and ``method``.
    key : str
        SHA-256 of all that determines the scores.
    """

    scene: str
    corruption: str
    method: str
    seed: int
    varied: dict[str, Any]
    settings: dict[str, dict[str, Any]]
    key: str


@record
class Study:
    """Settings of a Monte Carlo study; a value that is a list is varied over its items.

    Parameters
    ----------
    scenes : dict of dict
        Scenes by name. ``scene`` is a key of `asterism.simulate.SCENES`, and the others are its
        options; or ``capture`` is the path of a labelled capture.
    methods : dict of dict
        Methods by name. ``method`` is a key of `asterism.tracking.METHODS`, or ``auto``;
        ``stitch`` is that of `asterism.track`, and the others are options of the method.
    corruptions : dict of dict
        Options of `asterism.simulate.corrupt` by name; by default nothing is corrupted. ``burst``,
        ``ghosts`` and ``visits`` are tables of their fields. ``cameras`` is a number of cameras on
        a ring around the scene, two of which must see a marker.
    seeds : tuple of int
        Seeds; each case is repeated with each.
    scores : tuple of str
        Scores of `asterism.metrics.Evaluation`.

    Raises
    ------
    ParameterError
        If a name or a value is unknown.

    Examples
    --------
    >>> import asterism as am
    >>> study = am.sweep.Study(
    ...     scenes={"cube": {"scene": "cube", "frames": 30}},
    ...     corruptions={"missing": {"missing": [0.1, 0.3]}},
    ...     methods={"gnn": {"method": "gnn"}, "smp": {"method": "smp"}},
    ...     seeds=(1, 2, 3),
    ... )
    >>> cases = study.cases()
    >>> len(cases), cases[0].varied
    (12, {'corruption.missing': 0.1})
    """

    scenes: dict[str, dict[str, Any]]
    methods: dict[str, dict[str, Any]]
    corruptions: dict[str, dict[str, Any]] = dataclasses.field(
        default_factory=lambda: {"none": cast("dict[str, Any]", {})}
    )
    seeds: tuple[int, ...] = (0,)
    scores: tuple[str, ...] = SCORES

    def __post_init__(self) -> None:
        for name in ("scenes", "corruptions", "methods"):
            tables = getattr(self, name)
            if not isinstance(tables, dict) or not tables:
                raise ParameterError(name, "one table at least", repr(tables))
            for key, table in cast("dict[str, Any]", tables).items():
                if not isinstance(table, dict):
                    raise ParameterError(f"{name}.{key}", "a table", repr(table))
        for name, table in self.scenes.items():
            if ("scene" in table) == ("capture" in table):
                raise ParameterError(f"scenes.{name}", "either scene or capture", repr(table))
            if "scene" in table:
                chosen = _values(table["scene"])
                check_fields(f"scenes.{name}.scene", chosen, SCENES)
                for each in chosen:
                    known = [*inspect.signature(SCENES[each].make).parameters, "scene"]
                    known.remove("seed")
                    check_fields(f"scenes.{name}", table, known)
            else:
                check_fields(f"scenes.{name}", table, ("capture",))
        for name, table in self.corruptions.items():
            known = [each for each in inspect.signature(corrupt).parameters if each not in _GIVEN]
            known.append(RING)
            check_fields(f"corruptions.{name}", table, known)
        for name, table in self.methods.items():
            chosen = _values(table.get("method", "auto"))
            check_fields(f"methods.{name}.method", chosen, ("auto", *METHODS))
            for each in chosen:
                options = [] if each == "auto" else options_of(METHODS[each]())
                check_fields(f"methods.{name}", table, ["method", "stitch", *options])
        if not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise ParameterError("seeds", "different numbers", repr(self.seeds))
        for seed in self.seeds:
            check_number("seeds", seed, above=0, closed=True, integer=True)
        check_fields("scores", self.scores, _KNOWN_SCORES)

    def cases(self) -> list[Case]:
        """Return all cases, in the order of the tables and of the seeds.

        Raises
        ------
        FormatError
            If a capture cannot be read.
        """
        hashes: dict[str, str] = {}
        made: list[Case] = []
        for scene, corruption, method in itertools.product(
            self.scenes, self.corruptions, self.methods
        ):
            tables = {
                "scene": self.scenes[scene],
                "corruption": self.corruptions[corruption],
                "method": self.methods[method],
            }
            for varied, settings in _expanded(tables):
                capture = settings["scene"].get("capture")
                if capture is not None and capture not in hashes:
                    hashes[capture] = _hash_of_file(capture)
                for seed in self.seeds:
                    plain = {
                        **settings, "seed": seed, "capture": hashes.get(str(capture)),
                        "versions": versions(), "scores": self.scores,
                    }  # fmt: skip
                    text = json.dumps(plain, sort_keys=True)
                    made.append(
                        Case(
                            scene=scene, corruption=corruption, method=method, seed=seed,
                            varied=varied, settings=settings,
                            key=hashlib.sha256(text.encode()).hexdigest(),
                        )
                    )  # fmt: skip
        return made


def read_study(path: str | Path) -> Study:
    """Read a study from a TOML file; paths of captures are relative to it.

    Parameters
    ----------
    path : path
        File with the tables ``scenes``, ``corruptions`` and ``methods``, and with ``seeds``, a
        number of seeds from 1 on or a list of them, and ``scores``.

    Returns
    -------
    Study

    Raises
    ------
    FormatError
        If the file cannot be read, or is not a study.
    """
    values = read_toml(path, "a study")
    path = Path(path)
    try:
        check_fields("study", values, _SECTIONS)
        for name in ("scenes", "methods"):
            if name not in values:
                raise ParameterError(name, "one table at least", "nothing")
        seeds = values.get("seeds", 1)
        if isinstance(seeds, int):
            check_number("seeds", seeds, above=0, integer=True)
            seeds = range(1, seeds + 1)
        for table in values["scenes"].values():
            if isinstance(table, dict) and "capture" in table:
                given = _values(cast("dict[str, Any]", table)["capture"])
                table["capture"] = [str(path.parent / each) for each in given]
        scores = values.get("scores", SCORES)
        for name, each in (("seeds", seeds), ("scores", scores)):
            if not isinstance(each, (list, tuple, range)):
                raise ParameterError(name, "a list", repr(each))
        given = {key: values[key] for key in ("scenes", "corruptions", "methods") if key in values}
        return Study(**given, seeds=tuple(seeds), scores=tuple(scores))
    except ParameterError as error:
        raise FormatError(path, error.name, error.expected, error.got, error.hint) from error


def _values(value: Any) -> list[Any]:
    return cast("list[Any]", value) if isinstance(value, list) else [value]


def _expanded(
    tables: Mapping[str, Mapping[str, Any]],
) -> Iterator[tuple[dict[str, Any], dict[str, dict[str, Any]]]]:
    """Iterate over the values of all options that are lists: those varied, and all settings."""
    axes = [
        (table, option, _values(value))
        for table, options in tables.items()
        for option, value in options.items()
        if isinstance(value, list)
    ]
    for chosen in itertools.product(*(values for _, _, values in axes)):
        settings = {table: dict(options) for table, options in tables.items()}
        varied: dict[str, Any] = {}
        for (table, option, values), value in zip(axes, cast("Sequence[Any]", chosen), strict=True):
            settings[table][option] = value
            if len(values) > 1:
                varied[f"{table}.{option}"] = value
        yield varied, settings


def _hash_of_file(path: str) -> str:
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError as error:
        raise FormatError(Path(path), "", "", (error.strerror or str(error)).lower()) from error
