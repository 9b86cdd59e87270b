"""Marker sets of Vicon: subjects in ``.vsk`` and labelling templates in ``.vst``, both XML.

Lengths are millimetres and angles radians. The world of the root has the z axis up. Positions are
numbers or expressions of parameters. Up to version 2.5 a marker states its segment and position
itself, later ones in a list of targets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.errors import FormatError, ParameterError
from asterism.io.marker_sets.expressions import Parameters, fields
from asterism.io.marker_sets.postures import Segment, rotation
from asterism.io.marker_sets.statistics import marker_set
from asterism.io.xml_tree import load

if TYPE_CHECKING:
    from pathlib import Path
    from xml.etree.ElementTree import Element

    from numpy.typing import NDArray

    from asterism.model import MarkerSet

__all__ = ["SUFFIXES", "read"]

SUFFIXES = (".vsk", ".vst")
_PRESENCES = {"required": 1.0, "optional": 0.5, "constraint": 0.0}
"""Presence of a marker by its status; a constraint is worn during the calibration alone."""
_MOST = 500  # segments or markers; a body with both hands has fewer than 200
_FARTHEST, _MOST_TURNED = 10_000.0, 100.0  # millimetres and radians
_N_AXES = {
    "JointFree": 3, "JointBall": 3, "JointUniversal": 2, "JointHardySpicer": 2, "JointHinge": 1,
    "JointSlider": 0, "JointDummy": 0,
}  # fmt: skip
_LOOSE = ("JointFree", "JointSlider")
_AXIS_KEYS = {1: "AXIS", 2: "AXIS-PAIR"}
_TURN = 0.1
"""Standard deviation of a joint, per axis, radians; those of limbs move more."""
_SHIFT, _LOOSE_SHIFT = 0.01, 0.08
"""Error of the centre of a joint, and of a free or sliding one, whose place is not calibrated:
standard deviation per axis, metres."""


def read(path: Path) -> MarkerSet:
    """Read a subject or a labelling template of Vicon.

    Parameters
    ----------
    path : Path
        XML file, as a rule ``.vsk`` or ``.vst``.

    Returns
    -------
    MarkerSet
        Markers in the order of the file.

    Raises
    ------
    FormatError
        If a segment, joint, marker or parameter is missing or malformed.
    """
    root = load(path, "KinematicModel")
    elements = [
        e for e in root.iterfind("Parameters/*") if e.tag in ("Parameter", "StaticParameter")
    ]
    parameters = Parameters(path, elements)
    segments = _segments(path, root, parameters)
    number = {segment.name: s for s, segment in enumerate(segments)}
    names: list[str] = []
    presences: list[float] = []
    targets = {e.get("MARKER", "").strip(): e for e in root.iterfind("TargetSet/Targets/*")}
    owner: list[int] = []
    local: list[NDArray[np.float64]] = []
    for i, element in enumerate(root.iterfind("MarkerSet/Markers/Marker")):
        name = element.get("NAME", "").strip()
        place = f"marker {name or i + 1}"
        if not name or i >= _MOST:
            expected = f"at most {_MOST} markers" if name else "a NAME"
            raise FormatError(path, place, expected, "more" if name else "none")
        status = element.get("STATUS", "required").strip().lower()
        if status not in _PRESENCES:
            raise FormatError(path, f"{place}, STATUS", " or ".join(_PRESENCES), repr(status))
        names.append(name)
        presences.append(_PRESENCES[status])
        element = element if element.get("SEGMENT") else targets.get(name)
        if element is None:  # known by name alone
            owner.append(-1)
            local.append(np.full(3, np.nan))
            continue
        segment = element.get("SEGMENT", "").strip()
        if segment not in number:
            raise FormatError(path, f"{place}, SEGMENT", "a segment of the file", repr(segment))
        owner.append(number[segment])
        local.append(_vector(path, place, element, "POSITION", parameters, _FARTHEST) / 1000)
    if max(owner, default=-1) < 0:
        hint = "export the subject or the template again"
        raise FormatError(path, "Markers", "markers with a segment and a position", "none", hint)
    try:
        return marker_set(
            segments, names=names, owner=np.array(owner), local=np.array(local),
            presences=presences, is_calibrated=_is_calibrated(parameters, elements),
        )  # fmt: skip
    except ParameterError as error:
        raise FormatError(path, error.name, error.expected, error.got, error.hint) from error


def _segments(path: Path, root: Element, parameters: Parameters) -> list[Segment]:
    """Return the segments of the skeleton, each after its parent."""
    segments: list[Segment] = []
    waiting = [(element, -1) for element in root.iterfind("Skeleton/Segment")]
    while waiting:
        element, parent = waiting.pop(0)
        name = element.get("NAME", "").strip()
        place = f"segment {name or len(segments) + 1}"
        if not name or any(segment.name == name for segment in segments):
            raise FormatError(path, place, "a NAME of its own", "none" if not name else "two")
        if len(segments) >= _MOST:
            raise FormatError(path, place, f"at most {_MOST} segments", "more")
        joints = [child for child in element if child.tag.startswith("Joint")]
        if len(joints) != 1 or joints[0].tag not in _N_AXES:
            got = ", ".join(joint.tag for joint in joints) or "none"
            raise FormatError(path, place, f"one of {', '.join(_N_AXES)}", got)
        waiting += [(child, len(segments)) for child in element.iterfind("Segment")]
        segments.append(_segment(path, place, name, parent, joints[0], parameters))
    return segments


def _segment(
    path: Path, place: str, name: str, parent: int, joint: Element, parameters: Parameters
) -> Segment:
    def vector(key: str, most: float) -> NDArray[np.float64]:
        return _vector(path, place, joint, key, parameters, most)

    R_post = rotation(vector("POST-ORIENTATION", _MOST_TURNED))
    post = vector("POST-POSITION", _FARTHEST)
    if joint.get("INVERSE-POST-ORIENTATION") or joint.get("INVERSE-POST-POSITION"):
        R_post = rotation(vector("INVERSE-POST-ORIENTATION", _MOST_TURNED)).T
        post = -R_post @ vector("INVERSE-POST-POSITION", _FARTHEST)
    n_axes = 0 if parent < 0 else _N_AXES[joint.tag]
    axes = np.eye(3)[:n_axes]
    if n_axes in _AXIS_KEYS:
        axes = _axes(path, place, joint, _AXIS_KEYS[n_axes], n_axes)
    turns = np.full(n_axes, _TURN)
    # T marks each degree of freedom: * is free, 0 is fixed.
    moves = [mark != "0" for mark in joint.get("T", "").split()]
    if len(moves) == n_axes:
        turns *= moves
    is_fixed = parent < 0 or joint.tag == "JointDummy"
    return Segment(
        name=name, parent=parent, R_pre=rotation(vector("PRE-ORIENTATION", _MOST_TURNED)),
        pre=vector("PRE-POSITION", _FARTHEST) / 1000, R_post=R_post, post=post / 1000,
        axes=axes, turns=turns,
        shift=0.0 if is_fixed else _LOOSE_SHIFT if joint.tag in _LOOSE else _SHIFT,
    )  # fmt: skip


def _vector(
    path: Path, place: str, element: Element, key: str, parameters: Parameters, most: float
) -> NDArray[np.float64]:
    """Return a vector in the unit of the file, of an element or of its template, 0 by default."""
    text = element.get(key)
    if text is None:
        template = element.find(f"{element.tag}Template")
        template = element.find("JointTemplate") if template is None else template
        text = None if template is None else template.get(key)
    if text is None:
        if key == "POSITION":
            raise FormatError(path, f"{place}, {key}", "3 numbers", "none")
        return np.zeros(3)
    parts = fields(text)
    if len(parts) != 3:
        raise FormatError(path, f"{place}, {key}", "3 numbers", f"{len(parts)} in {text[:60]!r}")
    found = np.array([parameters.number(f"{place}, {key}", part) for part in parts])
    if np.abs(found).max() > most:
        raise FormatError(path, f"{place}, {key}", f"numbers up to {most:g}", repr(text[:60]))
    return found


def _axes(path: Path, place: str, joint: Element, key: str, n: int) -> NDArray[np.float64]:
    """Return n unit vectors."""
    words = joint.get(key, "").split()
    try:
        axes = np.array([float(word) for word in words]).reshape(n, 3)
    except ValueError:
        axes = np.zeros((n, 3))
    with np.errstate(over="ignore"):  # too long an axis is refused below
        length = np.linalg.norm(axes, axis=1, keepdims=True)
    if not (np.isfinite(length) & (length > 1e-6)).all():
        got = repr(joint.get(key, "")[:60])
        raise FormatError(path, f"{place}, {key}", f"{3 * n} numbers, directions", got)
    return axes / length


def _is_calibrated(parameters: Parameters, elements: list[Element]) -> bool:
    """Return whether a size was estimated: whether its VALUE differs from its PRIOR."""
    for element in elements:
        stated = [element.get(key, "").strip() for key in ("VALUE", "PRIOR")]
        if element.tag == "Parameter" and all(stated):
            place = f"parameter {element.get('NAME', '')[:60]!r}"
            value, prior = (parameters.number(place, text) for text in stated)
            if value != prior:
                return True
    return False
