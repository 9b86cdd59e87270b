"""Caliscope's calibration and image points, in each form that its versions write."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import asterism as am
from asterism.cli import main
from asterism.errors import FormatError
from asterism.io.calibrations.files import format_of
from tests.io.calibrations.rigs import rig_for, same_pixels, target_points


def numbered():
    """The rig of the other formats, its cameras called as caliscope numbers them."""
    rig = rig_for("caliscope")
    return am.Rig(tuple(c.replace(name=f"cam_{n}") for c, n in zip(rig, (0, 3, 7), strict=True)))


def camera_array(rig, rotation, *, id_key="cam_id", table="cameras."):
    """The file as caliscope has it, written without the library."""
    text = ""
    for camera in rig:
        number = camera.name.removeprefix("cam_")
        lens = camera.lens
        R = camera.T_camera_world[:3, :3]
        entries = {
            id_key: number,
            "size": list(camera.size_px),
            "rotation_count": -1,
            "error": 0.41,
            "exposure": '"null"',
            "grid_count": 30,
            "ignore": "false",
            "verified_resolutions": [[640, 480]],
            "matrix": camera.K.tolist(),
            "distortions": [lens.k1, lens.k2, lens.p1, lens.p2, lens.k3],
            "translation": camera.T_camera_world[:3, 3].tolist(),
            "rotation": rotation(R),
        }
        text += f"[{table}{number}]\n" + "".join(f"{k} = {v}\n" for k, v in entries.items()) + "\n"
    return text


FORMS = {
    "vector": lambda R: Rotation.from_matrix(R).as_rotvec().tolist(),
    "column": lambda R: [[x] for x in Rotation.from_matrix(R).as_rotvec().tolist()],
    "matrix": lambda R: R.tolist(),
    "rounded matrix": lambda R: np.round(R, 6).tolist(),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("id_key", ["cam_id", "port"])
def test_camera_array(tmp_path, form, id_key):
    rig = numbered()
    path = tmp_path / "camera_array.toml"
    path.write_text(camera_array(rig, FORMS[form], id_key=id_key))
    again = am.read_rig(path)
    assert again.names == ("cam_0", "cam_3", "cam_7")
    assert again.warnings == ()  # the unit is known: metres
    same_pixels(rig, again, 1e-9 if form != "rounded matrix" else 0.01)
    # The same pixels as OpenCV finds by the file's own numbers.
    for camera in again:
        R, t = camera.T_camera_world[:3, :3], camera.T_camera_world[:3, 3]
        lens = np.array([camera.lens.k1, camera.lens.k2, camera.lens.p1, camera.lens.p2,
                         camera.lens.k3])  # fmt: skip
        theirs = cv2.projectPoints(target_points(), cv2.Rodrigues(R)[0], t, camera.K, lens)[0]
        np.testing.assert_allclose(camera.project(target_points()).pixels, theirs[:, 0], atol=1e-6)


def test_the_older_form_without_the_table_of_cameras(tmp_path):
    text = camera_array(numbered(), FORMS["matrix"], id_key="port", table="cam_")
    text += '[charuco]\ncolumns = 4\nunits = "inch"\n'
    (tmp_path / "config.toml").write_text(text)
    rig = am.read_rig(tmp_path / "config.toml", units="m")
    same_pixels(numbered(), rig)
    assert rig.warnings == ("the entry 'charuco' is not a camera and is left out",)


def test_cameras_without_a_pose_or_marked_ignore_are_named(tmp_path):
    text = camera_array(numbered(), FORMS["vector"])
    one, two, three = text.split("\n\n")[:3]
    two = "\n".join(line for line in two.split("\n") if "rotation =" not in line)
    two = "\n".join(line for line in two.split("\n") if "translation =" not in line)
    three = three.replace("ignore = false", "ignore = true")
    (tmp_path / "a.toml").write_text("\n\n".join([one, two, three]))
    rig = am.read_rig(tmp_path / "a.toml")
    assert rig.names == ("cam_0",)
    assert rig.warnings == (
        "camera cam_3 has no pose and is left out",
        "camera cam_7 is marked ignore and is left out",
    )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("rotation = [", "rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 2]] #", "cam_0, rotation: exp"),
        ("rotation = [", "rotation = [[1, 0, 0], [0, 1, 0]] #", "3 × 3 numbers"),
        ("rotation = [", "rotation = [[1, 0, 0], [0, 1], [0]] #", "3 × 3 numbers"),
        ("rotation = [", 'rotation = "null" #', "cam_0, rotation"),
        ("size = [", "fisheye = true\nsize = [", "fisheye"),
    ],
)
def test_what_is_wrong_is_told_by_its_camera(tmp_path, old, new, says):
    text = camera_array(numbered(), FORMS["vector"]).replace(f"\n{old}", f"\n{new}")
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(FormatError, match=says):
        am.read_rig(tmp_path / "a.toml")


def test_there_and_back_keeps_numbers_and_names(tmp_path):
    am.io.write_rig(numbered(), tmp_path / "a.toml", format="caliscope")
    assert format_of(tmp_path / "a.toml").name == "caliscope"
    assert "[cameras.3]" in (tmp_path / "a.toml").read_text()
    assert am.read_rig(tmp_path / "a.toml").names == ("cam_0", "cam_3", "cam_7")
    same_pixels(numbered(), am.read_rig(tmp_path / "a.toml"))
    mixed = am.Rig(tuple(c.replace(name=n) for c, n in zip(numbered(), "xyz", strict=True)))
    am.io.write_rig(mixed, tmp_path / "b.toml", format="caliscope")
    assert "[cameras.2]" in (tmp_path / "b.toml").read_text()
    assert am.read_rig(tmp_path / "b.toml").names == ("x", "y", "z")


def seen_by(rig, n_frames=6):
    """Points of a body that moves, as each camera sees them."""
    rng = np.random.default_rng(2)
    body = rng.uniform([-0.4, -0.4, 0.7], [0.4, 0.4, 1.5], (5, 3))
    return [body + 0.01 * t for t in range(n_frames)]


def xy(rig, *, camera="cam_id", time=True, board=True):
    """The file as caliscope has it: cameras of a frame are a little apart in time."""
    head = ["sync_index", camera, "frame_index"] + ["frame_time"] * time
    head += ["point_id", "img_loc_x", "img_loc_y"] + ["obj_loc_x", "obj_loc_y"] * board
    lines = [",".join(head)]
    for t, body in enumerate(seen_by(rig), start=40):
        for c, cam in enumerate(rig):
            pixels = cam.project(body).pixels
            for k, (u, v) in enumerate(pixels.tolist()):
                if (t + c + k) % 7 == 0:
                    continue
                cells = [t, cam.name.removeprefix("cam_"), t - 1]
                cells += [repr(7 + t / 50 + 0.001 * c)] * time
                cells += [k * 10, repr(u), repr(v)] + ["", "0.05"] * board
                lines.append(",".join(map(str, cells)))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("camera", ["cam_id", "port"])
def test_image_points(tmp_path, camera, caplog):
    rig = numbered()
    path = tmp_path / "xy_CHARUCO.csv"
    path.write_text(xy(rig, camera=camera))
    seen = am.io.read_observations(path)
    assert seen.cameras == rig.names
    np.testing.assert_allclose(seen.times, 7 + np.arange(40, 46) / 50 + 0.001)
    assert set(seen.markers) == {0, 10, 20, 30, 40}
    assert seen.marker_names == ()
    for t, body in enumerate(seen_by(rig)):
        for c, cam in enumerate(rig):
            kept = [k for k in range(5) if (t + 40 + c + k) % 7]
            np.testing.assert_array_equal(seen.points(t, c), cam.project(body).pixels[kept])
    # There and back by the format in which image points are written.
    am.io.write_observations(seen, tmp_path / "o.csv")
    again = am.io.read_observations(tmp_path / "o.csv")
    np.testing.assert_array_equal(again.pixels, seen.pixels)
    np.testing.assert_array_equal(again.times, seen.times)
    np.testing.assert_array_equal(again.markers, seen.markers)
    assert again.cameras == seen.cameras
    assert caplog.messages == []


def test_image_points_without_times_count_frames(tmp_path, caplog):
    path = tmp_path / "xy.csv"
    path.write_text(xy(numbered(), time=False, board=False))
    np.testing.assert_array_equal(am.io.read_observations(path).times, np.arange(40, 46))
    expected = f"{path}: no frame_time is given: times are frame numbers, one per second"
    assert caplog.messages == [expected]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("40,3,", "40,,", "line 6, column cam_id: expected a number, found nothing"),
        ("40,3,", "40,3.5,", "line 6, column cam_id: expected a whole number"),
        ("40,3,", "40,-3,", "line 6, column cam_id: expected a number from 0"),
        ("40,3,", "40,x,", "line 6, column cam_id"),
        ("\n42,", "\n42,0,", "columns"),
    ],
)
def test_wrong_rows_are_told_by_their_line(tmp_path, old, new, says):
    text = xy(numbered())
    assert old in text
    path = tmp_path / "xy.csv"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FormatError, match=says):
        am.io.read_observations(path)


def test_the_command_line_reconstructs_from_both(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rig = numbered()
    (tmp_path / "camera_array.toml").write_text(camera_array(rig, FORMS["matrix"]))
    (tmp_path / "xy.csv").write_text(xy(rig))
    assert (
        main(["reconstruct", "xy.csv", "--rig", "camera_array.toml", "-o", "points.csv", "-q"]) == 0
    )
    points = am.read("points.csv")
    assert points.n_frames == 6
    for t, body in enumerate(seen_by(rig)):
        away = np.linalg.norm(points.frame(t)[:, None] - body[None], axis=2).min(axis=1)
        assert len(away) >= 3
        assert away.max() < 1e-3
    line = "camera convert camera_array.toml back.toml --format caliscope"
    assert main(line.split()) == 0
    same_pixels(rig, am.read_rig("back.toml"))
    capsys.readouterr()
