"""Text of FMUs, servers and language models without what a terminal would act on."""

import re

# Colours, cursor movements and the like; titles, links and clipboard contents with their ends. No character
# that starts a sequence may occur inside one, so that the search stays linear.
_SEQUENCES = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]"
    r"|(?:\x1b[\]PX^_]|[\x90\x98\x9d-\x9f])[^\x07\x1b\x80-\x9f\n]*(?:\x07|\x1b\\|\x9c)"
)
# All other control characters except newline and tab, and characters that hide or reorder text.
_CONTROLS = re.compile(
    r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff\U000e0000-\U000e007f]"
)


def printable(text: str) -> str:
    r"""Return the text without escape sequences, control characters and unpaired surrogates.

    Newlines and tabs stay. Takes a time proportional to the length.

    >>> printable("\x1b[31mred\x1b[0m \x1b]0;title\x07and\r plain")
    'red and plain'
    """
    text = _CONTROLS.sub("", _SEQUENCES.sub("", text))
    return text.encode("utf-8", "replace").decode("utf-8")
