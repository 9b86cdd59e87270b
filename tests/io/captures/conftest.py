"""Fixtures of the tests of captures."""

from __future__ import annotations

import pytest

from asterism.io import read
from tests.io.c3d_bytes import make_c3d


@pytest.fixture
def load(tmp_path):
    def _load(*args, **options):
        path = tmp_path / "trial.c3d"
        path.write_bytes(make_c3d(*args, **options))
        return read(path)

    return _load
