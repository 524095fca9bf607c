"""``falsifier bench`` and ``falsifier watch``."""

import time
from datetime import datetime
from itertools import product
from pathlib import Path
from typing import Any, NoReturn, get_args

import click

from falsifier.campaigns import (
    CampaignRequest,
    Follower,
    Method,
    Outcome,
    cross,
    is_worked_on,
    run_campaign,
    suite,
)
from falsifier.campaigns import resume_campaign as _resume
from falsifier.campaigns.analysis import load, read_published
from falsifier.campaigns.analysis.tables import TABLES, statistics_json
from falsifier.campaigns.suites import SUITES
from falsifier.cli.options import asking, asking_options, json_option, quiet_option
from falsifier.cli.output import conclude, say
from falsifier.core.files import write_whole
from falsifier.problem.loading import sources_of
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.request import Effort, LLMSettings
from falsifier.views.campaign_text import campaign_display, overall_line
from falsifier.views.terminal import warn

# Time in s between two looks of falsifier watch.
_WATCH_PERIOD = 0.5

jobs_option = click.option(
    "--jobs", type=int, default=1, show_default=True, help="Runs at a time on this machine."
)
executor_option = click.option(
    "--executor",
    metavar="dask:tcp://HOST:PORT",
    help="Run on a Dask cluster instead. Workers that do not see DIR are stopped by --total-... between runs "
    "only.",
)
table_option = click.option(
    "--table", "table", type=click.Choice(list(TABLES)), default="main", show_default=True
)


@click.command()
@click.argument("targets", nargs=-1)
@click.option("--suite", "suite_name", type=click.Choice(SUITES), help="A known list of requirements.")
@click.option("--instance", type=click.Choice(["1", "2"]), help="Of the suite: its parameterization.")
@click.option("--profile", help="Another parameterization that the specs offer.")
@click.option(
    "--parameterization", multiple=True, type=click.Choice(["fixed", "free"]), help="Default: fixed."
)
@click.option("--engine", "engines", multiple=True, metavar="NAME", help="Search engine. Repeatable.")
@click.option("--llm", "llms", multiple=True, metavar="NAME[@EFFORT]", help="Language model. Repeatable.")
@click.option("--effort", type=click.Choice(get_args(Effort)), help="Of llms without one of their own.")
@click.option("--variant", "variants", multiple=True, metavar="MP1..", help="Prompt variant. Repeatable.")
@asking_options
@click.option("--runs", type=click.IntRange(1), default=10, show_default=True, help="Runs of each.")
@click.option("--seed", type=int, default=0, show_default=True, help="Of the first run; others count up.")
@click.option("--budget", type=int, default=1500, show_default=True, help="Most simulations a run.")
@click.option("--seconds", type=float, help="Most wall-clock seconds a run.")
@click.option("--max-tokens", type=int, help="Most tokens of the language model a run.")
@click.option("--max-cost", type=float, help="Most US dollars for the language model a run.")
@click.option("--total-budget", type=int, help="Most simulations of all runs together.")
@click.option("--total-seconds", type=float, help="Most wall-clock seconds of the campaign.")
@click.option("--total-tokens", type=int, help="Most tokens of all runs together.")
@click.option("--total-cost", type=float, help="Most US dollars of all runs together.")
@click.option("--calls", type=click.IntRange(1), default=8, show_default=True, help="Model runs at a time.")
@jobs_option
@executor_option
@table_option
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Default: runs/NAME-TIME.")
@quiet_option
@json_option
def bench(
    *,
    targets: tuple[str, ...],
    suite_name: str | None,
    instance: str | None,
    profile: str | None,
    parameterization: tuple[str, ...],
    engines: tuple[str, ...],
    llms: tuple[str, ...],
    effort: str | None,
    variants: tuple[str, ...],
    runs: int,
    seed: int,
    budget: int,
    seconds: float | None,
    max_tokens: int | None,
    max_cost: float | None,
    total_budget: int | None,
    total_seconds: float | None,
    total_tokens: int | None,
    total_cost: float | None,
    calls: int,
    jobs: int,
    executor: str | None,
    table: str,
    out: Path | None,
    quiet: bool,
    as_json: bool,
    **options: Any,
) -> None:
    r"""Run requirements x methods x seeds and print the protocol's table.

    TARGETS are requirements (AT1), specs with all their requirements (my.toml), or none with --suite.

    \b
    falsifier bench --suite arch-comp --engine surrogate --runs 10 --budget 1500 --jobs 2
    falsifier bench AT CC --llm openai/gpt-5-nano@low --variant MP1 --variant MP4 --table ablation

    Exit code 0: all runs finished; 3: some failed or were stopped.
    """
    if instance is not None:
        if suite_name is None or profile is not None:
            raise click.UsageError("--instance belongs to --suite, and goes without --profile")
        profile = "instance2" if instance == "2" else None
    if bool(targets) == (suite_name is not None):
        raise click.UsageError("give requirements or specs, or --suite")
    problems = suite(suite_name, profile=profile) if suite_name else _problems(targets, profile)
    how = LLMSettings(name="", **asking(options, named=bool(llms)))
    methods = _methods(engines, llms, effort, variants, parameterization or ("fixed",), profile or "", how)
    limits = (total_budget, total_seconds, total_tokens, total_cost)
    request = CampaignRequest(
        runs=cross(
            problems,
            methods,
            seeds=range(seed, seed + runs),
            budget=Budget(budget, seconds, max_tokens, max_cost),
            asking=how,
        ),
        limits=Budget(*limits) if any(x is not None for x in limits) else None,
        calls=calls,
        suite=suite_name,
    )
    directory = out or Path("runs") / f"bench-{datetime.now():%Y%m%d-%H%M%S}"
    warn(f"{len(request.runs)} runs in {directory}")
    with campaign_display(quiet=quiet) as show:
        outcome = run_campaign(request, directory, jobs=jobs, executor=executor, listeners=[show])
    finish(directory, outcome, table=table, as_json=as_json)


