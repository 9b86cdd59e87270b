"""A figure's SVG made fit to stand inside a page of strict rules, beside others."""

from __future__ import annotations

import re

__all__ = ["inline"]

_STYLE = re.compile(r'\sstyle="([^"]*)"')
_ID = re.compile(r'(\sid="|href="#|url\(#)')


def inline(svg: str, name: str) -> str:
    """Give an SVG file as an element of an HTML page.

    A strict policy forbids style attributes and style sheets within figures, so what they say is
    said by presentation attributes, which a page's style sheet can also change in the dark. Names
    inside the figure are made its own: two figures of a page may not share any.

    Parameters
    ----------
    svg : str
        The file.
    name : str
        Put before the names inside the figure.
    """
    element = svg[svg.index("<svg") :].rstrip()
    element = re.sub(r"<metadata>.*?</metadata>\s*", "", element, flags=re.DOTALL)
    element = re.sub(r"<defs>\s*<style[^>]*>.*?</style>\s*</defs>\s*", "", element, flags=re.DOTALL)
    element = re.sub(r"<!--.*?-->\s*", "", element, flags=re.DOTALL)
    element = _STYLE.sub(lambda found: _attributes(found[1]), element)
    element = _ID.sub(rf"\g<1>{name}-", element)
    # What matplotlib's own style sheet, taken out above, says of all elements.
    head = '<svg role="img" stroke-linejoin="round" stroke-linecap="butt"'
    return head + element.removeprefix("<svg")


def _attributes(style: str) -> str:
    """Turn ``fill: #fff; stroke: none`` into attributes."""
    pairs = (pair.split(":", 1) for pair in style.split(";") if ":" in pair)
    return "".join(f' {key.strip()}="{value.strip()}"' for key, value in pairs)
