"""Options of commands that simulate: scenes, rigs, corruption and camera images."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from asterism.checks import check_fields
from asterism.errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import asterism as am
    from asterism.simulate import Burst, Ghosts

__all__ = ["episode", "made_scene", "rig_from", "seeing_from", "switches_from"]

log = logging.getLogger(__name__)

E = TypeVar("E", "Burst", "Ghosts")


def made_scene(
    name: str, given: dict[str, Any], texts: Sequence[str]
) -> tuple[am.simulate.Truth, dict[str, Any]]:
    """Make a scene from options of the command line.

    Parameters
    ----------
    name : str
        Name of the scene.
    given : dict
        Values of the options that every scene has, None if not given. ``markers`` is the number of
        markers or drones.
    texts : sequence of str
        ``NAME=VALUE`` for the other options.

    Returns
    -------
    truth : Truth
    options : dict
        All values, given and default seed.

    Raises
    ------
    ParameterError
        If the scene or an option is unknown, or the number of markers is fixed.
    """
    import asterism as am
    from asterism.cli.options import as_options, parsed, scene_options

    scenes = am.simulate.SCENES
    check_fields("SCENE", [name], scenes)
    known = scene_options(scenes[name].make)
    values = parsed("--option", f"scene {name}", texts, known)
    given = {key: value for key, value in given.items() if value is not None}
    options = {key: f"--option {key}" for key in values} | {key: f"--{key}" for key in given}
    if "markers" in given:
        number = next((n for n in ("n_markers", "n_drones") if n in known), None)
        if number is None:
            raise ParameterError(
                "--markers", f"no value, as {name} has a fixed number", given["markers"]
            )
        given[number] = given.pop("markers")
        options[number] = "--markers"
    for twice in values.keys() & given.keys():
        raise ParameterError(twice, "one value", f"{values[twice]} by --option and {given[twice]}")
    values |= given
    values.setdefault("seed", 0)
    with as_options(options):
        return scenes[name].make(**values), values


def rig_from(text: str, points: Any) -> tuple[am.Rig, str]:
    """Read a calibration, or place the cameras of a layout around points, shape (N, 3).

    Returns
    -------
    rig : Rig
    about : str
        Description for the printed result.

    Raises
    ------
    ParameterError
        If the text is neither a calibration nor a layout.
    """
    from asterism.io.calibrations import read_rig
    from asterism.simulate.rig_presets import is_preset, place_preset

    if is_preset(text) and not Path(text).exists():
        return place_preset(text, points.min(axis=0), points.max(axis=0))
    if not Path(text).exists():
        expected = "a calibration, or ring or wall with a number of cameras, such as ring8"
        raise ParameterError("--rig", expected, repr(text))
    rig = read_rig(text)
    for warning in rig.warnings:
        log.warning("%s: %s", text, warning)
    return rig, f"{len(rig)} cameras of {text}"


def switches_from(texts: Sequence[str]) -> dict[str, Any]:
    """Read ``NAME=VALUE`` switches of `asterism.simulate.corrupt`.

    ``burst`` and ``ghosts`` are ``N[:MIN-MAX]``, ``visits`` is ``MIN-MAX``, others are numbers.
    """
    from asterism.cli.options import Option, parsed
    from asterism.simulate import Burst, Ghosts, Visits, corrupt

    defaults: dict[str, Any] = corrupt.__kwdefaults__ or {}
    known = {
        name: Option(
            name=name, kind=str if default is None else type(default), default=default, about=""
        )
        for name, default in defaults.items()
        if name not in ("rig", "seed", "keep_unnamed")
    }
    values = parsed("--corrupt", "corruption", texts, known)
    if "burst" in values:
        values["burst"] = episode("--corrupt burst", Burst, values["burst"])
    if "ghosts" in values:
        values["ghosts"] = episode("--corrupt ghosts", Ghosts, values["ghosts"])
    if "visits" in values:
        match = re.fullmatch(r"(\d+)-(\d+)", values["visits"])
        if match is None:
            raise ParameterError(
                "--corrupt visits", "MIN-MAX, such as 50-200", repr(values["visits"])
            )
        values["visits"] = Visits(shortest=int(match[1]), longest=int(match[2]))
    return values


def seeing_from(texts: Sequence[str]) -> am.simulate.Seeing | None:
    """Read ``NAME=VALUE`` fields of `asterism.simulate.Seeing`; None without any."""
    from asterism.cli.options import as_options, parsed, record_options
    from asterism.simulate import Seeing

    values = parsed("--seeing", "camera images", texts, record_options(Seeing))
    with as_options({name: f"--seeing {name}" for name in values}):
        return Seeing(**values) if texts else None


def episode(option: str, kind: type[E], text: str) -> E:
    """Read ``N`` or ``N:MIN-MAX`` of a `Burst` or of `Ghosts`."""
    from asterism.cli.options import as_options

    match = re.fullmatch(r"(\d+)(?::(\d+)-(\d+))?", text.strip())
    if match is None:
        raise ParameterError(option, "N or N:MIN-MAX, such as 5:5-60", repr(text))
    names = ("n", "shortest", "longest")
    values = {name: int(n) for name, n in zip(names, match.groups(), strict=True) if n is not None}
    with as_options({name: f"{option} ({name})" for name in names}):
        return kind(**values)
