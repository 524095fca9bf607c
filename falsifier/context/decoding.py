"""Text of files in the encodings that editors and tools write."""

import codecs

# The mark of UTF-32 begins like that of UTF-16.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def text_of(content: bytes) -> str | None:
    """Return the text of a file by the mark it begins with, else UTF-8 or Latin-1; None for binary data.

    >>> text_of("5 K".encode("utf-16")), text_of(bytes([53, 176])), text_of(bytes(4))
    ('5 K', '5°', None)
    """
    encoding = next((name for mark, name in _MARKS if content.startswith(mark)), "utf-8")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        if encoding != "utf-8":
            return None
        text = content.decode("latin-1")
    return None if "\0" in text else text
