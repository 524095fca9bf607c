"""What an engine proposes, checked before anything is simulated."""

from collections.abc import Sequence

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.engines.protocol import Engine
from falsifier.errors import CandidateError, SpecError


def proposals(engine: Engine, space: SearchSpace, wanted: int) -> list[Candidate]:
    """Ask an engine, and return its candidates as they will be simulated.

    Args:
        engine: the engine, possibly made by the user.
        space: what may be varied.
        wanted: number of candidates to ask for.

    Raises:
        SpecError: if the engine returns something else than a list of candidates, none, or more than it was
            asked for.
        CandidateError: naming the engine and the input or parameter that is unknown, missing or outside its
            range.
    """
    candidates = engine.ask(wanted)
    if not isinstance(candidates, Sequence) or not all(isinstance(c, Candidate) for c in candidates):
        raise SpecError(
            f"engine {engine.name!r}: ask(n) must return a list of Candidate, got {repr(candidates)[:100]}"
        )
    if not candidates:
        raise SpecError(f"engine {engine.name!r} returned no candidate: ask(n) must return at least one")
    if len(candidates) > wanted:
        raise SpecError(
            f"engine {engine.name!r} returned {len(candidates)} candidates: ask({wanted}) must return "
            f"at most {wanted}"
        )
    try:
        return [space.admit(candidate) for candidate in candidates]
    except CandidateError as error:
        raise CandidateError(f"engine {engine.name!r}: {error}") from None
