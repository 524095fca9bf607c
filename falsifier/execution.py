"""Where evaluations happen: here, or on any ``concurrent.futures`` executor."""

from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor
from contextlib import contextmanager

from falsifier.errors import SpecError
from falsifier.evaluation import Evaluation, evaluate
from falsifier.problem import Problem
from falsifier.space import Candidate


@contextmanager
def local_executor(jobs: int) -> Iterator[Executor | None]:
    """Executor with this many processes on this machine; None for one job, which runs in this process.

    Raises:
        SpecError: when jobs is not positive.
    """
    if jobs < 1:
        raise SpecError(f"jobs must be 1 or more, got {jobs}")
    if jobs == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as executor:
        yield executor


def evaluate_all(
    problem: Problem, candidates: Sequence[Candidate], executor: Executor | None
) -> Iterator[Evaluation]:
    """Evaluations in the order of the candidates, each as soon as it and those before it are there.

    A worker process that dies is an evaluation with the status ``crashed``.
    """
    if executor is None:
        yield from (evaluate(problem, candidate) for candidate in candidates)
        return
    futures = [executor.submit(evaluate, problem, candidate) for candidate in candidates]
    for candidate, future in zip(candidates, futures, strict=True):
        try:
            yield future.result()
        except BrokenExecutor as error:
            yield Evaluation(candidate, "crashed", reason=f"the worker process died: {error}")
