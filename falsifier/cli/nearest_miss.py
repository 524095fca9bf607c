"""What commands on counterexamples do with the nearest miss of a run that falsified nothing."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from falsifier.cli.files import check_out, draw_evaluation, write_counterexample
from falsifier.cli.output import say
from falsifier.core.literals import one_line
from falsifier.core.words import candidate_lines, counted, in_one_line
from falsifier.counterexamples.nearest_miss import NearestMiss
from falsifier.counterexamples.shrink import Shrunk, shrink_miss
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.stl.margins import margin_words, signed
from falsifier.views.terminal import warn
from falsifier.views.text import broken_rows, evaluation_json


def nearest_miss_line(miss: NearestMiss) -> str:
    """Say what a nearest miss is, before anything is said about it."""
    return (
        f"{miss.requirement} was not falsified in {counted(miss.simulations, 'simulation')}; this is about "
        f"the nearest miss, with robustness {signed(miss.robustness)} ({margin_words(miss.robustness)})."
    )


def draw_nearest_miss(miss: NearestMiss, problem: Problem, evaluation: Evaluation) -> Path | None:
    """Write its picture into the run directory; None if it cannot be drawn, which is reported on stderr."""
    return draw_evaluation(problem, evaluation, miss.beside("nearest-miss.png"))


def shrink_nearest_miss(
    miss: NearestMiss, *, budget: int, within: float | None, out: Path | None, as_json: bool
) -> None:
    """Write the simplest input that comes about as near to a violation, or one that violates."""
    file = miss.beside("shrunk.csv") if out is None else out.resolve()
    check_out(file, beginnings=(b'"time"',))
    problem = miss.problem()
    try:
        shrunk = shrink_miss(
            problem,
            miss.simulated(problem),
            budget=budget,
            within=within,
            progress=lambda simpler, n: warn(
                f"simulation {n}: {in_one_line(simpler.candidate)}; robustness {signed(simpler.robustness)}"
            ),
        )
        confirmation = confirm(problem, shrunk.evaluation) if shrunk.evaluation.violated else None
        if confirmation is not None and confirmation.outcome != "refuted":
            files = write_counterexample(confirmation, file.parent, name=file.with_suffix(".json").name)
        else:
            files = _written(problem, shrunk.evaluation, file)
    finally:
        problem.model.close()
    found = shrunk.evaluation
    if as_json:
        content: dict[str, Any] = {
            "violated": found.violated,
            "outcome": confirmation and confirmation.outcome,
        }
        content |= {**evaluation_json(found), "minimal": shrunk.minimal, "simulations": shrunk.simulations}
        content |= {"largest_robustness": -shrunk.least_margin, "files": list(map(str, files))}
        say(json.dumps(content, indent=2))
        return
    lines = [nearest_miss_line(miss), shrunk_line(problem, shrunk, budget)]
    if confirmation is not None:
        lines.append(f"  violated       this simpler input violates the requirement: {confirmation.reason}")
        lines += [f"  {row}" for row in broken_rows(found.verdict)]
    else:
        tenth = ", a tenth more than before; --within changes it" if within is None else ""
        allowed = f"up to {signed(-shrunk.least_margin)} was allowed{tenth}"
        lines.append(f"  robustness     {signed(found.robustness)}; {allowed}")
    lines += [f"  {line}" for line in candidate_lines(found.candidate, problem.space)]
    lines.append(f"  files          {', '.join(map(str, files))}")
    say("\n".join(map(one_line, lines)))


def shrunk_line(problem: Problem, shrunk: Shrunk, budget: int) -> str:
    """Say how shrinking ended."""
    end = "no simpler one found nearby"
    if not shrunk.minimal:
        end = f"the budget of {counted(budget, 'simulation')} is used up"
    return f"{problem.name}: shrunk with {counted(shrunk.simulations, 'simulation')}; {end}"


def refuse(reason: str, options: Mapping[str, object]) -> None:
    """Refuse options that do not apply.

    Raises:
        click.UsageError: naming those that were given.
    """
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise click.UsageError(f"{', '.join(given)}: {reason}")


def _written(problem: Problem, evaluation: Evaluation, file: Path) -> list[Path]:
    from falsifier.counterexamples.export.inputs import input_table
    from falsifier.counterexamples.export.tables import write_csv

    files = [write_csv(input_table(problem, evaluation.candidate), file, problem.model)]
    picture = draw_evaluation(problem, evaluation, file.with_suffix(".png"))
    return files if picture is None else [*files, picture]
