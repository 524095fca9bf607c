"""Text of files in the encodings that editors and tools write."""

import codecs
import re

# The mark of UTF-32 begins like that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
# Control characters that no editor writes: what is not UTF-8 and has them is binary.
_CONTROL = re.compile(r"[\x01-\x08\x0e-\x19\x1c-\x1f]")


def text_of(content: bytes) -> str | None:
    """Return the text of a file by the mark it begins with, else UTF-8, Windows-1252 or Latin-1.

    None for binary data.

    >>> text_of("5 K".encode("utf-16")), text_of(bytes([53, 176])), text_of(bytes(4))
    ('5 K', '5°', None)
    """
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        if encoding != "utf-8":
            return None
        text = _western(content)
        if _CONTROL.search(text):
            return None
    return None if "\0" in text else text


def _western(content: bytes) -> str:
    """Return the text in Windows-1252, which has quotes and dashes where Latin-1 has control characters."""
    try:
        return content.decode("cp1252")
    except UnicodeDecodeError:
        return content.decode("latin-1")
