"""What a campaign runs and what that may cost: methods, requests, run names."""

import reprlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from itertools import product
from math import inf

from pydantic import Field

from falsifier.core.arguments import list_of, whole
from falsifier.core.files import readable_part
from falsifier.core.strict import Strict
from falsifier.core.words import counted
from falsifier.engines import DEFAULT_ENGINE
from falsifier.errors import SpecError, written
from falsifier.llm.conversation import MAX_REASKS
from falsifier.llm.prompts import MOST_PROMPT_TOKENS
from falsifier.llm.usage import Price
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.record.manifest import Manifest
from falsifier.search.budget import Budget, budget_of, stated_price
from falsifier.search.parameterization import engine_parameterization, parameterization_of
from falsifier.search.request import LLMSettings, RunRequest

_HASH_DIGITS = 10


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
        together: whether several requirements shared one search.
    """

    engine: str = ""
    llm: str = ""
    effort: str = ""
    variant: str = ""
    parameterization: str = "fixed"
    profile: str = ""
    anonymous: bool = False
    together: bool = False

    @property
    def label(self) -> str:
        """Name in tables, e.g. ``surrogate`` or ``openai/gpt-5-mini high MP4, free, instance2``."""
        llm = " ".join(p for p in (self.llm, self.effort, self.variant) if p)
        name = " + ".join(p for p in (self.engine, llm) if p) or DEFAULT_ENGINE
        apart = {
            self.parameterization: self.parameterization != "fixed",
            self.profile: bool(self.profile),
            "neutral names": self.anonymous,
            "shared search": self.together,
        }
        return ", ".join([name, *(text for text, applies in apart.items() if applies)])


class CampaignRequest(Strict):
    """What a campaign runs and may spend.

    Attributes:
        runs: all runs.
        limits: what all runs together may spend; None: no limit in addition to the runs' own.
    """

    runs: tuple[RunRequest, ...] = Field(min_length=1)
    limits: Budget | None = None

    def named(self) -> dict[str, RunRequest]:
        """Runs by the name of their directory, in order; SpecError if the same run is requested twice."""
        runs = {run_name(request): request for request in self.runs}
        if len(runs) < len(self.runs):
            raise SpecError("the campaign has the same run twice: name each requirement and engine only once")
        return runs


# Who suggests candidates: an engine, a language model, or an engine that one advises.
Searcher = str | LLMSettings | tuple[str, LLMSettings]


def _pair(searcher: object) -> tuple[str | None, LLMSettings | None]:
    match searcher:
        case str():
            return searcher, None
        case LLMSettings():
            return None, searcher
        case (str() as engine, LLMSettings() as llm):
            return engine, llm
    got = reprlib.repr(searcher)
    if hasattr(searcher, "ask"):
        got = "an engine made in Python, which cannot be in a campaign: for each seed, call falsify(problem, "
        got += "engine, directory='own/run0'), then falsifier report own shows all of them"
    raise SpecError(f"searchers: expected names of engines, LLMSettings, or pairs of both, got {got}")


def cross(
    problems: Iterable[ProblemSource | str],
    searchers: Iterable[Searcher],
    *,
    seeds: Iterable[int],
    budget: Budget | int,
) -> tuple[RunRequest, ...]:
    """Make the runs of problems x searchers x seeds, in this order; equal ones once.

    Args:
        problems: what is searched; where the engine or the problem allows no other control points, as fixed.
        searchers: names of engines, language models, or pairs of an engine and the model that advises it.
        seeds: seeds of the engines.
        budget: limits of each run, or a number of simulations; tokens and cost limit language models.

    Raises:
        SpecError: if one of them is no list, is empty, or holds what cannot be in a campaign, such as an
            engine made in Python, or a problem that is not valid.
        ModelError: if an FMU cannot be read.
    """
    lists = (
        list_of("problems", problems, ProblemSource | str, "targets such as 'AT1'"),
        [_pair(each) for each in list_of("searchers", searchers, object, "engines and language models")],
        [whole("seeds", seed, least=0) for seed in list_of("seeds", seeds, object, "numbers")],
    )
    if not all(lists):
        raise SpecError("problems, searchers and seeds: expected at least one of each")
    runs: dict[str, RunRequest] = {}
    given, space = budget_of(budget), cache(lambda source: load_source(source).space)
    for problem, (engine, llm), seed in product(*lists):
        used = ProblemSource(target=problem) if isinstance(problem, str) else problem
        if used.parameterization == "free" and (
            engine_parameterization(engine, llm) == "fixed"
            or (used.shortest_piece is None and parameterization_of(space(used)) == "fixed")
        ):
            used = used.model_copy(update={"parameterization": "fixed", "shortest_piece": None})
        limits = given if llm else replace(given, tokens=None, cost=None)
        run = RunRequest(problems=(used,), engine=engine, llm=llm, seed=seed, budget=limits, keep="best")
        runs[run_name(run)] = run
    return tuple(runs.values())


def method_of(request: RunRequest) -> Method:
    """Method of a run."""
    problem, llm = request.source or ProblemSource(target=""), request.llm or LLMSettings(name="")
    return Method(
        engine="" if request.llm and request.engine in (None, "llm") else request.engine or DEFAULT_ENGINE,
        llm=llm.name,
        effort=llm.effort or "",
        variant=llm.variant or "",
        parameterization=problem.parameterization,
        profile=problem.profile or "",
        anonymous=llm.anonymous,
        together=len(request.problems) > 1,
    )


def method_of_run(described: Manifest) -> Method:
    """Method of a run that has begun: with the parameterization that was really searched."""
    return replace(
        method_of(described.request), parameterization=described.parameterization, together=described.shared
    )


def run_name(request: RunRequest) -> str:
    """Name of a run's directory: readable, and unique by a hash of the request.

    The next version must find a campaign's runs by it, so it does not follow how methods are named elsewhere.
    """
    digest = sha256(request.model_dump_json().encode()).hexdigest()[:_HASH_DIGITS]
    method = method_of(request)
    label = replace(method, llm=method.llm.rpartition("/")[2]).label
    readable = f"{request.problems[0].name}-{label}-{request.seed}"
    return f"{readable_part(readable)}-{digest}"


@dataclass(frozen=True, slots=True)
class Ceiling:
    """What is asked of language models if nothing is found early."""

    # US dollars for sending all questions with prompts at their longest; None if a price is unknown.
    cost: float | None
    text: str  # number of questions and cost in a sentence


def ceiling(request: CampaignRequest, price_of: Callable[[LLMSettings], Price | None]) -> Ceiling | None:
    """Estimate what a campaign asks if each simulation takes a question, asked again as often as possible.

    Runs without a limit on simulations are not counted.

    Returns:
        The estimate; None if the campaign asks no language model.
    """
    asking = [(run.llm, run.budget) for run in request.runs if run.llm is not None]
    if not asking:
        return None
    prices = {key: price_of(llm) for key, llm in {repr(llm): llm for llm, _ in asking}.items()}
    questions, cost, limit = 0, 0.0, 0.0
    for llm, budget in asking:
        own = (budget.simulations or 0) * (1 + MAX_REASKS)
        price = prices[repr(llm)]
        questions += own
        cost += inf if price is None else price.cost(own * MOST_PROMPT_TOKENS, 0)
        limit += inf if budget.cost is None else budget.cost
    if request.limits is not None and request.limits.cost is not None:
        limit = min(limit, request.limits.cost)
    told, total = "free of charge", written("--total {}=N", "limits=Budget({}=N)")
    if limit < inf:
        told = f"the cost is limited to {limit:.4g} US dollars"
    elif cost == inf:
        told = (
            f"the price is unknown ({stated_price()}), so the cost is too: {total.format('tokens')} limits it"
        )
    elif cost:
        told = (
            f"sending them with the longest prompts costs about {cost:.4g} US dollars; replies cost extra, "
            f"and {total.format('cost')} limits all of it"
        )
    asked = ", ".join(dict.fromkeys(llm.told for llm, _ in asking))
    text = f"up to {counted(questions, 'question')} to {asked}; {told}"
    return Ceiling(None if cost == inf else cost, text)
