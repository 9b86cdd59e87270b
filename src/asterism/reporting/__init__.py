"""Report of tracks: this package gathers the content, and `page` draws it."""

from asterism.reporting.gather import report

__all__ = ["report"]
