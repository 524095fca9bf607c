"""Which part of its inputs' ranges, and of the system's behaviour, a run has tried; read from its record.

Ranges are divided into parts. A part counts as tried if a simulation with a verdict had a value in it at any
time. Trajectories are read one by one: a long run's would not fit in memory together.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, pairwise
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.ranges import Range, number_names
from falsifier.core.signals import Signal
from falsifier.core.trajectory import Trajectory
from falsifier.errors import SpecError
from falsifier.evaluation.levels import Climb
from falsifier.record import manifest
from falsifier.record.files import recorded_trajectory
from falsifier.record.journal import read_journal, recorded_candidates
from falsifier.record.manifest import Manifest
from falsifier.record.records import EvaluatedRecord
from falsifier.search.findings import Failure, failures as by_cause
from falsifier.stl import parse

# Parts of a range: enough to see gaps, few enough that a hundred simulations can try most pairs of them.
PARTS = 10
# How fast an input changed, slowest first; see pace_of.
PACES = ("constant", "slow", "medium", "fast", "steps")
# An input is slow if its range takes at least this share of the simulated time, and fast if at most that.
SLOW, FAST = 1 / 2, 1 / 20
# Points of a cubic piece at which its slope is calculated.
_PER_PIECE = np.linspace(0.0, 1.0, 5)
# Times between two control points, so close that an interpolated input meets each part between them.
_STEPS = 2 * PARTS
# Slices of the simulated time in which the values of an input are counted.
SLICES = 40
# Samples of an input over the simulated time: several per slice.
_SAMPLES = 201

Array = NDArray[np.float64]
Counts = NDArray[np.intp]
# Small numbers: those of a whole run are in memory at the same time.
Cells = NDArray[np.uint16]
Tried = Iterable[tuple[Candidate, Trajectory | None]]


@dataclass(frozen=True, slots=True, eq=False)
class RangeCoverage:
    """What was tried of one input or parameter.

    Attributes:
        searched: its name, range, unit and kind.
        low: smallest value tried; None if nothing was.
        high: largest value tried.
        parts: number of simulations with a value in each part of the range, shape (p,).
        times: the same by slice of the simulated time, shape (SLICES, p); None for a parameter.
        paces: number of simulations by the input's fastest change, as PACES; empty for a parameter.
    """

    searched: Range
    low: float | None
    high: float | None
    parts: Counts
    times: Counts | None
    paces: Mapping[str, int]

    @property
    def tried(self) -> int:
        """Number of parts of the range that were tried."""
        return int((self.parts > 0).sum())

    @property
    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Ranges of values that were not tried."""
        edges = edges_of(self.searched)
        missing = np.flatnonzero(self.parts == 0)
        groups = np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1) if missing.size else []
        return tuple((edges[group[0]][0], edges[group[-1]][1]) for group in groups)


@dataclass(frozen=True, slots=True, eq=False)
class PairCoverage:
    """Which combinations of two inputs or parameters were tried at the same time.

    Attributes:
        first: name of one.
        second: name of the other.
        tried: whether each combination of parts was tried, shape (parts of first, parts of second).
    """

    first: str
    second: str
    tried: NDArray[np.bool_]

    @property
    def count(self) -> int:
        """Number of combinations that were tried."""
        return int(self.tried.sum())


@dataclass(frozen=True, slots=True, eq=False)
class OutputCoverage:
    """Which values an output reached.

    Attributes:
        name: its name.
        unit: its unit, empty if unknown.
        times: in s, shape (n,).
        lows: smallest value at each time, shape (n,).
        highs: largest value at each time, shape (n,).
    """

    name: str
    unit: str
    times: Array
    lows: Array
    highs: Array


@dataclass(frozen=True, slots=True)
class ModeCoverage:
    """Which values an integer, Boolean or enumeration had: their names, or the numbers as text.

    Attributes:
        name: its name.
        seen: the values that it had.
        never: values that are known to exist and that it did not have.
        changes: the changes that happened, as pairs of values.
    """

    name: str
    seen: tuple[str, ...]
    never: tuple[str, ...]
    changes: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Coverage:
    """What a run has tried, and what it has seen.

    Attributes:
        simulations: number of simulations with a verdict; others say nothing about the system.
        failures: why the others failed, by cause.
        trajectories: number of simulations whose trajectory was kept, from which outputs and modes are read.
        stop_time: end of each simulation in s.
        ranges: the inputs, then the parameters.
        pairs: all pairs of them, the least tried first.
        outputs: recorded real outputs.
        modes: recorded and searched integers, Booleans and enumerations.
        climbs: levels of robustness and what is missing for a lower one, by requirement, as far as known.
    """

    simulations: int
    failures: tuple[Failure, ...]
    trajectories: int
    stop_time: float
    ranges: tuple[RangeCoverage, ...]
    pairs: tuple[PairCoverage, ...]
    outputs: tuple[OutputCoverage, ...]
    modes: tuple[ModeCoverage, ...]
    climbs: Mapping[str, Climb] = field(default_factory=dict)


