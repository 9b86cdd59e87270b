"""Building of HTML: text is escaped unless it was built here."""

from __future__ import annotations

import html

__all__ = ["Markup", "element", "joined"]

_WITHOUT_CONTENT = {"input", "meta", "link"}


class Markup(str):
    """Text that is already HTML and is not escaped again."""

    __slots__ = ()


def element(tag: str, *children: str, **attributes: str | int | bool | None) -> Markup:
    """Build an element.

    Parameters
    ----------
    tag : str
        Name of the element.
    *children : str
        Content, escaped unless it is `Markup`.
    **attributes : str, int or bool
        Attributes. A trailing underscore is dropped and others become hyphens (``class_``,
        ``data_frame``). True writes the name alone; False and None write nothing.

    Returns
    -------
    Markup
        HTML of the element.

    Examples
    --------
    >>> element("button", "A < B", data_frame=3, title='"')
    '<button data-frame="3" title="&quot;">A &lt; B</button>'
    """
    text = ""
    for name, value in attributes.items():
        if value is None or value is False:
            continue
        plain = name.rstrip("_").replace("_", "-")
        text += f" {plain}" if value is True else f' {plain}="{html.escape(str(value))}"'
    if tag in _WITHOUT_CONTENT:
        return Markup(f"<{tag}{text}>")
    return Markup(f"<{tag}{text}>{joined(*children)}</{tag}>")


def joined(*children: str, between: str = "") -> Markup:
    """Concatenate texts, escaped unless they are `Markup`."""
    safe = (c if isinstance(c, Markup) else Markup(html.escape(c)) for c in children)
    return Markup(between.join(safe))
