"""The result of a run as text or JSON."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from falsifier.analyses.assess import Assurance
from falsifier.campaigns.progress import spent_together
from falsifier.core.literals import one_line, shell_word
from falsifier.core.ranges import number_names
from falsifier.core.words import candidate_facts, counted, in_unit, readable, resolving
from falsifier.counterexamples.store import file_of
from falsifier.errors import JournalError
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem, held_text
from falsifier.record import manifest
from falsifier.search.budget import Spent
from falsifier.search.findings import Finding
from falsifier.search.parameterization import parameterization_note, parameterization_of
from falsifier.search.result import Result, mostly_unjudged
from falsifier.stl import Verdict, parse
from falsifier.stl.margins import margin_words, shown, signed

# A name and what is said under it: a row of a table, or a line of text.
Fact = tuple[str, str]
# Names of the numbers of signals that are not real, by signal.
Labels = Mapping[str, Mapping[int, str]]


def result_text(result: Result) -> str:
    """Format one result as text."""
    head = f"{result.problem.name}: {result.status} after {result.spent.simulations_text}"
    head += f"{untested(result.findings)} ({seconds_text(result.spent)})"
    lines = [head, *fact_lines(result_facts(result))]
    place = shell_word(result.directory)
    if result.directory is not None and result.directory.is_dir():
        pictures = (("picture", str(picture)) for picture in _pictures(result))
        lines += fact_lines([("files", str(result.directory)), *pictures])
        if result.status == "not falsified" and result.best is not None:
            nearest = f"falsifier explain {place} (the nearest miss), " if not result.best.violated else ""
            lines.append(f"to look closer: {nearest}falsifier coverage {place} (what was tried)")
    if result.directory is not None and _can_continue(result):
        lines.append(_continue_line(result.directory))
    if result.status == "failed":
        lines.append(f"failed: {result.reason}")
    return "\n".join(map(one_line, lines))


def result_facts(result: Result) -> list[Fact]:
    """Return what is said of a result, in the order of reports, for terminals and notebooks.

    What broke and by which inputs, whether that is sure or why the run ended, what was not tested; then what
    engineers of searches ask.
    """
    problem, shown, found = result.problem, result.shown, result.counterexample
    facts = [("requirement", str(problem.requirement.formula))]
    if shown is not None:
        facts += [*broken_facts(shown.verdict), *candidate_facts(shown.candidate, problem.space)]
    if found is not None:
        facts.append(("confirmed", found.reason))
    elif result.status != "failed":
        facts.append(("reason", result.reason))
    if found is None and result.searched is not None and result.searched.inputs:
        facts.append(("inputs", parameterization_note(result.searched)))
    facts += [("note", finding.text) for finding in result.findings]
    if held := held_text(problem.held_inputs):
        facts.append(("not searched", held))
    facts += [("failed", failure.text) for failure in result.failures]
    facts += [("fragile", c.reason) for c in result.fragile]
    facts += [("not confirmed", c.reason) for c in result.refuted]
    if shown is not None:
        facts += margin_facts(shown.verdict, *_known(problem))
        facts += [("rationale", shown.candidate.rationale)] if shown.candidate.rationale else []
    facts += [("note", remark) for remark in result.remarks]
    facts += [("language model", llm_use(result.spent))] if result.spent.questions else []
    return facts


def untested(findings: Iterable[Finding]) -> str:
    """Say, at the end of a result, that something was not tested; empty if all was."""
    return ", and a part of it was not tested" if any(f.untested for f in findings) else ""


def results_text(results: Sequence[Result]) -> str:
    """Format the results of several requirements as text, one line each."""
    width = max(len(result.problem.name) for result in results)
    lines = []
    for result in results:
        shown, found = result.shown, result.counterexample
        robustness = "" if shown is None else f", robustness {signed(shown.robustness)}"
        where = "".join(f", {picture}" for picture in _pictures(result))
        lines.append(
            f"{result.problem.name:{width}}  {result.status} after "
            f"{result.spent.simulations_text}{untested(result.findings)}{robustness}{where}"
        )
        below = [] if found is None else list(broken_lines(found.evaluation.verdict))
        below += [f"{c.outcome}: {c.reason}" for c in (*result.fragile, *result.refuted)]
        below += [f"note: {text}" for text in (*(f.text for f in result.findings), *result.remarks)]
        below += [f"failed: {failure.text}" for failure in result.failures]
        lines += [f"{'':{width}}  {line}" for line in below]
    held = dict.fromkeys(held_text(r.problem.held_inputs) for r in results)
    lines += [f"not searched: {text}" for text in held if text]
    falsified = sum(result.counterexample is not None for result in results)
    spent = spent_together((result.directory, result.spent) for result in results)
    lines.append(f"{falsified} of {len(results)} falsified ({seconds_text(spent)})")
    lines += [f"language model: {llm_use(spent)}"] if spent.questions else []
    places = {result.directory for result in results if result.directory is not None}
    if len(places) > 1:  # requirements that are searched one after the other are below one directory
        places = {place.parent for place in places}
    if len(places) == 1 and any(map(_can_continue, results)):
        lines.append(_continue_line(*places))
    lines += dict.fromkeys(f"failed: {result.reason}" for result in results if result.status == "failed")
    return "\n".join(map(one_line, lines))


def counterexample_name(result: Result) -> str:
    """File name of a result's counterexample; results that share a directory have one each."""
    try:
        shared = result.directory is not None and manifest.read(result.directory).shared
    except JournalError:  # the directory was moved while the run wrote to it
        shared = True
    return file_of(result.problem.name, shared=shared)


