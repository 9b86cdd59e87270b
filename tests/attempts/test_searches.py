"""Which searches with shared accelerations are kept."""

from __future__ import annotations

import pytest

import asterism as am
from asterism.tracking.attempts import most_certain
from asterism.tracking.attempts.uncorrected import Uncorrected

WALK = am.simulate.person(frames=60, seed=1)
RECIPE = am.tracking.plan_tracking(WALK.detections).recipe


class Stated(Uncorrected):
    """Tracks with the numbers of right and wrong detections that they state."""

    @property
    def expected_right(self):
        return self.tracks.info["right"]

    @property
    def expected_wrong(self):
        return self.tracks.info["wrong"]


def stated(right, wrong):
    info = {"right": right, "wrong": wrong}
    tracks = am.Tracks(detections=WALK.detections, labels=WALK.labels, info=info)
    return Stated(tracks=tracks, recipe=RECIPE, model=RECIPE.model)


@pytest.mark.parametrize(
    ("found", "n_kept", "n_made"),
    [
        ([(110, 90)], 1, 2),
        ([(110, 109)], 1, 2),
        ([(110, 110)], 0, 1),  # as many more that are wrong
        ([(100, 90)], 0, 1),  # not more that are right
        ([(110, 90), (120, 80), (130, 70)], 2, 2),  # at most two
        ([(110, 1)], 1, 1),  # in doubt no more
    ],
)
def test_a_search_is_kept_if_more_are_right(found, n_kept, n_made, monkeypatch):
    rest, made = iter([*found, (0, 500)]), []

    def searched(before, progress):
        made.append((before, progress))
        return stated(*next(rest))

    monkeypatch.setattr(most_certain, "searched_again", searched)
    best = most_certain._after_searches(stated(100, 100), lambda: None)
    assert len(made) == n_made
    assert best.tracks.info.get("searches", 0) == n_kept
    assert best.expected_right == (found[n_kept - 1][0] if n_kept else 100)


def test_tracks_are_exchanged_after_all_searches(monkeypatch):
    steps = []
    for name in ("_after_searches", "changed_if_more_probable"):
        monkeypatch.setattr(
            most_certain, name, lambda found, *_, name=name: (steps.append(name), found)[1]
        )
    am.track(am.simulate.person(frames=40, seed=1).detections)
    assert steps == ["_after_searches", "changed_if_more_probable"]
