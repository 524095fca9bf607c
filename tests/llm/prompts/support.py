"""Prompts in words."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.prompts import Questions, View, variant_named
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

FIRST = (100, 100, 100, 0, 0, 0, 0, 0, 0, 0)


@cache
def transmission(name: str = "AT1") -> tuple[Problem, Evaluation]:
    problem = load_problem(name)
    return problem, evaluate(problem, problem.space.decode(FIRST))


def told(
    view: Problem | View,
    variant: str,
    evaluations: Sequence[Evaluation] = (),
    *,
    count: int = 1,
    start: Mapping[str, tuple[float, float]] | None = None,
    **more: Any,
) -> tuple[str, str]:
    """The constant part of the question after these samples, and the rest."""
    view = View.of(view) if isinstance(view, Problem) else view
    questions = Questions(view, variant_named(variant), start=start)
    for evaluation in evaluations:
        questions.tell(evaluation)
    standing, changing = questions.ask(count, **more)
    assert (standing.role, changing.role) == ("system", "user")
    return standing.content, changing.content