def result_json(result: Result) -> dict[str, Any]:
    """Convert a result to a value that can be dumped as one JSON object."""
    found = result.counterexample
    return {
        **problem_json(result.problem),
        "status": result.status,
        "reason": result.reason,
        "counterexample": found and confirmation_json(found.evaluation, found),
        "best": result.best and evaluation_json(result.best),
        "parameterization": parameterization_of(result.searched or result.problem.space),
        "findings": [asdict(finding) for finding in result.findings],
        "failures": [asdict(failure) for failure in result.failures],
        "not_searched": [asdict(held) for held in result.problem.held],
        "fragile": [confirmation_json(c.evaluation, c) for c in result.fragile],
        "refuted": [confirmation_json(c.evaluation, c) for c in result.refuted],
        "remarks": list(result.remarks),
        "spent": asdict(result.spent),
        "directory": result.directory and str(result.directory),
    }


def evaluation_facts(problem: Problem, evaluation: Evaluation) -> list[Fact]:
    """Return what broke, the inputs, and what decided an evaluation."""
    verdict, inputs = evaluation.verdict, candidate_facts(evaluation.candidate, problem.space)
    return [*broken_facts(verdict), *inputs, *margin_facts(verdict, *_known(problem))]


def _known(problem: Problem) -> tuple[dict[str, str], Labels]:
    """Return the units of a model's variables by name, and the names of their numbers."""
    variables = problem.info.variables
    labels = {v.name: number_names(v.kind, v.items) for v in variables}
    return {v.name: v.unit for v in variables}, labels


def broken_facts(verdict: Verdict | None) -> list[Fact]:
    """Return what broke, and what made it necessary; nothing of what is not violated."""
    return [("" if k else "what broke", line) for k, line in enumerate(broken_lines(verdict))]


def margin_facts(verdict: Verdict | None, units: Mapping[str, str], labels: Labels) -> list[Fact]:
    """Return the robustness, what decided it and when, with the values then; nothing without a verdict."""
    if verdict is None:
        return []
    values, compared = [], parse(verdict.predicate).signals if verdict.predicate else ()
    for name, value in verdict.values.items():
        label = labels[name].get(int(value)) if labels.get(name) else None
        difference = shown(verdict.robustness) if name in compared else 0.0
        words = in_unit(f"{name} = {readable(value, resolving(value, difference))}", units.get(name, ""))
        values.append(f"{words} ({label})" if label else words)
    meaning = margin_words(verdict.robustness, verdict.predicate)
    return [
        ("robustness", f"{signed(verdict.robustness)} ({meaning})"),
        ("critical time", f"{readable(verdict.critical_time)} s, decided by {verdict.predicate}"),
        ("values then", ", ".join(values)),
    ]


