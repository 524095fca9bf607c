"""The part of a prompt that advises how to use the rest."""

from falsifier.core.space import InputRange
from falsifier.core.words import listed
from falsifier.llm.prompts.view import Variant, View
from falsifier.stl.formula import Always, And, Formula, Implies


def advice(view: View, variant: Variant) -> tuple[str, ...]:
    """Advice that fits what the variant shows, how the requirement is built and what is chosen."""
    return _guidance(view, variant) if variant.is_published else tuple(_lasting(view, variant))


def advice_on_first(view: View) -> str:
    """Advice on a sample that nothing was simulated before."""
    if not view.space.inputs:
        return "The limits of the ranges are good first samples."
    if all(_is_discrete(view, r) for r in view.space.inputs):
        return "One value throughout, and a single switch to another value, are good first samples."
    return (
        "The limits of the ranges are good first samples, and so is a single switch from one limit to the "
        "other."
    )


def advice_on_samples(view: View, *, is_flat: bool) -> tuple[str, ...]:
    """Advice on how to use earlier samples.

    Args:
        view: the problem.
        is_flat: whether all samples have the same robustness, so that what decided it gives no direction.
    """
    what = view.chosen
    deciding = (
        f"Look at the time that decided each robustness value, and change the {what} so that the signals "
        "at that time move towards violating the requirement."
    )
    return (
        f"Use the output values of the earlier samples to work out how each {what[:-1]} affects the outputs.",
        *([] if is_flat else [deciding]),
        "Do not just repeat the best sample with small changes: if samples stop improving, try a different "
        f"strategy{_such_as(view)}.",
    )


def _guidance(view: View, variant: Variant) -> tuple[str, ...]:
    """What to consider; the same in every question, as published."""
    what = view.chosen
    lines = ["Consider which combinations of values had the lower robustness."]
    if not variant.has("names"):
        return (*lines, "Consider what each number may stand for and how it may act on the system.")
    lines.append(
        f"Use the meaning of the {what} and of the requirement: how each of the {what} acts on the output "
        "signals, what the requirement demands of these, and what could break it."
    )
    if variant.has("values"):
        lines.append(
            f"Study the output values of the samples: how they follow the {what}, and whether they move "
            "towards a violation."
        )
    return tuple(lines)


def _such_as(view: View) -> str:
    if all(_is_discrete(view, r) for r in view.space.inputs):
        return ""
    return (
        ", such as a single short pulse, a small amplitude, a slow change or a faster repetition; the limits "
        "of the ranges are not always the worst"
    )


def _lasting(view: View, variant: Variant) -> list[str]:
    """Advice that needs no earlier sample and does not end with the first."""
    formula = view.requirement.formula
    lines = []
    if _is_conjunction(formula):
        lines.append(
            "The requirement is a conjunction: it is violated as soon as any one of its conjuncts is. Its "
            "robustness is the smallest of theirs; choose the one that is easiest to violate."
        )
    if len(formula.predicates) > 1 and len({view.unit(name) for name in formula.signals}) > 1:
        lines.append(
            "Robustness values of different parts are in the units of their signals: a small value in one "
            "unit may be harder to change than a large value in another."
        )
    if any(isinstance(part, Implies) for part in formula.walk()):
        lines.append(
            "An implication is violated only if its condition is true and its consequence fails: make the "
            "condition true first."
        )
    if variant.has("freedom") and any(r.free for r in view.space.inputs):
        free = [r for r in view.space.inputs if r.free]
        if not all(_is_discrete(view, r) for r in free):
            lines.append(
                "Choose the signal shape that a violation needs: constant interpolation with your own times "
                "for steps and short pulses, few control points for slow changes, pieces of half a period to "
                "excite a resonance."
            )
        if discrete := [r.name for r in free if _is_discrete(view, r)]:
            lines.append(
                f"{listed(discrete)} can only jump from value to value: what matters is the order of the "
                "values, when each begins and how long it lasts. Try unusual orders, switching back, and "
                "stays that are just too short or too long for what the system does meanwhile."
            )
    return lines


def _is_discrete(view: View, r: InputRange) -> bool:
    return r.kind != "real" or r.name in view.levels


def _is_conjunction(formula: Formula) -> bool:
    while isinstance(formula, Always):
        formula = formula.operand
    return isinstance(formula, And)
