"""§4.2's “fix” and figure 4.3: drawing from the best partition so far, on perfect data."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import asterism as am
from asterism.reproduction.part import Claim, Outcome, Part, Picture, Table
from asterism.reproduction.paths import draw_paths
from asterism.reproduction.rules import differs, spread, within
from asterism.reproduction.walks import HEAD, Scores, clips, our_chain, row, walked

if TYPE_CHECKING:
    from collections.abc import Callable

    from asterism.reproduction.part import Effort, Tell

COUNTS = (30, 80, 300, 1000)
WAYS: dict[str, Callable[..., am.MCMCDA]] = {
    "the original: from the partition taken last": partial(
        am.MCMCDA.report_2010, acceptance="metropolis"
    ),
    "the report's fix: from the best so far": am.MCMCDA.report_2010,
    "Asterism": our_chain,
}
ORIGINAL, FIXED, OURS = WAYS
MAX_GAP, N_MARKERS = 2, 8


def run(effort: Effort, tell: Tell) -> Outcome:
    """Walk over the undisturbed cube in the three ways."""
    some = clips(effort.seeds, max_gap=MAX_GAP, missing=0, clutter=0)
    found: dict[tuple[str, int], Scores] = {}
    for i, name in enumerate(WAYS):
        for j, count in enumerate(COUNTS):
            method = WAYS[name](moves=count / N_MARKERS)
            found[name, count] = walked(some, method)
            tell((i * len(COUNTS) + j + 1) / (len(WAYS) * len(COUNTS)))
    first = COUNTS[0]
    before, after = found[ORIGINAL, first].correct, found[FIXED, first].correct
    claims = [
        Claim(
            f"targets correctly tracked, original, N_mc = {first}", "≈ 15 %",
            f"{spread(before)} %", within(15, before, step=1), "100 %",
        ),
        Claim(
            f"targets correctly tracked, fixed, N_mc = {first}", "≈ 99.9 %",
            f"{spread(after)} %", within(99.9, after, step=0.1), "100 %",
        ),
        Claim(
            f"the fix leaves less that is not correct, N_mc = {first}", "84.9 points less",
            f"{spread(before - after)} points more" if before.mean() > after.mean()
            else f"{spread(after - before)} points less",
            differs(100 - after, 100 - before, "points of a hundred that are not correct"),
        ),
    ]  # fmt: skip
    last = COUNTS[-1]
    original = found[ORIGINAL, last].correct
    claims.append(
        Claim(
            f"only the fix arrives: the original stays at 15 %, N_mc = {last}", "≈ 15 %",
            f"{spread(original)} %", within(15, original, step=1), "100 %",
        )
    )  # fmt: skip
    rows = [row("floor", walked(some, None))]
    rows += [row(f"{name}, N_mc = {count}", s) for (name, count), s in found.items()]
    shown: dict[str, am.Tracks] = {}
    under: list[str] = []
    clip = some[min(1, len(some) - 1)]
    for name, chain in WAYS.items():
        method = chain(moves=first / N_MARKERS)
        tracks = am.track(clip.truth.detections, method, model=clip.model, seed=clip.seed)
        e = am.evaluate(tracks, clip.truth)
        shown[name] = tracks
        under.append(f"{e.n_tracks} tracks, {100 * e.idr:.0f} % correct")
    caption = (
        f"The report's first figure 4.3: N_mc = {first}, no false alarms and no missing data (seed "
        f"{clip.seed}). Brown: tracks beyond the eighth. Grey dots are in no track."
    )
    picture = Picture("report_fix", caption, draw_paths(shown, under, columns=3))
    return Outcome(
        claims=claims,
        tables=[Table("The cube without any disturbance, d̄ = 2", HEAD, rows)],
        pictures=[picture],
        notes=NOTES,
    )


NOTES = (
    "Both chains do not look enough with 30 moves a frame, and both arrive with more. To draw from "
    "the best partition and to weigh against the one taken last is an ascent: it finds, and does "
    "not sample, so it gives no confidence. “This is an error in [5]” is itself one: Metropolis "
    "and Hastings draw from where the chain is.",
)

PART = Part(
    title="The fix: drawing from the best partition so far",
    section="§4.2 and §4.3",
    covers="the first figure 4.3, algorithm 2",
    did="Algorithm 2 draws each proposal from the best partition so far, not from the one that the "
    "chain is at. On the cube without disturbances, 30 moves a frame, the report finds that this "
    "raises what is correctly tracked from about 15 % to about 99.9 %, and that only so the chain "
    "arrives.",
    run=run,
    slips=(
        "The change is no correction: with it the chain has no stationary distribution to arrive "
        "at.",
    ),
    chosen=(
        "“Correctly detected and tracked” is the share of the markers' detections that are in the "
        "one track of their marker (IDR).",
        "Noise of 5 mm, d̄ = 2, v̄ = 0.15; motion estimated from each clip.",
    ),
)