def coverage(directory: str | PathLike[str]) -> Coverage:
    """Say which part of the search space a recorded run has tried, and what the system did.

    Args:
        directory: run directory; the run may still be going on.

    Raises:
        JournalError: if it is no run directory, or its record is damaged.
        SpecError: if it is not a path.
    """
    if not isinstance(directory, str | PathLike):
        raise SpecError(
            f"coverage: expected a run directory, got {directory!r}; "
            "falsify(..., directory=...) records a run"
        )
    place = Path(directory)
    described, records = manifest.read(place), read_journal(place)
    candidates = recorded_candidates(records)
    ended = [r for r in records if isinstance(r, EvaluatedRecord)]
    counting = {m.name: number_names(m.kind, m.items) for m in described.modes if m.kind != "boolean"}
    climbs = {name: Climb(counting) for name in described.names}
    predicates = {r.name: parse(r.formula).predicates for r in described.requirements}

    def tried() -> Iterator[tuple[Candidate, Trajectory | None]]:
        for record in ended:
            if any(record.verdicts.values()):
                trajectory = recorded_trajectory(place, record.trajectory)
                for name, verdict in record.verdicts.items():
                    if verdict is not None:
                        climbs[name].add(record.index + 1, verdict, trajectory, predicates[name])
                yield candidates[record.index], trajectory

    reasons = ((r.index, r.reason) for r in ended if not any(r.verdicts.values()))
    return replace(coverage_of(described, tried(), failures=by_cause(reasons)), climbs=climbs)


def coverage_of(described: Manifest, tried: Tried, *, failures: tuple[Failure, ...] = ()) -> Coverage:
    """Return the coverage of candidates with a verdict, each with its trajectory if there is one."""
    candidates: list[Candidate] = []
    seen = _Seen(described)
    for candidate, trajectory in tried:
        candidates.append(candidate)
        seen.give(candidate)
        if trajectory is not None:
            seen.reach(trajectory)
    stop_time = described.stop_time
    times = np.linspace(0.0, stop_time, _SAMPLES)
    # Also when any input has a new value, which may be brief.
    begun = [np.unique(np.concatenate([times[:0], *map(_begun, c.signals.values())])) for c in candidates]
    most = max(map(len, begun), default=0)
    moments = [np.minimum(np.append(times, np.resize(b, most)), stop_time) for b in begun]
    ranges = []
    for r in described.inputs:
        signals = [c.signals[r.name].stepped(stop_time) for c in candidates]
        paces = Counter(pace_of(signal, r, stop_time) for signal in signals)
        values = [signal.sample(at) for signal, at in zip(signals, moments, strict=True)]
        ranges.append(_of_range(r, values, {p: paces[p] for p in PACES}))
    for p in described.parameters:
        ranges.append(_of_range(p, [[c.parameters[p.name]] for c in candidates], {}))
    pairs = []
    for (one, cells), (other, others) in combinations(ranges, 2):
        together = np.zeros((len(one.parts), len(other.parts)), np.bool_)
        together[cells, others] = True
        pairs.append(PairCoverage(one.searched.name, other.searched.name, together))
    return Coverage(
        simulations=len(candidates),
        failures=failures,
        trajectories=seen.trajectories,
        stop_time=stop_time,
        ranges=tuple(found for found, _ in ranges),
        pairs=tuple(sorted(pairs, key=lambda pair: pair.tried.mean())),
        outputs=tuple(seen.outputs.values()),
        modes=tuple(map(seen.mode, seen.labels)),
    )


def _begun(signal: Signal) -> Array:
    """Return times in s at which an input has new values, shape (n,): all parts that it passes are met.

    If it is sampled and held, it has them from the next sampling on.
    """
    numbers = points = np.arange(len(signal.times), dtype=np.float64)
    if signal.interpolation != "constant":
        points = np.arange(points[-1] * _STEPS + 1) / _STEPS
    return np.interp(points, numbers, signal.times) + 0.999999 * (signal.hold or 0.0)


def _of_range(r: Range, tried: Sequence[ArrayLike], paces: Mapping[str, int]) -> tuple[RangeCoverage, Cells]:
    """Return what was tried of an input or parameter, and the part of each value, shape (simulations, n).

    n is 1 for a parameter, which has no paces; an input has _SAMPLES even values, and more after them.
    """
    values = np.array(tried, np.float64) if tried else np.empty((0, _SAMPLES if paces else 1))
    cells, count = cells_of(r, values), len(edges_of(r))
    low, high = (float(values.min()), float(values.max())) if values.size else (None, None)
    times = None
    if paces:
        of_slice = np.arange(_SAMPLES) * SLICES // _SAMPLES
        even = cells[:, :_SAMPLES]
        times = np.stack([_had(even[:, of_slice == k], count) for k in range(SLICES)])
    return RangeCoverage(r, low, high, _had(cells, count), times, paces), cells


