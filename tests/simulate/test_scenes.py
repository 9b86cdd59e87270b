"""Scenes: what every scene promises, and what each one says of itself."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.errors import ParameterError
from asterism.model import Detections, Tracks
from asterism.simulate import (
    SCENES,
    attracted,
    crossing,
    cube,
    film,
    from_capture,
    smooth,
    swarm,
    walk,
    wander,
)

EVERY = pytest.mark.parametrize("name", sorted(SCENES))
PER_FRAME = {"attracted", "crossing", "cube", "dense", "smooth", "walk", "wander"}


def _steps(positions):
    return np.linalg.norm(np.diff(positions, axis=0), axis=-1)


def _distances(positions):
    return np.linalg.norm(positions[:, :, None] - positions[:, None], axis=-1)


@EVERY
def test_every_marker_is_seen_in_every_frame(name):
    truth = SCENES[name].make(frames=37, seed=4)
    k = truth.n_tracks
    assert len(set(truth.names)) == k
    assert truth.connections.shape == (k, k)
    assert (truth.lengths == 37).all()
    assert (truth.labels.reshape(37, k) == np.arange(k)).all()
    assert np.isfinite(truth.positions()).all()
    assert SCENES[name].about


@EVERY
def test_same_seed_same_bytes_and_another_seed_another_scene(name):
    make = SCENES[name].make
    first, again, other = (make(frames=20, seed=s).detections.points for s in (3, 3, 5))
    assert first.tobytes() == again.tobytes()
    assert not np.allclose(first, other)


@pytest.mark.parametrize("name", sorted(PER_FRAME))
def test_rate_changes_the_times_and_nothing_else(name):
    slow, fast = (SCENES[name].make(frames=20, rate=rate) for rate in (1.0, 200.0))
    assert np.array_equal(slow.detections.points, fast.detections.points)
    assert np.array_equal(slow.detections.times, np.arange(20))
    assert np.allclose(fast.detections.times, np.arange(20) / 200)


@pytest.mark.parametrize("name", sorted(set(SCENES) - PER_FRAME))
def test_scenes_in_seconds_are_the_same_at_every_rate(name):
    slow, fast = (SCENES[name].make(frames=n, rate=rate) for n, rate in ((30, 50.0), (59, 100.0)))
    np.testing.assert_allclose(fast.detections.times[::2], slow.detections.times, atol=1e-12)
    apart = np.linalg.norm(fast.positions()[::2] - slow.positions(), axis=2)
    assert apart.max() < (0.01 if name == "swarm" else 1e-9)  # whose motion is integrated


@EVERY
def test_every_scene_can_be_filmed(name):
    import asterism as am

    truth = SCENES[name].make(frames=3)
    places = truth.positions().reshape(-1, 3)
    middle, size = places.mean(axis=0), np.ptp(places, axis=0).max() + 1.0
    rig = am.Rig.ring(3, radius=3 * size, height=middle[2] + size, target=middle)
    shot = film(truth, rig)
    assert (shot.projection.reason <= am.camera.Reason.OCCLUDED).all()
    assert shot.observations.n_points > 0
    assert all(s.n_moments in (1, 3) for s in truth.surfaces)


@EVERY
@pytest.mark.parametrize("wrong", [{"frames": 0}, {"frames": 2.5}, {"rate": 0}, {"seed": -1}])
def test_what_makes_no_scene_is_refused(name, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        SCENES[name].make(**wrong)


@EVERY
def test_one_frame_is_a_scene(name):
    assert SCENES[name].make(frames=1).detections.n_frames == 1


@pytest.mark.parametrize("seed", range(5))
def test_cube_is_rigid_and_keeps_to_its_speed(seed):
    positions = cube(seed=seed, side=0.3, speed=0.1, frames=200).positions()
    distances = _distances(positions)
    assert np.allclose(distances, distances[0])
    assert np.isclose(distances[0][distances[0] > 0].min(), 0.3)
    assert 0.06 < _steps(positions).max() <= 0.1
    assert (_steps(positions).max(axis=0) > 0.03).all()  # no marker stands still


def test_crossing_is_the_reference_scene():
    positions = crossing(seed=2).positions()
    still, flying = positions[:, :8], positions[:, 8:]
    assert positions.shape == (60, 16, 3)
    assert (still == still[0]).all()
    for body in (still, flying):
        distances = _distances(body)
        assert np.allclose(distances, distances[0])
        assert np.isclose(distances[0][distances[0] > 0].min(), 0.25)
    centre = flying.mean(axis=1)
    assert np.allclose(np.diff(centre, axis=0), [0.02, 0, 0])
    middle = centre[29:31].mean(axis=0)
    assert 0 < np.abs(middle).max() < 0.1
    # About z by 0.08 a frame and about y by half of it: the whole turn from its matrix.
    a, b = flying[0] - centre[0], flying[1] - centre[1]
    R = np.linalg.lstsq(a, b, rcond=None)[0].T
    assert np.isclose(np.arccos((np.trace(R) - 1) / 2), np.hypot(0.08, 0.04), rtol=1e-3)


def test_crossing_offsets_have_the_stated_spread():
    middles = np.array(
        [crossing(seed=s, frames=1).positions()[0, 8:].mean(axis=0) for s in range(300)]
    )
    # 900 draws: the standard error of a standard deviation is 0.025 / sqrt(1800).
    assert abs(middles.std() - 0.025) < 4 * 0.025 / np.sqrt(1800)


@pytest.mark.parametrize("n_markers", [1, 30, 400])
def test_smooth_keeps_its_density_and_its_speed(n_markers):
    positions = smooth(n_markers=n_markers, frames=60, seed=1).positions()
    assert positions.shape == (60, n_markers, 3)
    assert _steps(positions).max() < 0.11
    if n_markers == 400:
        extent = np.ptp(positions[0], axis=0)
        room = extent.prod() / n_markers
        assert 0.34**3 < room < 2 * 0.34**3  # the swings reach beyond the box of the centres


def test_smooth_swings_are_within_the_stated_amplitudes():
    still = smooth(n_markers=200, frames=400, seed=2).positions()
    drift = 0.01 * np.arange(400)
    spread = np.ptp(still[:, :, 2], axis=0) / 2  # nothing drifts along z
    assert spread.min() > 0.09
    assert spread.max() <= 0.3
    common = np.linalg.norm(still.mean(axis=1)[-1] - still.mean(axis=1)[0])
    assert abs(common - drift[-1]) < 0.1


def test_walk_takes_steps_of_the_stated_size():
    steps = np.diff(walk(frames=2000, stride=0.02, seed=3).positions(), axis=0)
    n = steps.size
    assert abs(steps.std() - 0.02) < 4 * 0.02 / np.sqrt(2 * n)
    assert np.abs(steps.mean(axis=(0, 1))).max() < 4 * 0.02 / np.sqrt(n / 3)


def test_attracted_markers_crowd():
    free, pulled = walk(frames=400).positions(), attracted(frames=400).positions()
    assert np.abs(pulled[100:]).mean() < 0.5 * np.abs(free[100:]).mean()
    # The stationary spread of x' = (1 - pull) x + step.
    assert np.isclose(pulled[100:].std(), 0.02 / np.sqrt(1 - 0.9**2), rtol=0.1)


@pytest.mark.parametrize(
    ("make", "wrong"),
    [
        (cube, {"side": 0}),
        (cube, {"speed": -1}),
        (crossing, {"side": -0.1}),
        (smooth, {"n_markers": 0}),
        (smooth, {"spacing": 0}),
        (walk, {"pull": 1.5}),
        (walk, {"stride": -0.1}),
        (walk, {"n_markers": 0}),
    ],
)
def test_own_options_are_checked(make, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        make(**wrong)


@pytest.mark.parametrize("seed", range(4))
def test_wanderers_change_speed_and_direction_within_bounds(seed):
    truth = wander(n_markers=20, frames=600, speed=0.05, seed=seed)
    steps = np.diff(truth.positions(), axis=0)
    size = np.linalg.norm(steps, axis=2)
    assert size.max() <= 0.05 * (1 + 1e-12)
    assert size.std(axis=0).min() > 0.1 * 0.05
    cosine = (steps[1:] * steps[:-1]).sum(axis=2) / (size[1:] * size[:-1])
    assert 0.6 < np.median(cosine) < 0.99
    reach = np.linalg.norm(truth.positions(), axis=2)
    assert reach.max() < 12 * 0.3 * 20 ** (1 / 3)  # drawn back: it does not run away


@pytest.mark.parametrize("seed", range(3))
def test_drones_bunch_up_and_never_touch(seed):
    truth = swarm(n_drones=25, frames=1200, seed=seed, apart=0.2)
    places = truth.positions()
    gaps = _distances(places)
    gaps[:, range(25), range(25)] = np.inf
    nearest = gaps.min(axis=2)
    assert nearest.min() > 0.9 * 0.2
    assert np.median(nearest[250:300]) > 0.7  # spread
    assert np.median(nearest[550:600]) < 0.35  # bunched up
    order = [np.argsort(gaps[t, 0])[:5].tolist() for t in (299, 899)]
    assert order[0] != order[1]  # they changed places
    assert _steps(places).max() * 100 < 6.0
    assert places[..., 2].min() > 0


def test_a_labelled_capture_is_a_scene():
    d = Detections.from_frames(
        [0.0, 0.1], [[[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 0, 1], [9, 0, 1]]]
    )
    tracks = Tracks(detections=d, labels=[0, 1, 2, 0, -1], names=("A", None, "C"))
    truth = from_capture(tracks)
    assert truth.names == ("A", "C")
    assert truth.detections.n_points == 3
    assert np.isnan(truth.positions()[1, 1]).all()
    unnamed = from_capture(Tracks(detections=d, labels=[0, 1, 2, 0, 1]))
    assert unnamed.names == ("T000", "T001", "T002")
    with pytest.raises(ParameterError, match="labelled"):
        from_capture(Tracks(detections=d, labels=[-1] * 5))
