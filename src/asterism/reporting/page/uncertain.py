"""Places to check, in words: the first figure of the page, and its first list."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.model import Capture
from asterism.reporting.page.markup import Markup, element

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.model import Decision, Tracks
    from asterism.reporting.page.contents import Contents
    from asterism.reporting.places import Place

__all__ = ["entries", "in_words", "tile"]

MANY = 0.01
"""Share of wrong points among the labelled ones from which the severity is the highest."""
MAX_ALTERNATIVES = 3
MIN_LISTED = 0.015
"""Smallest probability of an alternative that is listed."""
MIN_INVOLVED = 0.05
"""Smallest probability of an alternative whose marker the player frames."""


def tile(contents: Contents) -> Markup:
    """Return the number of places to check, with its severity."""
    places = contents.places
    if places is None:
        sign, number, text = "none", "–", "places to check: no probabilities of identity"
    elif not places:
        sign, number, text = "clear", "✓ 0", "places to check"
    else:
        wrong = sum(place.expected_wrong for place in places)
        many = wrong >= MANY * np.count_nonzero(contents.tracks.labels >= 0)
        sign, number = ("many", f"▲ {len(places):,}") if many else ("some", f"△ {len(places):,}")
        text = f"{_only('place', len(places))} to check, {_points(wrong)}"
    return element(
        "div",
        element("dt", text),
        element("dd", number, data_fact="places"),
        class_="to-check",
        data_severity=sign,
    )


def entries(contents: Contents, shown: NDArray[np.int64], max_entries: int) -> list[Markup]:
    """Return the entries of the list.

    Parameters
    ----------
    contents : Contents
        Contents of the page.
    shown : ndarray of int
        Frames of the capture that the player has, increasing.
    max_entries : int
        Largest number of entries.
    """
    tracks = contents.tracks
    names, times = tracks.display_names, tracks.detections.times

    def of(place: Place) -> Markup:
        worst = place.decisions[0]
        first, last = (int(np.searchsorted(shown, t)) for t in (worst.first, worst.last))
        others = [
            a.track
            for a in worst.alternatives
            if a.track is not None and a.probability >= MIN_INVOLVED
        ]
        return element(
            "li",
            element(
                "button",
                element("span", f"uncertain {worst.kind}", class_="kind"),
                element("span", f"{times[worst.first]:.2f}\xa0s", class_="when"),
                element(
                    "span",
                    element("bdi", names[worst.track]),
                    in_words(place, tracks).removeprefix(names[worst.track]),
                    class_="why",
                ),
                type="button",
                data_frame=min(first, len(shown) - 1),
                data_last=min(last, len(shown) - 1),
                data_track=worst.track,
                data_tracks=" ".join(map(str, dict.fromkeys([worst.track, *others]))),
                data_kind=worst.kind,
            ),
        )

    return [of(place) for place in (contents.places or ())[:max_entries]]


def in_words(place: Place, tracks: Tracks) -> str:
    """Return what is uncertain at a place, with the alternatives and their probabilities.

    Parameters
    ----------
    place : Place
        Place, described by its decision with the most expected wrong points.
    tracks : Tracks
        Tracks of the page.
    """
    d, names = tracks.detections, tracks.display_names
    start = d.first_frame if isinstance(d, Capture) else 0
    worst = place.decisions[0]
    frames = f"frame {start + worst.first}"
    if worst.last > worst.first:
        frames = f"frames {start + worst.first} to {start + worst.last}"
    text = f"{names[worst.track]}, {frames}: {_percent(worst.probability)}"
    if others := _alternatives(worst, names):
        text += f", or {', '.join(others)}"
    if len(place.decisions) > 1:
        text += f"; {_count(len(place.decisions) - 1, 'more part')}"
        also = [names[k] for k in place.tracks if k != worst.track]
        text += f", also of {', '.join(also[:4])}" if also else ""
        text += f" and {len(also) - 4} more" if len(also) > 4 else ""
    return f"{text}; {_points(place.expected_wrong)}"


def _alternatives(decision: Decision, names: Sequence[str]) -> list[str]:
    likely = sorted(decision.alternatives, key=lambda a: -a.probability)
    unknown = "no name" if decision.kind == "name" else "unknown marker"
    return [
        f"{a.name or (unknown if a.track is None else names[a.track])} {_percent(a.probability)}"
        for a in likely[:MAX_ALTERNATIVES]
        if a.probability >= MIN_LISTED
    ]


def _percent(probability: float | None) -> str:
    return f"{100 * min(max(probability or 0.0, 0.01), 0.99):.0f}\xa0%"


def _points(wrong: float) -> str:
    n = max(1, round(wrong))
    return f"about {_count(n, 'wrong point')}"


def _only(noun: str, n: int) -> str:
    return noun if n == 1 else noun + "s"


def _count(n: int, noun: str) -> str:
    return f"{n:,} {_only(noun, n)}"