def fact_lines(facts: Iterable[Fact]) -> list[str]:
    """Return facts as rows of text."""
    return [f"  {name:<14} {text}" for name, text in facts]


def broken_lines(verdict: Verdict | None) -> tuple[str, ...]:
    """Say what broke, and what made it necessary; nothing of what is not violated."""
    return verdict.breach.lines if verdict is not None and verdict.breach is not None else ()


def problem_json(problem: Problem) -> dict[str, Any]:
    """Return how JSON about a requirement begins."""
    return {"requirement": problem.name, "formula": str(problem.requirement.formula)}


def confirmation_json(evaluation: Evaluation, found: Confirmation | None) -> dict[str, Any]:
    """Convert an evaluation, and what confirmed it if it is a violation, to a value for JSON."""
    outcome, reason = (found.outcome, found.reason) if found else (None, None)
    return {**evaluation_json(evaluation), "outcome": outcome, "reason": reason}


def evaluation_json(evaluation: Evaluation) -> dict[str, Any]:
    """Convert an evaluation to a value that can be dumped as JSON."""
    verdict = evaluation.verdict
    breach = verdict.breach if verdict else None
    return {
        **evaluation.candidate.to_json(),
        "violated": evaluation.violated,
        "robustness": evaluation.robustness,
        "critical_time": verdict and verdict.critical_time,
        "predicate": verdict and verdict.predicate,
        "values": dict(verdict.values) if verdict else None,
        "breach": breach and asdict(breach) | {"text": breach.text},
    }


def assurance_json(found: Assurance) -> dict[str, Any]:
    """Convert what random simulations say to a value that can be dumped as one JSON object."""
    return {
        **problem_json(found.problem),
        "distribution": found.distribution,
        "confidence": found.confidence,
        "violations": found.violations,
        "failures": [asdict(failure) for failure in found.failures],
        "upper_bound": found.bound,
        "interval": found.interval,
        "best": evaluation_json(found.best),
        "search": found.searched and asdict(found.searched),
        "findings": [asdict(finding) for finding in found.findings],
        "interrupted": found.interrupted,
        "spent": {"simulations": found.drawn},
    }


def _can_continue(result: Result) -> bool:
    if result.status == "failed":
        return bool(result.evaluations) and not mostly_unjudged([e.robustness for e in result.evaluations])
    return result.status == "interrupted"


def _continue_line(directory: Path) -> str:
    if not directory.is_dir():
        return f"{directory} was moved or deleted; if it was moved, to continue: falsifier resume NEW_PLACE"
    return f"to continue: falsifier resume {shell_word(directory)}"


def _pictures(result: Result) -> list[Path]:
    """Return the picture of a counterexample, if it could be drawn."""
    picture = (result.directory or Path()) / Path(counterexample_name(result)).with_suffix(".png")
    return [picture] if result.falsified and result.directory and picture.exists() else []


def llm_use(spent: Spent) -> str:
    """Calls, tokens and cost of the language model."""
    reasoning = f" ({spent.reasoning_tokens} for reasoning)" if spent.reasoning_tokens else ""
    lost = f" ({spent.without_reply} of them without a usable reply)" if spent.without_reply else ""
    kept = f", {counted(spent.kept, 'reply')} from the cache" if spent.kept else ""
    requests = f"{counted(spent.calls, 'request')}{lost}{kept}"
    return f"{requests}, {counted(spent.tokens, 'token')}{reasoning}, {spent.cost_text}"


def seconds_text(spent: Spent) -> str:
    """Wall-clock time of a run, and the parts spent in the simulator and the engine."""
    return (
        f"{spent.seconds:.1f} s; simulator {spent.simulation_seconds:.2f} s, "
        f"engine {spent.engine_seconds:.2f} s"
    )
