"""Loading problems by name or file.

``load_problem("AT1")`` loads a bundled problem, ``load_problem("my.toml:REQ")`` one from a spec file::

    problem = load_problem("specs/AT.toml:AT1", profile="instance2")
"""

import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec as find_module
from os import PathLike
from pathlib import Path
from traceback import extract_tb

from falsifier.core import named
from falsifier.core.arguments import texts
from falsifier.core.files import bundled, seen_from_here
from falsifier.core.literals import one_line, shell_word
from falsifier.core.model import Interface
from falsifier.errors import FalsifierError, SpecError, did_you_mean, setting, written
from falsifier.fmu import is_package
from falsifier.problem.context import named_context
from falsifier.problem.joining import join, join_formula
from falsifier.problem.problem import Problem
from falsifier.problem.sections import ModelChanges, RequirementSection
from falsifier.problem.shorthand import InputChoice, ParameterChoice, changes_from, requirement_of
from falsifier.problem.source import MODEL_FILES, Parameterization, ProblemSource, Target, source_of
from falsifier.problem.spec import read_spec

# Fingerprints of what this process has loaded: a changed problem is seen without loading it once more.
_LOADED: dict[ProblemSource, str] = {}
# A formula to begin with.
_EXAMPLE = "G[0,10] (SIGNAL <= 1)"
# Keys with which a requirement changes the simulation.
_OVERRIDES = set(ModelChanges.model_fields)


def find_spec(target: str) -> tuple[Path, str | None]:
    """Return the spec file and the requirement's name, if any, for a target.

    Args:
        target: ``file.toml``, ``file.toml:REQ``, or a bundled name: ``AT``, ``AT:AT1``, ``AT1``.

    Raises:
        SpecError: if there is neither; lists the known names.
    """
    parts = Target.parse(target)
    if parts.kind == "spec":
        return Path(parts.file), parts.requirement or None
    if parts.kind == "python":
        raise SpecError(f"{target}: expected an FMU, a spec or a bundled name, not a problem made in Python")
    name, requirement = target.partition(":")[0], parts.requirement
    specs = {path.stem: path for path in sorted(bundled("specs").glob("*.toml")) if path.stem != "published"}
    if name in specs:
        first, *others = read_spec(specs[name]).requirements
        return specs[name], requirement or (None if others else first)
    names = list(specs)
    for stem, path in specs.items():
        requirements = read_spec(path).requirements
        if name in requirements and requirement:
            raise SpecError(
                f"{target}: no requirement {requirement!r}: {name} is itself a requirement, of {stem}; give "
                f"{name} or {stem}:NAME; {did_you_mean(requirement, requirements)}"
            )
        if name in requirements:
            return path, name
        names.extend(requirements)
    if (fmu := target.rpartition(":")[0]).lower().endswith(MODEL_FILES):
        raise SpecError(f"{target}: an FMU has no requirements of its own; {_stating(fmu)}")
    if not target:
        raise SpecError("the target is empty; give a spec file, an FMU or a bundled name")
    if Path(target).is_dir():
        raise SpecError(
            f"{target} is a folder; give a spec file, an FMU or a bundled name. If it holds a run: "
            + written(
                f"falsifier resume {shell_word(target)} continues it, falsifier llm prompt "
                f"{shell_word(target)} --at N prints what was asked before sample N",
                f"resume({target!r}) continues it",
            )
        )
    if Path(target).is_file():
        raise SpecError(f"{target}: expected a file ending in .toml, .fmu, .ssp or .ssd, or a bundled name")
    if Path(f"{name}.toml").is_file():
        meant = f"{name}.toml{target.removeprefix(name)}"
        raise SpecError(f"no spec file or bundled requirement {target!r}; did you mean {meant!r}?")
    raise SpecError(
        f"no spec file or bundled requirement {target!r}; give a file like my.toml:REQ, or a bundled name; "
        f"{did_you_mean(name, names)}"
    )


