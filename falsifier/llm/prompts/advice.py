"""What to consider for the next sample: by what is chosen, and by what the samples so far show."""

from falsifier.core.space import SearchSpace

_FIRST = "If names or descriptions suggest how a violation comes about, begin with that; otherwise, {}."
_FIRST_OF = {
    "parameters": "the limits of the ranges are good first samples",
    "jumping": (
        "go once through all values, each held for long enough, which shows what the system does with them"
    ),
    "inputs": (
        "the limits of the ranges are good first samples, and so are steps that are far apart, or a slow run "
        "through a whole range, which show how and where the system reacts"
    ),
}
_ON_TIME = (
    "Look at the times that decided the robustness values, or at which a violation was nearest, and change "
    "the {what} so that the signals at such a time move towards violating the requirement."
)
_ON_STRATEGY = (
    "As long as samples improve, go on from the best ones, or between two of them. If they stop improving, "
    "do not just repeat the best one with small changes, unless it was very close to a violation, but "
    "try a different strategy{such}."
)
_ON_PLATEAU = "Do not just repeat a sample with small changes, but try a different strategy{such}."
_SUCH = (
    ", such as a single short pulse, a small amplitude, a slow change or a faster repetition; the limits of "
    "the ranges are not always the worst, as values just short of what the system reacts to may be"
)


def on_first(space: SearchSpace) -> str:
    """What is a good first sample."""
    if not any(r.free or r.control_points > 1 for r in space.inputs):
        return _FIRST.format(_FIRST_OF["parameters"])
    return _FIRST.format(_FIRST_OF["jumping" if _only_jumps(space) and not space.parameters else "inputs"])


def on_next(space: SearchSpace, *, count: int, is_timed: bool, is_flat: bool) -> str:
    """How to use so many samples; empty if there is nothing to say.

    ``is_timed``: the times that decided their robustness tell something; ``is_flat``: it was the same in all.
    """
    what, such = "inputs" if space.inputs else "parameters", "" if _only_jumps(space) else _SUCH
    on_time = [_ON_TIME.format(what=what)] if is_timed else []
    on_strategy = [(_ON_PLATEAU if is_flat else _ON_STRATEGY).format(such=such)] if count > 1 else []
    return "\n".join((*on_time, *on_strategy))


def _only_jumps(space: SearchSpace) -> bool:
    return all(r.kind != "real" for r in space.inputs)
