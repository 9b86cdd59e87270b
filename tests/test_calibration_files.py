"""Calibrations: every format there and back, against OpenCV, against formulas, and broken."""

from __future__ import annotations

import contextlib
import re
import shutil
import time

import cv2
import numpy as np
import pytest

from asterism.camera import (
    BrownConrady,
    Camera,
    QuadraticCorrection,
    ReportRadial,
    Rig,
    ViconRadial,
)
from asterism.errors import AsterismError, FormatError, ParameterError
from asterism.io.calibration import CALIBRATIONS, read_rig, write_rig
from calibration_rigs import LENSES, rig_for, target_points
from fuzz_readers import mutate

NAMES = {"rig": "a.toml", "anipose": "a.toml", "opencv": "a.yml", "qca": "a.qca.txt",
         "xcp": "a.xcp", "flydra": "fly", "myptv": "ptv"}  # fmt: skip


def test_every_format_is_tried_here():
    assert set(NAMES) == set(CALIBRATIONS)


def same_pixels(a: Rig, b: Rig, tolerance: float = 1e-9) -> None:
    points = target_points()
    ours, theirs = a.project(points), b.project(points)
    assert np.isfinite(ours.pixels).all()
    assert ours.visible.mean() > 0.5
    np.testing.assert_allclose(theirs.pixels, ours.pixels, rtol=0, atol=tolerance)
    assert (ours.reason == theirs.reason).mean() > 0.999


@pytest.mark.parametrize("format", NAMES)
@pytest.mark.parametrize("bent", [True, False], ids=["lens", "pinhole"])
def test_there_and_back(tmp_path, format, bent):
    rig = rig_for(format, bent=bent)
    path = tmp_path / NAMES[format]
    write_rig(rig, path, format=format)
    again = read_rig(path)
    same_pixels(rig, again)
    assert again.names == rig.names
    assert [c.size_px for c in again] == [c.size_px for c in rig]
    assert [type(c.lens) for c in again] == [type(c.lens) for c in rig]
    assert again.warnings == ()
    # Told by its content when its name says nothing.
    if path.is_file():
        shutil.move(path, tmp_path / "nameless")
        same_pixels(rig, read_rig(tmp_path / "nameless"))


@pytest.mark.parametrize("lens", ["none", *LENSES])
def test_our_own_format_keeps_every_bit(tmp_path, lens):
    rng = np.random.default_rng(3)
    cameras = []
    for i, camera in enumerate(rig_for("rig", bent=False)):
        K = camera.K + np.array([[rng.random(), rng.normal(), 0.1], [0, 1 / 3, 1e-7], [0, 0, 0]])
        options = {} if lens == "none" else {"lens": LENSES[lens], "K_lens": K * [1.25, 1, 1]}
        name = ["", 'a "b" \\ c', "ü☆"][i % 3] + (f" {i}" if i % 3 else "")
        limits = {"near": 0.1 * (1 + i), "far": [np.inf, 1e22 / 3][i % 2]}
        cameras.append(camera.replace(K=K, name=name, **options, **limits))
    rig = Rig(cameras[:3])
    write_rig(rig, tmp_path / "a.toml")
    for ours, again in zip(rig, read_rig(tmp_path / "a.toml"), strict=True):
        for field in ("K", "T_camera_world", "K_lens"):
            a, b = getattr(ours, field), getattr(again, field)
            assert (a is None) == (b is None)
            assert a is None or a.tobytes() == b.tobytes()
        for field in ("size_px", "lens", "near", "far", "name"):
            assert getattr(ours, field) == getattr(again, field)


# ---- what a format cannot hold ----------------------------------------------------------------


@pytest.mark.parametrize("format", ["anipose", "opencv", "qca", "xcp", "flydra", "myptv"])
@pytest.mark.parametrize("lens", LENSES)
def test_a_lens_that_does_not_fit_is_refused_by_name(tmp_path, format, lens):
    camera = rig_for("qca", bent=False)[0].replace(lens=LENSES[lens])
    fits = {"BrownConrady": ("anipose", "opencv", "qca"), "ViconRadial": ("xcp",)}
    path = tmp_path / NAMES[format]
    if format in fits.get(lens, ()):
        write_rig(Rig((camera,)), path, format=format)
        return
    with pytest.raises(ParameterError, match=camera.name) as error:
        write_rig(Rig((camera,)), path, format=format)
    assert "with_lens(am." in str(error.value)
    assert "asterism camera convert" in str(error.value)
    assert not path.exists()