def load_problem(
    target: str | PathLike[str],
    *,
    stl: str | None = None,
    profile: str | None = None,
    parameterization: Parameterization = "free",
    shortest_piece: float | None = None,
    inputs: Mapping[str, InputChoice] | None = None,
    parameters: Mapping[str, ParameterChoice] | None = None,
    stop_time: float | None = None,
    output_interval: float | None = None,
    time_limit: float | None = None,
    interface: Interface | None = None,
    context: Sequence[str] = (),
    omit: Sequence[str] = (),
    allow: Sequence[str] = (),
    deny: Sequence[str] = (),
) -> Problem:
    """Load one problem.

    ``target``, a path too, ``profile``, ``parameterization``, ``shortest_piece`` and ``context`` are those of
    ProblemSource; the requirement's name is optional if the spec has only one. ``stl`` is a formula, or a
    template with its arguments, in place of the spec's requirement. All others are those of Problem.from_fmu,
    and override what the spec states.

    Raises:
        SpecError: naming the file, the key and the remedy.
        ModelError: if the FMU cannot be read.
    """
    changes = changes_from(
        inputs=inputs,
        parameters=parameters,
        stop_time=stop_time,
        output_interval=output_interval,
        time_limit=time_limit,
        interface=interface,
        omit=omit,
        allow=allow,
        deny=deny,
    )
    source = source_of(
        target,
        stl=stl,
        profile=profile,
        parameterization=parameterization,
        shortest_piece=shortest_piece,
        changes=changes,
        context=texts("context", context),
    )
    note_named(source)
    return load_source(source)


def load_problems(target: str | PathLike[str], *, profile: str | None = None) -> list[Problem]:
    """Load one problem per requirement of a spec, or only the requirement that the target names."""
    return [load_source(source) for source in sources_of(source_of(target, profile=profile))]


def sources_of(source: ProblemSource) -> list[ProblemSource]:
    """Return a source per requirement of a spec; the source itself if it has one, as of an FMU."""
    if source.parts.kind in ("fmu", "python"):
        return [source]
    path, requirement = find_spec(source.target)
    if requirement is not None:
        return [source]
    spec = path.stem if path.parent == bundled("specs") else path
    return [source.model_copy(update={"target": f"{spec}:{name}"}) for name in read_spec(path).requirements]


def source_file(source: ProblemSource) -> Path | None:
    """Return the spec file, SSP package or imported module of a source; None if there is none."""
    if source.parts.kind == "python":
        file = Path(getattr(sys.modules.get(source.target.split(":")[1]), "__file__", None) or "")
        # As specs are, so that a project can be moved.
        return Path(seen_from_here(file)) if file.is_file() else None
    if source.parts.kind == "fmu":
        return Path(source.target) if is_package(source.target) else None
    return find_spec(source.target)[0]


def load_source(source: ProblemSource, *, searches: bool = True) -> Problem:
    """Load the problem that a source describes.

    ``searches``: whether to refuse a problem in which there is nothing to search.

    Raises:
        SpecError: naming what is wrong and the remedy.
        ModelError: if the FMU cannot be used.
    """
    if source.parts.kind == "python":
        problem = _python_problem(source)
        if source.context:  # else it may name its own
            problem = replace(problem, named_context=named_context(source))
    else:
        problem = _joined(source, searches=searches)
    problem = replace(problem.recording(source.record), source=source)
    if source.shortest_piece is not None:
        if source.parameterization == "fixed":
            raise SpecError("shortest_piece makes inputs free: parameterization must be free, not fixed")
        step = problem.experiment.step
        if source.shortest_piece < step:
            raise SpecError(
                f"pieces of {source.shortest_piece:g} s: inputs change at communication steps, "
                f"{step:g} s apart; give at least that, or a smaller {setting('output_interval')}"
            )
        problem = replace(problem, space=problem.space.freed(source.shortest_piece))
    if source.parameterization == "fixed":
        problem = replace(problem, space=problem.space.fixed)
    _LOADED[source] = problem.fingerprint
    return problem


def note_named(source: ProblemSource) -> None:
    """Note that the user has named the module of a problem made in Python, which a record may name later."""
    if source.parts.kind == "python":
        named.note(_module(source))


def is_named(source: ProblemSource) -> bool:
    """Whether loading a source imports no module, or one that the user has named on this machine."""
    return source.parts.kind != "python" or named.is_noted(_module(source))


def _module(source: ProblemSource) -> str:
    """The target of a problem made in Python, and where it would be imported from; imports nothing."""
    found = None
    with suppress(ImportError, ValueError, AttributeError):
        found = find_module(source.target.split(":")[1].partition(".")[0])
    places = [] if found is None else [found.origin or "", *(found.submodule_search_locations or ())]
    return "\n".join([source.target, *(str(Path(place).resolve()) for place in places)])


