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


class _RefusedError(ValueError):
    """The document has something that is not read."""


class _BegunError(Exception):
    """The first element begins."""


def read_xml(text: bytes, shown: str, wrong: type[ModelError] | type[SpecError]) -> Element:
    """Return the root element of a document.

    Args:
        text: the document.
        shown: what errors call it.
        wrong: the error to raise if it is not well-formed, declares a document type, or is too deep or too
            large.

    Raises:
        ModelError, SpecError: the one that was given.
    """
    try:
        _refuse_size(text)
        _refuse_document_type(text)
        root = ElementTree.fromstring(text)
        _refuse_depth(root)
    except _RefusedError as error:
        raise wrong(f"{shown}: refused because {error}") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # also an unknown encoding
        raise wrong(f"{shown}: not well-formed XML ({error}); export or save it again") from None
    return root


def _refuse_size(text: bytes) -> None:
    if text.count(b"<") > _MAX_SIGNS:
        raise _RefusedError(f"it has more than {_MAX_SIGNS:,} tags; export a smaller model")


def _refuse_document_type(text: bytes) -> None:
    """Look at what stands before the first element, before any entity is read."""
    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = _declared
    parser.StartElementHandler = _begun
    # In one piece: in several, a long tag or comment would be looked at from its beginning with each of them.
    # A fault is reported when the tree is built.
    with suppress(_BegunError, expat.ExpatError, LookupError):
        parser.Parse(text, True)  # noqa: FBT003


def _declared(name: str, *_: object) -> None:
    raise _RefusedError(
        f"it declares a document type ({name}), which can define entities; remove the declaration"
    )


def _begun(_name: str, _attributes: object) -> None:
    raise _BegunError


def _refuse_depth(root: Element) -> None:
    level = [root]
    for _ in range(_MAX_DEPTH):
        level = [child for element in level for child in element]
        if not level:
            return
    raise _RefusedError(f"its elements are nested more than {_MAX_DEPTH} deep; export it again")
