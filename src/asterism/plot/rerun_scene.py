"""Optional viewer: tracks and cameras as a Rerun recording."""

from __future__ import annotations

import secrets
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_extra, check_path
from asterism.errors import ParameterError, not_written
from asterism.plot.style import CLUTTER, CYCLE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.camera import Rig
    from asterism.model import Tracks

__all__ = ["view"]

_TRAIL = 0.5  # seconds
_SHARE = 0.006  # radius of a marker, of the extent of all
_MOST_LABELS = 60  # markers that can bear their name legibly


def view(tracks: Tracks, *, rig: Rig | None = None, path: str | Path | None = None) -> None:
    """Show tracks in the Rerun viewer, or save the scene to a file.

    The viewer can show or hide each part of the scene: markers by name, straight lines across gaps,
    trails of half a second, clutter in grey, the confidence of labels over time, and the cameras.
    The timelines are seconds and frame numbers.

    Parameters
    ----------
    tracks : Tracks
        Tracks in 3-D, or in 2-D in the plane z = 0. Metres, z up.
    rig : Rig, optional
        Cameras to show, as pinhole cameras, because Rerun has no lens models.
    path : path, optional
        File to write, ``.rrd``, which needs neither viewer nor screen. By default the viewer is
        opened, and the call returns when it is closed.

    Raises
    ------
    ParameterError
        Without detections, or without Rerun: ``pip install 'asterism[view]'``.
    FormatError
        If the file cannot be written, or the viewer cannot be opened.

    Notes
    -----
    The viewer accepts connections from this machine only. Rerun's usage statistics are switched off
    permanently, as by ``rerun analytics disable``.

    Examples
    --------
    >>> import asterism as am
    >>> am.plot.view(am.simulate.cube(seed=1), path="cube.rrd")  # doctest: +SKIP
    """
    check_extra("view", "view", "rerun")
    import rerun  # pyright: ignore[reportMissingImports]  # an extra

    if not tracks.detections.n_points:
        raise ParameterError("tracks", "at least one detection", "none")
    if path is not None:
        _save(rerun, tracks, rig, check_path("path", path))
        return
    from asterism.plot.viewer import open_viewer

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.rrd"
        _save(rerun, tracks, rig, file)
        open_viewer(file)


