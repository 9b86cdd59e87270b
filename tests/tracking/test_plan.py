"""What is checked before a tracking begins."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import asterism as am


@pytest.fixture
def never(monkeypatch):
    """No model is estimated."""
    monkeypatch.setattr("asterism.tracking.plan.estimate_model", lambda _: pytest.fail("too late"))


@pytest.mark.parametrize("method", [None, "mcmcda"])
def test_a_start_of_another_capture_is_refused_with_both_files(
    tmp_path, monkeypatch, never, method
):
    monkeypatch.chdir(tmp_path)
    for name, frames in (("a.c3d", 60), ("b.c3d", 50)):
        am.write(am.simulate.cube(frames=frames, seed=1), name)
    with pytest.raises(am.ParameterError) as refused:
        am.track(am.read("a.c3d"), method, start=am.read("b.c3d").tracks)
    assert str(refused.value) == (
        "start: expected tracks of the same detections: 60 frames with 480 detections in a.c3d, "
        "found 50 frames with 400 detections in b.c3d. Give tracks of the capture that is tracked, "
        "as from am.read(path).tracks."
    )


def test_a_start_with_other_numbers_in_its_frames_is_refused(never):
    truth = am.simulate.cube(frames=20, seed=1)
    d = truth.detections
    offsets = d.offsets.copy()
    offsets[5] -= 1  # a detection of frame 4 is in frame 5
    moved = am.Detections(times=d.times, offsets=offsets, points=d.points)
    with pytest.raises(
        am.ParameterError, match=r"160 detections, 8 in frame 4, found .*, 7\. Give"
    ):
        am.track(d, start=am.Tracks(detections=moved, labels=np.full(160, -1)))


def test_a_start_of_equal_detections_is_taken():
    truth = am.simulate.cube(frames=20, seed=1)
    d = truth.detections
    same = am.Detections(times=d.times.copy(), offsets=d.offsets.copy(), points=d.points.copy())
    plan = am.tracking.plan_tracking(d, "mcmcda", start=dataclasses.replace(truth, detections=same))
    assert plan.recipe.has_start
