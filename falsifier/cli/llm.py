"""``falsifier llm``: what a language model is sent, and whether it replies."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from falsifier.cli import llm_options
from falsifier.cli.command import command, stated
from falsifier.cli.options import PATH, json_option, problem_source, requirement_options
from falsifier.cli.output import FAILED, as_shown, conclude, say
from falsifier.core.words import counted
from falsifier.errors import JournalError, SpecError
from falsifier.problem.loading import load_source
from falsifier.search import DEFAULT_SIMULATIONS

if TYPE_CHECKING:
    from falsifier.llm.messages import Message
    from falsifier.problem.problem import Problem
    from falsifier.record.manifest import Manifest
    from falsifier.record.records import Record

# Of a request of a check, in s, and how often it is sent if failures are temporary; a run waits longer.
_CHECK_TIMEOUT = 60.0
_CHECK_ATTEMPTS = 2


@command()
@requirement_options
@llm_options.variant_option()
@llm_options.anonymous_option
@llm_options.context_option
@click.option(
    "--after",
    "directory",
    type=PATH,
    metavar="RUN",
    help="Run whose samples the prompt contains, whatever its engine; default: none.",
)
@click.option(
    "--at",
    type=click.IntRange(min=1),
    metavar="N",
    help="If TARGET is a run directory: the question that was sent before sample N, with its reply.",
)
@json_option
def prompt(
    *,
    variant: str | None,
    anonymous: bool,
    directory: Path | None,
    at: int | None,
    as_json: bool,
    **options: Any,
) -> None:
    """Print exactly what would be sent to a language model next, without sending it.

    With --at, print a question that a run sent.
    """
    from falsifier.engines.briefing import preview
    from falsifier.record.files import recorded_trajectory
    from falsifier.record.journal import read_journal, recorded_evaluations
    from falsifier.record.questions import doubtful_confirmations
    from falsifier.record.records import EvaluatedRecord

    if at is not None:
        if stray := stated({"variant", "anonymous", "directory", *options} - {"target"}):
            why = "--at prints what a run sent: falsifier llm prompt RUN --at N"
            raise click.UsageError(f"{', '.join(stray)}: {why}")
        say(_sent(Path(options["target"]), at, as_json=as_json))
        return
    problem = load_source(problem_source(options))
    records, evaluations = [], {}
    simulations: int | None = DEFAULT_SIMULATIONS
    if directory:
        simulations = _told_by(directory, problem).request.budget.simulations
        records = read_journal(directory)
        evaluations = recorded_evaluations(records, problem.name)
        for record in (r for r in records if isinstance(r, EvaluatedRecord) and r.index in evaluations):
            trajectory = recorded_trajectory(directory, record.trajectory)
            evaluations[record.index] = replace(evaluations[record.index], trajectory=trajectory)
    messages = preview(
        problem,
        variant=variant,
        evaluations=list(evaluations.values()),
        anonymous=anonymous,
        simulations=simulations,
        doubtful=doubtful_confirmations(problem, records, evaluations),
        lessons=_lessons(records),
    )
    sent = {"messages": [{"role": message.role, "content": message.content} for message in messages]}
    say(as_shown(_as_text(messages), sent, as_json=as_json))


def _lessons(records: Sequence["Record"]) -> str:
    """What the language model wrote down last in a run."""
    from falsifier.llm.candidate_text import lessons_in
    from falsifier.record.records import ExchangeRecord

    exchanges = [r.exchange for r in records if isinstance(r, ExchangeRecord)]
    told = (lessons_in(e.reply.text) for e in reversed(exchanges) if e.reply is not None and not e.problem)
    return next((lessons for lessons in told if lessons), "")


def _told_by(directory: Path, problem: "Problem") -> "Manifest":
    """Return what a run was; SpecError unless its samples are of the problem's model and requirement."""
    from falsifier.record import manifest

    described = manifest.read(directory)
    if described.model == problem.info.name and problem.name in described.names:
        return described
    raise SpecError(
        f"{directory} is a run of {', '.join(described.names)} on the model {described.model}, not of "
        f"{problem.name} on {problem.info.name}"
    )


def _sent(directory: Path, sample: int, *, as_json: bool) -> str:
    """The last question that was asked before a sample of a run was simulated, and its reply."""
    from falsifier.record.journal import holds_run, read_journal, recorded_candidates
    from falsifier.record.questions import exchange_before

    if not holds_run(directory):
        raise JournalError(
            f"{directory}: not a run directory, which --at requires: falsifier llm prompt RUN --at {sample}"
        )
    records = read_journal(directory)
    exchange = exchange_before(records, sample - 1)
    if exchange is None:
        raise JournalError(f"{directory}: no language model was asked before sample {sample}")
    if as_json:
        return exchange.model_dump_json(indent=2)
    parts = [_headed(message.role, message.content) for message in exchange.messages]
    answer = "(none)" if exchange.reply is None else exchange.reply.text
    parts.append(_headed(f"reply of {exchange.llm}", answer))
    if exchange.problem:
        parts.append(_headed("rejected", exchange.problem))
    # Not every sample is the answer to the question before it: engines and random changes fill in.
    if rationale := recorded_candidates(records)[sample - 1].rationale:
        parts.append(_headed(f"rationale of sample {sample}", rationale))
    return "\n\n".join(parts)


def _as_text(messages: Sequence["Message"]) -> str:
    """The messages, and how many tokens they have."""
    from falsifier.llm.usage import count_tokens

    tokens = [count_tokens(message.content) for message in messages]
    constant, total = tokens[0], sum(tokens)  # the constant part can be kept by a provider
    size = (
        f"{counted(total, 'token')}; the first {constant} of them ({constant / total:.0%}) are the same in "
        "every question of a run"
    )
    return "\n\n".join([*(_headed(m.role, m.content) for m in messages), _headed("size", size)])


def _headed(heading: str, text: str) -> str:
    return f"--- {heading} ---\n{text}"


@command()
@click.argument("name")
@llm_options.connection_options
def check(*, name: str, **options: Any) -> None:
    """Check the name and key of a language model and the features that runs need, with a few short requests.

    NAME is PROVIDER/MODEL, e.g. openai/gpt-5-mini, or PROVIDER/MODEL@EFFORT. The exit code is 3 if there is
    no usable answer.
    """
    from falsifier.llm.check import check_chat
    from falsifier.llm.providers import key_variable
    from falsifier.search.make_engines import note_llm, open_chat, price_of

    settings = llm_options.llm_settings({"llm": name, **options})
    assert settings is not None
    note_llm(settings)
    alone = {"cache": False, "timeout": settings.timeout or _CHECK_TIMEOUT}
    features, usage = check_chat(open_chat(settings.model_copy(update=alone), attempts=_CHECK_ATTEMPTS))
    price = price_of(settings) or "unknown"
    variable = key_variable(settings.name)
    key = f"key from {variable}" if variable else "no key needed"
    lines = [f"{settings.told}: {key}; price: {price}; {counted(usage.tokens, 'token')} for this check"]
    lines += [f"  {'ok ' if f.works else 'no '} {f.name}: {f.said}" for f in features]
    is_usable = features[0].works
    if not is_usable:
        lines.append("  no usable answer came: a run with this language model would fail")
    conclude("\n".join(lines), 0 if is_usable else FAILED)
