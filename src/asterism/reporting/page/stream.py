"""The page of a stream: the player, and the health of the source."""

from __future__ import annotations

import json

from asterism.plot.style import CLUTTER, CYCLE, MISSED, WRONG
from asterism.reporting.page.head import bundled, document
from asterism.reporting.page.markup import Markup, element

__all__ = ["stream_page"]

_RADIUS = 0.012  # of markers as they are drawn, metres


def stream_page(title: str) -> bytes:
    """Build the page of a stream.

    Parameters
    ----------
    title : str
        Name of the source.

    Returns
    -------
    bytes
        HTML in UTF-8. The page receives its frames from its own server, by ``/frames``.
    """
    script, style = bundled("player.js"), bundled("player.css")
    header = {
        "up": "z", "radius": _RADIUS,
        "colours": {"cycle": CYCLE, "clutter": CLUTTER, "wrong": WRONG, "missed": MISSED},
    }  # fmt: skip
    body = element(
        "body",
        element(
            "main",
            element("div", _top(title), _player(), class_="screen"),
        ),
        # A block of data, which no browser runs; a name cannot end it.
        element(
            "script", Markup(json.dumps(header).replace("<", "\\u003c")), type="text/plain",
            id="live",
        ),
        element("script", Markup(script)),
    )  # fmt: skip
    return document(title, body, style, [script], is_served=True)


def _top(title: str) -> Markup:
    cards = (
        ("rate", "frames of the source"), ("tracks", "tracks"), ("named", "named"),
        ("latency", "median latency"),
    )  # fmt: skip
    return element(
        "header",
        element("p", "Asterism live", class_="brand"),
        element("h1", element("bdi", title)),
        element(
            "dl",
            *(element("div", element("dt", what), element("dd", "–", id=i)) for i, what in cards),
            class_="cards",
        ),
    )


def _player() -> Markup:
    stage = element(
        "div",
        element(
            "canvas", id="scene", tabindex=0, role="img",
            aria_label="Markers in space. Drag to turn; a click selects a marker.",
        ),
        element("canvas", id="names", aria_hidden="true"),
        element(
            "p", "Drag to turn, scroll to zoom, click a marker for its name.", class_="hint",
            aria_hidden="true",
        ),
        element("p", id="scale", class_="scale", aria_hidden="true"),
        element("p", "Waiting for frames …", id="state", role="status"),
        class_="stage",
    )  # fmt: skip
    return element(
        "section",
        element("h2", "Player", class_="hidden"),
        element(
            "div",
            element("div", stage, class_="left"),
            element("div", _health(), class_="right"),
            class_="split",
        ),
        _settings(),
        id="player",
    )


def _health() -> Markup:
    facts = (("clock", "source"), ("model", "models so far"), ("drift", "clock drift"))
    return element(
        "div",
        element("h3", "Latency"),
        element("p", "From the reception of a frame until all sinks have it.", class_="quiet"),
        element("canvas", id="histogram", role="img", aria_label="Histogram of the latency."),
        element("p", id="quantiles", class_="quiet"),
        element("h3", "Source"),
        element(
            "dl",
            *(
                part
                for i, what in facts
                for part in (element("dt", what), element("dd", "–", id=i))
            ),
            class_="facts",
        ),
        element("h3", "Faults"),
        element("p", "None so far.", class_="quiet", id="no-faults"),
        element("ul", id="faults"),
        class_="health",
    )


def _settings() -> Markup:
    tails = [
        element("option", name, value=value, selected=value == "0.5")
        for name, value in (("none", "0"), ("0.5 s", "0.5"), ("1 s", "1"))
    ]
    up = [element("option", axis, value=axis, selected=axis == "z") for axis in "xyz"]
    return element(
        "div",
        _check("show-names", "Names", on=False),
        element("label", "Trails ", element("select", *tails, id="trails")),
        _check("show-clutter", "Clutter"),
        element("label", "Up ", element("select", *up, id="up")),
        _check("follow", "Follow subject"),
        element("button", "Show all", type="button", id="fit"),
        class_="settings",
    )


def _check(name: str, text: str, *, on: bool = True) -> Markup:
    return element("label", element("input", type="checkbox", id=name, checked=on), text)
