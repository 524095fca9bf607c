"""What a campaign asks of language models and about what that costs, said before it starts."""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from falsifier.campaigns.request import CampaignRequest
from falsifier.core.words import counted
from falsifier.llm.conversation import MAX_REASKS
from falsifier.llm.prompts import DEFAULT_PROMPT_TOKENS
from falsifier.llm.usage import Price
from falsifier.search.request import LLMSettings


@dataclass(frozen=True, slots=True)
class Ceiling:
    """What is asked of language models if nothing is found early.

    Attributes:
        questions: number of questions if each simulation takes one, and each of these is asked again as often
            as after replies that are not valid; calls of tools come on top.
        cost: US dollars for sending these with prompts at their longest; None if a price is unknown.
        limit: US dollars to which the campaign's own limits hold the cost of everything; inf without any.
    """

    questions: int
    cost: float | None
    limit: float

    @property
    def text(self) -> str:
        """The estimate in a sentence."""
        asked = f"up to {counted(self.questions, 'question')} to language models"
        if self.limit < inf:
            return f"{asked}; the cost is limited to {self.limit:.4g} US dollars"
        if self.cost is None:
            return (
                f"{asked}; the price is unknown (--llm-option price=SENT:RECEIVED), so the cost is too: "
                "--total tokens=N limits it"
            )
        if not self.cost:
            return f"{asked}, free of charge"
        return (
            f"{asked}, which cost about {self.cost:.4g} US dollars to send with the longest prompts; replies "
            "cost extra, and --total cost=N limits all of it"
        )


def ceiling(request: CampaignRequest, price_of: Callable[[LLMSettings], Price | None]) -> Ceiling | None:
    """Estimate what a campaign asks; None if it asks no language model.

    Runs without a limit on simulations are not counted.

    Args:
        request: the campaign.
        price_of: returns the price of a language model, None if it is unknown.
    """
    asking = [(run.llm, run.budget) for run in request.runs if run.llm is not None]
    if not asking:
        return None
    prices = {_server(llm): price_of(llm) for llm, _ in reversed(asking)}
    total = request.limits.cost if request.limits is not None else None
    questions, cost, limit = 0, 0.0, 0.0
    for llm, budget in asking:
        own = (budget.simulations or 0) * (1 + MAX_REASKS)
        price = prices[_server(llm)]
        questions += own
        cost += inf if price is None else price.cost(own * DEFAULT_PROMPT_TOKENS, 0)
        limit += inf if budget.cost is None else budget.cost
    return Ceiling(questions, None if cost == inf else cost, min(limit, inf if total is None else total))


def _server(llm: LLMSettings) -> tuple[object, ...]:
    """What the price of a language model depends on."""
    return llm.name, llm.api_base, llm.price
