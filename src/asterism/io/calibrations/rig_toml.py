"""Asterism's own calibration: a TOML file that holds every camera bit for bit."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

from asterism.camera import BrownConrady, Camera, QuadraticCorrection, ReportRadial, ViconRadial
from asterism.checks import check_fields
from asterism.errors import FormatError, ParameterError
from asterism.io.calibrations.parts import as_array, build_rig, faults_at
from asterism.io.calibrations.toml_text import load, table

if TYPE_CHECKING:
    from pathlib import Path

    from asterism.camera import Lens, Rig

__all__ = ["read", "sniff", "write"]

_NAME, _VERSION = "asterism-rig", 1
_Kind = type[BrownConrady] | type[ReportRadial] | type[ViconRadial] | type[QuadraticCorrection]
_LENSES: dict[str, _Kind] = {
    "brown-conrady": BrownConrady,
    "report-radial": ReportRadial,
    "vicon-radial": ViconRadial,
    "quadratic-correction": QuadraticCorrection,
}
_FIELDS = ("name", "size_px", "K", "T_camera_world", "near", "far", "K_lens", "lens")


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of Asterism's calibration."""
    return _NAME.encode() in head


def read(path: Path, units: str | None) -> Rig:
    """Read the cameras of Asterism's own calibration.

    Parameters
    ----------
    path : Path
        TOML file of `write`.
    units : str or None
        Not used: the format is in metres by definition.

    Returns
    -------
    Rig
        The same cameras as were written, bit for bit.

    Raises
    ------
    FormatError
        If an entry is missing, malformed or unknown, or if the version is newer.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> rig = am.Rig.ring(2, radius=3, height=2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "rig.toml")
    ...     _ = path.write_bytes(write(rig))
    ...     bool((read(path, None)[1].K == rig[1].K).all())
    True
    """
    del units
    content = load(path)
    if content.get("format") != _NAME:
        got = repr(content.get("format"))[:60]
        raise FormatError(path, "format", repr(_NAME), got)
    if content.get("version") != _VERSION:
        hint = "a newer version of Asterism reads it"
        raise FormatError(path, "version", str(_VERSION), repr(content.get("version"))[:60], hint)
    with faults_at(path, "the top level"):
        check_fields("entry", content, ("format", "version", "camera"))
    tables = content.get("camera", [])
    if not isinstance(tables, list):
        raise FormatError(path, "camera", "tables under [[camera]]", repr(tables)[:60])
    return build_rig(path, [_camera(path, i, entry) for i, entry in enumerate(tables)])


def _camera(path: Path, number: int, entry: Any) -> Camera:
    if not isinstance(entry, dict):
        raise FormatError(path, f"camera {number + 1}", "a table", repr(entry)[:60])
    name = entry.get("name", "")
    place = f"camera {name or number + 1}"
    with faults_at(path, place):
        check_fields("entry", entry, _FIELDS)
    if not isinstance(name, str):
        raise FormatError(path, f"{place}, name", "a text", repr(name)[:60])
    size = entry.get("size_px")
    if not (isinstance(size, list) and len(size) == 2 and all(type(n) is int for n in size)):
        raise FormatError(path, f"{place}, size_px", "two whole numbers", repr(size)[:60])
    limits = {}
    for key in ("near", "far"):
        if key in entry:
            if type(entry[key]) not in (int, float):
                raise FormatError(path, f"{place}, {key}", "a number", repr(entry[key])[:60])
            # An integer in TOML may exceed the largest float; only "inf" means infinity.
            is_finite = entry[key] != math.inf
            place_of = f"{place}, {key}"
            limits[key] = float(as_array(path, place_of, entry[key], ())) if is_finite else math.inf
    K_lens = entry.get("K_lens")
    if K_lens is not None:
        K_lens = as_array(path, f"{place}, K_lens", K_lens, (3, 3))
    lens = None if "lens" not in entry else _lens(path, f"{place}, lens", entry["lens"])
    with faults_at(path, place):
        return Camera(
            K=as_array(path, f"{place}, K", entry.get("K"), (3, 3)),
            T_camera_world=as_array(
                path, f"{place}, T_camera_world", entry.get("T_camera_world"), (4, 4)
            ),
            size_px=(size[0], size[1]),
            lens=lens,
            K_lens=K_lens,
            name=name,
            **limits,
        )


def _lens(path: Path, place: str, entry: Any) -> Lens:
    if not isinstance(entry, dict):
        raise FormatError(path, place, "a table", repr(entry)[:60])
    with faults_at(path, place):
        check_fields("kind", [entry.get("kind", "")], _LENSES)
    kind = _LENSES[entry["kind"]]
    numbers = {key: value for key, value in entry.items() if key != "kind"}
    with faults_at(path, place):
        check_fields("entry", numbers, [field.name for field in dataclasses.fields(kind)])
        for key, value in numbers.items():
            wanted = (5,) if kind is QuadraticCorrection else ()
            array = as_array(path, f"{place}, {key}", value, wanted)
            numbers[key] = tuple(array.tolist()) if wanted else float(array)
        return kind(**numbers)


def write(rig: Rig) -> bytes:
    """Encode a rig as Asterism's own calibration, which keeps every field bit for bit.

    Parameters
    ----------
    rig : Rig
        Cameras with any lens.

    Returns
    -------
    bytes
        Content of the file.

    Examples
    --------
    >>> import asterism as am
    >>> write(am.Rig.ring(1, radius=3, height=2)).decode().splitlines()[1:3]
    ['format = "asterism-rig"', 'version = 1']
    """
    text = "# A rig of cameras: metres and pixels. T_camera_world takes world to camera.\n"
    text += table("", {"format": _NAME, "version": _VERSION})
    for i, camera in enumerate(rig):
        values: dict[str, Any] = {
            "name": camera.name,
            "size_px": [int(n) for n in camera.size_px],
            "near": float(camera.near),
            "far": float(camera.far),
            "K": camera.K,
            "T_camera_world": camera.T_camera_world,
        }
        if camera.K_lens is not None:
            values["K_lens"] = camera.K_lens
        text += table("[[camera]]", values)
        if camera.lens is not None:
            text += table("[camera.lens]", _entries(i, camera.lens))
    return text.encode()


def _entries(i: int, lens: Lens) -> dict[str, Any]:
    for name, kind in _LENSES.items():
        if isinstance(lens, kind):
            fields = dataclasses.fields(kind)
            return {"kind": name} | {f.name: getattr(lens, f.name) for f in fields}
    expected = f"one of {', '.join(kind.__name__ for kind in _LENSES.values())}"
    raise ParameterError(f"the lens of camera {i}", expected, type(lens).__name__)
