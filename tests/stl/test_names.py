import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.stl.names import name_text, scan_name, scan_word


@pytest.mark.parametrize(
    ("text", "name", "rest"),
    [
        ("speed <= 1", "speed", " <= 1"),
        ("a.b[1].c+1", "a.b[1].c", "+1"),
        ("x[1, 2]", "x[1,2]", ""),
        ("der(x)", "der(x)", ""),
        ("der( x , 2 )", "der(x,2)", ""),
        ("der(der(x))-1", "der(der(x))", "-1"),
        ("car.'front left'.v", "car.'front left'.v", ""),
        ('"wheel speed" > 1', "wheel speed", " > 1"),
        (r'"a \"quoted\" \\ one"', r'a "quoted" \ one', ""),
        ("G.x", "G.x", ""),
        ("Größe", "Größe", ""),
        ("$internal", "$internal", ""),
        ("min", "min", ""),
    ],
)
def test_names_are_read_as_models_have_them(text: str, name: str, rest: str) -> None:
    found = scan_name(text, 0)
    assert found is not None
    assert (found[0], text[found[1] :]) == (name, rest)


@pytest.mark.parametrize("text", ["", "1x", "G", "until", "true", "min(x)", "<=", '"open'])
def test_other_things_are_no_names(text: str) -> None:
    assert scan_name(text, 0) is None


def test_der_without_a_signal_is_a_name_like_any_other() -> None:
    assert scan_name("der(1)", 0) == ("der", 3) == scan_name("der <= 1", 0)


@pytest.mark.parametrize(
    ("text", "word"),
    [("G[0,1]", "G"), ("always x", "always"), ("min (x)", "min"), ("min", None), ("G.x", None), ("Gx", None)],
)
def test_words_are_reserved_alone_and_functions_before_a_parenthesis(text: str, word: str | None) -> None:
    assert scan_word(text, 0) == word


def test_names_are_scanned_from_a_position() -> None:
    assert scan_name("x <= y", 5) == ("y", 6)
    assert scan_word("x and y", 2) == "and"


@given(st.text(st.characters(exclude_characters="\n", codec="utf-8"), min_size=1, max_size=20))
def test_any_name_is_written_so_that_it_reads_back(name: str) -> None:
    text = name_text(name)
    assert scan_name(text, 0) == (name, len(text))
