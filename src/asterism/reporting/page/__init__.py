"""The report: one HTML page with a player, that needs nothing but itself.

This package draws; what it shows is handed to it as `Contents`. `asterism.report` gathers that.
"""

from asterism.reporting.page.contents import Connections, Contents, Judgement, Score, Verdict
from asterism.reporting.page.document import page
from asterism.reporting.page.findings import Finding, find_troubles

__all__ = [
    "Connections",
    "Contents",
    "Finding",
    "Judgement",
    "Score",
    "Verdict",
    "find_troubles",
    "page",
]
