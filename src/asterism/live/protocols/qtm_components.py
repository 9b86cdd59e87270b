"""Components of a data packet of the Qualisys real-time protocol: markers, points, image points.

Positions are in millimetres. The layout here is the same in versions 1.12 to 1.28.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import TYPE_CHECKING

import numpy as np

from asterism.live.protocols.packet_error import PacketError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "COMPONENTS",
    "Component",
    "decode_2d",
    "decode_markers",
    "decode_points",
    "decode_positions",
    "encode_2d",
    "encode_nothing",
    "encode_positions",
]

_HEADER = 8
_MM = 1000.0  # per metre
_SUBPIXELS = 64


class Component(IntEnum):
    """Kinds of component of a data packet."""

    MARKERS = 1
    POINTS = 2
    ANALOG = 3
    FORCE = 4
    BODIES = 5
    BODIES_EULER = 6
    IMAGE_POINTS = 7
    IMAGE_POINTS_LINEAR = 8
    MARKERS_RESIDUAL = 9
    POINTS_RESIDUAL = 10
    BODIES_RESIDUAL = 11
    BODIES_EULER_RESIDUAL = 12
    ANALOG_SINGLE = 13
    IMAGE = 14
    FORCE_SINGLE = 15
    GAZE = 16
    TIMECODE = 17
    SKELETON = 18
    EYE_TRACKER = 19


COMPONENTS = {
    "3d": Component.MARKERS,
    "3dnolabels": Component.POINTS,
    "analog": Component.ANALOG,
    "force": Component.FORCE,
    "6d": Component.BODIES,
    "6deuler": Component.BODIES_EULER,
    "2d": Component.IMAGE_POINTS,
    "2dlin": Component.IMAGE_POINTS_LINEAR,
    "3dres": Component.MARKERS_RESIDUAL,
    "3dnolabelsres": Component.POINTS_RESIDUAL,
    "6dres": Component.BODIES_RESIDUAL,
    "6deulerres": Component.BODIES_EULER_RESIDUAL,
    "analogsingle": Component.ANALOG_SINGLE,
    "image": Component.IMAGE,
    "forcesingle": Component.FORCE_SINGLE,
    "gazevector": Component.GAZE,
    "timecode": Component.TIMECODE,
    "skeleton": Component.SKELETON,
    "eyetracker": Component.EYE_TRACKER,
}
"""Component of each lower-case name that clients use in commands."""
_WITH_RATES = {c for name, c in COMPONENTS.items() if name[0].isdigit()}  # 2D, 3D and 6D
_ROWS = {
    (order, kind): np.dtype([("place", f"{order}f4", 3), *more])
    for order in "<>"
    for kind, more in {
        Component.MARKERS: (),
        Component.MARKERS_RESIDUAL: (("residual", f"{order}f4"),),
        Component.POINTS: (("id", f"{order}u4"),),
        Component.POINTS_RESIDUAL: (("id", f"{order}u4"), ("residual", f"{order}f4")),
    }.items()
}
_IMAGE_ROW = {
    order: np.dtype([("x", f"{order}i4"), ("y", f"{order}i4"), ("size", f"{order}i2", 2)])
    for order in "<>"
}


def encode_nothing(kind: Component, order: str = "<") -> bytes:
    """Make a component that lists nothing."""
    if kind in _WITH_RATES:
        return struct.pack(f"{order}IIIHH", _HEADER + 8, kind, 0, 0, 0)
    return struct.pack(f"{order}III", _HEADER + 4, kind, 0)


def encode_positions(
    kind: Component,
    positions: NDArray[np.float64],
    ids: NDArray[np.int64] | None = None,
    order: str = "<",
) -> bytes:
    """Make a component of labelled markers or of unlabelled points.

    Parameters
    ----------
    kind : Component
        One of MARKERS, MARKERS_RESIDUAL, POINTS and POINTS_RESIDUAL. A residual is written as 0.
    positions : ndarray of shape (N, 3)
        Metres; markers in the order of the labels, NaN for a missing one.
    ids : ndarray of int, shape (N,), optional
        Number of each unlabelled point, of which the lowest 32 bits are sent.
    order : str
        Byte order.
    """
    if not len(positions):
        return encode_nothing(kind, order)
    rows = np.zeros(len(positions), _ROWS[order, kind])
    rows["place"] = positions * _MM
    is_nan = np.isnan(positions)
    if is_nan.any():
        # Clients test a missing marker by all 32 bits, which is one of many patterns of NaN.
        missing = is_nan.any(axis=1)
        rows.view(f"{order}u4").reshape(len(rows), -1)[missing, :3] = 0xFFFFFFFF
    if ids is not None:
        rows["id"] = ids & 0xFFFFFFFF
    size = _HEADER + 8 + rows.nbytes
    return struct.pack(f"{order}IIIHH", size, kind, len(rows), 0, 0) + rows.tobytes()


def decode_markers(
    body: bytes | memoryview, *, residuals: bool = False, order: str = "<"
) -> NDArray[np.float64]:
    """Return the labelled markers of a component, shape (K, 3), metres; NaN if missing.

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    kind = Component.MARKERS_RESIDUAL if residuals else Component.MARKERS
    return decode_positions(body, kind, order)


