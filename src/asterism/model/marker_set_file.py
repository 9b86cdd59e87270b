"""Marker sets as TOML: one line a marker, a distance and a side. All lengths are metres.

A set by hand needs the names and places alone::

    format = "asterism marker set 1"
    [markers]
    LASI = {place = [0.10, 0.12, 0.95], segment = "pelvis"}
"""

from __future__ import annotations

import json
import math
import re
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from asterism.checks import check_fields
from asterism.errors import FormatError, ParameterError
from asterism.model.toml_file import read_toml

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path
    from types import SimpleNamespace

    from numpy.typing import NDArray

__all__ = ["FORMAT", "read_fields", "to_text"]

FORMAT = "asterism marker set 1"
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_text(made: SimpleNamespace) -> str:
    """Return the fields of a `MarkerSet` as TOML text."""
    lines = [f'format = "{FORMAT}"']
    if made.subject:
        lines.append(f"subject = {json.dumps(made.subject, ensure_ascii=False)}")
    lines += [f"subjects = {made.n_subjects}", f'up = "{made.up}"', ""]
    # A key after a table would belong to it, so that the sides stand before the tables.
    lines += [
        "# Sides: a marker, three others, its height over their plane (right-handed), spread."
    ]
    lines += ["sides = ["]
    for quad, *numbers in zip(made.quads, made.heights, made.height_spreads, strict=True):
        names = ", ".join(json.dumps(made.names[m], ensure_ascii=False) for m in quad)
        lines.append(f"  [{names}, {_numbers(numbers)[1:-1]}],")
    lines += [
        "]",
        "",
        "# Places in one posture; share of the captures of moving subjects with a marker.",
    ]
    lines += ["[markers]"]
    rows = zip(made.names, made.places, made.segments, made.presences, strict=True)
    for name, place, segment, presence in rows:
        own = [f"place = {_numbers(place)}"] if np.isfinite(place).all() else []
        own += [f"segment = {json.dumps(segment, ensure_ascii=False)}"] if segment else []
        own += [f"presence = {round(float(presence), 3):g}"] if presence < 1 else []
        lines.append(f"{_key(name)} = {{{', '.join(own)}}}")
    lines += ["", "# Distances: usual, movement within a subject, variation between subjects."]
    rounded = [np.round(x, 5) for x in (made.distances, made.movements, made.variations)]
    for i, name in enumerate(made.names):
        known = [j for j in range(i + 1, len(made.names)) if np.isfinite(made.distances[i, j])]
        lines += [f"[distances.{_key(name)}]"] if known else []
        lines += [f"{_key(made.names[j])} = {_numbers([x[i, j] for x in rounded])}" for j in known]
    return "\n".join(lines) + "\n"


def read_fields(path: str | Path) -> dict[str, Any]:
    """Read the arguments of `MarkerSet` from a TOML file.

    Raises
    ------
    FormatError
        If the file cannot be read, is not TOML, or has another format.
    ParameterError
        If a value is missing, unknown or impossible.
    """
    content = read_toml(path, "a marker set in TOML")
    if content.get("format") != FORMAT:
        got = content.get("format", "none")
        hint = "write a marker set with asterism markerset learn"
        raise FormatError(path, "format", f'"{FORMAT}"', got, hint)
    return _fields(content)


def _fields(content: Mapping[str, Any]) -> dict[str, Any]:
    check_fields(
        "marker set",
        content,
        ("format", "subject", "subjects", "up", "sides", "markers", "distances"),
    )
    markers = _table(content, "markers")
    names = tuple(markers)
    number = {name: k for k, name in enumerate(names)}
    places = np.full((len(names), 3), np.nan)
    segments: list[str | None] = []
    presences = np.ones(len(names))
    for k, name in enumerate(names):
        own = _table(markers, name)
        check_fields(f"markers.{name}", own, ("place", "segment", "presence"))
        if "place" in own:
            places[k] = _row(f"place of {name}", own["place"], 3)
        if "presence" in own:
            presences[k] = _row(f"presence of {name}", [own["presence"]], 1)[0]
        segments.append(str(own["segment"]) if "segment" in own else None)
    fields: dict[str, Any] = {"names": names, "places": places, "presences": presences}
    fields["segments"] = tuple(segments)
    for key, name in (("subject", "subject"), ("subjects", "n_subjects"), ("up", "up")):
        if key in content:
            fields[name] = content[key]
    if "distances" in content:
        values = np.full((3, len(names), len(names)), np.nan)
        values[:, range(len(names)), range(len(names))] = 0
        for name, row in _table(content, "distances").items():
            for other in _table(_table(content, "distances"), name):
                i, j = _marker(number, name), _marker(number, other)
                values[:, i, j] = values[:, j, i] = _row(f"distances.{name}.{other}", row[other], 3)
        fields |= dict(zip(("distances", "movements", "variations"), values, strict=True))
    if "sides" in content:
        fields |= _sides(content["sides"], number)
    return fields


def _sides(rows: Any, number: Mapping[str, int]) -> dict[str, Any]:
    if not isinstance(rows, list):
        raise ParameterError("sides", "a list", type(rows).__name__)
    quads: list[list[int]] = []
    values: list[NDArray[np.float64]] = []
    for n, row in enumerate(cast("list[Any]", rows), 1):
        if not isinstance(row, list) or len(cast("list[Any]", row)) != 6:
            raise ParameterError(f"sides, row {n}", "four names and two numbers", repr(row))
        own = cast("list[Any]", row)
        quads.append([_marker(number, str(name)) for name in own[:4]])
        values.append(_row(f"sides, row {n}", own[4:], 2))
    table = np.array(values).reshape(-1, 2)
    return {
        "quads": np.array(quads, dtype=np.int64).reshape(-1, 4),
        "heights": table[:, 0],
        "height_spreads": table[:, 1],
    }


def _marker(number: Mapping[str, int], name: str) -> int:
    if name not in number:
        raise ParameterError("markers", "every marker that a distance or side names", f"no {name}")
    return number[name]


def _row(name: str, values: Any, n: int) -> NDArray[np.float64]:
    own = cast("list[Any]", values) if isinstance(values, list) else []
    if len(own) != n or not all(type(x) in (int, float) and abs(x) != math.inf for x in own):
        raise ParameterError(name, f"{n} numbers", repr(values))
    return np.array(own, dtype=np.float64)


def _table(content: Mapping[str, Any], name: str) -> dict[str, Any]:
    value = content.get(name)
    if not isinstance(value, dict):
        raise ParameterError(name, "a table", "none" if value is None else type(value).__name__)
    return cast("dict[str, Any]", value)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else json.dumps(name, ensure_ascii=False)


def _numbers(values: Any) -> str:
    return "[" + ", ".join(f"{round(float(x), 5):g}" for x in values) + "]"
