"""Streams from a source in memory, with the faults of networks and of sources."""

from __future__ import annotations

import dataclasses
import logging
import threading
import time

import numpy as np
import pytest

import asterism as am
from asterism.errors import SinkError, SourceError
from asterism.live.switchable import Switchable
from asterism.tracking import Stitched
from tests.live.judged import judged
from tests.live.sources import LOST, Kept, Memory, Unreachable, frames_of, with_faults

RATE = 100.0


@pytest.fixture(scope="module")
def scene():
    """A person in bursts of occlusions, its truth, and a model."""
    truth = am.simulate.person(frames=600, rate=RATE, seed=3)
    burst = am.simulate.Burst(n=2, shortest=5, longest=40)
    made = am.simulate.corrupt(truth, burst=burst, noise=3e-4, clutter=0.02, seed=3)
    return made, am.estimate_model(made.detections).model


def followed(items, model, *, method=None, **options):
    """Run a stream to its end; return the result and the frames."""
    sink = Kept()
    source = items if isinstance(items, Memory) else Memory(items)
    run = am.live.run(source, [sink], model=model, method=method, **options)
    assert not sink.is_open
    return run, sink.frames


@pytest.fixture(scope="module")
def clean(scene):
    """Frames of the stream without a fault."""
    made, model = scene
    return followed(frames_of(made.detections), model)[1]


@pytest.mark.parametrize(
    "method", [am.GNN(), am.JPDA(), am.TOMHT(), Stitched()], ids=lambda m: m.name
)
def test_identities_are_those_of_offline_tracking_by_the_same_method(scene, method):
    made, model = scene
    d = made.detections.part(0, 400)
    _, frames = followed(frames_of(d), model, method=method)
    state = method.init(model)
    for frame, (now, points) in zip(frames, d, strict=True):
        state, update = method.step(state, now, points)
        assert (frame.labels == update.labels).all()
        assert frame.time == now
        assert (np.sort(frame.tracks.ids) == np.sort(update.tracks.ids)).all()


def test_header_and_counts(scene):
    made, model = scene
    sink = Kept()
    seen = []
    run = am.live.run(
        Memory(frames_of(made.detections), rate=RATE), [sink], model=model, status=seen.append
    )
    assert sink.header.source == "memory"
    assert sink.header.rate == RATE
    assert run.n_frames == 600
    assert run.latency.n == 600
    assert run.rate == pytest.approx(RATE, rel=1e-3)
    assert run.faults == {}
    assert run.model is model
    assert seen
    assert seen[-1].source == "memory"


def test_the_states_of_tracks_are_computed_for_the_sinks_that_use_them(
    scene, tmp_path, monkeypatch
):
    made, model = scene
    frames, step, n_reads = frames_of(made.detections.part(0, 60)), Switchable.step, []

    def counted(*args, **options):
        state, update = step(*args, **options)

        def read():
            n_reads.append(1)
            return update.tracks

        return state, dataclasses.replace(update, read_tracks=read)

    monkeypatch.setattr(Switchable, "step", counted)
    run = am.live.run(Memory(frames), [str(tmp_path / "a.csv")], model=model, method="gnn")
    assert len(n_reads) < 10  # for the counts
    assert run.n_tracks > 20
    n_reads.clear()
    am.live.run(Memory(frames), [str(tmp_path / "a.jsonl")], model=model, method="gnn")
    assert len(n_reads) == 60


FAULTS = {
    "1 % loss": {"loss": 0.01},
    "duplicates": {"twice": 0.05},
    "reordering within 5 frames": {"shuffled": 0.02},
    "garbage": {"garbage": 0.1},
    "all of them": {"loss": 0.01, "twice": 0.02, "shuffled": 0.01, "garbage": 0.02},
}


@pytest.mark.parametrize("faults", FAULTS.values(), ids=FAULTS)
def test_faults_of_the_network_cost_no_identity(scene, clean, faults, caplog):
    made, model = scene
    rng = np.random.default_rng(5)
    with caplog.at_level(logging.WARNING, logger="asterism"):
        run, frames = followed(with_faults(frames_of(made.detections), rng, **faults), model)
    # What is dropped costs what the same frames without points would cost.
    there = {f.number for f in frames}
    d = made.detections
    empty = [d.frame(t) if t in there else np.empty((0, 3)) for t in range(d.n_frames)]
    lacking = am.Detections.from_frames(d.times, empty)
    offline = followed(frames_of(lacking), model)[1]
    own, best, least = (
        judged([f for f in each if f.number in there], made) for each in (frames, offline, clean)
    )
    assert own.switches <= max(best.switches, least.switches) + 1
    assert own.idf1 > min(best.idf1, least.idf1) - 0.01
    kinds = [r.message.rsplit("as ", 1)[-1] for r in caplog.records]
    assert len(kinds) == len(set(kinds)) == len(run.faults)