def _had(cells: Cells, count: int) -> Counts:
    """Return in how many simulations, the rows of cells, each of so many parts occurs."""
    return np.array([(cells == part).any(axis=1).sum() for part in range(count)], np.intp)


class _Seen:
    """What the system did, simulation by simulation: outputs, modes and their changes."""

    def __init__(self, described: Manifest) -> None:
        self.trajectories, self.stop_time = 0, described.stop_time
        self.outputs: dict[str, OutputCoverage] = {}
        self.inputs = {r.name for r in described.inputs}
        discrete = [r for r in (*described.inputs, *described.parameters) if r.kind != "real"]
        self.labels = {
            r.name: number_names(r.kind, r.items) or {n: str(n) for n in _allowed(r)} for r in discrete
        }
        self.labels |= {m.name: number_names(m.kind, m.items) for m in described.modes}
        self.values: dict[str, set[int]] = {name: set() for name in self.labels}
        self.changes: dict[str, set[tuple[int, int]]] = {name: set() for name in self.labels}

    def give(self, candidate: Candidate) -> None:
        """Add the modes that one simulation was given."""
        for name, signal in candidate.signals.items():
            self._add(name, signal.stepped(self.stop_time).values)
        for name, value in candidate.parameters.items():
            self._add(name, (value,))

    def reach(self, trajectory: Trajectory) -> None:
        """Add what one simulation reached."""
        self.trajectories += 1
        for name, values in trajectory.columns.items():
            if name in self.labels:
                self._add(name, values[np.flatnonzero(np.diff(values, prepend=np.nan))])
            elif name not in self.inputs:
                unit = trajectory.units.get(name, "")
                known = self.outputs.get(name) or OutputCoverage(name, unit, trajectory.times, values, values)
                lows, highs = np.minimum(known.lows, values), np.maximum(known.highs, values)
                self.outputs[name] = replace(known, lows=lows, highs=highs)

    def _add(self, name: str, values: Iterable[float]) -> None:
        if name in self.labels:
            numbers = [round(value) for value in values]
            self.values[name].update(numbers)
            self.changes[name].update((a, b) for a, b in pairwise(numbers) if a != b)

    def mode(self, name: str) -> ModeCoverage:
        """Return which values a mode had in all simulations."""
        labels, values = self.labels[name], self.values[name]

        def named(numbers: Iterable[int]) -> tuple[str, ...]:
            return tuple(labels.get(number, str(number)) for number in numbers)

        never = named(sorted(labels.keys() - values))
        return ModeCoverage(name, named(sorted(values)), never, tuple(map(named, sorted(self.changes[name]))))


def _allowed(r: Range) -> list[int]:
    """Return the numbers that an integer, Boolean or enumeration may have; empty if there are many."""
    return list(r.numbers) if r.items or r.high - r.low < PARTS else []


def edges_of(r: Range) -> list[tuple[float, float]]:
    """Return both ends of each part of a range; they are equal if a part is one whole number of a few."""
    if r.kind != "real" and (numbers := _allowed(r)):
        return [(float(n), float(n)) for n in numbers]
    if r.low == r.high:
        return [(r.low, r.high)]
    spaced = np.geomspace if r.scale == "log" else np.linspace
    return list(pairwise(spaced(r.low, r.high, PARTS + 1).tolist()))


def cells_of(r: Range, values: Array) -> Cells:
    """Return the part of the range in which each value is, in the shape of the values."""
    edges = np.array(edges_of(r))
    return np.searchsorted((edges[1:, 0] + edges[:-1, 1]) / 2, values, side="right").astype(np.uint16)


def pace_of(signal: Signal, r: Range, stop_time: float) -> str:
    """Return which of PACES an input had at its fastest.

    A signal that is sampled and held counts as what is sampled: its period is the model's, not the search's.
    """
    if signal.switches == 0:
        return "constant"
    if signal.interpolation == "constant":
        return "steps"
    pieces = signal.held(None).pieces(stop_time)[:-1]
    at = np.diff(signal.times)[:, np.newaxis] * _PER_PIECE
    slopes = pieces[:, 2:3] + 2 * pieces[:, 3:4] * at + 3 * pieces[:, 4:5] * at**2
    duration = (r.high - r.low) / float(np.abs(slopes).max(initial=0.0))
    if duration >= SLOW * stop_time:
        return "slow"
    return "fast" if duration <= FAST * stop_time else "medium"
