"""What a run may spend, and what it has spent."""

from dataclasses import dataclass, replace

from falsifier.errors import SpecError


@dataclass(frozen=True, slots=True)
class Spent:
    """What a run has used so far.

    Attributes:
        simulations: candidates that were simulated, failed ones included.
        seconds: wall-clock time of the run.
        simulation_seconds: of it inside the simulator.
        engine_seconds: of it inside the engine, language model included.
        calls: requests to a language model that were answered.
        prompt_tokens: tokens sent.
        completion_tokens: tokens received, reasoning included.
        reasoning_tokens: of them spent on reasoning, where the provider says so.
        cost: US dollars; None once the price of any call is unknown.
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

    @property
    def tokens(self) -> int:
        """Tokens sent and received."""
        return self.prompt_tokens + self.completion_tokens

    def plus_call(self, *, prompt: int, completion: int, reasoning: int, cost: float | None) -> "Spent":
        """Return this with one more answered request to a language model."""
        return replace(
            self,
            calls=self.calls + 1,
            prompt_tokens=self.prompt_tokens + prompt,
            completion_tokens=self.completion_tokens + completion,
            reasoning_tokens=self.reasoning_tokens + reasoning,
            cost=None if cost is None or self.cost is None else self.cost + cost,
        )


@dataclass(frozen=True, slots=True)
class Budget:
    """Limits of one run; the first that is reached ends it. None: no limit.

    Attributes:
        simulations: most simulations.
        seconds: most wall-clock seconds.
        tokens: most tokens sent to and received from a language model.
        cost: most US dollars spent on a language model.
    """

    simulations: int | None = 100
    seconds: float | None = None
    tokens: int | None = None
    cost: float | None = None

    def __post_init__(self) -> None:
        for name in ("simulations", "seconds", "tokens", "cost"):
            limit = getattr(self, name)
            if limit is not None and not limit > 0:
                raise SpecError(f"budget: {name} must be positive, got {limit}")
        if all(getattr(self, name) is None for name in ("simulations", "seconds", "tokens", "cost")):
            raise SpecError("budget: give at least one limit: simulations, seconds, tokens or cost")

    def exceeded(self, spent: Spent) -> str | None:
        """Which limit is reached, in words, or None.

        Raises:
            SpecError: with a limit on money when the price of a call is unknown.
        """
        if self.simulations is not None and spent.simulations >= self.simulations:
            return f"the budget of {self.simulations} simulations is used up"
        if self.seconds is not None and spent.seconds >= self.seconds:
            return f"the time limit of {self.seconds:g} s is reached"
        if self.tokens is not None and spent.tokens >= self.tokens:
            return f"the budget of {self.tokens} tokens is used up"
        if self.cost is not None:
            if spent.cost is None:
                raise SpecError(
                    "the price of this language model is unknown, so a limit on its cost cannot be kept: "
                    "give its price, or limit tokens instead"
                )
            if spent.cost >= self.cost:
                return f"the budget of {self.cost:g} US dollars is used up"
        return None

    def remaining(self, spent: Spent, wanted: int) -> int:
        """How many of the wanted simulations the budget still allows."""
        if self.simulations is None:
            return wanted
        return max(0, min(wanted, self.simulations - spent.simulations))
