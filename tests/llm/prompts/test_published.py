from dataclasses import replace

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import lag_problem
from tests.llm.prompts.support import told


def test_published_variants_tell_the_ten_most_recent_in_order() -> None:
    problem = lag_problem()
    evaluations = [evaluate(problem, problem.space.decode([0.05 * i] * 4)) for i in range(14)]
    evaluations[12] = replace(evaluations[12], verdict=None, status="failed", reason="diverged")
    _, changing = told(problem, "MP4", evaluations)
    numbers = [line.split()[1] for line in changing.splitlines() if line.startswith("Sample ")]
    assert numbers == [f"{i}:" for i in (4, 5, 6, 7, 8, 9, 10, 11, 12, 14)]
    assert "10 of 13" in changing
    assert "diverged" not in changing


def test_free_samples_are_told_at_the_fixed_times_by_published_variants() -> None:
    problem = lag_problem(free=Freedom(50, 0.1))
    candidate = problem.space.admit(Candidate({"u": Signal((0.0, 5.0), (0.25, -0.75), "constant")}))
    _, changing = told(problem, "MP4", [evaluate(problem, candidate)])
    assert "u = [0.25, 0.25, -0.75, -0.75]" in changing
