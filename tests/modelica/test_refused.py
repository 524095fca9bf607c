"""What the exporter does not support is an error that names file and line, never a wrong FMU."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from tests.modelica.conftest import ROOT, exporter_python

# name: (body of the model, line of the error, part of the message)
CASES = {
    "syntax": ("  Real x\nequation\n  x = 1;", 3, "syntax error"),
    "garbage_at_the_end": ("  Real x;\nequation\n  x = 1;\nend M;\nmodl N", 6, "syntax error"),
    "algebraic_loop": ("  Real x;\n  Real y;\nequation\n  x = y + 1;\n  y = x * 2;", 6, "algebraic loop"),
    "self_loop": ("  Real x;\nequation\n  x = 0.5 * x + sin(x);", 4, "cannot be solved"),
    "nonlinear": ("  Real x;\nequation\n  x ^ 3 = 2;", 4, "cannot be solved"),
    "too_few": ("  Real x;\n  Real y;\nequation\n  x = 1;", 3, "no equation for y"),
    "too_many": ("  Real x;\nequation\n  x = 1;\n  x = 2;", 5, "one equation too many"),
    "unknown_name": ("  Real x;\nequation\n  x = time + nothing;", 4, "no variable 'nothing'"),
    "unknown_function": ("  Real x;\nequation\n  x = delight(time);", 4, "no class 'delight'"),
    "unknown_class": ("  Modelica.Blocks.Sources.Sine s;\nequation", 2, "Standard Library is not available"),
    "delay": ("  Real x;\nequation\n  x = delay(time, 1);", 4, "'delay' is not supported"),
    "string": ('  parameter String s = "a";\nequation', 2, "String variables are not supported"),
    "connect": ("  Real x;\nequation\n  connect(x, x);", 4, "connect"),
    "flow": ("  flow Real x;\nequation\n  x = 1;", 2, "'flow'"),
    "inner": ("  inner Real x;\nequation\n  x = 1;", 2, "'inner' is not supported"),
    "replaceable": ("  replaceable Real x;\nequation\n  x = 1;", 2, "'replaceable' is not supported"),
    "conditional": ("  Real x if true;\nequation\n  x = 1;", 2, "conditional components"),
    "external": ('  function f\n    output Real y;\n    external "C";\n  end f;\n  Real x = f();\nequation', 4, "external"),
    "while_in_model": ("  Real x;\nalgorithm\n  while x < 1 loop\n    x := x + 1;\n  end while;", 4, "'while'"),
    "equality_of_reals": ("  Real x;\nequation\n  x = if time == 1 then 1 else 2;", 4, "between Reals"),
    "sample_in_expression": ("  Boolean b;\nequation\n  b = sample(0, 1);", 4, "'sample'"),
    "sample_that_varies": ("  Integer n(start=0);\nequation\n  when sample(0, time) then\n    n = 1;\n  end when;", 4, "parameters"),
    "der_of_expression": ("  Real x;\nequation\n  der(2 * x) = 1;", 4, "needs a variable"),
    "unequal_branches": ("  Real x;\n  Real y;\nequation\n  if time > 1 then\n    x = 1;\n  else\n    y = 1;\n  end if;", 5, "every branch"),
    "real_into_integer": ("  Integer n;\nequation\n  n = 2.5 * time;", 4, "integer(...)"),
    "boolean_arithmetic": ("  Real x;\nequation\n  x = 1 + true;", 4, "numbers"),
    "size_mismatch": ("  Real x[2];\nequation\n  x = {1, 2, 3};", 4, "sizes"),
    "subscript_out_of_range": ("  Real x[2];\nequation\n  x[1] = 1;\n  x[3] = 2;", 5, "outside of 1..2"),
    "wrong_attribute": ("  Real x(strat = 1);\nequation\n  x = 1;", 2, "no attribute 'strat'"),
    "wrong_modifier": ("  model A\n    Real y = 1;\n  end A;\n  A a(z = 2);\nequation", 5, "no component 'z'"),
    "redeclare": ("  model A\n    Real y = 1;\n  end A;\n  A a(redeclare Real y = 2);\nequation", 5, "'redeclare'"),
    "missing_argument": (
        "  function f\n    input Real a;\n    output Real y;\n  algorithm\n    y := a;\n  end f;\n  Real x;\nequation\n  x = f();",
        10, "argument 'a' of 'f' is missing",
    ),
    "array_arithmetic_in_function": (
        "  function f\n    input Real a[2];\n    output Real y;\n  algorithm\n    y := sum(a * 2);\n  end f;\n  Real x;\nequation\n  x = f({1, 2});",
        6, "use a loop",
    ),
    "parameter_without_value": ("  parameter Real p;\n  Real x = p;\nequation", 2, "has no value"),
    "parameter_that_varies": ("  Real x = time;\n  parameter Real p = x;\nequation", 3, "may only depend on parameters"),
    "circular_parameters": ("  parameter Real p = q;\n  parameter Real q = p;\nequation", 2, "depends on itself"),
    "initial_algorithm": ("  Real x;\ninitial algorithm\n  x := 1;\nequation\n  der(x) = 1;", 3, "initial algorithm"),
    "comprehension": ("  Real x[3];\nequation\n  x = {i for i in 1:3};", 4, "'for'"),
    "wrong_solver_setting": (
        "  Real x = 1;\nequation\n  annotation(__falsifier_solver(stepp = 0.1));", 4, "stepp",
    ),
    "reinit_of_no_state": ("  Real x = time;\nequation\n  when time > 1 then\n    reinit(x, 1);\n  end when;", 5, "not a state"),
    "when_in_if": (
        "  Real x(start = 0);\nequation\n  if time > 2 then\n    when time > 3 then\n      x = 1;\n    end when;\n  end if;",
        5, "'when' inside of 'if'",
    ),
    "pre_of_a_continuous_variable": ("  Real x = time;\n  Real y = pre(x);\nequation", 3, "when clause"),
    "equation_for_an_input": ("  input Real u;\nequation\n  u = 1;", 4, "no unknown variable"),
}  # fmt: skip

PROGRAM = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from export.cli import translate
from export.syntax import ExportError
found = {}
for path in sorted(Path(sys.argv[2]).glob("*.mo")):
    try:
        translate(path, "M")
        found[path.stem] = "translated"
    except ExportError as error:
        found[path.stem] = str(error)
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The exporter's message for every case, from one process."""
    folder = tmp_path_factory.mktemp("refused")
    for name, (body, _, _) in CASES.items():
        (folder / f"{name}.mo").write_text(f"model M\n{body}\nend M;\n")
    command = [exporter_python(), "-c", PROGRAM, str(ROOT / "modelica"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", CASES)
def test_refused_with_file_and_line(messages: dict[str, str], name: str) -> None:
    _, line, part = CASES[name]
    assert messages[name].startswith(f"{name}.mo:{line}: ")
    assert part in messages[name]


def test_a_missing_file_and_a_missing_model_are_named(tmp_path: Path) -> None:
    from tests.modelica.conftest import run_exporter

    done = run_exporter("M", "--source", str(tmp_path / "none.mo"))
    assert done.returncode == 1
    assert "none.mo does not exist" in done.stderr
    done = run_exporter("Nothing")
    assert done.returncode == 1
    assert "there is no model 'Nothing'" in done.stderr
