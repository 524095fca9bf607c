"""What a run may spend, what it has spent, and a chat that keeps to it and pays for nothing twice."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from math import inf
from time import monotonic

from falsifier.core.arguments import positive, whole
from falsifier.core.words import counted
from falsifier.errors import ChatError, FalsifierError, SpecError, written
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, Usage
from falsifier.search import DEFAULT_SIMULATIONS

# What requests to a language model use beside their cost, which may be unknown.
USED = ("without_reply", "kept", "prompt_tokens", "completion_tokens", "reasoning_tokens")


def stated_price() -> str:
    """Return how the reader states the price of a language model."""
    return written("--llm-option price=SENT:RECEIVED", "price=(SENT, RECEIVED)")


def unknown_price(llm: str) -> SpecError:
    """The error of a limit of the cost that cannot hold; what is resumed keeps the price of its start."""
    return SpecError(
        f"the price of {llm} is unknown, so its cost cannot be limited: limit the tokens, or state it where "
        f"the run or campaign is started ({stated_price()})"
    )


class LimitReached(FalsifierError):
    """A limit of the run is reached in the middle of an engine's turn; the message says which."""


@dataclass(frozen=True, slots=True)
class Spent:
    """What a run has spent so far.

    Attributes:
        simulations: number of simulated candidates, including failed simulations.
        failed: number of simulations among them that failed, crashed or timed out.
        seconds: wall-clock time of the run.
        simulation_seconds: time inside the simulator.
        engine_seconds: time inside the engine, including the language model.
        calls: requests to a language model that were answered or timed out.
        without_reply: number of them that timed out, were interrupted, or whose answer cannot be read.
        kept: replies of a language model that were taken from the cache, without a request.
        prompt_tokens: tokens sent.
        completion_tokens: tokens received, including reasoning.
        reasoning_tokens: part of them used for reasoning, if the provider reports it.
        cost: US dollars; None once the cost of any call is unknown.
    """

    simulations: int = 0
    seconds: float = 0.0
    simulation_seconds: float = 0.0
    engine_seconds: float = 0.0
    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    reasoning_tokens: int = 0
    cost: float | None = 0.0
    failed: int = 0
    without_reply: int = 0
    kept: int = 0

    @property
    def has_mostly_failed(self) -> bool:
        """Whether more than half of the simulations failed, so that little was searched."""
        return 2 * self.failed > self.simulations

    @property
    def simulations_text(self) -> str:
        """Number of simulations in words, with those that failed."""
        failed = f", {self.failed} of them failed" if self.failed else ""
        failed = ", which failed" if self.failed == self.simulations == 1 else failed
        return counted(self.simulations, "simulation") + failed

    @property
    def questions(self) -> int:
        """Questions to a language model: requests, and what was answered from the cache."""
        return self.calls + self.kept

    @property
    def tokens(self) -> int:
        """Tokens sent and received."""
        return self.prompt_tokens + self.completion_tokens

    @property
    def cost_text(self) -> str:
        """The cost in words."""
        return "cost unknown" if self.cost is None else f"{self.cost:.4f} US dollars"

    @classmethod
    def on_requests(cls, count: int, usage: Usage) -> "Spent":
        """Return what so many requests to a language model used."""
        return cls(calls=count, cost=usage.cost, **{name: getattr(usage, name) for name in USED})

    def __add__(self, other: "Spent") -> "Spent":
        cost = None if self.cost is None or other.cost is None else self.cost + other.cost
        return Spent(**{name: getattr(self, name) + getattr(other, name) for name in _COUNTS}, cost=cost)


_COUNTS = tuple(field.name for field in fields(Spent) if field.name != "cost")


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of one run; the first one reached ends it. None: no limit.

    Attributes:
        simulations: maximum number of simulations.
        seconds: maximum wall-clock time in s.
        tokens: maximum number of tokens sent to and received from a language model.
        cost: maximum amount in US dollars spent on a language model.
    """

    simulations: int | None = DEFAULT_SIMULATIONS
    seconds: float | None = None
    tokens: int | None = None
    cost: float | None = None

    def __post_init__(self) -> None:
        for name in ("simulations", "tokens"):
            if (number := getattr(self, name)) is not None:
                object.__setattr__(self, name, whole(f"budget: {name}", number, least=1))
        for name in ("seconds", "cost"):
            if (limit := getattr(self, name)) is not None:
                positive(f"budget: {name}", limit)
        if all(getattr(self, name) is None for name in ("simulations", "seconds", "tokens", "cost")):
            raise SpecError("budget: give at least one limit: simulations, seconds, tokens or cost")

    def exceeded(self, spent: Spent) -> str | None:
        """Which limit is reached, in words, or None; SpecError if the cost is limited, its price unknown."""
        if self.simulations is not None and spent.simulations >= self.simulations:
            return f"the budget of {counted(self.simulations, 'simulation')} is used up"
        if self.seconds is not None and spent.seconds >= self.seconds:
            return f"the time limit of {self.seconds:g} s is reached"
        if self.tokens is not None and spent.tokens >= self.tokens:
            return f"the budget of {counted(self.tokens, 'token')} is used up"
        if self.cost is not None:
            if spent.cost is None:
                raise unknown_price("this language model")
            if spent.cost >= self.cost:
                return f"the budget of {self.cost:g} US dollars is used up"
        return None

    def seconds_left(self, spent: Spent) -> float | None:
        """Seconds that the budget still allows; None without a limit."""
        return None if self.seconds is None else max(0.0, self.seconds - spent.seconds)


def budget_of(given: Budget | int) -> Budget:
    """Return the limits that a user gave; a plain number limits the simulations."""
    return given if isinstance(given, Budget) else Budget(whole("budget", given, least=1))


# A wait for a reply may end this much before the time that it was given.
_CLOCK_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class RunChat:
    """Answers with recorded replies in their order; then asks, and checks the budget before every request."""

    inner: Chat  # chat to ask
    budget: Budget  # limits of the run
    spent: Callable[[], Spent]  # returns what the run has spent so far
    # What was recorded and not played yet; chats that share it play each reply once.
    recorded: Iterator[Exchange]

    @property
    def llm(self) -> str:
        """Name of the inner chat's LLM."""
        return self.inner.llm

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next recorded reply, or ask, with what is left of the limits.

        Raises:
            LimitReached: if a limit is reached, before the request or while waiting for the reply.
            ChatError: if no reply can be obtained, or a failure was recorded.
        """
        if (played := next(self.recorded, None)) is not None:
            if played.reply is None:
                raise ChatError(played.problem or "there was no reply")
            return played.reply.model_copy(update={"source": "recording"})
        self._check()
        tokens, cost, spent = self.budget.tokens, self.budget.cost, self.spent()
        left = self.budget.seconds_left(spent)
        limits = {
            "deadline": None if left is None else monotonic() + left,
            "spare": (inf if tokens is None else tokens - spent.tokens, (cost or inf) - (spent.cost or 0.0)),
        }
        try:
            return self.inner.complete(request.model_copy(update=limits))
        except ChatError as error:
            self._check(error)
            raise

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Tell the inner chat."""
        self.inner.accepted(request, reply)

    def _check(self, failure: ChatError | None = None) -> None:
        spent = self.spent()
        if failure is not None:
            spent += Spent(seconds=_CLOCK_TOLERANCE) + Spent.on_requests(0, failure.lost or Usage(cost=0.0))
        if limit := self.budget.exceeded(spent):
            raise LimitReached(limit) from failure
