"""XML from files of other people: no document types, so no entities, and limits of depth and size.

Everything is checked before or after a tree is built, not while: a builder in Python would take half as long
again for a description of 100,000 variables.
"""

from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from falsifier.errors import ModelError, SpecError

# Files of tools are nested some ten levels deep, block diagrams with two to four elements per level.
_MAX_DEPTH = 400
# A description of 100,000 variables has some 400,000 signs, two or three per element.
_MAX_SIGNS = 6_000_000
_CHUNK = 1 << 16


class _RefusedError(ValueError):
    """The document has something that is not read."""


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
    declared: list[str] = []
    begun: list[str] = []
    parser.StartDoctypeDeclHandler = lambda name, *_: declared.append(name)
    parser.StartElementHandler = lambda name, _: begun.append(name)
    try:
        for start in range(0, len(text), _CHUNK):
            parser.Parse(text[start : start + _CHUNK])
            if declared or begun:
                break
    except (expat.ExpatError, LookupError, ValueError):
        pass  # the same fault is reported when the tree is built
    if declared:
        raise _RefusedError(
            f"it declares a document type ({declared[0]}), which can define entities; remove the declaration"
        )


def _refuse_depth(root: Element) -> None:
    level = [root]
    for _ in range(_MAX_DEPTH):
        level = [child for element in level for child in element]
        if not level:
            return
    raise _RefusedError(f"its elements are nested more than {_MAX_DEPTH} deep; export it again")
