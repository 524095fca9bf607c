"""The manifest of a run directory: what was requested, with which versions, files and ranges."""

import platform
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

from pydantic import ConfigDict, Field

from falsifier import __version__
from falsifier.context.values import Context
from falsifier.core import named
from falsifier.core.literals import shell_word
from falsifier.core.model import Variable
from falsifier.core.ranges import Range, ValueKind
from falsifier.core.strict import Strict
from falsifier.core.words import first_few
from falsifier.errors import FalsifierError, JournalError, did_you_mean, setting, written
from falsifier.fmu import fmu_files, fmus_sha256, is_packaged
from falsifier.problem.loading import is_named, source_file
from falsifier.problem.problem import Held, Problem
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.record.files import read_sealed, write_sealed
from falsifier.search.parameterization import engine_parameterization, parameterization_of, searched_space
from falsifier.search.request import RunRequest

MANIFEST = "manifest.json"
# What to do where a run's files, whose paths are relative, are not seen.
_GO_THERE = "change to the folder in which it was started, and name its directory from there"
# What to do where files have changed since a run was started.
_START_ANEW = "start a new run instead"
# Runs of a folder that are named where one of them is expected.
_NAMED = 3
_RECORDED_PACKAGES = ("litellm", "numpy", "rtamt", "scipy")


class ModeRecord(Strict):
    """One recorded signal of the model that is not real."""

    name: str
    kind: ValueKind
    items: tuple[tuple[str, int], ...] = Field((), description="Names and numbers of an enumeration's items.")


class RequirementRecord(Strict):
    """One requirement."""

    name: str
    formula: str
    description: str = ""


class Origin(NamedTuple):
    """What a counterexample belongs to: a formula, and SHA-256 of what was simulated."""

    formula: str
    fmu_sha256: str | None  # one for all FMUs of a system; None if the model is neither
    spec_sha256: str | None  # of the spec, SSP package or Python module; None if there is none

    @classmethod
    def of(cls, formula: str, hashes: Mapping[str, str]) -> "Origin":
        """Return it for a formula and hashes of files by path."""
        fmus = [digest for path, digest in hashes.items() if path.lower().endswith(".fmu")]
        others = (digest for path, digest in hashes.items() if not path.lower().endswith(".fmu"))
        return cls(formula, fmus_sha256(fmus), next(others, None))


class Surroundings(Strict):
    """With what and when a run or a campaign was started."""

    falsifier: str = Field(description="Version of this package.")
    python: str
    platform: str
    packages: dict[str, str] = Field(description="Versions of the packages that influence the numbers.")
    started: str = Field(description="Date and time in UTC.")


