"""The automaton among the dynamics: when it is learnt, whether it is believed, what it predicts."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.automaton import MOST_OUTPUTS, Automaton, learn
from falsifier.engines.surrogate.automaton.recording import Recording
from falsifier.engines.surrogate.dynamics import Prediction, StartState
from falsifier.engines.surrogate.objective import Objective
from falsifier.engines.surrogate.trace import Trace

# Simulations that it is learnt from: the last one and those with the most events.
_MOST_RECORDINGS = 6
# Numbers of simulations after which that is tried: where it fails, it takes milliseconds.
_ATTEMPTS = frozenset({*range(2, 17), 24, 32, 48, 64, 96, 128})
_FEWEST_SAMPLES, _MOST_SAMPLES = 10, 100_000
# Times that it is learnt again after a wrong prediction.
_MOST_DOUBTS = 12
# An automaton is used if its error on the simulations it was learnt from is at most this share of the spread.
_BELIEVED = 0.05
# Steps and events of a roll-out, times outputs, that take half a millisecond.
_USUAL_LOAD = 10_000
# Largest size of a predicted output or error.
_FARTHEST = 1e100


@dataclass(frozen=True, slots=True, eq=False)
class AutomatonDynamics:
    """The automaton as dynamics on the grid, see ``dynamics.Dynamics``.

    Attributes:
        automaton: the automaton.
        objective: what the predictions are for.
        start: outputs and velocities at the start.
        error: median error on what it was learnt from, see ``_error``.
        load: how long a roll-out takes, compared with the usual half a millisecond.
    """

    automaton: Automaton
    objective: Objective
    start: StartState
    error: float
    load: float

    def predict(self, inputs: Array, start: Array) -> Prediction:
        """Predict m traces; the start states are not used, as the automaton has its own."""
        first = self.start.predict(inputs)
        n = first.shape[1] // 2
        states, excess = zip(
            *(self._trace(u, s[:n], s[n:]) for u, s in zip(inputs, first, strict=True)), strict=True
        )
        return Prediction(np.stack(states), np.stack(excess))

    def _trace(self, inputs: Array, outputs: Array, velocities: Array) -> tuple[Array, Array]:
        samples, first = self.automaton.trajectory(inputs, outputs, velocities, self.objective.grid.step)
        samples = _finite(samples)
        states = self.objective.coordinates.transformed(samples[first])
        held = np.repeat(inputs, np.diff(first), axis=0)
        margins = self.objective.margins(samples, np.concatenate([held, held[-1:]]))
        excess = np.zeros((len(inputs), len(margins)))
        for i, (leaf, margin) in enumerate(zip(self.objective.leaves, margins, strict=True)):
            if leaf.envelope == "sample":
                continue
            extreme = np.minimum if leaf.envelope == "low" else np.maximum
            ends = extreme(margin[first[:-1]], margin[first[1:]])
            excess[:, i] = extreme(extreme.reduceat(margin, first[:-1]), ends) - ends
        return states, excess


@dataclass
class AutomatonLearner:
    """Keeps the last simulations and learns an automaton from them if one explains them.

    Attributes:
        learnt: the automaton, if there is one.
    """

    learnt: AutomatonDynamics | None = None
    _heard: list[tuple[Recording, Trace]] = field(default_factory=list)
    _count: int = 0
    _doubts: int = 0
    _is_due: bool = False

    def hear(
        self,
        space: SearchSpace,
        outputs: Sequence[str],
        candidate: Candidate,
        trajectory: Trajectory,
        trace: Trace,
    ) -> None:
        """Keep a simulation, unless it is too large to be learnt from."""
        if not 0 < len(outputs) <= MOST_OUTPUTS or not _FEWEST_SAMPLES <= len(trajectory) <= _MOST_SAMPLES:
            return
        self._count += 1
        self._is_due |= self.learnt is None and self._count in _ATTEMPTS
        self._heard.append((_recording(space, outputs, candidate, trajectory), trace))
        if len(self._heard) > _MOST_RECORDINGS:
            del self._heard[int(np.argmin([recording.kinks for recording, _ in self._heard[:-1]]))]

    def doubt(self) -> None:
        """Learn again before the next use, as a prediction was wrong; after some times, that is of no use."""
        self._doubts += 1
        self._is_due |= self._doubts <= _MOST_DOUBTS

    def current(self, objective: Objective, rng: np.random.Generator) -> AutomatonDynamics | None:
        """Return the automaton, learnt again if that is due; None if there is none."""
        if not self._is_due:
            return self.learnt
        self._is_due = False
        self.learnt = None
        recordings, traces = [r for r, _ in self._heard], [t for _, t in self._heard]
        automaton = learn(recordings, rng)
        if automaton is None:
            return None
        firsts = np.stack([np.concatenate([r.outputs[0], r.starting_velocity]) for r in recordings])
        start = StartState(firsts, np.stack([t.inputs[0] for t in traces]))
        error = _error(automaton, objective, recordings)
        if error <= _BELIEVED:
            grid = objective.grid
            events = sum(r.kinks for r in recordings) / len(recordings)
            steps = grid.cells * automaton.steps(grid.step) + events
            load = steps * len(automaton.laws) / _USUAL_LOAD
            self.learnt = AutomatonDynamics(automaton, objective, start, error, load)
        return self.learnt


def _recording(
    space: SearchSpace, outputs: Sequence[str], candidate: Candidate, trajectory: Trajectory
) -> Recording:
    times = np.asarray(trajectory.step * np.arange(len(trajectory)), np.float64)
    columns = [
        (candidate.signals[r.name].sample(times) - r.low) / ((r.high - r.low) or 1.0) for r in space.inputs
    ]
    columns += [
        np.full(len(times), (candidate.parameters[p.name] - p.low) / ((p.high - p.low) or 1.0))
        for p in space.parameters
    ]
    return Recording(
        trajectory.step,
        np.stack([trajectory[name] for name in outputs], axis=1),
        np.stack(columns, axis=1),
    )


def _error(automaton: Automaton, objective: Objective, recordings: Sequence[Recording]) -> float:
    """Return the coordinates' root mean square error as a share of their spread: the recordings' median.

    The median, as a few may enter modes that were too rare to be learnt. The inputs are those at the
    samples, as they may switch within a cell.
    """
    true = [objective.coordinates.transformed(r.outputs) for r in recordings]
    everything = np.concatenate(true)
    spread = everything.std(axis=0) + 1e-9 * np.abs(everything).max(axis=0, initial=0.0) + 1e-300
    errors = []
    for recording, states in zip(recordings, true, strict=True):
        samples, first = automaton.trajectory(
            recording.inputs[:-1], recording.outputs[0], recording.starting_velocity, recording.step
        )
        predicted = objective.coordinates.transformed(_finite(samples[first]))
        difference = (predicted - states).clip(-_FARTHEST * spread, _FARTHEST * spread) / spread
        errors.append(float(np.sqrt(np.mean(difference**2))))
    return float(np.median(errors))


def _finite(outputs: Array) -> Array:
    """Return outputs with large numbers for what escapes to infinity: these can be compared and scaled."""
    return np.clip(np.nan_to_num(outputs, nan=_FARTHEST), -_FARTHEST, _FARTHEST)
