"""What is compared in sources, by what each file says, and the crossings that follow."""

import pytest

from falsifier.context.crossings import crossings_of
from falsifier.context.excerpts import Readable, of_text, parsed
from falsifier.context.sources import Source
from falsifier.core.files import bundled

MODEL = """model M
 parameter Real p = 3;
 input Real u;
 Real y;
equation
 y = if u > p then 1 else 0;
end M;"""


def read(text: str, shown: str, seed: str, *more: str) -> Readable:
    return of_text(text, shown, [seed], [seed, *more])


def found(text: str, shown: str, seed: str, *more: str) -> list[str]:
    return [threshold.text for threshold in read(text, shown, seed, *more).found]


def crossings(readable: Readable) -> list[float]:
    return [crossing.value for crossing in crossings_of(readable.found, readable.known, {"u": (0.0, 10.0)})]


def source(text: str, shown: str) -> Source:
    parsed_source = parsed(text, shown)
    assert parsed_source is not None
    return parsed_source


C = """
#define ENTER 9.5 /* K */
#define SQUARE(x) ((x) * (x))
static const double LEAVE = 0.2;
double limit(double x) { return x > 100 ? 100 : x; }
static void control(Model *m) {
  double e = m->wanted - m->temperature; // "quoted
  if (m->disagreement > ENTER) {
    m->limp = 1;
  } else if (m->limp && m->disagreement < LEAVE)
    m->limp = 0;
  switch (m->limp) {
    case 1:
      m->power = limit(30);
      break;
    default:
      m->power = e > 5;
  }
  for (int i = 0; i < 3; i++) m->buf[i] = 0;
}
"""


def test_comparisons_of_c_with_their_lines() -> None:
    told = read(C, "a.c", "limp", "disagreement")
    assert [(t.text, t.place) for t in told.found] == [
        ("x > 100", "a.c:5"),
        ("m->disagreement > ENTER (ENTER = 9.5)", "a.c:8"),
        ("m->disagreement < LEAVE (LEAVE = 0.2)", "a.c:10"),
        ("e > 5", "a.c:16"),
        ("i < 3", "a.c:19"),
    ]
    assert told.known.equal == {"e": "m->wanted - m->temperature"}


def test_classes_conditions_and_sections_of_modelica() -> None:
    text = (
        'within Lib;\npackage P "A package"\n import SI = Modelica.Units;\n partial model Base\n'
        '  parameter Real limit(min = 0) = 2 * 3 "Where it ends";\n end Base;\n'
        " function f\n  input Real a;\n output Real b;\n algorithm\n  b := if a > 3 then a else 0;\n end f;\n"
        ' model M "A model; with a sign"\n  extends Base(limit = 7);\n  type Mode = enumeration(Off, On);\n'
        '  input Real u, v[3](each start = 1);\n  output Real y = if u > limit then 1 else 0 "Result";\n'
        "  Real x;\n  Real w;\n protected\n  Mode mode;\n initial equation\n  x = 5;\n equation\n"
        "  der(x) = u;\n  w = 2 * u;\n  if u > 4 then\n   mode = Mode.On;\n"
        "  elseif w > 8.5 then\n   mode = Mode.Off;\n  end if;\n end M;\nend P;\n"
    )
    told = read(text, "a.mo", "y", "u")
    assert [(t.text, sorted(t.names)) for t in told.found] == [
        ("a > 3", []), ("u > limit (limit = 2 * 3 or 7)", ["u"]), ("u > 4", ["u"]), ("w > 8.5", ["w"])
    ]  # fmt: skip
    assert told.known.equal["w"] == "2 * u"
    assert not {"x", "mode"} & told.known.equal.keys()
    assert crossings(told) == [4.0, 4.25, 6.0, 7.0]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("void f(void) {\n  y = 1;", "a.c"),
        ("int a[3; y = 4;", "a.c"),
        ("void f(void) " + "{" * 300 + "y = 1;", "a.c"),
        ("void f(void) {" + "if (a) " * 300 + "y = 1;", "a.c"),
        ("#ifdef A\nvoid f(int a) {\n#else\nvoid f(void) {\n#endif\n  y = 3;\n}\n", "a.c"),
        ("}}; garbage ?? y = 1;", "a.c"),
        ("model M\n  Real y;\nequation\n  y = 1;\n", "a.mo"),
        ("model M " * 200 + "Real y;", "a.mo"),
        ("model M Real y; equation " + "if a then " * 300 + "y = 1;", "a.mo"),
        ("model M Real y; end if; end when; end M; end M; }{", "a.mo"),
    ],
)
def test_what_is_not_closed_or_nested_deep_is_told_all_the_same(text: str, shown: str) -> None:
    assert read(text, shown, "y").forms[0].text() == text.strip()


