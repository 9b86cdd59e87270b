"""Calibrations that are damaged or mean harm: refused, and soon."""

from __future__ import annotations

import contextlib
import re
import shutil
import time

import numpy as np
import pytest

from asterism.app.camera_check import check_rig
from asterism.app.camera_info import describe_rig
from asterism.camera import (
    BrownConrady,
    Camera,
    QuadraticCorrection,
    ReportRadial,
    ViconRadial,
)
from asterism.errors import AsterismError, FormatError
from asterism.io.calibration import read_rig, write_rig
from calibration_rigs import LENSES, NAMES, rig_for
from fuzz_readers import mutate

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
    start = time.perf_counter()
    with pytest.raises(FormatError):
        read_rig(path)
    assert time.perf_counter() - start < 5


def test_a_file_without_end_is_not_read(tmp_path):
    path = tmp_path / "a.yml"
    with path.open("wb") as file:
        file.truncate(3 << 30)
    with pytest.raises(FormatError, match="at most"):
        read_rig(path)


WORDS = [b"nan", b"inf", b"-inf", b"0", b"-1", b"1e999", b"1e300", b"-1e-300", b"", b"x", b"1e5",
         b"99999999999999999999", b"true", b"[]", b"'", b"1 2", b"0.5"]  # fmt: skip


def spoil(raw: bytes, rng: np.random.Generator) -> bytes:
    """Break a file: as bytes, as numbers, or as lines."""
    kind = rng.integers(3)
    numbers = list(re.finditer(rb"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?", raw))
    if kind == 0 or not numbers:
        return mutate(raw, rng)
    if kind == 1:
        for _ in range(int(rng.integers(1, 4))):
            match = numbers[int(rng.integers(len(numbers)))]
            word = WORDS[int(rng.integers(len(WORDS)))]
            raw = raw[: match.start()] + word + raw[match.end() :]
            numbers = list(re.finditer(rb"-?\d+(?:\.\d*)?(?:e[-+]?\d+)?", raw)) or [match]
        return raw
    lines = raw.splitlines(keepends=True)
    a, b = (int(i) for i in rng.integers(0, len(lines), 2))
    if rng.random() < 0.5:
        lines[a], lines[b] = lines[b], lines[a]
    else:
        del lines[a]
    return b"".join(lines)


@pytest.mark.parametrize("format", NAMES)
def test_damaged_files_are_read_or_refused(tmp_path, format):
    rig = rig_for(format)
    seed = tmp_path / NAMES[format]
    write_rig(rig, seed, format=format)
    outcomes = set()
    for i in range(200):
        rng = np.random.default_rng([11, i])
        broken = tmp_path / f"broken{i}-{NAMES[format]}"
        if seed.is_dir():
            shutil.copytree(seed, broken)
            files = sorted(broken.iterdir())
            victim = files[int(rng.integers(len(files)))]
        else:
            broken.write_bytes(seed.read_bytes())
            victim = broken
        victim.write_bytes(spoil(victim.read_bytes(), rng))
        try:
            again = read_rig(broken, format=format)
        except AsterismError:
            outcomes.add("refused")
            continue
        outcomes.add("read")
        for camera in again:  # what was read is sound
            assert np.isfinite(camera.T_camera_world).all()
            assert np.isfinite(camera.K).all()
        describe_rig(again)  # whatever it is, it can be looked at
        check_rig(again)
        with contextlib.suppress(AsterismError):
            write_rig(again, tmp_path / f"again{i}.toml")
            read_rig(tmp_path / f"again{i}.toml")
    assert outcomes == {"read", "refused"}


def test_lenses_are_all_tried():
    kinds = {BrownConrady, ReportRadial, ViconRadial, QuadraticCorrection}
    assert {type(lens) for lens in LENSES.values()} == kinds
    assert isinstance(rig_for("rig")[0], Camera)