def _save(rr: Any, tracks: Tracks, rig: Rig | None, path: Path) -> None:
    """Write a recording, completely or not at all."""
    temporary = path.with_name(f".{secrets.token_hex(8)}.part")
    try:
        # Rerun panics if it cannot write to a folder, so this is tried first.
        temporary.touch(exist_ok=False)
        recording = rr.RecordingStream("asterism", recording_id="asterism", send_properties=False)
        recording.save(temporary, _blueprint(tracks))
        _log(rr, recording, tracks, rig)
        recording.disconnect()
        temporary.replace(path)
    except OSError as error:
        raise not_written(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def _log(rr: Any, recording: Any, tracks: Tracks, rig: Rig | None) -> None:
    d = tracks.detections
    points = d.points if d.n_axes == 3 else np.pad(d.points, ((0, 0), (0, 1)))
    radius = max(_SHARE * float(np.ptp(points, axis=0).max()), 1e-4)
    recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    is_clutter = tracks.labels < 0
    if is_clutter.any():
        recording.log(
            "world/clutter",
            rr.Points3D.from_fields(colors=_rgb(CLUTTER), radii=radius / 2),
            static=True,
        )
        counts = np.bincount(d.frame_of[is_clutter], minlength=d.n_frames)
        dots = rr.Points3D.columns(positions=points[is_clutter])
        recording.send_columns("world/clutter", _times(rr, tracks), dots.partition(counts))
    order, offsets = tracks.by_track
    for k, name in enumerate(_names(tracks)):
        members = order[offsets[k] : offsets[k + 1]]
        if len(members):
            _log_marker(rr, recording, tracks, points, members, name, CYCLE[k % len(CYCLE)], radius)
    _log_trails(rr, recording, tracks, points, radius)
    for camera, name in zip(rig or (), rig.names if rig is not None else (), strict=True):
        place = rr.new_entity_path(["world", "cameras", name])
        pose = rr.Transform3D(translation=camera.center, mat3x3=camera.T_camera_world[:3, :3].T)
        pinhole = rr.Pinhole(
            image_from_camera=camera.K, resolution=camera.size_px,
            camera_xyz=rr.ViewCoordinates.RDF, image_plane_distance=40 * radius,
        )  # fmt: skip
        recording.log(place, pose, pinhole, static=True)


def _log_marker(
    rr: Any,
    recording: Any,
    tracks: Tracks,
    points: NDArray[np.float64],
    members: NDArray[np.int64],
    name: str,
    colour: str,
    radius: float,
) -> None:
    """Log the positions of one marker, the lines across its gaps, and its confidence."""
    d = tracks.detections
    frames, places = d.frame_of[members], points[members]
    # Rerun keeps a point until the next row, so an empty row follows each run of frames.
    gaps = np.flatnonzero(np.diff(frames) > 1)
    ends = np.append(frames[gaps], frames[-1]) + 1
    ends = ends[ends < d.n_frames]
    rows = np.concatenate([frames, ends])
    in_order = np.argsort(rows, kind="stable")
    counts = np.repeat([1, 0], [len(frames), len(ends)])[in_order]
    marker = rr.new_entity_path(["world", "markers", name])
    look = rr.Points3D.from_fields(
        colors=_rgb(colour), radii=radius, labels=name,
        show_labels=np.count_nonzero(tracks.lengths) <= _MOST_LABELS,
    )  # fmt: skip
    recording.log(marker, look, static=True)
    positions = rr.Points3D.columns(positions=places).partition(counts)
    recording.send_columns(marker, _times(rr, tracks, rows[in_order]), positions)
    if len(gaps):
        bridge = rr.new_entity_path(["world", "gaps", name])
        recording.log(
            bridge, rr.LineStrips3D.from_fields(colors=_rgb(colour), radii=radius / 6), static=True
        )
        rows = np.stack([frames[gaps] + 1, frames[gaps + 1]], axis=1).ravel()
        strips = np.stack([places[gaps], places[gaps + 1]], axis=1)
        lines = rr.LineStrips3D.columns(strips=strips).partition(np.tile([1, 0], len(gaps)))
        recording.send_columns(bridge, _times(rr, tracks, rows), lines)
    if tracks.confidence is not None:
        curve = rr.new_entity_path(["confidence", name])
        recording.log(curve, rr.SeriesLines(colors=_rgb(colour), names=name), static=True)
        sure = rr.Scalars.columns(scalars=tracks.confidence[members])
        recording.send_columns(curve, _times(rr, tracks, frames), sure)


def _log_trails(
    rr: Any, recording: Any, tracks: Tracks, points: NDArray[np.float64], radius: float
) -> None:
    """Log each marker's displacement from the previous frame; the view shows a time window."""
    d = tracks.detections
    order, _ = tracks.by_track
    track, frame = tracks.labels[order], d.frame_of[order]
    goes_on = np.flatnonzero((np.diff(track) == 0) & (np.diff(frame) == 1))
    goes_on = goes_on[np.argsort(frame[goes_on], kind="stable")]
    if not len(goes_on):
        return
    strips = np.stack([points[order[goes_on]], points[order[goes_on + 1]]], axis=1)
    palette = np.array([_rgb(colour) for colour in CYCLE], dtype=np.uint8)
    colours = palette[track[goes_on] % len(CYCLE)]
    counts = np.bincount(frame[goes_on] + 1, minlength=d.n_frames)
    recording.log("world/trails", rr.LineStrips3D.from_fields(radii=radius / 5), static=True)
    lines = rr.LineStrips3D.columns(strips=strips, colors=colours).partition(counts)
    recording.send_columns("world/trails", _times(rr, tracks), lines)


def _times(rr: Any, tracks: Tracks, frames: NDArray[np.int64] | None = None) -> list[Any]:
    """Return both timelines for a selection of frames, by default for all."""
    d = tracks.detections
    frames = np.arange(d.n_frames) if frames is None else frames
    first = getattr(d, "first_frame", 0)
    return [
        rr.TimeColumn("time", duration=d.times[frames]),
        rr.TimeColumn("frame", sequence=frames + first),
    ]


def _blueprint(tracks: Tracks) -> Any:
    """Return the layout of the viewer: the scene and, if labels have it, the confidence below."""
    import rerun as rr  # pyright: ignore[reportMissingImports]
    import rerun.blueprint as rrb  # pyright: ignore[reportMissingImports]

    recent = rr.VisibleTimeRange(
        "time",
        start=rr.TimeRangeBoundary.cursor_relative(seconds=-_TRAIL),
        end=rr.TimeRangeBoundary.cursor_relative(),
    )
    space = rrb.Spatial3DView(
        origin="world", name="markers",
        overrides={"world/trails": rrb.VisibleTimeRanges([recent])},
    )  # fmt: skip
    parts: list[Any] = [space]
    if tracks.confidence is not None:
        axis = rrb.ScalarAxis(range=(0.0, 1.0))
        parts.append(rrb.TimeSeriesView(origin="confidence", name="confidence", axis_y=axis))
    return rrb.Blueprint(
        rrb.Vertical(*parts, row_shares=[3, 1][: len(parts)]), rrb.TimePanel(timeline="time")
    )


def _rgb(colour: str) -> tuple[int, int, int]:
    """Convert a colour of the style, ``#RRGGBB``, to Rerun's representation."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue


def _names(tracks: Tracks) -> list[str]:
    """Return a unique name for each track: its number, if it has no name."""
    found: dict[str, None] = {}
    for k, name in enumerate(tracks.names):
        base = chosen = name or f"track {k}"
        n = 1
        while chosen in found:
            n += 1
            chosen = f"{base} ({n})"
        found[chosen] = None
    return list(found)
