"""A long stream in real time: memory, clock drift, lost frames, and identities against a recording.

A process sends 60 markers as an OptiTrack system does (a person in bursts of occlusions, 0.3 mm of
noise, clutter), `asterism.live.run` tracks them with a given model by the default method, and a
third process receives them as a client of Qualisys does. A sink records points and labels. After
the stream the recording is tracked offline, frame by frame, by the same method and model.

    python benchmarks/live_hour.py [--minutes M] [--rate HZ] [--every MINUTES]
                                   [--recording FILE] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import multiprocessing
import struct
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import asterism as am
from asterism.tracking import Stitched
from live import free_port, receive, scene, send, wait_for
from report import conditions, publish, table
from stream import resident

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from asterism.live import LiveFrame, LiveRun, StreamHeader

_HEAD = struct.Struct("<IdI")


class Recording:
    """A sink that writes numbers, times, points and labels; NatNet has points of 32 bits."""

    def __init__(self, path: Path) -> None:
        self.name, self.faults, self._path = "recording", dict[str, int](), path

    def open(self, header: StreamHeader) -> None:
        """Open the file."""
        self._file = self._path.open("wb")

    def send(self, frame: LiveFrame) -> None:
        """Write a frame."""
        self._file.write(
            _HEAD.pack(frame.number, frame.time, len(frame.points))
            + frame.points.astype("<f4").tobytes()
            + frame.labels.astype("<i4").tobytes()
        )

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def recorded(path: Path) -> Iterator[tuple[int, float, NDArray[np.float64], NDArray[np.int32]]]:
    """Yield number, time, points and labels of each frame of a recording."""
    with path.open("rb") as file:
        while head := file.read(_HEAD.size):
            number, seconds, n = _HEAD.unpack(head)
            points = np.frombuffer(file.read(12 * n), "<f4").reshape(n, 3).astype(np.float64)
            yield number, seconds, points, np.frombuffer(file.read(4 * n), "<i4")


class Samples:
    """Rows of the table, one at a time of the stream."""

    def __init__(self, every: float) -> None:
        self.rows: list[list[str]] = []
        self._begin, self._every, self._next = time.perf_counter(), every, 1.0

    def note(self, run: LiveRun) -> None:
        """Add a row when it is due."""
        minutes = (time.perf_counter() - self._begin) / 60
        if minutes < self._next:
            return
        self._next = self._every * (minutes // self._every + 1)
        lost = sum((run.faults or {}).get(kind, 0) for kind in ("lost", "late"))
        self.rows.append([
            f"{minutes:.0f}", f"{run.n_frames:,}", f"{resident():.1f}", str(run.n_tracks),
            str(lost), f"{1e6 * run.drift:+.1f}",
        ])  # fmt: skip
        print(*self.rows[-1], flush=True)


def compared(path: Path, model: am.TrackingModel) -> str:
    """Track a recording offline; return how many of its labels are those of the stream."""
    method = Stitched()
    state = method.init(model)
    n_points = n_same = n_tracks = 0
    last: tuple[int, float] | None = None
    for number, seconds, points, labels in recorded(path):
        if last is not None:  # a lost frame is one without points, as in the stream
            n_steps = number - last[0]
            for k in range(1, n_steps):
                now = last[1] + k * (seconds - last[1]) / n_steps
                state, _ = method.step(state, now, np.empty((0, 3)))
        last = number, seconds
        state, update = method.step(state, seconds, points)
        n_points += len(points)
        n_same += int((update.labels == labels).sum())
        n_tracks = max(n_tracks, int(update.labels.max(initial=-1)) + 1)
    return f"{n_same:,} of {n_points:,} labels equal those of offline tracking ({n_tracks} tracks)"


def main() -> None:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--every", type=float, default=10.0, help="minutes between two rows")
    parser.add_argument("--recording", type=Path, help="kept; a temporary file by default")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    inward, outward = (f"{kind}://127.0.0.1:{free_port()}" for kind in ("natnet", "qtm"))
    context = multiprocessing.get_context("spawn")
    n = int(60 * options.minutes * options.rate)
    sent, got, begin = context.Array("d", n), context.Array("d", n), context.Event()
    model = am.estimate_model(scene(options.rate).part(0, int(2 * options.rate))).model
    sender = context.Process(target=send, args=(inward, options.rate, sent, begin), daemon=True)
    client = context.Process(target=receive, args=(outward, got, begin, 60.0), daemon=True)
    sender.start()
    client.start()
    stop = threading.Event()
    threading.Thread(target=lambda: (sender.join(), stop.set()), name="end", daemon=True).start()
    wait_for(inward)
    with tempfile.TemporaryDirectory() as folder:
        path = options.recording or Path(folder, "recording")
        samples = Samples(options.every)
        before = time.process_time()
        run = am.live.run(
            inward, [outward, Recording(path)], model=model, stop=stop, status=samples.note
        )
        spent = 1e3 * (time.process_time() - before) / max(run.n_frames, 1)
        client.join(5)
        client.kill()
        identities = compared(path, model)
    n_sent, n_got = (int((np.array(times[:]) > 0).sum()) for times in (sent, got))
    faults = ", ".join(f"{k} {v}" for k, v in (run.faults or {}).items()) or "none"
    info = run.info
    head = ["minute", "frames", "memory, MB", "tracks", "lost", "drift, ppm"]
    publish([
        *table(head, samples.rows), "",
        f"{n_sent:,} frames of {options.rate:g} Hz sent, {run.n_frames:,} tracked, {n_got:,} "
        f"received by the client; faults: {faults}. {identities}. Latency "
        f"{1e3 * info['latency_median']:.2f} ms (median), {1e3 * info['latency_p999']:.1f} ms "
        f"(99.9 %); {spent:.2f} ms of processor a frame.", "", conditions(),
    ], options.markdown)  # fmt: skip


if __name__ == "__main__":
    main()
