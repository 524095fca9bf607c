"""Each literal is read back by its own language as the same text."""

import ast
import re
import tomllib

from hypothesis import given

from falsifier.core import literals
from tests.hostile.names import names


@given(names)
def test_literals_are_read_back_as_the_same_text(name: str) -> None:
    writable = re.sub("[\0\ud800-\udfff]", "\ufffd", name)
    assert ast.literal_eval(literals.python_docstring(name)) == name
    assert tomllib.loads(f"a = {literals.toml_string(name)}")["a"] == writable
    assert re.fullmatch(r'"(?:[^"\\]|\\.)*"', literals.modelica_string(name), re.DOTALL)
    assert re.fullmatch(r"[\w.]+|'(?:[^'\\]|\\.)*'", literals.modelica_path(name), re.DOTALL)


@given(names)
def test_cells_and_lines_are_text(name: str) -> None:
    assert not re.match(r"[=@\t\n]|[+-](?![\d.])", literals.csv_cell(name))
    line = literals.one_line(name)
    assert len(line.splitlines()) <= 1 and not re.search("[\0-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]", line)
    assert "\n" not in literals.markdown_text(name) and "\n" not in literals.markdown_code(name)
    assert not re.search(r"(?<!\\)(?:\\\\)*[<|`\[]", literals.markdown_text(name))
