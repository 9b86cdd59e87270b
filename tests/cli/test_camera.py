"""``asterism camera``: info, convert and check, from the command line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from asterism.camera import BrownConrady, Rig, ViconRadial
from asterism.cli import main
from asterism.io.calibrations import CALIBRATION_FORMATS, read_rig, write_rig
from asterism.io.calibrations.points import read_sightings
from tests.io.calibrations.rigs import rig_for, target_points


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run a command in a folder that holds ``a.toml``; give its code, output and errors."""
    monkeypatch.chdir(tmp_path)
    write_rig(rig_for("rig"), "a.toml")

    def call(*arguments):
        code = main(["camera", *map(str, arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


# ---- info --------------------------------------------------------------------------------------


def test_info_says_what_the_cameras_are(run):
    rig = rig_for("anipose")
    write_rig(rig, "b.toml", format="anipose")
    code, out, _ = run("info", "b.toml")
    assert code == 0
    for camera in rig:
        assert camera.name in out
        assert ", ".join(f"{x:.3f}" for x in camera.center) in out
    _, out, _ = run("info", "b.toml", "--json")
    found = json.loads(out)
    assert found["n_cameras"] == found["cameras_that_see_it"] == 3
    np.testing.assert_allclose(found["axes_meet_at"], [0.1, 0, 1.1], atol=0.02)
    for camera, figures in zip(rig, found["cameras"], strict=True):
        assert figures["focal_px"] == [camera.K[0, 0], camera.K[1, 1]]
        assert figures["lens"] == "BrownConrady"
        assert figures["reach_percent"] == 100
        # The farthest shift is at a corner, as the lens is radial but for a little.
        w, h = camera.size_px
        corners = np.array([[u, v] for u in (-0.5, w - 0.5) for v in (-0.5, h - 0.5)])
        ideal = camera.undistort(corners) @ camera.K[:2, :2].T + camera.K[:2, 2]
        expected = np.linalg.norm(ideal - corners, axis=1).max()
        assert figures["largest_shift_px"] == pytest.approx(expected)


def test_info_of_a_pinhole_by_hand(run):
    camera = rig_for("myptv", bent=False)[0]
    K = np.array([[640, 0, 639.5], [0, 640, 511.5], [0, 0, 1.0]])
    write_rig(Rig((camera.replace(K=K, size_px=(1280, 1024)),)), "b.toml")
    _, out, _ = run("info", "b.toml", "--json")
    (figures,) = json.loads(out)["cameras"]
    np.testing.assert_allclose(figures["field_deg"], [90, 2 * np.degrees(np.arctan(0.8))])
    assert figures["largest_shift_px"] == 0
    np.testing.assert_allclose(figures["looks_at"], camera.center + camera.axis)


def test_info_of_a_lens_that_ends_within_the_image(run):
    camera = rig_for("anipose", bent=False)[0].replace(lens=BrownConrady(k1=-0.9))
    write_rig(Rig((camera,)), "b.toml")
    _, out, _ = run("info", "b.toml", "--json")
    (figures,) = json.loads(out)["cameras"]
    # r (1 - 0.9 r²) ends at r = 1 / √2.7, two thirds of which is as far as the image goes.
    radius = 2 / 3 / np.sqrt(2.7)
    seen = np.pi * radius**2 * camera.K[0, 0] * camera.K[1, 1] / np.prod(camera.size_px)
    assert figures["reach_percent"] == pytest.approx(100 * seen, rel=0.05)
    assert run("check", "b.toml")[0] == 1


# ---- convert -----------------------------------------------------------------------------------


@pytest.mark.parametrize("format", CALIBRATION_FORMATS)
def test_convert_to_every_format(run, format):
    suffixes = CALIBRATION_FORMATS[format].extensions or ("",)
    code, out, err = run("convert", "a.toml", f"b{suffixes[0]}", "--format", format, "--json")
    assert code == 0, err
    report = json.loads(out)
    again, rig, points = read_rig(f"b{suffixes[0]}"), rig_for("rig"), target_points()
    assert again.names == rig.names
    for new, old, change in zip(again, rig, report["cameras"], strict=True):
        np.testing.assert_allclose(new.center, old.center, atol=1e-9)
        away = np.linalg.norm(new.project(points).pixels - old.project(points).pixels, axis=1)
        if change["rms_px"] is None:
            assert away.max() < 1e-9
        else:  # the reported errors bound the measured ones
            assert 0 < change["rms_px"] <= change["max_px"]
            assert away.max() < 1.1 * change["max_px"] + 1e-6
            assert np.sqrt(np.mean(away**2)) < 2 * change["rms_px"] + 1e-6
    if format == "rig":
        assert [c["rms_px"] for c in report["cameras"]] == [None] * 3


def test_convert_a_report_lens_to_vicon_is_exact_where_it_can_be(run):
    camera = rig_for("myptv", bent=False)[0]  # one focal length, so that pixels are round
    from asterism.camera import ReportRadial

    write_rig(Rig((camera.replace(lens=ReportRadial(0.1, -0.03)),)), "b.toml")
    _, out, _ = run("convert", "b.toml", "b.xcp", "--json")
    (change,) = json.loads(out)["cameras"]
    assert change["lens"] == "ViconRadial"
    assert change["max_px"] < 1e-6
    lens = read_rig("b.xcp")[0].lens
    assert lens.k1 == pytest.approx(0.1 / camera.K[0, 0] ** 2, rel=1e-6)


def test_convert_with_a_lens_of_ones_choice(run):
    for name, kind in (("brown", BrownConrady), ("vicon", ViconRadial), ("none", type(None))):
        code, out, _ = run("convert", "a.toml", f"{name}.toml", "--lens", name)
        assert code == 0
        rig = read_rig(f"{name}.toml")
        assert {type(c.lens) for c in rig} == {kind}
        assert "not fitted" in out if name != "none" else "not fitted" not in out
    rms = {}
    for name in ("brown", "none"):
        _, out, _ = run("convert", "a.toml", f"{name}2.toml", "--lens", name, "--json")
        rms[name] = [c["rms_px"] or 0 for c in json.loads(out)["cameras"]]
    assert all(a < b / 5 for a, b in zip(rms["brown"], rms["none"], strict=True))


def test_convert_takes_out_a_skew_that_a_format_cannot_hold(run):
    camera = rig_for("flydra", bent=False)[0]
    assert camera.K[0, 1] != 0
    write_rig(Rig((camera,)), "b.toml")
    _, out, _ = run("convert", "b.toml", "b.yml", "--json")
    (change,) = json.loads(out)["cameras"]
    assert 0 < change["max_px"] < 1
    assert read_rig("b.yml")[0].K[0, 1] == 0


def test_convert_refuses_before_it_writes(run, tmp_path):
    before = sorted(p.name for p in tmp_path.iterdir())
    for arguments, word in (
        (("a.toml", "a.toml"), "OUT"),
        (("a.toml", "b"), "ending in"),
        (("a.toml", "b.toml", "--lens", "fish"), "--lens"),
        (("a.toml", "b.toml", "--format", "theia"), "format"),
        (("none.xcp", "b.toml"), "none.xcp: no such file"),
        (("a.toml", "b.xcp", "--lens", "brown"), "ViconRadial"),
        (("a.toml", "no/b.xcp"), "folder that exists"),
        (("a.toml", "b.xcp", "--units", "mm"), "units"),
    ):
        code, _, err = run("convert", *arguments)
        assert code == 2
        assert word in err
        assert "Traceback" not in err
    assert sorted(p.name for p in tmp_path.iterdir()) == before


# ---- check -------------------------------------------------------------------------------------


def sightings(rig: Rig, noise: float = 0.0):
    points = target_points()
    rng = np.random.default_rng(2)
    return points, [c.project(points).pixels + rng.normal(0, noise, (len(points), 2)) for c in rig]


def test_check_passes_a_sound_rig_and_its_points(run):
    rig = rig_for("rig")
    points, pixels = sightings(rig, noise=0.2)
    lines = ["u,v,z,y,x,camera"]
    for camera, seen in zip(rig, pixels, strict=True):
        lines += [f"{u},{v},{z},{y},{x},{camera.name}" for (x, y, z), (u, v) in zip(
            points.tolist(), seen.tolist(), strict=True)]  # fmt: skip
    with open("p.csv", "w") as file:  # noqa: PTH123
        file.write("\n".join(lines))
    code, out, err = run("check", "a.toml", "--points", "p.csv", "--json")
    assert code == 0, err
    found = json.loads(out)
    assert found["passed"] is True
    assert {c["status"] for c in found["checks"]} == {"passes"}
    for camera, error in zip(rig, found["reprojection"], strict=True):
        assert error["camera"] == camera.name
        assert error["n_points"] == len(points)
        # The length of a two-dimensional error: Rayleigh, median 1.177 σ, 95 % 2.448 σ.
        assert error["median_px"] == pytest.approx(0.2 * 1.177, rel=0.2)
        assert error["percentile_95_px"] == pytest.approx(0.2 * 2.448, rel=0.2)
    assert run("check", "a.toml", "--points", "p.csv", "--max-px", "0.1")[0] == 1
    assert run("check", "a.toml", "--points", "p.csv", "--point-units", "mm")[0] == 1


def test_check_reads_points_of_one_camera(run, tmp_path):
    rig = rig_for("rig")
    points, pixels = sightings(rig)
    one = np.ones((len(points), 1))
    np.savetxt("cam1.points4cal.dat", np.hstack([points * 1000, one, pixels[0], one]))
    np.savetxt("cam2_cal_points", np.hstack([pixels[1], points * 1000]))
    np.savetxt("wand", np.hstack([pixels[2], points]))
    files = ["cam1.points4cal.dat", "cam2_cal_points"]
    options = [x for file in files for x in ("--points", file)]
    code, out, err = run("check", "a.toml", *options, "--json")
    assert code == 0, err
    errors = json.loads(out)["reprojection"]
    assert [e["camera"] for e in errors] == ["cam1", "cam2"]
    assert max(e["worst_px"] for e in errors) < 1e-6
    code, _, err = run("check", "a.toml", "--points", "wand")
    assert code == 2
    assert "CAMERA=FILE" in err
    code, _, err = run("check", "a.toml", "--points", "cam3=wand", "--point-units", "m")
    assert code == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "known points"),
        ("1 2 3\n", "X Y Z 1 u v 1"),
        ("1 2 3 4 5\n1 2 3\n", "line 2"),
        ("1 2 3 4 x\n", "line 1"),
        ("1 2 3 4 nan\n", "finite"),
        ("1 2 3 2 5 6 1\n", "fourth"),
        ("camera,x,y,z,u\n", "no v"),
        ("camera,x,y,z,u,v\ncam1,1,2,3,4\n", "line 2"),
        ("camera,x,y,z,u,v\ncam1,1,2,3,4,inf\n", "finite"),
        ("camera,x,y,z,u,v\ncam9,1,2,3,4,5\n", "cam9"),
        ("camera,x,y,z,u,v\n", "known points"),
    ],
)
def test_points_that_are_none(run, text, expected):
    with open("cam1.txt", "w") as file:  # noqa: PTH123
        file.write(text)
    code, _, err = run("check", "a.toml", "--points", "cam1.txt")
    assert code == 2
    assert expected in err
    assert run("check", "a.toml", "--points", "nowhere")[0] == 2
    assert run("check", "a.toml", "--points", ".")[0] == 2


