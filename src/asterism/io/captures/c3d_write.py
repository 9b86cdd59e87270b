"""Writing of tracks as C3D: the points are new, everything else is copied from the source file."""

from __future__ import annotations

from dataclasses import replace
from typing import IO, TYPE_CHECKING

import numpy as np

import asterism
from asterism.errors import FormatError, ParameterError
from asterism.io.captures.c3d import (
    CLUTTER,
    MADE_FROM,
    OURS,
    UNNAMED,
    channel_descriptions,
    channel_names,
    is_modelled,
    is_seen,
)
from asterism.io.captures.c3d_layout import C3DFile, read_c3d
from asterism.io.captures.c3d_parameters import BLOCK, Group, Parameter, build
from asterism.io.captures.channels import to_channels, to_dense
from asterism.io.captures.rates import fixed_rate
from asterism.io.decisions import as_line, by_expected_wrong, decision_rows
from asterism.io.units import PER_METRE, to_float32
from asterism.model import Capture

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from asterism.model import Detections, Tracks

__all__ = ["write"]

DECISIONS = "DECISIONS"
"""Group of what the tracking decided; other programs ignore it."""
_MOST_DECISIONS, _LONGEST_LINE = 255, 120  # of which a parameter block has room for
_CHUNK = 2048  # frames converted at a time, so that a long capture is not in memory twice
# Some programs read 0, 0, 0 as a gap whatever the residual is. This distance from the origin is
# below any precision of measurement.
_NEAR_ORIGIN = np.float32(1e-30)


def write(tracks: Tracks, file: IO[bytes]) -> None:
    """Write tracks as C3D, one channel per track.

    Parameters
    ----------
    tracks : Tracks
        Tracks over 3-D detections at a fixed rate.
    file : binary file
        Open file to write to.

    Raises
    ------
    ParameterError
        If the detections are 2-D, if the times are irregular, or if there are too many tracks.
    FormatError
        If the detections came from a C3D that no longer exists or has changed.

    Notes
    -----
    Tracks without a name are called ``T000``, ``T001`` and so on; clutter is written to channels
    ``*0``, ``*1`` and so on. The descriptions of these channels mark them, so that `read` returns
    the same tracks. If the detections were read from a C3D, its unit, analog channels, events,
    computed points and all other parameters are kept, and so are the residuals and cameras of its
    points. A missed detection is written as 0, 0, 0 with residual -1, as other programs expect.
    C3D holds the first seven cameras of a point. A filled point has residual 0, as the format
    prescribes, and every measured point at least one step; the parameter ASTERISM:FILLED marks such
    a file. ASTERISM:TRUNCATED keeps the place at which the capture was cut off. DECISIONS:LINES
    lists at most 255 decisions, those with the most expected wrong detections first, and
    DECISIONS:NUMBER the number of all.

    Examples
    --------
    >>> import asterism as am, io
    >>> file = io.BytesIO()
    >>> write(am.simulate.cube(frames=5, seed=1), file)
    >>> file.getvalue()[1]  # the mark of C3D
    80
    """
    d = tracks.detections
    rate = fixed_rate(d, "C3D")
    source = _source(d)
    channels, names, n_clutter = to_channels(tracks)
    descriptions = [UNNAMED if name is None else "" for name in tracks.names]
    descriptions += [CLUTTER] * n_clutter
    n_own = len(names)
    computed = np.empty(0, dtype=np.int64)
    unit, first_frame, header = "mm", 1, bytes(BLOCK)
    groups: dict[str, Group] = {}
    analog = np.empty((d.n_frames, 0), dtype=np.float32)
    # Known residuals are written in steps of a hundredth, because they have 8 bits.
    scale, n_samples = 0.01 if d.residuals is not None else 1.0, 0
    if isinstance(d, Capture):
        unit = d.units
        first_frame = d.first_frame if d.n_frames and 0 <= d.first_frame < 2**31 else 1
    if source is not None:
        computed = _keep_channels(source, names, descriptions)
        header, groups, analog = source.header, source.groups, source.analog
        scale, n_samples = source.scale, source.n_samples

    if len(names) > 0xFFFF:
        raise ParameterError(
            "tracks", f"at most {0xFFFF} channels in a C3D", len(names), "write CSV instead"
        )
    _set_parameters(groups, names, descriptions, d.n_frames, first_frame, rate, unit, scale)
    filled = d.filled if d.filled is not None and d.filled.any() else None
    truncated = d.truncated if isinstance(d, Capture) else ""
    _set_ours(groups, filled is not None, d.residuals is not None, truncated)
    _set_decisions(groups, tracks)
    n_blocks = len(build(groups)) // BLOCK
    point = groups["POINT"].parameters  # the number of blocks is final from here on
    point["DATA_START"] = Parameter.of_integers([2 + n_blocks], point["DATA_START"])
    frames = np.minimum([first_frame, first_frame + d.n_frames - 1], 0xFFFF)
    counts = (len(names), analog.shape[1], *frames)
    file.write(_header(header, counts, scale, (2 + n_blocks, n_samples), rate))
    file.write(build(groups))

    row = np.zeros((_CHUNK, len(names), 4), dtype="<f4")
    for begin in range(0, d.n_frames, _CHUNK):
        rows = slice(begin, min(begin + _CHUNK, d.n_frames))
        block = row[: rows.stop - begin]
        dense = to_dense(tracks, channels, n_own, rows)
        seen = ~np.isnan(dense[..., 0])
        values = to_float32(dense * PER_METRE[unit])  # rounding removes an error in the last bit
        values[~seen] = 0
        values[seen & (values == 0).all(axis=-1), 0] = _NEAR_ORIGIN
        block[:, :n_own, :3] = values
        block[:, :n_own, 3] = np.where(seen, 0, -1)
        if d.cameras is not None or d.residuals is not None:
            mine = np.arange(int(d.offsets[rows.start]), int(d.offsets[rows.stop]))
            words = _words(d, mine, scale / PER_METRE[unit])
            block[d.frame_of[mine] - rows.start, channels[mine], 3] = words
        if source is not None:
            _keep_residuals(block, d, channels, rows, source)
            block[:, n_own:] = source.points[rows][:, computed]
        if filled is not None:
            mine = np.arange(int(d.offsets[rows.start]), int(d.offsets[rows.stop]))
            _mark_filled(block, d.frame_of[mine] - rows.start, channels[mine], filled[mine])
        file.write(np.hstack([block.reshape(len(block), -1), analog[rows]]).tobytes())
    # Data fill whole blocks; but where the counts overflow some readers go by the file's length.
    if d.n_frames <= 0xFFFF:
        file.write(bytes(-(d.n_frames * (4 * len(names) + analog.shape[1]) * 4) % BLOCK))


