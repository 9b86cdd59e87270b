"""The page of a report."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from asterism.reporting.page import uncertain
from asterism.reporting.page.data import Played, played
from asterism.reporting.page.editing import PANEL, editing_keys, tile
from asterism.reporting.page.facts import cards, facts_of, in_words
from asterism.reporting.page.findings import find_troubles
from asterism.reporting.page.head import bundled, document
from asterism.reporting.page.markup import Markup, element, joined
from asterism.reporting.page.player import keys_table, player
from asterism.reporting.page.thinning import MOST_POINTS, frames_to_show, stride_for

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.reporting.page.contents import Contents
    from asterism.reporting.page.findings import Finding

__all__ = ["MOST_LISTED", "page"]

MOST_LISTED = 60
"""Length of each list; the page states the total number."""


def page(contents: Contents, shown: NDArray[np.int64] | None = None) -> bytes:
    """Build the page.

    Parameters
    ----------
    contents : Contents
        Contents of the page.
    shown : ndarray of int, optional
        Frames of the player, increasing; by default those of `frames_to_show`.

    Returns
    -------
    bytes
        HTML in UTF-8, the same for the same contents. Its policy forbids all requests, and all
        scripts and styles but its own.
    """
    edits = contents.editing is not None
    scripts = [bundled("player.js"), *([bundled("editor.js")] if edits else [])]
    style = bundled("player.css") + (bundled("editor.css") if edits else "")
    findings = find_troubles(contents.tracks, contents.judgement, contents.naming)
    if shown is None:
        shown = frames_to_show(contents.tracks, contents.places or ())
    play = played(contents, _by_trouble(contents, findings), shown)
    body = element(
        "body",
        element("a", "Skip to the player", href="#player", class_="skip"),
        element(
            "main",
            element(
                "div",
                _top(contents),
                player(
                    contents,
                    joined(
                        _places(contents, shown) if contents.editing is None else PANEL,
                        _list(findings, contents, shown),
                    ),
                ),
                class_="screen",
            ),
            _scores(contents),
            _made(contents),
            _drawn(contents, play, shown),
            keys_table(editing_keys(contents)),
        ),
        # A block of data, which no browser runs.
        element("script", Markup(play.text), type="text/plain", id="data"),
        *(element("script", Markup(script)) for script in scripts),
    )
    is_served = contents.editing is not None and contents.editing.is_served
    return document(contents.title, body, style, scripts, is_served=is_served)


def _by_trouble(contents: Contents, findings: Sequence[Finding]) -> NDArray[np.int64]:
    """Sort tracks by expected wrong points, then by the weight of their findings."""
    trouble = np.zeros(contents.tracks.n_tracks)
    for place in contents.places or ():
        for decision in place.decisions:
            trouble[decision.track] += 1e6 * decision.expected_wrong
    for finding in findings:
        if finding.track >= 0:
            trouble[finding.track] += finding.weight
    seen = np.flatnonzero(contents.tracks.lengths)
    return seen[np.argsort(-trouble[seen], kind="stable")]


def _top(contents: Contents) -> Markup:
    facts = facts_of(contents.tracks)
    numbers = [
        uncertain.tile(contents) if contents.editing is None else tile(),
        *(
            element("div", element("dt", what), element("dd", number, data_fact=key))
            for key, number, what in cards(facts)
        ),
    ]
    if contents.judgement is not None:
        for score in contents.judgement.scores[:2]:
            inner = (element("dt", score.name), element("dd", score.value))
            numbers.append(element("div", *inner, class_="score"))
    warnings = [element("li", text) for text in contents.warnings]
    return element(
        "header",
        element("p", "Asterism", class_="brand"),
        element("h1", element("bdi", contents.title)),
        element("p", in_words(facts, contents.tracks.detections.n_axes), class_="lead"),
        element("dl", *numbers, class_="cards"),
        element("ul", *warnings, class_="warnings", aria_label="Warnings") if warnings else "",
    )


def _places(contents: Contents, shown: NDArray[np.int64]) -> Markup:
    """Return the list of places to check."""
    if not (contents.tracks.labels >= 0).any():
        text = "The result has no track."
    elif contents.places is None:
        text = "Not known: the tracks have no probabilities of identity."
    elif not contents.places:
        text = "None: no identity and no name is probably wrong."
    else:
        text = "" if len(contents.places) <= MOST_LISTED else f"The worst {MOST_LISTED} are listed."
    listed = uncertain.entries(contents, shown, MOST_LISTED)
    return joined(
        element("h3", "Places to check"),
        element("p", text, class_="quiet", id="places-count") if text else "",
        element("ol", *listed, id="places", class_="list") if listed else "",
    )


def _list(findings: Sequence[Finding], contents: Contents, shown: NDArray[np.int64]) -> Markup:
    """Return the folded list of gaps, jumps, ends and errors, each with its reason."""
    if not findings:
        return Markup()
    names, times = contents.tracks.display_names, contents.tracks.detections.times
    listed = [
        element(
            "li",
            element(
                "button",
                element("span", _kind(f, contents), class_="kind"),
                element("bdi", names[f.track]) if f.track >= 0 and f.count == 1 else "",
                element("span", f"{times[f.frame]:.2f} s", class_="when"),
                element("span", f.reason, class_="why"),
                type="button",
                data_frame=min(int(np.searchsorted(shown, f.frame)), len(shown) - 1),
                data_track=f.track,
                data_kind=f.kind.replace(" ", "-"),
            ),
        )
        for f in findings[:MOST_LISTED]
    ]
    n, kinds = len(findings), list(dict.fromkeys(_kind(f, contents) for f in findings))
    text = f"; the worst {len(listed)} are listed" if n > len(listed) else ""
    return element(
        "details",
        element("summary", f"Gaps, jumps, missed markers: {n:,}"),
        element("p", f"{', '.join(kinds)}{text}.".capitalize(), class_="quiet"),
        element("ol", *listed, id="findings", class_="list"),
        class_="others",
    )


def _kind(finding: Finding, contents: Contents) -> str:
    judged = contents.judgement
    if judged is None or judged.against == "truth":
        return finding.kind
    other = {"wrong marker": "differs", "missed": "only in the other result"}
    return other.get(finding.kind, finding.kind)


def _scores(contents: Contents) -> Markup:
    judged = contents.judgement
    if judged is None:
        return Markup()
    rows = [
        element(
            "tr",
            element("th", s.name, scope="row"),
            element("td", s.value, class_="number", data_score=s.name),
            element("td", s.sentence),
        )
        for s in judged.scores
    ]
    lost = ""
    if judged.n_elsewhere:
        text = f"{judged.n_elsewhere:,} points of markers are in the {judged.against} only. They "
        lost = element("p", text + "count as missed above and are not drawn.", class_="quiet")
    return element(
        "section",
        element("h2", f"Comparison with the {judged.against}"),
        element("table", *rows),
        lost,
        class_="judged",
    )


def _made(contents: Contents) -> Markup:
    info = [(name, f"{value:,.6g}") for name, value in contents.tracks.info.items()]
    if not (contents.made or contents.summary or info):
        return Markup()
    return element(
        "details",
        element("summary", "How it was made"),
        element("p", contents.made, class_="made") if contents.made else "",
        _table(contents.summary) if contents.summary else "",
        element("h3", "Figures reported by the method") if info else "",
        _table(info) if info else "",
        class_="folded",
    )


def _table(rows: Sequence[tuple[str, str]]) -> Markup:
    lines = (element("tr", element("th", a, scope="row"), element("td", b)) for a, b in rows)
    return element("table", *lines)


def _drawn(contents: Contents, play: Played, shown: NDArray[np.int64]) -> Markup:
    d = contents.tracks.detections
    notes = [
        f"Positions are drawn on a grid of {1e3 * play.resolution:.2g} mm; all figures are "
        "computed from the full numbers.",
        contents.connections.about,
    ]
    if d.n_axes == 3:
        notes.append(contents.about_up)
    if contents.tracks.identity_confidence is None:
        sure = "presence" if contents.tracks.confidence is None else "link confidence"
        notes.append(f"The tracks have no identity confidence: the timeline shows {sure} only.")
    if len(shown) < d.n_frames:
        near = " and all about the worst places are" if contents.places else " is"
        notes.append(
            f"Every {_ordinal(stride_for(d.n_points))} frame{near} shown ({len(shown):,} of "
            f"{d.n_frames:,}), because a page holds about {MOST_POINTS:,} points. Figures and "
            "both lists are of all frames."
        )
    if play.n_outside:
        notes.append(
            f"{play.n_outside:,} points of clutter are too far from all tracks to be drawn."
        )
    if contents.rig is not None:
        notes.append(
            "In the images of the cameras, points are drawn within "
            f"{max(play.lens_error, 0.01):.2f} pixels of the calibrated lens. "
            "Occlusion by bodies is not drawn."
        )
    items = [element("li", text) for text in notes]
    return element(
        "details",
        element("summary", "Notes on the drawing"),
        element("ul", *items, id="notes"),
        class_="folded",
    )


def _ordinal(n: int) -> str:
    return {2: "second", 3: "third"}.get(n, f"{n}th")