class Manifest(Surroundings):
    """Content of manifest.json: everything needed to repeat the run and to report on it."""

    # Of inputs and parameters their ranges alone are recorded.
    model_config = ConfigDict(revalidate_instances="subclass-instances")

    run: str = Field("", description="Random name of the run, which every line of its journal repeats.")
    request: RunRequest
    engine: str = Field(description="Name of the engine, even if it was made in Python.")
    requirements: tuple[RequirementRecord, ...] = Field(min_length=1)
    fingerprints: dict[str, str] = Field(
        description="Hash of what is searched and how it is simulated, by requirement."
    )
    model: str = Field(description="Name of the model.")
    components: tuple[str, ...] = Field((), description="Names of the components, if the model is a system.")
    parameterization: Parameterization = Field(
        description="free: the engine could choose the control points of at least one input."
    )
    inputs: tuple[Range, ...] = Field(description="So that reports can draw a run without its model.")
    parameters: tuple[Range, ...]
    not_searched: tuple[Held, ...] = Field(
        description="The other inputs and the parameters, with the values at which they are held."
    )
    internals: tuple[str, ...] = Field(
        (), description="Internal variables that were recorded for the engine beside those of the problem."
    )
    modes: tuple[ModeRecord, ...] = Field(description="Recorded integers, Booleans and enumerations.")
    stop_time: float = Field(gt=0, description="End of each simulation in s.")
    allow: tuple[str, ...] = Field((), description="What the FMU was allowed beyond its own folders.")
    deny: tuple[str, ...] = Field((), description="What it was denied.")
    hashes: dict[str, str] = Field(description="SHA-256 of the FMUs and the spec or module, by path.")
    contexts: dict[str, Context] = Field(
        {}, description="What the language model was told of context files, by requirement."
    )
    sum: str = Field("", description="Checksum of the file up to the comma before it.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the requirements; several if they share a search."""
        return tuple(r.name for r in self.requirements)

    @property
    def shared(self) -> bool:
        """Whether several requirements share a search."""
        return len(self.requirements) > 1

    @property
    def requirement(self) -> RequirementRecord:
        """The requirement; the first one if several share a search."""
        return self.requirements[0]

    @property
    def origin(self) -> Origin:
        """What a counterexample of the requirement belongs to."""
        return Origin.of(self.requirement.formula, self.hashes)

    def of(self, name: str | None) -> "Manifest":
        """Return it for one requirement; None: the only one. JournalError listing the names if it is none."""
        if name is None and self.shared:
            raise JournalError(
                f"this run searched {', '.join(self.names)}; choose one: {setting('requirement', 'NAME')}"
            )
        name = name or self.names[0]
        if name not in self.names:
            raise JournalError(f"this run has searched no {name!r}; {did_you_mean(name, self.names)}")
        which = self.names.index(name)
        request = self.request.model_copy(update={"problems": self.request.problems[which : which + 1]})
        return self.model_copy(update={"requirements": (self.requirements[which],), "request": request})


def read(directory: Path) -> Manifest:
    """Read the manifest of a run directory; JournalError if there is none, or it is invalid."""
    check_no_folder(directory)
    return read_sealed(directory / MANIFEST, Manifest, what="run")


def check_no_folder(directory: Path) -> None:
    """Refuse a folder of runs, or a campaign's, where a run is expected; JournalError naming some of them."""
    if not (directory / MANIFEST).exists() and (below := list(map(str, runs_below(directory)))):
        raise JournalError(f"{directory} is a folder of runs; give one of them: {first_few(below, _NAMED)}")


def runs_below(directory: Path, file: str = MANIFEST) -> list[Path]:
    """Return the run directories in a folder, in order; those of a spec's groups are a folder deeper.

    They are known by a file that they contain.
    """
    found = [path.parent for pattern in ("*", "*/*") for path in directory.glob(f"{pattern}/{file}")]
    return sorted(found)


def check_in_sight(place: Path, sources: Iterable[ProblemSource], remedy: str = _GO_THERE) -> None:
    """Check that the files of recorded problems exist; JournalError saying what to do otherwise."""
    for file in (source.parts.file for source in sources):
        if file and not Path(file).exists():
            raise JournalError(f"{place}: made with {file}, which is not seen from this folder: {remedy}")


def check_named(place: Path, sources: Iterable[ProblemSource]) -> None:
    """Refuse to import what only a record names, which may be somebody else's; JournalError telling so."""
    for target in (source.target for source in sources if not is_named(source)):
        naming = written(f"python -m falsifier check {shell_word(target)}", f"load_problem({target!r})")
        raise JournalError(
            f"{place}: made with {target}, a module that would be run, and which {named.unnamed(naming)}"
        )


def write(directory: Path, manifest: Manifest) -> None:
    """Write the manifest of a run directory."""
    write_sealed(directory / MANIFEST, manifest)


def describe(
    request: RunRequest,
    problems: Sequence[Problem],
    engine: str,
    internals: tuple[str, ...] = (),
    hashes: dict[str, str] | None = None,
) -> Manifest:
    """Make the manifest of a run before it starts.

    The problems differ only in their requirement; the internal variables are recorded, too. The hashes are of
    the files when these were loaded, see file_hashes; None: as they are now.
    """
    problem = problems[0]
    space, used = problem.space, engine_parameterization(request.engine, request.llm)
    stated = (p.requirement for p in problems)
    return Manifest(
        **environment(),
        run=token_hex(4),
        request=request,
        engine=engine,
        requirements=tuple(
            RequirementRecord(name=r.name, formula=str(r.formula), description=r.description) for r in stated
        ),
        fingerprints={p.name: p.fingerprint for p in problems},
        model=problem.info.name,
        components=problem.info.components,
        parameterization=parameterization_of(searched_space(space, used)),
        inputs=space.inputs,
        parameters=space.parameters,
        not_searched=problem.held,
        internals=internals,
        modes=tuple(_modes(problem, internals)),
        stop_time=space.stop_time,
        allow=tuple(getattr(problem.model, "allow", ())),
        deny=tuple(getattr(problem.model, "deny", ())),
        hashes=file_hashes(problem) if hashes is None else hashes,
        contexts={p.name: p.context for p in problems if p.context != Context()},
    )


def environment() -> dict[str, Any]:
    """Versions, platform and time, as keyword arguments of Surroundings."""
    return {
        "falsifier": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "packages": {name: version(name) for name in _RECORDED_PACKAGES},
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def file_hashes(problem: Problem) -> dict[str, str]:
    """SHA-256, by path, of what determines what is simulated: FMUs as they were loaded, spec, or module."""
    spec = None if problem.source is None else source_file(problem.source)
    # What is in a package was extracted to a folder of this process; the package's own hash covers it.
    fmus = {} if is_packaged(problem.model) else fmu_files(problem.model)
    specs = {spec: sha256(spec.read_bytes()).hexdigest()} if spec else {}
    return {str(path): digest for path, digest in (fmus | specs).items()}


def check_unchanged(
    directory: Path, recorded: dict[str, str], found: dict[str, str], remedy: str = _START_ANEW
) -> None:
    """Refuse to go on if hashes by path, or fingerprints by requirement, changed; JournalError naming one."""
    for name, digest in found.items():
        if recorded.get(name, digest) != digest:
            raise JournalError(f"{directory}: {name} has changed since the start; {remedy}")


@contextmanager
def loading(
    directory: Path, sources: Iterable[ProblemSource], recorded: dict[str, str], remedy: str = _START_ANEW
) -> Iterator[None]:
    """Check that the files exist, and blame what cannot be loaded on one that has changed, if there is one.

    Only then: of a project that was copied, the recorded hashes are of files that are no longer used.
    """
    sources = list(sources)
    check_in_sight(directory, sources)
    check_named(directory, sources)
    try:
        yield
    except FalsifierError:
        files = (Path(name) for name in recorded)
        found = {str(f): sha256(f.read_bytes()).hexdigest() for f in files if f.is_file()}
        check_unchanged(directory, recorded, found, remedy)
        raise


def _modes(problem: Problem, internals: tuple[str, ...]) -> Iterator[ModeRecord]:
    for name in (*problem.experiment.outputs, *internals):
        variable = problem.info[name] if name in problem.info else Variable(name)
        if variable.kind in ("integer", "boolean", "enumeration"):
            yield ModeRecord(name=name, kind=variable.kind, items=variable.items)