def test_every_bundled_source_is_read() -> None:
    folder = bundled("fmus").parent / "modelica"
    for path in sorted(folder.glob("*/*.mo")):
        if path.name not in ("package.mo", "Tables.mo"):
            text = source(path.read_text(encoding="utf-8"), path.name)
            assert text.scopes[path.stem].components or text.scopes[path.stem].bases, path


def test_constants_are_resolved() -> None:
    text = "#ifdef A\n#define L 5\n#else\n#define L 9\n#endif\nvoid f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c", "y") == ["m->u > L (L = 5 or 9)"]
    text = "const double L = 0.5; void f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c", "y") == ["m->u > L (L = 0.5)"]


HEADER = """
typedef struct P_ctrl_T_ P_ctrl_T;
typedef struct { real_T low; } inner_T;
struct P_ctrl_T_ {
  real_T gain; /* Variable: gain */
  real_T table[2];
  inner_T inner;
  real_T limit, other;
};
"""


@pytest.mark.parametrize(
    "values", ["2.0, { 1.0, 2.0 }, { 0.5 }, 9.5, 3.0", ".limit = 9.5, .inner = { .low = 0.5 }"]
)
def test_fields_of_generated_c_have_the_values_of_another_file(values: str) -> None:
    data = f"P_ctrl_T ctrl_P = {{ {values} }};\nExtU ctrl_U = {{ 0.0 }};\n"
    step = "void step(void) { ctrl_Y.y = ctrl_U.u > ctrl_P.limit || ctrl_U.u < ctrl_P.inner.low; }"
    library = {text: source(text, "a.c") for text in (HEADER, data, step)}
    readable = of_text(step, "a.c", ["y"], ["y", "u"], library=library)
    assert [t.text for t in readable.found] == [
        "ctrl_U.u > ctrl_P.limit (limit = 9.5)", "ctrl_U.u < ctrl_P.inner.low (low = 0.5)"
    ]  # fmt: skip
    assert crossings(readable) == [0.5, 9.5]


def test_what_a_structure_gives_first_to_a_signal_is_no_constant() -> None:
    text = "typedef struct { real_T u; } U; U in = { 3.0 };\nvoid f(void) { out.y = in.u > 5; }"
    assert found(text, "a.c", "y", "u") == ["in.u > 5"]


def test_what_a_variable_equals_has_one_statement_under_no_condition() -> None:
    text = (
        "model M\n input Real u; Real a; Real d = 2 * a; Real e; Real x; Boolean y;\nequation\n"
        " a = u - 1;\n if u > 3 then e = 1; else e = 2; end if;\n der(x) = u;\n"
        " y = d > 4 or e > 5 or x > 6;\nend M;"
    )
    readable = read(text, "a.mo", "y", "u")
    assert readable.known.equal["d"] == "2 * a"
    assert readable.known.equal["a"] == "u - 1"
    assert not {"e", "x"} & readable.known.equal.keys()
    assert crossings(readable) == [3.0, 6.0]  # d > 4, and the state x follows its input


def test_values_that_modifiers_change_are_not_told_as_certain() -> None:
    derived = f"{MODEL}\nmodel D\n extends M(p = 8);\nend D;"
    assert found(derived, "a.mo", "y") == ["u > p (p = 3 or 8)"]
    part = f"{MODEL}\nmodel D\n M m(p(min = 0) = 4);\n M n(p = f(1, 2), u = 5);\n Real z;\nend D;"
    assert found(part, "a.mo", "y") == ["u > p (p = 3 or 4 or f(1, 2))"]


