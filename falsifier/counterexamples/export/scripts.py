"""The text of scripts that simulate a counterexample in other tools."""

import shlex
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from math import ceil

from falsifier.core.literals import modelica_path, modelica_string, one_line, python_docstring
from falsifier.core.model import INTERFACE_TAGS, Model
from falsifier.core.words import listed, readable, resolving
from falsifier.counterexamples.export import tables
from falsifier.counterexamples.export.tables import text_of
from falsifier.counterexamples.store import FILE_NAME
from falsifier.evaluation.evaluate import Evaluation
from falsifier.fmu import FmuModel
from falsifier.fmu.description.archive import WINDOWS, this_platform
from falsifier.fmu.description.libraries import can_run_windows
from falsifier.problem.problem import Problem
from falsifier.stl import Verdict
from falsifier.stl.margins import shown, signed

# Rows that replay.py prints before and after the one at which what broke was farthest off.
_SHOWN_ROWS = 3
# Fewest rows that FMPy records in model exchange if an input moves between them.
_MOVING_STEPS = 10_000

_REPLAY_ABOUT = """\
Simulates a counterexample with FMPy only; writes outputs.csv and prints the rows around what broke.

    pip install fmpy
    python replay.py [MODEL.fmu]

{platforms}

{requirement}: {formula}
{recorded}
"""


def replay_script(problem: Problem, evaluation: Evaluation, inputs: Iterable[str]) -> str:
    """Python script for a counterexample of an FMU, which needs only FMPy.

    ``inputs`` are the names of the columns of input.csv after the time.
    """
    model, verdict, experiment = problem.model, evaluation.verdict, problem.experiment
    assert isinstance(model, FmuModel) and verdict is not None, "FMPy simulates FMUs"
    is_co_simulation = model.interface == "co-simulation"
    # FMPy uses the output interval as communication step. If the problem's step is smaller, the script
    # records at that step and keeps every n-th row.
    step = (is_co_simulation and experiment.step_size) or experiment.output_interval
    if not is_co_simulation and any(map(tables.is_curve, evaluation.candidate.signals.values())):
        step /= ceil(_MOVING_STEPS * step / experiment.stop_time)  # FMPy holds inputs between two rows
    about = _REPLAY_ABOUT.format(
        requirement=one_line(problem.name),
        formula=one_line(str(problem.requirement.formula)),
        platforms=f"{_platforms(model)}.",
        recorded=_recorded_lines(verdict),
    )
    named = ["time", *(n for n in experiment.outputs if n in problem.requirement.formula.signals)]
    # The rows differ in time, and what is marked from its limit.
    told = [resolving(verdict.values.get(n, 0.0), shown(verdict.robustness)) for n in named[1:]]
    digits = max(resolving(experiment.stop_time, experiment.output_interval), *told, 0)
    return _template("replay.template").format(
        digits=digits,
        width=digits + 8,
        about=python_docstring(about),
        moment=verdict.moment,
        mark=repr(_mark_of(verdict)),
        fmu=repr(model.path.name),
        refusal=f"sys.exit({refusal!r})\n\n" if (refusal := unplayable(model)) else "",
        fmi_type=INTERFACE_TAGS[model.interface],
        stop_time=experiment.stop_time,
        step=experiment.stop_time / round(experiment.stop_time / step),
        tolerance=experiment.tolerance,
        inputs=repr(list(inputs)),
        outputs=repr({name: tuple(model.place(name)) for name in experiment.outputs}),
        shown=repr(named),
        around=_SHOWN_ROWS,
        every=round(experiment.output_interval / step),
    )


def unplayable(model: Model) -> str:
    """Say that FMPy cannot take the inputs of an FMU, and what to use; empty if it can."""
    sizes: dict[str, int] = {}
    if not isinstance(model, FmuModel):
        return ""
    for name in dict.fromkeys(model.place(v.name)[0] for v in model.info.inputs if v.kind != "string"):
        elements = model.elements(name)
        variable, size = model.info[elements[0]], len(elements)
        why = f"an input named {name!r}" if name == "time" else ""
        if variable.is_continuous and sizes.setdefault(variable.type, size) != size:
            why = f"inputs of the type {variable.type} of different sizes, such as {name!r}"
        elif size > 1 and not variable.is_continuous:
            why = f"arrays of discrete inputs, such as {name!r}"
        if why:
            return f"simulate_fmu of FMPy cannot take {why}: use falsifier replay {FILE_NAME}"
    return ""


def _platforms(model: FmuModel) -> str:
    """Say where FMPy runs an FMU by itself."""
    return f"FMPy runs this FMU on {listed(model.info.platforms)}, for which it has binaries"


def replay_notes(model: Model) -> Iterator[str]:
    """Yield what keeps replay.py from simulating a model here, or anywhere."""
    if refusal := unplayable(model):
        yield refusal
    if isinstance(model, FmuModel) and this_platform() not in model.info.platforms:
        through_wine = WINDOWS in model.info.platforms and can_run_windows()
        wine = ", where it needs a program wine64" if through_wine else ""
        yield f"{_platforms(model)}; this is {this_platform()}{wine}"


def _recorded_lines(verdict: Verdict) -> str:
    """What broke in the recorded simulation, and what decided its robustness."""
    broken = verdict.breach.lines if verdict.breach else ()
    decided = f"decided at t = {readable(verdict.critical_time)} s by {verdict.predicate}"
    return "\n".join(map(one_line, (*broken, f"Recorded robustness {signed(verdict.robustness)}, {decided}")))


def _mark_of(verdict: Verdict) -> str:
    """What stands beside the row to look at."""
    part = verdict.breach.main.part if verdict.breach else verdict.predicate
    return f"  <- {'violated' if verdict.breach else 'decided by'}: {one_line(part)}"


def openmodelica_script(problem: Problem, start: Mapping[str, float | str], *, has_inputs: bool) -> str:
    """OpenModelica script for the model of an FMU, and for an input.csv if there are inputs in it."""
    info = problem.info
    overrides = ",".join(f"{name}={text_of(value, info[name].kind)}" for name, value in start.items())
    flags = ["-csvInput=input.csv"] if has_inputs else []
    flags += [f"-override={overrides}"] if overrides else []
    name = problem.info.name
    return _template("openmodelica.template").format(
        requirement=one_line(problem.name),
        formula=one_line(str(problem.requirement.formula)),
        file=modelica_string(f"{name.split('.')[0]}/package.mo" if "." in name else f"{name}.mo"),
        model=modelica_path(name),
        stop_time=problem.experiment.stop_time,
        intervals=problem.experiment.samples - 1,
        tolerance=f" tolerance={stated!r}," if (stated := problem.experiment.tolerance) else "",
        flags=modelica_string(shlex.join(flags)),  # omc starts the simulation with a shell
    )


def _template(name: str) -> str:
    return files("falsifier.counterexamples.export").joinpath(name).read_text(encoding="utf-8")
