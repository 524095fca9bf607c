"""XML from files of other people: no document types, so no entities, and limits of depth and size."""

from xml.etree.ElementTree import Element, ParseError, TreeBuilder, XMLParser

from falsifier.errors import SpecError

# Block diagrams are nested some ten levels deep, with two to four elements per level.
_MAX_DEPTH = 400
_MAX_ELEMENTS = 2_000_000


class _RefusedError(ValueError):
    """The document has something that is not read."""


class _Limited(TreeBuilder):
    """Builds a tree, but no deeper and no larger than any file that a tool would write."""

    def __init__(self) -> None:
        super().__init__()
        self._depth = self._elements = 0

    def doctype(self, name: str, _public: str | None, _system: str | None) -> None:
        """Refuse a document type before its entities are read."""
        raise _RefusedError(f"it declares a document type ({name}), which can define entities")

    def start(self, tag: str, attrs: dict[str, str], /) -> Element:
        self._depth += 1
        self._elements += 1
        if self._depth > _MAX_DEPTH:
            raise _RefusedError(f"its elements are nested more than {_MAX_DEPTH} deep")
        if self._elements > _MAX_ELEMENTS:
            raise _RefusedError(f"it has more than {_MAX_ELEMENTS:,} elements")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> Element:
        self._depth -= 1
        return super().end(tag)


def parse_xml(text: bytes, shown: str) -> Element:
    """Return the root element of a document.

    Args:
        text: the document.
        shown: what errors call it.

    Raises:
        SpecError: if it is not well-formed, declares a document type, or is too deep or too large.
    """
    parser = XMLParser(target=_Limited())
    try:
        parser.feed(text)
        root: Element = parser.close()
    except _RefusedError as error:
        raise SpecError(f"{shown}: refused because {error}") from None
    except (ParseError, LookupError, ValueError) as error:  # also an unknown encoding
        raise SpecError(f"{shown}: not well-formed XML ({error})") from None
    return root
