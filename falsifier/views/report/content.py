"""The content of a report, gathered from a directory before any layout."""

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from falsifier.campaigns.analysis import Published, Run, Table, load, main_table, read_published
from falsifier.campaigns.progress import total
from falsifier.core.candidate import Candidate
from falsifier.core.words import counted
from falsifier.problem.problem import held_text
from falsifier.problem.refinement import without_limits
from falsifier.problem.shorthand import options_from
from falsifier.record.journal import read_journal, recorded_candidates, recorded_trajectory
from falsifier.search.levels import level_results
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.stl import parse
from falsifier.stl.margins import is_on_limit, margin_words
from falsifier.views.plotting.panels import Panel, panels


@dataclass(frozen=True, slots=True, eq=False)
class Shown:
    """A run's counterexample, or its best simulation.

    Attributes:
        run: the run.
        candidate: what was simulated.
        panels: what to draw; empty if the trajectory was not kept.
        is_lost: whether it was kept, but its file is damaged or missing.
    """

    run: Run
    candidate: Candidate
    panels: list[Panel]
    is_lost: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """The part of a report about one requirement.

    Attributes:
        name: name of the requirement.
        heading: the name; of a formula without a name, the formula.
        formula: text of the formula.
        description: what it means.
        by_method: its runs by method.
        shown: counterexamples in the order of the runs; if there are none, the best simulation of all runs.
    """

    name: str
    heading: str
    formula: str
    description: str
    by_method: dict[str, list[Run]]
    shown: list[Shown]

    @property
    def runs(self) -> list[Run]:
        """Its runs with all methods."""
        return [run for runs in self.by_method.values() for run in runs]


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A complete report.

    Attributes:
        title: name of the directory.
        runs: all runs that have started.
        table: the protocol's table.
        sections: one per requirement.
    """

    title: str
    runs: list[Run]
    table: Table
    sections: list[Section]


def gather(directory: Path, published: Published | None = None) -> Content:
    """Read a run or a campaign.

    Raises:
        JournalError: if the directory is neither, or is damaged.
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


def outcome(section: Section) -> str:
    """Return in words what came of a requirement, over all its runs."""
    runs = section.runs
    count = counted(total(run.spent for run in searches(runs)).simulations, "simulation")
    found = [run for run in runs if run.falsified]
    if found:
        least = min(found, key=lambda run: run.simulations)
        after = counted(least.simulations, "simulation")
        of = "" if len(runs) == 1 else f" in {len(found)} of {len(runs)} runs, the quickest"
        return f"falsified{of} after {after}{_where(least)}"
    failed = [run for run in runs if run.status == "failed"]
    if len(failed) == len(runs):
        return f"failed: {failed[0].reason}"
    if not any(run.finished for run in runs):
        return "not finished"
    tested = ""
    if any(finding.untested for run in runs for finding in run.findings):
        tested = ", and a part of it was not tested"
    return f"not falsified in {count}{tested}{''.join(map(_where, _best(runs)))}"


def _where(run: Run) -> str:
    """Say what broke, or how near a run came, and when, with the values of what decided."""
    if run.verdict is None:
        return ""
    if run.falsified and run.verdict.breach is not None:
        return f": {run.verdict.breach.text}"
    signals = parse(run.verdict.predicate).signals
    values = "".join(f", {name} = {v:.6g}" for name, v in run.verdict.values.items() if name in signals)
    robustness, time = abs(run.verdict.robustness), run.verdict.critical_time
    what = f"by {robustness:.4g}" if run.falsified else f"{robustness:.4g} away from a violation"
    if is_on_limit(robustness):
        what = margin_words(run.verdict.robustness, run.verdict.predicate)
    return f": {what} at t = {time:.6g} s ({run.verdict.predicate}{values})"


def unshown(run: Run) -> list[str]:
    """Return what a search could not show, one line each."""
    texts = [*(finding.text for finding in run.findings), *(failure.text for failure in run.failures)]
    held = held_text(h for h in run.manifest.not_searched if h.causality == "input")
    return [*texts, *([f"not searched: {held}"] if held else [])]


def unshown_lines(section: Section) -> list[str]:
    """Return what the searches of a requirement could not show, one line each."""
    return [f"{run.method.label}, seed {run.seed}: {text}" for run in section.runs for text in unshown(run)]


def level_facts(run: Run) -> list[tuple[str, str]]:
    """Return what came of each level of a run that refined its inputs, and what the level searched."""
    levels = run.manifest.levels
    if not levels:
        return []
    found = level_results([level.first for level in levels], list(run.robustness), falsified=run.falsified)
    return [(each.name, f"{each.text}: {level.searched}") for level, each in zip(levels, found, strict=True)]


def replay_command(run: Run) -> str:
    """Shell command that replays a run's counterexample."""
    place = run.counterexample_file if run.shared else run.directory
    return shlex.join(["falsifier", "replay", str(place)])


def searches(runs: Iterable[Run]) -> list[Run]:
    """One run per directory: of those that share a search, the longest, which shows what the search spent."""
    longest: dict[Path, Run] = {}
    for run in runs:
        known = longest.get(run.directory)
        if known is None or run.simulations > known.simulations:
            longest[run.directory] = run
    return list(longest.values())


def run_command(request: RunRequest, *, shared: bool = False) -> str:
    """Shell command that repeats a run; shared: for all requirements of its spec.

    >>> run_command(RunRequest(problems=(ProblemSource(target="AT1"),), engine="uniform"))
    'falsifier run AT1 --engine uniform --budget 100 --seed 0'
    """
    problem, budget = request.source, request.budget
    if problem is None:
        return "(no command: the problem was made in Python)"
    if shared and problem.stl is not None:
        return "(no command: these requirements were searched together in Python)"
    target = (problem.parts.file or problem.target.partition(":")[0]) if shared else problem.target
    options: list[tuple[str, object]] = [
        ("--stl", problem.stl),
        ("--profile", problem.profile),
        ("--parameterization", None if problem.parameterization == "free" else problem.parameterization),
        ("--free", None if problem.shortest_piece is None else f"{problem.shortest_piece:g}"),
        *options_from(without_limits(problem.changes) if request.levels else problem.changes),
        ("--engine", request.engine),
        *(_llm_options(request.llm) if request.llm else ()),
        ("--budget", budget.simulations),
        ("--seconds", budget.seconds),
        ("--max-tokens", budget.tokens),
        ("--max-cost", budget.cost),
        ("--seed", request.seed),
        ("--jobs", request.jobs if request.jobs > 1 else None),
        ("--all", True if shared else None),
        ("--refine", True if request.levels else None),
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
        ("--reply", None if llm.reply == "json" else llm.reply),
        ("--anonymous", True if llm.anonymous else None),
        ("--fallback", llm.fallback),
    ]


def _section(name: str, by_method: dict[str, list[Run]]) -> Section:
    runs = [run for members in by_method.values() for run in members]
    requirement = runs[0].manifest.requirement
    found = [run for run in runs if run.falsified] or _best(runs)
    heading = requirement.formula if runs[0].is_ad_hoc else name
    if heading != name and name != requirement.name:
        heading = f"{name}: {heading}"
    return Section(
        name,
        heading,
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
    trajectory = recorded_trajectory(run.directory, run.trajectories.get(index))
    if trajectory is None:
        return Shown(run, candidate, [], is_lost=index in run.trajectories)
    drawn = panels(
        parse(run.manifest.requirement.formula),
        trajectory,
        candidate,
        run.manifest.inputs,
        run.verdict,
        components=run.manifest.components,
    )
    return Shown(run, candidate, drawn)
