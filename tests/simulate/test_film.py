"""Through the cameras: ideal image points, and what cameras really make of markers."""

from __future__ import annotations

import numpy as np
import pytest

from asterism.camera import Camera, Capsule, Polygon, Reason, Rig, intrinsics
from asterism.errors import ParameterError
from asterism.model import Tracks
from asterism.simulate import Seeing, Truth, cube, film, fingers, smooth

SHARP = {"noise_px": 0.0, "merge": False}
RIG = Rig.ring(4, radius=3, height=2, target=(0, 0, 0))


def one_camera(f=1000.0):
    K = intrinsics(focal_length=f, principal_point=(639.5, 511.5))
    return Rig((Camera.look_at((0, -4, 0), (0, 0, 0), K=K, size_px=(1280, 1024)),))


def still(*places, frames=1):
    places = np.broadcast_to(np.array(places, dtype=float), (frames, len(places), 3))
    return Tracks.from_dense(
        np.arange(frames) / 100, places, [f"m{i}" for i in range(len(places[0]))]
    )


def pixels_of(shot, chosen):
    return shot.observations.pixels[shot.blob_of[chosen]]


def cells(observations):
    return observations.frame_of * observations.n_cameras + observations.camera_of


def test_an_ideal_film_is_the_projection():
    truth = cube(frames=20, seed=2)
    shot = film(truth, RIG)
    seen = shot.projection.visible
    assert shot.observations.n_points == seen.sum()
    np.testing.assert_array_equal(shot.share, seen)
    np.testing.assert_array_equal(shot.blob_of >= 0, seen)
    for c, t, k in np.argwhere(seen)[::7]:
        blob = shot.blob_of[c, t, k]
        assert shot.observations.markers[blob] == k
        np.testing.assert_array_equal(
            shot.observations.pixels[blob], shot.projection.pixels[c, t, k]
        )
        assert cells(shot.observations)[blob] == t * 4 + c


def test_without_any_fault_seeing_is_ideal_but_for_the_order():
    truth = cube(frames=20, seed=2)
    ideal, shot = film(truth, RIG), film(truth, RIG, seeing=Seeing(**SHARP), seed=3)
    assert ideal.observations.n_points == shot.observations.n_points
    both = ideal.blob_of >= 0
    np.testing.assert_array_equal(shot.blob_of >= 0, both)
    np.testing.assert_array_equal(
        shot.observations.pixels[shot.blob_of[both]], ideal.observations.pixels[ideal.blob_of[both]]
    )
    assert (shot.observations.markers != ideal.observations.markers).mean() > 0.5


def test_a_marker_half_behind_an_edge_moves_its_centroid():
    r, f = 0.02, 2000.0
    edge = Polygon(corners=[[0, -0.1, -9], [9, -0.1, -9], [9, -0.1, 9], [0, -0.1, 9]])
    truth = Truth(**vars(still([0, 0, 0])) | {"surfaces": (edge,)})
    shot = film(truth, one_camera(f), seeing=Seeing(marker_radius=r, **SHARP))
    # From 4 m, an edge 0.1 m in front of the middle of a disc covers its right half: the centroid
    # of the left half lies 4 r / 3 π off.
    expected = 639.5 - 4 * r / (3 * np.pi) * f / 4
    assert shot.share[0, 0, 0] == pytest.approx(0.5, abs=0.1)
    np.testing.assert_allclose(
        shot.observations.pixels[0], [expected, 511.5], atol=0.12 * r * f / 4
    )
    unseen = film(truth, one_camera(f), seeing=Seeing(marker_radius=r, smallest_share=0.7, **SHARP))
    assert unseen.observations.n_points == 0
    assert unseen.blob_of[0, 0, 0] == -1


def test_a_marker_on_a_surface_is_not_occluded_by_it():
    floor = Polygon(corners=[[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]])
    K = intrinsics(focal_length=900.0, principal_point=(639.5, 511.5))
    rig = Rig((Camera.look_at((0, -4, 2), (0, 0, 0), K=K, size_px=(1280, 1024)),))
    shot = film(still([0, 0, 0]), rig, [floor], seeing=Seeing(**SHARP))
    assert shot.share[0, 0, 0] == 1.0
    below = film(still([0, 0, -0.05]), rig, [floor], seeing=Seeing(**SHARP))
    assert below.share[0, 0, 0] == 0.0


