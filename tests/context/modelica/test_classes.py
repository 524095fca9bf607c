from falsifier.context.modelica.classes import (
    class_for,
    class_text,
    conditions,
    slice_of,
    used_classes,
    with_bases,
)
from falsifier.context.modelica.reader import read_modelica

SOURCE = """
model Base
  parameter Real limit = 9.5 "Where it begins";
  Real x;
equation
  der(x) = u;
end Base;
function f
  input Real a;
  output Real b;
algorithm
  b := if a > 3 then a else 0;
end f;
model M "Both"
  extends Base;
  extends Elsewhere.Other;
  input Real u;
  output Real y, z;
  Real idle;
equation
  when x > limit then
    y = f(x);
    idle = 3;
  end when;
  z = idle;
end M;
"""
CLASSES = read_modelica(SOURCE, "a.mo")


def test_the_class_with_most_of_the_names_is_chosen() -> None:
    found = class_for(CLASSES, ["u", "y", "nothing"])
    assert found is not None
    assert found.name == "M"
    assert class_for(CLASSES, ["nothing"]) is None


def test_the_text_has_what_the_signal_depends_on() -> None:
    found = with_bases(CLASSES[-1], CLASSES)
    part = slice_of(found, ["y"])
    assert class_text(found, part).splitlines() == [
        'model M "Both"',
        '  parameter Real limit = 9.5 "Where it begins";',
        "  Real x;",
        "  input Real u;",
        "  output Real y;",
        "equation",
        "  der(x) = u;",
        "  when x > limit then",
        "    y = f(x);",
        "  end when;",
        "// 2 declarations left out: no influence on the requirement",
        "// extends Elsewhere.Other, which was not read",
    ]
    assert [c.name for c in used_classes(found, part, CLASSES)] == ["f"]
    assert ("when x > limit then", 21) in list(conditions(found, part))
    assert "idle" in class_text(found, None)


def test_a_component_stands_for_its_variables() -> None:
    (found,) = read_modelica("model A\n Sub p;\n Real y;\nequation\n y = 1;\n p.x = y;\nend A;", "a.mo")
    assert slice_of(found, ["p.x.z"]).names == {"p", "y"}
