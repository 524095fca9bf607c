"""Candidates in words: the same words on the terminal, in notebooks, in reports and in notes to an LLM."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import SearchSpace

# Control points told in full; longer signals are cut in the middle.
_SHOWN_POINTS = 12


@dataclass(frozen=True, slots=True)
class Choice:
    """What a candidate says of one input or parameter.

    Attributes:
        role: ``input`` or ``parameter``.
        name: of the input or parameter.
        unit: of its values, empty where unknown.
        text: its values in words.
    """

    role: Literal["input", "parameter"]
    name: str
    unit: str
    text: str

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def choices(candidate: Candidate, space: SearchSpace | None = None) -> list[Choice]:
    """What a candidate says, inputs first; units come from the search space."""
    units: dict[str, str] = {}
    if space is not None:
        units |= {r.name: r.unit for r in space.inputs} | {p.name: p.unit for p in space.parameters}
    return [
        *(Choice("input", n, units.get(n, ""), signal_text(s)) for n, s in candidate.signals.items()),
        *(Choice("parameter", n, units.get(n, ""), f"{v:.10g}") for n, v in candidate.parameters.items()),
    ]


def candidate_lines(candidate: Candidate, space: SearchSpace) -> list[str]:
    """One aligned line per input and parameter."""
    return [
        f"{c.role:<14} {c.label}{' =' if c.role == 'parameter' else ''} {c.text}"
        for c in choices(candidate, space)
    ]


def in_one_line(candidate: Candidate, space: SearchSpace | None = None) -> str:
    """A candidate in one line."""
    return "; ".join(
        f"{c.label}{' =' if c.role == 'parameter' else ''} {c.text}" for c in choices(candidate, space)
    )


def signal_text(signal: Signal) -> str:
    """Control points of a signal, and how lively it is: a reader judges how plausible that is.

    >>> signal_text(Signal((0.0, 2.5), (100.0, 0.0), "constant"))
    'constant: 100 at 0 s, 0 at 2.5 s (1 switch)'
    >>> signal_text(Signal((0.0,), (3.0,)))
    'constant 3'
    """
    if len(set(signal.values)) == 1:
        return f"constant {signal.values[0]:g}"
    points = [f"{v:g} at {t:.4g} s" for t, v in zip(signal.times, signal.values, strict=True)]
    if len(points) > _SHOWN_POINTS:
        half = _SHOWN_POINTS // 2
        points = [*points[:half], f"... {len(points) - 2 * half} more ...", *points[-half:]]
    dwell = signal.shortest_dwell
    lively = "" if dwell is None else f", shortest dwell {dwell:.4g} s"
    return f"{signal.interpolation}: {', '.join(points)} ({counted(signal.switches, 'switch')}{lively})"


def counted(count: int, noun: str) -> str:
    """A number of things, in the singular or plural.

    >>> counted(1, "switch"), counted(2, "switch"), counted(0, "simulation")
    ('1 switch', '2 switches', '0 simulations')
    """
    plural = f"{noun}es" if noun.endswith(("ch", "sh", "s", "x")) else f"{noun}s"
    return f"{count} {noun if count == 1 else plural}"


def listed(parts: Sequence[str]) -> str:
    """Several things as a sentence has them.

    >>> listed(["a"]), listed(["a", "b", "c"])
    ('a', 'a, b and c')
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
