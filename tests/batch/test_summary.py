"""Figures of a finished tracking."""

from __future__ import annotations

import json
import re

import numpy as np
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


def test_the_longest_gaps_have_names_and_agreeing_lengths(tmp_path, capsys):
    truth = am.simulate.cube(frames=60, seed=1)
    d = truth.detections
    positions = truth.positions()
    positions[20:23, 3] = np.nan
    source, markers = tmp_path / "cube.csv", tmp_path / "cube.toml"
    am.write(am.Tracks.from_dense(d.times, positions), source)
    am.learn_marker_set(truth).to_toml(markers)
    rows = {}
    for sets in ([], ["--markers", str(markers)]):
        line = ["track", str(source), "-o", str(tmp_path / "out.csv"), "--overwrite", *sets]
        assert main(line) == 0
        printed = capsys.readouterr().out
        rows[bool(sets)] = re.search(r"longest gaps +(.*)", printed)[1]
        assert main([*line, "--json"]) == 0
        gap = json.loads(capsys.readouterr().out)["longest_gaps"][0]
        period = d.times[1] - d.times[0]
        figures = f"frames {gap['first']} to {gap['last']} (3 frames, {4 * period:.3g} s between"
        assert gap["last"] - gap["first"] == 2
        assert (gap["name"] is None) is not bool(sets)
        number = f"track {gap['track']}"
        assert rows[bool(sets)] == f"{gap['name'] or number}, {figures} detections)"
    assert gap["name"] in am.io.read_tracks(tmp_path / "out.csv").names
