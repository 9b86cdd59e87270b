"""The loop of a stream: receive, check, track, pass on; estimate and refine the model meanwhile."""

from __future__ import annotations

import gc
import logging
import math
from time import perf_counter
from typing import TYPE_CHECKING, Any, Literal

from asterism.errors import AsterismError
from asterism.live.clock import SourceClock
from asterism.live.estimation import BackgroundEstimator, DirectEstimator, differs
from asterism.live.faults import Faults
from asterism.live.frame import LiveFrame, StreamHeader
from asterism.live.intake import Accepted, Intake
from asterism.live.latency import LatencyHistogram
from asterism.live.live_run import LiveRun
from asterism.live.live_tracker import LiveTracker
from asterism.live.low_latency import low_latency
from asterism.live.receiver import Receiver
from asterism.live.sinks.page import PageSink
from asterism.live.sources.base import EndOfSource

if TYPE_CHECKING:
    import threading
    from collections.abc import Callable, Sequence

    from asterism.live.estimation import Estimator
    from asterism.live.sinks.base import Sink
    from asterism.live.sources.base import Source
    from asterism.model import MarkerSet, TrackingModel
    from asterism.tracking.methods import Method

__all__ = ["LiveLoop"]

log = logging.getLogger(__name__)

MAX_AGE = 1.0
"""Seconds after which a waiting frame is dropped, if a later one waits too."""
FIRST_SECONDS = 2.0
"""Seconds of frames from which the first model is estimated."""
REFINE = (10.0, 30.0, 60.0)
"""Seconds of the stream at which the model is refined; then at multiples of the last."""
SILENCE = 1.0
"""Seconds without a frame that are a pause."""
COLLECT = 256
"""Number of frames between two collections of garbage."""
STATUS = 0.5
"""Seconds between two reports of the counts."""
_IDLE = 0.05  # seconds, after which the loop looks at the clock


