"""What a report says, gathered from a directory before anything is laid out."""

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from falsifier.campaigns.analysis import Published, Run, Table, load, main_table, read_published
from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.problem.options import options_from
from falsifier.search.journal import read_journal, recorded_candidates
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.stl import parse
from falsifier.views.panels import Panel, panels


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A run's counterexample, or its best simulation.

    Attributes:
        run: the run.
        candidate: what was simulated.
        panels: what to draw; none where no trajectory was kept.
    """

    run: Run
    candidate: Candidate
    panels: list[Panel]


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """One requirement.

    Attributes:
        name: of the requirement.
        formula: its text.
        description: what it means.
        by_method: its runs by method.
        shown: counterexamples in the order of the runs; without any, the smallest robustness of all.
    """

    name: str
    formula: str
    description: str
    by_method: dict[str, list[Run]]
    shown: list[Shown]

    @property
    def runs(self) -> list[Run]:
        """Its runs of all methods."""
        return [run for runs in self.by_method.values() for run in runs]


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A whole report.

    Attributes:
        title: name of the directory.
        runs: all runs that have begun.
        table: the protocol's table.
        sections: one a requirement.
    """

    title: str
    runs: list[Run]
    table: Table
    sections: list[Section]


def gather(directory: Path, published: Published | None = None) -> Content:
    """Read a run or a campaign.

    Raises:
        JournalError: when the directory is neither, or is damaged.
    """
    runs = load(directory)
    grouped: dict[str, dict[str, list[Run]]] = {}
    for run in runs:
        grouped.setdefault(run.requirement, {}).setdefault(run.method.label, []).append(run)
    return Content(
        directory.resolve().name,
        runs,
        main_table(runs, read_published() if published is None else published),
        [_section(name, by_method) for name, by_method in grouped.items()],
    )


def replay_command(run: Run) -> str:
    """Shell command that simulates a run's counterexample again."""
    place = run.counterexample_file if run.shared else run.directory
    return shlex.join(["falsifier", "replay", str(place)])


def searches(runs: Iterable[Run]) -> list[Run]:
    """Of the runs that shared a search, the one that lasted longest: what a directory's search has used."""
    longest: dict[Path, Run] = {}
    for run in runs:
        known = longest.get(run.directory)
        if known is None or run.simulations > known.simulations:
            longest[run.directory] = run
    return list(longest.values())


def run_command(request: RunRequest, *, shared: bool = False) -> str:
    """Shell command that repeats a run's search; shared: for all requirements of its spec.

    >>> run_command(RunRequest(problems=(ProblemSource(target="AT1"),), engine="uniform"))
    'falsifier run AT1 --engine uniform --budget 100 --seed 0'
    """
    problem, budget = request.source, request.budget
    if problem is None:
        return "(its problem was made in Python)"
    spec = problem.parts.file or problem.target.partition(":")[0]
    target = spec if shared else problem.target
    options: list[tuple[str, object]] = [
        ("--stl", problem.stl),
        ("--profile", problem.profile),
        ("--parameterization", None if problem.parameterization == "free" else problem.parameterization),
        *options_from(problem.changes),
        ("--engine", request.engine),
        *(_llm_options(request.llm) if request.llm else ()),
        ("--budget", budget.simulations),
        ("--seconds", budget.seconds),
        ("--max-tokens", budget.tokens),
        ("--max-cost", budget.cost),
        ("--seed", request.seed),
        ("--all", True if shared else None),
    ]
    words = ["falsifier", "run", target]
    for name, value in options:
        words += [] if value is None else [name] if value is True else [name, str(value)]
    return shlex.join(words)


def _llm_options(llm: LLMSettings) -> list[tuple[str, object]]:
    return [
        ("--llm", llm.name),
        ("--effort", llm.effort),
        ("--api-base", llm.api_base),
        ("--variant", llm.variant),
        *(("--llm-option", f"{name}={value}") for name, value in llm.options.items()),
        ("--price", None if llm.price is None else f"{llm.price[0]:g}:{llm.price[1]:g}"),
        ("--anonymous", True if llm.anonymous else None),
        ("--fallback", llm.fallback),
    ]


def _section(name: str, by_method: dict[str, list[Run]]) -> Section:
    runs = [run for members in by_method.values() for run in members]
    requirement = runs[0].manifest.requirement
    found = [run for run in runs if run.falsified] or _best(runs)
    return Section(
        name,
        requirement.formula,
        requirement.description,
        by_method,
        [_shown(run) for run in found],
    )


def _best(runs: Iterable[Run]) -> list[Run]:
    judged = [run for run in runs if run.verdict is not None]
    return [min(judged, key=lambda run: run.verdict.robustness if run.verdict else 0.0)] if judged else []


def _shown(run: Run) -> Shown:
    index = run.counterexample if run.counterexample is not None else run.best
    assert index is not None
    candidate = recorded_candidates(read_journal(run.directory))[index]
    path = run.directory / run.trajectories.get(index, "-")
    if not path.is_file():
        return Shown(run, candidate, [])
    drawn = panels(
        parse(run.manifest.requirement.formula),
        Trajectory.load(path),
        candidate,
        run.manifest.inputs,
        run.verdict,
    )
    return Shown(run, candidate, drawn)
