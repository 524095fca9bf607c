import pytest

from falsifier.context.modelica.reader import read_modelica
from falsifier.core.files import bundled
from falsifier.errors import SpecError

SOURCE = """
within Lib;
package P "A package"
  import SI = Modelica.Units;
  partial model Base
    parameter Real limit(min = 0) = 2 * 3 "Where it ends";
  end Base;
  model M "A model"
    extends Base(limit = 7);
    type Mode = enumeration(Off, On);
    input Real u, v[3](each start = 1);
    output Real y = if u > limit then 1 else 0 "Result" annotation(Dialog(tab = "x"));
    replaceable Sub part(k = u) "A part";
    Mode mode;
  protected
    Real x(start = 1);
  initial equation
    x = 0;
  equation
    der(x) = if u > 1 then if v[1] > 2 then x else u else part.y;
    if u > 3 then
      mode = Mode.On;
    elseif x > 4 then
      mode = Mode.Off;
    else
      mode = pre(mode);
    end if;
    connect(part.u, u);
    for i in 1:3 loop
      v[i] = x;
    end for;
  algorithm
    (a, b) := f(x);
    while a > 0 loop
      a := a - 1;
    end while;
  annotation(experiment(StopTime = 1));
  end M;
end P;
"""


def test_declarations() -> None:
    classes = {c.name: c for c in read_modelica(SOURCE, "a.mo")}
    assert set(classes) == {"P", "P.Base", "P.M"}
    found = {d.name: d for d in classes["P.M"].declarations}
    assert list(found) == ["u", "v", "y", "part", "mode", "x"]
    assert found["u"].prefixes == ("input",)
    assert found["v"].text == "input Real v[3](each start = 1)"
    assert (found["y"].value, found["y"].uses) == ("if u > limit then 1 else 0", frozenset({"u", "limit"}))
    assert found["y"].text.endswith('"Result"')
    assert (found["part"].type, found["part"].uses) == ("Sub", frozenset({"u"}))
    assert classes["P.Base"].constants == {"limit": "2 * 3"}
    assert classes["P.M"].bases == ("Base",)
    assert classes["P.M"].definitions == (("Mode", "type Mode = enumeration(Off, On)"),)
    assert classes["P.M"].description == '"A model"'


def test_equations_and_algorithms() -> None:
    (found,) = [c for c in read_modelica(SOURCE, "a.mo") if c.name == "P.M"]
    first, der, branches, connect, loop = found.equations
    assert (first.text, first.sets) == ("x = 0;", frozenset({"x"}))
    assert (der.sets, der.uses) == (frozenset({"x"}), frozenset({"u", "v", "x", "part"}))
    assert [b.head for b in branches.branches] == ["if u > 3 then", "elseif x > 4 then", "else"]
    assert (connect.sets, connect.uses) == (frozenset(), frozenset({"part", "u"}))
    assert loop.branches[0].statements[0].text == "v[i] = x;"
    assert loop.branches[0].statements[0].uses == {"x", "i"}
    assert found.algorithms[0].sets == {"a", "b"}
    assert found.algorithms[1].branches[0].statements[0].text == "a := a - 1;"


def test_every_bundled_source_is_read() -> None:
    folder = bundled("fmus").parent / "modelica"
    for path in sorted(folder.glob("*/*.mo")):
        if path.name not in ("package.mo", "Tables.mo"):
            classes = read_modelica(path.read_text(encoding="utf-8"), path.name)
            assert any(c.name.endswith(path.stem) and (c.declarations or c.bases) for c in classes), path


def test_what_is_not_closed_is_named() -> None:
    with pytest.raises(SpecError, match=r"a\.mo: the model M of line 2 is not closed"):
        read_modelica("\nmodel M\n  Real x;\nequation\n  x = 1;\n", "a.mo")
    with pytest.raises(SpecError, match="classes are nested more than 100 deep"):
        read_modelica("model M " * 200, "a.mo")
    with pytest.raises(SpecError, match="statements are nested more than 100 deep"):
        read_modelica("model M equation " + "if a then " * 300, "a.mo")
    assert read_modelica("this is no Modelica; }{", "a.mo") == ()
