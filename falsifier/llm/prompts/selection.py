"""Which earlier samples a prompt shows: the most recent ones, plus the best and the most different."""

from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from falsifier.evaluation.evaluate import Evaluation
from falsifier.llm.prompts.view import View

RECENT = 10
_MARKS = ("best so far", "second best so far")
# Latest samples of which more than one line is told.
_PLAIN = 3
_DIFFERENT = 2
# Times at which input signals are compared; enough to notice a pulse of a twentieth of the stop time.
_COMPARED_POINTS = 41


# How much is told of a sample: everything, also around the critical time; what matters; one line.
Depth = Literal["close", "plain", "summary"]


def recent(evaluations: Sequence[Evaluation]) -> dict[int, str]:
    """Indices of the most recent samples with a verdict, in order, mapped to empty marks."""
    judged = [i for i, e in enumerate(evaluations) if e.verdict is not None]
    return dict.fromkeys(judged[-RECENT:], "")


def recent_best_and_different(view: View, evaluations: Sequence[Evaluation]) -> dict[int, str]:
    """Indices of the samples to show, in order, mapped to a mark that says why an old one is shown."""
    chosen = dict.fromkeys(range(max(0, len(evaluations) - RECENT), len(evaluations)), "")
    judged = [(e.robustness, i) for i, e in enumerate(evaluations) if e.robustness is not None]
    is_flat = len({value for value, _ in judged}) == 1
    for rank, (_, i) in enumerate(sorted(judged)[: 0 if is_flat and len(judged) > 1 else len(_MARKS)]):
        chosen[i] = _MARKS[rank]
    others = [i for _, i in judged if i not in chosen]
    points = {i: _features(view, evaluations[i]) for i in (*chosen, *others)} if others else {}
    for _ in range(min(_DIFFERENT, len(others))):
        farthest = max(
            others, key=lambda i: min(float(np.linalg.norm(points[i] - points[j])) for j in chosen)
        )
        chosen[farthest] = "shown because it differs most from the others"
        others.remove(farthest)
    return dict(sorted(chosen.items()))


def depths(chosen: Iterable[int], evaluations: Sequence[Evaluation]) -> dict[int, Depth]:
    """How much to tell of each chosen sample: most of the best and the latest one."""
    judged = [i for i in chosen if evaluations[i].robustness is not None]
    by_robustness = sorted(judged, key=lambda i: (evaluations[i].robustness, i))
    close = {*by_robustness[:1], *judged[-1:]}
    plain = {*by_robustness[1:2], *judged[-_PLAIN:]}
    return {i: "close" if i in close else "plain" if i in plain else "summary" for i in judged}


def weight(mark: str, depth: Depth) -> int:
    """How long a sample stays in a prompt that is too long: the best one longest, then the latest one."""
    if mark == _MARKS[0]:
        return 3
    return 2 if depth == "close" else 1 if mark else 0


def _features(view: View, evaluation: Evaluation) -> NDArray[np.float64]:
    """Inputs over time and parameters, each scaled to its range."""
    times = np.linspace(0.0, view.space.stop_time, _COMPARED_POINTS)
    candidate = evaluation.candidate
    signals = [
        (candidate.signals[r.name].sample(times) - r.low) / (r.high - r.low) / np.sqrt(_COMPARED_POINTS)
        for r in view.space.inputs
    ]
    parameters = [(candidate.parameters[p.name] - p.low) / (p.high - p.low) for p in view.space.parameters]
    return np.concatenate([*signals, np.array(parameters)])
