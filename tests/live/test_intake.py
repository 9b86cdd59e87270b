"""Which frames of a source are tracked, and at what time."""

from __future__ import annotations

import dataclasses
import itertools
import logging
import math

import numpy as np
import pytest

from asterism.live.clock import SourceClock
from asterism.live.faults import Faults
from asterism.live.frame import SourceFrame
from asterism.live.intake import Intake

PERIOD = 0.01


def frame(number, *, time=None, received=None, points=None):
    time = number * PERIOD if time is None else time
    received = 50 + number * PERIOD if received is None else received
    points = np.zeros((2, 3)) if points is None else points
    return SourceFrame(number=number, time=time, points=points, received=received)


def taken(frames, **options):
    """Numbers, times and missing frames of the accepted frames, and the counts of faults."""
    faults = Faults("test")
    intake = Intake(faults, SourceClock(), **options)
    accepted = [a for f in frames if (a := intake.take(f)) is not None]
    assert all(a.frame.time < b.frame.time for a, b in itertools.pairwise(accepted))
    return (
        [a.frame.number for a in accepted], [a.frame.time for a in accepted],
        [a.n_missing for a in accepted], faults.counts,
    )  # fmt: skip


CASES = {
    "in order": (range(6), [0, 1, 2, 3, 4, 5], {}),
    "a lost frame": ([0, 1, 3, 4], [0, 1, 3, 4], {"lost": 1}),
    "a burst of losses": ([0, 1, 30, 31], [0, 1, 30, 31], {"lost": 28}),
    "a repeated frame": ([0, 1, 1, 2], [0, 1, 2], {"repeated": 1}),
    "reordered frames": ([0, 3, 1, 2, 4], [0, 3, 4], {"lost": 2, "reordered": 2}),
    "a frame far behind": ([*range(200, 205), 3, 205], [*range(200, 206)], {"reordered": 1}),
}


@pytest.mark.parametrize(("given", "kept", "counts"), CASES.values(), ids=CASES)
def test_frames_in_order_are_kept(given, kept, counts):
    numbers, _, _, found = taken([frame(n) for n in given])
    assert numbers == kept
    assert found == counts


def test_missing_frames_are_told_by_the_time():
    assert taken([frame(n) for n in (0, 1, 2, 9)])[2] == [0, 0, 0, 6]


def test_a_pause_of_the_source_counts_as_missing_frames():
    before = [frame(n) for n in range(10)]
    after = [frame(n, time=n * PERIOD + 5, received=55 + n * PERIOD) for n in range(10, 15)]
    _, times, missing, counts = taken([*before, *after])
    assert missing == [0] * 10 + [500] + [0] * 4
    assert counts == {}
    assert times[10] == pytest.approx(5.1)


@pytest.mark.parametrize("first", [500, 60])
def test_a_restart_continues_the_time_by_the_arrivals(first):
    before = [frame(n) for n in range(first)]
    gone = 50 + first * PERIOD + 0.5
    after = [frame(n, received=gone + n * PERIOD) for n in range(30)]
    numbers, times, missing, counts = taken([*before, *after])
    assert counts["restarts"] == 1
    n_held = counts["reordered"]
    assert n_held == (1 if first > 100 else 11)
    assert numbers[first] == n_held
    assert times[first] - times[first - 1] == pytest.approx(0.5 + (1 + n_held) * PERIOD)
    assert missing[first] == 50 + n_held


def test_time_stamps_that_do_not_advance_are_replaced_by_the_frame_rate():
    given = [frame(n) for n in range(5)]
    given += [frame(5, time=0.04), frame(6, time=math.nan), frame(7, time=0.0401), frame(8)]
    numbers, times, _, counts = taken(given)
    assert numbers == list(range(9))
    assert counts["bad_times"] >= 2
    np.testing.assert_allclose(times, np.arange(9) * PERIOD, atol=0.6 * PERIOD)


def test_a_clock_that_is_set_is_followed_by_the_arrivals():
    given = [frame(n) for n in range(5)]
    given += [frame(n, time=n * PERIOD + 3600) for n in range(5, 10)]
    given += [frame(n, time=n * PERIOD - 3600) for n in range(10, 15)]
    _, times, _, counts = taken(given)
    assert counts == {"clock_jumps": 2}
    np.testing.assert_allclose(times, np.arange(15) * PERIOD, atol=1e-9)


def test_a_stall_of_the_network_is_no_jump_of_the_clock():
    given = [frame(n) for n in range(5)]
    given += [frame(n, received=60 + 1e-4 * n) for n in range(5, 500)]
    _, times, missing, counts = taken(given)
    assert counts == {}
    assert max(missing) == 0
    np.testing.assert_allclose(times, np.arange(500) * PERIOD)


def test_points_that_are_not_finite_are_left_out():
    points = np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 0], [1e30, 0, 0], [1, 1, 1]])
    faults = Faults("test")
    noise = np.arange(5)[:, None, None] * np.eye(3)
    given = dataclasses.replace(frame(0, points=points), covariances=noise)
    accepted = Intake(faults, SourceClock()).take(given)
    assert accepted.frame.points.tolist() == [[0, 0, 0], [1, 1, 1]]
    assert accepted.frame.covariances[:, 0, 0].tolist() == [0, 4]
    assert faults.counts == {"bad_points": 2}  # NaN is a marker that is not seen


def test_a_frame_with_too_many_points_is_dropped():
    numbers, _, _, counts = taken([frame(0), frame(1, points=np.zeros((5000, 3))), frame(2)])
    assert numbers == [0, 2]
    assert counts == {"crowded": 1, "lost": 1}


def test_each_reason_is_logged_once(caplog):
    with caplog.at_level(logging.WARNING, logger="asterism"):
        taken([frame(n) for n in (0, 2, 4, 4, 6, 5, 8, 8)])
    assert len(caplog.records) == 3
    assert all(r.message.startswith("test: ") for r in caplog.records)


def test_a_file_has_no_arrivals_that_tell_the_time():
    given = [frame(n, received=50.0) for n in range(5)]
    given += [frame(n, time=n * PERIOD + 5, received=50.0) for n in range(5, 8)]
    _, times, _, counts = taken(given, in_real_time=False)
    assert counts == {}
    assert times[5] == pytest.approx(5.05)


def test_frames_that_are_dropped_from_a_burst_are_no_jump_of_the_clock():
    # The numbers of the frames state how much time has passed, not their arrivals.
    given = [frame(n) for n in range(5)]
    given += [frame(n, received=60 + 1e-4 * n) for n in (5, 6, 400, 401)]
    _, times, missing, counts = taken(given)
    assert counts == {"lost": 393}
    assert missing[-2:] == [393, 0]
    np.testing.assert_allclose(times, [*np.arange(7) * PERIOD, 4.0, 4.01])


def test_frames_that_are_dropped_here_are_not_lost():
    faults = Faults("test")
    intake = Intake(faults, SourceClock())
    intake.take(frame(0))
    intake.dropped(4)  # frames 2 to 5: the queue drops them while frame 1 is taken
    for n in (1, 6, 8):
        assert intake.take(frame(n)) is not None
    assert faults.counts == {"lost": 1}