def test_a_lens_about_another_centre_does_not_go_where_there_is_none(tmp_path):
    camera = rig_for("flydra")[0]
    for name in ("a.qca.txt", "a.yml"):
        with pytest.raises(ParameterError, match="K_lens"):
            write_rig(Rig((camera,)), tmp_path / name)


@pytest.mark.parametrize("format", ["qca", "xcp"])
def test_skew_is_refused_where_there_is_no_number_for_it(tmp_path, format):
    camera = rig_for(format)[0]
    K = camera.K.copy()
    K[0, 1] = 2.0
    with pytest.raises(ParameterError, match="skew"):
        write_rig(Rig((camera.replace(K=K),)), tmp_path / NAMES[format])


def test_a_name_that_would_leave_the_folder_is_refused(tmp_path):
    camera = rig_for("myptv")[0]
    for name in ("../a", "a/b", ".a", "a\\b"):
        with pytest.raises(ParameterError, match="name"):
            write_rig(Rig((camera.replace(name=name),)), tmp_path / "p", format="myptv")
    with pytest.raises(ParameterError, match="printable"):
        write_rig(Rig((camera.replace(name="a\nb"),)), tmp_path / "a.toml")


# ---- writing safely ----------------------------------------------------------------------------


def test_a_file_is_replaced_and_a_folder_is_not(tmp_path):
    rig = rig_for("anipose")
    path = tmp_path / "a.toml"
    path.write_text("old")
    with pytest.raises(ParameterError):
        write_rig(rig_for("xcp"), path, format="anipose")
    assert path.read_text() == "old"
    write_rig(rig, path, format="anipose")
    assert read_rig(path).names == rig.names
    folder = tmp_path / "fly"
    folder.mkdir()
    write_rig(rig_for("flydra"), folder, format="flydra")  # an empty one is as good as none
    before = sorted(p.name for p in folder.iterdir())
    with pytest.raises(ParameterError, match="new or empty"):
        write_rig(rig_for("flydra"), folder, format="flydra")
    assert sorted(p.name for p in folder.iterdir()) == before
    with pytest.raises(ParameterError, match="new or empty"):
        write_rig(rig_for("flydra"), path, format="flydra")
    with pytest.raises(FormatError, match="writing"):
        write_rig(rig, tmp_path / "no" / "a.toml")
    with pytest.raises(FormatError, match="writing"):
        write_rig(rig_for("myptv"), tmp_path / "no" / "a", format="myptv")
    with pytest.raises(ParameterError, match="ending in"):
        write_rig(rig, tmp_path / "a")
    with pytest.raises(ParameterError, match="one of rig"):
        write_rig(rig, tmp_path / "a", format="theia")


def test_opening_what_is_not_there(tmp_path):
    with pytest.raises(FormatError, match="nothing of that name"):
        read_rig(tmp_path / "a.xcp")
    with pytest.raises(FormatError, match="none of them"):
        read_rig(tmp_path)
    with pytest.raises(FormatError, match="a file of format xcp"):
        read_rig(tmp_path, format="xcp")
    (tmp_path / "x").write_bytes(b"\0\1\2")
    with pytest.raises(FormatError, match="its first bytes"):
        read_rig(tmp_path / "x")
    with pytest.raises(FormatError, match="a folder of format flydra"):
        read_rig(tmp_path / "x", format="flydra")
    with pytest.raises(ParameterError, match="one of rig"):
        read_rig(tmp_path / "x", format="theia")


# ---- units -------------------------------------------------------------------------------------


def millimetres(path):
    """Take the unit out of a file of ours and make its lengths millimetres."""
    text = path.read_text().replace('units: "metres"\n', "").replace('units = "metres"\n', "")

    def times(match):
        return re.sub(r"-?\d+\.?\d*(?:e[-+]\d+)?", lambda m: str(float(m[0]) * 1000), match[0])

    text = re.sub(r"translation = \[.*\]", times, text)
    text = re.sub(r"(?<=   T: !!opencv-matrix\n)(?:.*\n){3}.*", lambda m: re.sub(
        r"data: .*", times, m[0]), text)  # fmt: skip
    path.write_text(text)


