"""Flags of filled points in files, and the command line."""

from __future__ import annotations

import dataclasses
import json

import ezc3d
import numpy as np
import pytest

import asterism as am
from asterism.io.captures.c3d_layout import read_c3d
from asterism.simulate import Burst
from tests.cli.runs import refused, run
from tests.filling.fills import MODEL, occluded_at, rigid


def test_flags_are_checked():
    d = rigid(2, 3).detections
    n = d.n_points
    for wrong in ({"filled": [True]}, {"stds": np.full(n, -1.0)}, {"stds": np.full(n, np.nan)}):
        with pytest.raises(am.ParameterError, match=next(iter(wrong))):
            dataclasses.replace(d, **wrong)
    assert d.measured() is d


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a file that has gaps, and what filling it gives."""
    folder = tmp_path_factory.mktemp("made")
    truth = am.simulate.corrupt(am.simulate.person(seed=8), burst=Burst(), noise=3e-4, seed=8)
    am.write(truth, folder / "in.c3d")
    MODEL.to_toml(folder / "model.toml")
    return folder, am.fill_gaps(am.io.read_tracks(folder / "in.c3d"), model=MODEL)


@pytest.mark.parametrize("form", ["c3d", "csv"])
def test_files_give_back_the_flags(made, form, tmp_path):
    tracks = made[1].tracks
    am.write(tracks, tmp_path / f"a.{form}")
    again = am.io.read_tracks(tmp_path / f"a.{form}")
    before, after = (
        set(zip(d.frame_of[d.filled], one.labels[d.filled], strict=True))
        for one, d in ((tracks, tracks.detections), (again, again.detections))
    )
    assert before == after
    assert again.detections.filled.sum() == tracks.detections.filled.sum() > 0
    np.testing.assert_allclose(again.positions(), tracks.positions(), rtol=1e-6)
    am.write(again, tmp_path / f"b.{form}")
    assert (tmp_path / f"a.{form}").read_bytes() == (tmp_path / f"b.{form}").read_bytes()
    if form == "csv":
        np.testing.assert_array_equal(again.detections.stds, tracks.detections.stds)
    # What is not filled any more is not said to be.
    am.write(again.measured(), tmp_path / f"c.{form}")
    assert am.read(tmp_path / f"c.{form}").filled is None


@pytest.mark.parametrize("known", [False, True])
def test_c3d_has_residual_0_for_filled_points_alone(tmp_path, known):
    tracks = occluded_at(rigid(), (2, 100, 110))
    if known:
        residuals = np.linspace(0, 2e-3, tracks.detections.n_points)
        cameras = np.full(tracks.detections.n_points, 5)
        tracks = dataclasses.replace(
            tracks,
            detections=dataclasses.replace(tracks.detections, residuals=residuals, cameras=cameras),
        )
    filled = am.fill_gaps(tracks, model=MODEL).tracks
    am.write(filled, tmp_path / "a.c3d")
    words = read_c3d(tmp_path / "a.c3d").points[..., 3]
    assert (words[100:111, 2] == 0).all()
    words = np.delete(words, np.s_[100:111], axis=0)
    assert (words % 256 > 0).all()
    if known:  # without cameras ezc3d gives no residual but 0
        theirs = ezc3d.c3d(str(tmp_path / "a.c3d"))["data"]["meta_points"]["residuals"][0].T
        assert (theirs[100:111, 2] == 0).all()
        assert (np.delete(theirs, np.s_[100:111], axis=0) > 0).all()
    again = am.read(tmp_path / "a.c3d")
    assert (again.residuals is not None) == known
    if known:
        np.testing.assert_allclose(
            again.residuals[~again.filled], np.maximum(residuals, 1e-5), atol=6e-6
        )


def test_c3d_of_others_is_read_as_ever(tmp_path):
    """Residuals of 0 beside others tell nothing where the file does not say that they do."""
    tracks = rigid()
    residuals = np.where(np.arange(tracks.detections.n_points) % 3, 1e-3, 0.0)
    d = dataclasses.replace(tracks.detections, residuals=residuals)
    am.write(dataclasses.replace(tracks, detections=d), tmp_path / "a.c3d")
    assert am.read(tmp_path / "a.c3d").filled is None


@pytest.mark.parametrize("form", ["trc", "csv-wide", "qtm", "pointcloud"])
def test_formats_without_room_refuse(made, form, tmp_path):
    tracks = made[1].tracks
    with pytest.raises(am.ParameterError, match="c3d, csv"):
        am.write(tracks, tmp_path / "a", format=form)
    assert not (tmp_path / "a").exists()
    am.write(tracks, tmp_path / "a", format=form, unflagged=True)
    again = am.read(tmp_path / "a", format=form)
    assert again.n_points == tracks.detections.n_points
    am.write(tracks.measured(), tmp_path / "b", format=form)


@pytest.mark.parametrize("cell", ["2", "x", "", "0.5"])
def test_a_flag_is_0_or_1(tmp_path, cell):
    path = tmp_path / "a.csv"
    path.write_text(f"frame,time_s,x_m,y_m,track,filled,std\n1,0,1,1,0,{cell},0\n")
    with pytest.raises(am.FormatError, match="filled"):
        am.read(path)


def test_the_command_fills_and_says_what(made, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(made[0])
    out = tmp_path / "out.csv"
    text = run(f"fill in.c3d -o {out} --model model.toml", capsys)
    for word in ("gaps", "filled", "main estimator", "least certain", "mm", "written"):
        assert word in text
    d, expected = am.read(out), made[1]
    assert d.filled.sum() == expected.tracks.detections.filled.sum()
    given = json.loads(run(f"fill in.c3d -o {out} --model model.toml --json --overwrite", capsys))
    assert given["n_gaps"] == len(expected.gaps) == len(given["gaps"])
    assert given["largest_std"] == pytest.approx(max(gap.std for gap in expected.gaps))
    assert sum(given["estimators"].values()) == given["n_filled"]
    assert given["gaps"][0]["first"] == expected.gaps[0].first + 1
    assert (
        run(f"fill in.c3d -o {out} --model model.toml -q --longest 0.1 --overwrite", capsys) == ""
    )
    assert am.read(out).filled.sum() < d.filled.sum()


def test_the_command_refuses_in_one_line(made, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(made[0])
    before = sorted(path.name for path in made[0].iterdir())
    for line, says in (
        ("fill nowhere.c3d -o a.c3d", "nowhere.c3d: no such file"),
        ("fill in.c3d -o in.c3d", "a path of its own"),
        ("fill in.c3d -o a.trc", "--unflagged"),
        ("fill in.c3d -o a.xyz", "a name ending in"),
        ("fill in.c3d -o a.c3d --longest 0", "--longest"),
        ("fill in.c3d -o a.c3d --model in.c3d", "in.c3d"),
        ("fill in.c3d -o nowhere/a.c3d", "a folder that exists"),
    ):
        error = refused(line, capsys)
        assert says in error, line
        assert error.count("\n") == 1
    assert sorted(path.name for path in made[0].iterdir()) == before


def test_the_command_on_points_without_tracks(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    d = rigid().detections
    am.write(am.Tracks(detections=d, labels=np.full(d.n_points, -1)), "a.csv")
    assert "asterism track" in refused("fill a.csv -o b.csv", capsys)
