"""Source: the real-time stream of Qualisys Track Manager, over TCP."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections import deque
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from asterism.errors import SourceError, SourceLost
from asterism.live.faults import Faults
from asterism.live.frame import SourceFrame
from asterism.live.protocols import qtm
from asterism.live.protocols.packet_error import PacketError
from asterism.live.protocols.qtm import DataPacket, Packet
from asterism.live.protocols.qtm_components import (
    Component,
    decode_2d,
    decode_markers,
    decode_positions,
)
from asterism.live.protocols.qtm_parameters import read_calibration, read_parameters
from asterism.live.sources.camera_images import CameraImages, ImageFrame

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.camera import Rig

__all__ = ["QtmSource"]

T = TypeVar("T")

_VERSIONS = ("1.25", "1.24", "1.23", "1.22", "1.21", "1.20", "1.19")
_CONNECT_SECONDS = 5.0
_READ = 256 * 1024  # bytes
_TOGETHER = 16  # frames of image points that wait and are reconstructed together, at most


class QtmSource:
    """Source of the points of Qualisys Track Manager: labelled markers and unidentified points.

    Names of the system are not used, because the tracker names the points itself.

    Parameters
    ----------
    name : str
        The source, as the user wrote it.
    host, port : str and int
        Address of the system, and its port for little-endian clients.
    images : bool
        Whether the points are reconstructed from the image points of the cameras (component 2D)
        instead.
    rig : Rig, optional
        Calibration of the cameras, named by their serial numbers. By default the system is asked.
    """

    def __init__(
        self, name: str, host: str, port: int, *, images: bool = False, rig: Rig | None = None
    ) -> None:
        self._has_images, self._rig = images, rig
        self._cameras: tuple[str, ...] = ()
        self._images: CameraImages | None = None
        self._ready: deque[SourceFrame] = deque()
        self.name, self._address = name, (host, port)
        self.rate = 0.0
        self.waits = False
        self._faults = Faults(name)
        self.faults: dict[str, int] = self._faults.counts
        self._socket: socket.socket | None = None
        self._received = bytearray()
        self._arrived = 0.0

    def open(self) -> None:
        """Connect, agree on a version and ask for all frames.

        Raises
        ------
        SourceError
            If the system cannot be reached or refuses, or two cameras with a calibration are
            needed and it has fewer.
        """
        self.close()
        self._received.clear()
        self._ready.clear()
        try:
            self._socket = socket.create_connection(self._address, _CONNECT_SECONDS)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._handshake()
        except (OSError, PacketError) as error:
            self.close()
            text = getattr(error, "strerror", None) or str(error) or "no answer"
            hint = "Check that QTM runs and that its real-time output is switched on"
            raise SourceError(f"{self.name}: cannot connect: {text.lower()}. {hint}.") from error
        except SourceError:
            self.close()
            raise

    def _handshake(self) -> None:
        kind, text = self._answer()
        if kind != Packet.COMMAND or not text.startswith("QTM RT Interface connected"):
            raise SourceError(f"{self.name}: expected a Qualisys system, found {text[:60]!r}.")
        for version in _VERSIONS:
            kind, text = self._ask(f"Version {version}")
            if kind == Packet.COMMAND:
                break
        else:
            first, last = _VERSIONS[-1], _VERSIONS[0]
            raise SourceError(f"{self.name}: speaks none of the versions {first} to {last}.")
        kind, text = self._ask("GetParameters General 3D")
        self.rate, cameras = 0.0, tuple[str, ...]()
        if kind == Packet.XML:
            with contextlib.suppress(PacketError):  # the stream is of use without its rate
                self.rate, _, cameras = read_parameters(text)
        if self._has_images:
            self._calibrate(cameras)
        components = "2D" if self._has_images else "3D 3DNoLabels"
        self._send(f"StreamFrames AllFrames {components}")

    def _calibrate(self, cameras: tuple[str, ...]) -> None:
        """Find the calibration of the cameras."""
        rig = self._rig
        if rig is None:
            kind, text = self._ask("GetParameters Calibration")
            try:
                if kind != Packet.XML:
                    raise PacketError(text)
                rig = read_calibration(text)
            except PacketError as error:
                hint = "Calibrate it in QTM, or give a file: ?2d=FILE"
                text = f"{self.name}: the system has no calibration: {error}. {hint}."
                raise SourceError(text) from None
        if len(set(cameras) & set(rig.names)) < 2:
            found = f"cameras {', '.join(cameras) or 'none'}"
            raise SourceError(
                f"{self.name}: expected two cameras of the calibration ({', '.join(rig.names)}) or "
                f"more, found {found}. Name the cameras of the calibration by serial number."
            )
        if self._images is None or cameras != self._cameras:
            self._images, self._cameras = CameraImages(rig, cameras), cameras

    def _send(self, command: str) -> None:
        assert self._socket is not None
        self._socket.sendall(qtm.encode_text(Packet.COMMAND, command))

    def _ask(self, command: str) -> tuple[int, str]:
        self._send(command)
        return self._answer()

    def _answer(self) -> tuple[int, str]:
        """Wait for the answer to a command; events may arrive before it."""
        end = time.monotonic() + _CONNECT_SECONDS
        while time.monotonic() < end:
            found = self._packet(end - time.monotonic())
            if found is not None and found[0] in (Packet.ERROR, Packet.COMMAND, Packet.XML):
                return found[0], qtm.text_of(found[1])
        raise PacketError("no answer in time")

    def _packet(self, timeout: float) -> tuple[int, bytes] | None:
        """Return the next packet, as soon as it is complete."""
        assert self._socket is not None
        end = time.monotonic() + timeout
        while True:
            if (packet := self._complete()) is not None:
                return packet
            left = end - time.monotonic()
            if left < 0 or not select.select([self._socket], [], [], left)[0]:
                return None
            received = self._socket.recv(_READ)
            self._arrived = time.perf_counter()
            if not received:
                raise ConnectionResetError(0, "the system has closed the connection")
            self._received += received

    def _complete(self) -> tuple[int, bytes] | None:
        """Return the next packet of what was received; None if it is not complete."""
        found = qtm.split(self._received)
        if found is None:
            return None
        kind, view = found
        body = bytes(view)
        view.release()
        del self._received[: len(body) + 8]
        return kind, body

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame.

        Raises
        ------
        SourceLost
            If the connection is gone.
        """
        if self._socket is None:
            raise SourceLost("the source is not open.")
        end = time.monotonic() + timeout
        while not self._ready:
            try:
                packet = self._packet(max(0.0, end - time.monotonic()))
            except (OSError, PacketError) as error:
                # After a wrong size the boundary of packets is lost.
                self.close()
                text = getattr(error, "strerror", None) or str(error)
                raise SourceLost(f"the connection is lost: {text}.") from error
            if packet is None:
                return None
            if self._images is None:
                self._ready.extend(self._decoded(packet, self._frame))
            else:
                frames = self._decoded(packet, self._image_frame)
                with contextlib.suppress(PacketError):  # it is raised again when all are delivered
                    while len(frames) < _TOGETHER and (packet := self._complete()) is not None:
                        frames += self._decoded(packet, self._image_frame)
                self._ready.extend(self._images.add(frames))
        return self._ready.popleft()

    def _decoded(self, packet: tuple[int, bytes], decode: Callable[[DataPacket], T]) -> list[T]:
        """Return the frame of a packet, if it has one."""
        kind, body = packet
        try:
            return [decode(qtm.decode_data(body))] if kind == Packet.DATA else []
        except PacketError as error:
            self._faults.undecoded(error)
            return []

    def _frame(self, data: DataPacket) -> SourceFrame:
        points = np.empty((0, 3))
        if Component.POINTS in data.components:
            points = decode_positions(data.components[Component.POINTS], Component.POINTS)
        if Component.MARKERS in data.components:
            markers = decode_markers(data.components[Component.MARKERS])
            if len(markers):
                # All 32 bits set mark a marker that is not there.
                seen = markers[~np.isnan(markers).all(axis=1)]
                points = np.concatenate([seen, points])
        return SourceFrame(
            number=data.number, time=data.time, points=points, received=self._arrived,
            covariances=None,
        )  # fmt: skip

    def _image_frame(self, data: DataPacket) -> ImageFrame:
        if Component.IMAGE_POINTS not in data.components:
            raise PacketError("a frame without image points")
        images = decode_2d(data.components[Component.IMAGE_POINTS])
        if len(images) != len(self._cameras):
            raise PacketError(f"{len(images)} cameras instead of {len(self._cameras)}")
        return ImageFrame(data.number, data.time, self._arrived, images)

    def close(self) -> None:
        """Disconnect."""
        if self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.close()
            self._socket = None
