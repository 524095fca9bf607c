"""The part of a prompt that advises how to use the rest."""

from falsifier.llm.prompts.blocks import AdviceBlock
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.stl.formula import Implies


def advice(view: View, variant: Variant) -> AdviceBlock:
    """Advice that fits what the variant shows and how the requirement is built."""
    lines = ["Use the output values of the earlier samples to work out how each input affects the outputs."]
    if variant.has("critical"):
        lines.append(
            "Look at the time that decided each robustness value, and change the inputs so that the signals "
            "at that time move towards violating the requirement."
        )
    if variant.has("observations"):
        lines += _on_observations(view)
    if variant.has("freedom") and any(r.free for r in view.space.inputs):
        lines.append(
            "Choose the signal shape that a violation needs: constant interpolation with your own times for "
            "steps and short pulses, few control points for slow changes, pieces of half a period to excite "
            "a resonance."
        )
    return AdviceBlock(lines=tuple(lines))


def _on_observations(view: View) -> list[str]:
    lines = [
        "The limits of the ranges are good first samples; for signals, so is a single switch between them."
    ]
    formula = view.requirement.formula
    units = {view.unit(name) for name in formula.signals}
    if len(formula.predicates) > 1 and len(units) > 1:
        lines.append(
            "Robustness values of different parts are in the units of their signals: a small value in one "
            "unit may be harder to change than a large value in another."
        )
    if any(isinstance(part, Implies) for part in formula.walk()):
        lines.append(
            "An implication is violated only if its condition is true and its consequence fails: make the "
            "condition true first."
        )
    lines.append(
        "Do not just repeat the best sample with small changes: if samples stop improving, try a different "
        "strategy."
    )
    return lines
