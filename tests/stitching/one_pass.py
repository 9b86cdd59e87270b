"""A rigid cluster with one occluded marker, and one pass of the stitcher over it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

import asterism as am
from asterism import _engine
from asterism.model.compiled import motion_model, steps_of
from asterism.tracking.stitching.whole import stitch_options

NOISE = 1e-3
MODEL = am.TrackingModel(
    motion=am.DWNA(acceleration_sigma=1, velocity_sigma=1),
    sensor=am.Sensor(noise_sigma=NOISE, p_detection=0.9, clutter_density=0.1),
    population=am.Population(birth_density=0.1, p_disappear=0.001, max_speed=5, max_gap=4),
)
BODY = np.random.default_rng(1).uniform(-0.4, 0.4, (8, 3))
PLACE = np.array([0.05, 0.02, 0.1])  # of the marker that is occluded
WEIGHT = 0.25


@dataclasses.dataclass
class Found:
    """Of each fragment, in order of its label: the marker, the label before, how probably."""

    tracklets: Any
    marker: list[int]
    after: list[int]
    probability: Any
    n_cuts: int

    def logit(self, k):
        return float(np.log(self.probability[k] / (1 - self.probability[k])))


def one_pass(dense, *, advice=(), model=MODEL, confirm=15, max_occlusion=None, may_cut=True):
    """Stitch forward once; each column of (frames, labels, 3) is a label, and begins in order."""
    take = am.Tracks.from_dense(np.arange(len(dense)) / 100, dense)
    d = take.detections
    motion = motion_model(model, dense.shape[2])
    options = stitch_options(model, confirm, 0.03, max_occlusion, may_cut)
    stitcher = _engine.Stitcher(motion, options)
    if len(advice):
        of, before, weights = zip(*advice, strict=True)
        stitcher.advise(np.array(of), np.array(before), np.array(weights, dtype=float))
    tracklets = stitcher.run(
        d.times, *steps_of(model.motion, d.times), d.offsets, d.points, take.labels
    )
    markers, after, probabilities = stitcher.finish()
    return Found(tracklets, markers.tolist(), after.tolist(), probabilities, stitcher.n_cuts)


def scene(*seen, frames=300, body=BODY):
    """A body at rest, and others beside it as (first, last, place), in order of the first."""
    dense = np.full((frames, len(body) + len(seen), 3), np.nan)
    dense[:, : len(body)] = body
    for k, (first, last, place) in enumerate(seen, len(body)):
        dense[first : last + 1, k] = place
    return dense
