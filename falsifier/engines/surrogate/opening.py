"""The first simulations: which kinds of input teach most before anything is known."""

from collections.abc import Sequence
from itertools import zip_longest
from typing import Literal

from falsifier.engines.surrogate.settings import Settings

Kind = Literal["constant", "switching", "stepping"]


def opening(
    settings: Settings, *, has_inputs: bool, windows: Sequence[float], needs_several: bool
) -> tuple[Kind, ...]:
    """Kinds of the first inputs, in order.

    Windows inside of windows are violated by inputs that change a few times in a window, so that switching
    comes first there. Requirements that one extreme can violate are tried with constant extremes, and where
    several things must happen at once stepping signals show how the outputs depend on the inputs.

    Args:
        settings: how many of each.
        has_inputs: whether there are input signals and not parameters alone.
        windows: lengths in s of the formula's inner windows.
        needs_several: whether a violation needs several things at once.
    """
    if not has_inputs:
        return ()
    switches: list[Kind] = ["switching"] * settings.bangs
    constants: list[Kind] = ["constant"] * settings.constants
    steps: list[Kind] = ["stepping"] * settings.probes
    if windows:
        turns = zip_longest(switches, constants)
        return tuple(kind for turn in turns for kind in turn if kind is not None)
    return tuple(steps if needs_several else constants)