@pytest.mark.parametrize("format", ["anipose", "opencv"])
def test_a_unit_that_is_not_said_is_judged_and_told(tmp_path, format):
    rig = rig_for(format)
    path = tmp_path / NAMES[format]
    write_rig(rig, path, format=format)
    millimetres(path)
    judged = read_rig(path)
    same_pixels(rig, judged)
    assert len(judged.warnings) == 1
    assert "mm" in judged.warnings[0]
    assert "units=" in judged.warnings[0]
    told = read_rig(path, units="mm")
    same_pixels(rig, told)
    assert told.warnings == ()
    np.testing.assert_allclose(read_rig(path, units="m")[0].center, rig[0].center * 1000)


def test_a_unit_that_the_format_has_not_is_refused(tmp_path):
    write_rig(rig_for("qca"), tmp_path / "a.qca.txt")
    same_pixels(rig_for("qca"), read_rig(tmp_path / "a.qca.txt", units="mm"))
    with pytest.raises(ParameterError, match="mm, as in all files"):
        read_rig(tmp_path / "a.qca.txt", units="m")
    with pytest.raises(ParameterError, match="one of mm, cm, m"):
        read_rig(tmp_path / "a.qca.txt", units="inch")


# ---- OpenCV as the judge -----------------------------------------------------------------------


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
        (("[1e-1, 0, 0, 0]", "[1e-1, 0, 0, 0, 0, 0.3]"), "zeros after them"),
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


# ---- each format against its formula -----------------------------------------------------------

QCA = """<?xml version="1.0" encoding="UTF-8"?>
<calibration type="regular"><cameras>
<camera active="1" serial="111" model="Miqus Video" viewrotation="0">
<fov_marker left="0" top="0" right="1919" bottom="1087"/>
<fov_video left="100" top="40" right="1099" bottom="639"/>
<transform x="1000" y="-2000" z="1500"
 r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0"/>
<intrinsic focallength="9.3" sensorMinU="0" sensorMaxU="122879" sensorMinV="0" sensorMaxV="69631"
 focalLengthU="64000" focalLengthV="57600" centerPointU="38400" centerPointV="19200" skew="0"
 radialDistortion1="-0.05" radialDistortion2="0.1" radialDistortion3="0.01"
 tangentalDistortion1="0.001" tangentalDistortion2="-0.002"/>
</camera>
<camera active="0" serial="222" model="Oqus"/>
</cameras></calibration>
"""


def test_qca_says_what_qualisys_means(tmp_path):
    path = tmp_path / "c.qca.txt"
    path.write_text(QCA)
    rig = read_rig(path)
    assert rig.names == ("111",)
    assert rig.warnings == ("camera 222 is not calibrated and is left out",)
    camera = rig[0]
    assert camera.size_px == (1000, 600)
    assert camera.lens == BrownConrady(-0.05, 0.1, 0.001, -0.002, 0.01)  # not in 1/64
    np.testing.assert_allclose(camera.K, [[1000, 0, 500], [0, 900, 260], [0, 0, 1]])
    np.testing.assert_allclose(camera.center, [1, -2, 1.5])
    # It looks along +y, up is up and right is right.
    np.testing.assert_allclose(camera.T_camera_world[2, :3], [0, 1, 0], atol=1e-15)
    pixels = camera.replace(lens=None).project([[1, 0, 1.5], [1, 0, 1.6], [1.1, 0, 1.5]]).pixels
    np.testing.assert_allclose(pixels, [[500, 260], [500, 215], [550, 260]])


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (('r11="1"', 'r11="2"'), "camera 111, transform", "a rotation"),
        (('r11="1"', 'r11="-1"'), "camera 111, transform", "a rotation"),
        (('r33="0"', ""), "transform r33", "a number, got nothing"),
        (('z="1500"', 'z="high"'), "transform z", "a number"),
        (('z="1500"', 'z="NaN"'), "transform z", "finite"),
        (('skew="0"', 'skew="3"'), "intrinsic skew", "0, as Qualisys"),
        (('focalLengthU="64000"', 'focalLengthU="0"'), "camera 111, K", "focal lengths > 0"),
        (('right="1099"', 'right="99"'), "fov_video", "whole pixels"),
        (('<fov_video left="100"', '<fov_video l="1"'), "fov_video left", "a number, got nothing"),
        (('active="1"', 'active="0"'), "its cameras", "at least one"),
        (("</cameras>", ""), "line", "XML"),
        (("calibration", "calib"), "the outermost element", "<calibration>"),
        (('encoding="UTF-8"', 'encoding="klingon"'), "its encoding", "one that XML knows"),
    ],
)
def test_qca_that_is_broken(tmp_path, change, place, expected):
    path = tmp_path / "c.qca.txt"
    path.write_text(QCA.replace(*change))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(path)
    assert place in error.value.place


