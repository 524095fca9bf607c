import pytest

from falsifier.context import tokens
from falsifier.context.forms import Readable, of_source
from falsifier.context.levels import levels_of

PAGE = """<html><head><title>no</title><style>p {}</style></head><body><h1>1 Limits</h1>
<p>The value of <b>speed</b> stays &lt; 3.</p><script>x()</script><p>Other.</p></body></html>"""
MODEL = """model M
 parameter Real p = 3;
 input Real u;
 Real y;
equation
 y = if u > p then 1 else 0;
end M;"""


def texts(readable: Readable) -> dict[str, str]:
    return {form.name: form.text() for form in readable.forms}


def test_modelica_has_shorter_and_shorter_forms() -> None:
    readable = of_source(MODEL, "a.mo", ["y"], ["y", "u"])
    told = texts(readable)
    assert "y = if u > p" in told["what the requirement depends on"]
    assert told["parameters and comparisons"] == "p = 3\nu > p (p = 3)  [a.mo:6]"
    assert told["comparisons"] == "u > p (p = 3)  [a.mo:6]"
    assert told["name only"] == "class M"
    assert [t.text for t in readable.found] == ["u > p (p = 3)"]


def test_a_class_of_other_signals_is_text_and_that_is_said() -> None:
    readable = of_source(MODEL, "a.mo", ["other"], ["other"])
    assert readable.forms[0].name == "whole; no class declares a signal of the model"


def test_c_that_sets_no_signal_is_told_only_if_it_is_named() -> None:
    source = "void f(M *m) { if (m->a > 3) m->b = 1; }"
    assert texts(of_source(source, "a.c", ["b"], ["b"]))["comparisons"] == "m->a > 3  [a.c:1]"
    named = of_source(source, "a.c", ["other"], ["other"])
    assert named.forms[0].name == "whole, since no function sets a signal of the requirement"
    assert [f.name for f in of_source(source, "a.c", ["o"], ["o"], is_named=False).forms] == ["size only"]


def test_a_source_that_is_too_long_is_text_and_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    source = "void f(void) { speed = 3; }"
    monkeypatch.setattr(tokens, "_MAX_CHARACTERS", 10)
    first = of_source(source, "a.c", ["speed"], ["speed"]).forms[0]
    assert (
        first.name
        == "whole; not understood: has 27 characters, more than 10; split it, and name the part that matters"
    )
    assert "speed = 3;" in first.text()
    hidden = of_source(source, "m.fmu: a.c", ["speed"], ["speed"], is_named=False)
    assert len(hidden.forms) == 1


def test_pages_lose_their_tags() -> None:
    told = texts(of_source(PAGE, "a.html", ["speed"], ["speed"]))
    assert "The value of speed stays < 3." in told["whole"]
    assert "x()" not in told["whole"]
    assert told["paragraphs that name a signal"] == "The value of speed stays < 3."


def test_documents_keep_headings_and_paragraphs_that_name_a_signal() -> None:
    text = "# One\n\nNothing.\n\n## Two\n\nThe plant.speed is\nlimited.\n"
    told = texts(of_source(text, "a.md", ["plant.speed"], ["plant.speed"]))
    assert (
        told["headings, and paragraphs that name a signal"] == "# One\n## Two\n\nThe plant.speed is limited."
    )
    assert told["headings"] == "# One\n## Two"
    assert told["size only"] == "8 lines"


def test_json_is_told_by_its_keys_if_it_is_long() -> None:
    told = texts(of_source('{"a": [1, 2], "b": 3}', "a.json", [], []))
    assert told["keys"] == "a, b"
    assert "size only" in texts(of_source("[1", "a.json", [], []))


def test_json_of_a_single_value_is_told_as_it_is() -> None:
    assert texts(of_source("3.5", "a.json", [], []))["whole"] == "3.5"
    assert texts(of_source("null", "a.json", [], []))["whole"] == "null"


def test_pages_whose_head_is_not_closed_keep_their_text() -> None:
    page = "<html><head><title>no</title><body>The limit is 5 R&D"
    assert texts(of_source(page, "a.html", [], []))["whole"] == "The limit is 5 R&D"


def test_values_that_modifiers_change_are_not_told_as_certain() -> None:
    derived = f"{MODEL}\nmodel D\n extends M(p = 8);\nend D;"
    assert [t.text for t in of_source(derived, "a.mo", ["y"], ["y"]).found] == ["u > p (p = 3 or 8)"]
    part = f"{MODEL}\nmodel D\n M m(p(min = 0) = 4);\n M n(p = f(1, 2), u = 5);\n Real z;\nend D;"
    assert [t.text for t in of_source(part, "a.mo", ["y"], ["y"]).found] == ["u > p (p = 3 or 4 or f(1, 2))"]


def test_a_local_variable_is_not_the_signal_of_its_name() -> None:
    source = (
        "void step(M *m) {\n double u = noise();\n double v = m->v;\n double w;\n"
        " if (u > 3) m->y = 1;\n if (v > 4) m->y = 2;\n if (m->u > 5) m->y = 3;\n if (w > 6) m->y = 4;\n"
        " extern double out; unsigned int a, b[2];\n if (out > 7 || a > 8 || b[0] > 9) m->y = 5;\n}\n"
    )
    found = {t.right: set(t.names) for t in of_source(source, "a.c", ["y"], ["y", "u", "v", "w"]).found}
    assert found == {"3": set(), "4": {"v"}, "5": {"u"}, "6": set(), "7": {"out"}, "8": set(), "9": set()}


@pytest.mark.parametrize(
    ("declared", "levels"),
    [("double y;", [2.5]), ("double x, y, z[3];", [2.5]), ("real_T *y;", [2.5]), ("double y = 0;", [])],
)
def test_a_variable_that_is_declared_before_it_is_set_gives_a_level(
    declared: str, levels: list[float]
) -> None:
    source = f"double f(double u) {{\n {declared}\n y = 2 * u;\n if (y > 0x5) out = 1;\n}}\n"
    read = of_source(source, "a.c", ["out"], ["out", "u"])
    assert [level.value for level in levels_of(read.found, read.known, {"u": (0.0, 10.0)})] == levels


def test_variables_of_other_classes_are_not_the_signals_of_their_names() -> None:
    model = (
        "model Sub\n input Real u;\n Boolean high = u > 3;\nend Sub;\n"
        "model M\n input Real u;\n Real y;\n Sub sub(u = y);\nequation\n"
        " y = if sub.high then u else 0;\nend M;\n"
    )
    (limit,) = of_source(model, "a.mo", ["y"], ["y", "u"]).found
    assert (limit.text, limit.names) == ("u > 3", frozenset())
