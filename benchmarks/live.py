"""Streams on one machine: latency from a source to a client through sockets, and long runs.

A process sends 60 markers at 240 Hz (a person in bursts of occlusions, 0.3 mm of noise, clutter),
`asterism.live.run` tracks them, stitched, and a third process receives. The latency of the loop is
the time from the reception of a frame until all sinks have it; from end to end it is the time from
the call that sends a frame until the client has read the labelled one. All three processes share
the clock of the machine. Without `--estimate` the model is given; with it, it is estimated and
refined during the run.

With `--day`, one stream with a simulated clock of 24 hours is measured instead: each hour the
source sends 20 s of frames and pauses. The table has memory and tracks.

    python benchmarks/live.py [--seconds S] [--rate HZ] [--method NAME] [--estimate]
                              [--protocols NAME …] [--day] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import multiprocessing
import socket
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import asterism as am
from asterism.live.frame import LiveFrame, SourceFrame, StreamHeader
from asterism.live.sinks.parse import parse_sink
from asterism.live.sources.base import EndOfSource
from asterism.live.sources.parse import parse_source
from report import conditions, publish, table
from stream import resident

if TYPE_CHECKING:
    from collections.abc import Iterator
    from multiprocessing.sharedctypes import SynchronizedArray

    from numpy.typing import NDArray

N_MARKERS = 60
WARM_UP = 2.0
"""Seconds at the start that are not counted."""


def scene(rate: float) -> am.Detections:
    """Simulate a person whose markers are occluded in bursts."""
    truth = am.simulate.person(frames=int(8 * rate), rate=rate, n_markers=N_MARKERS, seed=1)
    burst = am.simulate.Burst(n=4, shortest=10, longest=120)
    return am.simulate.corrupt(truth, burst=burst, noise=3e-4, clutter=0.02, seed=1).detections


def back_and_forth(d: am.Detections) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield frames without an end, forward and backward."""
    n = 0
    while True:
        turn, at = divmod(n, d.n_frames)
        yield n, d.frame(at if turn % 2 == 0 else d.n_frames - 1 - at)
        n += 1


def free_port() -> int:
    """Return a free port."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def send(address: str, rate: float, sent: SynchronizedArray[float], begin: Any) -> None:
    """Send frames on time, and note when."""
    d, sink = scene(rate), parse_sink(address)
    sink.open(StreamHeader(source="benchmark", rate=rate))
    begin.wait()
    start = time.perf_counter()
    for n, points in back_and_forth(d):
        if n >= len(sent):
            break
        if (left := start + n / rate - time.perf_counter()) > 0:
            time.sleep(left)
        labels = np.full(len(points), -1, dtype=np.int64)
        sent[n] = time.perf_counter()
        sink.send(LiveFrame(number=n, time=n / rate, points=points, labels=labels))
    time.sleep(0.5)
    sink.close()


def receive(address: str, got: SynchronizedArray[float], begin: Any, silence: float = 3.0) -> None:
    """Receive labelled frames, and note when, until none has come for so many seconds."""
    source = parse_source(address)
    while True:
        try:
            source.open()
            break
        except am.AsterismError:
            time.sleep(0.1)
    begin.set()
    last = time.perf_counter() + 20
    while time.perf_counter() < last:
        try:
            frame = source.receive(0.2)
        except (EndOfSource, am.AsterismError):
            break
        if frame is not None and frame.number < len(got):
            got[frame.number] = frame.received
            last = time.perf_counter() + silence


def wait_for(address: str) -> None:
    """Wait until a server answers."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        source = parse_source(address)
        try:
            source.open()
        except am.AsterismError:
            time.sleep(0.2)
            continue
        source.close()
        return


ROUTES = {
    "JSON over UDP": ("udp://127.0.0.1:{a}", "udp://127.0.0.1:{b}"),
    "Qualisys RT": ("qtm://127.0.0.1:{a}", "qtm://127.0.0.1:{b}"),
    "NatNet": ("natnet://127.0.0.1:{a}", "natnet://127.0.0.1:{b}"),
}


