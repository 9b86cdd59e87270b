"""Animation frames a second of the page of a stream, with 100 markers, in headless Chromium.

Two people with 50 markers each, occluded in bursts, are played at 100 Hz and tracked, and the page
shows them with their trails. It is measured several times for five seconds: intervals of animation
frames, frames of the stream that were drawn, and the share of a processor that the thread of the
page takes. Chromium draws on the processor. The first row is an empty page, the most that the
machine allows at that time.

    python benchmarks/live_page.py [--seconds S] [--picture FILE] [--markdown FILE]
"""

from __future__ import annotations

import argparse
import importlib
import os
import queue
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

import asterism as am
from asterism.live import SourceFrame
from asterism.live.sinks.page import PageSink
from live import back_and_forth
from report import conditions, publish, table

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "reporting"))
Browser: Any = importlib.import_module("browser").Browser
RATE, N_MARKERS = 100.0, 100
COUNT = """new Promise((done) => {
  const times = [], frames = globalThis.asterism?.capture.frames ?? [0], first = frames[0];
  let [last, drawn] = [first, 0];
  const tick = (now) => {
    times.push(now);
    if (frames[0] !== last) drawn++;
    last = frames[0];
    if (now - times[0] < 5000) requestAnimationFrame(tick);
    else done([times, drawn, last - first]);
  };
  requestAnimationFrame(tick);
})"""


class InTime:
    """A source that plays detections forward and backward, in real time."""

    def __init__(self, d: am.Detections) -> None:
        self.name, self.rate, self.waits = "two people", RATE, False
        self.faults: dict[str, int] = {}
        self._frames, self._begin = back_and_forth(d), time.perf_counter()
        self._next = next(self._frames)

    def open(self) -> None:
        """Begin now."""
        self._begin = time.perf_counter()

    def close(self) -> None:
        """Do nothing."""

    def receive(self, timeout: float) -> SourceFrame | None:
        """Wait for the next frame, at most for some seconds."""
        n, points = self._next
        wait = self._begin + n / RATE - time.perf_counter()
        time.sleep(max(0.0, min(wait, timeout)))
        if wait > timeout:
            return None
        self._next = next(self._frames)
        return SourceFrame(number=n, time=n / RATE, points=points, received=time.perf_counter())


def busy(page: Any) -> float:
    """Return the seconds of processor that the thread of the page has used."""
    metrics = page.call("Performance.getMetrics")["metrics"]
    return next(m["value"] for m in metrics if m["name"] == "TaskDuration")


def counted(name: str, page: Any) -> list[str]:
    """Measure a page for five seconds; return the row of the table."""
    page.call("Performance.enable", timeDomain="threadTicks")
    worked = busy(page)
    times, n_drawn, n_passed = page.run(COUNT)
    worked = busy(page) - worked
    steps, took = np.diff(times), (times[-1] - times[0]) / 1e3
    row = [
        name, f"{1e3 / steps.mean():.1f}", f"{np.median(steps):.1f}",
        f"{np.quantile(steps, 0.99):.1f}", f"{n_drawn / took:.1f}", f"{n_passed / took:.0f}",
        f"{100 * worked / took:.0f} %", f"{os.getloadavg()[0]:.1f}",
    ]  # fmt: skip
    print(*row, flush=True)
    return row


def measured(addresses: queue.Queue[str], seconds: float, picture: Path | None) -> list[list[str]]:
    """Open an empty page and that of the stream; return the rows of the table."""
    browser = Browser()
    try:
        with tempfile.NamedTemporaryFile(suffix=".html") as empty:
            empty.write(b'<body data-ready="true">')
            empty.flush()
            page = browser.page(empty.name)
            rows = [counted("empty", page)]
            page.close()
        page = browser.page(addresses.get())
        page.wait(f"asterism.capture.slots.size >= {N_MARKERS} && document.body.dataset.fps > 0")
        rows += [counted("stream", page) for _ in range(int(seconds / 5))]
        if picture is not None:
            picture.write_bytes(page.screenshot())
        for complaint in page.complaints():
            print(complaint)
        return rows
    finally:
        browser.close()


def main() -> None:
    """Run what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--picture", type=Path)
    parser.add_argument("--markdown", type=Path)
    options = parser.parse_args()
    truth = am.simulate.two_people(frames=800, rate=RATE, n_markers=N_MARKERS // 2, seed=1)
    burst = am.simulate.Burst(n=4, shortest=10, longest=60)
    made = am.simulate.corrupt(truth, burst=burst, noise=3e-4, seed=1)
    model = am.estimate_model(made.detections.part(0, 200)).model
    addresses: queue.Queue[str] = queue.Queue()
    stop, rows = threading.Event(), list[list[str]]()

    def look() -> None:
        try:
            rows.extend(measured(addresses, options.seconds, options.picture))
        finally:
            stop.set()

    threading.Thread(target=look, daemon=True).start()
    sink = PageSink(on_address=addresses.put)
    run = am.live.run(InTime(made.detections), [sink], method="gnn", model=model, stop=stop)
    head = ["page", "animation frames/s", "interval: median, ms", "99 %", "drawn/s", "stream, Hz",
            "page busy", "load"]  # fmt: skip
    publish([*table(head, rows), "", f"{run.n_tracks} tracks, {conditions()}."], options.markdown)


if __name__ == "__main__":
    main()
