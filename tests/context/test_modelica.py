import pytest

from falsifier.context.forms import of_source
from falsifier.context.levels import levels_of


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
    ("declared", "equations", "told", "levels"),
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
    declared: str, equations: str, told: list[str], levels: list[float]
) -> None:
    readable = of_source(model(declared, equations), "a.mo", ["y"], ["y", "u"])
    assert [t.text for t in readable.found] == told
    found = levels_of(readable.found, readable.known, {"u": (0.0, 10.0)})
    assert [level.value for level in found] == pytest.approx(levels)
    text = readable.forms[0].text()
    assert "Placement" not in text
    assert "RealInput u;" in text


def test_the_class_with_most_of_the_names_is_told_with_its_bases() -> None:
    text = (
        "model Base\n Real x;\n parameter Real limit = 9.5;\nequation\n der(x) = u;\nend Base;\n"
        "model M\n extends Lib.Base;\n input Real u;\n output Real y, z;\n Real idle;\nequation\n"
        " y = x > limit;\n z = idle;\nend M;\n"
    )
    readable = of_source(text, "a.mo", ["y"], ["y", "u"])
    lines = readable.forms[0].text()
    assert "extends Lib.Base;" in lines
    assert "parameter Real limit = 9.5;" in lines
    assert "der(x) = u;" in lines
    assert "idle" not in lines
    assert [t.text for t in readable.found] == ["x > limit (limit = 9.5)"]


def test_a_component_is_not_the_signal_of_its_variable() -> None:
    text = (
        "model M\n Sub sub;\n input Real u;\n Real y;\nequation\n y = if sub.u > 3 then 1 else u;\nend M;\n"
    )
    (limit,) = of_source(text, "a.mo", ["y"], ["y", "u"]).found
    assert limit.names == {"sub.u"}
