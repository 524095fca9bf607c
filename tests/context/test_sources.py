"""What is told of sources and documents: comparisons with their constants, levels, and shorter forms."""

import pytest

from falsifier.context import sources
from falsifier.context.excerpts import Readable, of_source, of_text
from falsifier.context.sources import Source, read_source
from falsifier.context.thresholds import thresholds, tokens_of
from tests.command import ROOT

MODEL = """model M
 parameter Real p = 3;
 input Real u annotation(Placement(extent = {{0, 0}, {1, 1}}));
 Real y;
equation
 y = if u > p then 1 else 0;
end M;"""
PAGE = """<html><head><title>no</title><style>p {}</style></head><body><h1>1 Limits</h1>
<p>The value of <b>speed</b> stays &lt; 3.</p><script>x()</script><p>Other.</p></body></html>"""


def source(text: str, shown: str) -> Source:
    found = read_source(text, shown)
    assert found is not None
    return found


def read(text: str, shown: str, *more: str, seed: str = "y", is_named: bool = True) -> Readable:
    """Read a file, and more of the same language."""
    files = [source(each, shown) for each in (text, *more)]
    return of_source(files[0], files, [seed], is_named=is_named)


def found(text: str, shown: str, *more: str) -> list[str]:
    return [threshold.text for threshold in read(text, shown, *more).found]


def compared(text: str, **constants: str) -> list[str]:
    return [t.text for t in thresholds(text, constants, "a.mo")]


def levels(readable: Readable) -> list[float]:
    return sorted({level for threshold in readable.found for level in threshold.levels})


def texts(readable: Readable) -> dict[str, str]:
    return dict(readable.forms)


def test_comparisons_with_numbers_and_named_constants() -> None:
    assert compared("u > 9.5 and not v < limit", limit="0.2") == ["u > 9.5", "v < limit (limit = 0.2)"]
    assert compared("(calm - 1) * period < leave / 2", period="0.1") == [
        "(calm - 1) * period < leave / 2 (period = 0.1)"
    ]
    assert compared("y = if pre(x) == 0 then 1 else 2") == ["pre(x) == 0"]
    assert compared("if (m->u >= 3.0f && f(x, 2 < w))") == ["m->u >= 3.0f", "2 < w"]


def test_what_has_no_constant_or_no_variable_is_not_told() -> None:
    assert compared("a > b") == []
    assert compared("1 < 2") == []
    assert compared("a > b", b="c + d") == []
    assert compared("> 3") == []
    assert compared("(u) > 3 and abs(v) > 2 and f(x) and w > 1") == ["(u) > 3", "abs(v) > 2", "w > 1"]
    stated = {"b": "SCALE(7)", "d": "x1", "f": '"version 5"'}
    assert compared("a > b and c > d and e > f", **stated) == ["a > b (b = SCALE(7))"]


def test_names_values_and_place() -> None:
    text = "a;\n/* \n */ m->pause * period < valid;\nm->pause * period < valid;"
    (one,) = thresholds(text, {"valid": "1.5", "period": "0.1"}, "a.c", has_lines=True)
    assert (one.names, one.place) == (frozenset({"pause"}), "a.c:3")


def test_long_values_of_constants_are_not_told() -> None:
    assert compared("a + 1 > b", b="c + " * 100) == ["a + 1 > b"]
    assert compared("a > 3 " + "or b " * 3000) == ["a > 3"]
    assert compared("a > 3 " + "+ b " * 3000) == []


def test_kinds_of_tokens_of_all_languages() -> None:
    tokens = list(tokens_of('/* two\nlines */\n#if A\nx.y >= 1.5e-3f; // end\n\'a b\' "t\\"" :='))
    assert [(t.kind, t.text) for t in tokens] == [
        ("directive", "#if A"), ("name", "x"), ("sign", "."), ("name", "y"), ("sign", ">="),
        ("number", "1.5e-3f"), ("sign", ";"),
        ("name", "'a b'"), ("text", '"t\\""'), ("sign", ":=")
    ]  # fmt: skip


