"""What commands make of the files that they read: names, damage, units."""

from __future__ import annotations

import json

import numpy as np
import pytest

import asterism as am
from tests.cli.runs import printed, refused
from tests.io.c3d_bytes import make_c3d


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def walk(n_frames=60, n_points=5, seed=0):
    """A body of points in millimetres that wanders, with a fourth word of 0."""
    rng = np.random.default_rng(seed)
    shape = rng.uniform(100, 900, (n_points, 3))
    path = np.cumsum(rng.normal(scale=3, size=(n_frames, 1, 3)), axis=0)
    return np.concatenate([shape + path, np.zeros((n_frames, n_points, 1))], axis=2)


def write_c3d(path, points, **options):
    path.write_bytes(make_c3d(points, **options))


def test_marker_sets_leave_out_channels_without_a_name(tmp_path, capsys):
    labels = ["LASI", "RASI", "SACR", "*12", "Unlabeled 7"]
    write_c3d(tmp_path / "a.c3d", walk(), labels=labels)
    printed("markerset learn a.c3d -o a.toml", capsys)
    assert am.MarkerSet.from_toml(tmp_path / "a.toml").names == ("LASI", "RASI", "SACR")
    write_c3d(tmp_path / "b.c3d", walk(), labels=["*0", "*1", "", "U_4", "New 0001"])
    err = refused("markerset learn b.c3d -o b.toml", capsys)
    assert "a capture with named markers, found 5 tracks in b.c3d, none with a name" in err
    assert not (tmp_path / "b.toml").exists()


def test_a_truncated_capture_is_tracked_and_the_result_says_so(tmp_path, capsys):
    write_c3d(tmp_path / "whole.c3d", walk(), labels=["A", "B", "C", "D", "E"])
    raw = (tmp_path / "whole.c3d").read_bytes()
    begin = 512 * (int.from_bytes(raw[16:18], "little") - 1)  # of 60 frames of 80 bytes
    (tmp_path / "cut.c3d").write_bytes(raw[: begin + 40 * 80 + 7])
    said = "cut off in frame 41: expected 60 frames, found 40 complete, 1593 bytes are missing"
    out, err = printed("info cut.c3d", capsys)
    assert said in out
    assert said not in err  # it is shown once
    assert said in json.loads(printed("info cut.c3d --json", capsys)[0])["truncated"]
    out, err = printed("track cut.c3d -o out.c3d --run runs/a", capsys)
    assert said in out
    assert f"cut.c3d: {said}" in err
    assert said in json.loads((tmp_path / "runs/a/summary.json").read_text())["truncated"]
    assert said in printed("info out.c3d", capsys)[0]
    _, err = printed("markerset learn cut.c3d -o a.toml", capsys)
    assert f"cut.c3d: {said}" in err
    (tmp_path / "none.c3d").write_bytes(raw[: begin + 79])
    assert "the first is complete" in refused("info none.c3d", capsys)


def test_info_says_what_can_be_said_of_points_without_names(tmp_path, capsys):
    points = walk(30, 4)
    write_c3d(tmp_path / "unlabelled.c3d", points, labels=["*0", "*1", "", "U_7"])
    out, _ = printed("info unlabelled.c3d", capsys)
    lines = {line[:17].strip(): line[17:].strip() for line in out.splitlines()}
    assert lines["unnamed"] == "4 channels in 4 tracklets"
    assert lines["step"].startswith("median ")
    assert lines["step to nearest"] == lines["step"]  # the points are far apart
    assert "another piece of a trajectory" in lines["difficulty"]
    assert "absent" not in lines
    assert "gaps" not in lines
    printed("corrupt unlabelled.c3d -o c.csv --truth t.csv", capsys)
    for name in ("c.csv", "c.log"):
        if name == "c.log":
            am.write(am.read("c.csv").tracks, name)
        out, _ = printed(f"info {name}", capsys)
        lines = {line[:17].strip(): line[17:].strip() for line in out.splitlines()}
        assert lines["unnamed"] == "120 of 120 points without a track"
        assert lines["points per frame"] == "4 to 4, 4 on average"
        assert "step" not in lines
        assert float(lines["step to nearest"].split()[1].rstrip(",")) > 0
        assert "inf" not in out
        assert "–" not in out
    (tmp_path / "one.csv").write_text("frame,time_s,x_m,y_m,z_m\n1,0,1,2,3\n2,0.01,1,2,3\n")
    out, _ = printed("info one.csv", capsys)
    assert "none: at most one point per frame" in out
    assert "–" not in out
    report = json.loads(printed("info one.csv --json", capsys)[0])
    assert (report["n_points"], report["nearest_step_99"], report["spacing_50"]) == (2, 0, None)
