"""The content of a report, gathered from directories before any layout: a verdict per requirement first."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isclose
from os.path import realpath
from pathlib import Path
from typing import Literal

from falsifier.campaigns.analysis import Run, Table, group, load, main_table, not_begun, read_published
from falsifier.campaigns.directory import is_campaign
from falsifier.campaigns.progress import spent_together
from falsifier.core.candidate import Candidate
from falsifier.core.ranges import number_names
from falsifier.core.trajectory import Trajectory
from falsifier.counterexamples.store import EXPLANATION, SHRUNK, beside, load_counterexample
from falsifier.errors import FalsifierError
from falsifier.record.files import recorded_trajectory
from falsifier.record.journal import JOURNAL, candidates_in
from falsifier.search.budget import Spent
from falsifier.stl import Monitor, in_words, parse
from falsifier.stl.monitor import Verdict
from falsifier.views.plotting.panels import Panel, panels
from falsifier.views.text import Labels

# Maximum number of counterexamples of a requirement that are shown.
_MOST_SHOWN = 3

Status = Literal["violated", "no violation found", "no violation confirmed", "not finished", "failed"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shown:
    """A run's counterexample, shrunk if it was, or its best simulation."""

    run: Run
    candidate: Candidate
    verdict: Verdict | None  # robustness, and what decided it; None if it could not be judged
    units: Mapping[str, str]
    labels: Labels
    panels: list[Panel]  # what to draw; empty if the trajectory was not kept
    confirmed: str  # why a counterexample counts
    is_shrunk: bool = False
    is_lost: bool = False  # whether a trajectory was kept, but its file is damaged or missing

    @property
    def what(self) -> str:
        """What it is, in words."""
        if self._is_doubtful:
            return "violation that was not confirmed"
        if not self.run.falsified:
            return "simulation nearest to a violation"
        if self.is_shrunk and self.candidate.key == _recorded(self.run).key:
            return "counterexample, of which no simpler one was found nearby"
        return "shrunk counterexample" if self.is_shrunk else "counterexample"

    @property
    def explanation(self) -> str:
        """What ``falsifier explain`` has found out; empty if nobody asked, or if the run went on since."""
        file = beside(self.run.counterexample_file, EXPLANATION)
        journal = self.run.directory / JOURNAL
        if self._is_doubtful or not file.is_file() or file.stat().st_mtime < journal.stat().st_mtime:
            return ""  # of a run without a counterexample it is about the nearest miss
        return file.read_text(encoding="utf-8", errors="replace").strip()

    @property
    def _is_doubtful(self) -> bool:
        return not self.run.falsified and self.verdict is not None and self.verdict.violated


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """The part of a report about one requirement."""

    name: str
    heading: str  # the name; of a formula without a name, the formula
    formula: str
    sentence: str  # what it means
    runs: list[Run]  # its runs, those of a method after each other
    # Counterexamples, the shrunk and quickest ones first; if there are none, the best simulation of all runs.
    shown: list[Shown]
    found: list[Run]  # the runs that found what is shown, or would be if it were not too much

    @property
    def status(self) -> Status:
        """The verdict on the requirement over all its runs."""
        runs = self.runs
        if any(run.falsified for run in runs):
            return "violated"
        if all(run.status == "failed" for run in runs):
            return "failed"
        if not any(run.finished for run in runs):
            return "not finished"
        return "no violation confirmed" if any(run.unconfirmed for run in runs) else "no violation found"


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """What a report says of one directory; a comparison has several."""

    title: str  # name of the directory
    runs: list[Run]
    table: Table | None  # statistics of the protocol; None if no method has several runs
    sections: list[Section]


def gather(*directories: Path) -> list[Side]:
    """Read runs or campaigns; several are compared; JournalError if a directory is neither, or is damaged."""
    names = [Path(realpath(directory)).name for directory in directories]
    return [
        _side(directory, str(directory) if names.count(name) > 1 else name)
        for directory, name in zip(directories, names, strict=True)
    ]


def by_requirement(sides: Iterable[Side]) -> dict[str, list[Section | None]]:
    """Return of each requirement, by name, what each side says; None if a side did not search it."""
    by_side = [{section.name: section for section in side.sections} for side in sides]
    names = dict.fromkeys(name for sections in by_side for name in sections)
    return {name: [sections.get(name) for sections in by_side] for name in names}


