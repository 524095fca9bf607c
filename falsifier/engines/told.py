"""What a language model is told of a problem, and in which form it answers."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace

from falsifier.context.values import NOTHING
from falsifier.errors import SpecError
from falsifier.evaluation.confirm import Confirmation
from falsifier.llm import CONTEXT_VARIANT, ReplyKind
from falsifier.llm.prompts import Variant, View, variant_named
from falsifier.llm.prompts.disguise import Disguise
from falsifier.llm.replies import ReplyForm
from falsifier.problem.context import with_context
from falsifier.problem.problem import Problem
from falsifier.stl.margins import signed


def told_view(view: View, reply: ReplyKind) -> View:
    """Return the view that can be asked about: lists of numbers have the control points of the spec."""
    return view if reply == "json" else replace(view, space=view.space.fixed)


def told_context(
    problem: Problem, variant: str | None, *, anonymous: bool = False
) -> tuple[Problem, Variant]:
    """Return the problem with the context that is told, if any, and the prompt variant.

    Files are read only here, and only if the variant tells them.

    Raises:
        SpecError: if the variant is unknown, context cannot be read, would be sent anonymously, or was asked
            for although the variant does not tell it.
    """
    named = problem.named_context
    told = variant_named(variant, has_context=bool(named))
    if not named:
        return problem, told
    if not told.has("context"):
        if problem.source is not None and set(problem.source.context) - {NOTHING}:
            raise SpecError(
                f"--context: the prompt variant {told.name} does not tell it; use {CONTEXT_VARIANT}, or drop "
                "--variant"
            )
        return problem, told
    if anonymous:
        raise SpecError(
            "--anonymous hides what the system is, and context would tell it: drop --anonymous, or leave the "
            f"files out with --context {NOTHING}"
        )
    return with_context(problem), told


def reply_form(
    view: View,
    variant: Variant,
    reply: ReplyKind,
    *,
    count: int,
    reasoned: bool = True,
    keepable: int = 0,
) -> ReplyForm:
    """Return the form of replies with up to ``count`` candidates.

    Args:
        view: the problem.
        variant: the prompt variant.
        reply: what replies consist of.
        count: maximum number of candidates.
        reasoned: whether the LLM says why, and what it learnt; predictions need neither.
        keepable: number of earlier candidates on which it may insist.
    """
    return ReplyForm(
        view.space,
        named=variant.has("names") and reply == "json",
        points=reply == "points",
        free=variant.has("freedom"),
        count=count,
        reasoned=reasoned,
        lessons=reasoned and reply == "json" and variant.has("lessons"),
        keepable=keepable,
    )


def doubts_told(confirmations: Sequence[Confirmation], disguise: Disguise | None) -> dict[Hashable, str]:
    """Return why violations do not count, by the keys of their candidates as they are told."""
    if disguise is None:
        return {c.candidate.key: in_doubt(c) for c in confirmations}
    return {disguise.hidden_candidate(c.candidate).key: _in_hidden_doubt(c, disguise) for c in confirmations}


def _in_hidden_doubt(confirmation: Confirmation, disguise: Disguise) -> str:
    verdict = confirmation.evaluation.verdict
    return in_doubt(confirmation, lambda r: r if verdict is None else disguise.hidden_robustness(verdict, r))


def in_doubt(confirmation: Confirmation, shown: Callable[[float], float] = float) -> str:
    """Why a violation does not count, without any name, and what would count.

    Args:
        confirmation: how the violation was repeated.
        shown: turns a robustness into the number that is told.
    """
    found = confirmation.evaluation.robustness
    assert found is not None
    robustness, reference, halved = (
        None if value is None else shown(value)
        for value in (confirmation.robustness, confirmation.reference, confirmation.halved)
    )
    found = shown(found)
    again = halved if robustness is not None else None
    if robustness is None:
        why = "a second simulation of it failed"
    elif robustness >= 0:
        again, why = robustness, f"a second simulation gave robustness {signed(robustness, 3)}"
    elif again is not None and again >= 0:
        why = f"at half the simulation step its robustness is {signed(again, 3)}"
    else:
        told = "" if reference is None else f", {signed(reference, 3)} instead of {signed(robustness, 3)}"
        why = f"a second monitor does not confirm it{told}"
    text = f"this does not count as a violation, it is {confirmation.outcome}: {why}"
    if again is None or again < 0:
        return text
    error = f"{again - found:.2g}"
    return f"{text}. Find one that is clearer: below 0 by more than {error}, the error of the simulation"