XCP = """<?xml version="1.0"?>
<Cameras VERSION="1.0">
<Camera DEVICEID="7" NAME="" PIXEL_ASPECT_RATIO="1.25" SENSOR_SIZE="800 600" USERID="1"><KeyFrames>
<KeyFrame FRAME="5" FOCAL_LENGTH="1" />
<KeyFrame FRAME="0" FOCAL_LENGTH="1000" ORIENTATION="0.70710678118654757 0 0 0.70710678118654757"
 POSITION="500 -2000 1500" PRINCIPAL_POINT="400 300" VICON_RADIAL="3e-8 -2e-14"
 VICON_RADIAL2="Vicon3Parameter 410 290 4e-8 -3e-14 1e-20"/></KeyFrames></Camera>
<Camera DEVICEID="8" NAME="roof" SENSOR_SIZE="800 600" USERID="2"><KeyFrames/></Camera>
</Cameras>
"""


def test_xcp_says_what_vicon_means(tmp_path):
    path = tmp_path / "c.xcp"
    path.write_text(XCP)
    rig = read_rig(path)
    assert rig.names == ("7",)
    assert [text[:26] for text in rig.warnings] == [
        "camera 7 has 2 key frames,", "camera roof has no key fra",
    ]  # fmt: skip
    camera = rig[0]
    np.testing.assert_allclose(camera.center, [0.5, -2, 1.5])
    np.testing.assert_allclose(camera.T_camera_world[2, :3], [0, 1, 0], atol=1e-15)
    measured = camera.project(target_points()[:50]).pixels
    # From measured to ideal, about a centre of its own; then the pin-hole, with oblong pixels.
    away = measured - [410, 290]
    r2 = (away**2).sum(axis=1, keepdims=True)
    ideal = [410, 290] + away * (1 + 4e-8 * r2 - 3e-14 * r2**2 + 1e-20 * r2**3)
    x = (target_points()[:50] - [0.5, -2, 1.5]) @ camera.T_camera_world[:3, :3].T
    expected = np.stack([400 + 1000 * x[:, 0] / x[:, 2], 300 + 800 * x[:, 1] / x[:, 2]], axis=1)
    np.testing.assert_allclose(ideal, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (('ORIENTATION="0.7', 'ORIENTATION="0.8'), "ORIENTATION", "of length 1"),
        (("500 -2000 1500", "500 -2000"), "POSITION", "3 numbers"),
        (("500 -2000 1500", "500 inf 1500"), "POSITION", "finite"),
        (('"800 600"', '"800 -600"'), "SENSOR_SIZE", "whole pixels"),
        (('"800 600"', '"800.5 600"'), "SENSOR_SIZE", "whole pixels"),
        (('RATIO="1.25"', 'RATIO="0"'), "PIXEL_ASPECT_RATIO", "> 0"),
        (('LENGTH="1000"', 'LENGTH="-1000"'), "K", "focal lengths > 0"),
        (("Vicon3Parameter", "Vicon9Parameter"), "VICON_RADIAL2", "Vicon3Parameter"),
        (("410 290 4e-8", "410 4e-8"), "VICON_RADIAL2", "5 numbers"),
        (('FRAME="0" FOCAL_LENGTH="1000"', 'FRAME="0"'), "FOCAL_LENGTH", "nothing"),
        (("<Cameras", "<!DOCTYPE a [<!ENTITY x 'y'>]><Cameras"), "structure", "declaration"),
    ],
)
def test_xcp_that_is_broken(tmp_path, change, place, expected):
    path = tmp_path / "c.xcp"
    path.write_text(XCP.replace(*change))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(path)
    assert place in error.value.place


def test_xcp_that_was_never_calibrated(tmp_path):
    path = tmp_path / "c.xcp"
    path.write_text(re.sub(r"<KeyFrame (.|\n)*?/>", "", XCP))
    with pytest.raises(FormatError, match="at least one"):
        read_rig(path)


