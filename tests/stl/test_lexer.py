import pytest

from falsifier.errors import FormulaError
from falsifier.stl.lexer import syntax_error, tokenize


def kinds(text: str) -> list[tuple[str, str]]:
    return [(t.kind, t.text) for t in tokenize(text)]


def test_a_formula_falls_into_numbers_names_and_symbols() -> None:
    assert kinds("G[0,1.5e1] (a.b[1] <= .5)") == [
        ("symbol", "G"),
        ("symbol", "["),
        ("number", "0"),
        ("symbol", ","),
        ("number", "1.5e1"),
        ("symbol", "]"),
        ("symbol", "("),
        ("name", "a.b[1]"),
        ("symbol", "<="),
        ("number", ".5"),
        ("symbol", ")"),
        ("end", ""),
    ]


@pytest.mark.parametrize(
    ("written", "spelling"),
    [
        ("always", "G"),
        ("eventually", "F"),
        ("until", "U"),
        ("next", "X"),
        ("&&", "and"),
        ("|", "or"),
        ("!", "not"),
        ("=>", "->"),
        ("<=>", "<->"),
    ],
)
def test_each_operator_has_one_spelling(written: str, spelling: str) -> None:
    (token, _) = tokenize(written)
    assert (token.text, token.written, token.kind) == (spelling, written, "symbol")


def test_the_longest_symbol_is_taken() -> None:
    assert [t for _, t in kinds("a<->b<-c")] == ["a", "<->", "b", "<", "-", "c", ""]


def test_tokens_know_where_they_stand() -> None:
    tokens = tokenize("  x >= 12  ")
    assert [(t.position, t.end) for t in tokens] == [(2, 3), (4, 6), (7, 9), (9, 9)]
    assert [t.shown for t in tokens] == ["'x'", "'>='", "'12'", "the end"]


@pytest.mark.parametrize(
    ("text", "position", "hint"),
    [("x = 1", 3, "=="), ("x ≤ 1", 3, "<="), ("x # 1", 3, "quotes"), ("'x <= 1", 1, "single quote")],
)
def test_a_character_that_begins_nothing_is_pointed_at_with_a_hint(
    text: str, position: int, hint: str
) -> None:
    with pytest.raises(FormulaError) as caught:
        tokenize(text)
    first, line, caret, last = str(caught.value).splitlines()
    assert f"position {position}" in first
    assert line == f"  {text}"
    assert caret.index("^") == 2 + position - 1
    assert hint in last


def test_of_several_lines_the_one_in_question_is_shown() -> None:
    error = syntax_error("x <= 1\nand y <=   \nor z", "something is missing", 14, "write it")
    assert str(error).splitlines()[1:3] == ["  and y <=", "         ^"]
