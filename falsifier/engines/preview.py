"""What would be asked of a language model next, without asking."""

from collections.abc import Sequence

from falsifier.engines.told import doubts_told, reply_form, told_context, told_view
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation, start_values
from falsifier.llm import ReplyKind
from falsifier.llm.messages import Message, Tool
from falsifier.llm.prompts import DEFAULT_PROMPT_TOKENS, Questions, View, variant_named
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.tools import MOST_CANDIDATES, what_if_tool
from falsifier.problem.problem import Problem


def preview(
    problem: Problem,
    *,
    variant: str | None = None,
    evaluations: Sequence[Evaluation] = (),
    count: int = 1,
    prompt_tokens: int = DEFAULT_PROMPT_TOKENS,
    anonymous: bool = False,
    reply: ReplyKind = "json",
    simulations: int | None = None,
    doubtful: Sequence[Confirmation] = (),
    lessons: str = "",
) -> tuple[Message, ...]:
    """Return the messages that would be sent next, without sending them.

    Args:
        problem: the problem to search.
        variant: name of the prompt variant; None: the default one.
        evaluations: what was simulated so far, in order.
        count: number of candidates to ask for.
        prompt_tokens: maximum number of tokens of a prompt.
        anonymous: whether the LLM gets neutral names instead of real ones.
        reply: what a reply is to consist of.
        simulations: maximum number of simulations of the run; None: no limit.
        doubtful: violations among the evaluations that do not count.
        lessons: what the LLM wrote down in its last reply.
    """
    problem, told = told_context(problem, variant, anonymous=anonymous)
    view = told_view(View.of(problem), reply)
    start = start_values(problem) if anonymous or told.has("circumstances") else {}
    disguise = None
    if anonymous:
        disguise = Disguise.of(view, start).fitted(evaluations)
        view, evaluations = disguise.view, [disguise.hidden(e) for e in evaluations]
        start = disguise.hidden_values(start)
    doubts = doubts_told(doubtful, disguise)
    questions = Questions(view, told, reply=reply, start=start, tokens=prompt_tokens)
    for evaluation in evaluations:
        candidate = evaluation.candidate
        why = candidate.rationale if candidate.origin.endswith(f" {told.name}") else ""
        questions.tell(evaluation, doubt=doubts.get(candidate.key, ""), why=why)
    return questions.ask(count, simulations=simulations, lessons=lessons)


def preview_tool(
    problem: Problem,
    *,
    calls: int,
    variant: str | None = None,
    anonymous: bool = False,
    reply: ReplyKind = "json",
) -> Tool:
    """Return the tool that a question with permission to request predictions would offer; sends nothing."""
    view = told_view(View.of(problem), reply)
    shown = Disguise.of(view).view if anonymous else view
    form = reply_form(shown, variant_named(variant), reply, count=MOST_CANDIDATES, reasoned=False)
    return what_if_tool(form.schema(), calls=calls)
