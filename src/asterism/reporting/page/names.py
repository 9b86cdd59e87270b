"""What a track is called on the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asterism.model import Tracks

__all__ = ["track_names"]


def track_names(tracks: Tracks) -> tuple[str, ...]:
    """Name every track: its marker, or its number where it has none."""
    return tuple(name or f"track {k}" for k, name in enumerate(tracks.names))
