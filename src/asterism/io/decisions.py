"""Decisions of a tracking as a table: CSV, JSON, and lines for a C3D."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

from asterism.io.atomic import write_text
from asterism.model import Capture

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from asterism.model import Decision, Tracks

__all__ = ["as_line", "by_expected_wrong", "decision_rows", "write_decisions"]

DIGITS = 4
"""Decimals of probabilities in the table; they are not known any better."""


def decision_rows(tracks: Tracks) -> list[dict[str, Any]]:
    """Return the decisions of tracks as rows of plain values.

    Frames are numbered as in the capture's file. ``alternatives`` lists the name or the number of
    each other track, empty for an unknown marker, with its probability.

    Parameters
    ----------
    tracks : Tracks
        Tracks with decisions.

    Examples
    --------
    >>> import asterism as am
    >>> decision_rows(am.simulate.cube(frames=5, seed=1))
    []
    """
    d = tracks.detections
    first_frame = d.first_frame if isinstance(d, Capture) else 1
    names = tracks.display_names
    return [
        {
            "kind": each.kind,
            "track": each.track,
            "name": names[each.track] if each.track >= 0 else "",
            "first_frame": first_frame + each.first,
            "last_frame": first_frame + each.last,
            "start_s": float(d.times[each.first]),
            "end_s": float(d.times[each.last]),
            "detections": each.n_detections,
            "probability": None if each.probability is None else round(each.probability, DIGITS),
            "expected_wrong": round(each.expected_wrong, DIGITS),
            "alternatives": [
                {
                    "name": other.name or ("" if other.track is None else names[other.track]),
                    "probability": round(other.probability, DIGITS),
                }
                for other in each.alternatives
            ],
        }
        for each in tracks.decisions
    ]


def write_decisions(tracks: Tracks, path: Path) -> None:
    """Write the decisions of tracks as CSV, or as JSON if the name ends in ``.json``.

    Parameters
    ----------
    tracks : Tracks
        Tracks with decisions.
    path : Path
        File to create or replace.

    Raises
    ------
    FormatError
        If the file cannot be written.
    """
    rows = decision_rows(tracks)
    if path.suffix.lower() == ".json":
        write_text(path, json.dumps(rows, indent=1, ensure_ascii=False) + "\n")
        return
    file = io.StringIO()
    columns = ("kind", "track", "name", "first_frame", "last_frame", "start_s", "end_s",
               "detections", "probability", "expected_wrong")  # fmt: skip
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow((*columns, "alternatives"))
    for row in rows:
        others = (f"{o['name'] or 'unknown'} {o['probability']:.4f}" for o in row["alternatives"])
        writer.writerow((*(row[column] for column in columns), "; ".join(others)))
    write_text(path, file.getvalue())


def by_expected_wrong(decisions: Sequence[Decision]) -> list[int]:
    """Return the numbers of the decisions by falling expected number of wrong detections."""
    return sorted(range(len(decisions)), key=lambda i: (-decisions[i].expected_wrong, i))


def as_line(row: dict[str, Any]) -> str:
    """Return a row of `decision_rows` as one short line."""
    sure = "" if row["probability"] is None else f" p={row['probability']:.4f}"
    others = "".join(
        f" | {other['name'] or 'unknown'} {other['probability']:.4f}"
        for other in row["alternatives"]
    )
    frames = f"{row['first_frame']}-{row['last_frame']}"
    return f"{row['kind']} {row['name']} {frames} n={row['detections']}{sure}{others}"
