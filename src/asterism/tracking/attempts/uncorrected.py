"""Tracks before any edit, with what later steps need, and how certain their identities are."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from asterism.records import record
from asterism.tracking.confidence.identity import (
    Examined,
    examine,
    expected_right,
    with_confidence,
)

if TYPE_CHECKING:
    from asterism.model import Detections, Recipe, TrackingModel, Tracks
    from asterism.tracking.estimation import ModelEstimate
    from asterism.tracking.naming import Naming
    from asterism.tracking.stitching import Stitching

__all__ = ["DOUBTFUL", "Uncorrected"]

DOUBTFUL = 0.002
"""Share of the detections whose identity is expected to be wrong, from which there are further
attempts."""


@record(eq=False)
class Uncorrected:
    """Tracks of a recipe before any edit, with what the later steps need.

    Parameters
    ----------
    tracks : Tracks
        Associated, stitched and named tracks.
    recipe : Recipe
        Recipe as it was carried out; its method is the one that made the tracks.
    model : TrackingModel
        Model with which they were associated.
    stitching : Stitching, optional
        Stitching that made them.
    naming : Naming, optional
        Names with their probabilities.
    estimate : ModelEstimate, optional
        Estimate of the model, if it was estimated in a further attempt.
    still : Detections, optional
        The same detections without the motion that most markers have in common, if the model and
        the stitching hold for these coordinates.
    """

    tracks: Tracks
    recipe: Recipe
    model: TrackingModel
    stitching: Stitching | None = None
    naming: Naming | None = None
    estimate: ModelEstimate | None = None
    still: Detections | None = None

    def as_modelled(self, tracks: Tracks) -> Tracks:
        """Return tracks of the capture in the coordinates for which the model holds.

        Parameters
        ----------
        tracks : Tracks
            Tracks of the same detections.
        """
        return tracks if self.still is None else replace(tracks, detections=self.still)

    def as_captured(self, tracks: Tracks) -> Tracks:
        """Return such tracks in the coordinates of the capture.

        Parameters
        ----------
        tracks : Tracks
            Tracks of the same detections.
        """
        if self.still is None:
            return tracks
        return replace(tracks, detections=self.tracks.detections)

    @cached_property
    def examined(self) -> Examined:
        """What the confidence of identities is computed from."""
        threads = self.recipe.options.get("threads", 1)
        tracks = self.as_modelled(self.tracks)
        return examine(tracks, self.model, self.stitching, threads=threads)

    @cached_property
    def assessed(self) -> Tracks:
        """The tracks with the confidence of their identities."""
        return with_confidence(self.tracks, self.examined)

    @cached_property
    def expected_right(self) -> float:
        """Number of detections whose identity is expected to be right."""
        return expected_right(self.tracks, self.examined)

    @property
    def expected_wrong(self) -> float:
        """Number of detections with a track whose identity is expected to be wrong."""
        return int((self.tracks.labels >= 0).sum()) - self.expected_right

    @property
    def has_bonds(self) -> bool:
        """Whether the method used the distances between markers."""
        return self.recipe.options.get("rigid") is not None

    @property
    def is_doubtful(self) -> bool:
        """Whether more than `DOUBTFUL` of the detections are expected to be wrong."""
        return self.expected_wrong > DOUBTFUL * len(self.tracks.labels)
