"""Who leads a run: from the names that a user gives to engines."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

from falsifier.engines import DEFAULT_ENGINE, check_engine, make_engine
from falsifier.engines.protocol import Engine
from falsifier.errors import SpecError
from falsifier.llm.messages import Chat
from falsifier.problem.problem import Problem
from falsifier.search.request import LLMSettings, RunRequest

if TYPE_CHECKING:
    from falsifier.llm.retry import Gate

# Engines that ask a language model.
_LLM_ENGINES = ("llm", "hybrid")
# Between the seeds of the engines of one search, which must not draw the same points; larger than any seed
# that people count up by hand.
_SEED_STRIDE = 1_000_003


def make_engines(request: RunRequest, problems: Sequence[Problem], chat: Chat | None) -> list[Engine]:
    """Engines of a request, one for each problem.

    Args:
        request: what was asked for.
        problems: what is searched.
        chat: with the request's language model, where it was made in Python.

    Raises:
        SpecError: for an unknown engine, an engine and a language model that do not go together, or a limit
            on cost that cannot be kept.
        ChatError: for an unknown provider or a missing key.
    """
    check_names(request)
    if request.llm is None:
        engine = request.engine or DEFAULT_ENGINE
        return [make_engine(engine, p, seed=request.seed + i * _SEED_STRIDE) for i, p in enumerate(problems)]
    chat = chat or _open_chat(request, request.llm)
    return [_led_by_llm(request, request.llm, problem, chat) for problem in problems]


def check_names(request: RunRequest) -> None:
    """Refuse unknown names; nothing is imported for that and no key is looked for.

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
        raise SpecError(f"the engine {engine!r} does not use a language model: drop --llm or --engine")
    from falsifier.llm.prompts.variants import variant_named

    variant_named(llm.variant)
    if llm.fallback in _LLM_ENGINES:
        raise SpecError(f"--fallback {llm.fallback}: name an engine that does not use a language model")
    check_engine(llm.fallback or DEFAULT_ENGINE)


def _open_chat(request: RunRequest, llm: LLMSettings) -> Chat:
    """Chat with a request's language model; nothing is sent."""
    from falsifier.llm.cache import default_cache_directory
    from falsifier.llm.connect import connect, preflight
    from falsifier.llm.litellm_import import listed_price
    from falsifier.llm.usage import Price

    preflight(llm.name, api_base=llm.api_base)
    price = Price(*llm.price) if llm.price else None
    if request.budget.cost is not None and (price or listed_price(llm.name)) is None:
        raise SpecError(
            f"the price of {llm.name} is unknown, so --max-cost cannot be kept: give "
            "--price SENT:RECEIVED, or limit --max-tokens instead"
        )
    return connect(
        llm.name,
        effort=llm.effort,
        api_base=llm.api_base,
        options=llm.options,
        price=price,
        gate=_gate(llm.name, llm.api_base),
        cache=default_cache_directory() if llm.cache else None,
    )


def _led_by_llm(request: RunRequest, llm: LLMSettings, problem: Problem, chat: Chat) -> Engine:
    from falsifier.engines.llm import make_llm_engine

    fallback = make_engine(llm.fallback, problem, seed=request.seed) if llm.fallback else None
    led = make_llm_engine(
        problem,
        chat,
        variant=llm.variant,
        sample=request.seed,
        anonymous=llm.anonymous,
        fallback=fallback,
    )
    if request.engine == "hybrid":
        return make_engine("hybrid", problem, seed=request.seed, adviser=led)
    return led


@lru_cache
def _gate(llm: str, api_base: str | None) -> "Gate":
    """Return the gate that all runs of this process share on one account."""
    from falsifier.llm.retry import Gate

    return Gate()
