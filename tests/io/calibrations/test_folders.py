"""Calibrations that are folders: MyPTV and flydra, what their numbers mean, and broken ones."""

from __future__ import annotations

import re
import shutil

import cv2
import numpy as np
import pytest

from asterism.camera import (
    Rig,
)
from asterism.errors import FormatError
from asterism.io.calibrations import read_rig, write_rig
from tests.io.calibrations.rigs import rig_for, same_pixels, target_points


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
        (("\n0.0 0.0 0.0 0.0 0.0", ""), "line 10", "found nothing"),
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
        ("basename2.rad", lambda s: s.replace("kc1", "kd1"), "basename2.rad", "found nothing"),
        ("basename2.rad", lambda s: s.replace("K11 = ", "K11 = -"), "basename2.rad", "> 0"),
        ("basename2.rad", lambda s: s.replace("K12 = 0.0", "K12 = 3"), "basename2.rad", "0 beside"),
        ("basename2.rad", lambda s: "hello\n", "basename2.rad", "a name = a number"),
        ("other2.rad", lambda s: "", "other2.rad", "one file for each camera, found camera 2"),
        ("Res.dat", lambda s: "1 2\n", "Res.dat", "3 × 2"),
        ("Res.dat", lambda s: s.replace("1000", "0"), "Res.dat", "whole pixels"),
        ("calibration_units.txt", lambda s: "ells", "calibration_units.txt", "millimeters"),
        ("camera_order.txt", lambda s: "a\na\nb\n", "f", "a unique name"),
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