class LiveLoop:
    """One stream from a source to sinks.

    Parameters
    ----------
    source, sinks
        Source and sinks, not yet open.
    method, model, marker_sets, seed
        As for `run`.
    """

    def __init__(
        self,
        source: Source,
        sinks: Sequence[Sink],
        *,
        method: Method[Any],
        model: TrackingModel | None,
        marker_sets: Sequence[MarkerSet] | Literal["learn"],
        seed: int | None,
    ) -> None:
        self._source, self._sinks = source, list(sinks)
        self._faults = Faults(source.name)
        self._clock, self._latency = SourceClock(), LatencyHistogram()
        self._tracker = LiveTracker(method, marker_sets, model, seed, self._faults)
        known = () if isinstance(marker_sets, str) else marker_sets
        self._names = tuple(name for made in known for name in made.full_names)
        self._estimator: Estimator | None = None
        self._next_estimate = FIRST_SECONDS if model is None else math.inf
        self._first_time: float | None = None
        self._elapsed = 0.0  # seconds of the stream
        self._n_frames = 0
        self._last: LiveFrame | None = None
        self._last_arrival = math.inf
        self._is_silent = False

    def run(self, stop: threading.Event, status: Callable[[LiveRun], Any] | None = None) -> LiveRun:
        """Open everything, track until the source ends or `stop` is set, and close everything."""
        source, opened = self._source, list[Any]()
        waits = source.waits
        receiver = Receiver(source, self._faults)
        try:
            source.open()
            header = StreamHeader(source=source.name, rate=source.rate, names=self._names)
            for sink in self._sinks:
                sink.open(header)
                opened.append(sink)
            self._intake = intake = Intake(
                self._faults, self._clock, rate=source.rate, in_real_time=not waits
            )
            self._estimator = DirectEstimator() if waits else BackgroundEstimator()
            if math.isfinite(self._next_estimate):
                self._estimator.prepare()
            with low_latency():
                self._follow(receiver, intake, stop, status, waits=waits)
        finally:
            receiver.close()
            if self._estimator is not None:
                self._estimator.close()
            for sink in opened:
                sink.close()
        return self.snapshot()

    def snapshot(self) -> LiveRun:
        """Return the present counts."""
        faults = dict(self._faults.counts)
        for other in (self._source, *self._sinks):
            faults |= {f"{other.name} {kind}": n for kind, n in other.faults.items() if n}
        period = self._intake.period
        tracks = None if self._last is None else self._last.tracks
        return LiveRun(
            source=self._source.name, n_frames=self._n_frames,
            n_tracks=0 if tracks is None else len(tracks),
            n_names=self._tracker.n_names, rate=1 / period if period else math.nan,
            latency=self._latency, drift=self._clock.drift, faults=faults,
            model=self._tracker.model, n_models=self._tracker.n_models,
        )  # fmt: skip

    def _follow(
        self,
        receiver: Receiver,
        intake: Intake,
        stop: threading.Event,
        status: Callable[[LiveRun], Any] | None,
        *,
        waits: bool,
    ) -> None:
        tracker, next_status, n_dropped = self._tracker, 0.0, 0
        while not stop.is_set():
            try:
                frame = receiver.next(_IDLE)
            except EndOfSource:
                return
            if frame is not None:
                is_late = len(receiver) > 0 and perf_counter() - frame.received > MAX_AGE
                if is_late or receiver.n_dropped > n_dropped:
                    n = int(is_late) + receiver.n_dropped - n_dropped
                    n_dropped = receiver.n_dropped
                    self._faults.add("late", "tracking is behind and frames are dropped", n)
                    intake.dropped(n)
                if is_late:
                    continue
                accepted = intake.take(frame)
                if accepted is not None:
                    self._track(accepted, intake.period)
            now = perf_counter()
            self._notice_silence(now, is_frame=frame is not None)
            if receiver.collect():
                continue
            # The next frame is a few milliseconds away: this is the time for everything else.
            tracker.prepare()
            if now >= next_status:
                next_status = now + STATUS
                self._report(status)
            self._learn()
            while tracker.rehearse() and not receiver.collect():
                pass

    def _report(self, status: Callable[[LiveRun], Any] | None) -> None:
        """Pass on the present counts."""
        run = self.snapshot()
        for sink in self._sinks:
            if isinstance(sink, PageSink):
                sink.show(run)
        if status is not None:
            status(run)

    def _track(self, accepted: Accepted, period: float) -> None:
        frame = accepted.frame
        if self._first_time is None:
            self._first_time = frame.time
        self._elapsed = frame.time - self._first_time
        update = self._tracker.step(accepted, period)
        self._last = last = LiveFrame(
            number=frame.number, time=frame.time, points=frame.points, labels=update.labels,
            names=update.names, read_tracks=update.read_tracks, received=frame.received,
            done=perf_counter(),
        )  # fmt: skip
        for sink in tuple(self._sinks):
            try:
                sink.send(last)
            except (AsterismError, OSError) as error:
                self._faults.add("sinks", f"{sink.name} fails and is left out ({error})")
                self._sinks.remove(sink)
        self._latency.add(perf_counter() - frame.received)
        self._n_frames += 1
        if self._n_frames % COLLECT == 0:
            gc.collect()

    def _notice_silence(self, now: float, *, is_frame: bool) -> None:
        if is_frame:
            self._last_arrival, self._is_silent = now, False
        elif not self._is_silent and now - self._last_arrival > SILENCE:
            self._is_silent = True
            self._faults.add("pauses", f"no frame for {SILENCE:g} s")

    def _learn(self) -> None:
        """Begin an estimate of the model when it is due, and take up its result."""
        estimator, tracker = self._estimator, self._tracker
        assert estimator is not None
        if tracker.learn_names():
            log.info("%s: a marker set of %d names", self._source.name, tracker.n_names)
        if self._elapsed >= self._next_estimate and not estimator.is_busy:
            estimator.start(tracker.recent())
            late = REFINE[-1] * (1 + self._elapsed // REFINE[-1])
            self._next_estimate = next((t for t in REFINE if t > self._elapsed), late)
        result = estimator.result()
        if result is None:
            return
        if isinstance(result, str):
            self._faults.add("no_model", f"no model can be estimated yet ({result})")
            if tracker.model is None:
                self._next_estimate = self._elapsed + FIRST_SECONDS
        elif tracker.model is None or differs(result, tracker.model):
            log.info(
                "%s: %s model, noise %.2g mm", self._source.name,
                "first" if tracker.model is None else "refined", 1e3 * result.sensor.noise_sigma,
            )  # fmt: skip
            tracker.replace_model(result)
