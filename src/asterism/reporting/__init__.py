"""From tracks to their report: what is known about them is gathered here and drawn by `page`."""

from asterism.reporting.gather import report

__all__ = ["report"]
