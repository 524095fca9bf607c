"""What a user asked for, as one value: enough to run it, to record it and to run it again."""

import platform
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from falsifier import __version__
from falsifier.adhoc import adhoc_problem, changes_from_options
from falsifier.budget import Budget
from falsifier.engine import ProposerBuilder, Result, search
from falsifier.errors import JournalError, SpecError
from falsifier.events import Listener
from falsifier.execution import local_executor
from falsifier.journal import (
    Journal,
    Keep,
    Record,
    answered_exchanges,
    open_journal,
    read_journal,
    read_manifest,
    write_manifest,
)
from falsifier.model import Interface
from falsifier.problem import Problem, load_problem
from falsifier.space import InputRange, ParameterRange

if TYPE_CHECKING:
    from falsifier.llm.messages import Chat

# Engines that ask a language model.
_MODEL_ENGINES = ("llm", "hybrid")

Effort = Literal["low", "medium", "high"]

_RECORDED_PACKAGES = ("fmpy", "litellm", "numba", "numpy", "rtamt", "scipy")


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ProblemRequest(_Strict):
    """Which problem: a spec's requirement, or an FMU with a formula, and changes to either.

    The target ``python:MODULE:NAME`` is a Problem made in Python, or a function that returns one.
    """

    target: str
    stl: str | None = None
    profile: str | None = None
    parameterization: Literal["free", "fixed"] = "free"
    interface: Interface | None = None
    inputs: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    stop_time: float | None = None
    output_interval: float | None = None

    def load(self) -> Problem:
        """Return the problem.

        Raises:
            SpecError: naming what is wrong and the cure.
            ModelError: when the FMU cannot be used.
        """
        changes = changes_from_options(
            inputs=self.inputs,
            parameters=self.parameters,
            stop_time=self.stop_time,
            output_interval=self.output_interval,
            interface=self.interface,
        )
        if self.target.startswith("python:"):
            if self.model_copy(update={"parameterization": "free"}) != ProblemRequest(target=self.target):
                raise SpecError(f"{self.target}: a problem made in Python cannot be changed from outside")
            problem = _python_problem(self.target)
        elif self.target.endswith(".fmu"):
            if self.stl is None:
                raise SpecError(f"{self.target}: give the requirement with --stl 'G[0,10] (SIGNAL <= 1)'")
            problem = adhoc_problem(Path(self.target), self.stl, changes=changes)
        else:
            problem = load_problem(
                self.target,
                profile=self.profile,
                stl=self.stl,
                changes=changes,
            )
        return problem if self.parameterization == "free" else fixed_parameterization(problem)


class ModelRequest(_Strict):
    """Which language model, and how it is asked."""

    name: str
    effort: Effort | None = None
    api_base: str | None = None
    variant: str | None = None
    cache: bool = True


class RunRequest(_Strict):
    """One run. Naming a language model without an engine means that the model leads the search."""

    problem: ProblemRequest
    engine: str | None = None
    model: ModelRequest | None = None
    seed: int = Field(default=0, ge=0)
    budget: Budget = Budget()
    jobs: int = Field(default=1, ge=1)
    keep: Keep = "history"


class InputRecord(_Strict):
    """One searched input or parameter, so that a run can be drawn without its model."""

    name: str
    low: float
    high: float
    unit: str = ""
    description: str = ""


class Manifest(_Strict):
    """What a run directory says of how it came to be."""

    falsifier: str = Field(description="Version of this package.")
    python: str
    platform: str
    packages: dict[str, str] = Field(description="Versions of the packages that decide numbers.")
    started: str = Field(description="Date and time in UTC.")
    request: RunRequest
    source: str = Field(description="Where the problem was loaded from.")
    requirement: dict[str, str] = Field(description="name, formula and description of the requirement.")
    model: str = Field(description="Name of the model.")
    inputs: tuple[InputRecord, ...]
    parameters: tuple[InputRecord, ...]
    stop_time: float = Field(description="End of each simulation in s.")
    hashes: dict[str, str] = Field(description="SHA-256 by path of the FMU and the spec.")


def fixed_parameterization(problem: Problem) -> Problem:
    """Return the same problem with only the spec's fixed control points allowed."""
    inputs = tuple(replace(r, free=None) for r in problem.space.inputs)
    return replace(problem, space=replace(problem.space, inputs=inputs))


def execute(
    request: RunRequest, directory: Path | None, *, listeners: Iterable[Listener] = (), resume: bool = False
) -> Result:
    """Run a request, recorded in a directory; with resume, go on where that directory's journal ends.

    Raises:
        JournalError: when the directory holds another run, or its FMU or spec has changed since.
        SpecError: when the request cannot be understood.
        ModelError: when the FMU cannot be used.
        ChatError: when the language model cannot be used, before the first simulation.
    """
    problem = request.problem.load()
    return perform(
        request, problem, manifest(request, problem), directory, listeners=listeners, resume=resume
    )