@click.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--once", is_flag=True, help="Say how far it is, and end.")
def watch(*, directory: Path, once: bool) -> None:
    """Follow the campaign in DIRECTORY from another shell until it ends or is stopped.

    Nothing is written there.
    """
    follower = Follower(directory)
    working = is_worked_on(directory)
    if not once:
        with campaign_display() as show:
            while working:
                show(follower.look())
                time.sleep(_WATCH_PERIOD)
                working = is_worked_on(directory)
            show(follower.look())
    progress = follower.look()  # after the lock: who let it go has written everything
    say(overall_line(progress, None, stopped=not working))
    if not working and progress.finished < len(progress.runs):
        say(f"stopped; falsifier resume {directory} goes on")


def resume_campaign(
    directory: Path, *, jobs: int, executor: str | None, limits: Budget | None, quiet: bool, as_json: bool
) -> None:
    """Go on with a campaign for ``falsifier resume``."""
    with campaign_display(quiet=quiet) as show:
        outcome = _resume(directory, jobs=jobs, executor=executor, limits=limits, listeners=[show])
    finish(directory, outcome, table="main", as_json=as_json)


def finish(directory: Path, outcome: Outcome, *, table: str, as_json: bool) -> NoReturn:
    """Save the tables, print one, and end with the exit code."""
    runs, published = load(directory), read_published()
    for name, make in TABLES.items():
        made = make(runs, published)
        if made.rows:
            write_whole(directory / f"table-{name}.md", made.markdown())
            write_whole(directory / f"table-{name}.csv", made.csv())
    data = statistics_json(runs)
    write_whole(directory / "table.json", data)
    if outcome.reason:
        warn(f"stopped: {outcome.reason}; go on with: falsifier resume {directory}")
    failed = outcome.progress.counts["failed"]
    if failed:
        warn(f"{failed} runs failed; falsifier resume {directory} tries them again")
    text = data if as_json else TABLES[table](runs, published).text()
    conclude(text, 3 if failed or outcome.reason else 0, nl=not as_json)


def _problems(targets: tuple[str, ...], profile: str | None) -> list[ProblemSource]:
    """One source for each requirement; a spec without a requirement's name stands for all that it has."""
    return [
        source for target in targets for source in sources_of(ProblemSource(target=target, profile=profile))
    ]


def _methods(
    engines: tuple[str, ...],
    llms: tuple[str, ...],
    effort: str | None,
    variants: tuple[str, ...],
    parameterizations: tuple[str, ...],
    profile: str,
    how: LLMSettings,
) -> list[Method]:
    """Engines alone, or engines x LLMs x variants if an LLM is named; each in all parameterizations."""
    if not llms and (variants or effort):
        raise click.UsageError("--variant and --effort need --llm NAME")
    named = [_llm(llm, effort) for llm in llms] or [("", "")]
    return [
        Method(engine, llm, level, variant, parameterization, profile, how.anonymous, how.fallback or "")
        for engine, (llm, level), variant, parameterization in product(
            engines or ("",), named, variants or ("",), parameterizations
        )
    ]


def _llm(text: str, effort: str | None) -> tuple[str, str]:
    """Name and effort of ``NAME`` or ``NAME@EFFORT``; other texts behind an @ belong to the name."""
    name, _, level = text.rpartition("@")
    return (name, level) if name and level in get_args(Effort) else (text, effort or "")
