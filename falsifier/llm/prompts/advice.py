"""What to consider for the next sample: by what is chosen, and by what the samples so far show."""

from falsifier.core.space import SearchSpace

_BY_NAMES = "If names or descriptions suggest how a violation comes about, begin with that; otherwise, "
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
    "Look at the times {which}, and change the {what} so that the signals at such a time move towards "
    "violating the requirement."
)
_DECIDED, _NEAREST = "that decided the robustness values", "at which a violation was nearest"
_IMPROVING = "Samples improve: go on from the best ones, or combine what helped in several of them."
_STUCK = (
    "The last two samples were no better: do not just repeat the best one with small changes, unless it was "
    "very close to a violation, but try a different strategy{such}."
)
_ON_PLATEAU = "Do not just repeat a sample with small changes, but try a different strategy{such}."
_SUCH = (
    ", such as a short pulse, a small amplitude, a slow change, a faster repetition, or values just inside "
    "the limits"
)


def on_first(space: SearchSpace, *, is_named: bool) -> str:
    """What is a good first sample; ``is_named``: names and descriptions are those of the model."""
    kind = "jumping" if _only_jumps(space) and not space.parameters else "inputs"
    if not any(r.free or r.control_points > 1 for r in space.inputs):
        kind = "parameters"
    text = f"{_BY_NAMES if is_named else ''}{_FIRST_OF[kind]}."
    return text[0].upper() + text[1:]


def on_time(space: SearchSpace, *, is_joint: bool) -> str:
    """At which times to look; ``is_joint``: samples tell when most of what must happen together did."""
    which, what = _NEAREST if is_joint else _DECIDED, "inputs" if space.inputs else "parameters"
    return _ON_TIME.format(which=which, what=what)


def on_strategy(space: SearchSpace, *, is_flat: bool, is_stuck: bool) -> str:
    """How to go on; ``is_flat``: robustness was the same in all samples; ``is_stuck``: it fell no more."""
    text = _ON_PLATEAU if is_flat else _STUCK if is_stuck else _IMPROVING
    return text.format(such="" if _only_jumps(space) else _SUCH)


def _only_jumps(space: SearchSpace) -> bool:
    return all(r.kind != "real" for r in space.inputs)
