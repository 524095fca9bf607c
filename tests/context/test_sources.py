import pytest

from falsifier.context.forms import Readable, of_source, parsed
from falsifier.context.levels import levels_of
from falsifier.context.sources import Source
from falsifier.core.files import bundled

C = """
#include <math.h>
#define ENTER 9.5 /* K */
#define UNUSED 3
#define SQUARE(x) ((x) * (x))
static const double LEAVE = 0.2;
static double hidden;
typedef struct { double speed; } Y;
double limit(double x);
double limit(double x) { return x > 100 ? 100 : x; }
static void idle(void) { nothing(); }
static void control(Model *m) {
  double e = m->wanted - m->temperature;
  if (m->disagreement > ENTER) {
    m->limp = 1;
    m->age = m->time - m->ended;
  } else if (m->limp && m->disagreement < LEAVE)
    m->limp = 0;
  else {
    m->log++;
  }
  switch (m->limp) {
    case 1:
      m->power = limit(30);
      break;
    default:
      m->power = limit(e * 5);
  }
  for (int i = 0; i < 3; i++) m->buf[i] = 0;
}
void step(Model *m) {
  control(m);
  m->out.trips += m->temperature >= 64.0;
}
void plant(Model *m) { m->temperature = m->temperature + m->power * 0.1; }
"""
MODELICA = """
within Lib;
package P "A package"
  import SI = Modelica.Units;
  partial model Base
    parameter Real limit(min = 0) = 2 * 3 "Where it ends";
  end Base;
  function f
    input Real a;
    output Real b;
  algorithm
    b := if a > 3 then a else 0;
  end f;
  model M "A model"
    extends Base(limit = 7);
    type Mode = enumeration(Off, On);
    input Real u, v[3](each start = 1);
    output Real y = if u > limit then 1 else 0 "Result" annotation(Dialog(tab = "x"));
    Real idle(min = 0);
    Mode mode;
  protected
    Real x(start = 1);
  initial equation
    x = 0;
  equation
    der(x) = f(u);
    if u > 3 then
      mode = Mode.On;
    elseif x > 4 then
      mode = Mode.Off;
    else
      mode = pre(mode);
    end if;
    idle = 2 * y;
  algorithm
    annotation(experiment(StopTime = 1));
  end M;
end P;
"""


def read(text: str, shown: str, seed: str, *more: str) -> Readable:
    return of_source(text, shown, [seed], [seed, *more])


def first_of(readable: Readable) -> list[str]:
    return [line.strip() for line in readable.forms[0].text().splitlines()]


def source(text: str, shown: str) -> Source:
    found = parsed(text, shown)
    assert found is not None
    return found


def test_of_c_only_what_the_signal_depends_on_is_told() -> None:
    lines = first_of(read(C, "a.c", "model.trips"))
    for line in (
        "#define ENTER 9.5 /* K */",
        "static const double LEAVE = 0.2;",
        "double limit(double x) { return x > 100 ? 100 : x; }",
        "if (m->disagreement > ENTER) {",
        "m->limp = 1;",
        "} else if (m->limp && m->disagreement < LEAVE)",
        "case 1:",
        "break;",
        "control(m);",
        "m->out.trips += m->temperature >= 64.0;",
    ):
        assert line in lines, lines
    for word in ("UNUSED", "hidden", "idle", "buf", "log", "age", "SQUARE"):
        assert word not in " ".join(lines)
    assert "statements left out" in lines[-1]


def test_of_modelica_only_what_the_signal_depends_on_is_told() -> None:
    lines = first_of(read(MODELICA, "a.mo", "mode", "y", "u"))
    for line in ("input Real u, v[3](each start = 1);", "elseif x > 4 then", "der(x) = f(u);", "end if;"):
        assert line in lines, lines
    assert "type Mode = enumeration(Off, On);" in lines
    assert "b := if a > 3 then a else 0;" in lines, "a function that is used is told"
    assert not any("idle" in line or "output Real y" in line for line in lines)
    assert 'output Real y = if u > limit then 1 else 0 "Result";' in first_of(read(MODELICA, "a.mo", "idle"))


def test_a_condition_around_a_call_counts_and_a_loop_is_told_with_its_end() -> None:
    text = "void f(M *m) {\n m->y = 1;\n}\nvoid g(M *m) {\n if (m->u > 5) {\n  f(m);\n }\n m->z = 2;\n}\n"
    assert first_of(read(text, "a.c", "y"))[:-1] == [
        "void f(M *m) {", "m->y = 1;", "}", "void g(M *m) {", "if (m->u > 5) {", "f(m);", "}", "...", "}"
    ]  # fmt: skip
    loop = "model M\n Real y, k;\nalgorithm\n while k > 3 loop\n  y := 1;\n end while;\nend M;\n"
    assert first_of(read(loop, "a.mo", "y"))[2:] == [
        "algorithm",
        "while k > 3 loop",
        "y := 1;",
        "end while;",
        "end M;",
    ]


def test_an_unknown_that_nothing_sets_is_met_in_equations() -> None:
    text = "model M\n input Real u;\n Real i;\n Real other;\nequation\n u = 2 * i;\n{}end M;\n"
    assert "u = 2 * i;" in first_of(read(text.format(""), "a.mo", "i"))
    assert "other = i;" not in first_of(read(text.format(" other = i;\n i = 2 * u;\n"), "a.mo", "i"))


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
    readable = read(text, shown, "y")
    assert readable.forms[0].name == "what the requirement depends on"
    assert "y" in readable.forms[0].text()


def test_every_bundled_source_is_read() -> None:
    folder = bundled("fmus").parent / "modelica"
    for path in sorted(folder.glob("*/*.mo")):
        if path.name not in ("package.mo", "Tables.mo"):
            found = source(path.read_text(encoding="utf-8"), path.name)
            assert found.components.get(path.stem) or found.bases.get(path.stem), path


def test_constants_are_resolved() -> None:
    text = "#ifdef A\n#define L 5\n#else\n#define L 9\n#endif\nvoid f(M *m) { m->y = m->u > L; }"
    (told,) = read(text, "a.c", "y").found
    assert told.text == "m->u > L (L = 5 or 9)"
    assert first_of(read(text, "a.c", "y"))[:2] == ["#define L 5", "#define L 9"]
    (told,) = read("const double L = 0.5; void f(M *m) { m->y = m->u > L; }", "a.c", "y").found
    assert told.text == "m->u > L (L = 0.5)"


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
    readable = of_source(step, "a.c", ["y"], ["y", "u"], library=library)
    assert [t.text for t in readable.found] == [
        "ctrl_U.u > ctrl_P.limit (limit = 9.5)", "ctrl_U.u < ctrl_P.inner.low (low = 0.5)"
    ]  # fmt: skip
    levels = levels_of(readable.found, readable.known, {"u": (0.0, 10.0)})
    assert [level.value for level in levels] == [0.5, 9.5]


def test_what_a_structure_gives_first_to_a_signal_is_no_constant() -> None:
    text = "typedef struct { real_T u; } U; U in = { 3.0 };\nvoid f(void) { out.y = in.u > 5; }"
    assert [t.text for t in read(text, "a.c", "y", "u").found] == ["in.u > 5"]


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
    levels = levels_of(readable.found, readable.known, {"u": (0.0, 10.0)})
    assert [level.value for level in levels] == [3.0, 6.0]  # d > 4, and the state x follows its input
