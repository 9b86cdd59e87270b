"""Calibrations: every format there and back, what it cannot hold, and safe writing."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

from asterism.camera import (
    Rig,
)
from asterism.errors import FormatError, ParameterError
from asterism.io.calibrations import CALIBRATION_FORMATS, read_rig, write_rig
from tests.io.calibrations.rigs import LENSES, NAMES, rig_for, same_pixels


def test_every_format_is_tried_here():
    assert set(NAMES) == set(CALIBRATION_FORMATS)


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
    # The content decides if the name has no suffix.
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
    assert "fit_lens(camera, am." in str(error.value)
    assert "asterism camera convert" in str(error.value)
    assert not path.exists()


def test_a_lens_about_another_centre_does_not_go_where_there_is_none(tmp_path):
    camera = rig_for("flydra")[0]
    for name in ("a.qca.txt", "a.yml"):
        with pytest.raises(ParameterError, match="K_lens"):
            write_rig(Rig((camera,)), tmp_path / name)


@pytest.mark.parametrize("format", ["qca", "xcp", "anipose", "opencv"])
def test_skew_is_refused_where_there_is_no_number_for_it(tmp_path, format):
    camera = rig_for(format)[0]
    K = camera.K.copy()
    K[0, 1] = 2.0
    with pytest.raises(ParameterError, match="skew"):
        write_rig(Rig((camera.replace(K=K),)), tmp_path / NAMES[format], format=format)


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
    with pytest.raises(FormatError, match="cannot be written"):
        write_rig(rig, tmp_path / "no" / "a.toml")
    with pytest.raises(FormatError, match="cannot be written"):
        write_rig(rig_for("myptv"), tmp_path / "no" / "a", format="myptv")
    with pytest.raises(ParameterError, match="ending in"):
        write_rig(rig, tmp_path / "a")
    with pytest.raises(ParameterError, match="one of rig"):
        write_rig(rig, tmp_path / "a", format="theia")


def test_opening_what_is_not_there(tmp_path):
    with pytest.raises(FormatError, match="no such file"):
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
    given = read_rig(path, units="mm")
    same_pixels(rig, given)
    assert given.warnings == ()
    np.testing.assert_allclose(read_rig(path, units="m")[0].center, rig[0].center * 1000)


def test_a_unit_that_the_format_has_not_is_refused(tmp_path):
    write_rig(rig_for("qca"), tmp_path / "a.qca.txt")
    same_pixels(rig_for("qca"), read_rig(tmp_path / "a.qca.txt", units="mm"))
    with pytest.raises(ParameterError, match="mm, as in all files"):
        read_rig(tmp_path / "a.qca.txt", units="m")
    with pytest.raises(ParameterError, match="one of mm, cm, m"):
        read_rig(tmp_path / "a.qca.txt", units="furlong")
