"""The page: its document, and the policy that restricts it."""

from __future__ import annotations

import base64
import hashlib
from collections import Counter
from importlib import resources
from typing import TYPE_CHECKING

import numpy as np

from asterism.reporting.page.data import Played, played
from asterism.reporting.page.facts import cards, facts_of, in_words
from asterism.reporting.page.findings import find_troubles
from asterism.reporting.page.markup import Markup, element, joined
from asterism.reporting.page.player import HELP, player
from asterism.reporting.page.thinning import MOST_POINTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from asterism.reporting.page.contents import Contents
    from asterism.reporting.page.findings import Finding

__all__ = ["MOST_LISTED", "page"]

MOST_LISTED = 60
"""Length of the list of findings; the page states the total number."""
_ICON = (
    "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 16 16'%3E"
    "%3Cpath d='M3 12 8 3l5 6z' fill='none' stroke='%230072B2'/%3E%3Cg fill='%230072B2'%3E"
    "%3Ccircle cx='3' cy='12' r='2'/%3E%3Ccircle cx='8' cy='3' r='2'/%3E"
    "%3Ccircle cx='13' cy='9' r='2'/%3E%3C/g%3E%3C/svg%3E"
)


def page(contents: Contents) -> bytes:
    """Build the page.

    Parameters
    ----------
    contents : Contents
        Contents of the page.

    Returns
    -------
    bytes
        HTML in UTF-8, the same for the same contents. Its policy forbids all requests, and all
        scripts and styles but its own.
    """
    script, style = _bundled("player.js"), _bundled("player.css")
    findings = find_troubles(contents.tracks, contents.judgement, contents.naming)
    order = _by_trouble(contents, findings)
    play = played(contents, order)
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=_policy(script, style)),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("meta", name="generator", content="Asterism"),
        element("link", rel="icon", href=_ICON),
        element("title", f"{contents.title} – Asterism"),
        element("style", Markup(style)),
    )
    body = element(
        "body",
        element("a", "Skip to the player", href="#player", class_="skip"),
        element(
            "main",
            _top(contents),
            player(contents, _list(findings, contents, play.stride)),
            _scores(contents),
            element("div", _made(contents), _drawn(contents, play), class_="columns"),
            HELP,
        ),
        # A block of data, which no browser runs.
        element("script", Markup(play.text), type="text/plain", id="data"),
        element("script", Markup(script)),
    )
    text = f"<!doctype html>\n{element('html', head, body, lang='en')}\n"
    # Half a surrogate pair, as a damaged name may have, has no place in UTF-8.
    return text.encode("utf-8", errors="replace")


def _policy(script: str, style: str) -> str:
    """Return a policy that forbids everything but the page's own script and style."""

    def hashed(text: str) -> str:
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    return (
        f"default-src 'none'; script-src {hashed(script)}; style-src {hashed(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'; "
        "require-trusted-types-for 'script'; trusted-types 'none'"
    )


def _bundled(name: str) -> str:
    return resources.files("asterism.reporting.page").joinpath(name).read_text(encoding="utf-8")


def _by_trouble(contents: Contents, findings: Sequence[Finding]) -> NDArray[np.int64]:
    """Sort tracks by the weight of their findings, the largest first, and then by number."""
    trouble = np.zeros(contents.tracks.n_tracks)
    for finding in findings:
        if finding.track >= 0:
            trouble[finding.track] += finding.weight
    seen = np.flatnonzero(contents.tracks.lengths)
    return seen[np.argsort(-trouble[seen], kind="stable")]


def _top(contents: Contents) -> Markup:
    facts = facts_of(contents.tracks)
    numbers = [
        element("div", element("dt", what), element("dd", number, data_fact=key))
        for key, number, what in cards(facts)
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
        element("p", contents.made, class_="made") if contents.made else "",
        element("dl", *numbers, class_="cards"),
        element("ul", *warnings, class_="warnings", aria_label="Warnings") if warnings else "",
    )


def _list(findings: Sequence[Finding], contents: Contents, stride: int) -> Markup:
    """Return the findings of the page, each with its reason."""
    if not findings:
        sure = contents.tracks.confidence is not None
        if not (contents.tracks.labels >= 0).any():
            return element("p", "The result has no track.", class_="quiet", id="findings-count")
        text = "No findings: no long gap, no improbable step, no track that starts or ends midway"
        text += ", no label of low confidence." if sure else "."
        return element("p", text, class_="quiet", id="findings-count")
    names, times = contents.tracks.display_names, contents.tracks.detections.times
    shown = [
        element(
            "li",
            element(
                "button",
                element("span", f.kind, class_="kind"),
                element("bdi", names[f.track]) if f.track >= 0 else "",
                element("span", f"{times[f.frame]:.2f} s", class_="when"),
                element("span", f.reason, class_="why"),
                type="button",
                data_frame=f.frame // stride,
                data_track=f.track,
                data_kind=f.kind.replace(" ", "-"),
            ),
        )
        for f in findings[:MOST_LISTED]
    ]
    kinds = Counter(f.kind for f in findings)
    parts = ", ".join(f"{kind} {n:,}" for kind, n in kinds.most_common())
    n = len(findings)
    count = f"{n:,} places" if n > 1 else "One place"
    count += f", of which the {len(shown)} most severe are listed" if n > len(shown) else ""
    return joined(
        element("p", f"{count}: {parts}.", class_="quiet", id="findings-count"),
        element("ol", *shown, id="findings"),
    )


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
        text = f"{judged.n_elsewhere:,} points of markers are in the truth only. They count as "
        lost = element("p", text + "missed above and are not drawn.", class_="quiet")
    return element(
        "section",
        element("h2", "Comparison with the truth"),
        element("table", *rows),
        lost,
        class_="judged",
    )


def _made(contents: Contents) -> Markup:
    info = [(name, f"{value:,.6g}") for name, value in contents.tracks.info.items()]
    if not (contents.summary or info):
        return Markup()
    parts = [_table(contents.summary)] if contents.summary else []
    if info:
        heading = element("summary", "Figures reported by the method")
        parts.append(element("details", heading, _table(info)))
    return element("section", element("h2", "Method and model"), *parts)


def _table(rows: Sequence[tuple[str, str]]) -> Markup:
    lines = (element("tr", element("th", a, scope="row"), element("td", b)) for a, b in rows)
    return element("table", *lines)


def _drawn(contents: Contents, play: Played) -> Markup:
    d = contents.tracks.detections
    notes = [
        f"Positions are drawn on a grid of {1e3 * play.resolution:.2g} mm; all figures are "
        "computed from the full numbers.",
        contents.connections.about,
    ]
    if d.n_axes == 3:
        notes.append(contents.about_up)
    if contents.tracks.confidence is None:
        notes.append("The tracks have no confidence: the timeline shows presence only.")
    if play.stride > 1:
        notes.append(
            f"Every {_ordinal(play.stride)} frame is shown ({-(-d.n_frames // play.stride):,} of "
            f"{d.n_frames:,}), because a page holds {MOST_POINTS:,} points at most. Figures and "
            "the list of findings are of all frames."
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
        "section", element("h2", "Notes on the drawing"), element("ul", *items, id="notes")
    )


def _ordinal(n: int) -> str:
    return {2: "second", 3: "third"}.get(n, f"{n}th")
