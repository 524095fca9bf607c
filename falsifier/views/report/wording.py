"""What a report says of its content: phrases, facts, tables, and commands that repeat what it shows."""

import shlex
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from falsifier.analyses.coverage import coverage_of
from falsifier.campaigns.analysis import Run, Table
from falsifier.core.literals import shell_word, shortest
from falsifier.core.signals import Signal
from falsifier.core.words import choosing, counted, in_unit, listed, readable, with_unit
from falsifier.counterexamples.store import SHRUNK, beside
from falsifier.engines import ENGINES
from falsifier.problem.problem import held_text
from falsifier.problem.shorthand import options_from, without_option
from falsifier.problem.source import ProblemSource
from falsifier.record.journal import candidates_in
from falsifier.search.request import LLMSettings, RunRequest
from falsifier.views.analyses_text import tried_facts
from falsifier.views.report.content import Section, Shown, Side, spent_on
from falsifier.views.text import Fact, broken_facts, margin_facts, untested

_BETWEEN = {
    "constant": "held until the next row",
    "linear": "linear between rows",
    "pchip": "smooth between rows (pchip)",
}
# A run with more simulations is not searched for what it has tried: that takes a second per thousand.
_MOST_COUNTED = 5000


def differences(sides: Sequence[Side]) -> Table:
    """Return what the directories of a comparison differ in: engine, options, formula, files and version."""
    columns: list[dict[str, dict[str, None]]] = []
    for side in sides:
        told: dict[str, dict[str, None]] = {}
        for run in side.runs:
            manifest = run.manifest
            facts = [
                ("engine", run.method.label),
                *_options(manifest.request),
                (f"formula of {run.requirement}", manifest.requirement.formula),
                *((Path(path).name, f"SHA-256 {digest[:12]}") for path, digest in manifest.hashes.items()),
                ("falsifier", manifest.falsifier),
            ]
            for name, value in facts:
                if value is not None and name != "--engine":
                    told.setdefault(name, {})[str(value)] = None
        columns.append(told)
    names = dict.fromkeys(name for told in columns for name in told)
    texts = {name: [", ".join(told.get(name, ())) for told in columns] for name in names}
    differing = tuple((name, *cells) for name, cells in texts.items() if len(set(cells)) > 1)
    return Table("What differs", ("", *(side.title for side in sides)), differing)


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
    count = counted(spent_on(runs).simulations, "simulation")
    if not any(run.finished for run in runs):
        return f"not finished: no violation confirmed in {count} so far"
    return f"{section.status} in {count}{untested(f for run in runs for f in run.findings)}"


def limit_facts(shown: Shown) -> list[Fact]:
    """Return what broke; without a violation, how near it came."""
    return broken_facts(shown.verdict) or margin_facts(shown.verdict, shown.units, shown.labels)


def margin_beside(shown: Shown) -> list[Fact]:
    """Return the margin of what broke, also if it was not confirmed; ``limit_facts`` has it of the rest."""
    return margin_facts(shown.verdict, shown.units, shown.labels) if broken_facts(shown.verdict) else []


def input_table(shown: Shown) -> Table:
    """Return the inputs of a simulation as a table of their control points over time.

    A cell is empty where an input has no control point; how it goes on between them stands in the header.
    """
    signals = {
        name: Signal((0.0,), signal.values[:1]) if len(set(signal.values)) == 1 else signal
        for name, s in shown.candidate.signals.items()
        for signal in [s.stepped(shown.run.manifest.stop_time)]
    }
    header, columns = ["time [s]"], []
    for name, signal in signals.items():
        header.append(f"{with_unit(name, shown.units.get(name, ''))}, {_course(signal)}")
        points = zip(signal.times, signal.values, strict=True)
        columns.append({time: _entered(shown, name, value) for time, value in points})
    times = sorted({time for column in columns for time in column})
    rows = [(f"{time:.10g}", *(column.get(time, "") for column in columns)) for time in times]
    return Table("Inputs", tuple(header), tuple(rows))


def _course(signal: Signal) -> str:
    """How an input goes on between its control points."""
    if len(signal.times) == 1:
        return "constant"
    is_held = signal.hold and signal.interpolation != "constant"
    held = f", sampled every {readable(signal.hold)} s" if signal.hold and is_held else ""
    return f"{_BETWEEN[signal.interpolation]}{held}"


def parameter_facts(shown: Shown) -> list[Fact]:
    """Return the parameters of a simulation with their values and units."""
    values = shown.candidate.parameters.items()
    return [(n, in_unit(_entered(shown, n, value), shown.units.get(n, ""))) for n, value in values]


def _entered(shown: Shown, name: str, value: float) -> str:
    """Return a value to enter: as it was written, or with digits that show a millionth of its range."""
    manifest = shown.run.manifest
    widths = {r.name: r.high - r.low for r in (*manifest.inputs, *manifest.parameters)}
    return readable(value, choosing(value, widths.get(name, 0.0) / 1e6, 10))


def tried(section: Section) -> list[Fact]:
    """Return what the run shown for a requirement has tried of what it searched, read from its record."""
    if not section.shown or section.shown[0].run.simulations > _MOST_COUNTED:
        return []
    run = section.shown[0].run
    candidates = candidates_in(run.directory)
    judged = [int(index) for index in np.flatnonzero(~np.isnan(run.robustness))]
    return tried_facts(coverage_of(run.manifest, [(candidates[index], None) for index in judged]))


