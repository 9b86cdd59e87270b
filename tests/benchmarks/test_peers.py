"""Every peer of the benchmark, where it is installed: labels that fit, and that are of some use."""

from __future__ import annotations

import gc
import sys

import numpy as np
import pytest

import asterism as am
from tests.paths import ROOT

sys.path.append(str(ROOT / "benchmarks"))

from field_clips import cut
from measured import measured
from peers import PEERS, in_frames
from peers.peer import length_of

MODULES = {"nrl-tracker": "pytcl"}


def tiny():
    truth = am.simulate.cube(seed=1, frames=25)
    return am.simulate.corrupt(truth, missing=0.05, clutter=0.05, noise=0.002, seed=1)


@pytest.mark.filterwarnings("default")  # of others' making
@pytest.mark.parametrize("name", PEERS)
def test_a_peer_labels_every_detection(name):
    peer = PEERS[name]
    if peer.package:
        pytest.importorskip(MODULES.get(peer.package, peer.package), exc_type=ImportError)
    truth = tiny()
    d = in_frames(truth.detections)
    try:
        labels = peer.label(d, peer.middle())
    except Exception as error:
        if isinstance(error.__cause__, OSError):
            pytest.skip(f"{name} does not load here: {error.__cause__}")
        raise
    assert labels.shape == (d.n_points,)
    assert labels.min() >= -1
    for t in range(d.n_frames):  # a track has one detection a frame
        here = labels[d.offsets[t] : d.offsets[t + 1]]
        here = here[here >= 0]
        assert len(np.unique(here)) == len(here)
    tracks = am.Tracks(detections=truth.detections, labels=labels)
    # laptrack has no motion, and the middle of btrack's space is far from its best; all others
    # follow a cube by far the most of the time.
    assert am.evaluate(tracks, truth).idf1 > (0.2 if name in {"laptrack", "btrack"} else 0.6)


@pytest.mark.parametrize("name", PEERS)
def test_settings_are_drawn_inside_their_space(name):
    peer = PEERS[name]
    rng = np.random.default_rng(1)
    for setting in (peer.middle(), *(peer.draw(rng) for _ in range(50))):
        assert setting.keys() == peer.space.keys()
        for key, (low, high) in peer.space.items():
            assert low <= setting[key] <= high
            assert isinstance(setting[key], int) == isinstance(low, int)
    again = np.random.default_rng(1)
    assert peer.draw(again) == peer.draw(np.random.default_rng(1))


@pytest.mark.parametrize("name", [name for name, peer in PEERS.items() if peer.like])
def test_a_search_begins_with_what_fits_of_another_setting(name):
    peer = PEERS[name]
    setting = {**dict.fromkeys(peer.space, 1e9), "of another": 1.0}
    found = peer.near(setting)
    assert found == {key: high for key, (_, high) in peer.space.items()}
    assert peer.near({}) == peer.middle()
    shared = set(peer.like.space) & set(peer.space)
    assert {"process", "noise", "speed", "max_gap"} <= shared


def test_lengths_are_those_of_the_markers_that_move():
    # Two of three markers rest: their median step is nothing, and a reach of so many of those too.
    frames = [np.array([[0, 0, 0], [9, 0, 0], [0.03 * t, 5, 0]]) for t in range(20)]
    d = am.Detections.from_frames(np.arange(20.0), frames)
    assert length_of(d) == pytest.approx(0.03)
    at_rest = am.Detections.from_frames(np.arange(20.0), [frames[0]] * 20)
    assert length_of(at_rest) == pytest.approx(0.001)


def test_a_run_is_ended_at_its_limit_and_says_why_it_failed():
    def forever():
        while True:
            pass

    def fails():
        raise ValueError("no such thing")

    assert measured(forever, 1).error == "more than 1 s"
    assert measured(fails, 5).error == "ValueError: no such thing"
    done = measured(lambda: np.arange(3), 5)
    np.testing.assert_array_equal(done.labels, [0, 1, 2])
    assert done.error == ""


def test_memory_is_that_of_the_run():
    held = np.ones(30_000_000)  # the parent's own does not count

    class Knot:
        pass

    gc.collect()
    gc.disable()  # nor what of it could be freed
    knot = Knot()
    knot.itself, knot.values = knot, np.ones(30_000_000)
    del knot
    pieces = [np.ones(10_000) for _ in range(3_000)]  # nor what it freed and still keeps
    above = pieces.pop()
    pieces.clear()

    def work():
        gc.collect()
        return np.full(20_000_000, 2.0)[:3].astype(int)

    run = measured(work, 20)
    gc.enable()
    if not np.isnan(run.megabytes):
        assert 120 < run.megabytes < 220
    assert held[0] == above[0] == 1


@pytest.mark.parametrize("is_middle", [False, True])
def test_a_part_of_a_capture_keeps_its_truth(is_middle):
    truth = tiny()
    part = cut(truth, 10, is_middle=is_middle)
    assert part.detections.n_frames == 10
    first = 7 if is_middle else 0
    d = truth.detections
    inside = slice(d.offsets[first], d.offsets[first + 10])
    np.testing.assert_array_equal(part.detections.points, d.points[inside])
    np.testing.assert_array_equal(part.detections.times, d.times[first : first + 10])
    a, b = truth.labels[inside], part.labels
    np.testing.assert_array_equal(a >= 0, b >= 0)
    pairs = set(zip(a[a >= 0].tolist(), b[b >= 0].tolist(), strict=True))
    assert len(pairs) == len({x for x, _ in pairs}) == len({y for _, y in pairs})
