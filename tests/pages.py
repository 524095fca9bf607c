"""A page as a tree."""

import re
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

_EMPTY = re.compile(r"<((?:br|hr|img|link|meta)\b[^<>]*)>")


def parse(page: str) -> Element:
    """Return a page's outermost element.

    But for elements without content a page is XML: every element must be closed where it was opened.
    """
    return ElementTree.fromstring(_EMPTY.sub(r"<\1/>", page))


def every(element: Element, tag: str, class_: str = "") -> list[Element]:
    """Return the elements with this tag, and with this class if one is given, in order."""
    return [e for e in element.iter(tag) if not class_ or class_ in e.get("class", "").split()]


def content(element: Element) -> str:
    """Return the text of an element and all within it."""
    return "".join(element.itertext())