CONSTANTS = {
    "limit": "5 or 9 or something",
    "cast": "((real_T)7.2F)",
    "low": "((float)-7.2)",
    "less": "(c)-7",
    "wide": "(unsigned int)3",
    "pair": "3 4",
}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("u > 9.5", (9.5,)),
        ("-9.5 < (plant.u)", (-9.5,)),
        ("m->u > 1e-3f", (0.001,)),
        ("u > 0x1.8p1", (3.0,)),
        ("u <= limit", (5.0, 9.0)),
        ("limit <= u", (5.0, 9.0)),
        ("(u > 3", (3.0,)),
        ("u > (3)", (3.0,)),
        ("u > cast", (7.2,)),
        ("u < low", (-7.2,)),
        ("u < less", ()),
        ("u < wide", (3.0,)),
        ("u > (long long)- 3", ()),
        ("u > (const unsigned long) 3", (3.0,)),
        ("u > (signed char)-3", (-3.0,)),
        ("u > - 3", (-3.0,)),
        ("u < pair", ()),
        ("u > ( my_real ) .5", (0.5,)),
        ("if (on) u > 3", (3.0,)),
        ("u > (float)v + 3", ()),
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
    text: str, expected: tuple[float, ...]
) -> None:
    assert [t.levels for t in thresholds(text, CONSTANTS, "a.mo") if t.levels] == (
        [expected] if expected else []
    )


C = (ROOT / "tests" / "fixtures" / "control.c").read_text()


def test_comparisons_of_c_with_their_lines() -> None:
    assert [(t.text, t.place) for t in read(C, "a.c").found] == [
        ("x > 100", "a.c:5"),
        ("m->disagreement > ENTER (ENTER = 9.5)", "a.c:8"),
        ("m->disagreement < LEAVE (LEAVE = 0.2)", "a.c:10"),
        ("e > 5", "a.c:17"),
        ("i < 3", "a.c:19"),
    ]


def test_conditions_of_modelica_whatever_class_they_belong_to() -> None:
    text = (
        'within Lib;\npackage P "A package"\n import SI = Modelica.Units;\n partial model Base\n'
        '  parameter Real limit(min = 0) = 2 * 3 "Where it ends";\n end Base;\n'
        ' model M "A model; with a sign"\n  extends Base(limit = 7);\n  type Mode = enumeration(Off, On);\n'
        '  input Real u, v[3](each start = 1);\n  output Real y = if u > limit then 1 else 0 "Result";\n'
        "  Real x;\n  Mode mode;\n equation\n  der(x) = u;\n  if u > 4 then\n   mode = Mode.On;\n"
        "  elseif M.w > 8.5 then\n   mode = Mode.Off;\n  end if;\n end M;\nend P;\n"
    )
    assert [(t.text, sorted(t.names)) for t in read(text, "a.mo").found] == [
        ("u > limit (limit = 2 * 3 or 7)", ["u"]), ("u > 4", ["u"]), ("M.w > 8.5", ["M.w"])
    ]  # fmt: skip
    assert levels(read(text, "a.mo")) == [4.0, 7.0, 8.5]
    assigned = source(text, "a.mo").assigned
    assert {"x", "mode", "y"} <= {each.name for each in assigned if not each.is_constant}


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("void f(void) {\n  y = 1;", "a.c"),
        ("int a[3; y = 4;", "a.c"),
        ("void f(void) " + "{" * 300 + "y = 1;", "a.c"),
        ("}}; garbage ?? y = 1;", "a.c"),
        ("model M\n  Real y;\nequation\n  y = 1;\n", "a.mo"),
        ("model M Real y; equation " + "if a then " * 300 + "y = 1;", "a.mo"),
        ("model M Real y; end if; Gain; end M; }{ connect(", "a.mo"),
        ("model M Real y annotation(", "a.mo"),
    ],
)
def test_what_is_not_closed_or_nested_deep_is_told_all_the_same(text: str, shown: str) -> None:
    assert read(text, shown).forms[0][1] == text.removesuffix(" annotation(").strip()


