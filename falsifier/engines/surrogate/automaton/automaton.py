"""The automaton as dynamics: learnt from recordings, used only if it repeats them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.guards import Guard, find_guards
from falsifier.engines.surrogate.automaton.modes import find_modes
from falsifier.engines.surrogate.automaton.recording import Motion, Recording

# The differences that may be guards grow with the square of the number of outputs.
MOST_OUTPUTS = 20
# A step of a roll-out takes so many output intervals at most, and this share of the fastest time constant.
_STEP, _TURN = 20, 0.3
# Largest rate of a law times the output interval: what is faster cannot be seen at the outputs.
_FASTEST = 1.0
# Events that a trajectory may have before its samples are thinned out.
_MOST_EVENTS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Automaton:
    """Modes with linear accelerations, and guards between them.

    Attributes:
        laws: coefficients of the accelerations, shape (n, modes, features), see ``modes.features``.
        guards: events between modes.
        modes: modes at the start, shape (n,).
        interval: output interval in s.
    """

    laws: Array
    guards: tuple[Guard, ...]
    modes: NDArray[np.intp]
    interval: float

    @property
    def _fastest(self) -> float:
        """Largest rate of decay or oscillation of any law, in 1/s."""
        driven = (self.laws.shape[2] - 3) // 2
        damping = np.abs(self.laws[:, :, 1]) + np.abs(self.laws[:, :, 3 + driven :]).sum(axis=2)
        return max(float((damping + np.sqrt(np.abs(self.laws[:, :, 2]))).max()), 1e-12)

    def steps(self, cell: float) -> int:
        """Return the number of steps that a roll-out takes in a cell of this length in s."""
        return max(1, math.ceil(cell / min(_STEP * self.interval, _TURN / self._fastest) - 1e-9))

    def trajectory(
        self, inputs: Array, outputs: Array, velocities: Array, cell: float
    ) -> tuple[Array, NDArray[np.intp]]:
        """Predict one trajectory.

        Args:
            inputs: scaled inputs and parameters, shape (cells, p).
            outputs: outputs at the start, shape (n,).
            velocities: their velocities, shape (n,).
            cell: length of a cell in s.

        Returns:
            The outputs at steps and events, shape (samples, n), and the index of each cell's first sample
            and of the last sample, shape (cells + 1,).
        """
        from falsifier.engines.surrogate.automaton.kernel import roll_out

        steps = self.steps(cell)
        samples = np.empty((len(inputs) * steps + _MOST_EVENTS, len(outputs)))
        first = np.empty(len(inputs) + 1, np.intp)
        integers = np.array([(g.output, g.source, g.target, g.high, g.low) for g in self.guards], np.intp)
        reals = np.array([(g.threshold, g.direction, g.factor, g.offset) for g in self.guards])
        count = roll_out(
            self.laws,
            integers,
            reals,
            self.modes.copy(),
            outputs.copy(),
            velocities.copy(),
            np.ascontiguousarray(inputs),
            cell,
            steps,
            samples,
            first,
        )
        return samples[:count], first


def learn(recordings: Sequence[Recording], rng: np.random.Generator) -> Automaton | None:
    """Return an automaton that explains the recordings, or None.

    The class is narrow on purpose: in each of up to three modes, an output's acceleration is linear in its
    velocity, its value, the inputs, and the inputs times its velocity; its mode changes where an output or
    the difference of two passes a threshold, and its velocity may then jump by a linear map. That a system is
    not like that shows at once, in milliseconds.
    """
    n = recordings[0].outputs.shape[1]
    motions, modes = [], []
    for output in range(n):
        motion = Motion.of(recordings, output)
        found = find_modes(recordings, motion, rng)
        if found is None:
            return None
        motions.append(motion)
        modes.append(found)
    guards = find_guards(recordings, motions, modes)
    if not guards:
        return None
    laws = np.zeros((n, max(len(m.laws) for m in modes), modes[0].laws.shape[1]))
    start = np.zeros(n, np.intp)
    for i, (motion, found) in enumerate(zip(motions, modes, strict=True)):
        laws[i, : len(found.laws)] = found.laws
        early = [
            label
            for piece, label in zip(motion.pieces, found.labels, strict=True)
            if piece.start == 0 and label >= 0
        ]
        start[i] = np.bincount(early).argmax() if early else 0
    automaton = Automaton(laws, tuple(guards), start, recordings[0].step)
    return automaton if automaton._fastest * automaton.interval <= _FASTEST else None
