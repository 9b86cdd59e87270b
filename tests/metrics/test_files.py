"""Real captures, corrupted, written, read back and evaluated against what they were."""

from __future__ import annotations

import pytest

from asterism.io import read, write
from asterism.metrics import evaluate, oracle_tracks
from asterism.simulate import Burst, Ghosts, corrupt
from tests.paths import DATA

CAPTURES = [
    "RealTimeBiomechanics__rtosim/data/ViconNexus/walking_1.c3d",
    "kineticstoolkit__kineticstoolkit/data/kinematics_racing_full.c3d",
    "pyomeca__pyorerun/examples/c3d/Running_0002.c3d",  # its first frame is not the first
]


@pytest.mark.data
@pytest.mark.parametrize("name", CAPTURES)
@pytest.mark.parametrize("kind", ["c3d", "trc", "csv"])
@pytest.mark.parametrize("stride", [1, 2])
def test_truth_survives_its_file(name, kind, stride, tmp_path):
    path = DATA / name
    if not path.is_file():
        pytest.skip(f"no {path}")
    truth = corrupt(
        read(path).tracks, missing=0.1, clutter=0.1, noise=3e-4, burst=Burst(), ghosts=Ghosts(),
        stride=stride, seed=1,
    )  # fmt: skip
    write(truth, tmp_path / f"truth.{kind}")
    back = read(tmp_path / f"truth.{kind}").tracks
    assert evaluate(truth, back).idf1 == 1  # clutter came back as tracks without a name, or none
    result = oracle_tracks(truth, 4)
    found = evaluate(result, back)
    assert found.to_dict() == evaluate(result, truth).to_dict()
    assert 0.1 < found.idf1 < 1
    assert found.switches > 0
