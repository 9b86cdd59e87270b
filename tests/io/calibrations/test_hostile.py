"""Calibrations that are damaged or mean harm: refused, and soon."""

from __future__ import annotations

import re
import time

import pytest

from asterism.camera import (
    BrownConrady,
    Camera,
    QuadraticCorrection,
    ReportRadial,
    ViconRadial,
)
from asterism.errors import FormatError
from asterism.io.calibrations import read_rig, write_rig
from tests.io.calibrations.rigs import LENSES, rig_for

BOMB = "<!DOCTYPE l [<!ENTITY a0 'ha'>" + "".join(
    f"<!ENTITY a{i} '{f'&a{i - 1};' * 10}'>" for i in range(1, 12)
)  # fmt: skip
HOSTILE = {
    "entities.xcp": f"{BOMB}]><Cameras>&a11;</Cameras>",
    "outside.xcp": "<!DOCTYPE l [<!ENTITY x SYSTEM 'file:///etc/passwd'>]><Cameras>&x;</Cameras>",
    "deep.xcp": "<Cameras>" * 200_000,
    "deep.qca.txt": "<calibration>" + "<a>" * 100_000 + "</a>" * 100_000 + "</calibration>",
    "attributes.qca.txt": "<calibration " + " ".join(f'a{i}="1"' for i in range(200_000)) + "/>",
    "deep.yml": "%YAML:1.0\n---\nK: " + "[" * 50_000,
    "deeper.yml": "%YAML:1.0\n---\n" + "".join(" " * i + f"a{i}:\n" for i in range(1500)),
    "laughs.yml": "a0: &a0 [x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)) + "K: *a8\n",
    "keys.yml": "? [a, b]\n: c\n",
    "python.yml": "K: !!python/object/apply:os.system ['true']\n",
    "deep.toml": "a = " + "[" * 100_000,
    "dotted.toml": ".".join(["a"] * 20_000) + " = 1\n",
    "digits.toml": "a = " + "9" * 10_000,
    "words.toml": "matrix = distortions",
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_files_are_refused_and_soon(tmp_path, name):
    path = tmp_path / name
    path.write_text(HOSTILE[name])
    start = time.process_time()
    with pytest.raises(FormatError):
        read_rig(path)
    assert time.process_time() - start < 5


def test_a_file_without_end_is_not_read(tmp_path):
    path = tmp_path / "a.yml"
    with path.open("wb") as file:
        file.truncate(3 << 30)
    with pytest.raises(FormatError, match="at most"):
        read_rig(path)


def test_lenses_are_all_tried():
    kinds = {BrownConrady, ReportRadial, ViconRadial, QuadraticCorrection}
    assert {type(lens) for lens in LENSES.values()} == kinds
    assert isinstance(rig_for("rig")[0], Camera)


def test_whole_numbers_that_no_float_can_hold(tmp_path):
    write_rig(rig_for("rig"), tmp_path / "a.toml")
    text = (tmp_path / "a.toml").read_text()
    for key in ("near", "far", "k1"):
        changed = re.sub(rf"(?m)^{key} = .*$", f"{key} = 1{'0' * 400}", text, count=1)
        assert changed != text
        (tmp_path / "b.toml").write_text(changed)
        with pytest.raises(FormatError, match=key):
            read_rig(tmp_path / "b.toml")
