"""XML from files of other people: no document types, so no entities, and limits of depth and size.

Everything is checked before or after a tree is built, not while: a builder in Python would take half as long
again for a description of 100,000 variables.
"""

from contextlib import suppress
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from falsifier.errors import ModelError, SpecError

# Files of tools are nested some ten levels deep, block diagrams with two to four elements per level.
_MAX_DEPTH = 400
# A description of 100,000 variables has some 400,000 signs, two or three per element.
_MAX_SIGNS = 6_000_000


class _SeenError(Exception):
    """What comes before the first element has been seen."""


def read_xml(text: bytes, shown: str, wrong: type[ModelError] | type[SpecError]) -> Element:
    """Return the root element of a document.

    Errors call the document ``shown``.

    Raises:
        ModelError, SpecError: the one that is ``wrong``, if it is not well-formed, declares a type, or
            is too deep or too large.
    """
    refused = f"{shown}: refused because it"
    if text.count(b"<") > _MAX_SIGNS:
        raise wrong(f"{refused} has more than {_MAX_SIGNS:,} tags; export a smaller model")
    if (declared := _document_type(text)) is not None:
        raise wrong(
            f"{refused} declares a document type ({declared}), which can define entities; remove the "
            "declaration"
        )
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # also an unknown encoding
        raise wrong(f"{shown}: not well-formed XML ({error}); export or save it again") from None
    level = [root]
    for _ in range(_MAX_DEPTH):
        level = [child for element in level for child in element]
        if not level:
            return root
    raise wrong(f"{refused} has elements nested more than {_MAX_DEPTH} deep; export it again")


def _document_type(text: bytes) -> str | None:
    """Return the document type that is declared before the first element; no entity is read for that."""
    found: list[str] = []

    def declared(name: str, *_: object) -> None:
        found.append(name)
        raise _SeenError

    def begun(*_: object) -> None:
        raise _SeenError

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = declared
    parser.StartElementHandler = begun
    # In one piece: in several, a long tag or comment would be looked at from its beginning with each of them.
    # A fault is reported when the tree is built.
    with suppress(_SeenError, expat.ExpatError, LookupError, ValueError):
        parser.Parse(text, True)  # noqa: FBT003
    return found[0] if found else None
