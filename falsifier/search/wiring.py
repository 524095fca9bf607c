"""From what a user asked for to the engine that does it."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from falsifier.engines import DEFAULT_ENGINE, check_engine, make_engine
from falsifier.engines.protocol import Engine
from falsifier.errors import SpecError
from falsifier.problem.problem import Problem
from falsifier.search.journal import Record, recorded_exchanges
from falsifier.search.loop import EngineBuilder, OnExchange
from falsifier.search.request import LLMSettings, RunRequest

if TYPE_CHECKING:
    from falsifier.llm.messages import Chat
    from falsifier.llm.retry import Gate

# Engines that ask a language model.
_LLM_ENGINES = ("llm", "hybrid")
# Between the seeds of the engines of one search, which must not draw the same points; larger than any seed
# that people count up by hand.
_SEED_STRIDE = 1_000_003


def engine_builder(
    request: RunRequest, problems: Sequence[Problem], records: Sequence[Record]
) -> EngineBuilder:
    """Return what makes the request's engines.

    Names of engines and LLMs, and the LLM's key, are checked here, before any simulation.

    Args:
        request: what was asked for.
        problems: what is searched.
        records: what the run's journal already holds; its replies are played again instead of paid for again.

    Raises:
        SpecError: for an unknown engine, or an engine and an LLM that do not go together.
        ChatError: for an unknown provider or a missing key.
    """
    check_names(request)
    if request.llm is None:
        engine = request.engine or DEFAULT_ENGINE
        seeds = range(request.seed, request.seed + _SEED_STRIDE * len(problems), _SEED_STRIDE)
        made = {p.name: make_engine(engine, p, seed=s) for p, s in zip(problems, seeds, strict=True)}
        return lambda problem, _: made[problem.name]
    return _led_by_llm(request, request.llm, _chat(request, request.llm, records))


def check_names(request: RunRequest) -> None:
    """Refuse names that nobody knows; nothing is imported for that and no key is looked for.

    Raises:
        SpecError: for an unknown engine or prompt variant, or an engine and an LLM that do not go together.
    """
    engine, llm = request.engine, request.llm
    if llm is None:
        if engine in _LLM_ENGINES:
            raise SpecError(f"the engine {engine!r} needs a language model: add --llm NAME")
        check_engine(engine or DEFAULT_ENGINE)
        return
    if (engine or "llm") not in _LLM_ENGINES:
        raise SpecError(
            f"the engine {engine!r} asks no language model: leave out --llm, or leave out --engine"
        )
    from falsifier.llm.prompts.variants import variant_named

    variant_named(llm.variant)
    if llm.fallback in _LLM_ENGINES:
        raise SpecError(f"--fallback {llm.fallback}: name an engine that asks no language model")
    check_engine(llm.fallback or DEFAULT_ENGINE)


def _led_by_llm(request: RunRequest, llm: LLMSettings, chat: "Chat") -> EngineBuilder:
    from falsifier.engines.llm import make_llm_engine

    def build(problem: Problem, on_exchange: OnExchange) -> Engine:
        fallback = make_engine(llm.fallback, problem, seed=request.seed) if llm.fallback else None
        led = make_llm_engine(
            problem,
            chat,
            variant=llm.variant,
            on_exchange=on_exchange,
            sample=request.seed,
            anonymous=llm.anonymous,
            fallback=fallback,
        )
        if request.engine == "hybrid":
            return make_engine("hybrid", problem, seed=request.seed, adviser=led)
        return led

    return build


def _chat(request: RunRequest, llm: LLMSettings, records: Sequence[Record]) -> "Chat":
    from falsifier.llm.cache import default_cache_directory
    from falsifier.llm.connect import connect, preflight
    from falsifier.llm.litellm_import import listed_price
    from falsifier.llm.replay import RecordedChat
    from falsifier.llm.usage import Price

    preflight(llm.name, api_base=llm.api_base)
    price = Price(*llm.price) if llm.price else None
    if request.budget.cost is not None and (price or listed_price(llm.name)) is None:
        raise SpecError(
            f"the price of {llm.name} is unknown, so --max-cost cannot be kept: give "
            "--price SENT:RECEIVED, or limit --max-tokens instead"
        )
    chat = connect(
        llm.name,
        effort=llm.effort,
        api_base=llm.api_base,
        options=llm.options,
        price=price,
        gate=_gate(llm.name, llm.api_base),
        cache=default_cache_directory() if llm.cache else None,
    )
    return RecordedChat(recorded_exchanges(records), chat)


@lru_cache
def _gate(llm: str, api_base: str | None) -> "Gate":
    """Return the gate that all runs of this process share on one account."""
    from falsifier.llm.retry import Gate

    return Gate()
