"""Naming of tracks after the markers of an earlier capture."""

from asterism.tracking.naming.name import Naming, name_tracks

__all__ = ["Naming", "name_tracks"]
