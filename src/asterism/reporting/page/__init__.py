"""The report: one self-contained HTML page with a player.

This package draws the `Contents` that `asterism.report` gathers.
"""

from asterism.reporting.page.contents import (
    Connections,
    Contents,
    Editing,
    Judgement,
    Score,
    Verdict,
)
from asterism.reporting.page.document import page
from asterism.reporting.page.findings import Finding, find_troubles

__all__ = [
    "Connections",
    "Contents",
    "Editing",
    "Finding",
    "Judgement",
    "Score",
    "Verdict",
    "find_troubles",
    "page",
]