def _header(
    old: bytes, counts: tuple[int, ...], scale: float, data: tuple[int, int], rate: float
) -> bytes:
    """Make the first block; of an old one it keeps the events that old programs put there."""
    words = np.frombuffer(old, "<u2").copy()
    words[0] = 0x5002  # parameters in block 2, and the mark of a C3D
    words[1:5] = counts
    words[6:8] = np.array([-scale], "<f4").view("<u2")
    words[8:10] = data
    words[10:12] = np.array([rate], "<f4").view("<u2")
    words[147:149] = 0  # the section of labels and ranges, which is obsolete, is not copied
    return words.tobytes()


def _keep_channels(source: C3DFile, names: list[str], descriptions: list[str]) -> NDArray[np.int64]:
    """Add the source's descriptions and its computed points; return the channels of these."""
    old_names, old_texts = channel_names(source), channel_descriptions(source)
    text_of = dict(zip(old_names, old_texts, strict=True))
    text_of = {name: t for name, t in text_of.items() if t not in (UNNAMED, CLUTTER)}
    own = zip(descriptions, names, strict=True)
    descriptions[:] = [text or text_of.get(name, "") for text, name in own]
    computed = np.flatnonzero(is_modelled(source))
    names += [old_names[c] for c in computed]
    descriptions += [old_texts[c] for c in computed]
    return computed


def _source(d: Detections) -> C3DFile | None:
    """File that the detections were read from, cut to their frames; None without one."""
    if not isinstance(d, Capture) or d.format != "c3d":
        return None
    hint = "write to CSV, or put the source back where it was read from"
    if not d.path.is_file():
        got = "no such file"
        raise FormatError(d.path, "the source", "the C3D that was read", got, hint)
    source = read_c3d(d.path)
    skipped = d.first_frame - source.first_frame
    rows = slice(skipped, skipped + d.n_frames)
    n_frames, n_channels, _ = source.points.shape
    is_same = skipped >= 0 and rows.stop <= n_frames
    is_same = is_same and (d.n_points == 0 or int(d.channels.max()) < n_channels)
    if is_same:
        source = replace(source, points=source.points[rows], analog=source.analog[rows])
        ours = d.channels >= 0
        is_same = bool(is_seen(source)[d.frame_of[ours], d.channels[ours]].all())
    if not is_same:
        got = "another number of frames, channels or points"
        raise FormatError(d.path, "the source", "the C3D that was read", got, hint)
    return source


def _words(d: Detections, rows: NDArray[np.int64], step: float) -> NDArray[np.float64]:
    """Return cameras and residual of some detections as C3D has them: 7 bits and 8 bits."""
    words = np.zeros(len(rows))
    if d.cameras is not None:
        words += 256 * (d.cameras[rows] & 0x7F)
    if d.residuals is not None:
        words += np.clip(np.rint(d.residuals[rows] / step), 1, 255)  # 0 says: not measured
    return words


