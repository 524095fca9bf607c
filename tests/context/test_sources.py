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
    return of_source(files[0], files, ["y"])


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
    assert {"x", "mode", "y"} <= source(text, "a.mo").others.keys()


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
