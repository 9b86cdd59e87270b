"""Parts of the loop: clock, latency, queue, and the replacement of models."""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np
import pytest

import asterism as am
from asterism.live import LatencyHistogram
from asterism.live.clock import SourceClock
from asterism.live.estimation import BackgroundEstimator, DirectEstimator, differs
from asterism.live.faults import Faults
from asterism.live.intake import Accepted
from asterism.live.live_tracker import LiveTracker
from asterism.live.receiver import Receiver
from asterism.live.sources.base import EndOfSource
from asterism.tracking import Stitched
from tests.live.sources import Memory, frames_of


def test_quantiles_are_those_of_the_durations_within_a_class():
    rng = np.random.default_rng(1)
    durations = rng.lognormal(-7, 1, 20_000)
    latency = LatencyHistogram()
    for seconds in durations:
        latency.add(float(seconds))
    for share in (0.5, 0.99, 0.999):
        exact = np.quantile(durations, share)
        assert exact <= latency.quantile(share) * 1.001
        assert latency.quantile(share) < 1.07 * exact
    assert sum(n for _, n in latency.classes()) == latency.n == 20_000
    assert latency.quantile(1.0) == latency.longest == durations.max()
    assert math.isnan(LatencyHistogram().quantile(0.5))


def test_durations_beyond_the_classes_are_counted():
    latency = LatencyHistogram()
    for seconds in (0.0, 1e-9, 1e3):
        latency.add(seconds)
    assert latency.n == 3
    assert latency.quantile(1.0) == 1e3


@pytest.mark.parametrize("drift", [0.0, 5e-5, -2e-3])
def test_drift_is_found_under_delays_and_a_stall(drift):
    rng, clock = np.random.default_rng(2), SourceClock()
    for n in range(4000):
        time = n / 100
        delay = rng.exponential(0.003) + (2.0 if 1000 <= n < 1150 else 0.0)
        clock.add(time, 7 + (1 + drift) * time + delay)
    assert clock.drift == pytest.approx(drift, abs=2e-5)


def test_drift_is_unknown_at_first():
    clock = SourceClock()
    for n in range(100):
        clock.add(n / 100, n / 100)
    assert math.isnan(clock.drift)


def test_of_the_waiting_frames_the_oldest_are_dropped_and_an_end_comes_after_them(monkeypatch):
    monkeypatch.setattr("asterism.live.receiver.QUEUE", 2)
    frames = frames_of(am.simulate.cube(frames=6, seed=1).detections)
    receiver = Receiver(Memory(frames, waits=False), Faults("test"))
    assert receiver.next(0.0) is frames[0]
    while receiver.collect() and receiver.n_dropped < 3:
        pass
    assert [receiver.next(0.0).number for _ in range(2)] == [4, 5]
    with pytest.raises(EndOfSource):
        receiver.next(0.0)


def stepped(tracker, frames):
    return [tracker.step(Accepted(f, 0), 0.01) for f in frames]


def test_a_replaced_model_keeps_every_identity():
    truth = am.simulate.person(frames=500, rate=100, seed=1)
    burst = am.simulate.Burst(n=3, shortest=10, longest=40)
    made = am.simulate.corrupt(truth, burst=burst, noise=3e-4, seed=1)
    d = made.detections
    model = am.estimate_model(d).model
    first = am.estimate_model(d.part(0, 150)).model
    tracker = LiveTracker(Stitched(), (), None, None, Faults("test"))
    updates = stepped(tracker, frames_of(d)[:150])
    assert all((u.labels == -1).all() for u in updates)
    tracker.replace_model(first)
    while tracker.rehearse():
        pass
    assert tracker.model is first
    updates += stepped(tracker, frames_of(d)[150:300])
    tracker.replace_model(model)
    # The stream goes on while the new model catches up.
    for frame in frames_of(d)[300:320]:
        updates += stepped(tracker, [frame])
        for _ in range(20):
            tracker.rehearse()
    while tracker.rehearse():
        pass
    assert tracker.model is model
    assert tracker.n_models == 2
    updates += stepped(tracker, frames_of(d)[320:])
    labels = np.concatenate([u.labels for u in updates])
    before, after = (d.offsets[t] for t in (318, 322))
    own = slice(before, after)
    marker = made.labels[own]
    for m in np.unique(marker[marker >= 0]):
        ids = labels[own][marker == m]
        assert len(set(ids[ids >= 0].tolist())) <= 1
    # Revisions refer to the same detections as before the replacement.
    n_seen = 0
    for update in updates:
        n_seen += len(update.labels)
        assert (update.revised < n_seen).all()
        assert (update.revised >= 0).all()


@pytest.mark.parametrize("kind", [DirectEstimator, BackgroundEstimator])
def test_estimates_are_those_of_estimate_model(kind):
    d = am.simulate.corrupt(am.simulate.cube(frames=80, seed=1), noise=3e-4, seed=1).detections
    estimator = kind()
    assert estimator.result() is None
    estimator.start(d)
    assert estimator.is_busy
    model = waited(estimator)
    expected = am.estimate_model(d).model
    assert isinstance(model, am.TrackingModel)
    assert model.to_toml() == expected.to_toml()
    assert not differs(model, expected)
    assert not estimator.is_busy
    estimator.start(d.part(0, 2))
    assert "at least 3 frames" in waited(estimator)
    estimator.close()


def waited(estimator):
    end = time.monotonic() + 60
    while (result := estimator.result()) is None and time.monotonic() < end:
        time.sleep(0.01)
    return result


def test_models_differ_by_noise_and_motion():
    d = am.simulate.cube(frames=80, seed=1).detections
    model = am.estimate_model(d).model
    sensor = dataclasses.replace(model.sensor, noise_sigma=1.5 * model.sensor.noise_sigma)
    assert differs(dataclasses.replace(model, sensor=sensor), model)
