"""§4.2's “fix” and figure 4.3: proposals from the best partition so far, on perfect data."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import asterism as am
from asterism.reproduction.drawing import draw_paths
from asterism.reproduction.part import Outcome, Part
from asterism.reproduction.rules import fewer, within
from asterism.reproduction.scores import compare, cubes, score_table

if TYPE_CHECKING:
    from collections.abc import Callable

COUNTS = (30, 80, 300, 1000)
ORIGINAL, FIXED = "original: from the current partition", "fixed: from the best so far"
CHAINS: dict[str, Callable[..., am.MCMCDA]] = {
    ORIGINAL: partial(am.MCMCDA.report_2010, acceptance="metropolis"),
    FIXED: am.MCMCDA.report_2010,
}
MAX_GAP, N_MARKERS = 2, 8


def run(seeds: int) -> Outcome:
    """Track the undisturbed cube with both chains."""
    found = compare(
        cubes(seeds, max_gap=MAX_GAP, missing=0, clutter=0),
        {f"{name}, N_mc = {n}": chain(moves=n / N_MARKERS)
         for name, chain in CHAINS.items() for n in COUNTS},
    )  # fmt: skip
    first, last = COUNTS[0], COUNTS[-1]
    before, after = (found[f"{name}, N_mc = {first}"].correct for name in CHAINS)
    unfixed = found[f"{ORIGINAL}, N_mc = {last}"].correct
    judge = partial(within, sign="≈ ", unit=" %", oracle=found["oracle"].correct)
    claims = [
        judge(f"targets correctly tracked, original, N_mc = {first}", 15, before, step=1),
        judge(f"targets correctly tracked, fixed, N_mc = {first}", 99.9, after, step=0.1),
        fewer(f"the fix tracks more targets correctly, N_mc = {first}", "84.9 % more",
              100 - after, 100 - before, "% not correct"),
        judge(f"the original does not converge, N_mc = {last}", 15, unfixed, step=1),
    ]  # fmt: skip
    return Outcome(
        claims=claims,
        tables=[score_table("The cube without disturbances, d̄ = 2", found)],
        figure=draw_paths({name: found[f"{name}, N_mc = {first}"].example for name in CHAINS}),
    )


PART = Part(
    name="fix",
    title="The fix: proposals from the best partition so far",
    section="§4.2 and §4.3",
    covers="the first figure 4.3, algorithm 2",
    summary="Algorithm 2 draws each proposal from the best partition so far, not from the chain's "
    "current one. On the cube without disturbances, with 30 moves a frame, the report finds that "
    "this raises the share of targets correctly tracked from about 15 % to about 99.9 %, and that "
    "only with it the chain converges.",
    run=run,
    caption=f"The report's first figure 4.3: N_mc = {COUNTS[0]}, no false alarms and no missing "
    "data (seed 0). Brown: tracks beyond the eighth. Grey dots are in no track.",
    notes=(
        "With 30 moves a frame neither chain has converged; with 1000 both have. A chain that "
        "draws from the best partition and compares with the current one is an ascent: it "
        "optimises and does not sample, so it gives no confidence. “This is an error in [5]” is "
        "itself one: Metropolis and Hastings draw from the current state.",
    ),
    mistakes=("With the change the chain has no stationary distribution to converge to.",),
    assumptions=(
        "“Correctly detected and tracked” is the share of the markers' detections that are in the "
        "one track of their marker (IDR).",
        "Noise of 5 mm, d̄ = 2, v̄ = 0.15; motion estimated from each capture.",
    ),
)
