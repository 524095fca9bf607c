"""How to make use of what a prompt tells."""

from falsifier.llm.prompts.blocks import AdviceBlock
from falsifier.llm.prompts.variants import Variant
from falsifier.llm.prompts.view import View
from falsifier.stl.formula import Implies


def advice(view: View, variant: Variant) -> AdviceBlock:
    """Advice that fits what the variant tells and what the requirement asks."""
    lines = ["Use the output values of the earlier samples to work out how each input moves the outputs."]
    if variant.has("critical"):
        lines.append(
            "Look at the time that decided each robustness value, and change the inputs so that the signals "
            "there move towards the wrong side."
        )
    if variant.has("observations"):
        lines += _on_observations(view)
    if variant.has("freedom") and any(r.free for r in view.space.inputs):
        lines.append(
            "Choose the shape that the violation needs: steps and short pulses by constant pieces with times "
            "of your own, slow changes by few points, a resonance by pieces of half its period."
        )
    return AdviceBlock(lines=tuple(lines))


def _on_observations(view: View) -> list[str]:
    lines = ["Extremes of the ranges are cheap first samples; for signals also one switch between them."]
    formula = view.requirement.formula
    units = {view.unit(name) for name in formula.signals}
    if len(formula.predicates) > 1 and len(units) > 1:
        lines.append(
            "Robustness values of different parts are in the units of their signals: a small number in one "
            "unit may be harder to move than a large one in another."
        )
    if any(isinstance(part, Implies) for part in formula.walk()):
        lines.append(
            "An implication is violated only where its condition holds and its consequence fails: bring "
            "about the condition first."
        )
    lines.append(
        "Do not only repeat the best sample with small changes: when samples stop improving, try another "
        "strategy."
    )
    return lines
