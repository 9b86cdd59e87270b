"""HTML of the player; its behaviour is in the bundled script."""

from __future__ import annotations

from typing import TYPE_CHECKING

from asterism.reporting.page.markup import Markup, element, joined

if TYPE_CHECKING:
    from collections.abc import Mapping

    from asterism.reporting.page.contents import Contents

__all__ = ["keys_table", "player"]

_KEYS = (
    ("Space", "play, pause"),
    ("← →", "one frame back or forward; ten with Shift"),
    ("Home, End", "first and last frame"),
    ("N, P", "next and previous place"),
    ("[ ]", "previous and next track, in the order of the timeline"),
    ("F", "follow the selected track"),
    ("Esc", "clear the selection"),
    ("L", "names on and off"),
    ("W A S D", "turn the view"),
    ("+ −", "zoom in and out"),
    ("0", "show the whole scene"),
    ("M", "show the subject and follow it"),
)


def player(contents: Contents, lists: Markup) -> Markup:
    """Build the player with its timeline and both lists of places."""
    solid = contents.tracks.detections.n_axes == 3
    does = "turn" if solid else "move"
    hint = f"Drag to {does}, scroll to zoom, click a marker to select it."
    stage = element(
        "div",
        element(
            "canvas", id="scene", tabindex=0, role="img",
            aria_label="Markers in space. Drag to turn; a click or [ and ] select a marker.",
        ),
        element("canvas", id="names", aria_hidden="true"),
        element("p", hint, class_="hint", aria_hidden="true"),
        element("p", id="scale", class_="scale", aria_hidden="true"),
        element("p", "Unpacking …", id="state", role="status"),
        class_="stage",
    )  # fmt: skip
    return element(
        "section",
        element("h2", "Player", class_="hidden"),
        element(
            "noscript",
            element("p", "The player needs JavaScript; all figures and reasons do not."),
        ),
        element(
            "div",
            element("div", stage, _chosen(), _transport(), class_="left"),
            element(
                "div", _camera(contents), element("div", lists, class_="places"), class_="right"
            ),
            class_="split",
        ),
        _settings(contents, solid),
        _timeline(contents),
        id="player",
    )


def _transport() -> Markup:
    speeds = [
        element("option", f"{s:g} ×", value=f"{s:g}", selected=s == 1)
        for s in (0.05, 0.1, 0.25, 0.5, 1, 2, 4)
    ]
    return element(
        "div",
        _button("play", "▶", "Play"),
        _button("back", "‹", "One frame back"),
        _button("on", "›", "One frame forward"),
        element(
            "input", type="range", id="frame", min=0, max=0, value=0, step=1, aria_label="Frame"
        ),
        element("output", "", id="clock", for_="frame"),
        element("select", *speeds, id="speed", aria_label="Speed"),
        class_="transport",
    )


def _button(name: str, sign: str, label: str) -> Markup:
    return element("button", sign, type="button", id=name, aria_label=label, title=label)


def _chosen() -> Markup:
    return element(
        "div",
        element("h3", "Selected marker", class_="hidden"),
        element("dl", id="chosen"),
        element("label", element("input", type="checkbox", id="follow"), "Follow it"),
        element("button", "×", type="button", id="release", aria_label="Clear the selection"),
        id="about",
        hidden=True,
    )


def _camera(contents: Contents) -> Markup:
    if contents.rig is None:
        return Markup()
    options = [
        element("option", camera.name or f"{i + 1}", value=i)
        for i, camera in enumerate(contents.rig.cameras)
    ]
    return element(
        "div",
        element(
            "label", "Through camera ", element("select", *options, id="camera"), class_="heading"
        ),
        element("canvas", id="image", role="img", aria_label="Markers in the image of the camera"),
        element("p", id="image-count", class_="quiet"),
        class_="camera",
    )


def _settings(contents: Contents, solid: bool) -> Markup:
    tails = [
        element("option", name, value=value, selected=value == "0.5")
        for name, value in (("none", "0"), ("0.5 s", "0.5"), ("2 s", "2"), ("10 s", "10"))
    ]
    colours = [element("option", by, value=by) for by in ("track", "segment")]
    up = [element("option", axis, value=axis, selected=axis == contents.up) for axis in "xyz"]
    parts = [
        _check("show-names", "Names", on=False),
        element("label", "Trails ", element("select", *tails, id="trails")),
        element("label", "Colours ", element("select", *colours, id="colours")),
        _check("show-lines", "Bonds"),
        _check("show-clutter", "Clutter"),
    ]
    if contents.judgement is not None:
        parts.append(_check("show-truth", contents.judgement.against.capitalize()))
    if contents.rig is not None:
        parts.append(_check("show-cameras", "Cameras"))
    if solid:
        parts.append(element("label", "Up ", element("select", *up, id="up")))
    parts.append(_check("track-subject", "Follow subject"))
    parts.append(element("button", "Show all", type="button", id="fit"))
    return element("div", *parts, class_="settings")


def _check(name: str, text: str, *, on: bool = True) -> Markup:
    return element("label", element("input", type="checkbox", id=name, checked=on), text)


def _timeline(contents: Contents) -> Markup:
    orders = [
        element("option", text, value=value)
        for value, text in (("trouble", "severity"), ("first", "first frame"), ("name", "name"))
    ]
    signs = [("seen", "seen")]
    if contents.tracks.identity_confidence is not None:
        signs = [("fading", "identity confidence, 100 % to 50 %")]
    elif contents.tracks.confidence is not None:
        signs = [("fading", "link confidence, 100 % to 50 %")]
    if contents.judgement is not None:
        is_truth = contents.judgement.against == "truth"
        signs.append(("wrong", "wrong marker" if is_truth else "differs from the other result"))
        signs.append(("missed", "missed (in clutter)" if is_truth else "only in the other result"))
    signs.append(("gap", "gap"))
    legend = [
        joined(element("i", class_=f"sign {name}", aria_hidden="true"), text)
        for name, text in signs
    ]
    return element(
        "div",
        element(
            "div",
            element("h3", "Timeline"),
            element("ul", *(element("li", entry) for entry in legend), class_="legend"),
            element("label", "Sorted by ", element("select", *orders, id="order")),
            class_="bar",
        ),
        element(
            "div",
            element(
                "canvas", id="strips", tabindex=0, role="img",
                aria_label="Presence of each track over time. A click goes to that time; arrows up "
                "and down select a track.",
            ),
            element("div", id="rows", aria_hidden="true"),
            id="timeline",
        ),
        class_="times",
    )  # fmt: skip


def keys_table(added: Mapping[str, str]) -> Markup:
    """Return the table of the keys, with those of the editor."""
    return element(
        "details",
        element("summary", "Keys"),
        element(
            "dl",
            *(
                element("div", element("dt", element("kbd", keys)), element("dd", what))
                for keys, what in {**dict(_KEYS), **added}.items()
            ),
        ),
        class_="keys",
        id="keys",
    )
