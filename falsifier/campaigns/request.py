"""What a campaign runs and what that may cost: methods, requests, run names."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from hashlib import sha256
from math import inf

from pydantic import BaseModel, ConfigDict, Field

from falsifier.core.words import counted
from falsifier.engines import DEFAULT_ENGINE
from falsifier.errors import SpecError
from falsifier.llm.conversation import MAX_REASKS
from falsifier.llm.prompts import DEFAULT_PROMPT_TOKENS
from falsifier.llm.usage import Price
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import Manifest
from falsifier.search.budget import Budget
from falsifier.search.refine_levels import engine_parameterization
from falsifier.search.request import LLMSettings, RunRequest

_HASH_DIGITS = 10
# Maximum length of a run's name before its hash; file systems allow 255 bytes.
_READABLE_LENGTH = 120


@dataclass(frozen=True, slots=True, order=True)
class Method:
    """How runs search; tables have one row or column per method.

    Runs that differ in any of these attributes are never counted together.

    Attributes:
        engine: name of the engine; empty if a language model leads the search.
        llm: name of the language model, or empty.
        effort: its reasoning effort, or empty.
        variant: its prompt variant, or empty.
        parameterization: ``free`` or ``fixed``.
        profile: profile of the specs, or empty.
        anonymous: whether prompts use neutral names.
        fallback: engine to switch to if the language model fails, or empty.
        together: whether several requirements shared one search.
    """

    engine: str = ""
    llm: str = ""
    effort: str = ""
    variant: str = ""
    parameterization: str = "fixed"
    profile: str = ""
    anonymous: bool = False
    fallback: str = ""
    together: bool = False

    @property
    def label(self) -> str:
        """Name in tables, e.g. ``surrogate`` or ``gpt-5-mini high MP4, free, instance2``."""
        llm = " ".join(p for p in (self.llm.rpartition("/")[2], self.effort, self.variant) if p)
        name = " + ".join(p for p in (self.engine, llm) if p) or DEFAULT_ENGINE
        apart = {
            self.parameterization: self.parameterization != "fixed",
            self.profile: bool(self.profile),
            "neutral names": self.anonymous,
            f"fallback {self.fallback}": bool(self.fallback),
            "shared search": self.together,
        }
        return ", ".join([name, *(text for text, applies in apart.items() if applies)])


class CampaignRequest(BaseModel):
    """What a campaign runs and may spend.

    Attributes:
        runs: all runs.
        limits: what all runs together may spend; None: no limit in addition to the runs' own.
        suite: name of the suite that the runs come from, or None.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    runs: tuple[RunRequest, ...] = Field(min_length=1)
    limits: Budget | None = None
    suite: str | None = None

    def named(self) -> dict[str, RunRequest]:
        """Runs by the name of their directory, in order.

        Raises:
            SpecError: if the same run is requested twice.
        """
        runs = {run_name(request): request for request in self.runs}
        if len(runs) < len(self.runs):
            raise SpecError(
                "this campaign contains the same run twice: name each requirement and engine only once"
            )
        return runs


def cross(
    problems: Iterable[ProblemSource],
    methods: Iterable[Method],
    *,
    seeds: Iterable[int],
    budget: Budget,
    asking: LLMSettings | None = None,
) -> tuple[RunRequest, ...]:
    """Make the runs of problems x methods x seeds, in this order.

    Args:
        problems: what is searched; the method determines their parameterization and profile.
        methods: how to search.
        seeds: seeds of the engines.
        budget: limits of each run.
        asking: address, options, price and cache of language models; the method determines the rest.
    """
    seeds, methods = tuple(seeds), tuple(methods)
    return tuple(
        RunRequest(
            problems=(
                problem.model_copy(
                    update={"parameterization": method.parameterization, "profile": method.profile or None}
                ),
            ),
            engine=method.engine or None,
            llm=_llm_settings(method, asking),
            seed=seed,
            budget=budget,
            keep="best",
        )
        for problem in problems
        for method in methods
        for seed in seeds
    )


def method_of(request: RunRequest) -> Method:
    """Method of a run."""
    problem, llm = request.source or ProblemSource(target=""), request.llm or LLMSettings(name="")
    return Method(
        engine=request.engine or ("" if request.llm else DEFAULT_ENGINE),
        llm=llm.name,
        effort=llm.effort or "",
        variant=llm.variant or "",
        parameterization=problem.parameterization,
        profile=problem.profile or "",
        anonymous=llm.anonymous,
        fallback=llm.fallback or "",
        together=len(request.problems) > 1,
    )


def method_of_run(described: Manifest) -> Method:
    """Method of a run that has begun: with the parameterization that was really searched."""
    return replace(
        method_of(described.request),
        parameterization=described.parameterization,
        together=described.shared,
    )


def as_searched(method: Method) -> Method:
    """Return the method with the parameterization that its engine really searches."""
    llm = _llm_settings(method, None)
    used = engine_parameterization(method.engine or None, llm)
    return method if used == "free" else replace(method, parameterization="fixed")


def run_name(request: RunRequest) -> str:
    """Name of a run's directory: readable, and unique by a hash of the request."""
    digest = sha256(request.model_dump_json().encode()).hexdigest()[:_HASH_DIGITS]
    readable = f"{request.problems[0].name}-{method_of(request).label}-{request.seed}"
    return f"{re.sub(r'[^A-Za-z0-9.]+', '-', readable)[:_READABLE_LENGTH].strip('-.')}-{digest}"


def _llm_settings(method: Method, asking: LLMSettings | None) -> LLMSettings | None:
    if not method.llm:
        return None
    decided = {
        "name": method.llm,
        "effort": method.effort or None,
        "variant": method.variant or None,
        "anonymous": method.anonymous,
        "fallback": method.fallback or None,
    }
    return LLMSettings.model_validate((asking.model_dump() if asking else {}) | decided)


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
    prices = {key: price_of(llm) for key, llm in {repr(llm): llm for llm, _ in asking}.items()}
    total = request.limits.cost if request.limits is not None else None
    questions, cost, limit = 0, 0.0, 0.0
    for llm, budget in asking:
        own = (budget.simulations or 0) * (1 + MAX_REASKS)
        price = prices[repr(llm)]
        questions += own
        cost += inf if price is None else price.cost(own * DEFAULT_PROMPT_TOKENS, 0)
        limit += inf if budget.cost is None else budget.cost
    return Ceiling(questions, None if cost == inf else cost, min(limit, inf if total is None else total))
