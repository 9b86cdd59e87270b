"""Sources in memory: frames as they are, or with the faults of a network; and a sink that keeps."""

from __future__ import annotations

import dataclasses
import time

import numpy as np

from asterism.errors import SourceError, SourceLost
from asterism.live import EndOfSource, SourceFrame


def frames_of(detections, *, first=0):
    """Frames of a capture that arrive on time, by a clock that starts at 100 s."""
    return [
        SourceFrame(number=first + t, time=float(time_), points=points, received=100 + float(time_))
        for t, (time_, points) in enumerate(detections)
    ]


class Memory:
    """A source of prepared frames; an item may also be an error, which is raised.

    The times of arrival are those of the frames unless the source is in real time.
    """

    def __init__(self, items, *, waits=True, rate=0.0, period=0.0):
        self.name, self.rate, self.waits = "memory", rate, waits
        self.faults, self.n_opened = {}, 0
        self._items, self._period = list(items), period
        self._next = 0.0

    def open(self):
        self.n_opened += 1

    def receive(self, timeout):
        if not self._items:
            raise EndOfSource(self.name)
        if self._period:
            due = max(self._next + self._period, time.perf_counter() - 0.1)
            if (wait := due - time.perf_counter()) > timeout:
                time.sleep(timeout)
                return None
            self._next = due
            time.sleep(max(0.0, wait))
        item = self._items.pop(0)
        if isinstance(item, (int, float)):
            time.sleep(item)
            return None
        if isinstance(item, Exception):
            raise item
        if self._period:
            return dataclasses.replace(item, received=time.perf_counter())
        return item

    def close(self):
        pass


class Unreachable(Memory):
    """A source that refuses some attempts to connect again."""

    def __init__(self, items, n_refused, **options):
        super().__init__(items, **options)
        self._n_refused = n_refused

    def open(self):
        super().open()
        if self.n_opened > 1 and self._n_refused:
            self._n_refused -= 1
            raise SourceError("memory: refuses.")


class Kept:
    """A sink that keeps every frame."""

    def __init__(self):
        self.name, self.faults = "kept", {}
        self.frames, self.header, self.is_open = [], None, False

    def open(self, header):
        self.header, self.is_open = header, True

    def send(self, frame):
        self.frames.append(frame)

    def close(self):
        self.is_open = False


LOST = SourceLost("the connection is gone.")


def with_faults(frames, rng, *, loss=0.0, twice=0.0, shuffled=0.0, garbage=0.0):
    """Lose, repeat, reorder within five frames and corrupt frames at random."""
    frames = [f for f in frames if rng.random() >= loss]
    places = np.arange(len(frames)) + 0.0
    moved = rng.random(len(frames)) < shuffled
    places[moved] += rng.uniform(0, 5, moved.sum())
    out = []
    for i in np.argsort(places, kind="stable"):
        frame = frames[i]
        if rng.random() < garbage:
            rows = rng.uniform(-1, 1, (3, 3)) * np.array([[np.nan], [np.inf], [1e30]])
            frame = dataclasses.replace(frame, points=np.concatenate([frame.points, rows]))
        out.append(frame)
        if rng.random() < twice:
            out.append(frame)
    return out
