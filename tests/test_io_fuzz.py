"""Some hundred broken files of each kind; `fuzz_readers.py` does the same at length."""

from __future__ import annotations

import numpy as np
import pytest

from fuzz_readers import mutate, seeds, try_one

KINDS = ("seed_c3d", "seed_float", "seed_integer", "seed_sgi", "seed_dec", "seed_trc", "seed_csv",
         "seed_csv-wide", "seed_qtm", "seed_motive", "seed_pointcloud")  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("fuzz")
    seeds(path)
    return path


def test_the_seeds_themselves_are_read_and_written(folder, tmp_path):
    made = sorted(folder.glob("seed_*"))
    assert sorted(path.stem for path in made) == sorted(KINDS)
    for path in made:
        assert try_one(path, tmp_path) == "read"


@pytest.mark.parametrize("kind", KINDS)
def test_broken_files_are_read_or_refused(kind, folder, tmp_path):
    seed = next(path for path in folder.glob("seed_*") if path.stem == kind)
    raw = seed.read_bytes()
    outcomes = set()
    for i in range(120):
        path = tmp_path / f"input{seed.suffix}"
        path.write_bytes(mutate(raw, np.random.default_rng([7, i])))
        outcomes.add(try_one(path, tmp_path))
    # Both happen, or the mutations are too gentle or too rough to show anything.
    assert {"read", "refused"} <= outcomes
