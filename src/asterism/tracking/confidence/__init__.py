"""Confidence of links and of identities, and the decisions that may be wrong."""

from asterism.tracking.confidence.identity import assess

__all__ = ["assess"]
