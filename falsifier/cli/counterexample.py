"""Commands on counterexamples: ``replay``, ``shrink``, ``explain``, ``export``, ``robustness-map``.

Of a run that falsified nothing, ``shrink``, ``explain`` and ``robustness-map`` take the nearest miss.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from falsifier.cli.llm_options import (
    api_base_option,
    effort_option,
    llm_option,
)
from falsifier.cli.nearest_miss import (
    draw_nearest_miss,
    nearest_miss_line,
    refuse,
    shrink_nearest_miss,
    shrunk_line,
)
from falsifier.cli.options import (
    budget_option,
    json_option,
    out_option,
    run_argument,
    seed_option,
    store_option,
)
from falsifier.cli.output import conclude, say
from falsifier.core.candidate import Candidate
from falsifier.core.literals import one_line
from falsifier.core.words import candidate_lines, in_one_line
from falsifier.counterexamples.nearest_miss import NearestMiss, Subject, asked_about
from falsifier.counterexamples.store import (
    Database,
    Replayed,
    StoredCounterexample,
    beside,
    counterexample_file,
    load,
    problem_of,
    shrunk_file,
    to_store,
)
from falsifier.counterexamples.store import (
    replay as replay_stored,
)
from falsifier.errors import CandidateError, SpecError
from falsifier.evaluation.confirm import Confirmation, confirm, other_interface
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.problem.joining import rights_notes
from falsifier.problem.problem import Problem
from falsifier.stl.margins import shown, signed
from falsifier.views.terminal import warn
from falsifier.views.text import broken_rows

# Shrinking usually reaches a local minimum with fewer simulations.
_SHRINK_BUDGET = 500

_requirement_option = click.option(
    "--requirement", metavar="NAME", help="Which one, if RUN searched several requirements."
)


@click.command()
@run_argument
@click.option(
    "--other-interface", "other", is_flag=True, help="Simulate through the FMU's other FMI interface."
)
@json_option
def replay(*, run: Path, other: bool, as_json: bool) -> None:
    """Simulate a counterexample again, even if the FMU or the requirement has changed since.

    RUN is a run directory or a counterexample file.

    Exit codes: 0 no longer violated, or fragile, 1 still violated, 2 it does not fit the problem, 3 the
    simulation failed.
    """
    stored = load(run)
    with _problem(stored) as problem:
        judged = other_interface(problem) if other else problem
        replayed = replay_stored(stored, judged)
        judged.model.close()
    if replayed.status == "does not fit":
        raise CandidateError(replayed.text)
    text = json.dumps(_replayed_json(replayed), indent=2) if as_json else replayed.text
    conclude(text, 1 if replayed.status == "violates" else 0)


@click.command()
@run_argument
@budget_option(_SHRINK_BUDGET)
@click.option(
    "--margin",
    type=float,
    help="Margin to keep: the robustness stays at or below minus this value. Default: half of the "
    "original's; 0: any violation will do.",
)
@click.option(
    "--within",
    type=float,
    help="For a nearest miss: the robustness may grow by this value. Default: a tenth of it.",
)
@_requirement_option
@out_option("File to write; default: shrunk.json in RUN's directory; of a nearest miss shrunk.csv.")
@store_option
@json_option
def shrink(
    *,
    run: Path,
    budget: int,
    margin: float | None,
    within: float | None,
    requirement: str | None,
    out: Path | None,
    store: Path | None,
    as_json: bool,
) -> None:
    """Make a counterexample as simple as possible while it still violates; the original is kept.

    RUN is a run directory or a counterexample file. Of a run that falsified nothing, the input that came
    nearest to a violation is made as simple as possible while it still comes about as near.
    """
    found = asked_about(run, requirement)
    if isinstance(found, NearestMiss):
        refuse("a nearest miss is no counterexample", {"--margin": margin, "--store": store})
        shrink_nearest_miss(found, budget=budget, within=within, out=out, as_json=as_json)
        return
    refuse("applies to the nearest miss of a run that falsified nothing", {"--within": within})
    file, stored = found
    _shrink(file, stored, budget=budget, margin=margin, out=out, store=store, as_json=as_json)


def _shrink(
    original: Path,
    stored: StoredCounterexample,
    *,
    budget: int,
    margin: float | None,
    out: Path | None,
    store: Path | None,
    as_json: bool,
) -> None:
    from falsifier.cli.files import check_out, write_counterexample
    from falsifier.counterexamples.shrink import shrink as shrink_violation

    # A link is followed, not replaced.
    file = shrunk_file(original) if out is None else out.resolve()
    check_out(file, beginnings=(b'{\n  "format"',), kept=original)
    with _problem(stored) as problem:
        shrunk = shrink_violation(
            problem,
            _simulated(stored, problem),
            budget=budget,
            margin=margin,
            progress=lambda simpler, n: warn(f"simulation {n}: {_inputs_line(simpler)}"),
        )
        confirmation = confirm(problem, shrunk.evaluation)
    if confirmation.outcome == "refuted":
        raise SpecError(f"{original}: {confirmation.reason}")
    written = write_counterexample(confirmation, file.parent, name=file.name)
    if store is not None:
        written.append(Database(store).save(problem, to_store(confirmation)))
    if as_json:
        content = _confirmation_json(confirmation)
        content |= {"minimal": shrunk.minimal, "simulations": shrunk.simulations}
        content |= {"least_margin": shrunk.least_margin}
        say(json.dumps(content | {"files": list(map(str, written))}, indent=2))
        return
    say(shrunk_line(problem, shrunk, budget))
    say(f"  {confirmation.outcome:<13}  {confirmation.reason}")
    for line in broken_rows(confirmation.evaluation.verdict):
        say(f"  {line}")
    half = ", half of the original's; --margin changes it" if margin is None else ""
    say(f"  margin         at least {shown(shrunk.least_margin):.6g} was kept{half}")
    for line in candidate_lines(confirmation.evaluation.candidate, problem.space):
        say(f"  {line}")
    say(f"  files          {', '.join(map(str, written))}")


@click.command()
@run_argument
@llm_option()
@effort_option
@api_base_option
@_requirement_option
@json_option
def explain(
    *,
    run: Path,
    llm: str | None,
    effort: str | None,
    api_base: str | None,
    requirement: str | None,
    as_json: bool,
) -> None:
    """Explain in one paragraph what broke, and what resetting each input alone comes to.

    RUN is a run directory, whose shrunk counterexample is taken if there is one, or a counterexample file.
    Of a run that falsified nothing, the simulation that came nearest to a violation is explained, and drawn
    as nearest-miss.png. With --llm, a language model describes it in its own words, too.
    """
    from falsifier.counterexamples.explain import explain as explain_violation
    from falsifier.counterexamples.explain import narrate

    if llm is None and (effort is not None or api_base is not None):
        raise click.UsageError("--effort and --api-base require --llm NAME")
    found = asked_about(run, requirement, shrunk=True)
    chat = None
    if llm is not None:
        from falsifier.llm.connect import connect

        chat = connect(llm, effort=effort, api_base=api_base)
    with _subject(found) as (problem, evaluation):
        explanation = explain_violation(problem, evaluation)
        picture = draw_nearest_miss(found, problem, evaluation) if isinstance(found, NearestMiss) else None
    words = narrate(explanation, chat) if chat else None
    if as_json:
        effects = [asdict(e) for e in explanation.effects]
        told = {"llm": llm, "words": words} if words else None
        content: dict[str, Any] = {"violated": explanation.violated, "text": explanation.text}
        content |= {"effects": effects, "about": _about(found)}
        content |= {"told_by": told, "picture": picture and str(picture)}
        say(json.dumps(content, indent=2))
        return
    _say_about(found, problem, run)
    say(explanation.text)
    if words is not None:
        say(f"\nIn the words of {llm}, which may be wrong:\n{words}")
    if picture is not None:
        say(f"picture: {picture}")


@click.command()
@run_argument
@out_option("Directory to write; default: export in RUN's directory.", metavar="DIR")
@store_option
def export(*, run: Path, out: Path | None, store: Path | None) -> None:
    """Write a counterexample for FMPy, fmusim, OpenModelica, Simulink and pytest.

    RUN is a run directory or a counterexample file.
    """
    from falsifier.counterexamples.export import export_counterexample

    stored = load(run)
    directory = out or beside(counterexample_file(run), "export")
    with _problem(stored) as problem:
        written = export_counterexample(problem, stored, _simulated(stored, problem), directory)
    if store is not None:
        written.append(Database(store).save(problem, stored))
    for path in written:
        say(str(path))


@click.command("robustness-map")
@run_argument
@click.option(
    "--radius",
    type=float,
    default=0.05,
    show_default=True,
    help="Largest change of an input, as a share of its range.",
)
@click.option(
    "--samples", type=int, default=256, show_default=True, help="Number of random changes to simulate."
)
@click.option("--grid", type=int, default=21, show_default=True, help="Points per side of the map.")
@seed_option()
@_requirement_option
@out_option("Picture to write; default: robustness-map.png in RUN's directory.")
@json_option
def robustness_map(
    *,
    run: Path,
    radius: float,
    samples: int,
    grid: int,
    seed: int,
    requirement: str | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Change the inputs of a counterexample at random and plot where they still violate.

    RUN is a run directory, whose shrunk counterexample is taken if there is one, or a counterexample file.
    Of a run that falsified nothing, the inputs that came nearest to a violation are changed.
    """
    from falsifier.counterexamples.robustness_map import robustness_map
    from falsifier.views.plotting import plot_robustness_map, save_figure

    about, name = asked_about(run, requirement, shrunk=True), "robustness-map.png"
    picture = out or (about.beside(name) if isinstance(about, NearestMiss) else beside(about[0], name))
    with _subject(about) as (problem, evaluation):
        found = robustness_map(problem, evaluation, radius=radius, samples=samples, points=grid, seed=seed)
    save_figure(plot_robustness_map(found, problem.name), picture)
    if as_json:
        content = {
            "original": found.original,
            "smallest": found.smallest,
            "persistence": [{"size": size, "share": share} for size, share in found.persistence],
            "rank_correlations": {
                c.label: r for c, r in zip(found.coordinates, found.influences, strict=True)
            },
            "about": _about(about),
            "picture": str(picture),
        }
        say(json.dumps(content, indent=2))
        return
    _say_about(about, problem, run)
    say(f"{problem.name}: {found.text}")
    say(f"  picture        {picture}")