def test_xcp_keeps_a_device_number_and_a_name_apart(tmp_path):
    rig = rig_for("xcp")
    rig = Rig((rig[0].replace(name="19622"), rig[1].replace(name="left"), rig[2].replace(name="")))
    write_rig(rig, tmp_path / "a.xcp")
    text = (tmp_path / "a.xcp").read_text()
    assert 'DEVICEID="19622" NAME=""' in text
    assert 'NAME="left"' in text
    assert read_rig(tmp_path / "a.xcp").names == ("19622", "left", "camera3")


def test_myptv_says_what_myptv_means(tmp_path):
    rig = rig_for("myptv")
    write_rig(rig, tmp_path / "p", format="myptv")
    for camera in read_rig(tmp_path / "p"):
        lines = (tmp_path / "p" / camera.name).read_text().splitlines()
        assert all(line.endswith(" ") for line in lines[2:])  # MyPTV cuts the last character off
        width, height = map(int, lines[2].split())
        center, theta, (f,), (xh, yh), *E = (np.array(line.split(), float) for line in lines[3:])
        x, y, z = (cv2.Rodrigues(a * e)[0] for a, e in zip(theta, np.eye(3), strict=True))
        for point in target_points()[:20]:
            u, v = camera.project(point).pixels
            Z = np.array([u, v, u * u, v * v, u * v])
            ray = np.array([u - width / 2 - xh + E[0] @ Z, v - height / 2 - yh + E[1] @ Z, f])
            sight = x @ y @ z @ (point * 1000 - center)
            np.testing.assert_allclose(ray[:2] / f, sight[:2] / sight[2], rtol=0, atol=1e-12)


def test_myptv_takes_skew_and_two_focal_lengths_into_its_correction(tmp_path):
    for bent in (True, False):
        rig = rig_for("myptv", bent=bent)
        K = rig[0].K + np.array([[0, 3.5, 0], [0, 120, 0], [0, 0, 0]])
        rig = Rig((rig[0].replace(K=K),))
        write_rig(rig, tmp_path / f"p{bent}", format="myptv")
        same_pixels(rig, read_rig(tmp_path / f"p{bent}"))


@pytest.mark.parametrize("y", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, 1e-9 - np.pi / 2, 3.0])
def test_myptv_angles_at_the_end_of_their_range(tmp_path, y):
    rng = np.random.default_rng(1)
    from scipy.spatial.transform import Rotation

    for x, z in rng.uniform(-np.pi, np.pi, (20, 2)):
        T = np.eye(4)
        T[:3, :3] = Rotation.from_euler("XYZ", [x, y, z]).as_matrix()
        camera = rig_for("myptv", bent=False)[0].replace(T_camera_world=T, name="a")
        write_rig(Rig((camera,)), tmp_path / "p", format="myptv")
        again = read_rig(tmp_path / "p" / "a")[0].T_camera_world
        shutil.rmtree(tmp_path / "p")
        np.testing.assert_allclose(again, T, rtol=0, atol=1e-14)


MYPTV = """Tsai model camera
cam1
1280 1024 
48.7 79.4 528.6 
0.1 3.17 3.14 
6000.0
-63.3 154.9 
0.0035 -0.0019 -3.8e-06 -7.8e-07 2.3e-06 
0.0002 -3.3e-06 -3.8e-08 2.3e-06 -2.4e-06 
0.0 0.0 0.0 0.0 0.0 
"""  # noqa: W291


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (("0.0 0.0 0.0 0.0 0.0", "0.0 0.1 0.0 0.0 0.0"), "line 10", "zeros"),
        (("\n0.0 0.0 0.0 0.0 0.0", ""), "line 10", "got nothing"),
        (("6000.0", "0"), "camera cam1, K", "focal lengths > 0"),
        (("6000.0", "nan"), "line 6, focal length", "finite"),
        (("1280 1024", "1280 0"), "line 3", "whole pixels"),
        (("1280 1024", "1280"), "line 3", "2 numbers"),
        (("48.7 79.4", "48.7"), "line 4", "3 numbers"),
        (("Tsai model", "Zolof model"), "line 1", "Tsai"),
        (("cam1\n", "\xff\n"), "byte", "UTF-8"),
    ],
)
def test_myptv_that_is_broken(tmp_path, change, place, expected):
    path = tmp_path / "cam1"
    path.write_bytes(MYPTV.replace(*change).encode("latin-1"))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(path, format="myptv")
    assert place in error.value.place


