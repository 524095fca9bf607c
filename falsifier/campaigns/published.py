"""What was published (published.toml): suites of requirements, their results, the rank of our own."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from falsifier.core.files import bundled
from falsifier.errors import SpecError, did_you_mean
from falsifier.problem.loading import find_spec
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.problem.spec import read_spec

# Published means have one decimal, so means are compared with one decimal: 1.3 and 1.34 share a rank.
_DECIMALS = 1


@dataclass(frozen=True, slots=True)
class Score:
    """One cell of a table: how often a requirement was falsified, and in how many simulations.

    Attributes:
        falsified: number of falsified runs.
        runs: number of all runs.
        mean: mean number of simulations over the falsified runs; None if there is none.
        tool: name of the tool, if the column combines several tools.
    """

    falsified: int
    runs: int
    mean: float | None
    tool: str = ""

    @property
    def key(self) -> tuple[float, float]:
        """Sort key of ranks: more falsified runs first, then fewer simulations."""
        mean = float("inf") if self.mean is None else round(self.mean, _DECIMALS)
        return -self.falsified / max(self.runs, 1), mean


@dataclass(frozen=True, slots=True)
class Published:
    """Content of published.toml.

    Attributes:
        columns: scores by column (``best``, ``uniform``, ``llm_falsifier``) and requirement.
        ablation: scores by prompt variant and requirement.
        tools: scores of single tools that have no column of their own, by tool and requirement.
        llms: scores by language model with effort, e.g. ``gpt-5-mini-high``, and requirement.
        sources: publication that a column was taken from.
    """

    columns: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    ablation: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    llms: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    tools: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def scores(self, requirement: str) -> dict[str, Score]:
        """Scores for one requirement by column."""
        return {name: scores[requirement] for name, scores in self.columns.items() if requirement in scores}

    def competitors(self, requirement: str) -> list[Score]:
        """Scores for one requirement of every published tool, each tool once."""
        best = self.columns.get("best", {}).get(requirement)
        shown = list(self.scores(requirement).values())
        return shown + [
            scores[requirement]
            for tool, scores in self.tools.items()
            if requirement in scores and (best is None or best.tool != tool)
        ]


COLUMNS = {"best": "best ARCH-COMP tool", "llm_falsifier": "LLM-Falsifier", "uniform": "uniform random"}


def rank(score: Score, others: Iterable[Score]) -> int | None:
    """Rank of a score: one plus the number of better ones; None without a falsified run."""
    if score.falsified == 0:
        return None
    return 1 + sum(other.falsified > 0 and other.key < score.key for other in others)


def is_tied(score: Score, others: Iterable[Score]) -> bool:
    """Whether another score has the same rank."""
    return any(other.falsified > 0 and other.key == score.key for other in others)


@cache
def read_published() -> Published:
    """Read the bundled table of published results."""
    data = tomllib.loads((bundled("specs") / "published.toml").read_text(encoding="utf-8"))

    def columns(found: Mapping[str, Any]) -> dict[str, dict[str, Score]]:
        return {name: _scores(column, int(data["runs"])) for name, column in found.items()}

    best, tools = {name: data[name] for name in COLUMNS}, data["tools"]
    return Published(
        columns=columns(best),
        ablation=columns(data["ablation"]),
        llms=columns(data["llms"]),
        tools=columns(tools),
        sources={name: column.get("source", "") for name, column in (best | tools).items()},
    )


def _scores(column: Mapping[str, Any], runs: int) -> dict[str, Score]:
    return {
        requirement: Score(cell["falsified"], runs, cell.get("mean"), cell.get("tool", ""))
        for requirement, cell in column.items()
        if requirement != "source"
    }


SUITES = ("arch-comp",)
# The competition's protocol: simulations per run, and the parameterization that published results have.
PROTOCOL_SIMULATIONS = 1500
PROTOCOL_PARAMETERIZATION: Parameterization = "fixed"


def suite(name: str, *, profile: str | None = None) -> tuple[ProblemSource, ...]:
    """Requirements of a suite, with the parameterization that published results have.

    Args:
        name: ``arch-comp``: the requirements in ``published.toml``, in that order.
        profile: profile of the specs; requirements whose spec does not offer it are omitted.

    Raises:
        SpecError: for an unknown name.
    """
    if name not in SUITES:
        raise SpecError(f"unknown suite {name!r}; {did_you_mean(name, SUITES)}")
    targets = [bundled_target(requirement) for requirement in read_published().columns["best"]]
    return tuple(
        ProblemSource(target=target, profile=profile, parameterization=PROTOCOL_PARAMETERIZATION)
        for target in targets
        if profile is None or _offers(target, profile)
    )


def bundled_target(requirement: str) -> str:
    """Target of a bundled requirement including its spec, such as ``NN:NN``: ``NN`` alone is the whole spec.

    Raises:
        SpecError: if there is none of that name.
    """
    return f"{find_spec(requirement)[0].stem}:{requirement}"


def _offers(target: str, profile: str) -> bool:
    return profile in read_spec(find_spec(target)[0]).profiles