def _side(directory: Path, title: str) -> Side:
    runs = load(directory)
    grouped, searched = group(runs), dict[str, list[Run]]()
    for (requirement, _), members in grouped.items():
        searched.setdefault(requirement, []).extend(members)
    # Of a single run, shares and means say nothing.
    counts = is_campaign(directory) or any(len(members) > 1 for members in grouped.values())
    return Side(
        title,
        runs,
        main_table([*runs, *not_begun(directory, runs)], read_published()) if counts else None,
        [_section(name, own) for name, own in searched.items()],
    )


def spent_on(runs: Iterable[Run]) -> Spent:
    """What runs have spent together."""
    return spent_together((run.directory, run.spent) for run in runs)


def _section(name: str, runs: list[Run]) -> Section:
    found = [run for run in runs if run.falsified]
    if not found:
        judged = {run.verdict.robustness: run for run in reversed(runs) if run.verdict is not None}
        found = [judged[min(judged)]] if judged else []
    both = sorted(((run, _shrunk(run)) for run in found), key=lambda b: (b[1] is None, b[0].simulations))
    shown = [shrunk or shown_of(run, _recorded(run)) for run, shrunk in both[:_MOST_SHOWN]]
    return section_of(name, runs, shown, [run for run, _ in both])


def section_of(name: str, runs: list[Run], shown: list[Shown], found: list[Run]) -> Section:
    """Return what is said of a requirement; shown: counterexamples or, without any, the best simulation."""
    requirement = runs[0].manifest.requirement
    heading = requirement.formula if runs[0].is_ad_hoc else name
    if heading != name and name != requirement.name:
        heading = f"{name}: {heading}"
    return Section(
        name,
        heading,
        requirement.formula,
        requirement.description or in_words(parse(requirement.formula)),
        runs,
        shown,
        found,
    )


def _recorded(run: Run) -> Candidate:
    assert run.shown is not None
    return candidates_in(run.directory)[run.shown]


def shown_of(run: Run, candidate: Candidate) -> Shown:
    """Return a run's counterexample or best simulation, given its candidate."""
    name = None if run.shown is None else run.trajectories.get(run.shown)
    trajectory = recorded_trajectory(run.directory, name)
    if trajectory and not {*parse(run.manifest.requirement.formula).signals} <= {*trajectory.names}:
        trajectory = None  # it is that of another model
    is_lost = trajectory is None and name is not None
    return replace(_drawn(run, candidate, trajectory, run.verdict, run.reason), is_lost=is_lost)


def _shrunk(run: Run) -> Shown | None:
    """Return a run's shrunk counterexample, which ``falsifier explain --shrink`` leaves in its directory.

    None if there is none, or if its formula, FMU or spec is no longer that of the run.
    """
    file = beside(run.counterexample_file, SHRUNK)
    samples = file.with_suffix(".npz")
    if not run.falsified or not (file.is_file() and samples.is_file()):
        return None
    try:
        stored, trajectory = load_counterexample(file), Trajectory.load(samples)
        candidate = Candidate.from_json(stored.candidate)
    except (FalsifierError, OSError, ValueError, KeyError):
        return None  # the original is shown instead
    formula = parse(run.manifest.requirement.formula)
    verdict = Monitor(formula, trajectory.step, len(trajectory)).evaluate(trajectory)
    # One that was interrupted may have left the samples of an earlier one.
    is_its = isclose(verdict.robustness, stored.robustness, rel_tol=1e-9)
    if stored.origin != run.manifest.origin or not verdict.violated or not is_its:
        return None
    return replace(_drawn(run, candidate, trajectory, verdict, stored.reason), is_shrunk=True)


def _drawn(
    run: Run, candidate: Candidate, trajectory: Trajectory | None, verdict: Verdict | None, confirmed: str
) -> Shown:
    searched = (*run.manifest.inputs, *run.manifest.parameters)
    units = {r.name: r.unit for r in searched if r.unit} | dict(trajectory.units if trajectory else {})
    described, drawn = run.manifest, list[Panel]()
    labels = {r.name: number_names(r.kind, r.items) for r in searched if r.kind != "real"}
    labels |= {mode.name: number_names(mode.kind, mode.items) for mode in described.modes}
    if trajectory is not None:
        formula, components = parse(described.requirement.formula), described.components
        drawn = panels(formula, trajectory, candidate, described.inputs, verdict, labels, components)
    return Shown(
        run=run,
        candidate=candidate,
        verdict=verdict,
        units=units,
        labels=labels,
        panels=drawn,
        confirmed=confirmed if run.falsified else "",
    )
