"""``falsifier run`` and ``falsifier resume``."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from falsifier.cli import options
from falsifier.cli.command import Command, command, refuse
from falsifier.cli.llm_options import check_context, context_option, llm_options, llm_settings, read_budget
from falsifier.cli.output import INTERRUPTED, as_shown, conclude
from falsifier.core.arguments import utf_8
from falsifier.errors import JournalError, SpecError
from falsifier.views.terminal import warn

if TYPE_CHECKING:  # imported where used, so that --help prints at once
    from falsifier.core.candidate import Candidate
    from falsifier.problem.problem import Problem
    from falsifier.problem.source import ProblemSource
    from falsifier.search.budget import Budget
    from falsifier.search.result import Result

# If several requirements end differently, the first of these that occurs decides.
_EXIT_CODES = {"interrupted": 130, "failed": 3, "falsified": 1, "not falsified": 0}


class _OneTarget(Command):
    """A command that says what to use instead if it is given several targets."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as error:
            if "unexpected extra argument" not in error.message:
                raise
            raise click.UsageError(
                f"{error.message}; a run searches one target: for several, use falsifier bench TARGET "
                "TARGET ...; for all requirements of a spec in one search, falsifier run SPEC",
                ctx,
            ) from None


@click.command(cls=_OneTarget)
@options.requirement_options
@options.engine_option()
@llm_options
@context_option
@options.budget_option()
@options.limit_options()
@options.seed_option()
@options.jobs_option("simulations")
@options.inputs_option("Known inputs to simulate first; the engine learns from them", multiple=True)
@options.quiet_option
@options.out_option("Run directory; default: runs/NAME-TIME.", metavar="DIR")
@click.option(
    "--fmu-log",
    type=options.PATH,
    metavar="FILE",
    help="Ask the FMU for messages in every simulation, and write them to this file.",
)
@options.json_option
def run(
    *,
    engine: str | None,
    seed: int,
    jobs: int,
    places: tuple[Path, ...],
    quiet: bool,
    out: Path | None,
    fmu_log: Path | None,
    as_json: bool,
    **given: Any,
) -> None:
    """Search for inputs that violate a requirement.

    TARGET is a bundled problem (AT1), a spec file (my.toml or my.toml:REQ), or an FMU with --stl. If a spec
    has several requirements, all are searched together unless one is named.

    The first limit that is reached ends the run. Exit codes: 0 not falsified, 1 falsified, 2 wrong usage or
    spec, 3 simulator, language model or machine failed, 130 interrupted.
    """
    from falsifier.cli.files import check_out, in_existing_folder, new_directory
    from falsifier.problem.loading import load_source
    from falsifier.record.run import falsify
    from falsifier.views.progress import log_fmu, make_display

    source, llm = options.problem_source(given), llm_settings(given)
    check_context(source.context, [engine] if llm is None else [])
    budget = read_budget(given, asks=llm is not None)
    logs = [log_fmu(fmu_log)] if fmu_log else []
    if fmu_log:
        if out is not None and fmu_log.resolve() == out.resolve():
            raise click.UsageError(f"--fmu-log {fmu_log}: --out is a directory of this name; name a file")
        if in_existing_folder(fmu_log).is_file() or fmu_log.is_dir():  # not: a stream such as /dev/stderr
            check_out(fmu_log, begins=b"simulation 1: ")
        source = source.model_copy(update={"changes": source.changes.model_copy(update={"logging": True})})
    sources = _sources(source)
    searched: Sequence[ProblemSource | Problem] = sources
    start_from = []
    if places:
        searched = loaded = [load_source(each) for each in sources]
        start_from = [_known(place, loaded[0]) for place in places]
    with make_display(quiet=quiet) as display:
        results = falsify(
            searched,
            engine,
            llm=llm,
            seed=seed,
            budget=budget,
            jobs=jobs,
            directory=out or new_directory(source.name),
            start_from=start_from,
            listeners=[display, *logs],
        )
    _finish(results, as_json=as_json)


