"""Prompts in words."""

from collections.abc import Sequence
from functools import cache

from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.prompts import View, build_prompt, render, variant_named
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

FIRST = (100, 100, 100, 0, 0, 0, 0, 0, 0, 0)


@cache
def transmission(name: str = "AT1") -> tuple[Problem, Evaluation]:
    problem = load_problem(name)
    return problem, evaluate(problem, problem.space.decode(FIRST))


def told(problem: Problem, variant: str, evaluations: Sequence[Evaluation] = ()) -> tuple[str, str]:
    prompt = build_prompt(View.of(problem), variant_named(variant), evaluations)
    standing, changing = render(prompt)
    assert (standing.role, changing.role) == ("system", "user")
    return standing.content, changing.content
