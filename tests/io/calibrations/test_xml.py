"""Calibrations of Qualisys and Vicon: what their numbers mean, and broken files."""

from __future__ import annotations

import re

import numpy as np
import pytest

from asterism.camera import (
    BrownConrady,
    Rig,
)
from asterism.errors import FormatError
from asterism.io.calibrations import read_rig, write_rig
from tests.io.calibrations.rigs import rig_for, target_points

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
        (('r33="0"', ""), "transform r33", "a number, found nothing"),
        (('z="1500"', 'z="high"'), "transform z", "a number"),
        (('z="1500"', 'z="NaN"'), "transform z", "finite"),
        (('skew="0"', 'skew="3"'), "intrinsic skew", "0, as Qualisys"),
        (('focalLengthU="64000"', 'focalLengthU="0"'), "camera 111, K", "focal lengths > 0"),
        (('right="1099"', 'right="99"'), "fov_video", "whole pixels"),
        (
            ('<fov_video left="100"', '<fov_video l="1"'),
            "fov_video left",
            "a number, found nothing",
        ),
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
