"""Scores of the frames that a sink has received."""

from __future__ import annotations

import dataclasses

import numpy as np

import asterism as am


def tracks_of(frames):
    """Tracks of what a sink has received."""
    times = [f.time for f in frames]
    d = am.Detections.from_frames(times, [f.points for f in frames])
    labels = np.concatenate([f.labels for f in frames])
    _, ids = np.unique(labels[labels >= 0], return_inverse=True)
    dense = labels.copy()
    dense[labels >= 0] = ids
    return am.Tracks(detections=d, labels=dense)


def judged(frames, made):
    """Scores against the truth; the numbers of the frames are those of the scene."""
    kept = [f.number for f in frames]
    d = made.detections
    truth = am.Tracks.from_dense(d.times[kept], made.positions()[kept])
    found = tracks_of([dataclasses.replace(f, time=float(d.times[f.number])) for f in frames])
    return am.evaluate(found, truth)