def test_a_local_variable_is_not_the_signal_of_its_name() -> None:
    text = (
        "void step(M *m) {\n double u = noise();\n double v = m->v;\n double w;\n"
        " if (u > 3) m->y = 1;\n if (v > 4) m->y = 2;\n if (m->u > 5) m->y = 3;\n if (w > 6) m->y = 4;\n"
        " extern double out; unsigned int a, b[2];\n if (out > 7 || a > 8 || b[0] > 9) m->y = 5;\n}\n"
    )
    names = {t.right: set(t.names) for t in of_text(text, "a.c", ["y"], ["y", "u", "v", "w"]).found}
    assert names == {"3": set(), "4": {"v"}, "5": {"u"}, "6": set(), "7": {"out"}, "8": set(), "9": set()}


@pytest.mark.parametrize(
    ("declared", "expected"),
    [("double y;", [2.5]), ("double x, y, z[3];", [2.5]), ("real_T *y;", [2.5]), ("double y = 0;", [])],
)
def test_a_variable_that_is_declared_before_it_is_set_gives_a_level(
    declared: str, expected: list[float]
) -> None:
    text = f"double f(double u) {{\n {declared}\n y = 2 * u;\n if (y > 0x5) out = 1;\n}}\n"
    assert crossings(read(text, "a.c", "out", "u")) == expected


def test_variables_of_other_classes_are_not_the_signals_of_their_names() -> None:
    model = (
        "model Sub\n input Real u;\n Boolean high = u > 3;\nend Sub;\n"
        "model M\n input Real u;\n Real y;\n Sub sub(u = y);\nequation\n"
        " y = if sub.high then u else 0;\nend M;\n"
    )
    (limit,) = of_text(model, "a.mo", ["y"], ["y", "u"]).found
    assert (limit.text, limit.names) == ("u > 3", frozenset())


def model(declared: str, equations: str) -> str:
    return f"""model M
  import Modelica.Blocks.*;
  Modelica.Blocks.Interfaces.RealInput u annotation(Placement(extent = {{{{0, 0}}, {{1, 1}}}}));
  output Boolean y;
  parameter Real top = 7;
  {declared}
equation
  {equations}
  y = part.y;
end M;
"""


@pytest.mark.parametrize(
    ("declared", "equations", "told", "expected"),
    [
        ("Logical.Hysteresis part(uLow = 2, uHigh = top);", "connect(u, part.u);",
         ["u > top (top = 7)", "u < 2"], [2.0, 7.0]),
        ("Logical.GreaterThreshold part(threshold = 4);", "connect(part.u, u);", ["u > 4"], [4.0]),
        ("Logical.LessEqualThreshold part;", "part.u = u - 3;", ["u - 3 <= 0"], [3.0]),
        ("Logical.OnOffController part(bandwidth = 2, reference = 5);", "connect(u, part.u);",
         ["u > 5 + 2 / 2", "u < 5 - 2 / 2"], [4.0, 6.0]),
        ("Math.Gain g(k = 2); Logical.GreaterThreshold part(threshold = 5);",
         "connect(u, g.u); connect(g.y, part.u);", ["g.y > 5"], [2.5]),
        ("Tables.CombiTable1Ds part(table = [0, 1; 2.5, 3; 30, 4]);", "connect(u, part.u);",
         ["u leads to a table with the breakpoints 0, 2.5, 30"], [0.0, 2.5]),
        ("Nonlinear.Limiter part(uMax = 6);", "connect(u, part.u);", ["u > 6", "u < -(6)"], [6.0]),
    ],
)  # fmt: skip
def test_blocks_of_the_standard_library_compare_what_leads_to_them(
    declared: str, equations: str, told: list[str], expected: list[float]
) -> None:
    readable = of_text(model(declared, equations), "a.mo", ["y"], ["y", "u"])
    assert [t.text for t in readable.found] == told
    assert crossings(readable) == pytest.approx(expected)


def test_a_component_is_not_the_signal_of_its_variable() -> None:
    text = (
        "model M\n Sub sub;\n input Real u;\n Real y;\nequation\n y = if sub.u > 3 then 1 else u;\nend M;\n"
    )
    (limit,) = of_text(text, "a.mo", ["y"], ["y", "u"]).found
    assert limit.names == {"sub.u"}
