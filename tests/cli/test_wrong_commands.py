"""Wrong commands: each is refused in one line that begins with the file or the option."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import asterism as am
from asterism.cli import main
from tests.scenes import small_model


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files that are right, and some that are not, for wrong commands."""
    folder = tmp_path_factory.mktemp("files")
    truth = am.simulate.cube(seed=1, frames=20)
    sensed = am.simulate.corrupt(truth, noise=1e-3, seed=1)
    unnamed = am.Tracks(detections=sensed.detections, labels=[-1] * sensed.detections.n_points)
    am.write(sensed, folder / "truth.csv")
    am.write(unnamed, folder / "in.csv")
    rig = am.Rig.ring(4, radius=5, height=2)
    am.io.write_rig(rig, folder / "rig.toml")
    am.io.write_observations(am.simulate.film(truth, rig).observations, folder / "seen.csv")
    am.learn_marker_set(truth).to_toml(folder / "set.toml")
    model = small_model().to_toml(folder / "model.toml")
    (folder / "misspelt.toml").write_text(model.replace("noise_sigma", "noise_sgima"))
    (folder / "bad.toml").write_text("a = [\n")
    (folder / "bad.csv").write_text("frame,x\n1,q,3\n")
    (folder / "folder").mkdir()
    return folder


# A wrong command, how its one line begins, and what it says at last.
TABLE = Path(__file__).with_name("wrong_commands.txt").read_text(encoding="utf-8")
WRONG = [[cell.strip() for cell in f"{row} |".split(" |")[:3]] for row in TABLE.splitlines()]


@pytest.mark.parametrize(("line", "begins", "ends"), WRONG, ids=[line for line, *_ in WRONG])
def test_a_wrong_command_is_told_in_one_line(
    files, tmp_path, monkeypatch, capsys, line, begins, ends
):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    assert main(line.split()) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(f"asterism: {begins}")
    assert ends in err
    assert err.count("\n") == 1
    assert ".part" not in err
    assert sorted(tmp_path.rglob("*")) == before
