"""Counterexamples as files that people and other tools read.

::

    counterexample.json         for falsifier itself
    input.csv                   input signals: FMPy, fmusim, OpenModelica
    start_values.json, .ssv     parameters and start values: scripts; tools that read SSP parameter sets
    replay.py                   simulates both with FMPy alone, into outputs.csv, and prints what decided
    replay.mos                  the same in OpenModelica, from the Modelica model
    inputs.mat                  input signals and start values for Simulink
    test_NAME.py                a pytest that fails while the counterexample violates
"""

from pathlib import Path

from falsifier.counterexamples.export.inputs import input_table, start_values
from falsifier.counterexamples.export.scripts import openmodelica_script, pytest_file, replay_script
from falsifier.counterexamples.export.tables import write_csv, write_json, write_mat, write_ssv
from falsifier.counterexamples.store import FILE_NAME, StoredCounterexample, save
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem

__all__ = ["export_counterexample"]


def export_counterexample(
    problem: Problem, stored: StoredCounterexample, evaluation: Evaluation, directory: Path
) -> list[Path]:
    """Write a counterexample for other tools; return the files.

    What does not apply is left out: input.csv of a model without inputs, the scripts that simulate an FMU
    where the model is none, the pytest file where the problem cannot be loaded from a file.

    Args:
        problem: what it violates.
        stored: the counterexample.
        evaluation: today's simulation of it.
        directory: where to write; it is made.
    """
    directory.mkdir(parents=True, exist_ok=True)
    table, start = input_table(problem, evaluation.candidate), start_values(problem, evaluation.candidate)
    files = [
        save(stored, directory / FILE_NAME),
        write_json(start, directory / "start_values.json"),
        write_ssv(start, problem.name, directory / "start_values.ssv"),
        write_mat(table, start, directory / "inputs.mat"),
    ]
    if table.columns:
        files.append(write_csv(table, directory / "input.csv"))
    scripts = {
        "replay.py": replay_script(problem, evaluation, directory),
        "replay.mos": openmodelica_script(problem, start),
        f"test_{_identifier(problem.name)}.py": pytest_file(stored),
    }
    for name, text in scripts.items():
        if text is not None:
            (directory / name).write_text(text, encoding="utf-8")
            files.append(directory / name)
    return files


def _identifier(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name)
