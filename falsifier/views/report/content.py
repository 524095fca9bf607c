"""The content of a report, gathered from directories before any layout: a verdict per requirement first."""

import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from falsifier.analyses.coverage import coverage_of
from falsifier.campaigns.analysis import Published, Run, Table, load, main_table, read_published
from falsifier.campaigns.directory import is_campaign
from falsifier.campaigns.progress import total
from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import counted, listed
from falsifier.counterexamples.store import EXPLANATION, beside, shrunk_file
from falsifier.counterexamples.store import load as load_counterexample
from falsifier.errors import FalsifierError
from falsifier.problem.problem import held_text
from falsifier.record.journal import read_journal, recorded_candidates
from falsifier.record.trajectory_files import recorded_trajectory
from falsifier.search.levels import level_results
from falsifier.stl import Monitor, in_words, parse
from falsifier.stl.margins import is_on_limit, margin_words
from falsifier.stl.monitor import Verdict
from falsifier.views.analyses_text import tried_facts
from falsifier.views.plotting.panels import Panel, panels
from falsifier.views.text import Fact

Status = Literal["violated", "not violated", "not finished", "failed"]

_BETWEEN = {
    "constant": "held until the next row",
    "linear": "linear between rows",
    "pchip": "smooth between rows (pchip)",
}
# A run with more simulations is not searched for what it has tried: that takes a second per thousand.
_MOST_COUNTED = 5000


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shown:
    """A run's counterexample, shrunk if it was, or its best simulation.

    Attributes:
        run: the run.
        candidate: what was simulated.
        verdict: robustness, and what decided it; None if it could not be judged.
        units: units of the signals, by name.
        panels: what to draw; empty if the trajectory was not kept.
        confirmed: why a counterexample counts.
        is_shrunk: whether it is the shrunk counterexample.
        is_lost: whether a trajectory was kept, but its file is damaged or missing.
    """

    run: Run
    candidate: Candidate
    verdict: Verdict | None
    units: Mapping[str, str]
    panels: list[Panel]
    confirmed: str
    is_shrunk: bool = False
    is_lost: bool = False

    @property
    def explanation(self) -> str:
        """What ``falsifier explain`` has found out; empty if nobody asked."""
        file = beside(self.run.counterexample_file, EXPLANATION)
        return file.read_text(encoding="utf-8").strip() if file.is_file() else ""


@dataclass(frozen=True, slots=True, eq=False)
class Section:
    """The part of a report about one requirement.

    Attributes:
        name: name of the requirement.
        heading: the name; of a formula without a name, the formula.
        formula: text of the formula.
        sentence: what it means.
        by_method: its runs by method.
        shown: counterexamples, the shrunk and quickest ones first; if there are none, the best simulation of
            all runs.
    """

    name: str
    heading: str
    formula: str
    sentence: str
    by_method: dict[str, list[Run]]
    shown: list[Shown]

    @property
    def runs(self) -> list[Run]:
        """Its runs with all methods."""
        return [run for runs in self.by_method.values() for run in runs]

    @property
    def status(self) -> Status:
        """The verdict on the requirement over all its runs."""
        runs = self.runs
        if any(run.falsified for run in runs):
            return "violated"
        if all(run.status == "failed" for run in runs):
            return "failed"
        return "not violated" if any(run.finished for run in runs) else "not finished"