def test_blobs_that_touch_are_one():
    # At 4 m a radius of 0.01 m is 2.5 px; 0.018 m apart they touch, 0.022 m apart they do not.
    for apart, n in ((0.018, 1), (0.022, 2)):
        truth = still([0, 0, 0], [apart, 0, 0])
        shot = film(truth, one_camera(), seeing=Seeing(marker_radius=0.01, noise_px=0.0))
        assert shot.observations.n_points == n
        assert len(set(shot.blob_of[0, 0])) == n
    # The one behind is smaller, and counts by its area.
    near_far = still([0, 0, 0], [0.03, 4, 0])
    shot = film(near_far, one_camera(), seeing=Seeing(marker_radius=0.01, noise_px=0.0))
    u = near_far_pixels = shot.projection.pixels[0, 0, :, 0]
    assert shot.observations.markers.tolist() == [0]
    expected = (4 * u[0] + near_far_pixels[1]) / 5
    np.testing.assert_allclose(shot.observations.pixels[0, 0], expected, rtol=1e-12)
    chain = still([0, 0, 0], [0.018, 0, 0], [0.036, 0, 0], [0.2, 0, 0])
    shot = film(chain, one_camera(), seeing=Seeing(marker_radius=0.01, noise_px=0.0))
    assert shot.observations.n_points == 2


def test_noise_missing_false_and_rounding_are_as_asked():
    truth = smooth(n_markers=20, frames=400, seed=1)
    rig = Rig.ring(3, radius=5, height=1, target=(0.5, 0.5, 0.5), focal_px=600)
    exact = film(truth, rig, seeing=Seeing(**SHARP))
    there = exact.blob_of >= 0
    n = there.sum()

    noisy = film(truth, rig, seeing=Seeing(noise_px=0.4, merge=False), seed=5)
    both = there & (noisy.blob_of >= 0)
    error = (
        noisy.observations.pixels[noisy.blob_of[both]]
        - exact.observations.pixels[exact.blob_of[both]]
    )
    assert error.std() == pytest.approx(0.4, rel=4 / np.sqrt(2 * error.size))
    assert abs(error.mean()) < 4 * 0.4 / np.sqrt(error.size)

    holed = film(truth, rig, seeing=Seeing(missing=0.15, **SHARP), seed=5)
    lost = 1 - (holed.blob_of >= 0).sum() / n
    assert lost == pytest.approx(0.15, abs=4 * np.sqrt(0.15 * 0.85 / n))

    false = film(truth, rig, seeing=Seeing(false=1.5, **SHARP), seed=5).observations
    counts = np.bincount(cells(false)[false.markers < 0], minlength=1200)
    assert counts.mean() == pytest.approx(1.5, abs=4 * np.sqrt(1.5 / 1200))
    assert counts.var() == pytest.approx(1.5, rel=0.25)
    places = false.pixels[false.markers < 0]
    np.testing.assert_allclose(places.mean(axis=0), [639.5, 511.5], atol=35)
    assert ((places >= -0.5) & (places < [1279.5, 1023.5])).all()

    coarse = film(truth, rig, seeing=Seeing(quantum_px=0.25, **SHARP)).observations.pixels
    np.testing.assert_array_equal(coarse * 4, np.rint(coarse * 4))


def test_each_switch_has_a_stream_of_its_own():
    truth = smooth(n_markers=10, frames=100, seed=1)
    rig = Rig.ring(2, radius=5, height=1, target=(0.5, 0.5, 0.5), focal_px=600)
    plain = film(truth, rig, seeing=Seeing(noise_px=0.3, merge=False), seed=8)
    more = film(
        truth, rig, seeing=Seeing(noise_px=0.3, merge=False, missing=0.2, false=2.0), seed=8
    )
    both = (plain.blob_of >= 0) & (more.blob_of >= 0)
    assert 0.7 < both.sum() / (plain.blob_of >= 0).sum() < 0.9
    np.testing.assert_array_equal(
        plain.observations.pixels[plain.blob_of[both]], more.observations.pixels[more.blob_of[both]]
    )
    again = film(
        truth, rig, seeing=Seeing(noise_px=0.3, merge=False, missing=0.2, false=2.0), seed=8
    )
    np.testing.assert_array_equal(again.observations.pixels, more.observations.pixels)
    other = film(
        truth, rig, seeing=Seeing(noise_px=0.3, merge=False, missing=0.2, false=2.0), seed=9
    )
    assert other.observations.n_points != more.observations.n_points


def test_a_late_camera_sees_where_the_markers_will_be():
    t = np.arange(50) / 100
    places = np.stack([0.5 * t, 0 * t, 0 * t], axis=1)[:, None]
    truth = Tracks.from_dense(t, places, ["a"])
    rig = Rig(tuple(c.replace(name=f"c{i}") for i, c in enumerate([*one_camera()] * 40)))
    shot = film(truth, rig, seeing=Seeing(timing=0.004, **SHARP), seed=1)
    shift = shot.observations.pixels[shot.blob_of[..., 0], 0] - shot.projection.pixels[:, :, 0, 0]
    late = shift / (0.5 * 1000 / 4)
    np.testing.assert_allclose(late, np.broadcast_to(late[:, :1], late.shape), atol=1e-9)
    assert late[:, 0].std() == pytest.approx(0.004, rel=0.4)