def _about(found: Subject) -> str:
    """The file of a counterexample, or the run directory of a nearest miss."""
    return str(found.directory if isinstance(found, NearestMiss) else found[0])


def _say_about(found: Subject, problem: Problem, named: Path) -> None:
    """Say what a text is about if that is not what was named."""
    if isinstance(found, NearestMiss):
        say(one_line(nearest_miss_line(found)))
    elif found[0] != named and found[0].stem.startswith("shrunk"):
        say(f"This is about {found[0]}, the shrunk counterexample:")
        for line in candidate_lines(Candidate.from_json(found[1].candidate), problem.space):
            say(f"  {line}")


@contextmanager
def _problem(stored: StoredCounterexample) -> Iterator[Problem]:
    """Load the problem of a counterexample, and close its model at the end."""
    problem = problem_of(stored)
    for note in rights_notes(problem.model):
        warn(note)
    try:
        yield problem
    finally:
        problem.model.close()


@contextmanager
def _subject(found: Subject) -> Iterator[tuple[Problem, Evaluation]]:
    """Load the problem of what was asked about, simulate that again, and close the model at the end."""
    if isinstance(found, NearestMiss):
        problem = found.problem()
        try:
            yield problem, found.simulated(problem)
        finally:
            problem.model.close()
        return
    with _problem(found[1]) as problem:
        yield problem, _simulated(found[1], problem)


def _simulated(stored: StoredCounterexample, problem: Problem) -> Evaluation:
    evaluation = evaluate(problem, problem.space.admit(Candidate.from_json(stored.candidate)))
    if not evaluation.violated:
        found = evaluation.reason or f"its robustness is now {signed(evaluation.robustness)}"
        raise SpecError(
            f"the counterexample of {problem.name} no longer violates: {found}; to search for another one: "
            "falsifier run"
        )
    return replace(evaluation, candidate=replace(evaluation.candidate, rationale=""))


def _inputs_line(evaluation: Evaluation) -> str:
    return f"{in_one_line(evaluation.candidate)}; robustness {signed(evaluation.robustness)}"


def _replayed_json(replayed: Replayed) -> dict[str, Any]:
    return {
        "status": replayed.status,
        "robustness": replayed.evaluation and replayed.evaluation.robustness,
        "text": replayed.text,
    }


def _confirmation_json(confirmation: Confirmation) -> dict[str, Any]:
    return {
        **confirmation.evaluation.candidate.to_json(),
        "robustness": confirmation.robustness,
        "outcome": confirmation.outcome,
        "reason": confirmation.reason,
    }
