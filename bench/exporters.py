"""What users do with an FMU, from first look to replay, on FMUs with the habits of exporters.

``python -m bench.exporters [--out bench/exporters.md]``

The FMUs are the project's own (tests/fixtures/fmus): each has one habit that was seen in FMUs of the exporter
named. A cell says what happened; "replay" runs the exported replay.py, which uses plain fmpy, and compares
its table with the trajectory found here.
"""

import argparse
import csv
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.shrink import shrink
from falsifier.counterexamples.store import to_store
from falsifier.errors import FalsifierError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import evaluate
from falsifier.fmu import read_info
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from falsifier.problem.writing import starter_spec
from falsifier.record.run import falsify
from falsifier.views.model_text import info_text

HERE = Path(__file__).parent
FMUS = HERE.parent / "tests" / "fixtures" / "fmus"
COLUMNS = ("info", "init", "check", "run", "confirm", "shrink", "export", "replay")


@dataclass(frozen=True)
class Habit:
    """One FMU, what it does, and the problem that is solved with it."""

    fmu: str
    exporter: str
    habit: str
    formula: str = "G[0,10] (y <= 5)"
    choices: dict[str, Any] = field(default_factory=dict)


TABLE = {"inputs": {"u": (0.0, 1.0, 2)}}
EXPORTERS = (
    Habit("Lag_2", "any", "none"),
    Habit("NoOutputs_2dymola", "Dymola, OpenModelica, JModelica", "declares no outputs"),
    Habit("HugeLimits_2", "Simulink, Dymola", "1.8e308, 1e30 and INF as limits; no step", "G[0,1] (y <= 1)",
          {"inputs": {"u": (-10.0, 10.0, 3)}}),
    Habit("Aliases_3", "Dymola 2023x", "one value reference with two names", "G[0,10] (plant.u + y <= 5)"),
    Habit("StrictEnd_2", "20-sim", "refuses a step that ends a rounding error after the stop time",
          "G[0,1] (y <= 2)"),
    Habit("StrictEnd_3", "20-sim", "the same in FMI 3", "G[0,1] (y <= 2)"),
    Habit("Corrupts_2", "Dymola 2022x", "the third reset corrupts its memory"),
    Habit("Hangs_2", "in-house tools", "a reset does not return"),
    Habit("Silent_2", "Dymola, Simulink", "silent unless logging is on; the solver fails for u > 5",
          "G[0,10] (y <= 2)"),
    Habit("NeedsTool_2", "tool couplings", "needs the exporting tool"),
    Habit("Table_2", "Dymola, OpenModelica", "reads a file named by a string parameter",
          "G[0,1] (y <= 2)", TABLE),
    Habit("OddNames_2", "SimulationX, OpenModelica", "quotes, backslashes, line breaks, umlauts",
          "G[0,10] (größe.y <= 5)"),
    Habit("Arrays_3", "FMI 3 exporters", "arrays", "G[0,10] (y[1] <= 10.5)",
          {"inputs": {"u[1]": (-1.0, 1.0, 2), "u[2]": (-1.0, 1.0, 2)}}),
    Habit("ClocksAndBinary_3", "FMI 3 exporters", "input clocks and binary variables"),
    Habit("LateStart_2", "any", "the default experiment starts at 5 s"),
    Habit("OtherLibrary_2", "in-house tools", "the library is not called like the model identifier"),
)  # fmt: skip


def main() -> None:
    """Go through all habits and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "exporters.md")
    arguments = parser.parse_args()
    lines = [
        "# From first look to replay, by exporter's habit",
        "",
        "`python -m bench.exporters`. Search with the default engine, at most 40 simulations, seed 0.",
        "",
        "| FMU | exporter | habit | " + " | ".join(COLUMNS) + " |",
        "|---" * (3 + len(COLUMNS)) + "|",
    ]
    for habit in EXPORTERS:
        with tempfile.TemporaryDirectory() as folder:
            cells = _walk(habit, Path(folder))
        shown = (*(cells.get(name, "") for name in COLUMNS),)
        lines.append(f"| {habit.fmu} | {habit.exporter} | {habit.habit} | {' | '.join(shown)} |")
        print(lines[-1], flush=True)
    lines += [
        "",
        "Plain fmpy loads only libraries with the name of the model identifier, which is why OtherLibrary_2 "
        "cannot be replayed with it.",
        "",
    ]
    arguments.out.write_text("\n".join(lines), encoding="utf-8")


def _walk(habit: Habit, folder: Path) -> dict[str, str]:
    """Return what happened in each step; the first one that fails is the last."""
    cells: dict[str, str] = {}

    def step(name: str, action: Callable[[], tuple[str, Any]]) -> Any:
        cells[name], value = action()
        return value

    name = ""
    try:
        for name in COLUMNS[:3]:
            step(name, lambda name=name: _looked(name, habit, folder))  # type: ignore[misc]
        name = "run"
        problem = _problem(habit, folder)
        found: Confirmation = step(name, lambda: _searched(problem))
        cells["confirm"] = found.outcome
        name = "shrink"
        shrunk = shrink(problem, found.evaluation, budget=30)
        cells[name] = f"{shrunk.evaluation.robustness:+.3g}"
        name = "export"
        evaluation = evaluate(problem, found.candidate)
        files = export_counterexample(problem, to_store(found), evaluation, folder / "export")
        cells[name] = f"{len(files)} files"
        name = "replay"
        cells[name] = _replayed(problem, evaluation.trajectory, folder / "export")
        problem.model.close()
    except FalsifierError as error:
        cells[name] = " ".join(str(error).split()).replace("|", "/").replace(f"{FMUS}/", "")
    return cells


def _looked(name: str, habit: Habit, folder: Path) -> tuple[str, None]:
    fmu, spec = FMUS / f"{habit.fmu}.fmu", folder / "my.toml"
    info = read_info(fmu)
    if name == "info":
        return f"ok, {len(info_text(info).splitlines())} lines", None
    if name == "init":
        spec.write_text(starter_spec(fmu, info), encoding="utf-8")
    else:
        spec.write_text(spec.read_text(encoding="utf-8").replace("LIMIT", "5"), encoding="utf-8")
        load_problem(str(spec))
    return "ok", None


def _problem(habit: Habit, folder: Path) -> Problem:
    choices = dict(habit.choices)
    if habit.choices is TABLE:
        (folder / "gain.txt").write_text("2.5")
        choices["parameters"] = {"fileName": str(folder / "gain.txt")}
    return Problem.from_fmu(FMUS / f"{habit.fmu}.fmu", habit.formula, **choices)


def _searched(problem: Problem) -> tuple[str, Confirmation]:
    result = falsify(problem, budget=40)
    if result.counterexample is None:
        raise FalsifierError(f"{result.status}: {result.reason}")
    return result.spent.simulations_text, result.counterexample


def _replayed(problem: Problem, trajectory: Any, folder: Path) -> str:
    script = [sys.executable, str(folder / "replay.py")]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    if done.returncode:
        return f"failed: {re.sub(r'/[^ ]*/(?=binaries/)', '', done.stderr.strip().splitlines()[-1])}"
    with (folder / "outputs.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    table = np.array(rows, dtype=np.float64)
    off = max(
        float(np.abs(table[:, header.index(name)] - trajectory[name]).max())
        for name in problem.experiment.outputs
    )
    return f"differs by {off:.1g}"


if __name__ == "__main__":
    main()
