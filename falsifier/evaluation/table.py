"""Evaluations as a table: one row each, as plain columns or as a data frame of pandas."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from falsifier.core.signals import Signal
from falsifier.errors import SpecError
from falsifier.evaluation.evaluate import Evaluation

if TYPE_CHECKING:
    import pandas

Columns = dict[str, list[Any]]


def evaluation_columns(evaluations: Sequence[Evaluation]) -> Columns:
    """Return one row per evaluation, as columns of equal length.

    An input whose control points are always at the same times has one column of numbers per control point,
    named ``throttle @ 8.33 s``; a constant input and a parameter have one, named like them. An input whose
    control points move has one column of texts: ``pchip 0:0 8.33:100``, times in s before values.

    Args:
        evaluations: all evaluations of a run, in order.

    Returns:
        ``simulation`` (from 1), ``status``, ``robustness`` and ``critical_time`` in s (None without a
        verdict), ``reason`` why there is none, ``seconds`` in the simulator, ``origin`` of the candidate;
        then inputs and parameters.
    """
    columns: Columns = {
        "simulation": list(range(1, len(evaluations) + 1)),
        "status": [e.status for e in evaluations],
        "robustness": [e.robustness for e in evaluations],
        "critical_time": [e.verdict.critical_time if e.verdict else None for e in evaluations],
        "reason": [e.reason for e in evaluations],
        "seconds": [e.seconds for e in evaluations],
        "origin": [e.candidate.origin for e in evaluations],
    }
    for name in _names(e.candidate.signals for e in evaluations):
        columns |= _signal_columns(name, [e.candidate.signals.get(name) for e in evaluations])
    for name in _names(e.candidate.parameters for e in evaluations):
        columns[name] = [e.candidate.parameters.get(name) for e in evaluations]
    return columns


def frame(columns: Columns) -> "pandas.DataFrame":
    """Return columns as a data frame.

    Raises:
        SpecError: if pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise SpecError(
            "a data frame needs pandas: pip install 'falsifier[frames]'; columns() gives the same as lists"
        ) from None
    return pandas.DataFrame(columns)


def _names(mappings: Iterable[Mapping[str, object]]) -> list[str]:
    return list(dict.fromkeys(name for mapping in mappings for name in mapping))


def _signal_columns(name: str, signals: Sequence[Signal | None]) -> Columns:
    # Between control points, only one interpolation can be meant by numbers alone.
    shapes = {(s.times, s.interpolation if len(s.times) > 1 else "") for s in signals if s}
    if len(shapes) > 1:
        return {name: [None if signal is None else _text(signal) for signal in signals]}
    ((shared, _),) = shapes
    labels = [name] if len(shared) == 1 else [f"{name} @ {time:.6g} s" for time in shared]
    return {
        label: [None if signal is None else signal.values[i] for signal in signals]
        for i, label in enumerate(labels)
    }


def _text(signal: Signal) -> str:
    points = (f"{time:.6g}:{value:.6g}" for time, value in zip(signal.times, signal.values, strict=True))
    return f"{signal.interpolation} {' '.join(points)}"