def test_myptv_cameras_come_in_the_order_of_people(tmp_path):
    for i in (10, 2, 1):
        (tmp_path / f"cam{i}").write_text(MYPTV.replace("cam1", f"cam{i}"))
    (tmp_path / "blobs_cam1").write_text("1 2 3\n")
    rig = read_rig(tmp_path)
    assert rig.names == ("cam1", "cam2", "cam10")
    np.testing.assert_allclose(rig[0].center, [0.0487, 0.0794, 0.5286])
    np.testing.assert_allclose(read_rig(tmp_path, units="m")[0].center, [48.7, 79.4, 528.6])


def test_flydra_folders_with_less_in_them(tmp_path):
    rig = rig_for("flydra")
    folder = tmp_path / "f"
    write_rig(rig, folder, format="flydra")
    (folder / "camera_order.txt").unlink()
    assert read_rig(folder).names == ("camera1", "camera2", "camera3")
    (folder / "calibration_units.txt").write_text("meters\n")
    np.testing.assert_allclose(read_rig(folder)[0].center, rig[0].center * 1000)
    (folder / "calibration_units.txt").unlink()
    judged = read_rig(folder)
    same_pixels(rig, judged)
    assert "mm" in judged.warnings[0]
    (folder / "Res.dat").unlink()
    guessed = read_rig(folder, units="mm")
    K = rig[0].K_lens
    assert guessed[0].size_px == (round(2 * K[0, 2] + 1), round(2 * K[1, 2] + 1))
    assert "Res.dat" in guessed.warnings[0]
    (folder / "basename2.rad").unlink()
    with pytest.raises(FormatError, match=r"Res\.dat"):
        read_rig(folder, units="mm")


@pytest.mark.parametrize(
    ("name", "change", "file", "expected"),
    [
        ("camera2.Pmat.cal", None, "camera_order.txt", "2 names"),
        ("camera2.Pmat.cal", lambda s: s + s, "camera2.Pmat.cal", "3 × 4"),
        ("camera2.Pmat.cal", lambda s: s.replace("e", "x", 1), "camera2.Pmat.cal", "3 × 4"),
        ("camera2.Pmat.cal", lambda s: "0 0 0 1\n" * 3, "camera2.Pmat.cal", "rank 3"),
        ("camera2.Pmat.cal", lambda s: s.replace(s.split()[0], "nan"), "camera2.Pmat", "finite"),
        ("basename2.rad", lambda s: s.replace("kc1", "kd1"), "basename2.rad", "got nothing"),
        ("basename2.rad", lambda s: s.replace("K11 = ", "K11 = -"), "basename2.rad", "> 0"),
        ("basename2.rad", lambda s: s.replace("K12 = 0.0", "K12 = 3"), "basename2.rad", "0 beside"),
        ("basename2.rad", lambda s: "hello\n", "basename2.rad", "a name = a number"),
        ("other2.rad", lambda s: "", "other2.rad", "one file a camera"),
        ("Res.dat", lambda s: "1 2\n", "Res.dat", "3 × 2"),
        ("Res.dat", lambda s: s.replace("1000", "0"), "Res.dat", "whole pixels"),
        ("calibration_units.txt", lambda s: "feet", "calibration_units.txt", "millimeters"),
        ("camera_order.txt", lambda s: "a\na\nb\n", "f", "a name of its own"),
    ],
)
def test_flydra_that_is_broken(tmp_path, name, change, file, expected):
    folder = tmp_path / "f"
    write_rig(rig_for("flydra"), folder, format="flydra")
    path = folder / name
    if change is None:
        path.unlink()
    else:
        path.write_text(change(path.read_text() if path.exists() else ""))
    with pytest.raises(FormatError, match=re.escape(expected)) as error:
        read_rig(folder)
    assert file in error.value.path


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


def test_two_cameras_of_one_name(tmp_path):
    path = tmp_path / "c.toml"
    path.write_text(ANIPOSE + ANIPOSE.replace("cam_0", "cam_1").split("[metadata]")[0])
    with pytest.raises(FormatError, match="a name of its own"):
        read_rig(path, units="m")


