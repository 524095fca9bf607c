"""``falsifier bench`` and ``falsifier watch``."""

import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NoReturn

import click

from falsifier.campaigns import CampaignEnd, CampaignRequest, Follower, cross, run_campaign, suite
from falsifier.campaigns.analysis import load, not_begun, read_published
from falsifier.campaigns.archcomp import PROTOCOL_PARAMETERIZATION, PROTOCOL_SIMULATIONS, SUITES
from falsifier.campaigns.directory import is_campaign
from falsifier.campaigns.request import Method, Searcher, ceiling, method_of
from falsifier.campaigns.runner import check_request
from falsifier.campaigns.tables import TABLES, statistics_json
from falsifier.cli import llm_options, options
from falsifier.cli.command import command, refuse
from falsifier.cli.files import new_directory
from falsifier.cli.output import FAILED, conclude, say
from falsifier.core.files import write_whole
from falsifier.core.literals import shell_word
from falsifier.core.words import counted
from falsifier.engines import DEFAULT_ENGINE
from falsifier.problem.loading import sources_of
from falsifier.problem.source import Parameterization, ProblemSource
from falsifier.record.journal import check_new
from falsifier.search import DEFAULT_SIMULATIONS
from falsifier.search.budget import Budget
from falsifier.search.make_engines import LLM_ENGINES, price_of
from falsifier.search.request import LLMSettings
from falsifier.views.campaign_progress import campaign_display, overall_line
from falsifier.views.terminal import warn

# Time in s between two updates of falsifier watch.
_WATCH_PERIOD = 0.5

_BENCH_HELP = """Run requirements x methods x seeds and print a table in the format of the ARCH-COMP category.

TARGETS are requirements (AT1) or specs with all their requirements (my.toml); without targets, give --suite.
Each run has the defaults of falsifier run; with --suite, those of the competition. With --llm, the engines
llm and hybrid ask it, and the others run as they are.

\b
falsifier bench --suite arch-comp --engine surrogate --runs 10 --budget 1500 --jobs 2
falsifier bench AT CC --llm openai/gpt-5-nano@low --variant MP1 --variant MP4 --table ablation
falsifier bench AT1 --llm openai/gpt-5-mini --engine llm --engine uniform --engine surrogate

Exit codes: 0 all runs finished, 2 wrong usage or spec, 3 some runs failed or were stopped.
"""


@command(help=_BENCH_HELP)
@click.argument("targets", nargs=-1)
@click.option("--suite", "suite_name", type=click.Choice(SUITES), help="Published list of requirements.")
@options.policy_options
@options.parameterization_option(
    multiple=True, default=f"{options.DEFAULT_PARAMETERIZATION}; with --suite {PROTOCOL_PARAMETERIZATION}"
)
@options.engine_option(multiple=True)
@partial(llm_options.llm_options, multiple=True)
@llm_options.context_option
@options.count_option(
    "--runs", "Number of runs per requirement and method, each with its own seed.", default=10
)
@options.seed_option("Random seed of the first run; the others count up.")
@options.budget_option(shown=f"{DEFAULT_SIMULATIONS}; with --suite {PROTOCOL_SIMULATIONS}", note=" per run")
@options.limit_options(note=" per run")
@options.total_option
@options.jobs_option("runs")
@click.option(
    "--table", type=click.Choice(list(TABLES)), default="main", show_default=True, help="Table to print."
)
@options.out_option("Campaign directory; default: runs/bench-TIME.", metavar="DIR")
@click.option("--yes", is_flag=True, help="Do not ask whether to pay for language models.")
@options.quiet_option
@options.json_option
def bench(
    *,
    targets: tuple[str, ...],
    suite_name: str | None,
    parameterizations: tuple[options.Parameterized, ...],
    engines: tuple[str, ...],
    llms: tuple[str, ...],
    variants: tuple[str, ...],
    context: tuple[str, ...],
    runs: int,
    seed: int,
    totals: Budget | None,
    jobs: int,
    table: str,
    out: Path | None,
    yes: bool,
    quiet: bool,
    as_json: bool,
    **given: Any,
) -> None:
    profile, kinds = _kinds(
        parameterizations, PROTOCOL_PARAMETERIZATION if suite_name else options.DEFAULT_PARAMETERIZATION
    )
    if bool(targets) == (suite_name is not None):
        raise click.UsageError("expected either TARGETS (requirements or specs) or --suite")
    # A spec without a requirement's name stands for all its requirements.
    problems = (
        suite(suite_name, profile=profile)
        if suite_name
        else [s for target in targets for s in sources_of(ProblemSource(target=target, profile=profile))]
    )
    llm_options.check_context(context, [] if llms else [engine or None for engine in engines or ("",)])
    changes = {"changes": options.changes_in(given)}
    problems = [
        source.model_copy(update=changes | {"parameterization": kind, "context": (*source.context, *context)})
        for source in problems
        for kind in kinds
    ]
    # The competition's 1500 simulations may be 1500 paid questions.
    usual = PROTOCOL_SIMULATIONS if suite_name and not llms else DEFAULT_SIMULATIONS
    budget = llm_options.read_budget(given, asks=bool(llms), usual=usual)
    stated = given["api_base"]
    how = llm_options.llm_settings({"llm": next(iter(llms), None), **given})
    searchers = _searchers(engines, llms, variants, how, stated)
    request = CampaignRequest(
        runs=cross(problems, searchers, seeds=range(seed, seed + runs), budget=budget), limits=totals
    )
    if table != "main" and not llms:
        raise click.UsageError(f"--table {table}: shows language models; name one with --llm, or drop it")
    directory = out or new_directory("bench")
    check_new(directory)
    check_request(request)
    warn(f"{counted(len(request.runs), 'run')} in {directory}")
    searched: dict[Method, set[str]] = {}
    for run in request.runs:
        searched.setdefault(method_of(run), set()).add(run.problems[0].name)
    for method, names in searched.items():
        label = replace(method, parameterization="fixed").label
        of = "" if names == set().union(*searched.values()) else f" of {', '.join(sorted(names))}"
        warn(f"{label}: {method.parameterization} parameterization{of}")
    _agree(request, yes=yes)
    with campaign_display(quiet=quiet) as show:
        outcome = run_campaign(request, directory, jobs=jobs, listeners=[show])
    finish(directory, outcome, table=table, as_json=as_json)


