"""JSON that a language model is asked for, as schemas, and JSON in what it wrote.

Objects are read as they stand, else with mistakes that are unambiguous. A reply has been paid for, so a
trailing comma, a comment or quotes of another kind do not cost another one. What could mean several
things is left to be rejected: objects that are cut off, omissions such as ``...``, and arithmetic.
"""

import json
import re
from collections.abc import Iterator
from typing import Any

_THOUGHT_TAG = re.compile(r"<(/?)think>", re.IGNORECASE)
_OBJECT_START = re.compile(r'\{(?=\s*["}])')
_FENCE = re.compile(r"^ {0,8}```[^\n`]*$", re.MULTILINE)
_COMMENT = re.compile(r"(?://|#)[^\n\]}]*$|/\*[^*]*\*/", re.MULTILINE)
_INNER_LIST = re.compile(r"\[([^\[\]{}\"']*)\]")
_LIST_WORD = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|null|None|true|false", re.ASCII)
# Punctuation of East Asian typing and of word processors.
_PLAIN = str.maketrans("｛｝［］：，＂“”„‘’（）", '{}[]:,""""\'\'()')
# Keywords of a schema that not every server takes.
_LIMITS = frozenset({"minItems", "maxItems", "minimum", "maximum"})
# How often the text of a reply may be read again in search of JSON, counted in its length.
_READINGS = 20
# The repair of a hostile text takes a time that grows with the square of its length.
_LONGEST_REPAIRED = 10_000


def schema_of_object(**properties: Any) -> dict[str, Any]:
    """Return a schema that strict servers take: all keys are required, and no others allowed."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def schema_of_list(
    items: dict[str, Any], least: int | None = None, most: int | None = None
) -> dict[str, Any]:
    """Return the schema of a list, with the number of its items as far as it is limited."""
    limits = {"minItems": least, "maxItems": most}
    return {"type": "array", "items": items, **{k: n for k, n in limits.items() if n is not None}}


def without_limits(schema: Any) -> Any:
    """Return a schema without numbers of items and ranges of numbers, which not every server takes."""
    if isinstance(schema, list):
        return [without_limits(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: without_limits(part) for key, part in schema.items() if key not in _LIMITS}


def objects_in(text: str) -> Iterator[Any]:
    """What a reply may mean outside of its thoughts, the best guess first.

    The last object counts, as reasoning may show drafts before it; then what can be read in one way only.
    """
    text = without_thoughts(text)
    yield from reversed(list(json_objects(text)))
    yield repaired(text)


def without_thoughts(text: str) -> str:
    """The text outside of ``<think> ... </think>``; a thought that does not end stays."""
    kept, start, begun = [], 0, -1
    for tag in _THOUGHT_TAG.finditer(text):
        if not tag[1]:
            begun = tag.start() if begun < 0 else begun
        elif begun >= 0:
            kept.append(text[start:begun])
            start, begun = tag.end(), -1
    return "".join((*kept, text[start:]))


def json_objects(text: str) -> Iterator[dict[str, Any]]:
    """JSON objects that are not inside of others, in order; the time is proportional to the length."""
    # Python refuses to read integers of thousands of digits; as floats they are inf, which is rejected later.
    decoder = json.JSONDecoder(parse_int=float)
    allowance = _READINGS * len(text)
    start = _OBJECT_START.search(text)
    while start is not None and allowance > 0:
        position = start.start()
        try:
            found, end = decoder.raw_decode(text, position)
        except json.JSONDecodeError as error:
            end = position + 1
            # The error counts the lines before it, which is fast but not free.
            allowance -= error.pos - position + len(text) // 1000 + 1
        except RecursionError:
            end = position + 1
            allowance -= len(text)
        else:
            if isinstance(found, dict):
                yield found
        start = _OBJECT_START.search(text, end)


def repaired(text: str) -> Any:
    """What the end of a reply says if it can be read in one way only: an object or a list, else None."""
    text = text[-_LONGEST_REPAIRED:].translate(_PLAIN)
    fences = [fence.end() for fence in _FENCE.finditer(text)]
    if len(fences) >= 2:
        text = text[fences[-2] : fences[-1]].rstrip("`\n ")
    begin = min((at for at in (text.find("{"), text.find("[")) if at >= 0), default=len(text))
    text = text[begin : max(text.rfind("}"), text.rfind("]")) + 1]
    if not text or not _is_clear(text):
        return None
    from json_repair import loads

    try:
        return loads(text, skip_json_loads=False)
    except (ValueError, RecursionError):
        return None


def _is_clear(text: str) -> bool:
    """Whether all brackets are closed and lists of numbers hold nothing but numbers."""
    text = _COMMENT.sub("", text)
    if any(text.count(opening) != text.count(closing) for opening, closing in ("{}", "[]")):
        return False
    words = (word for inner in _INNER_LIST.findall(text) for word in re.split(r"[\s,]+", inner) if word)
    return all(_LIST_WORD.fullmatch(word) for word in words)