def paused(frames, at, seconds, *, restarts):
    """Let a source pause; it may begin anew, by number and time."""
    late = [
        dataclasses.replace(
            f,
            number=f.number - (at if restarts else 0),
            time=f.time - frames[at].time if restarts else f.time + seconds,
            received=f.received + seconds,
        )
        for f in frames[at:]
    ]
    return [*frames[:at], *late]


@pytest.mark.parametrize("restarts", [False, True], ids=["pause", "restart"])
@pytest.mark.parametrize("seconds", [0.03, 0.3, 5.0])
def test_a_pause_costs_what_a_gap_of_that_length_costs(scene, seconds, restarts, monkeypatch):
    monkeypatch.setattr("asterism.live.loop.MAX_AGE", float("inf"))
    monkeypatch.setattr("asterism.live.receiver.QUEUE", 10_000)
    made, model = scene
    d = made.detections
    frames = paused(frames_of(d), 300, seconds, restarts=restarts)
    _, found = followed(Memory(frames, waits=False), model)
    n_lost = 1 if restarts else 0  # a restart is certain by its second frame
    assert len(found) == d.n_frames - n_lost
    # Offline, the capture has frames without points meanwhile.
    n_empty = round(seconds * RATE) + n_lost
    points = [d.frame(t) for t in range(300)] + [np.empty((0, 3))] * n_empty
    points += [d.frame(t) for t in range(300 + n_lost, d.n_frames)]
    times = np.round(np.arange(len(points)) / RATE, 6)
    method, state = Stitched(), Stitched().init(model)
    expected = []
    for now, frame in zip(times, points, strict=True):
        state, update = method.step(state, float(now), frame)
        if len(frame):
            expected.append(update.labels)
    if seconds < 1:
        assert all((f.labels == labels).all() for f, labels in zip(found, expected, strict=True))
        return
    kept = [*range(300), *range(300 + n_lost, d.n_frames)]
    offline = [
        dataclasses.replace(f, labels=labels, number=t)
        for f, labels, t in zip(found, expected, kept, strict=True)
    ]
    live = [dataclasses.replace(f, number=t) for f, t in zip(found, kept, strict=True)]
    a, b = judged(live, made), judged(offline, made)
    assert a.switches <= b.switches + 1
    assert a.idf1 >= b.idf1 - 0.01


def test_the_connection_is_tried_again_until_it_is_there(scene, monkeypatch):
    made, model = scene
    monkeypatch.setattr("asterism.live.receiver.FIRST_WAIT", 0.01)
    frames = frames_of(made.detections.part(0, 60))
    source = Unreachable([*frames[:30], LOST, *frames[30:]], n_refused=3)
    run, found = followed(source, model)
    assert source.n_opened == 5
    assert [f.number for f in found] == list(range(60))
    assert run.faults == {"disconnects": 1}


def test_a_source_that_is_not_there_is_an_error_at_the_start(scene):
    class Nowhere(Memory):
        def open(self):
            raise SourceError("memory: no answer.")

    with pytest.raises(SourceError, match="no answer"):
        followed(Nowhere([]), scene[1])


def test_an_error_of_the_source_ends_the_stream_and_closes_the_sinks(scene):
    sink = Kept()
    frames = frames_of(scene[0].detections.part(0, 5))
    with pytest.raises(RuntimeError, match="broken"):
        am.live.run(Memory([*frames, RuntimeError("broken")]), [sink], model=scene[1])
    assert len(sink.frames) == 5
    assert not sink.is_open


def test_a_sink_that_fails_is_left_out_and_the_others_go_on(scene):
    class Failing(Kept):
        def send(self, frame):
            super().send(frame)
            raise SinkError("failing: gone.")

    failing, other = Failing(), Kept()
    frames = frames_of(scene[0].detections.part(0, 20))
    run = am.live.run(Memory(frames), [failing, other], model=scene[1])
    assert (len(failing.frames), len(other.frames)) == (1, 20)
    assert run.faults == {"sinks": 1}
    assert not failing.is_open