def perform(
    request: RunRequest,
    problem: Problem,
    described: Manifest,
    directory: Path | None,
    *,
    listeners: Iterable[Listener] = (),
    resume: bool = False,
    patience: float = 0.0,
) -> Result:
    """Run a request whose problem is loaded, like execute.

    Args:
        request: what to run.
        problem: of the request.
        described: manifest of the request.
        directory: of the run; None: nothing is recorded.
        listeners: called with every event.
        resume: go on where the directory's journal ends; start where there is none.
        patience: how long in s to wait for another process that writes to the directory.
    """
    with ExitStack() as stack:
        journal: Journal | None = None
        records: Sequence[Record] = ()
        begun = directory is not None and (directory / "manifest.json").exists()
        if directory is not None and begun:
            if not resume:
                raise JournalError(
                    f"{directory} already holds a run: choose another --out, or continue it with "
                    f"'falsifier resume {directory}'"
                )
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            check_unchanged(directory, read_manifest(directory)["hashes"], described.hashes)
            records = read_journal(directory)
        build = proposer_builder(request, problem, records)
        if directory is not None and not begun:  # only now: a wrong engine or a missing key leaves no folder
            journal = stack.enter_context(open_journal(directory, keep=request.keep, patience=patience))
            write_manifest(directory, described.model_dump(mode="json"))
        executor = stack.enter_context(local_executor(request.jobs))
        stack.callback(problem.model.close)
        return search(
            problem,
            build,
            request.budget,
            batch=request.jobs,
            executor=executor,
            journal=journal,
            records=records,
            listeners=listeners,
        )


def resume_run(directory: Path, *, listeners: Iterable[Listener] = ()) -> Result:
    """Continue the run of a directory."""
    return execute(recorded_request(directory), directory, listeners=listeners, resume=True)


def recorded_request(directory: Path) -> RunRequest:
    """What the run of a directory was asked for."""
    return RunRequest.model_validate(read_manifest(directory)["request"])


def manifest(request: RunRequest, problem: Problem) -> Manifest:
    """Describe a run before it starts."""
    space, requirement = problem.space, problem.requirement
    return Manifest(
        **environment(),
        request=request,
        source=problem.source,
        requirement={
            "name": problem.name,
            "formula": str(requirement.formula),
            "description": requirement.description,
        },
        model=problem.info.name,
        inputs=tuple(_range_record(r) for r in space.inputs),
        parameters=tuple(_range_record(p) for p in space.parameters),
        stop_time=space.stop_time,
        hashes=file_hashes(problem),
    )


def environment() -> dict[str, Any]:
    """Versions, platform and time, as manifests state them."""
    return {
        "falsifier": __version__,
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "packages": {name: found for name in _RECORDED_PACKAGES if (found := _version(name))},
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def file_hashes(problem: Problem) -> dict[str, str]:
    """SHA-256 by path of the files that decide what is simulated: the FMU and the spec."""
    spec = problem.source.rpartition(":")[0]
    paths = [getattr(problem.model, "path", None), Path(spec) if spec.endswith(".toml") else None]
    return {str(p): sha256(Path(p).read_bytes()).hexdigest() for p in paths if p is not None}


def check_unchanged(directory: Path, recorded: dict[str, str], found: dict[str, str]) -> None:
    """Refuse to continue with other files than those that a run or campaign was started with.

    Raises:
        JournalError: naming the file that has changed.
    """
    for path, digest in found.items():
        if recorded.get(path, digest) != digest:
            raise JournalError(f"{directory}: {path} has changed since this was started; start anew")


def proposer_builder(request: RunRequest, problem: Problem, records: Sequence[Record]) -> ProposerBuilder:
    """Return what makes the request's proposer; a language model is checked here, before any simulation."""
    from falsifier.proposers import DEFAULT_ENGINE, make_proposer

    if request.model is None:
        engine = request.engine or DEFAULT_ENGINE
        if engine in _MODEL_ENGINES:
            raise SpecError(f"the engine {engine!r} needs a language model: add --model NAME")
        proposer = make_proposer(engine, problem, seed=request.seed)
        return lambda _: proposer
    if (request.engine or "llm") not in _MODEL_ENGINES:
        raise SpecError(
            f"the engine {request.engine!r} asks no language model: leave out --model, or leave out --engine"
        )
    from falsifier.proposers.llm import make_llm_proposer

    variant, sample = request.model.variant, request.seed
    chat = _chat(request.model, records)
    return lambda on_exchange: make_llm_proposer(
        problem, chat, variant=variant, on_exchange=on_exchange, sample=sample
    )


def _chat(model: ModelRequest, records: Sequence[Record]) -> "Chat":
    """Return the chat that first plays the journal's replies, so that none is paid for twice.

    Raises:
        ChatError: for an unknown provider or a missing key.
    """
    from falsifier.llm.cache import default_cache_directory
    from falsifier.llm.connect import connect
    from falsifier.llm.replay import RecordedChat

    cache = default_cache_directory() if model.cache else None
    chat = connect(model.name, effort=model.effort, api_base=model.api_base, cache=cache)
    return RecordedChat(answered_exchanges(records), chat)


def _python_problem(target: str) -> Problem:
    _, module, name = [*target.split(":"), "", ""][:3]
    try:
        found = getattr(import_module(module), name)
    except (ImportError, ValueError, AttributeError) as error:
        raise SpecError(f"{target}: expected python:MODULE:NAME of something importable: {error}") from None
    problem = found() if callable(found) else found
    if not isinstance(problem, Problem):
        raise SpecError(f"{target}: expected a Problem or a function that returns one")
    return replace(problem, source=problem.source or target)


def _range_record(range_: InputRange | ParameterRange) -> InputRecord:
    return InputRecord(
        name=range_.name,
        low=range_.low,
        high=range_.high,
        unit=range_.unit,
        description=range_.description,
    )


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None