def _keep_residuals(
    block: NDArray[np.float32],
    d: Detections,
    channels: NDArray[np.int64],
    rows: slice,
    source: C3DFile,
) -> None:
    """Copy residual and cameras of the points that came from the source."""
    if not isinstance(d, Capture):
        return
    mine = np.arange(int(d.offsets[rows.start]), int(d.offsets[rows.stop]))
    mine = mine[d.channels[mine] >= 0]
    frames = d.frame_of[mine]
    words = source.points[frames, d.channels[mine], 3]
    block[frames - rows.start, channels[mine], 3] = words


def _set_ours(
    groups: dict[str, Group], any_filled: bool, has_residuals: bool, truncated: str
) -> None:
    """Set the parameters of our own; what an older file said there is forgotten."""
    old = groups.pop(OURS, Group())
    for key in ("FILLED", "RESIDUALS", "TRUNCATED"):
        old.parameters.pop(key, None)
    if any_filled:
        old.parameters["FILLED"] = Parameter.of_integers([1])
        old.parameters["RESIDUALS"] = Parameter.of_integers([int(has_residuals)])
    if truncated:
        about = truncated.removeprefix(MADE_FROM)
        old.parameters["TRUNCATED"] = Parameter.of_strings([MADE_FROM + about])
    if old.parameters:
        groups[OURS] = old


def _set_decisions(groups: dict[str, Group], tracks: Tracks) -> None:
    """Set the decisions that cost most if they are wrong, as lines of text."""
    groups.pop(DECISIONS, None)
    if not tracks.decisions:
        return
    rows = decision_rows(tracks)
    lines = [as_line(rows[i]) for i in by_expected_wrong(tracks.decisions)[:_MOST_DECISIONS]]
    lines = [line.encode()[:_LONGEST_LINE].decode(errors="ignore") for line in lines]
    number = Parameter.of_reals([float(len(rows))])
    groups[DECISIONS] = Group({"LINES": Parameter.of_strings(lines), "NUMBER": number})


def _mark_filled(
    block: NDArray[np.float32],
    rows: NDArray[np.int64],
    channels: NDArray[np.int64],
    filled: NDArray[np.bool_],
) -> None:
    """Return filled points the word 0, and measured ones a residual of at least a step."""
    words = block[rows, channels, 3]
    words[words % 256 == 0] += 1
    words[filled] = 0
    block[rows, channels, 3] = words


def _set_parameters(
    groups: dict[str, Group],
    names: list[str],
    descriptions: list[str],
    n_frames: int,
    first_frame: int,
    rate: float,
    unit: str,
    scale: float,
) -> None:
    """Make the parameters say what the file holds, and leave the others alone."""
    point = groups.setdefault("POINT", Group()).parameters
    n_known = min(n_frames, 0xFFFF)
    for key, value in (("USED", len(names)), ("FRAMES", n_known)):
        point[key] = Parameter.of_integers([value], point.get(key))
    for key, real in (("SCALE", -scale), ("RATE", rate)):
        point[key] = Parameter.of_reals([real], point.get(key))
    point["DATA_START"] = Parameter.of_integers([0], point.get("DATA_START"))
    point["UNITS"] = Parameter.of_strings([unit], point.get("UNITS"))
    for key, texts in (("LABELS", names), ("DESCRIPTIONS", descriptions)):
        for old in [k for k in point if k.startswith(key) and k[len(key) :].isdecimal()]:
            del point[old]
        for i in range(0, max(len(texts), 1), 255):  # a dimension is one byte
            number = "" if i == 0 else str(i // 255 + 1)
            old = point.get(key)
            point[f"{key}{number}"] = Parameter.of_strings(texts[i : i + 255], old)
    # The 16-bit counts overflow: these are the ways round it of Qualisys and of Vicon.
    if "LONG_FRAMES" in point or n_frames > 0xFFFF:
        point["LONG_FRAMES"] = Parameter.of_reals([n_frames], point.get("LONG_FRAMES"))
    trial = groups.get("TRIAL", Group()).parameters
    last_frame = first_frame + n_frames - 1
    if "ACTUAL_END_FIELD" in trial or last_frame > 0xFFFF:
        trial = groups.setdefault("TRIAL", Group()).parameters
        for key, frame in (("ACTUAL_START_FIELD", first_frame), ("ACTUAL_END_FIELD", last_frame)):
            words = [frame & 0xFFFF, frame >> 16]
            trial[key] = Parameter.of_integers(words, trial.get(key))
    if "ANALOG" not in groups:
        analog = groups["ANALOG"] = Group()
        analog.parameters["USED"] = Parameter.of_integers([0])
    if "MANUFACTURER" not in groups:
        maker = groups["MANUFACTURER"] = Group()
        for key, text in (("SOFTWARE", "Asterism"), ("VERSION_LABEL", asterism.__version__)):
            maker.parameters[key] = Parameter.of_strings([text])
