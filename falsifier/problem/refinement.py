"""From coarse to fine inputs: what a search may try in turn if few control points bound it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import floor

from falsifier.core.space import Freedom, InputRange, SearchSpace
from falsifier.errors import SpecError
from falsifier.problem.grid import default_freedom
from falsifier.problem.problem import Problem
from falsifier.problem.sections import FreeSection, InputSection, ModelChanges

# The middle level has this many times the pieces of an input's own control points; each level after it that
# an engine on fixed control points searches has as many times more again.
_FINER = 2


def limits_of(problems: Sequence[Problem]) -> FreeSection:
    """Return the default limits of a free parameterization for requirements of one system."""
    experiment = problems[0].experiment
    formulas = [str(problem.requirement.formula) for problem in problems]
    return default_freedom(formulas, stop_time=experiment.stop_time, step=experiment.output_interval)


def coarse_inputs(space: SearchSpace, limits: FreeSection) -> list[InputRange]:
    """Return the inputs with fixed control points, and fewer of them than the limits allow."""
    return [r for r in space.inputs if r.free is None and r.control_points < limits.max_control_points]


def widened(problems: Sequence[Problem]) -> list[Problem]:
    """Let engines choose the control points of coarse inputs too, within the default limits.

    Args:
        problems: they differ only in their requirement.

    Raises:
        SpecError: if only the spec's own control points are allowed.
    """
    for problem in problems:
        if problem.source is not None and problem.source.parameterization == "fixed":
            raise SpecError(
                f"{problem.name}: a fixed parameterization allows only the spec's own control points, so "
                "there is nothing to refine: drop --parameterization fixed or --refine (refine=True)"
            )
    limits = limits_of(problems)
    coarse = {r.name for r in coarse_inputs(problems[0].space, limits)}
    return [_freed(problem, coarse, limits) for problem in problems] if coarse else list(problems)


def without_limits(changes: ModelChanges) -> ModelChanges:
    """Return the changes that a user stated, without the limits that ``widened`` added."""
    stated = {name: s for name, s in changes.inputs.items() if s.model_fields_set != {"free"}}
    return changes.model_copy(update={"inputs": stated})


def level_spaces(space: SearchSpace, *, free: bool) -> tuple[SearchSpace, ...]:
    """Return what to search in turn: the own control points, twice as many pieces, then the whole space.

    Each contains the ones before it if the engine chooses control points itself. For other engines they are
    evenly spaced, held between them and doubled again in place of the whole space.

    Args:
        space: the whole search space; inputs without free control points are the same on all levels.
        free: whether the engine chooses control points itself.
    """
    if free:
        finer = [_each(space, partial(_limited, stop_time=space.stop_time)), space]
    else:
        times = (_FINER, _FINER**2)
        finer = [_each(space, partial(_held, stop_time=space.stop_time, finer=n)) for n in times]
    return tuple(dict.fromkeys((space.fixed, *finer)))


def _freed(problem: Problem, names: set[str], limits: FreeSection) -> Problem:
    """Return the problem with the limits, also among its source's changes, so that it can be loaded again."""
    freedom = Freedom(limits.max_control_points, limits.min_interval)
    space = _each(problem.space, lambda r: replace(r, free=freedom) if r.name in names else r)
    source = problem.source
    if source is not None:
        stated = source.changes.inputs
        freed = {n: stated.get(n, InputSection()).model_copy(update={"free": limits}) for n in sorted(names)}
        changes = source.changes.model_copy(update={"inputs": {**stated, **freed}})
        source = source.model_copy(update={"changes": changes})
    return replace(problem, space=space, source=source)


def _each(space: SearchSpace, change: Callable[[InputRange], InputRange]) -> SearchSpace:
    return replace(space, inputs=tuple(map(change, space.inputs)))


def _pieces(r: InputRange) -> int:
    """Return the number of pieces between an input's own control points; one for a constant."""
    return max(1, r.control_points - (r.interpolation != "constant"))


def _limited(r: InputRange, stop_time: float) -> InputRange:
    """Return the input with free control points, no more and no closer than twice its own."""
    pieces = _FINER * _pieces(r)
    if r.free is None or pieces >= r.free.max_control_points or stop_time / pieces <= r.free.min_interval:
        return r
    return replace(r, free=Freedom(pieces + 1, stop_time / pieces))


def _held(r: InputRange, stop_time: float, finer: int) -> InputRange:
    """Return the input with that many times its own pieces, held, as far as its limits allow."""
    if r.free is None:
        return r
    most = min(r.free.max_control_points, floor(stop_time / r.free.min_interval * (1 + 1e-9)))
    pieces = max(_pieces(r), min(finer * _pieces(r), most))
    return replace(r, control_points=pieces, interpolation="constant", free=None)