@command()
@options.directory_argument
@options.jobs_option("runs", default=None)
@options.budget_option(None, note=", including those already done")
@options.total_option
@options.quiet_option
@options.json_option
def resume(
    *,
    directory: Path,
    jobs: int | None,
    budget: int | None,
    totals: "Budget | None",
    quiet: bool,
    as_json: bool,
) -> None:
    """Continue the run or campaign in DIRECTORY.

    No recorded question is asked again, and no recorded simulation is repeated unless its trajectory is
    needed and was not kept. A run keeps its limits; only --budget replaces the limit on simulations, even
    if the run has ended. --jobs, by default 1, and --total apply to campaigns only. Totals of simulations,
    tokens and cost include what was spent before.
    """
    from falsifier.campaigns import resume_campaign
    from falsifier.campaigns.directory import is_campaign
    from falsifier.cli.campaign import finish
    from falsifier.record.run import resume as resume_run, runs_in
    from falsifier.views.campaign_progress import campaign_display
    from falsifier.views.progress import make_display

    if is_campaign(directory):
        refuse(
            "the runs of a campaign keep their limit; --total simulations=N limits all of them", budget=budget
        )
        with campaign_display(quiet=quiet) as show:
            outcome = resume_campaign(directory, jobs=jobs or 1, limits=totals, listeners=[show])
        finish(directory, outcome, table="main", as_json=as_json)
    places = runs_in(directory)
    refuse(
        f"applies to campaigns only; the run {directory} keeps its number of jobs and its limits, except "
        "--budget",
        jobs=jobs,
        total=totals,
    )
    results: list[Result] = []
    with make_display(quiet=quiet) as display:
        for place in places:
            try:
                results += resume_run(place, budget=budget, listeners=[display])
            except (JournalError, SpecError) as error:  # such as a run whose problem was made in Python
                if len(places) == 1:
                    raise
                warn(f"falsifier: {error}; left as it is")
            if any(result.status == "interrupted" for result in results):
                break
    if not results:
        raise JournalError(f"{directory}: none of these {len(places)} runs can be continued here")
    _finish(results, as_json=as_json)


def _known(place: Path, problem: "Problem") -> "Candidate":
    """Read known inputs as they are, and say on stderr what of a file is not used."""
    from falsifier.counterexamples.case import read_known

    found, notes = read_known(place, problem)
    for note in notes:
        warn(f"{place}: {note}")
    return replace(found, rationale=f"from {utf_8(str(place))}")


def _finish(results: "list[Result]", *, as_json: bool) -> NoReturn:
    """Write the counterexamples, print the results, and end with the code of what the search found."""
    from falsifier.views.text import result_json, result_text, results_text

    code = None
    try:
        for result in results:
            if result.directory is not None:
                _write_counterexamples(result, result.directory)
    except KeyboardInterrupt:
        code = INTERRUPTED
        warn("interrupted: the results are complete; falsifier resume writes pictures that are missing")
    for reason in {result.unrecorded for result in results} - {""}:
        warn(f"falsifier: the end of the run could not be recorded: {reason}")
    text = result_text(results[0]) if len(results) == 1 else results_text(results)
    shown = [result_json(result) for result in results]
    statuses = {result.status for result in results}
    code = code or next(code for status, code in _EXIT_CODES.items() if status in statuses)
    conclude(as_shown(text, shown[0] if len(shown) == 1 else shown, as_json=as_json), code)


def _write_counterexamples(result: "Result", directory: Path) -> None:
    """Write the files of what was found; one that cannot be written is reported and costs nothing else."""
    from falsifier.cli.files import draw_evaluation, saved
    from falsifier.counterexamples.store import save, to_store
    from falsifier.views.text import counterexample_name

    name = counterexample_name(result)
    found = {} if result.counterexample is None else {name: result.counterexample}
    found |= {
        f"fragile-{i}{name.removeprefix('counterexample')}": fragile
        for i, fragile in enumerate(result.fragile, start=1)
    }
    for file, confirmation in found.items():
        if saved(directory / file, partial(save, to_store(confirmation))):
            picture = (directory / file).with_suffix(".png")
            draw_evaluation(confirmation.problem, confirmation.evaluation, picture)


def _sources(source: "ProblemSource") -> "tuple[ProblemSource, ...]":
    """Return one source per requirement of a spec, or the source if it is about one."""
    from falsifier.problem.loading import find_spec, sources_of

    if source.parts.kind in ("fmu", "python") or source.stl is not None:
        return (source,)
    # NN is the name of a spec and of one of its requirements, which is meant.
    several = sources_of(source)
    named = [each for each in several if each.name == find_spec(source.target)[0].stem]
    return (source,) if len(several) == 1 or named else tuple(several)
