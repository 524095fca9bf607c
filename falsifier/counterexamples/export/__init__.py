"""Counterexamples as files for people and other tools; ``docs/counterexamples.md`` lists the files."""

import shutil
from pathlib import Path

from falsifier.core.files import file_name, write_whole
from falsifier.counterexamples.export import tables
from falsifier.counterexamples.export.components import write_components, write_package
from falsifier.counterexamples.export.scripts import openmodelica_script, replay_script
from falsifier.counterexamples.store import FILE_NAME, StoredCounterexample, save
from falsifier.evaluation.evaluate import Evaluation
from falsifier.fmu import FmuModel, System
from falsifier.problem.problem import Problem
from falsifier.record.files import make_folder


def export_counterexample(
    problem: Problem, stored: StoredCounterexample, evaluation: Evaluation, directory: Path
) -> list[Path]:
    """Write a counterexample for other tools; return the files.

    Files that do not apply are omitted: input.csv if the model has no inputs, the simulation scripts if the
    model is not an FMU. The evaluation is a current simulation of it. The directory is created if missing.
    """
    make_folder(directory)
    candidate = evaluation.candidate
    table, start = tables.input_table(problem, candidate), tables.start_values(problem, candidate)
    files = [
        save(stored, directory / FILE_NAME),
        tables.write_json(start, directory / "start_values.json", problem.model),
        tables.write_ssv(
            start,
            problem.name,
            directory / "start_values.ssv",
            problem.info,
            named=not isinstance(problem.model, System),
        ),
        tables.write_mat(table, start, directory / "inputs.mat"),
    ]
    if table.columns:
        files.append(tables.write_csv(table, directory / "input.csv", problem.model))
    if isinstance(problem.model, FmuModel):
        columns = tables.file_columns(table, problem.model)
        files += [
            # Next to the scripts, which then need nothing else of this machine.
            shutil.copyfile(problem.model.path, directory / problem.model.path.name),
            write_whole(directory / "replay.py", replay_script(problem, evaluation, columns)),
            write_whole(
                directory / "replay.mos", openmodelica_script(problem, start, has_inputs=bool(columns))
            ),
        ]
    if isinstance(problem.model, System):
        inside = {file.name: file for file in files if file.name in ("input.csv", "start_values.ssv")}
        target = directory / f"{file_name(problem.model.name)}.ssp"
        files.append(write_package(problem.model, problem.experiment.stop_time, inside, target))
        files += write_components(problem, candidate, directory)
    return files
