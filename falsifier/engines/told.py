"""What a language model is told of a problem, and in which form it answers."""

from collections.abc import Hashable, Sequence
from dataclasses import replace

from falsifier.evaluation.confirm import Confirmation
from falsifier.llm.disguise import Disguise
from falsifier.llm.messages import ReplyKind
from falsifier.llm.prompts import Variant, View
from falsifier.llm.prompts.context import in_doubt
from falsifier.llm.replies import ReplyForm


def told_view(view: View, reply: ReplyKind) -> View:
    """Return the view that can be asked about: lists of numbers have the control points of the spec."""
    return view if reply == "json" else replace(view, space=view.space.fixed)


def reply_form(
    view: View, variant: Variant, reply: ReplyKind, *, count: int, reasoned: bool = True
) -> ReplyForm:
    """Return the form of replies with up to ``count`` candidates."""
    return ReplyForm(
        view.space,
        named=variant.has("names") and reply == "json",
        points=reply == "points",
        free=variant.has("freedom"),
        count=count,
        reasoned=reasoned,
    )


def doubts_told(confirmations: Sequence[Confirmation], disguise: Disguise | None) -> dict[Hashable, str]:
    """Return why violations do not count, by the keys of their candidates as they are told."""
    if disguise is None:
        return {c.candidate.key: in_doubt(c) for c in confirmations}
    return {
        disguise.hidden_candidate(c.candidate).key: in_doubt(c, disguise.unit_of(c.evaluation))
        for c in confirmations
    }
