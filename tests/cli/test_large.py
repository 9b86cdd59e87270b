"""``asterism large``."""

from __future__ import annotations

import json

import pytest

import asterism as am
from asterism.cli import main
from tests.large.scenes import MODEL, dense, rows_of, write_csv


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_csv(tmp_path / "in.csv", rows_of(dense(n=60, frames=14).detections))
    MODEL.to_toml(tmp_path / "model.toml")
    return tmp_path


def test_a_table_is_tracked(here, capsys):
    line = "large in.csv -o out.csv --model model.toml"
    assert main([*line.split(), "--json"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    figures = json.loads(out)
    assert figures["n_frames"] == 14
    assert am.TrackingModel.from_dict(figures["model"]) == MODEL
    first = (here / "out.csv").read_bytes()
    again = f"{line} --overwrite --tile 0.3 --threads 2"
    assert main(again.split()) == 0
    out, err = capsys.readouterr()
    assert "in tracks" in out
    assert (here / "out.csv").read_bytes() == first
    assert main(f"{line} --overwrite -q".split()) == 0
    assert capsys.readouterr().out == ""


def test_the_model_is_estimated(here, capsys):
    line = "large in.csv -o out.csv --label id --rate 100 --unit mm -q"
    assert main(line.split()) == 0
    assert (here / "out.csv").read_text().startswith("frame,x,y,z,id\n")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("large nowhere.csv -o out.csv", "nowhere.csv: no such file"),
        ("large in.csv -o out.parquet", "--out: expected a name ending in .csv, .tsv, .txt"),
        ("large in.c3d -o out.c3d", "expected a name ending in .parquet"),
        ("large in.csv -o out.csv --tile 0", "--tile: expected a number > 0"),
        ("large in.csv -o out.csv --threads 0", "--threads: expected a whole number in [1, 1024]"),
        ("large in.csv -o out.csv --unit parsec", "--unit: expected one of mm, cm, m"),
        ("large in.csv -o out.csv --axes x", "--axes: expected two or three columns"),
        ("large in.csv -o out.csv --time when", "in.csv: columns: expected one named when"),
        ("large in.csv -o out.csv --look-ahead 9", "--look-ahead: expected"),
        ("large in.csv -o out.csv --label x", "expected no column x yet"),
    ],
)
def test_mistakes_are_one_line(here, capsys, line, says):
    assert main([*line.split(), *([] if "nowhere" in line else ["--model", "model.toml"])]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert says in err
    assert not (here / "out.csv").exists()
