"""``falsifier assess`` and ``falsifier margin``: what a search that found nothing says."""

from contextlib import closing
from pathlib import Path
from typing import Any

import click

from falsifier.analyses.assess import assess as assess_problem
from falsifier.analyses.margin import margin as find_margin, stated_at
from falsifier.cli import options
from falsifier.cli.command import command, refuse, stated
from falsifier.cli.output import INTERRUPTED, as_shown, conclude
from falsifier.core.literals import number_in, one_line
from falsifier.engines import DEFAULT_ENGINE
from falsifier.errors import JournalError, SpecError
from falsifier.problem.loading import load_source
from falsifier.problem.problem import Problem
from falsifier.problem.source import Target
from falsifier.record import manifest
from falsifier.record.journal import holds_run, read_journal, recorded_evaluations
from falsifier.record.questions import doubtful_confirmations
from falsifier.search.make_engines import LLM_ENGINES
from falsifier.views.terminal import warn
from falsifier.views.text import assurance_json

_ASSESS_BUDGET = 300
# Progress is said after this many simulations.
_SAID_EVERY = 100


@command()
@options.requirement_options
@options.budget_option(_ASSESS_BUDGET)
@options.requirement_option
@options.seed_option()
@options.quiet_option
@options.json_option
def assess(
    *, budget: int, requirement: str | None, seed: int, quiet: bool, as_json: bool, **given: Any
) -> None:
    """Bound the probability of a violation by simulating at random.

    TARGET is a bundled problem (AT1), a spec file (my.toml or my.toml:REQ), an FMU with --stl, or a run
    directory: then inputs are drawn from the search space of the run, and its findings are stated beside
    the bound. Every control point of the fixed parameterization and every parameter is drawn uniformly
    from its range. The upper bound is exact (Clopper and Pearson).

    Exit codes: 0 no violation among the draws, 1 at least one, 2 wrong usage or spec, 3 the simulations
    failed, 130 interrupted, after which the draws so far count.
    """

    def said(count: int) -> None:
        if not quiet and count % _SAID_EVERY == 0:
            warn(f"simulation {count} of at most {budget}")

    problem, search = _loaded(given, requirement)
    with closing(problem.model):
        found = assess_problem(problem, budget=budget, seed=seed, progress=said, **search)
    content = assurance_json(found)
    lines = [f"{problem.name}: {problem.requirement.formula}"]
    lines += [f"  {line}" for line in found.text.splitlines()]
    code = INTERRUPTED if found.interrupted else 1 if found.violations else 0
    conclude(as_shown("\n".join(map(one_line, lines)), content, as_json=as_json), code)


@command()
@options.problem_options
@options.stl_option("Formula or template with {limit} in place of a threshold.", required=True)
@click.option("--between", required=True, metavar="LOW:HIGH", help="Smallest and largest threshold.")
@options.engine_option(without=LLM_ENGINES)
@options.budget_option(least=20, note=" of all searches together")
@options.seed_option()
@options.quiet_option
@options.json_option
def margin(
    *,
    stl: str,
    between: str,
    engine: str | None,
    budget: int,
    seed: int,
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    """Find the threshold at which a search starts to find violations.

    TARGET is a bundled problem (AT1), a spec file (my.toml or my.toml:REQ), or an FMU. The formula replaces
    its requirement. Every simulation is judged for all thresholds.

    Exit codes: 0 not falsified at any threshold, 1 falsified at a threshold, 2 wrong usage or spec, 3 the
    simulations failed, 130 interrupted, after which the searches so far count.
    """
    low, high = _between(between)
    # So that the signals of the formula are recorded; problems made in Python take no formula.
    made_here = Target.parse(given["target"]).kind != "python"
    requirement = {"stl": stated_at(stl, low) if made_here else None}

    def said(threshold: float, falsified: bool, count: int) -> None:  # noqa: FBT001 - given by position
        if not quiet:
            found = "falsified" if falsified else "not falsified"
            warn(f"{threshold:.12g}: {found} ({count} of at most {budget} simulations used)")

    problem = load_source(options.problem_source(given | requirement))
    with closing(problem.model):
        how: dict[str, Any] = {"engine": engine or DEFAULT_ENGINE, "budget": budget, "seed": seed}
        found = find_margin(problem, stl, (low, high), **how, searched=said)
    content = {
        "formula": stl,
        "between": [low, high],
        "falsified_at": found.falsified_at,
        "unfalsified_at": found.unfalsified_at,
        "searches": [{"threshold": at, "falsified": falsified} for at, falsified in found.searches],
        "complete": found.complete,
        "interrupted": found.interrupted,
        "spent": {"simulations": found.simulations},
    }
    text = as_shown(one_line(f"{stl}: {found.text}"), content, as_json=as_json)
    conclude(text, INTERRUPTED if found.interrupted else 0 if found.falsified_at is None else 1)


def _loaded(given: dict[str, Any], requirement: str | None) -> tuple[Problem, dict[str, Any]]:
    """Load the problem of a target, or of a run that has not changed since, with what that found."""
    place = Path(given["target"])
    if not (place.is_dir() and holds_run(place)):
        refuse("applies to run directories only; TARGET is not one", requirement=requirement)
        if given["parameterization"].shortest_piece:
            raise click.UsageError(
                "--parameterization free:SECONDS: the fixed control points are drawn; drop :SECONDS"
            )
        try:
            return load_source(options.problem_source(given)), {}
        except SpecError:
            if not place.is_dir():
                raise
            manifest.check_no_folder(place)
            raise JournalError(
                f"{place}: not a run directory: it contains no {manifest.MANIFEST}; expected a run, a spec, "
                "an FMU or a bundled name"
            ) from None
    if changed := stated(given.keys() - {"target"}):
        raise click.UsageError(f"{place}: a run's search space cannot be changed; drop {', '.join(changed)}")
    described = manifest.read(place).of(requirement)
    source = described.request.source
    if source is None:
        raise SpecError(f"{place}: the problem of this run was made in Python; call assess() in Python")
    remedy = f"what was found says nothing about it: assess {source.target}, or start a new run"
    with manifest.loading(place, [source], described.hashes, remedy):
        problem = load_source(source)
    manifest.check_unchanged(place, described.hashes, manifest.file_hashes(problem), remedy)
    records = read_journal(place)
    evaluations = recorded_evaluations(records, problem.name)
    doubtful = doubtful_confirmations(problem, records, evaluations)
    return problem, {"searched": list(evaluations.values()), "doubtful": doubtful}


def _between(text: str) -> tuple[float, float]:
    match [number_in(end) for end in text.split(":")]:
        case [float(low), float(high)] if low < high:
            return low, high
    raise click.UsageError(f"--between {text}: expected LOW:HIGH with LOW < HIGH, for example 100:160")
