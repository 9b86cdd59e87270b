"""An independent client as a process: it compares every frame that it receives with what was sent.

It prints the number of frames after each `EVERY` of them, by which the sender keeps its pace, and
at the end the number of frames and of those that differ. `live_clients.py` starts it.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import os
import socket
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["EVERY", "N_MARKERS", "N_POINTS", "RATE", "sent_frame"]

EVERY = 5
N_MARKERS, N_POINTS, RATE, PERIOD = 60, 5, 240.0, 240
"""Markers and other points of a frame, frames per second, and frames after which they repeat."""
SILENT = 20.0  # seconds without a frame, after which it ends

_rng = np.random.default_rng(1)
_MARKERS = _rng.normal(size=(PERIOD, N_MARKERS, 3))
_MARKERS[np.arange(PERIOD), np.arange(PERIOD) % N_MARKERS] = np.nan
_POINTS = _rng.normal(size=(PERIOD, N_POINTS, 3))


def sent_frame(number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return markers and other points of a frame, by its number from 1 on."""
    return _MARKERS[number % PERIOD], _POINTS[number % PERIOD]


class Count:
    """Frames that have arrived and those that differ."""

    def __init__(self, n: int) -> None:
        self.n, self.n_wrong, self._wanted, self.last = 0, 0, n, time.monotonic()

    def take(self, number: int, parts: list[tuple[Any, NDArray[np.float64]]], scale: float) -> bool:
        """Compare a frame; return whether it was the last."""
        n, self.last = self.n + 1, time.monotonic()
        same = number == n
        for got, want in parts:
            want = (want * scale).astype(np.float32)
            same &= np.array_equal(np.array(got, np.float32), want, equal_nan=True)
        self.n_wrong += not same
        if n % EVERY == 0:
            print(n, file=sys.__stdout__, flush=True)
        self.n = n  # after that line, as the last number lets another thread print the end
        return n == self._wanted

    def wait(self) -> None:
        """Wait for the last frame."""
        while self.n < self._wanted and time.monotonic() - self.last < SILENT:
            time.sleep(0.01)


def qtm_rt(count: Count, port: int, version: str) -> None:
    import qtm_rt as sdk

    async def receive() -> None:
        client: Any = await sdk.connect("127.0.0.1", port=port, version=version)
        end = asyncio.Event()

        def arrived(packet: Any) -> None:
            markers, points = sent_frame(packet.framenumber)
            others = [p[:3] for p in packet.get_3d_markers_no_label()[1]]
            parts = [(packet.get_3d_markers()[1], markers), (others, points)]
            if count.take(packet.framenumber, parts, 1000.0):
                end.set()

        await client.stream_frames(components=["3d", "3dnolabels"], on_packet=arrived)
        await end.wait()

    asyncio.run(receive())


def motioncapture(count: Count, port: int, version: str) -> None:
    import motioncapture as sdk

    # Its Python side shows rigid bodies only, so that the frames are counted and not compared.
    client: Any = sdk.connect("qualisys", {"hostname": "127.0.0.1"})
    while True:
        client.waitForNextFrame()
        if count.take(count.n + 1, [], 1.0):
            return


def natnet(count: Count, port: int, version: str) -> None:
    import natnet as sdk

    client: Any = sdk.NatNetClient(
        command_port=port, data_port=port + 1, use_multicast="multicast" in version
    )

    def arrived(frame: Any) -> None:
        markers, points = sent_frame(frame.prefix.frame_number)
        own = frame.marker_sets[0].marker_pos_list
        count.take(
            frame.prefix.frame_number, [(own, markers), (frame.unlabeled_marker_pos, points)], 1.0
        )

    client.on_data_frame_received_event.handlers.append(arrived)
    client.connect()
    client.run_async()
    count.wait()


def natnetsdk(count: Count, port: int, version: str) -> None:
    from natnetsdk.NatNetClient import NatNetClient

    client: Any = NatNetClient()
    client.command_port, client.print_level = port, 0
    client.set_use_multicast(False)
    unpack = client._NatNetClient__unpack_mocap_data

    def noted(*args: Any) -> Any:
        at, frame = unpack(*args)
        number = frame.prefix_data.frame_number
        markers, points = sent_frame(number)
        own = frame.marker_set_data.marker_data_list[0].marker_pos_list
        others = frame.legacy_other_markers.marker_pos_list
        count.take(number, [(own, markers), (others, points)], 1.0)
        frame.get_as_string = str  # the client makes a text of every frame, printed or not
        return at, frame

    client._NatNetClient__unpack_mocap_data = noted

    class Nowhere(io.StringIO):
        def write(self, text: str) -> int:
            return len(text)

    with contextlib.redirect_stdout(Nowhere()):
        client.run()
        count.wait()


def pylsl(count: Count, port: int, version: str) -> None:
    import pylsl as sdk

    found = sdk.resolve_byprop("name", f"asterism benchmark {port}", timeout=30)
    inlet: Any = sdk.StreamInlet(found[0], max_buflen=60)
    inlet.open_stream()
    while True:
        sample, _ = inlet.pull_sample(timeout=SILENT)
        if sample is None:
            return
        places = np.array(sample, np.float32).reshape(-1, 3)
        if count.take(count.n + 1, [(places, sent_frame(count.n + 1)[0])], 1.0):
            return


def python_osc(count: Count, port: int, version: str) -> None:
    from pythonosc.osc_bundle import OscBundle

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", port))
        receiver.settimeout(SILENT)
        print(0, file=sys.__stdout__, flush=True)
        while True:
            messages: Any = list(OscBundle(receiver.recv(65_536)))
            number = messages[0].params[0]
            markers, _ = sent_frame(number)
            seen = markers[np.isfinite(markers[:, 0])]
            got = [m.params for m in messages[1:] if "/marker/" in m.address]
            if count.take(number, [(got, seen)], 1.0):
                return


if __name__ == "__main__":
    name, port, version, n = sys.argv[1:]
    count = Count(int(n))
    globals()[name.replace("-", "_")](count, int(port), version)
    print(f"end {count.n} {count.n_wrong}", file=sys.__stdout__, flush=True)
    os._exit(0)  # some clients have threads that do not end
