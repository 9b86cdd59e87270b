"""Correction: tracks that respect the edits of a person."""

from asterism.tracking.correction.change import Change, Stretch
from asterism.tracking.correction.correct import correct
from asterism.tracking.correction.correction import Correction
from asterism.tracking.correction.settled import settled

__all__ = ["Change", "Correction", "Stretch", "correct", "settled"]
