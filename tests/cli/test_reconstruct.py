"""``asterism reconstruct`` and ``asterism chain``: what they write, print and refuse."""

from __future__ import annotations

import json

import numpy as np
import pytest

import asterism as am
from asterism.cli import main


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    scene = am.simulate.cube(seed=1, frames=20)
    rig = am.Rig.ring(4, radius=3, height=2, target=(0, 0, 0))
    seeing = am.simulate.Seeing(noise_px=0.2, merge=False, marker_radius=0)
    shot = am.simulate.film(scene, rig, seeing=seeing)
    am.io.write_observations(shot.observations, folder / "obs.csv")
    am.io.write_rig(rig, folder / "rig.toml")
    return folder


def test_points_and_their_truth(film, tmp_path, capsys):
    out, truth = tmp_path / "points.csv", tmp_path / "truth.csv"
    arguments = ["reconstruct", str(film / "obs.csv"), "--rig", str(film / "rig.toml")]
    assert main([*arguments, "-o", str(out), "--truth", str(truth), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    points = am.read(out)
    assert said["n_points"] == points.n_points == 160
    assert (points.labels == -1).all()
    named = am.io.read_tracks(truth)
    assert named.n_tracks == 8
    scene = am.simulate.cube(seed=1, frames=20)
    scores = am.metrics.point_scores(named.detections, scene)
    assert scores.recall == 1
    assert scores.ghosts == 0
    # Standard deviations go with the points, in the formats that hold them.
    made = am.reconstruct(am.io.read_observations(film / "obs.csv"), am.read_rig(film / "rig.toml"))
    np.testing.assert_allclose(points.stds, made.detections.stds, rtol=1e-6)
    assert main([*arguments, "-o", str(tmp_path / "points.c3d")]) == 0
    assert "by number of cameras" in capsys.readouterr().out
    assert am.read(tmp_path / "points.c3d").n_points == 160


def test_what_is_refused_leaves_no_file(film, tmp_path, capsys):
    obs, rig, out = film / "obs.csv", film / "rig.toml", tmp_path / "p.csv"
    fewer = tmp_path / "fewer.toml"
    am.io.write_rig(am.read_rig(rig)[:3], fewer)
    untold = tmp_path / "untold.csv"
    seen = am.io.read_observations(obs)
    am.io.write_observations(
        am.Observations(
            times=seen.times, cameras=seen.cameras, offsets=seen.offsets, pixels=seen.pixels
        ),
        untold,
    )
    for arguments, message in (
        ([str(obs), "--rig", str(fewer), "-o", str(out)], "no cam4"),
        ([str(tmp_path / "none.csv"), "--rig", str(rig), "-o", str(out)], "none.csv"),
        ([str(obs), "--rig", str(tmp_path / "none.toml"), "-o", str(out)], "none.toml"),
        ([str(obs), "--rig", str(rig), "-o", str(obs)], "a path of its own"),
        ([str(obs), "--rig", str(rig), "-o", str(tmp_path / "p.xyz")], "--out: expected a name"),
        ([str(obs), "--rig", str(rig), "-o", str(out), "--min-views", "9"], "--min-views"),
        ([str(obs), "--rig", str(rig), "-o", str(out), "--sigma", "-1"], "--sigma"),
        (
            [str(untold), "--rig", str(rig), "-o", str(out), "--truth", str(tmp_path / "q.csv")],
            "--truth",
        ),
    ):
        assert main(["reconstruct", *arguments]) == 2
        assert message in capsys.readouterr().err
        assert not out.exists()


def test_the_whole_chain(tmp_path, capsys):
    arguments = ["chain", "person", "--rig", "ring6", "--frames", "30", "--method", "gnn"]
    arguments += ["--method", "smp", "-o", str(tmp_path / "chain"), "--json"]
    assert main(arguments) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["2d"]["seen_by_two_percent"] > 90
    assert said["3d"]["recall"] > 0.98
    assert said["3d"]["ghosts"] < 0.02
    assert set(said["identity"]) == {"gnn", "smp"}
    assert said["identity"]["gnn"]["idf1"] > 0.9
    again = am.evaluate(
        am.io.read_tracks(tmp_path / "chain" / "tracks_gnn.csv"),
        am.io.read_tracks(tmp_path / "chain" / "truth.csv"),
    )
    assert again.idf1 == pytest.approx(said["identity"]["gnn"]["idf1"], abs=0.01)
    assert main(arguments) == 2
    assert main([*arguments[:-3], "--overwrite", "-o", str(tmp_path / "chain")]) == 0
    assert "Identity" in capsys.readouterr().out
    assert main(["chain", "person", "--rig", "ring6", "--frames", "30"]) == 0
    assert "auto  smp, window=3, then stitched" in capsys.readouterr().out
    assert main(["chain", "person", "--method", "unknown"]) == 2


def test_point_scores_by_hand():
    truth = am.Tracks.from_dense([0.0, 1.0], [[[0, 0, 0], [1, 0, 0]], [[0, 0, 0], [np.nan] * 3]])
    d = am.Detections.from_frames([0.0, 1.0], [[[0.01, 0, 0], [5, 0, 0]], [[0, 0.003, 0]]])
    s = am.metrics.point_scores(d, truth)
    assert (s.n_markers, s.n_found, s.n_points, s.n_ghosts) == (3, 2, 3, 1)
    assert s.rms_mm == pytest.approx(np.sqrt((100 + 9) / 2))
    assert np.isnan(s.nees)
    only = am.metrics.point_scores(d, truth, counted=[[True, False], [False, False]])
    assert (only.n_markers, only.n_found, only.n_ghosts) == (1, 1, 1)
    # One point cannot be two markers.
    near = am.Tracks.from_dense([0.0], [[[0, 0, 0], [0.001, 0, 0]]])
    one = am.Detections.from_frames([0.0], [[[0, 0, 0]]])
    assert am.metrics.point_scores(one, near).n_found == 1
    with pytest.raises(am.ParameterError, match="truth"):
        am.metrics.point_scores(one, truth)


def test_the_map_of_a_rig(film, tmp_path, capsys):
    picture = tmp_path / "map.png"
    arguments = ["camera", "map", str(film / "rig.toml"), "--spacing", "0.5"]
    assert main([*arguments, "-o", str(picture), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert picture.read_bytes().startswith(b"\x89PNG")
    errors = [s["rms_error_mm"] for s in said["suggestions"]]
    assert len(errors) == 3
    assert errors == sorted(errors)
    assert errors[0] < said["rms_error_mm"]
    assert main([*arguments, "--low", "-1,-1,-1", "--high", "1,1,1", "--suggest", "1"]) == 0
    assert "One more camera" in capsys.readouterr().out
    for wrong in (
        ["--low", "0,0,0"],
        ["--low", "0,0", "--high", "1,1,1"],
        ["--low", "1,1,1", "--high", "0,0,0"],
        ["--suggest", "-1"],
        ["-o", str(tmp_path / "map.txt")],
    ):
        assert main([*arguments, *wrong]) == 2
