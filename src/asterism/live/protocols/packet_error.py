"""The one error of the decoders."""

from __future__ import annotations

__all__ = ["PacketError"]


class PacketError(ValueError):
    """A packet is not what its protocol says: truncated, too long or garbage."""
