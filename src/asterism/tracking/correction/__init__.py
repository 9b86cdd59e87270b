"""Correction: tracks that respect the edits of a person."""

from asterism.tracking.correction.correction import Change, Correction, Stretch, correct, settled

__all__ = ["Change", "Correction", "Stretch", "correct", "settled"]
