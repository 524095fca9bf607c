"""Requirements in words: a language model's readings, checked, told apart by examples and judged."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from falsifier.analyses.lint import ranges_of, static_findings
from falsifier.core.ranges import InputRange, ParameterRange
from falsifier.core.trajectory import Trajectory
from falsifier.errors import ChatError, FalsifierError, SpecError
from falsifier.evaluation.evaluate import Evaluation, compiled, simulate
from falsifier.llm import formalizing
from falsifier.llm.conversation import NoValidReplyError, RejectedReplyError, converse
from falsifier.llm.formalizing import ReadingReply
from falsifier.llm.messages import Chat, ChatRequest, Exchange
from falsifier.problem.grid import fitting_interval
from falsifier.problem.problem import Problem
from falsifier.problem.unit_check import defined_units, factor_and_offset
from falsifier.problem.writing import Subject, subject_of
from falsifier.search.budget import Spent
from falsifier.search.make_engines import open_chat
from falsifier.search.request import LLMSettings
from falsifier.stl import Formula, in_words
from falsifier.stl.formula import And
from falsifier.stl.implication import implies
from falsifier.stl.margins import shown
from falsifier.stl.tell_apart import tell_apart

_LONGEST_SENTENCE = 4000


@dataclass(frozen=True, slots=True)
class Reading:
    """One formula that a sentence may mean.

    Attributes:
        formula: the formula; it fits the model and its experiment.
        meaning: what it means, as the language model says.
        words: the formula said back in words, made from the formula alone.
        problem: the problem with this requirement.
        nominal: the nominal simulation, judged; None before it.
    """

    formula: Formula
    meaning: str
    words: str
    problem: Problem
    nominal: Evaluation | None = None


@dataclass(frozen=True, slots=True)
class Difference:
    """Trajectories that tell two readings apart.

    Attributes:
        first: number of one reading, from 1.
        second: number of the other one.
        only_first: satisfies the first one only; None: none was found.
        only_second: satisfies the second one only; None: none was found.
    """

    first: int
    second: int
    only_first: Trajectory | None
    only_second: Trajectory | None


@dataclass(frozen=True, slots=True)
class Formalized:
    """Readings of a sentence.

    Attributes:
        sentence: the requirement in words.
        subject: the model, and the spec to write to.
        readings: one to three formulas, the most probable first.
        differences: how each two of them differ.
        rejected: why other readings were rejected, in the order of the replies; why a reply is missing.
        spent: calls, tokens and cost of the language model.
    """

    sentence: str
    subject: Subject
    readings: tuple[Reading, ...]
    differences: tuple[Difference, ...]
    rejected: tuple[str, ...]
    spent: Spent


def formalize(target: str, sentence: str, llm: Chat | LLMSettings | str) -> Formalized:
    """Return what a requirement in words may mean, as formulas.

    Each is judged on a simulation with the inputs at their start values, or else in the middle.

    Args:
        target: an FMU, a spec, one of its requirements, or a bundled name.
        sentence: the requirement.
        llm: the language model: its name, settings, or a chat.

    Raises:
        SpecError: if the target or the sentence cannot be used.
        ChatError: if there is no reply, or no valid reading in any of them.
        ModelError: if the FMU cannot be used.

    >>> formalize("my.fmu", "the speed stays below 120", "openai/gpt-5-mini")  # doctest: +SKIP
    """
    if not sentence.strip() or len(sentence) > _LONGEST_SENTENCE:
        raise SpecError(f"expected a sentence of 1 to {_LONGEST_SENTENCE} characters")
    subject = subject_of(target)
    settings = LLMSettings(name=llm) if isinstance(llm, str) else llm
    chat = open_chat(settings) if isinstance(settings, LLMSettings) else settings
    exchanges: list[Exchange] = []
    readings: list[Reading] = []
    rejected: list[str] = []

    def read(text: str) -> None:
        """Keep a reply's readings if they are as many as before; RejectedReplyError says what is wrong."""
        nonlocal readings
        valid: list[Reading] = []
        problems: list[str] = []
        for number, reply in enumerate(formalizing.read_readings(text), start=1):
            try:
                valid.append(_checked_reading(reply, subject, valid))
            except RejectedReplyError as rejection:
                problems.append(f"reading {number} ({reply.formula[:200]}): {rejection}")
        if len(valid) >= len(readings) or not problems:
            readings = valid
        if problems:
            rejected.extend(problems)
            raise RejectedReplyError("; ".join(problems))

    messages = formalizing.formalizing_messages(sentence, subject.problem.info, subject.problem.experiment)
    request = ChatRequest(messages=messages, reply_schema=formalizing.readings_schema())
    try:
        converse(chat, request, read, exchanges.append)
    except (ChatError, SpecError) as error:  # also one that takes back what was valid
        if not readings:
            raise
        if isinstance(error, ChatError) and not isinstance(error, NoValidReplyError):
            rejected.append(f"no better answer came: {error}")
            exchanges.append(Exchange(llm=chat.llm, messages=request.messages, reply=None, lost=error.lost))
    spent = sum((Spent.on_requests(each.requests, each.usage) for each in exchanges), Spent())
    readings = _judged(subject, readings)
    differences = tuple(
        _difference(i, j, readings[i - 1], readings[j - 1])
        for i, j in combinations(range(1, len(readings) + 1), 2)
    )
    return Formalized(sentence.strip(), subject, tuple(readings), differences, tuple(rejected), spent)


