"""Calibrations in OpenCV's manner, with OpenCV as the judge: YAML and the TOML of anipose."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest

from asterism.camera import (
    BrownConrady,
    Rig,
)
from asterism.errors import FormatError
from asterism.io.calibrations import read_rig, write_rig
from tests.io.calibrations.rigs import rig_for, target_points


def cv_pixels(K, k, R, t, points):
    rvec = cv2.Rodrigues(np.array(R))[0]
    return cv2.projectPoints(points, rvec, np.array(t), np.array(K), np.array(k))[0][:, 0]


def test_opencv_reads_what_we_write(tmp_path):
    rig, points = rig_for("opencv"), target_points()
    write_rig(rig, tmp_path / "a.yml")
    storage = cv2.FileStorage(str(tmp_path / "a.yml"), cv2.FILE_STORAGE_READ)
    assert storage.isOpened()
    for i, camera in enumerate(rig):
        node = storage.getNode(f"camera_{i}")
        K, k, R, t = (
            node.getNode(n).mat() for n in ("camera_matrix", "distortion_coefficients", "R", "T")
        )
        np.testing.assert_array_equal(K, camera.K)
        pixels = cv_pixels(K, k, R, t, points)
        np.testing.assert_allclose(pixels, camera.project(points).pixels, rtol=0, atol=1e-8)
        assert node.getNode("name").string() == camera.name
        assert int(node.getNode("image_width").real()) == camera.size_px[0]
    storage.release()


@pytest.mark.parametrize("kind", ["matrix", "vector", "plain", "nested"])
def test_we_read_what_opencv_writes(tmp_path, kind):
    rig, points = rig_for("opencv"), target_points()
    camera = rig[1]
    R, t = camera.T_camera_world[:3, :3].copy(), camera.T_camera_world[:3, 3:].copy()
    k = np.array([[camera.lens.k1, camera.lens.k2, camera.lens.p1, camera.lens.p2, camera.lens.k3]])
    path = tmp_path / "left.yaml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    if kind == "nested":
        storage.startWriteStruct("left", cv2.FileNode_MAP)
    storage.write("image_width", camera.size_px[0])
    storage.write("image_height", camera.size_px[1])
    names = {"matrix": ("camera_matrix", "distortion_coefficients", "R", "T"),
             "vector": ("cameraMatrix", "dist_coeffs", "rvec", "tvec"),
             "plain": ("K", "D", "rotation", "translation"),
             "nested": ("K", "dist", "rotation_vector", "translation_vector")}[kind]  # fmt: skip
    eight = np.concatenate([k, np.zeros((1, 3))], axis=1)
    values = (np.array(camera.K), eight if kind == "plain" else k.T,
              cv2.Rodrigues(R)[0] if "vec" in "".join(names) else R, t)  # fmt: skip
    for name, value in zip(names, values, strict=True):
        storage.write(name, value)
    storage.write("calibration_time", "Mon 20 Nov: 10:00")
    if kind == "nested":
        storage.endWriteStruct()
    storage.release()
    again = read_rig(path, units="m")
    assert again.names == ("left",)
    np.testing.assert_allclose(again[0].project(points).pixels, camera.project(points).pixels,
                               rtol=0, atol=1e-9)  # fmt: skip
    np.testing.assert_allclose(cv_pixels(camera.K, k, R, t, points),
                               again[0].project(points).pixels, rtol=0, atol=1e-8)  # fmt: skip


def test_the_skew_that_opencv_leaves_out_is_left_out_here(tmp_path):
    K = np.array([[500, 9.0, 320], [0, 500, 240], [0, 0, 1]])
    path = tmp_path / "skew.yml"
    text = PLAIN_YAML.replace("[500, 0, 320]", "[500, 9, 320]")
    path.write_text(text)
    rig = read_rig(path)
    points = target_points() + np.array([0, 0, 3])
    expected = cv_pixels(K, [0.1, 0, 0, 0], np.eye(3), np.zeros(3), points)
    np.testing.assert_allclose(rig[0].project(points).pixels, expected, rtol=0, atol=1e-9)
    assert "skew 9" in rig.warnings[0]


PLAIN_YAML = """%YAML:1.0
---
image_size: [640, 480]
camera_matrix: [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
dist_coeffs: [1e-1, 0, 0, 0]
"""


def test_yaml_written_by_hand(tmp_path):
    path = tmp_path / "hand.yml"
    path.write_text(PLAIN_YAML)
    rig = read_rig(path)
    assert rig[0].lens == BrownConrady(k1=0.1)
    assert rig[0].size_px == (640, 480)
    np.testing.assert_array_equal(rig[0].T_camera_world, np.eye(4))
    assert "no pose" in rig.warnings[0]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (("[1e-1, 0, 0, 0]", "[1e-1, 0, 0, 0, 0, 0.3]"), "followed by zeros"),
        (("image_size: [640, 480]", ""), "image_width and image_height"),
        (("[640, 480]", "[640, 0]"), "whole pixels"),
        (("[640, 480]", "[640, 480.5]"), "whole pixels"),
        (("[500, 0, 320]", "[0, 0, 320]"), "focal lengths > 0"),
        (("[500, 0, 320]", "[nan, 0, 320]"), "finite"),
        (("[500, 0, 320]", "[.nan, 0, 320]"), "numbers"),
        (("[500, 0, 320]", "[500, 320]"), "3 × 3"),
        (("---\n", "---\nrvec: [0, 0, 0]\n"), "or neither"),
        (("---\n", "---\nrvec: [0, 0]\ntvec: [0, 0, 0]\n"), "or a vector of 3"),
        (("---\n", "---\nrvec: [0, 0, 0]\ntvec: [0, 0]\n"), "3 numbers"),
        (("---\n", "---\nR: [[1, 0, 0], [0, 1, 0], [0, 0, 2]]\nT: [0, 0, 0]\n"), "a rotation"),
        (("---\n", "---\nR: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]\nT: [0, 0, 0]\n"), "a rotation"),
        (("---\n", "---\ndistortion_model: equidistant\n"), "pinhole"),
        (("---\n", "---\nfisheye: 1\n"), "pinhole"),
        (("camera_matrix", "x"), "a camera_matrix"),
        (("dist_coeffs: [1e-1", "dist_coeffs: [one"), "numbers"),
        (("dist_coeffs: [", "dist_coeffs: ["[:-1] + "{rows: 2, cols: 1, data: [0], x: ["), "line"),
        (("[1e-1, 0, 0, 0]", "{rows: 2, cols: 1, dt: d, data: [0.1]}"), "2 × 1"),
    ],
)  # fmt: skip
def test_yaml_that_is_not_a_camera(tmp_path, change, expected):
    path = tmp_path / "bad.yml"
    path.write_text(PLAIN_YAML.replace(*change))
    with pytest.raises(FormatError, match=re.escape(expected)):
        read_rig(path)


ANIPOSE = """[cam_0]
name = "cam1"
size = [640, 480]
matrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
distortions = [0.1, 0.0, 0.0, 0.0, 0.0]
rotation = [0.1, 0.2, 0.3]
translation = [1.0, 2.0, 3.0]
[metadata]
adjusted = false
"""


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (("rotation =", "fisheye = true\nrotation ="), "camera cam1, fisheye", "false"),
        (("distortions = [0.1", "distortions = [0, 0, 0, 0, 0, 0.1"), "distortions", "k3"),
        (("[640, 480]", "[640]"), "size", "2 numbers"),
        (("[640, 480]", "[640, 0]"), "size", "whole pixels"),
        (("[500.0, 0.0", "[-500.0, 0.0"), "K", "focal lengths > 0"),
        (("[500.0, 0.0", "[nan, 0.0"), "matrix", "finite"),
        (("[500.0, 0.0", "[1e-300, 0.0"), "K", "focal lengths over"),
        (("[500.0, 0.0", "[1e300, 0.0"), "K", "under 1e+09"),
        (("[0.1, 0.0", "[1e300, 0.0"), "the lens", "under 1e+09"),
        (("[1.0, 2.0, 3.0]", "[1.0, 2.0, -1e200]"), "T_camera_world", "under 1e+09"),
        (("rotation = [0.1, 0.2, 0.3]\n", ""), "rotation", "nothing"),
        (("rotation = [0.1, ", "rotation = ["), "rotation", "3 numbers"),
        (("translation = [1.0", "translation = ['a'"), "translation", "3 numbers"),
        (("[cam_0]", "[cam_0"), "its text", "TOML"),
        (("matrix", "mat"), "its cameras", "at least one"),
    ],
)
def test_anipose_that_is_broken(tmp_path, change, place, expected):
    path = tmp_path / "c.toml"
    path.write_text(ANIPOSE.replace(*change))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(path, format="anipose")
    assert place in error.value.place


CALISCOPE = """[cameras.1]
cam_id = 1
rotation_count = 0
exposure = "null"
size = [640, 480]
matrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
distortions = [0.1, 0.0, 0.0, 0.0, 0.0]
rotation = [0.1, 0.2, 0.3]
translation = [1.0, 2.0, 3.0]

[cameras.2]
size = [640, 480]
matrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
distortions = [0.1, 0.0, 0.0, 0.0, 0.0]
rotation = "null"
translation = "null"
"""


def test_cameras_as_caliscope_nests_them(tmp_path):
    (tmp_path / "a.toml").write_text(ANIPOSE)
    (tmp_path / "c.toml").write_text(CALISCOPE)
    anipose, caliscope = (read_rig(tmp_path / f"{c}.toml", units="m") for c in "ac")
    assert anipose.names == ("cam1",)
    assert caliscope.names == ("cam_1",)
    np.testing.assert_array_equal(caliscope[0].T_camera_world, anipose[0].T_camera_world)
    assert caliscope.warnings == ("camera cam_2 has no pose and is left out",)
    (tmp_path / "c.toml").write_text("cameras = 3\n" + ANIPOSE)
    assert read_rig(tmp_path / "c.toml", units="m").names == ("cam1",)


def test_two_cameras_of_one_name(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(ANIPOSE + ANIPOSE.replace("cam_0", "cam_1").split("[metadata]")[0])
    with pytest.raises(FormatError, match="a unique name"):
        read_rig(path, units="m")


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (("version = 1", "version = 2"), "version", "1"),
        (("asterism-rig", "asterism-wig"), "format", "asterism-rig"),
        (('kind = "brown-conrady"', 'kind = "fisheye"'), "kind", "one of brown-conrady"),
        (('kind = "brown-conrady"', "kind = [1]"), "kind", "one of brown-conrady"),
        (("k1 = ", "k9 = "), "lens, entry", "one of k1"),
        (("k1 = ", "k1 = 'a' #"), "lens, k1", "numbers"),
        (("near = 0.0", "near = -1.0"), "near", "≥ 0"),
        (("near = 0.0", "near = 'x'"), "near", "a number"),
        (("far = inf", "far = 0.0"), "far", "> near"),
        (("far = inf", "fear = 3"), "entry", "one of name"),
        (("size_px = [", "size_px = [1.5, "), "size_px", "two whole numbers"),
        (("name = ", "name = 3 #"), "name", "a text"),
        (("[[camera]]", "[camera]\n[[kamera]]"), "entry", "camera"),
        (("T_camera_world =", "T_world_camera ="), "entry", "T_camera_world"),
    ],
)
def test_our_own_format_broken(tmp_path, change, place, expected):
    path = tmp_path / "c.toml"
    write_rig(Rig((rig_for("anipose")[0].replace(near=0.0),)), path)
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(change[0], change[1], 1))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(path, format="rig")
    assert place in error.value.place
