"""``falsifier explain``, ``replay``, ``export``: on a counterexample, or the nearest miss of a run."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.cli import files, options
from falsifier.cli.command import command, refuse
from falsifier.cli.output import FAILED, INTERRUPTED, as_shown, conclude, say
from falsifier.core.files import write_whole
from falsifier.core.literals import one_line
from falsifier.core.words import candidate_facts, counted, in_one_line
from falsifier.counterexamples.case import Case, case_of, counterexample_case
from falsifier.counterexamples.explain import explain as explain_case
from falsifier.counterexamples.export import export_counterexample
from falsifier.counterexamples.export.scripts import replay_notes
from falsifier.counterexamples.export.tables import input_table, write_csv
from falsifier.counterexamples.regression import Database
from falsifier.counterexamples.robustness_map import BUDGET as MAP_BUDGET, robustness_map
from falsifier.counterexamples.shrink import BUDGET as SHRINK_BUDGET, shrink
from falsifier.counterexamples.store import EXPLANATION, SHRUNK, beside, replay as replay_stored, save
from falsifier.evaluation.confirm import confirm, other_interface
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.joining import rights_notes
from falsifier.problem.problem import Problem
from falsifier.stl.margins import signed
from falsifier.views.terminal import warn
from falsifier.views.text import broken_facts, confirmation_json, evaluation_json, fact_lines, problem_json

if TYPE_CHECKING:
    from falsifier.core.model import Interface

_FORMAT = b'{\n  "format"'  # how a counterexample's file begins
# What is printed: lines of text, and the content of the same as JSON.
Told = tuple[list[str], dict[str, Any]]


@command()
@options.run_argument
@click.option(
    "--shrink", "shrunk", is_flag=True, help="Write the simplest counterexample near it that still violates."
)
@click.option(
    "--map", "mapped", is_flag=True, help="Change all inputs at random; draw which changes still violate."
)
@options.budget_option(
    shown=f"{SHRINK_BUDGET}; with --map {MAP_BUDGET}, at least 7", note=" of --shrink or --map"
)
@click.option(
    "--at-most",
    type=float,
    metavar="ROBUSTNESS",
    help="With --shrink: maximum robustness of the simpler one; 0: any violation. Default: half that of "
    "the counterexample, or a tenth more than that of the nearest miss.",
)
@options.requirement_option
@options.out_option(
    "File to write; default: shrunk.json, or shrunk.csv for a nearest miss; with --map robustness-map.png."
)
@options.policy_options
@options.quiet_option
@options.json_option
def explain(
    *,
    run: Path,
    shrunk: bool,
    mapped: bool,
    budget: int | None,
    at_most: float | None,
    requirement: str | None,
    out: Path | None,
    quiet: bool,
    as_json: bool,
    **rights: Any,
) -> None:
    """Say why a counterexample violates, simplify it, or map the robustness around it.

    RUN is a run directory or a counterexample file. If a run falsified nothing, this is about its nearest
    miss, the simulation that came nearest to a violation.

    Without --shrink and --map: says what broke, and what happens if each input alone is reset; for a nearest
    miss it also draws nearest-miss.png. Except with --shrink, the shrunk counterexample of a run is used if
    there is one.
    """
    if shrunk and mapped:
        raise click.UsageError("--shrink and --map cannot be combined; run one after the other")
    if not shrunk:
        refuse("applies to --shrink only", at_most=at_most)
    if not (shrunk or mapped):
        refuse("add --shrink or --map", budget=budget, out=out)
    case = case_of(run, requirement, shrunk=not shrunk)
    if shrunk:
        lines, content = _shrink(case, rights, budget or SHRINK_BUDGET, at_most, out, quiet=quiet)
    elif mapped:
        lines, content = _map(case, run, rights, budget or MAP_BUDGET, out)
    else:
        lines, content = _explain(case, run, rights)
    only_drawn = shrunk and all(name.endswith(".png") for name in content["files"])
    is_lost = only_drawn or (mapped and not content["files"])  # what was to be written
    code = INTERRUPTED if content.get("interrupted") else FAILED if is_lost else 0
    conclude(as_shown("\n".join(lines), content, as_json=as_json), code)


@command()
@options.run_argument
@options.interface_option("FMI interface to simulate with; default: that of the run.")
@options.policy_options
@options.json_option
def replay(*, run: Path, interface: "Interface | None", as_json: bool, **rights: Any) -> None:
    """Simulate a counterexample again, even if the FMU or the requirement has changed since.

    RUN is a run directory or a counterexample file.

    Exit codes: 0 no longer violated, or fragile, 1 still violated, 2 it does not fit the problem, 3 the
    simulation failed.
    """
    case = counterexample_case(run)
    assert case.stored is not None, "a counterexample has a file"
    with _loaded(case, rights, today=True) as problem:
        case.admitted(problem)
        own = getattr(problem.model, "interface", None)
        judged = problem if interface in (None, own) else other_interface(problem)
        replayed = replay_stored(case.stored, judged)
        judged.model.close()
    assert replayed.evaluation is not None, "it fits: it is admitted"
    judgement = confirmation_json(replayed.evaluation, replayed.confirmation)
    content = _content(case, judged, judgement) | {"text": replayed.text}
    conclude(as_shown(replayed.text, content, as_json=as_json), 1 if replayed.status == "violates" else 0)


@command()
@options.run_argument
@options.out_option("New directory to write; default: export in RUN's directory.", metavar="DIR")
@click.option(
    "--store",
    type=options.PATH,
    metavar="DIR",
    help="Store the counterexample in this folder, for pytest --falsifier, and write nothing else.",
)
@options.policy_options
def export(*, run: Path, out: Path | None, store: Path | None, **rights: Any) -> None:
    """Write a counterexample for FMPy, fmusim, OpenModelica and Simulink, or store it for pytest.

    RUN is a run directory or a counterexample file.
    """
    if store is not None:
        refuse("--store writes nothing else; export to it in another command", out=out)
    case = counterexample_case(run)
    assert case.stored is not None, "a counterexample has a file"
    directory = out or beside(case.file, "export")
    if store is None:
        files.made_folder(directory)
    with _loaded(case, rights) as problem:
        evaluation, stored = case.simulated(problem), case.stored
        if case.changes(problem):  # the files are about one simulation
            stored = case.content(confirm(problem, evaluation))
        if store is not None:
            written = [Database(store).save(problem, stored)]
        else:
            written = export_counterexample(problem, stored, evaluation, directory)
            for note in replay_notes(problem.model):
                warn(f"replay.py: {note}")
    say("\n".join(map(str, written)))


def _shrink(
    case: Case,
    rights: Mapping[str, Any],
    budget: int,
    at_most: float | None,
    out: Path | None,
    *,
    quiet: bool,
) -> Told:
    """Write the simplest one that still violates, or of a nearest miss that comes about as near."""
    ending = ".csv" if case.is_miss else ".json"
    file = out or beside(case.file, f"shrunk{ending}")
    files.check_ending(file, (ending,))
    file = file.resolve() if file.is_symlink() else file  # a link is followed, not replaced
    if case.is_miss:
        files.check_out(file)
    files.check_out(file.with_suffix(".json"), begins=_FORMAT, kept=case.file)
    files.check_out(file.with_suffix(".npz"), begins=b"PK")
    files.check_out(file.with_suffix(".png"), holds=files.DRAWN)

    def said(simpler: Evaluation, n: int) -> None:
        if not quiet:
            what = in_one_line(simpler.candidate, problem.space)
            warn(f"simulation {n}: {what}; robustness {signed(simpler.robustness)}")

    with _loaded(case, rights) as problem:
        original = case.simulated(problem)
        shrunk = shrink(problem, original, budget=budget, at_most=at_most, progress=said)
        found = shrunk.evaluation
        confirmation = confirm(problem, found) if found.violated else None
        if confirmation is not None and confirmation.outcome == "refuted" and case.is_miss:
            confirmation = None  # else case.content says so
        table, data = input_table(problem, found.candidate), file.with_suffix(".json")
        if data.resolve() == beside(case.file, SHRUNK).resolve():  # which is explained instead from now on
            with suppress(OSError):
                beside(case.file, EXPLANATION).unlink(missing_ok=True)
        paths = files.saved(file, lambda name: write_csv(table, name, problem.model)) if case.is_miss else []
        if confirmation is not None:
            paths += files.saved(data, partial(save, case.content(confirmation)))
            if found.trajectory is not None:  # for reports, which simulate nothing
                files.saved(file.with_suffix(".npz"), found.trajectory.save)
        paths += files.draw_evaluation(problem, found, file.with_suffix(".png"))
    content = _content(case, problem, confirmation_json(found, confirmation), paths) | {
        "minimal": shrunk.minimal,
        "at_most": shrunk.at_most,
        "spent": {"simulations": shrunk.simulations},
    }
    end = "nothing simpler found nearby" if shrunk.minimal else "the budget is used up"
    done = "not shrunk" if in_one_line(found.candidate) == in_one_line(original.candidate) else "shrunk"
    head = f"{problem.name}: {done} with {counted(shrunk.simulations, 'simulation')}; {end}"
    facts = list[tuple[str, str]]()
    if confirmation is not None:
        simpler = "this simpler input violates the requirement: " if case.is_miss else ""
        facts.append((confirmation.outcome, f"{simpler}{confirmation.reason}"))
        facts += broken_facts(confirmation.evaluation.verdict)
    share = "a tenth more than before" if case.is_miss else "half of the original's"
    allowed = "" if found.violated and case.is_miss else f"; up to {signed(shrunk.at_most)} was allowed"
    allowed += f", {share}; --at-most changes it" if allowed and at_most is None else ""
    facts.append(("robustness", f"{signed(found.robustness)}{allowed}"))
    facts += candidate_facts(found.candidate, problem.space)
    if confirmation is not None and case.changes(problem):
        facts.append(("note", "not of the run's FMU and spec: its reports show the original"))
    facts += [("files", ", ".join(map(str, paths)))] if paths else []
    lines = [*([case.text] if case.is_miss else []), head, *fact_lines(facts)]
    return list(map(one_line, lines)), content


def _explain(case: Case, run: Path, rights: Mapping[str, Any]) -> Told:
    """Tell what broke, and what resetting each input alone comes to."""
    pictures: list[Path] = []
    with _loaded(case, rights) as problem:
        evaluation = case.simulated(problem)
        explanation = explain_case(problem, evaluation)
        if case.is_miss:
            pictures = files.draw_evaluation(problem, evaluation, beside(case.file, "nearest-miss.png"))
        about = "\n".join([*case.changes(problem), explanation.text])  # reports repeat it
    with suppress(OSError):  # it is printed anyway
        write_whole(beside(case.file, EXPLANATION), f"{about}\n")
    content = _content(case, problem, evaluation_json(evaluation), pictures) | {
        "text": explanation.text,
        "effects": [asdict(effect) for effect in explanation.effects],
    }
    drawn = [f"picture: {picture}" for picture in pictures]
    return [*_about(case, problem, run), explanation.text, *drawn], content


def _map(case: Case, run: Path, rights: Mapping[str, Any], budget: int, out: Path | None) -> Told:
    """Draw the robustness around it."""
    from falsifier.views.plotting import plot_robustness_map

    picture = beside(case.file, "robustness-map.png") if out is None else files.checked_picture(out)
    with _loaded(case, rights) as problem:
        evaluation = case.simulated(problem)
        found = robustness_map(problem, evaluation, budget=budget)
    drawn = files.draw(lambda: plot_robustness_map(found, problem.name), picture)
    labels = (coordinate.label for coordinate in found.coordinates)
    content = _content(case, problem, evaluation_json(evaluation), drawn) | {
        "smallest_robustness": found.smallest,
        "interrupted": found.interrupted,
        "persistence": [{"size": size, "share": share} for size, share in found.persistence],
        "rank_correlations": dict(zip(labels, found.influences, strict=True)),
    }
    told = [f"{problem.name}: {found.text}", *fact_lines(("picture", str(file)) for file in drawn)]
    return [*_about(case, problem, run), *told], content


def _content(
    case: Case, problem: Problem, simulated: Mapping[str, Any], written: Iterable[Path] = ()
) -> dict[str, Any]:
    """Return what the JSON of all these commands has: what it is about, and one evaluation."""
    about = {"about": str(case.place), **problem_json(problem)}
    return {**about, **simulated, "files": list(map(str, written))}


def _about(case: Case, problem: Problem, named: Path) -> list[str]:
    """Say what a text is about if that is not what was named."""
    if case.is_miss:
        return [one_line(case.text)]
    if case.file == named or not case.is_shrunk:
        return []
    lines = fact_lines(candidate_facts(case.candidate, problem.space))
    return [f"This is about {case.place}, the shrunk counterexample:", *lines]


@contextmanager
def _loaded(case: Case, rights: Mapping[str, Any], *, today: bool = False) -> Iterator[Problem]:
    """Load the problem, say what its FMU may do, and close the model at the end.

    Unless ``today``, its formula is the recorded one, and what has changed since is said.
    """
    problem, withheld = case.problem(allow=rights["allow"], deny=rights["deny"])
    for note in rights_notes(problem.model):
        warn(note)
    if withheld:
        warn(f"not allowed, as when this was recorded: {', '.join(withheld)}; --allow grants it")
    for change in () if today else case.changes(problem):
        warn(f"{case.place}: {change}")
    with closing(problem.model):
        yield problem if today else case.as_recorded(problem)
