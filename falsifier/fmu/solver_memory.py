"""What the solver of model-exchange FMUs works on: the model, and the memory of one simulation."""

from math import prod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from falsifier.core.operating_system import guarded_memory
from falsifier.fmu.ports import Addresses, Table

# Rows of Memory.clock (s) and of Memory.counts.
TIME, NEXT_STEP, NEXT_EVENT = range(3)
COLUMN, IMPLICIT, STIFF_HITS, OTHER_HITS, EVENTS, JACOBIAN_KNOWN, INDICATORS_KNOWN = range(7)

Floats = NDArray[np.float64]


class Model(NamedTuple):
    """What does not change during a simulation.

    Attributes:
        functions: instance, FMI version and function addresses, in the order of the constants above.
        ports: continuous inputs (``Ports.table``).
        held_ports: inputs that may change only at events.
        getters: recorded variables.
        pieces: address of the continuous inputs' pieces (``Signal.pieces``) and their number per input.
        held_pieces: the same for the inputs that may change only at events.
        weights: absolute tolerance of each state, shape (states,).
        tolerance: relative tolerance.
        stop_time: stop time in s.
        max_step: maximum step in s.
    """

    functions: tuple[int, ...]
    ports: Addresses
    held_ports: Addresses
    getters: Addresses
    pieces: tuple[int, int]
    held_pieces: tuple[int, int]
    weights: Floats
    tolerance: float
    stop_time: float
    max_step: float


class Memory(NamedTuple):
    """What changes during a simulation.

    Attributes:
        clock: time, proposed step and next time event in s.
        counts: column to record next, method and counters.
        piece: current piece of each continuous input, then of each input that may change only at events.
        x: states.
        new_x: states at the end of a trial step.
        stages: derivatives at the stages of a step, shape (7, states).
        work: scratch vectors, shape (4, states).
        jacobian: partial derivatives of the state derivatives with respect to the states.
        factors: LU factors of the implicit step's matrix.
        pivots: row exchanges of the factorisation.
        z: event indicators.
        new_z: event indicators at a trial point.
        trials: event indicators on both sides of an event that is being located, and at a trial point
            between, shape (3, indicators).
        events: memory for the structures that the FMU fills at events, uint8[64].
    """

    clock: Floats
    counts: Table
    piece: Table
    x: Floats
    new_x: Floats
    stages: NDArray[np.float64]
    work: NDArray[np.float64]
    jacobian: NDArray[np.float64]
    factors: NDArray[np.float64]
    pivots: Table
    z: Floats
    new_z: Floats
    trials: NDArray[np.float64]
    events: NDArray[np.uint8]


def make_memory(states: int, indicators: int, inputs: int) -> Memory:
    """Return the memory of a simulation that starts at time 0."""
    return Memory(
        clock=np.array([0.0, 0.0, np.inf]),
        counts=np.zeros(7, dtype=np.int64),
        piece=np.zeros(inputs, dtype=np.int64),
        x=_written_by_fmu(states),
        new_x=_written_by_fmu(states),
        stages=_written_by_fmu(7, states),
        work=_written_by_fmu(4, states),
        jacobian=np.zeros((states, states)),
        factors=np.zeros((states, states)),
        pivots=np.zeros(states, dtype=np.int64),
        z=_written_by_fmu(indicators),
        new_z=_written_by_fmu(indicators),
        trials=_written_by_fmu(3, indicators),
        events=np.zeros(64, dtype=np.uint8),
    )


def _written_by_fmu(*shape: int) -> NDArray[np.float64]:
    """Return zeros; an FMU that writes past their end crashes there, instead of damaging what lies behind."""
    return np.ndarray(shape, np.float64, guarded_memory(8 * prod(shape)))
