"""The benchmark beside peers: how it searches, what it keeps, and what its tables say."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from dataclasses import replace

import numpy as np
import pytest

import asterism as am
from tests.paths import ROOT

sys.path.append(str(ROOT / "benchmarks"))

from field_cache import Cache
from field_clips import Clip, Kind
from field_growth import growth, growth_table
from field_rows import NOT_RUN, ORACLES, OURS, Score, of_peer, rows_of
from field_search import tuned, unloadable
from field_verdict import fewer, verdict
from peers import PEERS, Peer

OPTIONS = Namespace(trials=6, budget=20.0, limit=1.0, frames=30, tuning_frames=30)


def clip(seed):
    return am.simulate.corrupt(am.simulate.cube(seed=seed, frames=30), clutter=0.1, seed=seed)


def broken_by(d, setting):
    """Labels of the truth of seeds 1 and 2, torn apart where the setting is far from 20."""
    (truth,) = (t for t in map(clip, (1, 2)) if len(t.labels) == d.n_points)
    torn = abs(np.log(setting["at"] / 20)) * (1 + len(truth.labels) % 2)
    piece = (d.frame_of * torn / 10).astype(np.int64)
    return np.where(truth.labels >= 0, truth.labels + 10 * piece, -1)


FAST = Peer(name="fast", package="", space={"at": (0.1, 100.0)}, label=broken_by)


def test_the_search_finds_what_trying_all_in_full_finds():
    truths = [clip(1), clip(2)]
    found = tuned(FAST, None, truths, 30, 60.0)
    rng = np.random.default_rng(0)
    settings = [FAST.middle(), *(FAST.draw(rng) for _ in range(29))]

    def value(setting):
        labels = [broken_by(t.detections, setting) for t in truths]
        results = [
            am.Tracks(detections=t.detections, labels=x)
            for t, x in zip(truths, labels, strict=True)
        ]
        return np.mean([am.evaluate(r, t).idf1 for r, t in zip(results, truths, strict=True)])

    best = max(settings, key=value)
    assert found["setting"] == best != FAST.middle()
    assert found["idf1"] == pytest.approx(value(best))
    assert (found["trials"], found["error"]) == (30, "")


def test_the_search_begins_with_what_was_found_for_another():
    found = tuned(FAST, {"at": 20.0}, [clip(1)], 6, 60.0)
    assert found["setting"] == {"at": 20.0}  # no draw is better
    assert found["idf1"] == 1.0


def test_a_slow_peer_has_fewer_trials_and_none_without_a_result_counts():
    def slow(d, setting):
        stop = time.process_time() + 0.4
        while time.process_time() < stop:
            pass
        return broken_by(d, setting)

    found = tuned(replace(FAST, label=slow), None, [clip(1), clip(2)], 50, 1.0)
    assert 1 <= found["trials"] <= 4
    assert found["idf1"] > 0

    def never(d, setting):
        raise RuntimeError("no")

    found = tuned(replace(FAST, label=never), {"at": 7.0}, [clip(1)], 3, 5.0)
    assert found["setting"] == {"at": 7.0}
    assert found["error"] == "RuntimeError: no"


def kind(*seeds):
    clips = [Clip(name=f"cube, {seed}", make=lambda s=seed: clip(s)) for seed in seeds]
    return Kind(name="cube", tuned_as="cube", scored=tuple(clips), tuning=tuple(clips[:1]))


def test_rows_are_kept_and_missing_ones_are_listed(tmp_path):
    cache = Cache(tmp_path / "kept" / "field.jsonl", is_closed=False)
    first = of_peer(kind(1), FAST, OPTIONS, cache)
    closed = Cache(tmp_path / "kept" / "field.jsonl", is_closed=True)
    again = of_peer(kind(1, 2), FAST, OPTIONS, closed)
    assert again[0] == first[0]
    assert again[1].error == NOT_RUN


def test_a_tracker_late_on_a_capture_is_run_on_smaller_ones_only(tmp_path):
    def late(d, setting):
        while d.n_points > 250:
            pass
        return np.full(d.n_points, -1)

    def of(name, n):
        return Clip(name=name, make=lambda: am.simulate.smooth(n_markers=n, frames=30, seed=1))

    clips = (of("small", 8), of("large", 9), of("larger", 12), of("small too", 7))
    peer = replace(FAST, label=late, space={"at": (1.0, 1.0)})
    several = Kind(name="cubes", tuned_as="cubes", scored=clips, tuning=clips[:1])
    start = time.process_time()
    rows = of_peer(several, peer, OPTIONS, Cache(tmp_path / "field.jsonl", is_closed=False))
    assert [bool(r.error) for r in rows] == [False, True, True, False]
    assert rows[2].error == "more than 1 s"
    assert rows[2].points == 360
    assert time.process_time() - start < 10


def test_oracles_and_ours_have_rows(tmp_path):
    cache = Cache(tmp_path / "field.jsonl", is_closed=False)
    for name in (*ORACLES, "gnn"):
        (row,) = rows_of(kind(1), name, OPTIONS, cache)
        assert row.idf1 > 0.99
        assert row.points == clip(1).detections.n_points
    assert np.isnan(rows_of(kind(1), next(iter(ORACLES)), OPTIONS, cache)[0].ms)


def test_a_peer_that_ends_its_process_is_not_loaded():
    def ends(d, setting):
        import os
        import signal

        os.kill(os.getpid(), signal.SIGTERM)

    assert unloadable(replace(FAST, label=ends)) == "does not load: ended by -15"
    assert unloadable(PEERS["Kalman + assignment"]) == ""


def row(idf1, switches, ms, error=""):
    return Score(
        clip="c",
        idf1=idf1,
        switches=switches,
        ms=ms,
        megabytes=8.0,
        error=error,
        frames=20,
        points=9,
    )


def table_of(peers, ours):
    found = {("dense 50", name): [row(1.0, 0.0, np.nan)] for name in ORACLES}
    found |= {("dense 50", name): [row(0, 0, 1, NOT_RUN)] for name in PEERS}
    found |= {("dense 50", name): [row(0.9, 9.0, 3.0)] for name in OURS}
    found |= {("dense 50", name): [value] for name, value in {**peers, **ours}.items()}
    return found


@pytest.mark.parametrize(
    ("peer", "ours", "word", "saved", "fastest"),
    [
        (row(0.95, 6.0, 9), row(0.99, 0.5, 2), "auto", "12.0 ×", "auto 2.00 ms"),
        (row(0.99, 1.0, 9), row(0.95, 2.0, 2), "motpy", "0.5 ×", "motpy 9.00 ms"),
        (row(0.990, 0.0, 1), row(0.991, 0.0, 2), "equal", "none to save", "motpy 1.00 ms"),
    ],
)
def test_the_verdict_names_the_tracker_ahead(peer, ours, word, saved, fastest):
    line = verdict(["dense 50"], table_of({"motpy": peer}, {"auto": ours}))[-1].split(" | ")
    assert line[1].startswith("motpy")
    assert (line[4], line[8], line[9].removesuffix(" |")) == (word, saved, fastest)


@pytest.mark.parametrize("gone", ["motpy", "auto", list(ORACLES)[-1]])
def test_a_part_of_the_trackers_has_no_verdict_and_no_error(gone):
    found = table_of({"motpy": row(0.9, 1.0, 1)}, {})
    found = {key: rows for key, rows in found.items() if key[1] != gone}
    assert len(verdict(["dense 50"], found)) == 2  # the head


def test_switches_that_the_oracle_has_do_not_count():
    assert fewer(3.0, 2.1, 2.0) == "10.0 ×"
    assert fewer(2.0, 2.1, 2.0) == "none to save"
    assert fewer(3.0, 1.9, 2.0) == "all of them"


def test_growth_says_what_a_frame_took_at_least_where_time_ran_out():
    found = table_of({"motpy": row(0, 0, np.nan, "more than 25 s")}, {})
    lines = growth_table(["dense 50"], found)
    assert any(line.startswith("| motpy | > 1,250 | – |") for line in lines)
    assert any(line.startswith("| norfair | not run | – |") for line in lines)
    texts = [text.get_text() for text in growth(found).axes[0].texts]
    assert "auto" in texts
    assert "motpy" not in texts  # it has no point to draw