def reloadable(problem: Problem) -> ProblemSource | None:
    """Return the source of a problem; None if it was made in Python or changed after it was loaded."""
    source = problem.source
    if source is None:
        return None
    return source if (_LOADED.get(source) or load_source(source).fingerprint) == problem.fingerprint else None


def _stating(fmu: str) -> str:
    """Say how to state a requirement of an FMU."""
    add = written(f"add --stl '{_EXAMPLE}'", f"use load_problem({fmu!r}, stl={_EXAMPLE!r})")
    return f"{add}, or write a spec with `falsifier init {shell_word(fmu)}`"


def _joined(source: ProblemSource, *, searches: bool) -> Problem:
    """Join what a source names."""
    stated = None if source.stl is None else requirement_of(source.stl)
    if source.parts.kind == "fmu":
        fmu = Path(source.target)
        if stated is None and fmu.is_file():
            raise SpecError(f"{fmu}: no requirement; {_stating(str(fmu))}")
        if source.profile is not None:
            raise SpecError(f"{fmu}: an FMU has no profile {source.profile!r}: only specs have profiles")
        joined = join_formula(
            fmu,
            stated or RequirementSection(formula=""),
            changes=source.changes,
            name=source.stl_name,
            searches=searches,
        )
        return replace(Problem.of(joined), named_context=named_context(source))
    path, requirement = find_spec(source.target)
    spec = read_spec(path)
    if requirement is None and path.stem in spec.requirements:
        requirement = path.stem  # such as NN, which is the name of a spec and of one of its requirements
    if requirement is None:
        requirement, *others = spec.requirements
        target, names = source.target.rstrip(":"), ", ".join(spec.requirements)
        if others and stated is None:
            every = written(f"falsifier run {shell_word(target)}", f"falsify(load_problems({target!r}))")
            raise SpecError(
                f"has {len(spec.requirements)} requirements; name one of them, for example "
                f"{target}:{requirement}; {every} searches all of them. Known: {names}",
                file=str(path),
            )
        first, *rest = (section.model_dump(include=_OVERRIDES) for section in spec.requirements.values())
        if any(each != first for each in rest):
            raise SpecError(
                f"the requirements of {target} simulate in different ways; say whose inputs and times hold: "
                f"{target}:NAME, with one of {names}"
            )
    joined = join(
        spec,
        requirement,
        path=path,
        profile=source.profile,
        stated=stated,
        stated_name=source.stl_name,
        changes=source.changes,
        searches=searches,
        is_free=source.parameterization == "free" and source.shortest_piece is None,
    )
    return replace(Problem.of(joined), named_context=named_context(source, spec, path))


def _python_problem(source: ProblemSource) -> Problem:
    """Return a problem made in Python."""
    target = source.target
    kept = source.model_dump(include={"target", "parameterization", "shortest_piece", "record", "context"})
    if source != ProblemSource(**kept):
        raise SpecError(f"{target}: options cannot change a problem made in Python; change it in its module")
    _, module, name = [*target.split(":"), "", ""][:3]
    try:
        found = getattr(import_module(module), name)
    except (ImportError, ValueError, AttributeError) as error:
        cure = "; in the folder of MODULE.py, start the command line with python -m falsifier"
        cure = cure if isinstance(error, ModuleNotFoundError) and error.name == module else ""
        raise SpecError(
            f"{target}: expected python:MODULE:NAME that can be imported: {error}{_place(error)}{cure}"
        ) from None
    except (Exception, SystemExit) as error:  # whatever the user's module does
        raise SpecError(_raised(f"{target}: importing {module}", error)) from error
    try:
        problem = found() if callable(found) else found
    except FalsifierError:
        raise
    except (Exception, SystemExit) as error:  # whatever the user's function does
        raise SpecError(_raised(f"{target}: {name}()", error)) from error
    if not isinstance(problem, Problem):
        raise SpecError(f"{target}: expected a Problem or a function that returns one")
    return problem


def _raised(what: str, error: BaseException) -> str:
    """Say what a user's code raised, and where."""
    said = one_line(f"{type(error).__name__}: {error}") + _place(error)
    return f"{what} raised {said}; expected a Problem or a function without arguments that returns one"


def _place(error: BaseException) -> str:
    """Return where a user's code raised an error, in brackets; empty if it was not their code."""
    theirs = [each for each in extract_tb(error.__traceback__)[1:] if "importlib" not in each.filename]
    return f" ({theirs[-1].filename}, line {theirs[-1].lineno})" if theirs else ""
