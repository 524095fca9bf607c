"""The first simulations: the kinds of input that are most informative before anything is known."""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Literal

from falsifier.engines.surrogate.settings import Settings

Kind = Literal["constant", "switching", "stepping"]


def opening(
    settings: Settings, *, has_inputs: bool, windows: Sequence[float], needs_several: bool
) -> tuple[Kind, ...]:
    """Return the kinds of the first inputs, in order.

    Formulas with nested windows are violated by inputs that change a few times per inner window, so switching
    inputs come first. Requirements that a single extreme can violate start with constant extremes. If a
    violation requires several conditions at once, stepping inputs show how the outputs depend on the inputs.

    Args:
        settings: number of inputs of each kind.
        has_inputs: whether there are input signals, not only parameters.
        windows: lengths in s of the formula's inner windows.
        needs_several: whether a violation requires several conditions at once.
    """
    if not has_inputs:
        return ()
    switches: list[Kind] = ["switching"] * settings.bangs
    constants: list[Kind] = ["constant"] * settings.constants
    steps: list[Kind] = ["stepping"] * settings.probes
    if windows:
        pauses: list[Kind] = ["constant"] * settings.pauses
        turns = zip_longest(switches, pauses)
        return tuple(kind for turn in turns for kind in turn if kind is not None)
    return tuple(steps if needs_several else constants)
