"""Docstrings as the site shows them: code in fences, descriptions of pydantic fields as their docstrings."""

import ast
import re
from typing import Any

from griffe import Attribute, Docstring, Extension, Object

# Lines from a prompt to the next empty line; lines further to the right after a ``::``.
_PROMPTS = re.compile(r"^>>> .*(?:\n\S.*)*", re.MULTILINE)
_LITERAL = re.compile(r"::\n\n((?:(?: {4}.*)?\n)*(?: {4}.*))")
_DESCRIPTION = re.compile(r"^Field\(.*\bdescription=('[^']*'|\"[^\"]*\")")
_DOCTEST_OPTION = re.compile(r" *# doctest:.*")


class Examples(Extension):
    """Rewrites docstrings when they are read."""

    def on_instance(self, *, obj: Object, **_: Any) -> None:
        """Put code into fences."""
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)

    def on_attribute_instance(self, *, attr: Attribute, **_: Any) -> None:
        """Take the description of a pydantic field."""
        if attr.docstring is None and (described := _DESCRIPTION.search(str(attr.value or ""))):
            attr.docstring = Docstring(ast.literal_eval(described[1]), parent=attr)


def fenced(text: str) -> str:
    """Return a docstring's text with its code in fences."""
    text = _PROMPTS.sub(lambda code: f"```pycon\n{_DOCTEST_OPTION.sub('', code[0])}\n```", text)
    return _LITERAL.sub(
        lambda code: f":\n\n```python\n{re.sub('^ {4}', '', code[1], flags=re.MULTILINE)}\n```", text
    )
