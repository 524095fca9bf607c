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
from falsifier.search.request import ModelRequest, RunRequest

if TYPE_CHECKING:
    from falsifier.llm.messages import Chat
    from falsifier.llm.retry import Gate

# Engines that ask a language model.
_MODEL_ENGINES = ("llm", "hybrid")
# Between the seeds of the engines of one search, which must not draw the same points; larger than any seed
# that people count up by hand.
_SEED_STRIDE = 1_000_003


def engine_builder(
    request: RunRequest, problems: Sequence[Problem], records: Sequence[Record]
) -> EngineBuilder:
    """Return what makes the request's engines.

    Names of engines and models, and the model's key, are checked here, before any simulation.

    Args:
        request: what was asked for.
        problems: what is searched.
        records: what the run's journal already holds; its replies are played again instead of paid for again.

    Raises:
        SpecError: for an unknown engine, or an engine and a model that do not go together.
        ChatError: for an unknown provider or a missing key.
    """
    check_names(request)
    if request.model is None:
        engine = request.engine or DEFAULT_ENGINE
        seeds = range(request.seed, request.seed + _SEED_STRIDE * len(problems), _SEED_STRIDE)
        made = {p.name: make_engine(engine, p, seed=s) for p, s in zip(problems, seeds, strict=True)}
        return lambda problem, _: made[problem.name]
    return _led_by_model(request, request.model, _chat(request, request.model, records))


def check_names(request: RunRequest) -> None:
    """Refuse names that nobody knows; nothing is imported for that and no key is looked for.

    Raises:
        SpecError: for an unknown engine or prompt variant, or an engine and a model that do not go together.
    """
    engine, model = request.engine, request.model
    if model is None:
        if engine in _MODEL_ENGINES:
            raise SpecError(f"the engine {engine!r} needs a language model: add --model NAME")
        check_engine(engine or DEFAULT_ENGINE)
        return
    if (engine or "llm") not in _MODEL_ENGINES:
        raise SpecError(
            f"the engine {engine!r} asks no language model: leave out --model, or leave out --engine"
        )
    from falsifier.llm.prompts.variants import variant_named

    variant_named(model.variant)
    if model.fallback in _MODEL_ENGINES:
        raise SpecError(f"--fallback {model.fallback}: name an engine that asks no language model")
    check_engine(model.fallback or DEFAULT_ENGINE)


def _led_by_model(request: RunRequest, model: ModelRequest, chat: "Chat") -> EngineBuilder:
    from falsifier.engines.llm import make_llm_engine

    def build(problem: Problem, on_exchange: OnExchange) -> Engine:
        fallback = make_engine(model.fallback, problem, seed=request.seed) if model.fallback else None
        led = make_llm_engine(
            problem,
            chat,
            variant=model.variant,
            on_exchange=on_exchange,
            sample=request.seed,
            anonymous=model.anonymous,
            fallback=fallback,
        )
        if request.engine == "hybrid":
            return make_engine("hybrid", problem, seed=request.seed, adviser=led)
        return led

    return build


def _chat(request: RunRequest, model: ModelRequest, records: Sequence[Record]) -> "Chat":
    from falsifier.llm.cache import default_cache_directory
    from falsifier.llm.connect import connect, preflight
    from falsifier.llm.litellm_import import listed_price
    from falsifier.llm.replay import RecordedChat
    from falsifier.llm.usage import Price

    preflight(model.name, api_base=model.api_base)
    price = Price(*model.price) if model.price else None
    if request.budget.cost is not None and (price or listed_price(model.name)) is None:
        raise SpecError(
            f"the price of {model.name} is unknown, so --max-cost cannot be kept: give "
            "--price SENT:RECEIVED, or limit --max-tokens instead"
        )
    chat = connect(
        model.name,
        effort=model.effort,
        api_base=model.api_base,
        options=model.options,
        price=price,
        gate=_gate(model.name, model.api_base),
        cache=default_cache_directory() if model.cache else None,
    )
    return RecordedChat(recorded_exchanges(records), chat)


@lru_cache
def _gate(model: str, api_base: str | None) -> "Gate":
    """Return the gate that all runs of this process share on one account."""
    from falsifier.llm.retry import Gate

    return Gate()
