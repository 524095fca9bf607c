"""HTML markup; plain text is escaped automatically."""

from html import escape

from falsifier.core.literals import plain

_VOID = frozenset({"br", "hr", "link", "meta"})


class Html(str):
    """Text that is markup already and is not escaped again."""

    __slots__ = ()


def el(tag: str, *children: str, **attributes: str | float | None) -> Html:
    """Make an element; children that are not Html are escaped, attributes always.

    Args:
        tag: name of the element.
        children: content.
        attributes: ``class_`` stands for ``class``, other underscores for hyphens; None omits an attribute.

    >>> el("p", "1 < 2", class_="a")
    '<p class="a">1 &lt; 2</p>'
    """
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{_escaped(_text(value))}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in _VOID:
        return Html(f"<{tag}{given}>")
    return Html(f"<{tag}{given}>{join(*children)}</{tag}>")


def join(*parts: str) -> Html:
    """Concatenate parts; those that are not Html are escaped."""
    return Html("".join(part if isinstance(part, Html) else _escaped(part) for part in parts))


def _escaped(text: str) -> str:
    return escape(plain(text))


def _text(value: str | float) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"
