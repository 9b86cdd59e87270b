"""What both pages say, so that they say the same."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from asterism.reproduction.part import Effort

__all__ = ["CLAIMS_HEAD", "CONTENTS_HEAD", "DRAWN", "TITLE", "about", "stopped"]

TITLE = "The 2010 report, made anew"
CLAIMS_HEAD = ("", "the report", "ours", "floor", "verdict")
CONTENTS_HEAD = ("part", "section", "what is made anew", "reproduced")
DRAWN = (
    "The rest of the report's figures are drawings of an idea, with nothing to measure: 2.2, the "
    "flow of multiple-hypothesis tracking, whose four subroutines bear the same names in `am.MHT`."
)
"""What has no part."""


def about(effort: Effort) -> str:
    """Say how the page was made."""
    kind = "a quick run" if effort.is_quick else "a full run"
    return (
        f"E. D'Elia, C. Tavian, A. Zugno: Simulation and Multi-Target Tracking, Padua 2010. Its "
        f"figures beside ours, from {kind} with {effort.seeds} seeds. “±” is a standard deviation "
        "over the seeds. The floor is the best that these data allow, where that is not "
        "everything. Times differ from run to run and are in `times.md`."
    )


def stopped(missing: Sequence[str]) -> str:
    """Say what is not there, or nothing."""
    return f"Stopped before its end. Not made: {', '.join(missing)}." if missing else ""
