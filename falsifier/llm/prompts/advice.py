"""What to consider for the next sample: by what is chosen, and by what the samples so far show."""

from collections.abc import Iterator

from falsifier.core.space import SearchSpace

_BY_NAMES = "If names or descriptions suggest how a violation comes about, begin with that; otherwise, "
_FIRST_OF = {
    "parameters": "the limits of the ranges are good first samples",
    "jumping": (
        "go through all values, each held for long enough, and to some of them again after others, which "
        "shows what the system does with them and whether their order matters"
    ),
    "inputs": (
        "good first samples are the limits of the ranges, steps between these, of each input at times of its "
        "own, or a slow run through a whole range: they show how and where the system reacts"
    ),
}
_ON_TIME = (
    "Look at the times that decided the robustness values, and change the {what} so that the signals at such "
    "a time move towards violating the requirement."
)
_STUCK = "The last two samples were no better."
_ELSE = (
    "Try something else{unless}: a short pulse, a small amplitude, a slow change, a faster repetition, "
    "values just inside the limits, or one between them held for long."
)
_CLOSE = ", unless the best ones are close to a violation"


def on_first(space: SearchSpace, *, is_named: bool) -> str:
    """What is a good first sample; ``is_named``: names and descriptions are those of the model."""
    kind = "jumping" if _only_jumps(space) and not space.parameters else "inputs"
    if not any(r.free or r.control_points > 1 for r in space.inputs):
        kind = "parameters"
    text = f"{_BY_NAMES if is_named else ''}{_FIRST_OF[kind]}."
    return text[0].upper() + text[1:]


def on_next(space: SearchSpace, *, is_timed: bool, is_flat: bool, is_stuck: bool) -> Iterator[str]:
    """How to go on.

    ``is_timed``: the times that decided tell something; ``is_flat``: robustness was the same in all samples;
    ``is_stuck``: the last two were no better than those before.
    """
    if is_timed:
        yield _ON_TIME.format(what="inputs" if space.inputs else "parameters")
    if is_stuck and not is_flat:
        yield _STUCK
    if (is_stuck or is_flat) and not _only_jumps(space):
        yield _ELSE.format(unless="" if is_flat else _CLOSE)


def _only_jumps(space: SearchSpace) -> bool:
    return all(r.kind != "real" for r in space.inputs)