def test_tracking_that_falls_behind_drops_frames_and_stays_in_time(scene, monkeypatch):
    monkeypatch.setattr("asterism.live.loop.MAX_AGE", 0.05)

    class Slow(Kept):
        def send(self, frame):
            super().send(frame)
            time.sleep(0.004)

    sink = Slow()
    frames = frames_of(scene[0].detections)
    source = Memory(frames, waits=False, rate=1000.0, period=0.001)
    run = am.live.run(source, [sink], model=scene[1])
    assert run.faults["late"] > 100
    assert run.n_frames + run.faults["late"] == 600
    assert "lost" not in run.faults
    assert run.latency.longest < 1.0
    assert max(f.done - f.received for f in sink.frames) < 0.5


def test_a_stop_from_another_thread_ends_the_stream(scene):
    stop, sink = threading.Event(), Kept()
    frames = frames_of(scene[0].detections)

    def end():
        while not sink.frames:
            time.sleep(0.01)
        stop.set()

    threading.Thread(target=end, daemon=True).start()
    run = am.live.run(Memory(frames, waits=False, period=0.1), [sink], model=scene[1], stop=stop)
    assert 0 < run.n_frames < 300
    assert not sink.is_open


def test_the_model_comes_from_the_first_seconds_and_tracks_keep_their_identities(scene):
    made, _ = scene
    run, frames = followed(frames_of(made.detections), None)
    assert run.n_models >= 1
    unlabelled = [f.number for f in frames if (f.labels < 0).all()]
    assert unlabelled == list(range(201))
    assert (frames[300].labels >= 0).mean() > 0.9
    assert judged(frames[250:], made).idf1 > 0.9


def test_a_marker_set_names_the_points(scene):
    made, model = scene
    marker_set = am.learn_marker_set(am.simulate.person(frames=200, rate=RATE, seed=3))
    run, frames = followed(frames_of(made.detections), model, marker_set=marker_set)
    last = frames[-1]
    assert run.n_names > 40
    named = [name for name in last.names if name]
    assert len(named) == len(set(named)) > 35
    assert set(named) <= set(marker_set.names)


@pytest.mark.parametrize("given", [True, False], ids=["model", "no model"])
def test_a_marker_set_is_learnt_from_the_first_seconds(scene, given, monkeypatch):
    monkeypatch.setattr("asterism.live.live_tracker.LEARN_SECONDS", 2.0)
    made, model = scene
    run, frames = followed(frames_of(made.detections), model if given else None, marker_set="learn")
    assert run.n_names > 40
    first = next(f for f in frames if f.names is not None)
    assert first.time == pytest.approx(2.0 if given else 4.0, abs=0.2)
    # A marker keeps its name.
    marker_of = {}
    d = made.detections
    n_right = n_all = 0
    for frame in frames[first.number :]:
        truth = made.labels[d.offsets[frame.number] : d.offsets[frame.number + 1]]
        for name, marker in zip(frame.names, truth.tolist(), strict=True):
            if name is not None and marker >= 0:
                n_all += 1
                n_right += marker_of.setdefault(name, marker) == marker
    assert n_all > 5000
    assert n_right > 0.97 * n_all
    assert max(f.names is None for f in frames[first.number :]) is False


def test_after_a_long_pause_tracks_begin_anew_and_get_their_names_again(scene):
    made, model = scene
    marker_set = am.learn_marker_set(am.simulate.person(frames=200, rate=RATE, seed=3))
    frames = paused(frames_of(made.detections), 300, 120.0, restarts=False)
    _, found = followed(frames, model, marker_set=marker_set)
    before, after = found[299], found[-1]
    assert not set(before.tracks.ids.tolist()) & set(after.tracks.ids.tolist())
    assert 45 < len(after.tracks) < 65
    assert len(set(after.names) & set(before.names) - {None}) > 35


def test_the_model_is_refined_while_the_stream_runs(scene, monkeypatch):
    monkeypatch.setattr("asterism.live.loop.REFINE", (3.0, 4.5))
    monkeypatch.setattr("asterism.live.loop.differs", lambda new, old: True)
    made, _ = scene
    run, frames = followed(frames_of(made.detections), None)
    assert run.n_models == 3
    assert judged(frames[210:], made).idf1 > 0.9
    # No identity changes at a replacement.
    d = made.detections
    for at in (300, 450):
        before, after = frames[at - 3], frames[at + 3]
        of = [
            dict(zip(made.labels[d.offsets[f.number] : d.offsets[f.number + 1]], f.labels,
                     strict=True)) for f in (before, after)
        ]  # fmt: skip
        common = [m for m in of[0] if m >= 0 and of[0][m] >= 0 and of[1].get(m, -1) >= 0]
        assert len(common) > 40
        assert sum(of[0][m] != of[1][m] for m in common) <= 1
