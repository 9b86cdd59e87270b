"""Shared accelerations by the evidence of frames left out: segments have them, a swarm has none."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import asterism as am
from asterism.cli import main
from asterism.reporting.shared_evidence import _blocks, found_tracks, shared_evidence
from tests.methods.test_shared_size import segments
from tests.paths import DATA


def evidence(tracks):
    return shared_evidence(tracks, am.estimate_model(tracks.detections).model)


@pytest.mark.parametrize("n_axes", [2, 3])
def test_segments_have_an_acceleration_in_common(n_axes):
    found = evidence(segments(1, sigma=20.0, n_axes=n_axes, n_frames=600))
    assert found.gain > 5 * found.gain_std
    assert found.size == pytest.approx(20.0, abs=4 * found.std)
    assert found.n_tracks == 12
    ((name, text),) = found.rows()
    assert name == "shared acceleration"
    assert text.startswith(f"{found.size:.3g} ± ")
    assert f"gain {found.gain:.2g} ± " in text


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("frames", [80, 200, 600])
def test_a_swarm_has_nothing_in_common(frames, seed):
    """By own motion with smaller variances alone, its detections would gain 0.4 nats."""
    truth = am.simulate.swarm(frames=frames, seed=seed)
    noisy = am.simulate.corrupt(truth, missing=0.1, clutter=0.1, noise=3e-4, seed=seed)
    for tracks in (truth, noisy):
        model = am.estimate_model(tracks.detections).model
        for each in (tracks, found_tracks(tracks.detections, model)):
            found = shared_evidence(each, model)
            assert (found.size, found.n_tracks) == (0.0, 0)
            assert found.rows() == [("shared acceleration", "nothing in common")]


def test_found_tracks_show_what_true_tracks_show():
    truth = am.simulate.corrupt(
        am.simulate.person(frames=300, seed=1), missing=0.1, clutter=0.1, noise=3e-4, seed=1
    )
    model = am.estimate_model(truth.detections).model
    true = shared_evidence(truth, model)
    found = shared_evidence(found_tracks(truth.detections, model), model)
    assert found.gain == pytest.approx(true.gain, abs=3 * true.gain_std)
    assert found.size == pytest.approx(true.size, abs=3 * true.std)


def test_the_gain_is_that_of_the_frames_left_out():
    """Independent noise there takes the gain away, which the frames of the learning still have."""
    truth = segments(3, sigma=20.0, n_frames=600)
    d, model = truth.detections, am.estimate_model(truth.detections).model
    clean = shared_evidence(truth, model).gain
    assert clean > 0.3
    is_left_out = np.zeros(d.n_frames, dtype=bool)
    for first, end in _blocks(truth)[1::2]:
        is_left_out[first:end] = True
    noise = np.random.default_rng(1).normal(0, 0.002, d.points.shape)
    noisy = dataclasses.replace(d, points=d.points + noise * is_left_out[d.frame_of, None])
    assert shared_evidence(am.Tracks(detections=noisy, labels=truth.labels), model).gain < clean / 2


CAPTURES = (
    "HC030A22.c3d", "JA1Gait35.c3d", "kinematics_basket_sprint.c3d", "kinematics_racing_full.c3d",
    "kinematics_tennis_serve_2players.c3d", "mocap36.c3d", "nick_freeform_001.c3d",
    "PronetoRun01.c3d", "recording.tsv", "Running_0002.c3d", "runway_13.c3d", "testdata.c3d",
    "walking_1.c3d",
)  # fmt: skip


@pytest.mark.skipif(not DATA.is_dir(), reason="no real captures in ../shared/data")
@pytest.mark.parametrize("name", CAPTURES)
@pytest.mark.filterwarnings("ignore")
def test_real_captures_show_the_same_without_names(name):
    """Sizes within two standard errors; gains, which wrong links lower, also within a tenth."""
    capture = am.read(next(DATA.rglob(name)))
    model = am.estimate_model(capture).model
    named = shared_evidence(capture.tracks, model)
    found = shared_evidence(found_tracks(capture, model), model)
    error = 2 * np.hypot(named.gain_std, found.gain_std)
    assert abs(named.gain - found.gain) < max(error, named.gain / 10)
    if named.size and found.size:
        assert abs(named.size - found.size) < 2 * np.hypot(named.std, found.std)
    else:
        assert name == "recording.tsv"


def test_the_order_and_the_names_of_tracks_do_not_matter():
    truth = am.simulate.person(frames=200, seed=2)
    model = am.estimate_model(truth.detections).model
    first = shared_evidence(truth, model)
    nameless = dataclasses.replace(truth, names=(None,) * truth.n_tracks)
    assert shared_evidence(nameless, model) == first
    turned = truth.select(range(truth.n_tracks)[::-1])
    assert shared_evidence(turned, model).size == pytest.approx(first.size, rel=0.05)


@pytest.mark.parametrize("n_frames", [0, 9, 80, 81, 199, 200, 5000])
@pytest.mark.parametrize("n_markers", [1, 20, 500])
def test_blocks_do_not_overlap_and_lie_in_the_capture(n_frames, n_markers):
    times = np.arange(n_frames) / 100
    tracks = am.Tracks.from_dense(times, np.zeros((n_frames, n_markers, 3)))
    blocks = _blocks(tracks)
    assert len(blocks) % 2 == 0
    assert all(first < end for first, end in blocks)
    bounds = [0, *(edge for block in blocks for edge in block), n_frames]
    assert bounds == sorted(bounds)


def test_few_tracks_or_frames_give_no_evidence():
    truth = am.simulate.person(frames=100, seed=1)
    model = am.estimate_model(truth.detections).model
    assert shared_evidence(truth, model) is not None
    none = am.Tracks(detections=truth.detections, labels=np.full(len(truth.labels), -1))
    for each in (truth.part(0, 70), truth.part(0, 2), truth.select([3]), truth.select([]), none):
        assert shared_evidence(each, model) is None
    assert found_tracks(truth.detections.part(0, 70), model) is None


@pytest.fixture
def files(tmp_path, monkeypatch):
    """Captures of a person and of a swarm, with tracks, without, with one marker, and short."""
    monkeypatch.chdir(tmp_path)
    person, swarm = am.simulate.person(frames=200, seed=1), am.simulate.swarm(frames=200, seed=1)
    d = person.detections
    am.write(person, "person.csv")
    am.write(swarm, "swarm.csv")
    am.write(am.Tracks(detections=d, labels=np.full(d.n_points, -1)), "unlabelled.csv")
    am.write(person.select(["LKNE"]), "one.csv")
    am.write(person.part(0, 5), "short.csv")
    return person


def test_info_and_estimate_state_the_same(files, capsys):
    want = shared_evidence(files, am.estimate_model(files.detections).model)
    shown = {}
    for command in ("info", "estimate"):
        for name in ("person", "swarm", "unlabelled", "one", "short"):
            assert main([command, f"{name}.csv", "--json"]) == 0
            shown[command, name] = json.loads(capsys.readouterr().out)["shared"]
            assert main([command, f"{name}.csv"]) == 0
            row = "shared acceleration" in capsys.readouterr().out
            assert row is (shown[command, name] is not None)
    for command in ("info", "estimate"):
        assert shown[command, "person"]["size"] == pytest.approx(want.size, rel=1e-6)
        assert shown[command, "person"]["gain"] == pytest.approx(want.gain, rel=1e-3)
        assert shown[command, "swarm"]["size"] == 0
        assert shown[command, "one"] is shown[command, "short"] is None
    assert shown["info", "unlabelled"] is None  # nothing is tracked
    assert shown["estimate", "unlabelled"]["size"] == pytest.approx(want.size, abs=3 * want.std)
