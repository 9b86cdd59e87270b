"""Reading of C3D, the binary format of biomechanics: detections and their identities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.io.captures.c3d_layout import C3DFile, read_c3d
from asterism.io.captures.c3d_parameters import BLOCK, DEC, INTEL, SGI
from asterism.io.captures.c3d_side_data import analog_of, events_of, plates_of
from asterism.io.captures.channels import identities
from asterism.io.captures.marker_names import find_modelled
from asterism.io.units import PER_METRE, check_size, judge_unit, parse_unit
from asterism.model import Capture

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

__all__ = [
    "CLUTTER",
    "MADE_FROM",
    "OURS",
    "UNNAMED",
    "channel_descriptions",
    "channel_names",
    "is_modelled",
    "is_seen",
    "read",
    "sniff",
]

# The writer puts these in POINT:DESCRIPTIONS, so that the reader returns the same tracks.
UNNAMED, CLUTTER = "track without a name", "clutter"
OURS = "ASTERISM"
"""Group of Asterism's own parameters. FILLED: samples whose residual and cameras are 0 were filled,
and all others measured. The format prescribes this, but few files comply. RESIDUALS: whether the
residuals of the measured samples were known. TRUNCATED: where the source of the file was cut
off."""
MADE_FROM = "made from a capture that is "


def read(path: Path) -> Capture:
    """Read the optical points of a C3D file.

    A sample is a missed detection if its residual is negative, if it is not finite, or if it lies
    exactly at the origin. Coordinates are converted from the unit of POINT:UNITS.

    Parameters
    ----------
    path : Path
        C3D file.

    Returns
    -------
    Capture
        Detections with the identities of the channels, analog channels, events and force plates.
        Computed points are left out and listed in `Capture.modelled`.

    Raises
    ------
    FormatError
        If the file is not C3D, or is cut off before its first frame is complete.

    Examples
    --------
    >>> import asterism as am, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "cube.c3d")
    ...     am.write(am.simulate.cube(frames=5, seed=1), path)
    ...     capture = read(path)
    >>> capture.units, capture.n_points
    ('mm', 40)
    """
    file = read_c3d(path)
    warnings = list(file.warnings)
    names = channel_names(file)
    modelled = is_modelled(file)
    seen = is_seen(file)
    n_origin = int((~seen & ~modelled & (file.points[..., 3] >= 0) & _at_origin(file)).sum())
    if n_origin:
        warnings.append(f"{n_origin} samples at exactly (0, 0, 0) are taken as missed detections")
    seen[:, modelled] = False
    points = file.points[..., :3][seen].astype(np.float64)
    stated = " ".join(file.group("POINT").strings("UNITS")[:1])
    unit = parse_unit(stated)
    if unit is None:
        unit = judge_unit(points)
        warnings.append(f"POINT:UNITS is {stated!r}: by their size the coordinates are {unit}")
        points /= PER_METRE[unit]
    else:
        points /= PER_METRE[unit]
        warnings += check_size(points, unit)
    rate = file.rate
    if not rate:
        warnings.append("no frame rate is given: times are frame numbers, one per second")

    labels, identity_names = _labels(file, seen, modelled)
    for array in (points, labels):
        array.flags.writeable = False  # a read-only array is kept without a copy
    cameras, residuals = _seen_by(file, seen, PER_METRE[unit])
    ours = file.group(OURS)
    filled = file.points[..., 3][seen] == 0 if ours.counts("FILLED")[:1] == [1] else None
    if filled is not None and ours.counts("RESIDUALS")[:1] == [0]:
        residuals = None
    return Capture(
        times=np.arange(len(seen)) / (rate or 1.0),
        offsets=np.concatenate([[0], np.cumsum(seen.sum(axis=1))]),
        points=points,
        path=path,
        format="c3d",
        rate=rate,
        first_frame=file.first_frame,
        units=unit,
        channels=np.nonzero(seen)[1],
        cameras=cameras,
        residuals=residuals,
        filled=filled,
        labels=labels,
        names=identity_names,
        analog=analog_of(file),
        events=events_of(file),
        plates=plates_of(file, unit),
        modelled=tuple(name for name, gone in zip(names, modelled, strict=True) if gone),
        warnings=tuple(warnings),
        truncated=file.truncated or " ".join(ours.strings("TRUNCATED")[:1]),
    )


def _overflowing(file: C3DFile, name: str) -> list[str]:
    """Return the texts of a parameter that may continue in others: LABELS, LABELS2, LABELS3."""
    point = file.group("POINT")
    texts = point.strings(name)
    number = 2
    while f"{name}{number}" in point.parameters:
        texts += point.strings(f"{name}{number}")
        number += 1
    n_points = file.points.shape[1]
    return (texts + [""] * n_points)[:n_points]


def channel_names(file: C3DFile) -> list[str]:
    """Return the name of each channel, "" for a channel without one."""
    return _overflowing(file, "LABELS")


def channel_descriptions(file: C3DFile) -> list[str]:
    """Return the description of each channel, "" for a channel without one."""
    return _overflowing(file, "DESCRIPTIONS")


def is_modelled(file: C3DFile) -> NDArray[np.bool_]:
    """Return which channels are computed instead of measured, shape (K,)."""
    point = file.group("POINT")
    groups = {name: point.strings(name) for name in point.parameters}
    return np.array(find_modelled(channel_names(file), groups), dtype=bool)


def _at_origin(file: C3DFile) -> NDArray[np.bool_]:
    x, y, z = (file.points[..., axis] == 0 for axis in range(3))
    return x & y & z


def is_seen(file: C3DFile) -> NDArray[np.bool_]:
    """Return which samples are detections, shape (T, K)."""
    seen = ~(file.points[..., 3] < 0)
    for axis in range(3):
        seen &= np.isfinite(file.points[..., axis])
    return seen & ~_at_origin(file)


def _seen_by(
    file: C3DFile, seen: NDArray[np.bool_], per_metre: float
) -> tuple[NDArray[np.int64] | None, NDArray[np.float64] | None]:
    """Return the cameras and the residuals of the points, None for those that are all zero."""
    words = file.points[..., 3][seen]
    if not np.isfinite(words).all() or words.max(initial=0) > 0x7FFF:
        return None, None  # some programs store other values than the format prescribes
    whole = words.astype(np.int64)
    cameras: NDArray[np.int64] = whole >> 8
    residuals: NDArray[np.float64] = (whole & 0xFF).astype(np.float64) * (file.scale / per_metre)
    return cameras if cameras.any() else None, residuals if residuals.any() else None


def _labels(
    file: C3DFile, seen: NDArray[np.bool_], modelled: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], tuple[str | None, ...]]:
    """Return the identities of the measured channels, by the marks of the writer if present."""
    names, descriptions = channel_names(file), channel_descriptions(file)
    is_clutter = np.array([text == CLUTTER for text in descriptions], dtype=bool)
    kept = np.flatnonzero(~modelled & ~is_clutter)
    labels = np.full(int(seen.sum()), -1, dtype=np.int64)
    channels = np.nonzero(seen)[1]
    labels[~is_clutter[channels]], found = identities(
        seen[:, kept], [None if descriptions[c] == UNNAMED else names[c] for c in kept]
    )
    return labels, found


def sniff(head: bytes) -> bool:
    """Return whether the first bytes of a file are those of a C3D file.

    The second byte alone is too weak a criterion for a binary file. In addition the parameter
    section must name a processor or, if that section is damaged, the header a first frame.
    """
    if len(head) < BLOCK or head[1] != 0x50 or head[0] < 2:
        return False
    at = (head[0] - 1) * BLOCK + 3
    return (at < len(head) and head[at] in (INTEL, DEC, SGI)) or any(head[6:8])
