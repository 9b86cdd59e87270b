"""§4.2: walking over cells of space, or over clusters of what is near, apart."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import asterism as am
from asterism.plot import plot_groups
from asterism.plot.style import INK
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.rules import differs, spread
from asterism.reproduction.walks import HEAD, Scores, clips, our_chain, row, walked

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from asterism.reproduction.part import Effort, Tell
    from asterism.reproduction.walks import Clip

COUNT, PER, MAX_GAP = 80, 8.8, 2
SPLITS: dict[str, dict[str, Any]] = {
    "off: everything at once": {"groups": "whole"},
    "cells of 0.5 m": {"groups": "cells", "distance": 0.5},
    "clusters within 0.25 m": {"groups": "clusters", "distance": 0.25},
    "what plausible links join": {"groups": "likelihood"},
}
OFF, CELLS, CLUSTERS, LINKS = SPLITS
CHAINS: dict[str, Callable[..., am.MCMCDA]] = {
    "the report's chain": am.MCMCDA.report_2010,
    "Asterism": our_chain,
}


def run(effort: Effort, tell: Tell) -> Outcome:
    """Walk over the cube whole and in pieces."""
    some = clips(effort.seeds, max_gap=MAX_GAP)
    found: dict[tuple[str, str], Scores] = {}
    rows = [row("floor", walked(some, None))]
    for chain, made in CHAINS.items():
        for split, groups in SPLITS.items():
            method = made(moves=COUNT / PER, **groups)
            found[chain, split] = walked(some, method)
            rows.append(row(f"{chain}, {split}", found[chain, split]))
            tell(len(found) / (len(CHAINS) * len(SPLITS)))
    theirs = {split: found["the report's chain", split] for split in SPLITS}
    ours = found["Asterism", LINKS]
    claims = [
        Claim(
            "to regroup what cells divide remains a problem", "tracks break at borders",
            f"{spread(theirs[CELLS].tracks, 1)} tracks, {spread(theirs[OFF].tracks, 1)} without",
            differs(theirs[OFF].tracks, theirs[CELLS].tracks, "tracks without cells", 1),
        ),
        Claim(
            "clusters are the more efficient approach", "better than cells",
            f"{spread(theirs[CLUSTERS].correct)} % correct, in cells "
            f"{spread(theirs[CELLS].correct)} %",
            differs(-theirs[CLUSTERS].correct, -theirs[CELLS].correct,
                    "points of correct labels lost"),
        ),
        Claim(
            "clusters do better than no split", "an improvement",
            f"{spread(theirs[CLUSTERS].correct)} % correct, without "
            f"{spread(theirs[OFF].correct)} %",
            differs(-theirs[CLUSTERS].correct, -theirs[OFF].correct,
                    "points of correct labels lost"),
        ),
    ]  # fmt: skip
    return Outcome(
        claims=claims,
        tables=[Table(f"N_mc = {COUNT}, 10 % false alarms, 10 % missing, d̄ = {MAX_GAP}", HEAD,
                      rows)],
        pictures=[Picture("report_groups", CAPTION, _draw(some[0]))],
        notes=(
            "The report proposes both splits and gives no figures. Each group has moves in "
            "proportion to its detections.",
            "Groups of what plausible links join, which the report does not have, take "
            f"{ours.moves.mean():.1f} moves a frame, at {ours.correct.mean():.2f} % correct.",
        ),
    )  # fmt: skip


def _draw(clip: Clip) -> Figure:
    tracks = am.track(clip.truth.detections, am.GNN(), model=clip.model)
    axes = plot_groups(am.filter.gate_groups(tracks, clip.model))
    told = axes.get_title(loc="left")
    axes.set_title(f"what the gates join: {told}", fontsize=10, color=INK, loc="left")
    return axes.figure  # pyright: ignore[reportReturnType]


CAPTION = (
    "Beyond the report: what need not be walked over together. Tracks of a recording of the cube "
    "by the number of those that share candidates with them, frame by frame (seed 0)."
)

PART = Part(
    title="Groups: cells and clusters",
    section="§4.2",
    covers="“Volume or distance clusters splitting up”",
    did="Proposes to divide space into cells, or the measurements into clusters by their distance, "
    "each with a chain of its own; the second is held to be more efficient, and the regrouping of "
    "what was divided to be the common problem.",
    run=run,
    chosen=("Cells of 0.5 m, shifted by half in every other frame; clusters within 0.25 m.",),
)
