"""Real calibrations, with the points that they were made from."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

from asterism.cli import main
from asterism.io.calibrations import CALIBRATION_FORMATS, read_rig, write_rig
from asterism.io.calibrations.fitting import fit_to_format
from asterism.multiview.rig_info import meeting_point
from tests.paths import DATA

pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real captures at {DATA}"),
]
FLYDRA = DATA / "strawlab__flydra/flydra_analysis/tests/sample_calibration"
MYPTV = DATA / "ronshnapp__MyPTV/example"
VICON = DATA / "RealTimeBiomechanics__rtosim/data/ViconNexus/walking_1.xcp"
QUALISYS = DATA / "perfanalytics__pose2sim/Pose2Sim/Demo_SinglePerson/calibration/Calib.qca.txt"


def errors(camera, points, pixels):
    return np.linalg.norm(camera.project(points).pixels - pixels, axis=1)


# Median distance of the calibration's own points, pixels: with its lens, and without.
FLYDRA_MEDIANS = [(0.20, 0.70), (0.18, 1.15), (0.21, 0.38), (0.22, 0.40), (0.25, 0.45)]


@pytest.mark.parametrize("i", range(5))
def test_flydra_sees_its_own_points(i):
    camera = read_rig(FLYDRA)[i]
    assert camera.name == f"cam{i + 1}_0"
    assert camera.size_px == (656, 491)
    rows = np.loadtxt(FLYDRA / f"cam{i + 1}.points4cal.dat")
    for bent, expected in zip(
        (camera, camera.replace(lens=None, K_lens=None)), FLYDRA_MEDIANS[i], strict=True
    ):
        found = np.median(errors(bent, rows[:, :3] / 1000, rows[:, 4:6]))
        assert found == pytest.approx(expected, abs=0.006)


MYPTV_MEDIANS = [(0.211, 0.472), (0.441, 1.514), (0.427, 2.020)]


@pytest.mark.parametrize("i", range(3))
def test_myptv_sees_its_own_points(i):
    camera = read_rig(MYPTV)[i]
    rows = np.loadtxt(MYPTV / "Calibration" / f"cam{i + 1}_cal_points")
    for bent, expected in zip(
        (camera, camera.replace(lens=None, K_lens=None)), MYPTV_MEDIANS[i], strict=True
    ):
        found = np.median(errors(bent, rows[:, 2:] / 1000, rows[:, :2]))
        assert found == pytest.approx(expected, abs=0.001)


@pytest.mark.parametrize(("i", "expected"), [(0, 0.348), (1, 0.399), (2, 0.494)])
def test_myptv_sees_particles_where_their_blobs_are(i, expected):
    particles, blobs = np.loadtxt(MYPTV / "particles"), np.loadtxt(MYPTV / f"blobs_cam{i + 1}")
    # Blobs stand as row and column, counted within their frame.
    seen = [blobs[blobs[:, 5] == row[7]][int(row[3 + i]), 1::-1] for row in particles]
    found = errors(read_rig(MYPTV)[i], particles[:, :3] / 1000, np.array(seen))
    assert np.median(found) == pytest.approx(expected, abs=0.001)


@pytest.mark.parametrize(
    ("path", "n", "height"), [(QUALISYS, 4, (0.3, 1.2)), (VICON, 12, (0.8, 1.4))]
)
def test_a_laboratory_is_above_its_floor_and_no_mirror_of_itself(path, n, height):
    rig = read_rig(path)
    assert len(rig) == n
    assert rig.warnings == ()
    meeting = meeting_point(rig)
    assert height[0] < meeting[2] < height[1]  # at a person, above the floor
    assert rig.project(meeting).visible.all()
    for camera in rig:
        assert 0.5 < camera.center[2] < 3
        z = np.array([0, 0, 0.1])
        places = np.stack([meeting, meeting + z, meeting + np.cross(camera.axis, z)])
        here, up, right = camera.project(places).pixels
        if path == QUALISYS:  # two of the others hang upside down
            assert up[1] < here[1] - 10  # v runs down
        # However a camera is turned, right and up are in the order of no mirror.
        (a, b), (c, d) = right - here, up - here
        assert a * d - b * c < -100


real_rig = functools.cache(read_rig)


@pytest.mark.usefixtures("each_fit_once")
@pytest.mark.parametrize("source", [FLYDRA, MYPTV, VICON, QUALISYS], ids=lambda p: p.name)
@pytest.mark.parametrize("format", CALIBRATION_FORMATS)
def test_real_rigs_go_through_every_format(tmp_path, source, format):
    rig = real_rig(source)[:2]
    form = CALIBRATION_FORMATS[format]
    fits = [fit_to_format(camera, form) for camera in rig]
    cameras = tuple(c if f is None else f.camera for c, f in zip(rig, fits, strict=True))
    path = tmp_path / f"a{(form.extensions or ('',))[0]}"
    write_rig(rig.replace(cameras=cameras), path, format=format)
    again = read_rig(path)
    for camera, fit, new in zip(rig, fits, again, strict=True):
        w, h = camera.size_px
        pixels = np.stack(np.meshgrid(np.linspace(0, w - 1, 9), np.linspace(0, h - 1, 9)), -1)
        points = camera.center + camera.rays(pixels.reshape(-1, 2)) * 3
        away = np.linalg.norm(new.project(points).pixels - pixels.reshape(-1, 2), axis=1)
        assert away.max() < (1e-8 if fit is None else fit.max_px + 1e-6)


def test_check_with_all_known_points(capsys):
    files = sorted(FLYDRA.glob("*.points4cal.dat"))
    options = [x for file in files for x in ("--points", str(file))]
    assert main(["camera", "check", str(FLYDRA), *options, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [e["n_points"] for e in found["reprojection"]] == [506, 414, 456, 506, 240]
    assert max(e["median_px"] for e in found["reprojection"]) < 0.25
    assert main(["camera", "info", str(VICON)]) == 0
    assert "26552" in capsys.readouterr().out
