"""What a prompt may tell beside the problem and its samples: limit, start, doubts."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field

from falsifier.evaluation.confirm import Confirmation
from falsifier.stl.margins import signed


@dataclass(frozen=True, slots=True)
class Circumstances:
    """The circumstances of a question.

    Attributes:
        simulations: maximum number of simulations of the run; None: no limit, or unknown.
        start: smallest and largest value of each output at time 0, by name.
        doubts: why a violation does not count, by the key of its candidate.
    """

    simulations: int | None = None
    start: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    doubts: Mapping[Hashable, str] = field(default_factory=dict)


def in_doubt(confirmation: Confirmation, shown: Callable[[float], float] = float) -> str:
    """Why a violation does not count, without any name, and what would count.

    Args:
        confirmation: how the violation was repeated.
        shown: turns a robustness into the number that is told.
    """
    found = confirmation.evaluation.robustness
    assert found is not None
    robustness, reference, halved = (
        None if value is None else shown(value)
        for value in (confirmation.robustness, confirmation.reference, confirmation.halved)
    )
    found = shown(found)
    again = halved if robustness is not None else None
    if robustness is None:
        why = "a second simulation of it failed"
    elif robustness >= 0:
        again, why = robustness, f"a second simulation gave robustness {signed(robustness, 3)}"
    elif again is not None and again >= 0:
        why = f"at half the simulation step its robustness is {signed(again, 3)}"
    else:
        told = "" if reference is None else f", {signed(reference, 3)} instead of {signed(robustness, 3)}"
        why = f"a second monitor does not confirm it{told}"
    text = f"this does not count as a violation, it is {confirmation.outcome}: {why}"
    if again is None or again < 0:
        return text
    error = f"{again - found:.2g}"
    return f"{text}. Find one that is clearer: below 0 by more than {error}, the error of the simulation"