def test_markers_are_occluded_by_the_scenes_own_surfaces():
    wall = Polygon(corners=[[-9, -1, -9], [9, -1, -9], [9, -1, 9], [-9, -1, 9]])
    truth = Truth(**vars(still([0, 0, 0], frames=3)) | {"surfaces": (wall,)})
    assert (film(truth, one_camera()).projection.reason == Reason.OCCLUDED).all()
    assert film(truth, one_camera(), ()).observations.n_points == 3


@pytest.mark.parametrize(
    "wrong",
    [{"noise_px": -1}, {"missing": 2}, {"false": -1}, {"quantum_px": np.nan}, {"timing": -1},
     {"marker_radius": -0.1}, {"smallest_share": 1.5}],
)  # fmt: skip
def test_wrong_switches_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        Seeing(**wrong)


def test_flat_scenes_are_refused():
    flat = Tracks.from_dense([0.0], [[[0.0, 1.0]]], ["a"])
    with pytest.raises(ParameterError, match="3-D"):
        film(flat, RIG)


@pytest.mark.parametrize("behind", [0.002, 0.005, 0.02, 0.1])
def test_markers_are_not_seen_through_what_they_do_not_sit_on(behind):
    sheet = Polygon(corners=[[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]])
    shot = film(still([0, behind, 0]), one_camera(), [sheet], seeing=Seeing(**SHARP))
    assert shot.share[0, 0, 0] == 0
    rod = Capsule(ends=[[-1, 0, 0], [1, 0, 0]], radius=0.008)
    beyond = film(still([0, 0.008 + behind, 0]), one_camera(), [rod], seeing=Seeing(**SHARP))
    assert beyond.share[0, 0, 0] <= 0.5


def test_seeing_sees_about_as_much_as_the_eye():
    truth = fingers(frames=40, seed=2)
    middle = truth.positions().mean(axis=(0, 1))
    rig = Rig.ring(8, radius=0.8, height=middle[2] + 0.5, target=middle)
    ideal = film(truth, rig).projection.visible
    shot = film(truth, rig, seeing=Seeing(marker_radius=0.003, merge=False, noise_px=0))
    seen = shot.blob_of >= 0
    assert (ideal & ~seen).mean() < 0.03
    assert (seen & ~ideal).mean() < 0.08  # a rim that looks past the edge


def test_a_surface_far_away_changes_nothing():
    K = intrinsics(focal_length=1000.0, principal_point=(639.5, 511.5))
    rig = Rig((Camera.look_at((0, -1, 0), (0, 0, 0), K=K, size_px=(1280, 1024)),))
    far = Capsule(ends=[[50, 50, 0], [50, 50, 1]], radius=0.01)
    for x in (0.6, 0.6399, 0.645):  # at the right edge of the image, and beyond it
        a, b = (
            film(still([x, 0, 0]), rig, s, seeing=Seeing(marker_radius=0.02, **SHARP))
            for s in ([], [far])
        )
        np.testing.assert_array_equal(a.observations.pixels, b.observations.pixels)
        np.testing.assert_array_equal(a.share, b.share)


def test_late_cameras_do_not_repeat_the_scene():
    scene = np.random.default_rng(5).standard_normal(3)
    t = np.arange(5) / 100
    truth = Tracks.from_dense(t, np.stack([t, 0 * t, 0 * t], axis=1)[:, None], ["a"])
    rig = Rig(tuple(one_camera()[0].replace(name=n) for n in "abc"))
    shot = film(truth, rig, seeing=Seeing(timing=0.01, **SHARP), seed=5)
    shift = shot.observations.pixels[shot.blob_of[..., 0], 0] - shot.projection.pixels[:, :, 0, 0]
    late = shift[:, 2] / 250 / 0.01
    assert np.abs(late - scene).min() > 1e-3


@pytest.mark.parametrize("wrong", [{"merge": "no"}, {"false": 1e30}])
def test_kinds_of_switches(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        Seeing(**wrong)


def test_what_is_no_truth_or_no_rig():
    with pytest.raises(ParameterError, match="rig"):
        film(cube(frames=2), RIG[0])
    with pytest.raises(ParameterError, match="truth"):
        film(cube(frames=2).detections, RIG)


def test_small_blobs_touch_when_their_own_radii_say_so():
    # Radii of 2.5 px at 4 m and 1.25 px at 8 m: they touch up to 3.75 px, not up to 5.
    for apart_px, n in ((3.5, 1), (4.2, 2)):
        truth = still([0, 0, 0], [apart_px * 8 / 1000, 4, 0])
        shot = film(truth, one_camera(), seeing=Seeing(marker_radius=0.01, noise_px=0.0))
        assert shot.observations.n_points == n
