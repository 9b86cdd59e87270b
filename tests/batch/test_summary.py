"""Figures of a finished tracking: the shared acceleration, where the method has bonds."""

from __future__ import annotations

import json

import pytest

import asterism as am
from asterism.cli import main


def test_the_shared_acceleration_is_stated_where_the_method_has_bonds(tmp_path, capsys):
    truth = am.simulate.corrupt(am.simulate.person(frames=200, seed=1), missing=0.05, seed=1)
    source = tmp_path / "person.csv"
    am.write(truth, source)
    found = {}
    for rigid in ("yes", "no"):
        out = str(tmp_path / f"{rigid}.csv")
        options = ["--method", "gnn", "--option", f"rigid={rigid}", "-o", out]
        assert main(["track", str(source), *options, "--json"]) == 0
        found[rigid] = json.loads(capsys.readouterr().out)["shared"]
    assert found["no"] is None
    of_truth = am.tracking.learn_bonds(truth)
    pairs = of_truth.pairs[of_truth.rigid]
    size, std = am.tracking.shared_size(truth, *pairs.T)
    assert found["yes"]["size"] == pytest.approx(size, abs=5 * std)
    assert main(["track", str(source), *options[:3], "rigid=yes", "-o", out, "--overwrite"]) == 0
    row = f"shared acceleration  {found['yes']['size']:.3g} ± "
    assert row in capsys.readouterr().out
