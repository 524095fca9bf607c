"""What requirements in words are about: a model and its experiment, and the spec that they are written to."""

import tomllib
from dataclasses import dataclass, replace
from os.path import relpath
from pathlib import Path
from typing import Any

import tomlkit

from falsifier.core.files import bundled
from falsifier.errors import FormulaError, SpecError
from falsifier.fmu import is_package, read_info, read_package
from falsifier.problem.grid import fitting_interval
from falsifier.problem.joining import join
from falsifier.problem.loading import find_spec, load_source
from falsifier.problem.problem import Problem
from falsifier.problem.requirement import PLACEHOLDER, parse_requirement
from falsifier.problem.source import MODEL_FILES, ProblemSource
from falsifier.problem.spec import parse_spec, read_spec
from falsifier.problem.starter import starter_spec
from falsifier.stl import Formula, parse

# Name of the requirement in a starter spec, which is to be replaced.
_STARTED = "R1"


@dataclass(frozen=True, slots=True)
class Subject:
    """A model that a new requirement is about.

    Attributes:
        problem: model, ranges and experiment; its requirement is another one.
        spec: spec file to write to; None for a bundled spec, which stays as it is.
        folder: folder to which paths in the spec are relative.
        text: content of that file, or of a starter spec.
        is_new: whether the file is a starter, whose requirement is a placeholder.
        free_grid: whether the output interval may follow the formula.
    """

    problem: Problem
    spec: Path | None
    folder: Path
    text: str
    is_new: bool
    free_grid: bool

    @property
    def is_started(self) -> bool:
        """Whether its first requirement is a starter's, still without its number."""
        return _has_placeholder(tomllib.loads(self.text))

    def parsed(self, text: str) -> tuple[Formula, Problem]:
        """Return a formula that fits, and the problem with the time grid on which it is judged.

        Raises:
            SpecError: with the position of the mistake, the unknown signal, or the window that does not fit.
        """
        problem = self.problem
        if self.free_grid:
            try:
                fits = fitting_interval(
                    parse(text), problem.experiment.stop_time, problem.experiment.output_interval
                )
            except FormulaError as error:
                raise SpecError(str(error)) from None
            if fits is not None:
                problem = replace(problem, experiment=replace(problem.experiment, output_interval=fits))
        return parse_requirement(text, problem.info, problem.experiment), problem


def subject_of(target: str) -> Subject:
    """Return what a spec, a bundled name or an FMU says of the model.

    Raises:
        SpecError: if the target is none of these.
        ModelError: if the FMU cannot be read.
    """
    if target.endswith(MODEL_FILES):
        return _of_model(Path(target))
    path, requirement = find_spec(target)
    spec = read_spec(path)
    name = requirement or next(iter(spec.requirements))
    is_bundled = path.parent == bundled("specs")
    text = path.read_text(encoding="utf-8-sig")
    if name == _STARTED and _has_placeholder(tomllib.loads(text)):
        problem = problem_of_starter(text, path)
    else:
        problem = load_source(ProblemSource(target=f"{path}:{name}"))
    intervals = [spec.model.output_interval, spec.requirements[name].output_interval]
    return Subject(
        problem,
        None if is_bundled else path,
        path.parent,
        text,
        is_new=False,
        free_grid=intervals == [None, None],
    )


def _of_model(fmu: Path) -> Subject:
    if not fmu.is_file():
        raise SpecError(f"{fmu}: no such file; give the path of an .fmu file, or a spec")
    info = read_package(fmu).info if is_package(fmu) else read_info(fmu)
    path = fmu.with_suffix(".toml")
    text = starter_spec(Path(fmu.name), info)
    problem = problem_of_starter(text, path)
    return Subject(problem, path, path.parent, text, is_new=True, free_grid=True)


def problem_of_starter(text: str, path: Path) -> Problem:
    """Return the problem of a starter spec, with a number in place of its placeholder.

    Args:
        text: the spec.
        path: file for which it is meant; its paths are relative to that file's folder.

    Raises:
        SpecError: if anything else of it is not valid.
    """
    content = tomllib.loads(text)
    requirement = content["requirements"][_STARTED]
    requirement["formula"] = requirement["formula"].removesuffix(f"{PLACEHOLDER})") + "0)"
    return Problem.from_parts(join(parse_spec(content, file=str(path)), _STARTED, path=path))


def _has_placeholder(content: dict[str, Any]) -> bool:
    formula = content["requirements"].get(_STARTED, {}).get("formula")
    return isinstance(formula, str) and formula.endswith(f"<= {PLACEHOLDER})")


def _relocate(document: tomlkit.TOMLDocument, folder: Path, out: Path) -> None:
    """Change relative paths of FMUs to those from another file's folder."""
    for section in (document.get("model", {}), *document.get("components", {}).values()):
        if "fmu" in section and not Path(str(section["fmu"])).is_absolute():
            fmu = (folder / str(section["fmu"])).resolve()
            section["fmu"] = Path(relpath(fmu, out.resolve().parent)).as_posix()


def with_requirement(
    subject: Subject, out: Path, formula: str, *, name: str | None = None, description: str = ""
) -> tuple[str, str]:
    """Return the spec's text with one more requirement, and the name that it has; comments are kept.

    Args:
        subject: the spec.
        out: file that it will be written to; the path of the FMU is changed accordingly.
        formula: the requirement's formula.
        name: its name; None: the first free one of R1, R2, ...
        description: the sentence that it stands for.

    Raises:
        SpecError: if the spec has a requirement of this name.
    """
    document = tomlkit.parse(subject.text)
    if subject.folder.resolve() != out.resolve().parent:
        _relocate(document, subject.folder, out)
    requirements: Any = document["requirements"]
    if subject.is_started:
        del requirements[_STARTED]
    if name is None:
        name = next(f"R{k}" for k in range(1, len(requirements) + 2) if f"R{k}" not in requirements)
    if name in requirements:
        raise SpecError(f"the spec has a requirement {name!r} already; choose another --name")
    table = tomlkit.table()
    table.add("formula", tomlkit.string(formula, literal=formula.isprintable() and "'" not in formula))
    table.add("description", description)
    requirements[name] = table
    text = tomlkit.dumps(document)
    parse_spec(tomllib.loads(text), file=str(out))
    return text, name