def decode_points(
    body: bytes | memoryview, *, residuals: bool = False, order: str = "<"
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the unlabelled points of a component, shape (N, 3), metres, and their ids, (N,).

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    kind = Component.POINTS_RESIDUAL if residuals else Component.POINTS
    rows = _rows(body, kind, order)
    return _metres(rows), rows["id"].astype(np.int64)


def decode_positions(
    body: bytes | memoryview, kind: Component, order: str = "<"
) -> NDArray[np.float64]:
    """Return the positions of a component of markers or points, shape (N, 3), metres.

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    return _metres(_rows(body, kind, order))


def _metres(rows: NDArray[np.void]) -> NDArray[np.float64]:
    return np.divide(rows["place"], _MM, dtype=np.float64)


def _rows(body: bytes | memoryview, kind: Component, order: str) -> NDArray[np.void]:
    if len(body) < 8:
        raise PacketError("a component without a whole header")
    (n,) = struct.unpack_from(f"{order}I", body)
    dtype = _ROWS[order, kind]
    if n * dtype.itemsize > len(body) - 8:
        raise PacketError(f"a component of {n} markers in {len(body)} bytes")
    return np.frombuffer(body, dtype, count=n, offset=8)


def encode_2d(cameras: Sequence[NDArray[np.float64]], order: str = "<") -> bytes:
    """Make the component of image points.

    Parameters
    ----------
    cameras : sequence of ndarray, each of shape (n, 2)
        Image points of each camera, pixels. They are sent in units of 1/64 pixel, without a size.
    order : str
        Byte order.
    """
    parts: list[bytes] = []
    for pixels in cameras:
        rows = np.zeros(len(pixels), _IMAGE_ROW[order])
        rows["x"], rows["y"] = np.rint(pixels * _SUBPIXELS).T
        parts += [struct.pack(f"{order}IB", len(rows), 0), rows.tobytes()]
    body = b"".join(parts)
    size = _HEADER + 8 + len(body)
    return struct.pack(f"{order}IIIHH", size, Component.IMAGE_POINTS, len(cameras), 0, 0) + body


def decode_2d(body: bytes | memoryview, order: str = "<") -> list[NDArray[np.float64]]:
    """Return the image points of each camera of a component, pixels.

    Returns
    -------
    list of ndarray, each of shape (n, 2)

    Raises
    ------
    PacketError
        If the component is truncated.
    """
    if len(body) < 8:
        raise PacketError("a component without a whole header")
    (n_cameras,) = struct.unpack_from(f"{order}I", body)
    dtype, at = _IMAGE_ROW[order], 8
    cameras: list[NDArray[np.float64]] = []
    for _ in range(n_cameras):
        if len(body) < at + 5:
            raise PacketError("a component with fewer cameras than it states")
        (n,) = struct.unpack_from(f"{order}I", body, at)
        at += 5  # the count and the flags of the camera
        if n * dtype.itemsize > len(body) - at:
            raise PacketError(f"{n} image points in {len(body)} bytes")
        rows = np.frombuffer(body, dtype, count=n, offset=at)
        cameras.append(np.column_stack([rows["x"], rows["y"]]) / _SUBPIXELS)
        at += n * dtype.itemsize
    return cameras
