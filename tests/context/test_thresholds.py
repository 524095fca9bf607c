import pytest

from falsifier.context.thresholds import thresholds, tokens_of


def found(text: str, **constants: str) -> list[str]:
    return [t.text for t in thresholds(text, constants, "a.mo")]


def test_comparisons_with_numbers_and_named_constants() -> None:
    assert found("u > 9.5 and not v < limit", limit="0.2") == ["u > 9.5", "v < limit (limit = 0.2)"]
    assert found("(calm - 1) * period < leave / 2", period="0.1") == [
        "(calm - 1) * period < leave / 2 (period = 0.1)"
    ]
    assert found("y = if pre(x) == 0 then 1 else 2") == ["pre(x) == 0"]
    assert found("if (m->u >= 3.0f && f(x, 2 < w))") == ["m->u >= 3.0f", "2 < w"]


def test_what_has_no_constant_or_no_variable_is_not_told() -> None:
    assert found("a > b") == []
    assert found("1 < 2") == []
    assert found("a > b", b="c + d") == []
    assert found("> 3") == []


def test_names_values_and_place() -> None:
    text = "a;\n/* \n */ m->pause * period < valid;\nm->pause * period < valid;"
    (one,) = thresholds(text, {"valid": "1.5", "period": "0.1"}, "a.c", has_lines=True)
    assert (one.names, one.place) == (frozenset({"pause"}), "a.c:3")


def test_long_values_of_constants_are_not_told() -> None:
    assert found("a + 1 > b", b="c + " * 100) == ["a + 1 > b"]
    assert found("a > 3 " + "or b " * 3000) == ["a > 3"]
    assert found("a > 3 " + "+ b " * 3000) == []


def test_kinds_of_tokens_of_all_languages() -> None:
    tokens = list(tokens_of('/* two\nlines */\n#if A\nx.y >= 1.5e-3f; // end\n\'a b\' "t\\"" :='))
    assert [(t.kind, t.text) for t in tokens] == [
        ("directive", "#if A"), ("name", "x"), ("sign", "."), ("name", "y"), ("sign", ">="),
        ("number", "1.5e-3f"), ("sign", ";"),
        ("name", "'a b'"), ("text", '"t\\""'), ("sign", ":=")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("u > 9.5", (9.5,)),
        ("-9.5 < (plant.u)", (-9.5,)),
        ("m->u > 1e-3f", (0.001,)),
        ("u > 0x1.8p1", (3.0,)),
        ("u <= limit", (5.0, 9.0)),
        ("limit <= u", (5.0, 9.0)),
        ("(u > 3", (3.0,)),
        ("u > (3)", (3.0,)),
        ("f(x[i > 3]) > u + 1", (3.0,)),
        ("u > 0x" + 300 * "F", ()),
        ("u > 1e999", ()),
        ("2 * u > 3", ()),
        ("u > 2 * 3", ()),
        ("pre(u) > 3", ()),
        ("u > v + 3", ()),
    ],
)
def test_levels_are_those_of_a_variable_that_is_compared_with_a_number(
    text: str, levels: tuple[float, ...]
) -> None:
    assert [t.levels for t in thresholds(text, {"limit": "5 or 9 or something"}, "a.mo") if t.levels] == (
        [levels] if levels else []
    )
