"""Fixtures of the tests of the command line."""

from __future__ import annotations

import shutil

import pytest

from asterism.cli import main


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A folder with a labelled scene, an experiment made of it, its truth, and its model."""
    folder = tmp_path_factory.mktemp("made")
    scene, corrupted, truth = (str(folder / f"{name}.csv") for name in ("scene", "in", "truth"))
    options = "--missing 0.1 --clutter 0.1 --noise 0.0003 --seed 1 -q"
    assert main(["simulate", "crossing", "-o", scene, "--rate=100", "--seed=3", "-q"]) == 0
    assert main(["corrupt", scene, "-o", corrupted, "--truth", truth, *options.split()]) == 0
    assert main(["estimate", corrupted, "-o", str(folder / "model.toml"), "-q"]) == 0
    return folder


@pytest.fixture
def scene(made, tmp_path, monkeypatch):
    """A copy of that folder, to work in."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path
