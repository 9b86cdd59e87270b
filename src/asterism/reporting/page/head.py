"""HTML document around the body of a page, and the policy that restricts it."""

from __future__ import annotations

import base64
import hashlib
from importlib import resources
from typing import TYPE_CHECKING

from asterism.reporting.page.markup import Markup, element

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["bundled", "document"]

_ICON = (
    "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 16 16'%3E"
    "%3Cpath d='M3 12 8 3l5 6z' fill='none' stroke='%230072B2'/%3E%3Cg fill='%230072B2'%3E"
    "%3Ccircle cx='3' cy='12' r='2'/%3E%3Ccircle cx='8' cy='3' r='2'/%3E"
    "%3Ccircle cx='13' cy='9' r='2'/%3E%3C/g%3E%3C/svg%3E"
)


def bundled(name: str) -> str:
    """Return a script or a style sheet of the package."""
    return resources.files("asterism.reporting.page").joinpath(name).read_text(encoding="utf-8")


def document(
    title: str, body: Markup, style: str, scripts: Sequence[str], *, is_served: bool
) -> bytes:
    """Build an HTML document.

    Parameters
    ----------
    title : str
        Title of the page.
    body : Markup
        The body, with the scripts in it.
    style : str
        Style sheet.
    scripts : sequence of str
        The scripts that may run.
    is_served : bool
        Whether the page may make requests to its own server.

    Returns
    -------
    bytes
        HTML in UTF-8. Its policy forbids all other requests, scripts and styles.
    """
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element(
            "meta",
            http_equiv="Content-Security-Policy",
            content=_policy(scripts, style, is_served=is_served),
        ),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("meta", name="generator", content="Asterism"),
        element("link", rel="icon", href=_ICON),
        element("title", f"{title} – Asterism"),
        element("style", Markup(style)),
    )
    text = f"<!doctype html>\n{element('html', head, body, lang='en')}\n"
    # Half a surrogate pair, as a damaged name may have, has no place in UTF-8.
    return text.encode("utf-8", errors="replace")


def _policy(scripts: Sequence[str], style: str, *, is_served: bool) -> str:
    """Return a policy that forbids everything but the page's own script, style and server."""

    def hashed(text: str) -> str:
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    connect = "connect-src 'self'; " if is_served else ""
    allowed = " ".join(map(hashed, scripts))
    return (
        f"default-src 'none'; script-src {allowed}; style-src {hashed(style)}; "
        f"img-src data:; {connect}base-uri 'none'; form-action 'none'; "
        "require-trusted-types-for 'script'; trusted-types 'none'"
    )