@dataclass(frozen=True, slots=True, eq=False)
class Side:
    """What a report says of one directory; a comparison has several.

    Attributes:
        title: name of the directory.
        runs: all runs that have started.
        table: statistics of the protocol; None if no method has several runs.
        sections: one per requirement.
    """

    title: str
    runs: list[Run]
    table: Table | None
    sections: list[Section]


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A complete report.

    Attributes:
        sides: one per directory.
    """

    sides: list[Side]

    @property
    def title(self) -> str:
        """Names of the directories."""
        return " and ".join(side.title for side in self.sides)

    @property
    def requirements(self) -> dict[str, list[Section | None]]:
        """Of each requirement, by name, what each side says; None if a side did not search it."""
        by_side = [{section.name: section for section in side.sections} for side in self.sides]
        names = dict.fromkeys(name for sections in by_side for name in sections)
        return {name: [sections.get(name) for sections in by_side] for name in names}


def gather(*directories: Path, published: Published | None = None) -> Content:
    """Read runs or campaigns; several are compared.

    Raises:
        JournalError: if a directory is neither, or is damaged.
    """
    return Content([_side(directory, published) for directory in directories])


def _side(directory: Path, published: Published | None) -> Side:
    runs = load(directory)
    grouped: dict[str, dict[str, list[Run]]] = {}
    for run in runs:
        grouped.setdefault(run.requirement, {}).setdefault(run.method.label, []).append(run)
    # Of a single run, shares and means say nothing.
    counts = is_campaign(directory) or any(len(m) > 1 for by in grouped.values() for m in by.values())
    return Side(
        directory.resolve().name,
        runs,
        main_table(runs, read_published() if published is None else published) if counts else None,
        [_section(name, by_method) for name, by_method in grouped.items()],
    )


def differences(content: Content) -> Table:
    """Return what the directories of a comparison differ in: files, formulas, engines, seeds and versions."""
    columns: list[dict[str, list[str]]] = []
    for side in content.sides:
        told: dict[str, list[str]] = {}
        for run in side.runs:
            manifest = run.manifest
            facts = {
                "engine": run.method.label,
                "seed": str(run.seed),
                f"formula of {run.requirement}": manifest.requirement.formula,
                **{Path(path).name: f"SHA-256 {digest[:12]}" for path, digest in manifest.hashes.items()},
                "falsifier": manifest.falsifier,
            }
            for name, text in facts.items():
                told.setdefault(name, [])
                told[name] += [text] if text not in told[name] else []
        columns.append(told)
    names = dict.fromkeys(name for told in columns for name in told)
    texts = {name: [", ".join(told.get(name, [])) for told in columns] for name in names}
    differing = tuple((name, *cells) for name, cells in texts.items() if len(set(cells)) > 1)
    return Table("What differs", ("", *(side.title for side in content.sides)), differing)


def result_text(section: Section) -> str:
    """Return in words what came of a requirement, over all its runs."""
    runs = section.runs
    found = [run for run in runs if run.falsified]
    if found:
        after = counted(min(run.simulations for run in found), "simulation")
        if len(runs) == 1:
            return f"violated: found after {after}"
        return f"violated: found in {len(found)} of {len(runs)} runs, the quickest after {after}"
    failed = [run for run in runs if run.status == "failed"]
    if len(failed) == len(runs):
        return f"failed: {failed[0].reason}"
    count = counted(total(run.spent for run in searches(runs)).simulations, "simulation")
    if not any(run.finished for run in runs):
        return f"not finished: no violation in {count} so far"
    tested = ""
    if any(finding.untested for run in runs for finding in run.findings):
        tested = ", and a part of it was not tested"
    return f"no violation found in {count}{tested}"


def limit_facts(verdict: Verdict, units: Mapping[str, str]) -> list[Fact]:
    """Return the limit, the value reached and when; without a violation, how near it came.

    Args:
        verdict: robustness, and what decided it.
        units: units of the signals, by name.
    """
    if verdict.breach is not None:
        main, never = verdict.breach.main, verdict.breach.main.never
        unit = f" {main.unit}" if main.unit and main.part[-1].isdigit() else ""
        span = f"from {main.start:.6g} s to {main.end:.6g} s" if main.start != main.end else ""
        return [
            ("required", f"{main.part}{unit}" + (" at some time" if never else "")),
            ("nearest" if never else "reached", main.reading),
            ("never held" if never else "violated", span or f"at {main.time:.6g} s"),
            *([("worst", f"at {main.time:.6g} s")] if span and not never else []),
            *(("", line) for line in verdict.breach.lines[1:]),
        ]
    signals = parse(verdict.predicate).signals
    read = (f"{n} = {v:.6g} {units.get(n, '')}".strip() for n, v in verdict.values.items() if n in signals)
    values = ", ".join(read)
    robustness = f"{verdict.robustness:.6g} away from a violation"
    if is_on_limit(verdict.robustness):
        robustness = margin_words(verdict.robustness, verdict.predicate)
    return [
        ("required", verdict.predicate),
        ("nearest", f"{robustness}: {values}" if values else robustness),
        ("when", f"at {verdict.critical_time:.6g} s"),
    ]


def input_table(shown: Shown) -> Table:
    """Return the inputs of a simulation as a table of their control points over time.

    A cell is empty where an input has no control point; how it goes on between them stands in the header.
    """
    signals = {
        name: Signal((0.0,), signal.values[:1]) if len(set(signal.values)) == 1 else signal
        for name, signal in shown.candidate.signals.items()
    }
    times = sorted({time for signal in signals.values() for time in signal.times})
    points = {name: dict(zip(s.times, s.values, strict=True)) for name, s in signals.items()}
    header = [f"{name}{_in_brackets(shown.units.get(name, ''))}, {_course(s)}" for name, s in signals.items()]
    cells = {time: [points[name].get(time) for name in signals] for time in times}
    rows = [
        (f"{time:.6g}", *("" if value is None else f"{value:.6g}" for value in row))
        for time, row in cells.items()
    ]
    return Table("Inputs", ("time [s]", *header), tuple(rows))


def _in_brackets(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def _course(signal: Signal) -> str:
    """How an input goes on between its control points."""
    if len(signal.times) == 1:
        return "constant"
    held = f", sampled every {signal.hold:g} s" if signal.hold and signal.interpolation != "constant" else ""
    return f"{_BETWEEN[signal.interpolation]}{held}"


def tried(section: Section) -> list[Fact]:
    """Return what the run shown for a requirement has tried of what it searched, read from its record."""
    if not section.shown or section.shown[0].run.simulations > _MOST_COUNTED:
        return []
    run = section.shown[0].run
    candidates = recorded_candidates(read_journal(run.directory))
    judged = [int(index) for index in np.flatnonzero(~np.isnan(run.robustness))]
    return tried_facts(coverage_of(run.manifest, [(candidates[index], None) for index in judged]))


def unshown(run: Run) -> list[str]:
    """Return what a search could not show, one line each."""
    texts = [*(finding.text for finding in run.findings), *(failure.text for failure in run.failures)]
    held = held_text(h for h in run.manifest.not_searched if h.causality == "input")
    return [*texts, *([f"not searched: {held}"] if held else [])]


def unshown_lines(section: Section) -> list[str]:
    """Return what the searches of a requirement could not show, one line each, with the runs that say so."""
    told: dict[str, list[Run]] = {}
    for run in section.runs:
        for text in unshown(run):
            told.setdefault(text, []).append(run)
    return [
        text if len(runs) == len(section.runs) else f"{listed(list(map(run_name, runs)))}: {text}"
        for text, runs in told.items()
    ]


def trouble_lines(section: Section) -> Iterator[str]:
    """Yield which runs failed or were interrupted, and which violations were not confirmed."""
    for run in section.runs:
        if run.status in ("failed", "interrupted"):
            yield f"{run_name(run)}: {run.status}: {run.reason}"
        for index, outcome in run.unconfirmed.items():
            yield f"{run_name(run)}, simulation {index + 1}: {outcome}"


def run_name(run: Run) -> str:
    """What a run is called beside others: its method and its seed."""
    return f"{run.method.label}, seed {run.seed}"


def level_facts(run: Run) -> list[Fact]:
    """Return what came of each level of a run that refined its inputs, and what the level searched."""
    levels = run.manifest.levels
    if not levels:
        return []
    found = level_results([level.first for level in levels], list(run.robustness), falsified=run.falsified)
    return [(each.name, f"{each.text}: {level.searched}") for level, each in zip(levels, found, strict=True)]


def searches(runs: Iterable[Run]) -> list[Run]:
    """One run per directory: of those that share a search, the longest, which shows what the search spent."""
    longest: dict[Path, Run] = {}
    for run in runs:
        known = longest.get(run.directory)
        if known is None or run.simulations > known.simulations:
            longest[run.directory] = run
    return list(longest.values())


def advice(shown: Shown) -> str:
    """Return the command that would simplify or explain a counterexample; empty if both are done."""
    run = shown.run
    if not run.falsified or (shown.is_shrunk and shown.explanation):
        return ""
    place = str(run.counterexample_file if run.shared else run.directory)
    return shlex.join(["falsifier", "explain", place, *([] if shown.is_shrunk else ["--shrink"])])


def _section(name: str, by_method: dict[str, list[Run]]) -> Section:
    runs = [run for members in by_method.values() for run in members]
    shown = [_shown(run) for run in [run for run in runs if run.falsified] or _best(runs)]
    return section_of(name, by_method, shown)


def section_of(name: str, by_method: dict[str, list[Run]], shown: list[Shown]) -> Section:
    """Return what is said of a requirement.

    Args:
        name: name of the requirement.
        by_method: its runs by method.
        shown: their counterexamples or, if there are none, the best simulation.
    """
    runs = [run for members in by_method.values() for run in members]
    requirement = runs[0].manifest.requirement
    heading = requirement.formula if runs[0].is_ad_hoc else name
    if heading != name and name != requirement.name:
        heading = f"{name}: {heading}"
    return Section(
        name,
        heading,
        requirement.formula,
        requirement.description or in_words(parse(requirement.formula)),
        by_method,
        sorted(shown, key=lambda one: (not one.is_shrunk, one.run.simulations)),
    )


def _best(runs: Iterable[Run]) -> list[Run]:
    judged = [run for run in runs if run.verdict is not None]
    return [min(judged, key=lambda run: run.verdict.robustness if run.verdict else 0.0)] if judged else []


def _shown(run: Run) -> Shown:
    if (shrunk := _shrunk(run)) is not None:
        return _drawn(run, *shrunk, is_shrunk=True)
    index = shown_index(run)
    assert index is not None
    return shown_of(run, recorded_candidates(read_journal(run.directory))[index])


def shown_index(run: Run) -> int | None:
    """Return the index of the counterexample, otherwise of the best evaluation; None if there is none."""
    return run.best if run.counterexample is None else run.counterexample


def shown_of(run: Run, candidate: Candidate) -> Shown:
    """Return a run's counterexample or best simulation, given its candidate."""
    index = shown_index(run)
    name = None if index is None else run.trajectories.get(index)
    trajectory = recorded_trajectory(run.directory, name)
    is_lost = trajectory is None and name is not None
    return _drawn(run, candidate, trajectory, run.verdict, run.reason, is_lost=is_lost)


def _shrunk(run: Run) -> tuple[Candidate, Trajectory, Verdict, str] | None:
    """Return a run's shrunk counterexample, which ``falsifier explain`` leaves in the run directory."""
    file = shrunk_file(run.counterexample_file)
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
    return candidate, trajectory, verdict, stored.reason


def _drawn(
    run: Run,
    candidate: Candidate,
    trajectory: Trajectory | None,
    verdict: Verdict | None,
    confirmed: str,
    *,
    is_shrunk: bool = False,
    is_lost: bool = False,
) -> Shown:
    searched = (*run.manifest.inputs, *run.manifest.parameters)
    units = {r.name: r.unit for r in searched if r.unit} | dict(trajectory.units if trajectory else {})
    formula, components = parse(run.manifest.requirement.formula), run.manifest.components
    drawn = (
        []
        if trajectory is None
        else panels(formula, trajectory, candidate, run.manifest.inputs, verdict, components=components)
    )
    return Shown(
        run=run,
        candidate=candidate,
        verdict=verdict,
        units=units,
        panels=drawn,
        confirmed=confirmed if run.falsified else "",
        is_shrunk=is_shrunk,
        is_lost=is_lost,
    )
