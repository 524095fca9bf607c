"""The text of scripts that simulate a counterexample in other tools."""

import json
from collections.abc import Mapping

from falsifier.counterexamples.store import StoredCounterexample
from falsifier.evaluation.evaluate import Evaluation
from falsifier.fmu import FmuModel
from falsifier.problem.problem import Problem

# Rows that replay.py prints before and after the critical time.
_SHOWN_ROWS = 3
_FMPY_TYPES = {"co-simulation": "CoSimulation", "model-exchange": "ModelExchange"}

_REPLAY = '''\
"""Simulates a counterexample with FMPy only; writes outputs.csv and prints the rows at the critical time.

    pip install fmpy
    python replay.py [MODEL.fmu]

{requirement}: {formula}
Recorded robustness {robustness:+.6g}, decided at t = {critical_time:.6g} s by {predicate}
"""

import csv
import json
import sys
from pathlib import Path

import numpy
from fmpy import simulate_fmu

HERE = Path(__file__).resolve().parent
# Name of each output: the FMU's variable, and the element if that is an array.
OUTPUTS = {outputs}
FMU = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / {fmu}


def read_inputs():
    """Read input.csv; cells of arrays hold all elements. Unlike with fmpy, names may contain commas."""
    lines = (HERE / "input.csv").read_text(encoding="utf-8").splitlines()
    names, *rows = csv.reader(lines)
    cells = [[tuple(map(float, cell.split())) for cell in row] for row in rows]
    sizes = [len(cell) for cell in cells[0]]
    columns = [(n, float, (size,)) if size > 1 else (n, float) for n, size in zip(names, sizes)]
    return numpy.array([tuple(c if len(c) > 1 else c[0] for c in row) for row in cells], columns)


result = simulate_fmu(
    str(FMU),
    validate=False,
    fmi_type="{fmi_type}",
    start_time=0.0,
    stop_time={stop_time!r},
    output_interval={step!r},
    relative_tolerance={tolerance!r},
    record_events=False,
    start_values=json.loads((HERE / "start_values.json").read_text()),
    input={inputs},
    output=sorted({{variable for variable, _ in OUTPUTS.values()}}),
)[::{every}]
columns = {{"time": result["time"]}}
for name, (variable, element) in OUTPUTS.items():
    columns[name] = result[variable].reshape(len(result), -1)[:, element]

lines = [",".join(f'"{{name}}"' if "," in name else name for name in columns)]
lines += [",".join(repr(float(value)) for value in row) for row in zip(*columns.values())]
(HERE / "outputs.csv").write_text("\\n".join(lines) + "\\n")

shown = {shown}
critical = int(abs(result["time"] - {critical_time!r}).argmin())
print("".join(f"{{name:>14}}" for name in shown))
for k in range(max(critical - {around}, 0), min(critical + {around} + 1, len(result))):
    values = "".join(f"{{float(columns[name][k]):14.6g}}" for name in shown)
    print(values + ("  <- critical time" if k == critical else ""))
print(f"all {{len(result)}} rows are in outputs.csv next to this script")
'''

_OPENMODELICA = """\
// Simulates a counterexample in OpenModelica, from the Modelica model that the FMU was exported from:
//     omc replay.mos
// First set the path of the model in loadFile, and in simulate its full name if it differs from the FMU's.
//
// {requirement}: {formula}
loadFile("{file}");
simulate({model}, startTime=0, stopTime={stop_time!r}, numberOfIntervals={intervals},
  outputFormat="csv", simflags="{flags}");
getErrorString();
"""

_PYTEST = '''\
"""Fails as long as the counterexample in this folder violates {requirement}."""

from pathlib import Path

from falsifier.counterexamples.store import load, problem_of, replay

FILE = Path(__file__).with_name("counterexample.json")


def test_{name}_is_no_longer_violated() -> None:
    stored = load(FILE)
    replayed = replay(stored, problem_of(stored))
    assert replayed.status != "violates", replayed.text
'''


def replay_script(problem: Problem, evaluation: Evaluation) -> str | None:
    """Python script that needs only FMPy; None if the model is not an FMU."""
    model, verdict, experiment = problem.model, evaluation.verdict, problem.experiment
    if not isinstance(model, FmuModel) or verdict is None:
        return None
    is_co_simulation = model.interface == "co-simulation"
    # FMPy uses the output interval as communication step. If the problem's step is smaller, the script
    # records at that step and keeps every n-th row.
    step = (is_co_simulation and experiment.step_size) or experiment.output_interval
    return _REPLAY.format(
        requirement=problem.name,
        formula=" ".join(str(problem.requirement.formula).split()),
        robustness=verdict.robustness,
        critical_time=verdict.critical_time,
        predicate=verdict.predicate,
        fmu=json.dumps(model.path.name),
        fmi_type=_FMPY_TYPES[model.interface],
        stop_time=experiment.stop_time,
        step=experiment.stop_time / round(experiment.stop_time / step),
        tolerance=experiment.tolerance,
        inputs="read_inputs()" if _has_inputs(problem) else "None",
        outputs=json.dumps({name: model.place(name) for name in experiment.outputs}),
        shown=json.dumps(
            ["time", *(n for n in experiment.outputs if n in problem.requirement.formula.signals)]
        ),
        around=_SHOWN_ROWS,
        every=round(experiment.output_interval / step),
    )


def openmodelica_script(problem: Problem, start: Mapping[str, float | str]) -> str | None:
    """OpenModelica script; None if the model is not an FMU."""
    if not isinstance(problem.model, FmuModel):
        return None
    texts = {name: value if isinstance(value, str) else repr(value) for name, value in start.items()}
    overrides = ",".join(f"{name}={text}" for name, text in texts.items())
    flags = ["-csvInput=input.csv"] if _has_inputs(problem) else []
    flags += [f"-override={overrides}"] if overrides else []
    name = problem.info.name
    return _OPENMODELICA.format(
        requirement=problem.name,
        formula=" ".join(str(problem.requirement.formula).split()),
        file=f"{name.split('.')[0]}/package.mo" if "." in name else f"{name}.mo",
        model=name,
        stop_time=problem.experiment.stop_time,
        intervals=problem.experiment.samples - 1,
        flags=" ".join(flags),
    )


def pytest_file(stored: StoredCounterexample) -> str | None:
    """Test of the counterexample file next to it; None if its problem cannot be loaded from a file."""
    if stored.problem is None:
        return None
    name = "".join(c if c.isalnum() else "_" for c in stored.requirement)
    return _PYTEST.format(requirement=stored.requirement, name=name.lower())


def _has_inputs(problem: Problem) -> bool:
    return any(v.kind != "string" for v in problem.info.inputs)
