"""The arrays through which a simulation receives its inputs and returns its outputs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.fmu.plan import Plan


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Arrays that a plan's simulations read from and write to; they may be in shared memory.

    Attributes:
        parameters: values to set, shape (parameters,).
        inputs: each input as a piecewise cubic (``Signal.pieces``), shape (inputs, 5 * pieces); unused pieces
            start at inf.
        outputs: recorded values by output and sample, shape (outputs, samples).
        component: position of the component of a system whose code runs, shape (1,); after a crash it tells
            which one crashed. 0 for a single FMU.
    """

    parameters: NDArray[np.float64]
    inputs: NDArray[np.float64]
    outputs: NDArray[np.float64]
    component: NDArray[np.float64]

    @staticmethod
    def size(plan: Plan) -> int:
        """Return the number of float64 values that a plan needs."""
        rows = len(plan.inputs) * 5 * plan.pieces + len(plan.outputs) * plan.samples
        return len(plan.parameters) + rows + 1

    @classmethod
    def over(cls, plan: Plan, memory: NDArray[np.float64]) -> "Room":
        """Return a plan's arrays as views of a flat array of at least ``size`` float64 values."""
        a = len(plan.parameters)
        b = a + len(plan.inputs) * 5 * plan.pieces
        c = b + len(plan.outputs) * plan.samples
        return cls(
            memory[:a],
            memory[a:b].reshape(len(plan.inputs), 5 * plan.pieces),
            memory[b:c].reshape(len(plan.outputs), plan.samples),
            memory[c : c + 1],
        )
