import pytest

from falsifier.context.c_source import c_conditions, c_slice, c_text, read_c
from falsifier.context.thresholds import thresholds
from falsifier.errors import SpecError

SOURCE = """
#include <math.h>
#define ENTER 9.5 /* K */
#define UNUSED 3
#define SQUARE(x) ((x) * (x))
static const double LEAVE = 0.2;
static double hidden;
typedef struct { double speed; } Y;
double limit(double x);
double limit(double x) { return x > 100 ? 100 : x; }
static void other(Model *m) { m->other = 3; }
static void control(Model *m) {
  double e = m->wanted - m->temperature;
  if (m->disagreement > ENTER) { m->limp = 1; m->age = m->time - m->ended; }
  else if (m->limp && m->disagreement < LEAVE)
    m->limp = 0;
  else { m->log++; }
  switch (m->limp) { case 1: m->power = limit(30); break; default: m->power = limit(e * 5); }
  for (int i = 0; i < 3; i++) m->buf[i] = 0;
  do { m->log--; } while (m->log > 0);
}
void step(Model *m) { other(m); control(m); read_sensor(&m->x); m->out.trips += m->temperature >= 64.0; }
void plant(Model *m) { m->temperature = m->temperature + m->power * 0.1; }
"""


def test_only_what_sets_the_signal_is_kept() -> None:
    found = read_c(SOURCE, "a.c")
    part = c_slice(found, ["model.trips"])
    text = c_text(found, part)
    for line in (
        "#define ENTER 9.5 /* K */",
        "static const double LEAVE = 0.2;",
        "  return x > 100 ? 100 : x;",
        "  if (m->disagreement > ENTER) {",
        "    m->limp = 1;",
        "  } else if (m->limp && m->disagreement < LEAVE) {",
        "    case 1:",
        "    break;",
        "  control(m);",
        "  m->out.trips += m->temperature >= 64.0;",
        "/* 1 function left out: no influence on the requirement */",
    ):
        assert line in text.splitlines(), text
    for word in ("UNUSED", "hidden", "other", "buf", "log", "age", "SQUARE"):
        assert word not in text
    assert ("if (m->disagreement > ENTER) {", 14) in list(c_conditions(found, part))


def test_names_and_constants() -> None:
    found = read_c(SOURCE, "a.c")
    assert {"trips", "power", "limp", "log"} <= found.names
    assert found.constants == {"ENTER": "9.5", "UNUSED": "3", "LEAVE": "0.2"}
    assert [f.name for f in found.functions] == ["limit", "other", "control", "step", "plant"]
    assert "double hidden" in c_text(found, None)


def test_macros_name_what_they_set() -> None:
    found = read_c("void f(M *m) { M(speed) = r(u_) * GAIN; }", "a.c")
    assert "speed" in found.names
    assert c_slice(found, ["speed"]).names >= {"speed", "GAIN", "u_"}


def test_what_is_not_closed_is_named() -> None:
    for source, message in (
        ("void f(void) {\n  x = 1;", r"the brace of line 1 is not closed"),
        ("int a[3", r"the bracket \[ of line 1 is not closed"),
        ("void f(void) " + "{" * 300, "nested more than 200 deep"),
        ("void f(void) {" + "if (a) " * 300, "nested more than 200 deep"),
    ):
        with pytest.raises(SpecError, match=f"a.c: .*{message}"):
            read_c(source, "a.c")
    assert read_c("}}; garbage ??", "a.c").functions == ()


def test_macros_of_several_conditions_have_several_values() -> None:
    source = "#ifdef A\n#define L 5\n#else\n#define L 9\n#endif\nvoid f(M *m) { m->y = m->u > L; }"
    found = read_c(source, "a.c")
    assert found.constants == {"L": "5 or 9"}
    assert c_text(found, c_slice(found, ["y"])).splitlines()[:2] == ["#define L 5", "#define L 9"]
    (told,) = thresholds(c_conditions(found, None), found.constants, "a.c")
    assert told.text == "m->u > L (L = 5 or 9)"


def test_functions_within_extern_c_are_read() -> None:
    source = '#ifdef P\nextern "C" {\n#endif\nvoid f(M *m) { m->y = 1; }\nvoid g(M *m) { m->z = 1; }\n}\n'
    assert [f.name for f in read_c(source, "a.c").functions] == ["f", "g"]