def test_constants_are_resolved() -> None:
    text = "#ifdef A\n#define L 5\n#else\n#define L 9\n#endif\nvoid f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c") == ["m->u > L (L = 5 or 9)"]
    text = "const double L = 0.5; void f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c") == ["m->u > L (L = 0.5)"]
    assert found(text.replace("const", "constexpr"), "a.cpp") == ["m->u > L (L = 0.5)"]
    assert found(f"{text} void g(M *m) {{ int L = m->v; }}", "a.c") == [], "a variable elsewhere"


def test_values_that_modifiers_change_are_not_told_as_certain() -> None:
    derived = f"{MODEL}\nmodel D\n extends M(p = 8);\nend D;"
    assert found(derived, "a.mo") == ["u > p (p = 3 or 8)"]
    part = f"{MODEL}\nmodel D\n M m(p(min = 0) = 4);\n M n(p = f(1, 2), u = 5);\n Real z;\nend D;"
    assert found(part, "a.mo") == ["u > p (p = 3 or 4 or f(1, 2))"]
    assert found(MODEL, "a.mo", "model D extends M(p = 9); end D;") == ["u > p (p = 3 or 9)"]


def test_a_component_is_not_the_signal_of_its_variable() -> None:
    (limit,) = read("model M\n Sub sub;\nequation\n y = if sub.u > 3 then 1 else u;\nend M;\n", "a.mo").found
    assert limit.names == {"sub.u"}


def test_sources_have_shorter_and_shorter_forms() -> None:
    readable = read(MODEL, "a.mo")
    assert texts(readable) == {
        "whole": MODEL.replace(" annotation(Placement(extent = {{0, 0}, {1, 1}}))", ""),
        "parameters and comparisons": "p = 3\nu > p (p = 3)  [a.mo:6]",
        "lines with the requirement's signals": "Real y;\ny = if u > p then 1 else 0;",
        "size only": "7 lines",
    }
    assert [t.text for t in readable.found] == ["u > p (p = 3)"]


def test_a_source_without_text_is_not_too_long() -> None:
    assert texts(read("", "a.c")) == {"size only": "0 lines"}


def test_a_source_inside_an_fmu_is_told_only_if_it_sets_a_signal() -> None:
    text = "void f(M *m) { if (m->a > 3) m->b = 1; }"
    assert "m->a > 3  [a.c:1]" in texts(read(text, "a.c", seed="b", is_named=False)).values()
    assert list(texts(read(text, "a.c", seed="a", is_named=False))) == ["size only"]
    assert "whole" in texts(read(text, "a.c", seed="o"))


def test_a_source_that_is_too_long_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "_MAX_CHARACTERS", 10)
    assert read_source("void f(void) { speed = u > 3; }", "a.c") is None


def test_pages_lose_their_tags() -> None:
    told = texts(of_text(PAGE, "a.html", ["speed"]))
    assert "The value of speed stays < 3." in told["whole"]
    assert "x()" not in told["whole"]
    assert told["paragraphs that name a signal"] == "The value of speed stays < 3."
    cells = of_text("<table><tr><td>12</td><td>0 <b>V</b> 10<sup>3</sup></table>", "a.html", [])
    assert texts(cells)["whole"] == "12 0 V 10^3"


def test_documents_keep_headings_and_paragraphs_that_name_a_signal() -> None:
    text = "# One\n\nNothing.\n\n## Two\n\nThe plant.speed is\nlimited.\n"
    told = texts(of_text(text, "a.md", ["plant.speed"]))
    assert (
        told["headings, and paragraphs that name a signal"] == "# One\n## Two\n\nThe plant.speed is limited."
    )
    assert told["headings"] == "# One\n## Two"
    assert told["size only"] == "8 lines"
