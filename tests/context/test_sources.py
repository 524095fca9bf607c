"""What is compared in sources, and at which levels, by what each file says."""

import pytest

from falsifier.context.excerpts import Readable, of_source, source_of
from falsifier.context.sources import Source

MODEL = """model M
 parameter Real p = 3;
 input Real u;
 Real y;
equation
 y = if u > p then 1 else 0;
end M;"""


def source(text: str, shown: str) -> Source:
    found = source_of(text, shown)
    assert found is not None
    return found


def read(text: str, shown: str, *more: str) -> Readable:
    """Read a file, and more of the same language."""
    files = [source(each, shown) for each in (text, *more)]
    return of_source(files[0], files, ["y"], ["y", "u"])


def found(text: str, shown: str, *more: str) -> list[str]:
    return [threshold.text for threshold in read(text, shown, *more).found]


def levels(readable: Readable) -> list[float]:
    return sorted({level for threshold in readable.found for level in threshold.levels})


C = """
#define ENTER 9.5 /* K */
#define SQUARE(x) ((x) * (x))
static const double LEAVE = 0.2;
double limit(double x) { return x > 100 ? 100 : x; }
static void control(const Model *m) {
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
    assert [(t.text, t.place) for t in read(C, "a.c").found] == [
        ("x > 100", "a.c:5"),
        ("m->disagreement > ENTER (ENTER = 9.5)", "a.c:8"),
        ("m->disagreement < LEAVE (LEAVE = 0.2)", "a.c:10"),
        ("e > 5", "a.c:17"),
        ("i < 3", "a.c:19"),
    ]
    assert source(C, "a.c").names_set == {"e", "limp", "power", "buf"}


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
    assert {"x", "mode", "y"} <= source(text, "a.mo").names_set


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("void f(void) {\n  y = 1;", "a.c"),
        ("int a[3; y = 4;", "a.c"),
        ("void f(void) " + "{" * 300 + "y = 1;", "a.c"),
        ("P p = {1, {2; struct P {", "a.c"),
        ("}}; garbage ?? y = 1;", "a.c"),
        ("model M\n  Real y;\nequation\n  y = 1;\n", "a.mo"),
        ("model M Real y; equation " + "if a then " * 300 + "y = 1;", "a.mo"),
        ("model M Real y; end if; Hysteresis part; Gain; end M; }{ connect(", "a.mo"),
        ("Limiter a", "a.mo"),
        ("model M Real y annotation(", "a.mo"),
        ("", "a.mo"),
    ],
)
def test_what_is_not_closed_or_nested_deep_is_told_all_the_same(text: str, shown: str) -> None:
    assert read(text, shown).forms[0][1] == text.removesuffix(" annotation(").strip()


def test_constants_are_resolved() -> None:
    text = "#ifdef A\n#define L 5\n#else\n#define L 9\n#endif\nvoid f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c") == ["m->u > L (L = 5 or 9)"]
    text = "const double L = 0.5; void f(M *m) { m->y = m->u > L; }"
    assert found(text, "a.c") == ["m->u > L (L = 0.5)"]


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
    "values", ["2.0, { 1.0, 2.0 }, { 0.5 }, /* limit */ 9.5, 3.0", ".limit = 9.5, .inner = { .low = 0.5 }"]
)
def test_fields_of_generated_c_have_the_values_of_another_file(values: str) -> None:
    data = f"P_ctrl_T ctrl_P = {{ {values} }};\nExtU ctrl_U = {{ 0.0 }};\n"
    step = "void step(void) { ctrl_Y.y = ctrl_U.u > ctrl_P.limit || ctrl_U.u < ctrl_P.inner.low; }"
    readable = read(step, "a.c", HEADER, data)
    assert [t.text for t in readable.found] == [
        "ctrl_U.u > ctrl_P.limit (limit = 9.5)", "ctrl_U.u < ctrl_P.inner.low (low = 0.5)"
    ]  # fmt: skip
    assert levels(readable) == [0.5, 9.5]


def test_what_a_structure_gives_first_to_a_signal_is_no_constant() -> None:
    text = "typedef struct { real_T u; } U; U in = { 3.0 };\nvoid f(void) { out.y = in.u > 5; }"
    assert found(text, "a.c") == ["in.u > 5"]


def test_values_that_modifiers_change_are_not_told_as_certain() -> None:
    derived = f"{MODEL}\nmodel D\n extends M(p = 8);\nend D;"
    assert found(derived, "a.mo") == ["u > p (p = 3 or 8)"]
    part = f"{MODEL}\nmodel D\n M m(p(min = 0) = 4);\n M n(p = f(1, 2), u = 5);\n Real z;\nend D;"
    assert found(part, "a.mo") == ["u > p (p = 3 or 4 or f(1, 2))"]
    assert found(MODEL, "a.mo", "model D extends M(p = 9); end D;") == ["u > p (p = 3 or 9)"]


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
        ("Logical.Hysteresis part(uLow = 2, final uHigh = top);", "connect(u, part.u);",
         ["u > top (top = 7)", "u < 2"], [2.0, 7.0]),
        ("Logical.GreaterThreshold part(threshold = 4);", "connect(part.u, u);", ["u > 4"], [4.0]),
        ("Logical.LessEqualThreshold part;", "part.u = u - 3;", ["u - 3 <= 0"], []),
        ("Logical.OnOffController part(bandwidth = 2, reference = 5);", "connect(u, part.u);",
         ["u > 5 + 2 / 2", "u < 5 - 2 / 2"], []),
        ("Tables.CombiTable1Ds part(table = [0, 1; 2.5, 3; 30, 4]);", "connect(u, part.u);",
         ["u leads to a table with the breakpoints 0, 2.5, 30"], [0.0, 2.5, 30.0]),
        ("Nonlinear.Limiter part(uMax = 6);", "connect(u, part.u);", ["u > 6", "u < -(6)"], [6.0]),
    ],
)  # fmt: skip
def test_blocks_of_the_standard_library_compare_what_leads_to_them(
    declared: str, equations: str, told: list[str], expected: list[float]
) -> None:
    readable = read(model(declared, equations), "a.mo")
    assert [t.text for t in readable.found] == told
    assert levels(readable) == pytest.approx(expected)


def test_a_component_is_not_the_signal_of_its_variable() -> None:
    (limit,) = read("model M\n Sub sub;\nequation\n y = if sub.u > 3 then 1 else u;\nend M;\n", "a.mo").found
    assert limit.names == {"sub.u"}
