"""Correction of a tracked capture by a person: a session of edits, each of which is on disk."""

from asterism.edit.session import Session

__all__ = ["Session"]
