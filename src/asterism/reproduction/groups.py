"""§4.2: separate chains for cells of space, or for clusters of close detections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import asterism as am
from asterism.reproduction.part import Outcome, Part
from asterism.reproduction.rules import fewer
from asterism.reproduction.scores import PER, compare, cubes, score_table

if TYPE_CHECKING:
    from collections.abc import Mapping

COUNT, MAX_GAP = 80, 2
GROUPS: Mapping[str, Mapping[str, Any]] = {
    "no groups": {},
    "cells of 0.5 m": {"groups": "cells", "distance": 0.5},
    "clusters within 0.25 m": {"groups": "clusters", "distance": 0.25},
}


def run(seeds: int) -> Outcome:
    """Track the cube as a whole and in groups."""
    methods = {
        name: am.MCMCDA.report_2010(moves=COUNT / PER, **groups) for name, groups in GROUPS.items()
    }
    found = compare(cubes(seeds, max_gap=MAX_GAP), methods)
    whole, cells, clusters = (found[name] for name in GROUPS)
    claims = [
        fewer("cells break tracks at their borders", "a remaining problem",
              whole.tracks, cells.tracks, "tracks", 1),
        fewer("clusters track more correctly than cells", "better than cells",
              100 - clusters.correct, 100 - cells.correct, "% not correct"),
        fewer("clusters track more correctly than no groups", "an improvement",
              100 - clusters.correct, 100 - whole.correct, "% not correct"),
    ]  # fmt: skip
    title = f"N_mc = {COUNT}, 10 % false alarms, 10 % missing, d̄ = {MAX_GAP}"
    return Outcome(claims=claims, tables=[score_table(title, found)])


PART = Part(
    name="groups",
    title="Groups: cells and clusters",
    section="§4.2",
    covers="“Volume or distance clusters splitting up”",
    summary="Proposes to divide space into cells, or the measurements into clusters by their "
    "distance, each with a chain of its own; calls the second more efficient, and the regrouping "
    "of what was divided the common problem.",
    run=run,
    notes=(
        "The report proposes both divisions and gives no figures. Each group has moves in "
        "proportion to its detections.",
    ),
    assumptions=("Cells of 0.5 m, shifted by half in every other frame; clusters within 0.25 m.",),
)
