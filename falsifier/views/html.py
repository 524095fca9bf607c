"""HTML markup; plain text is escaped automatically."""

from base64 import b64encode
from collections.abc import Iterable
from html import escape
from typing import Literal

from falsifier.core.literals import plain

_VOID = frozenset({"br", "hr", "img", "input", "link", "meta"})
# Notebook front ends align table cells to the right by default.
_LEFT = "text-align: left"


class Html(str):
    """Text that is markup already and is not escaped again."""

    __slots__ = ()


def el(tag: str, *children: str, **attributes: str | float | None) -> Html:
    """Make an element; children that are not Html are escaped, attributes always.

    ``class_`` stands for ``class``, other underscores for hyphens; None omits an attribute.

    >>> el("p", "1 < 2", class_="a")
    '<p class="a">1 &lt; 2</p>'
    """
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{_escaped(value)}"'
        for name, value in attributes.items()
        if value is not None
    )
    return Html(f"<{tag}{given}>" + ("" if tag in _VOID else f"{join(*children)}</{tag}>"))


def join(*parts: str) -> Html:
    """Concatenate parts; those that are not Html are escaped."""
    return Html("".join(part if isinstance(part, Html) else _escaped(part) for part in parts))


def table(
    header: Iterable[str], rows: Iterable[Iterable[str]], *, label: str = "", numbers: bool = False
) -> Html:
    """Make a table whose first column names the rows.

    Args:
        header: names of the columns; without any, the table has no head.
        rows: cells.
        label: what it shows; if given, it scrolls in a region of its own, which the keyboard reaches.
        numbers: whether most cells are numbers, which the page aligns; otherwise they are aligned left.
    """
    style = None if numbers else _LEFT
    named = [el("th", name, scope="col", style=style) for name in header]
    body = [
        el("tr", el("th", first, scope="row", style=style), *(el("td", cell, style=style) for cell in rest))
        for first, *rest in rows
    ]
    head = [el("thead", el("tr", *named))] if named else []
    made = el("table", *head, el("tbody", *body), class_="numbers" if numbers else None)
    if not label:
        return made
    return el("div", made, class_="scroll", tabindex="0", role="region", aria_label=label)


def picture(content: bytes, kind: Literal["png", "svg+xml"], description: str) -> Html:
    """Embed a picture; as an image it can neither run scripts nor change the page."""
    data = b64encode(content).decode()
    return el("img", src=f"data:image/{kind};base64,{data}", alt=description, class_="picture")


def _escaped(value: str | float) -> str:
    return escape(plain(value if isinstance(value, str) else f"{value:.6g}"))
