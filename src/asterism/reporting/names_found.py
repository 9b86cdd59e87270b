"""What was named, as rows of a printed table and as plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asterism.model import Capture

if TYPE_CHECKING:
    from collections.abc import Iterable

    from asterism.tracking import KeptNames, NameConflict, Naming

__all__ = ["conflict_figures", "naming_figures", "naming_rows"]

UNCERTAIN = 0.9
"""Probability of a name below which it is listed."""
MOST = 8
"""Number of rows of a list."""


def naming_rows(found: Naming) -> list[tuple[str, str]]:
    """Return the result of `name_tracks` as rows: names, missing ones, uncertain ones, changes."""
    names = [name for name in found.tracks.names if name is not None]
    rows = [
        ("names given", f"{len(names)}, to {found.n_named} of {len(found.markers)} tracks"),
        ("names not found", ", ".join(found.missing) or "none"),
    ]
    rows += [] if found.own is None else _own_rows(found, found.own)
    tracks = zip(found.probabilities, found.markers, found.alternatives, strict=True)
    least: dict[str, tuple[float, str, str | None]] = {}  # by name, of all tracks with it
    for p, name, other in tracks:
        if name is not None and p < min(UNCERTAIN, least.get(name, (1.0,))[0]):
            least[name] = float(p), name, other
    uncertain = sorted(least.values())
    for n, (p, name, other) in enumerate(uncertain[:MOST]):
        rows.append(("" if n else f"below {UNCERTAIN:.0%}", f"{name} {p:.0%}, else {other}"))
    if len(uncertain) > MOST:
        rows.append(("", f"and {len(uncertain) - MOST} more"))
    at = _first_frame(found)
    for n, change in enumerate(found.changes[:MOST]):
        text = f"frames {at + change.first} to {at + change.last}: "
        text += f"{change.name or 'no name'} instead of {change.usual or 'no name'}"
        rows.append(("" if n else "changes of marker", text))
    if len(found.changes) > MOST:
        rows.append(("", f"and {len(found.changes) - MOST} more"))
    return rows


def _own_rows(found: Naming, own: KeptNames) -> list[tuple[str, str]]:
    """Return the result for the names in the file as rows."""
    kept, moved, left_out = len(own.kept), len(own.moved), len(own.left_out)
    rows = [("names in the file", f"{kept} kept, {moved} moved, {left_out} left out")]
    if own.moved:
        rows.append(("moved", ", ".join(own.moved)))
    at = _first_frame(found)
    longest = sorted(own.conflicts, key=lambda one: one.first - one.last)[:MOST]
    for n, one in enumerate(longest):
        text = f"{one.name}, frames {at + one.first} to {at + one.last}: {one.found or 'no name'}"
        rows.append(("" if n else "contradicted", text))
    if len(own.conflicts) > MOST:
        rows.append(("", f"and {len(own.conflicts) - MOST} more"))
    return rows


def conflict_figures(conflicts: Iterable[NameConflict], at: int) -> list[dict[str, Any]]:
    """Return names that are contradicted as plain values; `at` is the number of the first frame."""
    return [
        {
            "name": one.name,
            "first": at + one.first,
            "last": at + one.last,
            "found": one.found,
            "probability": one.probability,
        }
        for one in conflicts
    ]


def naming_figures(found: Naming) -> dict[str, Any]:
    """Return the result of `name_tracks` as plain values, with the frame numbers of the file."""
    at, own = _first_frame(found), found.own
    rows = zip(
        found.markers,
        found.probabilities.tolist(),
        found.alternatives,
        found.alternative_probabilities.tolist(),
        strict=True,
    )
    return {
        "n_tracks": len(found.markers),
        "n_named": found.n_named,
        "names": [
            {
                "track": k,
                "name": name,
                "probability": p,
                "alternative": other,
                "alternative_probability": q,
            }
            for k, (name, p, other, q) in enumerate(rows)
            if name is not None
        ],
        "changes": [
            {
                "track": change.track,
                "first": at + change.first,
                "last": at + change.last,
                "usual": change.usual,
                "name": change.name,
            }
            for change in found.changes
        ],
        "not_found": list(found.missing),
        "own": None
        if own is None
        else {
            "kept": list(own.kept),
            "moved": list(own.moved),
            "left_out": list(own.left_out),
            "conflicts": conflict_figures(own.conflicts, at),
        },
    }


def _first_frame(found: Naming) -> int:
    capture = found.tracks.detections
    return capture.first_frame if isinstance(capture, Capture) else 0
