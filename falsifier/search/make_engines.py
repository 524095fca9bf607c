"""Makes the engines that lead a run from the names in a request."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from falsifier.context.values import Context
from falsifier.core import named
from falsifier.core.files import cache_directory
from falsifier.core.words import listed
from falsifier.engines import DEFAULT_ENGINE, ENGINES, check_engine, make_engine
from falsifier.engines.protocol import Engine
from falsifier.errors import ChatSetupError, SpecError, setting
from falsifier.llm.messages import Chat
from falsifier.llm.model_file import is_model_file
from falsifier.llm.providers import check_recorded
from falsifier.llm.usage import Price
from falsifier.problem.context import with_context
from falsifier.problem.problem import Problem
from falsifier.search.budget import unknown_price
from falsifier.search.request import LLMSettings, RunRequest

# Engines that ask a language model.
LLM_ENGINES = ("llm", "hybrid")
# Distance between the seeds of the engines in one search, so that they do not draw the same points; larger
# than the consecutive seeds that users choose.
_SEED_STRIDE = 1_000_003


def make_engines(
    request: RunRequest, problems: Sequence[Problem], chat: Chat | None, internals: tuple[str, ...] = ()
) -> list[Engine]:
    """Make the engines of a request, one per problem; a chat is given if it was made in Python.

    The internal variables are recorded, and engines learn from them; a language model is told the modes
    alone, which change rarely: prompts would become long.

    Raises:
        SpecError: for an unknown engine, an engine that does not fit the language model, or a cost limit
            although the price is unknown.
        ChatError: for an unknown provider or a missing key.
    """
    check_names(request.engine, request.llm)
    # Those of other requirements would make dynamics slow: they are for robustness of few values.
    own = [tuple(name for name in internals if name in p.internals) for p in problems]
    seeds = [request.seed + i * _SEED_STRIDE for i in range(len(problems))]
    prepared = list(zip(problems, own, seeds, strict=True))
    llm = request.llm
    if llm is None:
        name = request.engine or DEFAULT_ENGINE
        return [make_engine(name, p.watching(watched), seed=seed) for p, watched, seed in prepared]
    from falsifier.engines.llm import LLMEngine
    from falsifier.llm.client import LiteLLMChat
    from falsifier.llm.litellm_adapter import load_litellm

    chat = chat or open_chat(llm, max_cost=request.budget.cost)
    if request.budget.seconds is not None and isinstance(chat, LiteLLMChat):
        load_litellm()  # takes seconds, which do not count before the search begins
    engines: list[Engine] = []
    for problem, watched, seed in prepared:
        told = problem.watching(watched, only_modes=True)
        led = LLMEngine(told, chat, variant=llm.variant, sample=request.seed, anonymous=llm.anonymous)
        is_hybrid, seen = request.engine == "hybrid", problem.watching(watched)
        engines.append(make_engine("hybrid", seen, seed=seed, adviser=led) if is_hybrid else led)
    return engines


def told_problems(
    request: RunRequest, problems: Sequence[Problem], recorded: Mapping[str, Context] | None = None
) -> list[Problem]:
    """Return the problems with what their context files say to the language model or engine that leads.

    Of a run that is continued, ``recorded`` are its contexts by requirement, and no file is read again: one
    without a context there had none, even if its files are gone or others by now.

    Raises:
        SpecError: if a file cannot be read, looks like it holds a secret, or must not be told.
    """
    llm = request.llm
    if recorded is not None:
        return [replace(p, context=recorded.get(p.name, Context())) for p in problems]
    if llm is None:
        engine = ENGINES.get(request.engine or DEFAULT_ENGINE)
        is_read = engine is not None and engine.uses_context
        return [with_context(p, is_told=False) if is_read else p for p in problems]
    from falsifier.engines.briefing import told_context

    return [told_context(problem, llm.variant, anonymous=llm.anonymous)[0] for problem in problems]


def check_names(engine: str | None, llm: LLMSettings | None) -> None:
    """Reject unknown names, without importing an engine or looking for a key.

    Raises:
        SpecError: for an unknown engine or prompt variant, or an engine that does not fit the language
            model.
    """
    if llm is None:
        if engine in LLM_ENGINES:
            raise SpecError(
                f"the engine {engine!r} needs a language model: name one ({setting('llm', 'NAME')}), "
                "or choose another engine"
            )
        check_engine(engine or DEFAULT_ENGINE)
        return
    if (engine or "llm") not in LLM_ENGINES:
        raise SpecError(f"the engine {engine!r} does not use a language model: drop one of the two")
    from falsifier.llm.prompts.view import variant_named

    variant_named(llm.variant)


def open_chat(llm: LLMSettings, *, max_cost: float | None = None, attempts: int | None = None) -> Chat:
    """Make the chat with a language model; nothing is sent.

    ``max_cost`` is the limit of the cost in US dollars, ``attempts`` the maximum number of requests per reply
    if failures are temporary; None: as of a run.

    Raises:
        SpecError: if the cost is limited although the price is unknown.
        ChatError: for an unknown provider, a missing key, or another server than that of the settings.
    """
    from falsifier.llm.client import DEFAULT_ATTEMPTS, DEFAULT_TIMEOUT
    from falsifier.llm.connect import connect

    check_recorded(llm.name, llm.api_base)
    chat = connect(
        llm.name,
        effort=llm.effort,
        api_base=llm.api_base,
        options=llm.options,
        price=Price(*llm.price) if llm.price else None,
        timeout=llm.timeout or DEFAULT_TIMEOUT,
        attempts=attempts or DEFAULT_ATTEMPTS,
        cache=cache_directory() / "replies" if llm.cache else None,
    )
    check_price(llm, max_cost)
    return chat


def note_llm(llm: LLMSettings | None) -> None:
    """Note that the user has named this language model with its server, which a record may name later.

    The usual server, too: once the environment has another address, it is none.
    """
    if llm is not None:
        named.note(llm.check)


def check_llm(place: Path, *llms: LLMSettings | None) -> None:
    """Refuse to ask servers that only a record names, which may be somebody else's.

    Raises:
        ChatSetupError: naming all of them and what to do.
    """
    others = {llm.check: llm.told for llm in llms if not (llm is None or llm.is_usual)}
    if unnoted := {check: told for check, told in others.items() if not named.is_noted(check)}:
        raise ChatSetupError(
            f"{place}: prompts, and a key of yours if the provider needs one, would go to "
            f"{listed([*unnoted.values()])}, which {named.unnamed(' && '.join(unnoted))}"
        )


def check_price(llm: LLMSettings, max_cost: float | None) -> None:
    """Reject a limit of the cost that cannot hold; SpecError if the price is unknown."""
    if max_cost is not None and price_of(llm) is None:
        raise unknown_price(llm.name)


def price_of(llm: LLMSettings) -> Price | None:
    """Return what a language model costs: as stated, otherwise as listed; None if unknown."""
    from falsifier.llm.litellm_adapter import listed_price

    if llm.price:
        return Price(*llm.price)
    return Price(0.0, 0.0) if is_model_file(llm.name) else listed_price(llm.name, api_base=llm.api_base)
