"""JSON objects that show damage: their last key ``sum`` is a checksum of all the text before it."""

import re
from hashlib import sha256

_DIGITS = 16
_SEAL = re.compile(rb',\s*"sum":\s*"([0-9a-f]{16})"\s*\}\s*\Z')


def checksum(content: bytes) -> str:
    """Return the checksum of a content: the first 16 digits of its SHA-256."""
    return sha256(content).hexdigest()[:_DIGITS]


def seal(text: str) -> str:
    r"""Add a checksum to the text of a JSON object that is not empty.

    >>> seal('{"a":1}')
    '{"a":1,"sum":"f52fcad08a1c96f3"}\n'
    """
    body = text.rstrip().removesuffix("}").rstrip()
    separator = ",\n  " if "\n" in body else ","
    colon, end = (": ", "\n}") if "\n" in body else (":", "}")
    return f'{body}{separator}"sum"{colon}"{checksum(body.encode())}"{end}\n'


def check_seal(content: bytes) -> None:
    """Check the checksum of a sealed JSON object.

    Raises:
        ValueError: if it has none, or the content does not match it.
    """
    found = _SEAL.search(content[-100:])
    if found is None:
        raise ValueError("it does not end with a checksum")
    body = content[: found.start() - len(content[-100:])]
    if checksum(body) != found[1].decode():
        raise ValueError("its checksum does not match")
