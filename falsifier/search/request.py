"""What a user asked for, as one value: enough to run it, to record it and to run it again."""

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from falsifier.core.model import Interface
from falsifier.errors import SpecError
from falsifier.problem.loading import find_spec, load_problem
from falsifier.problem.options import adhoc_problem, changes_from_options
from falsifier.problem.problem import Problem, alike
from falsifier.problem.spec import read_spec
from falsifier.search.budget import Budget
from falsifier.search.journal import Keep

Effort = Literal["low", "medium", "high"]


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

    def load_all(self, names: Sequence[str] = ()) -> list[Problem]:
        """Return the problems of these requirements of the spec, recording alike; of all of them by default.

        Raises:
            SpecError: when the target is no spec file, or as load does.
        """
        if self.target.endswith(".fmu") or self.target.startswith("python:") or self.stl is not None:
            raise SpecError(f"{self.target}: only a spec has several requirements")
        path, requirement = find_spec(self.target)
        if requirement is not None:
            raise SpecError(f"{self.target}: name the spec without a requirement to falsify all of them")
        each = (
            self.model_copy(update={"target": f"{path}:{name}"}).load()
            for name in names or read_spec(path).requirements
        )
        return [problem for group in alike(each) for problem in group]

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


class LLMSettings(_Strict):
    """Which language model, and how it is asked."""

    name: str
    effort: Effort | None = None
    api_base: str | None = None
    variant: str | None = Field(default=None, description="Prompt variant; default: the best one.")
    options: dict[str, str | float] = Field(
        default_factory=dict, description="Passed to litellm as they are."
    )
    price: tuple[float, float] | None = Field(
        default=None, description="US dollars for 1000 tokens sent and received; default: litellm's table."
    )
    anonymous: bool = Field(default=False, description="The LLM is told neutral names only.")
    fallback: str | None = Field(default=None, description="Engine that goes on when the LLM gives up.")
    cache: bool = Field(default=True, description="Equal questions are answered from disk.")


class RunRequest(_Strict):
    """One run. Naming a language model without an engine means that it leads the search."""

    problem: ProblemRequest
    together: tuple[str, ...] = Field(
        default=(), description="Requirements that are falsified in one search."
    )
    engine: str | None = None
    llm: LLMSettings | None = None
    seed: int = Field(default=0, ge=0)
    budget: Budget = Budget()
    jobs: int = Field(default=1, ge=1)
    keep: Keep = "history"


def fixed_parameterization(problem: Problem) -> Problem:
    """Return the same problem with only the spec's fixed control points allowed."""
    inputs = tuple(replace(r, free=None) for r in problem.space.inputs)
    return replace(problem, space=replace(problem.space, inputs=inputs))


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
