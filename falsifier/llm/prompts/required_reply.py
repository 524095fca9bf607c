"""The part of a prompt that says how to reply."""

import json
from collections.abc import Sequence

from falsifier.core.space import InputRange, ParameterRange, nearest_value
from falsifier.core.words import counted
from falsifier.llm import ReplyKind
from falsifier.llm.prompts.view import Variant, View

_RATIONALE = "why these values"
_ALL_NOTE = "Every {} must be given in every reply, also those that stay as they were."
_FREE_NOTES = (
    'If "times" is empty, the values are evenly spaced control points from 0 to the stop time, however many '
    "there are; with constant interpolation they are pieces of equal length. One value alone is a constant.",
    'Otherwise "times" gives the time in s of each value, increasing from 0; the last value is held to the '
    "stop time.",
)
# Places in a range of the numbers of an example: unlike each other, so that none looks recommended.
_PLACES = (0.13, 0.86, 0.42, 0.68, 0.27, 0.94, 0.55)
# Share of the stop time at which the pieces of an example begin.
_BEGINNINGS = (0.0, 0.24, 0.62)


_POINTS = (
    "Think step by step, but write no code. End your reply with {what}: {order}; separate the numbers by "
    "commas and put {them} between <point> and </point>."
)
_JSON = "Reply with one JSON object{many} in this form, with one or two sentences of rationale{own}:"
_OWN_NUMBERS = "; the numbers below only show the form, choose your own"
_LESSONS = "what the samples taught so far"
_LESSONS_NOTE = (
    '"lessons" is shown to you again in the next question, in place of the earlier one: two or three '
    "sentences on what you know by now of the system and what remains to be tried."
)


def reply_text(view: View, variant: Variant, count: int, reply: ReplyKind = "json") -> str:
    """Say what form a reply has."""
    if reply == "points":
        what, them = ("the new sample", "them")
        if count > 1:
            what, them = (f"{count} different samples", "each sample")
        return _POINTS.format(what=what, order=_order(view, variant), them=them)
    many = f" with {count} different candidates" if count > 1 else ""
    if variant.is_published:
        # The published prompts show no numbers before the first sample.
        return "\n".join((_JSON.format(many=many, own=""), _blank(view, variant, count)))
    return "\n".join((_JSON.format(many=many, own=_OWN_NUMBERS), *_filled(view, variant, count)))


def _filled(view: View, variant: Variant, count: int) -> list[str]:
    """The form of a reply with numbers that no reader takes for advice, and notes on it."""
    space = view.space
    one: dict[str, object] = {"rationale": _RATIONALE}
    free = variant.has("freedom") and any(r.free for r in space.inputs)
    if space.inputs:
        one["signals"] = [_example(view, r, k, free=free) for k, r in enumerate(space.inputs)]
    if space.parameters:
        values = _spread([(p.low, p.high) for p in space.parameters])
        one["parameters"] = [
            {"name": p.name, "value": _admissible(view, p, value)}
            for p, value in zip(space.parameters, values, strict=True)
        ]
    told = one if count == 1 else {"candidates": [one]}
    example = json.dumps({"lessons": _LESSONS, **told} if variant.has("lessons") else told)
    several = len(space.names) > 1
    what = " and ".join(["input"] * bool(space.inputs) + ["parameter"] * bool(space.parameters))
    notes = [_ALL_NOTE.format(what)] if several else []
    notes += _FREE_NOTES if free else ()
    return [example, *notes, *([_LESSONS_NOTE] if variant.has("lessons") else ())]


def _order(view: View, variant: Variant) -> str:
    """Which numbers a point has."""
    numbers = counted(len(view.space.dimensions), "number")
    if variant.is_published:
        return f"its {numbers} in the order above"
    signals = (
        f"the value of {r.name}"
        if r.control_points == 1
        else f"the values of {r.name} at its {r.control_points} control points"
        for r in view.space.inputs
    )
    return f"its {numbers} in this order: {', '.join((*signals, *(p.name for p in view.space.parameters)))}"


def _blank(view: View, variant: Variant, count: int) -> str:
    """The form of a reply with blanks in place of numbers."""
    space, parts = view.space, [f'"rationale": {json.dumps(_RATIONALE)}']
    if not variant.has("names"):
        parts.append(f'"point": [{counted(len(space.dimensions), "number")}]')
    else:
        signals = (
            f'{{"name": {json.dumps(r.name)}, "values": [{counted(r.control_points, "number")}]}}'
            for r in space.inputs
        )
        parameters = (f'{{"name": {json.dumps(p.name)}, "value": number}}' for p in space.parameters)
        if space.inputs:
            parts.append(f'"signals": [{", ".join(signals)}]')
        if space.parameters:
            parts.append(f'"parameters": [{", ".join(parameters)}]')
    one = f"{{{', '.join(parts)}}}"
    return one if count == 1 else f'{{"candidates": [{one}]}}'


def _example(view: View, r: InputRange, position: int, *, free: bool) -> dict[str, object]:
    limits = [(r.low, r.high)]
    if not free:
        values = [_admissible(view, r, v) for v in _spread(limits * r.control_points, position)]
        return {"name": r.name, "values": values}
    times: list[float] = []
    interpolation: str = r.interpolation
    count = min(r.control_points, len(_PLACES))
    stepping = r.free and r.free.max_control_points >= len(_BEGINNINGS)
    if stepping and r.free and position == 0 and r.free.min_interval <= view.space.stop_time / 5:
        times = [float(f"{share * view.space.stop_time:.3g}") for share in _BEGINNINGS]
        interpolation, count = "constant", len(times)
    elif r.free is None:
        count = r.control_points
    values = [_admissible(view, r, v) for v in _spread(limits * count, position)]
    return {"name": r.name, "interpolation": interpolation, "times": times, "values": values}


def _admissible(view: View, ranged: InputRange | ParameterRange, value: float) -> float:
    """The nearest value that a reply may contain; a type that is not told has levels."""
    levels = view.levels.get(ranged.name)
    return min(levels, key=lambda level: abs(level - value)) if levels else nearest_value(ranged, value)


def _spread(limits: Sequence[tuple[float, float]], first: int = 0) -> list[float]:
    """Numbers within their limits that differ from each other."""
    places = (_PLACES[(first + k) % len(_PLACES)] for k in range(len(limits)))
    return [
        float(f"{low + place * (high - low):.4g}") for place, (low, high) in zip(places, limits, strict=True)
    ]
