"""The function `report`, which writes tracks as a page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from asterism.camera import Rig
from asterism.checks import check_fields, check_kind, check_path
from asterism.errors import ParameterError
from asterism.io.atomic import replacing
from asterism.model import Capture, Tracks
from asterism.model.upwards import up_axis
from asterism.reporting.connections import connections_of
from asterism.reporting.judgement import judge
from asterism.reporting.page import Contents, page
from asterism.reporting.page.editing import editing_of
from asterism.reporting.places import places_of
from asterism.tracking.decisions import of_naming

if TYPE_CHECKING:
    from collections.abc import Iterable

    from asterism.model.upwards import Axis, UpReason
    from asterism.tracking import Naming

__all__ = ["contents_of", "report"]


def report(
    tracks: Tracks,
    path: str | Path,
    *,
    truth: Tracks | None = None,
    rig: Rig | None = None,
    naming: Naming | None = None,
    made: str = "",
    summary: Iterable[tuple[str, str]] = (),
    title: str | None = None,
    up: Axis | None = None,
    editor: bool = False,
    overwrite_input: bool = False,
) -> None:
    """Write tracks as one self-contained HTML page with a player.

    The page loads nothing from the network. Above 3 million points it shows every second, third …
    frame, with a note.

    Parameters
    ----------
    tracks : Tracks
        Tracks in 2-D or 3-D, with or without names and confidence.
    path : path
        File to write. An existing file is replaced, unless it is the input of the detections.
    truth : Tracks, optional
        True tracks, as for `evaluate`. Wrong labels are marked, and scores are shown. Tracks with
        confidence or a recipe are presented as another result.
    rig : Rig, optional
        The cameras, drawn in the scene; the player looks through each. Only with 3-D tracks.
    naming : Naming, optional
        Result of `name_tracks` that gave the names; uncertain ones are places to check.
    made : str
        Sentence about the method and the model of the tracks.
    summary : iterable of (str, str)
        Names and values for the table about the tracking.
    title : str, optional
        Title of the page. By default the name of the tracked file.
    up : "x", "y" or "z", optional
        Axis that points up; the page states it and can change it. By default the axis that is up
        in the images of the `rig`. Without a rig it is y for TRC, for Motive's CSV and if the
        lowest points stay near y = 0 and far from z = 0, and z otherwise.
    editor : bool
        Add an editor that collects edits and downloads them as a file, for ``asterism track
        --edits`` on the same capture. Filled points are left out of such a page.
    overwrite_input : bool
        Allow `path` to be the file that the detections were read from.

    Raises
    ------
    ParameterError
        If an argument has another type, the truth is of another capture, or `path` is the input.
    FormatError
        If the page cannot be written.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(seed=1)
    >>> am.report(am.track(truth.detections), "cube.html", truth=truth)  # doctest: +SKIP
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    d, path = tracks.detections, check_path("path", path)
    if editor:
        tracks = tracks.measured()
    contents = contents_of(
        tracks, truth=truth, rig=rig, naming=naming, made=made, summary=summary, title=title, up=up
    )
    if path.suffix.lower() not in (".html", ".htm"):
        raise ParameterError("path", "a name ending in .html", repr(path.name))
    if isinstance(d, Capture) and not overwrite_input and path.resolve() == d.path.resolve():
        raise ParameterError("path", "another file than the one that was read", str(path))
    if editor:
        name = f"{Path(contents.title).stem}.edits.toml"
        contents = replace(contents, editing=editing_of(tracks.detections, name))
    text = page(contents)
    with replacing(path) as file:
        file.write(text)


def contents_of(
    tracks: Tracks,
    *,
    truth: Tracks | None = None,
    rig: Rig | None = None,
    naming: Naming | None = None,
    made: str = "",
    summary: Iterable[tuple[str, str]] = (),
    title: str | None = None,
    up: Axis | None = None,
) -> Contents:
    """Gather the contents of a page, with the parameters of `report`."""
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    if truth is not None:
        check_kind("truth", truth, Tracks)
    if rig is not None:
        check_kind("rig", rig, Rig, "am.read_rig(path)")
    if up is not None:
        check_fields("up", [up], ("x", "y", "z"))
    d = tracks.detections
    if rig is not None and d.n_axes != 3:
        raise ParameterError("rig", "tracks in space to look at", f"{d.n_axes}-D tracks")
    if naming is not None and all(each.kind != "name" for each in tracks.decisions):
        tracks = replace(tracks, decisions=(*tracks.decisions, *of_naming(naming, tracks)))
    axis, about_up = _up(tracks, rig, up)
    if title is None:
        title = d.path.name if isinstance(d, Capture) else ""
    warnings = (*filter(None, [d.truncated]), *d.warnings) if isinstance(d, Capture) else ()
    return Contents(
        title=title or "Tracks",
        tracks=tracks,
        made=made,
        summary=tuple((str(name), str(text)) for name, text in summary),
        warnings=(*warnings, *(rig.warnings if rig is not None else ()), *_oddities(tracks)),
        up=axis,
        about_up=about_up,
        connections=connections_of(tracks),
        judgement=None if truth is None else judge(tracks, truth),
        rig=rig,
        naming=naming,
        places=None
        if tracks.identity_confidence is None and not tracks.decisions
        else places_of(tracks),
    )


_UP: dict[UpReason, str] = {
    "format": "The y axis points up, as in most files of this format.",
    "ground": "The y axis is taken to point up: the lowest points stay near y = 0, far from z = 0. "
    "Change it below the player if this is wrong.",
    "assumed": "The z axis is taken to point up. Change it below the player if this is wrong.",
}


def _up(tracks: Tracks, rig: Rig | None, asked: Axis | None) -> tuple[Axis, str]:
    """Return the axis that points up, and a sentence with the reason."""
    if asked is not None:
        return asked, f"The {asked} axis points up, as set by the option `up`."
    if rig is not None:
        # An image has its rows from top to bottom.
        mean = np.mean([-camera.T_camera_world[1, :3] for camera in rig.cameras], axis=0)
        axes: tuple[Axis, ...] = ("x", "y", "z")
        axis = axes[int(np.argmax(np.abs(mean)))]
        return axis, f"The {axis} axis points up, as in the images of the cameras."
    axis, reason = up_axis(tracks.detections)
    return axis, _UP[reason]


def _oddities(tracks: Tracks) -> list[str]:
    d = tracks.detections
    if d.n_points and not (tracks.labels >= 0).any():
        return ["No track was confirmed: all points are clutter. Check the model and unit."]
    return []
