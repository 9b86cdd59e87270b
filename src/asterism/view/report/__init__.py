"""The report: one HTML page with a player, that needs nothing but itself.

This package draws; what it shows is handed to it as `Contents`. `asterism.report` gathers that.
"""

from asterism.view.report.contents import Connections, Contents, Judgement, Score, Verdict
from asterism.view.report.findings import Finding, find_troubles
from asterism.view.report.page import page

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