@pytest.mark.parametrize(
    ("change", "place", "expected"),
    [
        (("version = 1", "version = 2"), "version", "1"),
        (("asterism-rig", "asterism-wig"), "format", "asterism-rig"),
        (('kind = "brown-conrady"', 'kind = "fisheye"'), "kind", "one of brown-conrady"),
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


# ---- what means harm ---------------------------------------------------------------------------

BOMB = "<!DOCTYPE l [<!ENTITY a0 'ha'>" + "".join(
    f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12)
)  # fmt: skip
HOSTILE = {
    "entities.xcp": f"{BOMB}]><Cameras>&a11;</Cameras>",
    "outside.xcp": "<!DOCTYPE l [<!ENTITY x SYSTEM 'file:///etc/passwd'>]><Cameras>&x;</Cameras>",
    "deep.xcp": "<Cameras>" * 200_000,
    "deep.qca.txt": "<calibration>" + "<a>" * 100_000 + "</a>" * 100_000 + "</calibration>",
    "attributes.qca.txt": "<calibration " + " ".join(f'a{i}="1"' for i in range(200_000)) + "/>",
    "deep.yml": "%YAML:1.0\n---\nK: " + "[" * 50_000,
    "deeper.yml": "%YAML:1.0\n---\n" + "".join(" " * i + f"a{i}:\n" for i in range(1500)),
    "laughs.yml": "a0: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)) + "K: *a8\n",
    "keys.yml": "? [a, b]\n: c\n",
    "python.yml": "K: !!python/object/apply:os.system ['true']\n",
    "deep.toml": "a = " + "[" * 100_000,
    "dotted.toml": ".".join(["a"] * 20_000) + " = 1\n",
    "digits.toml": "a = " + "9" * 10_000,
    "words.toml": "matrix = distortions",
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_and_soon(tmp_path, name):
    path = tmp_path / name
    path.write_text(HOSTILE[name])
    start = time.perf_counter()
    with pytest.raises(FormatError):
        read_rig(path)
    assert time.perf_counter() - start < 5


def test_a_file_without_end_is_not_read(tmp_path):
    path = tmp_path / "a.yml"
    with path.open("wb") as file:
        file.truncate(3 << 30)
    with pytest.raises(FormatError, match="at most"):
        read_rig(path)


WORDS = [b"nan", b"inf", b"-inf", b"0", b"-1", b"1e999", b"1e300", b"-1e-300", b"", b"x", b"1e5",
         b"99999999999999999999", b"true", b"[]", b"'", b"1 2", b"0.5"]  # fmt: skip


def spoil(raw: bytes, rng: np.random.Generator) -> bytes:
    """Break a file: as bytes, as numbers, or as lines."""
    kind = rng.integers(3)
    numbers = list(re.finditer(rb"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?", raw))
    if kind == 0 or not numbers:
        return mutate(raw, rng)
    if kind == 1:
        for _ in range(int(rng.integers(1, 4))):
            match = numbers[int(rng.integers(len(numbers)))]
            word = WORDS[int(rng.integers(len(WORDS)))]
            raw = raw[: match.start()] + word + raw[match.end() :]
            numbers = list(re.finditer(rb"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?", raw)) or [match]
        return raw
    lines = raw.splitlines(keepends=True)
    a, b = (int(i) for i in rng.integers(0, len(lines), 2))
    if rng.random() < 0.5:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        del lines[a]
    return b"".join(lines)


@pytest.mark.parametrize("format", NAMES)
def test_damaged_files_are_read_or_refused(tmp_path, format):
    rig = rig_for(format)
    seed = tmp_path / NAMES[format]
    write_rig(rig, seed, format=format)
    outcomes = set()
    for i in range(200):
        rng = np.random.default_rng([11, i])
        broken = tmp_path / f"broken{i}-{NAMES[format]}"
        if seed.is_dir():
            shutil.copytree(seed, broken)
            files = sorted(broken.iterdir())
            victim = files[int(rng.integers(len(files)))]
        else:
            broken.write_bytes(seed.read_bytes())
            victim = broken
        victim.write_bytes(spoil(victim.read_bytes(), rng))
        try:
            again = read_rig(broken, format=format)
        except AsterismError:
            outcomes.add("refused")
            continue
        outcomes.add("read")
        for camera in again:  # what was read is sound
            assert np.isfinite(camera.T_camera_world).all()
            assert np.isfinite(camera.K).all()
        with contextlib.suppress(AsterismError):
            write_rig(again, tmp_path / f"again{i}.toml")
            read_rig(tmp_path / f"again{i}.toml")
    assert outcomes == {"read", "refused"}


def test_lenses_are_all_tried():
    kinds = {BrownConrady, ReportRadial, ViconRadial, QuadraticCorrection}
    assert {type(lens) for lens in LENSES.values()} == kinds
    assert isinstance(rig_for("rig")[0], Camera)
