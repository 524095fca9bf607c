"""Systems with events, solved piece by piece without steps: accelerations are constant between events."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.recording import Recording

STEP, CELL, CELLS = 0.01, 1.0, 30


@dataclass(frozen=True)
class Event:
    """``difference @ outputs`` passes a threshold in a direction: an output's mode and velocity change."""

    output: int
    source: int
    target: int
    difference: tuple[float, ...]
    threshold: float
    direction: int
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class System:
    """Outputs at the start, their modes and accelerations, and the events."""

    start: tuple[float, ...]
    accelerations: Callable[[Sequence[int], float], Sequence[float]]
    events: tuple[Event, ...]
    velocity: tuple[float, ...] = ()

    def solve(self, inputs: Array, *, step: float = STEP) -> Recording:
        """Simulate inputs that are held in cells, shape (CELLS,)."""
        per_cell = round(CELL / step)
        y = np.array(self.start)
        v = np.array(self.velocity or [0.0] * len(y))
        modes = [0] * len(y)
        outputs = [y.copy()]
        for u in inputs:
            for _ in range(per_cell):
                rest = step
                while True:
                    a = np.array(self.accelerations(modes, u))
                    times = [
                        self._due(e, y, v, a, rest) if modes[e.output] == e.source else rest
                        for e in self.events
                    ]
                    span = min([rest, *times])
                    y, v = y + v * span + a * span**2 / 2, v + a * span
                    rest -= span
                    if rest <= 0:
                        break
                    event = self.events[int(np.argmin(times))]
                    modes[event.output] = event.target
                    v[event.output] = event.factor * v[event.output] + event.offset
                outputs.append(y.copy())
        held = np.repeat(inputs, per_cell)
        return Recording(step, np.array(outputs), np.append(held, held[-1])[:, None])

    def _due(self, event: Event, y: Array, v: Array, a: Array, span: float) -> float:
        d = np.array(event.difference)
        roots = np.roots([d @ a / 2, d @ v, d @ y - event.threshold])
        for time in sorted(float(r.real) for r in roots if abs(r.imag) < 1e-12):
            moving = event.direction * (d @ (v + a * time)) > 0
            if moving and -1e-9 <= time < span:
                return max(time, 0.0)
        return span


# A puck between two walls, pushed by the input; it loses a twentieth of its speed at the left one.
PUCK = System(
    (0.3,),
    lambda modes, u: [2.0 * u - 1.0],
    (
        Event(0, 0, 0, (1.0,), 1.0, 1, factor=-1.0),
        Event(0, 0, 0, (1.0,), 0.0, -1, factor=-0.95),
    ),
    (1.0,),
)

# A car ahead, which the input drives, and one that goes forwards and backwards, after the cars of ARCH-COMP.
CONVOY = System(
    (0.0, 10.0),
    lambda modes, u: [-0.4 * u, -1.0 if modes[1] else 0.0],
    (
        Event(1, 0, 1, (-1.0, 1.0), 15.0, 1, factor=-1.0),
        Event(1, 1, 0, (-1.0, 1.0), 10.0, -1, factor=-1.0),
    ),
)


def driven(count: int, *, seed: int = 0) -> list[Array]:
    """Return inputs at the bounds 0 and 1 or between them, of a few pieces, shape (CELLS,) each."""
    rng = np.random.default_rng(seed)
    levels = [rng.choice([0.0, 0.2, 0.6, 1.0], size=5) for _ in range(count)]
    return [np.repeat(level, CELLS // 5) for level in levels]