def _checked_reading(reply: ReadingReply, subject: Subject, others: Sequence[Reading]) -> Reading:
    """Return a reading that passed all checks; RejectedReplyError stating what is wrong.

    Its formula must parse, name signals of the model, fit the stop time and the grid, compare what has the
    same unit, neither hold nor fail for all values in range, and require something else than the others. It
    must hold on the example that came with it and fail on the counterexample: a reversed inequality
    contradicts its own examples.
    """
    try:
        formula, problem = subject.parsed(reply.formula)
    except SpecError as error:
        raise RejectedReplyError(str(error)) from None
    _check_units(reply, formula, problem)
    problem = problem.with_requirement(formula)
    equal = (p for p in formula.predicates if p.operator in ("==", "!="))
    equates_reals = any(problem.info[n].kind == "real" for p in equal for n in p.signals)  # not whole numbers
    for found in static_findings(problem):
        if found.kind in ("always", "never", "units") or (found.kind == "margin" and equates_reals):
            raise RejectedReplyError(f"{found.part or formula}: {found.text}; {found.advice}")
    _check_examples(reply, formula, problem)
    for number, other in enumerate(others, start=1):
        if implies(formula, other.formula) and implies(other.formula, formula):
            raise RejectedReplyError(f"it requires the same as reading {number}; leave it out")
    return Reading(formula, reply.meaning, in_words(formula), problem)


def _check_units(reply: ReadingReply, formula: Formula, problem: Problem) -> None:
    units = defined_units(problem.model)
    for name in formula.signals:
        real = problem.info[name].unit
        assumed = next((u.unit for u in reply.units if u.signal == name), real)
        found = factor_and_offset(assumed, real, units) if assumed and real else (1.0, 0.0)
        if found != (1.0, 0.0):
            shift = f" {found[1]:+.6g}" if found and found[1] else ""
            how = f" (1 {assumed} is {found[0]:.6g} {real}{shift})" if found else ""
            raise RejectedReplyError(
                f"{name} is in {real}, not in {assumed}: convert the numbers to {real}{how}"
            )


def _check_examples(reply: ReadingReply, formula: Formula, problem: Problem) -> None:
    experiment = problem.experiment
    for signals, said, other in (
        (reply.satisfied, "satisfied", "violated"),
        (reply.violated, "violated", "satisfied"),
    ):
        trajectory = formalizing.example_trajectory(signals, formula.signals, experiment.times)
        try:
            verdict = compiled(formula, experiment.output_interval, experiment.samples).evaluate(trajectory)
        except FalsifierError as error:
            raise RejectedReplyError(f"the formula has no value on an example: {error}") from None
        if verdict.violated != (said == "violated"):
            raise RejectedReplyError(
                f"the example that you call {said} is {other} by the formula, with robustness "
                f"{shown(verdict.robustness):.4g}: is an inequality reversed, or a window wrong?"
            )


def _judged(subject: Subject, readings: Sequence[Reading]) -> list[Reading]:
    """Judge readings on simulations with the inputs at their start values, or else in the middle."""
    info, space = subject.problem.info, subject.problem.space

    def start(searched: InputRange | ParameterRange) -> float:
        value, low, high = info[searched.name].start, searched.low, searched.high
        known = float(value) if isinstance(value, int | float) and low <= value <= high else None
        return float(searched.at(0.5)) if known is None else known

    inputs = {r.name: start(r) for r in space.inputs}
    parameters = {p.name: start(p) for p in space.parameters}
    try:
        return [replace(r, nominal=simulate(r.problem, dict(inputs), parameters)) for r in readings]
    finally:
        subject.problem.model.close()


def _difference(first: int, second: int, one: Reading, other: Reading) -> Difference:
    stop = one.problem.experiment.stop_time
    finest = min(reading.problem.experiment.output_interval for reading in (one, other))
    step = fitting_interval(And(one.formula, other.formula), stop, fmu_step=finest)
    if step is None:  # no grid of a reasonable size fits the windows of both
        return Difference(first, second, None, None)

    def only(a: Reading, b: Reading) -> Trajectory | None:
        samples, ranges = round(stop / step) + 1, ranges_of(a.problem)
        return tell_apart(a.formula, b.formula, step=step, samples=samples, ranges=ranges)

    return Difference(first, second, only(one, other), only(other, one))
