import pytest

from falsifier.context import tokens
from falsifier.context.tokens import tokens_of, written
from falsifier.errors import SpecError

SOURCE = '#define A 1 \\\n 2\n/* two\nlines */ x.y >= 1.5e-3f; // end\n\'a b\' "t\\"" :='


def test_kinds_texts_and_lines() -> None:
    found = list(tokens_of(SOURCE, "a.c"))
    assert [t.text for t in found][1:] == ["x", ".", "y", ">=", "1.5e-3f", ";", "'a b'", '"t\\""', ":="]
    assert [t.kind for t in found] == [
        "directive", "name", "sign", "name", "sign", "number", "sign", "name", "text", "sign"
    ]  # fmt: skip
    assert [t.line for t in found[:2]] == [1, 4]
    assert found[-1].line == 5


def test_what_was_written_is_one_line_with_its_comments() -> None:
    assert written("x; a = // why\n  b;", 3, 18) == "a = /* why */ b;"


def test_length_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tokens, "_MAX_CHARACTERS", 10)
    with pytest.raises(SpecError, match="has 12 characters, more than 10"):
        tokens_of("x" * 12, "a.c")


def test_indented_directives_are_directives() -> None:
    found = list(tokens_of("#if A\n\n  # define B 1\n#endif\nx", "a.c"))
    assert [t.kind for t in found] == ["directive"] * 3 + ["name"]


@pytest.mark.parametrize("source", ["/* " * 1000, '"' + '\\"' * 1000, '"' + '\\"' * 1000 + "\\"])
def test_what_is_not_closed_ends_with_the_source(source: str) -> None:
    assert len(list(tokens_of(source, "a.c"))) <= 1  # one by one, each would be searched up to the end
