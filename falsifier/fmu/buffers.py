"""The arrays through which a simulation gets its inputs and gives its outputs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu.plan import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Arrays that a plan's simulations read from and write to; they may lie in shared memory.

    Attributes:
        parameters: values to set, shape (parameters,).
        inputs: each input as a piecewise cubic (Signal.pieces), shape (inputs, 5 * pieces); pieces that are
            not there start at inf.
        outputs: recorded values by output and sample, shape (outputs, samples).
    """

    parameters: NDArray[np.float64]
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]

    @staticmethod
    def size(plan: Plan) -> int:
        """Number of float64 that a plan needs."""
        rows = len(plan.inputs) * 5 * plan.pieces + len(plan.outputs) * plan.samples
        return len(plan.parameters) + rows

    @classmethod
    def over(cls, plan: Plan, memory: NDArray[np.float64]) -> "Room":
        """Lay a plan's arrays over a flat array of at least ``size`` float64."""
        a = len(plan.parameters)
        b = a + len(plan.inputs) * 5 * plan.pieces
        c = b + len(plan.outputs) * plan.samples
        return cls(
            memory[:a],
            memory[a:b].reshape(len(plan.inputs), 5 * plan.pieces),
            memory[b:c].reshape(len(plan.outputs), plan.samples),
        )
