"""The table of §4.3: the turning cube with false alarms and missing data, by N_mc."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

import asterism as am
from asterism.reproduction.drawing import draw_paths
from asterism.reproduction.part import Claim, Outcome, Part, Table, Timing
from asterism.reproduction.rules import within
from asterism.reproduction.scores import (
    FRAMES,
    PER,
    Scores,
    compare,
    cubes,
    own_chain,
    score_table,
)

if TYPE_CHECKING:
    from collections.abc import Callable


class _Reported(NamedTuple):
    """A block of the report's table, as printed."""

    wrong: float
    tracks: float
    missing: float
    minutes: float
    step: float


TABLE = {
    30: _Reported(36, 12, 10, 40.70, 1),
    80: _Reported(12, 9, 6, 102.30, 1),
    1000: _Reported(0.1, 8, 0.1, 364.75, 0.1),
}
REPORT, OWN = "the report's chain", "Asterism"
CHAINS: dict[str, Callable[..., am.MCMCDA]] = {REPORT: am.MCMCDA.report_2010, OWN: own_chain}
GAPS = (2, 4)


def run(seeds: int) -> Outcome:
    """Track every capture with both chains, by N_mc and d̄."""
    claims: list[Claim] = []
    tables: list[Table] = []
    timings: list[Timing] = []
    examples: dict[str, am.Tracks] = {}
    for max_gap in GAPS:
        methods = {
            f"{chain}, N_mc = {n}": make(moves=n / PER)
            for chain, make in CHAINS.items()
            for n in TABLE
        }
        found = compare(cubes(seeds, max_gap=max_gap), methods)
        tables.append(score_table(f"d̄ = {max_gap}", found))
        for chain in CHAINS:
            for n, reported in TABLE.items():
                scores = found[f"{chain}, N_mc = {n}"]
                about = f"{FRAMES} frames, N_mc = {n}, d̄ = {max_gap}, {chain}"
                minutes = f"{reported.minutes:.2f} minutes" if chain == REPORT else "–"
                timings.append(Timing(about, minutes, float(np.median(scores.seconds))))
                if chain == REPORT and (max_gap == GAPS[0] or n == max(TABLE)):
                    of = f"N_mc = {n}" + (f", d̄ = {max_gap} instead" * (max_gap != GAPS[0]))
                    claims += _claims(of, reported, scores, found["oracle"])
        if max_gap == GAPS[0]:
            examples["the true paths, broken at gaps beyond d̄"] = found["oracle"].example
            examples |= {f"N_mc = {n}": found[f"{REPORT}, N_mc = {n}"].example for n in TABLE}
    return Outcome(claims=claims, tables=tables, figure=draw_paths(examples), timings=timings)


def _claims(of: str, reported: _Reported, found: Scores, oracle: Scores) -> list[Claim]:
    step = reported.step
    return [
        within(f"wrong associations, {of}", reported.wrong, found.strict, step=step, sign="~",
               unit=" %", oracle=oracle.strict),
        within(f"generated tracks, {of}", reported.tracks, found.tracks, step=1, digits=1,
               oracle=oracle.tracks),
        within(f"missing labels, {of}", reported.missing, found.missing, step=step, sign="~",
               unit=" %", oracle=oracle.missing),
    ]  # fmt: skip


PART = Part(
    name="mcmcda",
    title="MCMCDA with 10 % false alarms and 10 % missing data",
    section="§4.3",
    covers="the table of §4.3 and the second figure 4.3",
    summary="A rotating and translating cube of 8 markers, 100 frames, 10 % false alarms and 10 % "
    "missing data, v̄ = 0.15 and d̄ = 2, tracked with 30, 80 and 1000 moves a frame.",
    run=run,
    caption="The report's second figure 4.3: the cube's true paths, and those found by the "
    "report's chain with more and more moves a frame (seed 0). Brown: tracks beyond the eighth, "
    "which the report counts as wrong. Grey dots are in no track.",
    notes=(
        "The oracle is the truth, broken at every gap longer than d̄. Two missed detections in a "
        "row occur in every capture; any tracker with d̄ = 2 begins a new track after them.",
        "With few moves the chain leaves detections without a label where the report's gave wrong "
        "labels.",
    ),
    mistakes=(
        "With d̄ = 2 neither 0.1 % wrong nor 8 tracks are possible: see the oracle.",
        "Two figures bear the number 4.3; the first one calls the second 4.4.",
        "The conclusions speak of at most 80 instants, the caption of 100 frames.",
    ),
    assumptions=(
        "Noise of 5 mm; the cube's side is 0.3 and its greatest speed 0.1 a frame, in the unit of "
        "v̄, which the report calls cm a frame and which is taken as metres here.",
        "Motion and rates are estimated from each capture.",
        "“Wrong” has the sense of the report's captions: all detections in a track beyond one for "
        "each marker are wrong too, however pure (100 · (1 − IDP)).",
    ),
)
