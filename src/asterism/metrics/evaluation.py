"""Evaluation of tracks by all scores at once."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from asterism.checks import check_array, check_kind
from asterism.metrics.alignment import align
from asterism.metrics.association import AssociationScores, association_scores
from asterism.metrics.clear import ClearScores, clear_scores
from asterism.metrics.gospa import GospaScores, gospa_scores
from asterism.metrics.hota import HotaScores, hota_scores
from asterism.metrics.identity import IdentityScores, identity_scores
from asterism.metrics.names import NameScores, name_scores
from asterism.model import Tracks
from asterism.records import record

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Evaluation", "evaluate"]


@record(eq=False)
class Evaluation(
    ClearScores, IdentityScores, HotaScores, GospaScores, AssociationScores, NameScores
):
    """All scores of a result; the base classes describe their fields.

    Attributes
    ----------
    times : ndarray of shape (T,)
        Times of the frames, seconds, for all fields that start with ``frame_``.
    filled : int
        Number of filled points of the tracks, which are left out.

    Examples
    --------
    >>> import asterism as am
    >>> truth = am.simulate.cube(frames=20, seed=1)
    >>> am.evaluate(truth, truth).idf1
    1.0
    """

    times: NDArray[np.float64]
    filled: int

    def to_dict(self) -> dict[str, Any]:
        """Return the overall scores by name, as plain numbers for JSON.

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> am.evaluate(truth, truth).to_dict()["switches"]
        0
        """
        fields = (f.name for f in dataclasses.fields(self))
        values = {name: getattr(self, name) for name in sorted(fields) if not _is_by_frame(name)}
        return {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}

    def by_frame(self) -> dict[str, NDArray[Any]]:
        """Return times and scores by frame, as columns of one table, each of shape (T,).

        Examples
        --------
        >>> import asterism as am
        >>> truth = am.simulate.cube(frames=20, seed=1)
        >>> int(am.evaluate(truth, truth).by_frame()["missed"].sum())
        0
        """
        fields = (f.name for f in dataclasses.fields(self))
        return {"times": self.times} | {
            name.removeprefix("frame_"): getattr(self, name)
            for name in sorted(fields)
            if name.startswith("frame_")
        }

    def __str__(self) -> str:
        table = ", ".join(f"{n} with {k}" for k, n in enumerate(self.frames_by_wrong) if n)
        rows = [
            ("frames, markers, tracks", f"{len(self.times)}, {self.n_markers}, {self.n_tracks}"),
            ("IDF1 (IDP, IDR)", f"{self.idf1:.4f} ({self.idp:.4f}, {self.idr:.4f})"),
            ("MOTA, MOTP", f"{self.mota:.4f}, {self.motp_mm:.3f} mm"),
            ("HOTA (DetA, AssA)", f"{self.hota:.4f} ({self.deta:.4f}, {self.assa:.4f})"),
            ("GOSPA", f"{1000 * self.gospa:.3f} mm a frame"),
            ("switches", f"{self.switches} ({self.switches_per_1000:.3f} per 1000 detections)"),
            ("fragments", f"{self.fragments}"),
            ("missed, false labels", f"{self.missed}, {self.false_labels}"),
            ("mostly tracked, lost", f"{self.mostly_tracked}, {self.mostly_lost}"),
            ("wrong associations", _percent(self.wrong_percent)),
            ("… by a track's first marker", _percent(self.wrong_first_percent)),
            ("missing labels", _percent(self.missing_percent)),
            ("clutter labelled", _percent(self.clutter_labelled_percent)),
            ("tracks a marker", f"{self.tracks_per_marker:.3f}"),
            ("wrong links, broken links", f"{self.wrong_links}, {self.broken_links}"),
            ("frames by wrong ones", table),
            *([("filled points left out", str(self.filled))] if self.filled else []),
            *self._name_rows(),
        ]
        width = max(len(name) for name, _ in rows)
        return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)

    def _name_rows(self) -> list[tuple[str, str]]:
        if np.isnan(self.name_accuracy):
            return [("names", "not scored, because tracks or truth have none")]
        parts = f"{self.name_precision:.4f}, {self.name_recall:.4f}"
        return [
            ("name F1 (precision, recall)", f"{self.name_f1:.4f} ({parts})"),
            ("name accuracy", f"{self.name_accuracy:.4f}"),
            ("left and right swapped", f"{self.swapped_sides_percent:.3f} %"),
        ]

    def __repr__(self) -> str:
        return (
            f"Evaluation(idf1={self.idf1:.4f}, mota={self.mota:.4f}, hota={self.hota:.4f}, "
            f"switches={self.switches}, n_tracks={self.n_tracks}, n_markers={self.n_markers})"
        )


def _is_by_frame(name: str) -> bool:
    return name == "times" or name.startswith("frame_")


def evaluate(
    tracks: Tracks,
    truth: Tracks,
    *,
    truth_positions: ArrayLike | None = None,
    c: float = 0.1,
    tolerance: float = 1e-6,
) -> Evaluation:
    """Score tracks against the ground truth.

    Labels are compared detection by detection, so both must come from the same capture. If they do
    not share one `Detections`, detections are matched by equal times and positions
    (`asterism.metrics.align`). If any track of the truth has a name, its unnamed tracks are
    clutter. Names are scored if both sides have any; all other scores compare identities alone.
    Filled points of either side are left out: they are no detections.

    Parameters
    ----------
    tracks : Tracks
        Tracks to score.
    truth : Tracks
        Ground truth.
    truth_positions : array_like of shape (N, D), optional
        True position of the marker of each detection of `truth`, metres; NaN for clutter. Used
        for `motp_mm` and `gospa`. By default the detections are assumed to be exact.
    c : float
        Cut-off of GOSPA, metres, > 0. Larger values weigh missed and false labels more.
    tolerance : float
        Largest difference of a coordinate between matching detections, metres.

    Returns
    -------
    Evaluation

    Raises
    ------
    ParameterError
        If fewer than half of the detections of either side match, or an argument
        is out of range.

    Examples
    --------
    >>> from asterism.metrics import oracle_tracks
    >>> from asterism.model import Tracks
    >>> import numpy as np
    >>> positions = np.ones((10, 2, 3)) * [[0.0], [1.0]]
    >>> positions[3:6, 1] = np.nan
    >>> truth = Tracks.from_dense(np.arange(10), positions, ["LASI", "RASI"])
    >>> evaluate(oracle_tracks(truth, max_gap=2), truth)
    Evaluation(idf1=0.8235, mota=0.9412, hota=0.8935, switches=1, n_tracks=3, n_markers=2)
    """
    check_kind("tracks", tracks, Tracks, "am.track(detections)")
    check_kind("truth", truth, Tracks, "am.io.read_tracks(path)")
    filled, of_truth = tracks.detections.filled, truth.detections.filled
    tracks, truth = tracks.measured(), truth.measured()
    both = align(tracks, truth, tolerance=tolerance)
    labels, truth_labels, frame_of = both.labels, both.truth_labels, both.frame_of
    n_frames = len(both.times)
    error = None
    if truth_positions is not None:
        n_axes = truth.detections.n_axes
        n = len(truth.labels) if of_truth is None else len(of_truth)
        places = check_array("truth_positions", truth_positions, (n, n_axes), finite=False)
        places = places if of_truth is None else places[~of_truth]
        error = np.full(len(labels), np.nan)
        is_on_both = (both.i_tracks >= 0) & (both.i_truth >= 0)
        seen = tracks.detections.points[both.i_tracks[is_on_both]]
        error[is_on_both] = np.linalg.norm(seen - places[both.i_truth[is_on_both]], axis=1)
    parts = (
        clear_scores(labels, truth_labels, frame_of, n_frames=n_frames, error=error),
        identity_scores(labels, truth_labels),
        hota_scores(labels, truth_labels),
        gospa_scores(labels, truth_labels, frame_of, c=c, n_frames=n_frames, error=error),
        association_scores(labels, truth_labels, frame_of, n_frames=n_frames),
        name_scores(labels, truth_labels, tracks.names, truth.names),
    )
    scores: dict[str, Any] = {}
    for part in parts:
        scores |= vars(part)
    n_filled = 0 if filled is None else int(filled.sum())
    return Evaluation(times=both.times, filled=n_filled, **scores)


def _percent(share: float) -> str:
    return "–" if np.isnan(share) else f"{share:.3f} %"