def unshown_lines(section: Section) -> list[str]:
    """Return what the searches of a requirement could not show, one line each, with the runs that say so."""
    told: dict[str, list[Run]] = {}
    for run in section.runs:
        texts = [*(finding.text for finding in run.findings), *(failure.text for failure in run.failures)]
        if held := held_text(h for h in run.manifest.not_searched if h.causality == "input"):
            texts.append(f"not searched: {held}")
        for text in texts:
            told.setdefault(text, []).append(run)
    return [
        text if len(runs) == len(section.runs) else f"{listed(list(map(run_name, runs)))}: {text}"
        for text, runs in told.items()
    ]


def trouble_lines(section: Section) -> list[str]:
    """Return which runs failed or were interrupted, and which violations were not confirmed."""
    lines = []
    for run in section.runs:
        if run.status in ("failed", "interrupted"):
            lines.append(f"{run_name(run)}: {run.status}: {run.reason}")
        for index, outcome in run.unconfirmed.items():
            lines.append(f"{run_name(run)}, simulation {index + 1}: {outcome}")
    return lines


def run_name(run: Run) -> str:
    """What a run is called beside others: its method and its seed."""
    return f"{run.method.label}, seed {run.seed}"


def advice(shown: Shown) -> list[Fact]:
    """Return what would simplify or explain a counterexample, and its command; empty if both are done."""
    run = shown.run
    if not run.falsified or (shown.is_shrunk and shown.explanation):
        return []
    place = shell_word(run.counterexample_file if run.method.together else run.directory)
    what, option = ("explain", "") if shown.is_shrunk else ("simplify and explain", " --shrink")
    return [(f"To {what} it", f"falsifier explain {place}{option}")]


def replay_command(run: Run, *, shrunk: bool = False) -> str:
    """Shell command that replays a run's counterexample, or what it was shrunk to."""
    found = run.counterexample_file if run.method.together else run.directory
    place = beside(run.counterexample_file, SHRUNK) if shrunk else found
    return f"falsifier replay {shell_word(place)}"


def commands(shown: Shown) -> list[Fact]:
    """Return the commands that replay a counterexample, and repeat the run that is shown."""
    run = shown.run
    replayed = [("replay it", replay_command(run, shrunk=shown.is_shrunk))] if run.falsified else []
    return [*replayed, ("repeat the run", run_command(run.manifest.request, shared=run.method.together))]


def run_command(request: RunRequest, *, shared: bool = False) -> str:
    """Shell command that repeats a run; shared: for all requirements of its spec.

    >>> run_command(RunRequest(problems=(ProblemSource(target="AT1"),), engine="uniform"))
    'falsifier run AT1 --engine uniform --budget 100 --seed 0'
    """
    if (problem := request.source) is None:
        return "(no command: the problem was made in Python)"
    if request.engine not in (None, "llm", *ENGINES):
        return f"(no command: the engine {request.engine!r} was made in Python)"
    if request.start_from:
        return "(no command: it began with known inputs, which the manifest lists)"
    if shared and problem.stl is not None:
        return "(no command: these requirements were searched together in Python)"
    if unsaid := without_option(problem.changes):
        return f"(no command: no option states {listed(unsaid)}, which the manifest has)"
    target = (problem.parts.file or problem.target.partition(":")[0]) if shared else problem.target
    stated = [(name, value) for name, value in _options(request) if value is not None]
    words = chain.from_iterable([name] if value is True else [name, str(value)] for name, value in stated)
    return f"falsifier run {shell_word(target)} {shlex.join(words)}"


def _options(request: RunRequest) -> list[tuple[str, object]]:
    """Return the options of a command that repeats a run; None: as by default."""
    problem, budget = request.source or ProblemSource(target=""), request.budget
    return [
        ("--stl", problem.stl),
        ("--parameterization", _parameterization(problem)),
        *options_from(problem.changes),
        *(("--context", file) for file in problem.context),
        ("--engine", request.engine),
        *(_llm_options(request.llm) if request.llm else ()),
        ("--budget", budget.simulations),
        ("--seconds", budget.seconds),
        ("--max-tokens", budget.tokens),
        ("--max-cost", budget.cost),
        ("--seed", request.seed),
        ("--jobs", request.jobs if request.jobs > 1 else None),
    ]


def _parameterization(problem: ProblemSource) -> str | None:
    kind = "fixed" if problem.parameterization == "fixed" else None
    if problem.shortest_piece is not None:
        kind = f"free:{shortest(problem.shortest_piece)}"
    return ",".join(word for word in (problem.profile, kind) if word) or None


def _llm_options(llm: LLMSettings) -> list[tuple[str, object]]:
    return [
        ("--llm", f"{llm.name}@{llm.effort}" if llm.effort else llm.name),
        ("--api-base", llm.api_base),
        ("--variant", llm.variant),
        *(("--llm-option", f"{name}={value}") for name, value in llm.options.items()),
        ("--llm-option", None if llm.price is None else f"price={':'.join(map(shortest, llm.price))}"),
        ("--llm-option", None if llm.timeout is None else f"timeout={shortest(llm.timeout)}"),
        ("--llm-option", None if llm.cache else "cache=no"),
        ("--anonymous", True if llm.anonymous else None),
    ]
