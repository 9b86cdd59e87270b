"""From tracks to their report: what is known about them is gathered here and drawn by `view`."""

from asterism.reporting.report import report

__all__ = ["report"]