def test_whose_points_a_file_holds(tmp_path):
    (tmp_path / "x").mkdir()
    for file, cameras, whose in (
        ("cam1.points4cal.dat", ["cam1_0", "cam10_0"], "cam1_0"),
        ("cam10_cal_points", ["cam1", "cam10"], "cam10"),
        ("cam1_cal_points", ["cam1", "cam10"], "cam1"),
        ("left.csv.txt", ["left", "left.csv"], "left.csv"),
    ):
        path = tmp_path / "x" / file
        path.write_text("1 2 3 4 5\n")
        assert read_sightings(path, cameras)[0].camera == whose


def test_check_fails_what_cannot_be(run):
    rig = rig_for("rig")
    # Two cameras in one place.
    T = rig[0].T_camera_world
    write_rig(Rig((rig[0], rig[1].replace(T_camera_world=T))), "same.toml")
    # A camera that looks away from the others.
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])
    away = [c.replace(T_camera_world=turned @ c.T_camera_world) for c in rig]
    write_rig(Rig((away[0], rig[1])), "away.toml")
    write_rig(Rig(tuple(away)), "out.toml")
    K = rig[0].K * [[1], [2], [1]]
    write_rig(Rig((rig[0].replace(K=K), rig[1])), "oblong.toml")
    for name, check in (
        ("same.toml", "places of the cameras"),
        ("away.toml", "a common volume"),
        ("out.toml", "a common volume"),
        ("oblong.toml", "focal lengths along u and v"),
    ):
        code, out, _ = run("check", name, "--json")
        assert code == 1
        found = json.loads(out)
        assert found["passed"] is False
        assert check in [c["name"] for c in found["checks"] if c["status"] == "fails"]
    code, out, _ = run("check", "same.toml")
    assert code == 1
    assert "fails" in out
    code, _, err = run("check", "a.toml", "--max-px", "0")
    assert code == 2
    assert "--max-px" in err


def test_check_of_one_camera_is_odd_and_passes(run):
    write_rig(Rig((rig_for("rig")[0],)), "b.toml")
    code, out, _ = run("check", "b.toml")
    assert code == 0
    assert "is odd" in out


def test_no_command_shows_help(run):
    code, out, err = run()
    assert "convert" in out + err
    assert code in (0, 2)