@command()
@options.directory_argument
@click.option("--page", is_flag=True, help="Serve a web page of it, on this machine only, until Ctrl-C.")
@click.option("--allow-stop", is_flag=True, help="With --page: add a button that stops the run, like Ctrl-C.")
def watch(*, directory: Path, page: bool, allow_stop: bool) -> None:
    """Follow the run or campaign in DIRECTORY from another terminal until it ends or is stopped.

    This writes nothing to DIRECTORY unless somebody presses the button that --allow-stop adds. The page
    can also be opened after the run has ended.
    """
    if page:
        import asyncio

        from falsifier.views.report.watch import serve

        page_of = serve(directory, announce=lambda address: say(f"page: {address}"), allow_stop=allow_stop)
        with suppress(KeyboardInterrupt):
            asyncio.run(page_of)
        return
    refuse("applies to --page only", allow_stop=allow_stop)
    follower = Follower(directory)
    with campaign_display() as show:
        while follower.is_worked_on:
            show(follower.look())
            time.sleep(_WATCH_PERIOD)
        progress = follower.look()  # after the lock was released: by then everything has been written
        show(progress)
    is_retried = is_campaign(directory)  # what failed in it
    for run in () if is_retried else progress.runs:
        say(str(replace(run, status="interrupted") if run.status == "running" else run))
    say(overall_line(progress, stopped=True))
    ended = [r for r in progress.runs if r.status == "failed" and r.unjudged and not is_retried]
    if progress.finished + len(ended) < len(progress.runs):
        say(f"stopped; to continue: falsifier resume {shell_word(directory)}")


def finish(directory: Path, outcome: CampaignEnd, *, table: str, as_json: bool) -> NoReturn:
    """Save all tables, print one of them, and exit with the campaign's exit code."""
    begun, published = load(directory), read_published()
    runs = [*begun, *not_begun(directory, begun)]
    tables = {name: make(runs, published) for name, make in TABLES.items()}
    for name, made in tables.items():
        if made.rows:
            write_whole(directory / f"table-{name}.md", made.markdown())
            write_whole(directory / f"table-{name}.csv", made.csv())
    data = statistics_json(runs)
    write_whole(directory / "table.json", data)
    again = f"falsifier resume {shell_word(directory)}"
    if outcome.reason:
        warn(f"stopped: {outcome.reason}; to continue: {again}")
    failed = outcome.progress.counts["failed"]
    if failed:
        warn(f"{counted(failed, 'run')} failed; to retry: {again}")
    shown = tables[table]
    while sys.stdout.isatty() and len(shown.header) > 3 and shown.width > shutil.get_terminal_size().columns:
        shown = shown.only(*shown.header[:-1])
    if cut := tables[table].header[len(shown.header) :]:
        warn(f"too wide for this terminal: {', '.join(cut)}; in {directory / f'table-{table}.md'}")
    conclude(data if as_json else shown.text(), FAILED if failed or outcome.reason else 0, nl=not as_json)


def _agree(request: CampaignRequest, *, yes: bool) -> None:
    """Say about what language models can cost; ask on a terminal."""
    most = ceiling(request, price_of)
    if most is None:
        return
    warn(most.text)
    if not yes and most.cost != 0 and sys.stdin.isatty():
        click.confirm("Start?", abort=True, err=True)


def _kinds(
    given: Sequence[options.Parameterized], default: Parameterization
) -> tuple[str | None, tuple[Parameterization, ...]]:
    """Return the profile of all runs, of which there may be one, and their parameterizations."""
    profiles = {chosen.profile for chosen in given}
    if len(profiles) > 1:
        raise click.UsageError("--parameterization: all runs of a campaign must have the same profile")
    if any(chosen.shortest_piece is not None for chosen in given):
        raise click.UsageError("--parameterization free:SECONDS: applies to single runs only; write free")
    kinds = tuple(dict.fromkeys(chosen.kind or default for chosen in given))
    return next(iter(profiles), None), kinds or (default,)


def _searchers(
    engines: Sequence[str],
    llms: Sequence[str],
    variants: Sequence[str],
    how: LLMSettings | None,
    api_base: str | None,
) -> list[Searcher]:
    """Engines, those that ask an LLM once for each LLM and variant; without engines, the LLMs alone."""
    if how is None:
        refuse("requires --llm NAME", variant=variants)
        return [*(engines or (DEFAULT_ENGINE,))]
    models = []
    for llm, variant in product(llms, variants or (None,)):
        name, effort = llm_options.name_and_effort(llm)
        # Without an address, each has that of its own provider.
        decided = {"name": name, "effort": effort, "variant": variant, "api_base": api_base}
        models.append(LLMSettings.model_validate(how.model_dump() | decided))
    # If no engine asks one, all are paired with it, which is refused where requests are checked.
    asking = {*engines} & {*LLM_ENGINES} or {*engines}
    searchers: list[Searcher] = [] if engines else [*models]
    for engine in engines:
        searchers += product([engine], models) if engine in asking else [engine]
    return searchers