def measured(name: str, options: argparse.Namespace) -> list[str]:
    """Run one route; return the row of the table."""
    a, b = free_port(), free_port()
    inward, outward = (text.format(a=a, b=b) for text in ROUTES[name])
    context = multiprocessing.get_context("spawn")
    n = int(options.seconds * options.rate)
    sent, got = context.Array("d", n), context.Array("d", n)
    begin = context.Event()
    model = None
    if not options.estimate:
        d = scene(options.rate)
        model = am.estimate_model(d.part(0, int(2 * options.rate))).model
    sender = context.Process(target=send, args=(inward, options.rate, sent, begin), daemon=True)
    client = context.Process(target=receive, args=(outward, got, begin), daemon=True)
    sender.start()
    client.start()
    stop = threading.Event()
    threading.Thread(target=lambda: (client.join(), stop.set()), name="end", daemon=True).start()
    if name != "JSON over UDP":
        wait_for(inward)
    before = time.process_time()
    run = am.live.run(inward, [outward], method=options.method, model=model, stop=stop)
    spent = (time.process_time() - before) / max(run.n_frames, 1)
    sender.join(5)
    sender.kill()
    there = np.array(got[:]) > 0
    there[: int(WARM_UP * options.rate)] = False
    whole = (np.array(got[:]) - np.array(sent[:]))[there]
    info = run.info

    def ms(seconds: float) -> str:
        return f"{1e3 * seconds:.2f}"

    return [
        name, f"{run.n_frames:,}", ms(spent),
        *(ms(info[f"latency_{k}"]) for k in ("median", "p99", "p999")),
        *(ms(float(np.quantile(whole, q))) for q in (0.5, 0.99, 0.999)),
        ", ".join(f"{k} {v}" for k, v in (run.faults or {}).items()) or "none",
    ]  # fmt: skip


class Day:
    """A source of 24 hours by its own clock: 20 s of frames each hour, then a pause."""

    def __init__(self, d: am.Detections, rate: float) -> None:
        self.name, self.rate, self.waits = "a day", rate, True
        self.faults: dict[str, int] = {}
        self._frames, self._n = back_and_forth(d), 0

    def open(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def receive(self, timeout: float) -> SourceFrame:
        """Return the next frame; its clock is 20 ppm slow."""
        del timeout
        n_each = int(20 * self.rate)
        hour, at = divmod(self._n, n_each)
        if hour == 24:
            raise EndOfSource(self.name)
        _, points = next(self._frames)
        self._n += 1
        now = 3600 * hour + at / self.rate
        return SourceFrame(
            number=round(now * self.rate), time=now, points=points, received=now * (1 + 2e-5)
        )


class Memory:
    """A sink that notes memory and tracks, once an hour."""

    def __init__(self, rate: float) -> None:
        self.name, self.faults = "memory", dict[str, int]()
        self.rows: list[tuple[int, float, int]] = []
        self._rate = rate

    def open(self, header: StreamHeader) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""

    def send(self, frame: LiveFrame) -> None:
        """Note the last frame of an hour."""
        if frame.number % int(3600 * self._rate) == int(20 * self._rate) - 1:
            n = 0 if frame.tracks is None else len(frame.tracks)
            self.rows.append((frame.number // int(3600 * self._rate), resident(), n))


def day(options: argparse.Namespace) -> list[str]:
    """Measure a stream of 24 hours; return the lines of the page."""
    d = scene(options.rate)
    model = am.estimate_model(d.part(0, int(2 * options.rate))).model
    sink = Memory(options.rate)
    run = am.live.run(Day(d, options.rate), [sink], model=model)
    rows = [
        [f"{hour + 1}", f"{mb:.0f}", f"{n}"]
        for hour, mb, n in sink.rows
        if hour % 4 == 3 or hour == 0
    ]
    drift = f"clock drift {1e6 * run.drift:.1f} ppm of 20 ppm"
    return [
        *table(["hour", "memory, MB", "tracks"], rows), "",
        f"{run.n_frames:,} frames; {drift}.", "", conditions(),
    ]  # fmt: skip


def main() -> None:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=240.0)
    parser.add_argument("--method", help="stitched method, smp over three frames by default")
    parser.add_argument("--estimate", action="store_true")
    parser.add_argument("--protocols", nargs="+", choices=ROUTES, default=list(ROUTES))
    parser.add_argument("--day", action="store_true")
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    if options.day:
        publish(day(options), options.markdown)
        return
    head = ["route", "frames", "processor, ms", "loop: median, ms", "99 %", "99.9 %",
            "end to end: median, ms", "99 %", "99.9 %", "faults"]  # fmt: skip
    rows = [measured(name, options) for name in options.protocols]
    publish([*table(head, rows), "", conditions()], options.markdown)


if __name__ == "__main__":
    main()
