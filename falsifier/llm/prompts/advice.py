"""The part of a prompt that advises how to use the rest."""

from falsifier.core.space import InputRange
from falsifier.core.words import listed
from falsifier.llm.prompts.blocks import AdviceBlock
from falsifier.llm.prompts.published import guidance
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.stl.formula import Always, And, Formula, Implies


def advice(view: View, variant: Variant, *, is_flat: bool = False) -> AdviceBlock:
    """Advice that fits what the variant shows, how the requirement is built and what is chosen.

    Args:
        view: the problem.
        variant: which parts the prompt contains.
        is_flat: whether all samples have the same robustness, so that what decided it gives no direction.
    """
    if variant.is_published:
        return AdviceBlock(lines=guidance(view, variant))
    what = view.chosen
    deciding = (
        f"Look at the time that decided each robustness value, and change the {what} so that the signals "
        "at that time move towards violating the requirement."
    )
    samples = [
        f"Use the output values of the earlier samples to work out how each {what[:-1]} affects the outputs.",
        *([] if is_flat else [deciding]),
        "Do not just repeat the best sample with small changes: if samples stop improving, try a different "
        f"strategy{_such_as(view)}.",
    ]
    return AdviceBlock(lines=tuple(_at_any_time(view, variant)), on_samples=tuple(samples))


def _such_as(view: View) -> str:
    if all(_is_discrete(view, r) for r in view.space.inputs):
        return ""
    return (
        ", such as a single short pulse, a small amplitude, a slow change or a faster repetition; the limits "
        "of the ranges are not always the worst"
    )


def _at_any_time(view: View, variant: Variant) -> list[str]:
    """Advice that needs no earlier sample."""
    formula = view.requirement.formula
    lines = ["The limits of the ranges are good first samples."]
    if view.space.inputs:
        lines = [
            "The limits of the ranges are good first samples, and so is a single switch from one limit to "
            "the other."
        ]
    if view.space.inputs and all(_is_discrete(view, r) for r in view.space.inputs):
        lines = ["One value throughout, and a single switch to another value, are good first samples."]
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
