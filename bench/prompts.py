"""Tokens of prompts by variant, system and number of samples, and the reconstruction error of courses.

    python -m bench.prompts > bench/prompts.md

Samples alternate between the surrogate engine and uniform random search, seed 1. Tokens are counted with the
vocabulary cl100k_base. A course is judged by its band: the smallest and largest value within a fiftieth of
the simulated time around each moment, so that an oscillation need not be redrawn swing by swing. Its error is
the root mean square difference between the bands of the signal and of the redrawn course, as a share of the
span.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from falsifier.core.trajectory import is_discrete
from falsifier.engines import make_engine
from falsifier.engines.preview import preview
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.prompts import VARIANTS, View
from falsifier.llm.prompts.courses import column_decimals
from falsifier.llm.prompts.numbers import plain
from falsifier.llm.prompts.observations import course_line, drawn_course
from falsifier.llm.prompts.shapes import Course, Points
from falsifier.llm.usage import count_tokens
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

SYSTEMS = ("AT1", "CC4", "CCx", "NN", "F16", "SC")
SAMPLES = (0, 1, 5, 20)
# MP5 with the same samples before courses were told by breakpoints (21 values on a grid and 20 to 40 around
# the critical time for up to 16 signals of each sample), counted with the same vocabulary.
BEFORE = {
    "AT1": (815, 1285, 3877, 8534),
    "CC4": (1036, 2929, 10385, 25029),
    "CCx": (1159, 1644, 13260, 35776),
    "NN": (870, 2757, 9506, 24698),
    "F16": (671, 2233, 8295, 20861),
    "SC": (841, 1662, 5087, 12390),
}
Array = NDArray[np.float64]


def samples(problem: Problem, count: int) -> list[Evaluation]:
    """The first samples of a search."""
    uniform, surrogate = (make_engine(name, problem, seed=1) for name in ("uniform", "surrogate"))
    found: list[Evaluation] = []
    for i in range(count):
        (candidate,) = (uniform if i % 2 else surrogate).ask(1)
        found.append(evaluate(problem, candidate))
        surrogate.tell(found[-1:])
    return found


def tokens(problem: Problem, evaluations: Sequence[Evaluation], variant: str) -> list[int]:
    """Tokens of the prompts after each number of samples."""
    return [
        sum(count_tokens(m.content) for m in preview(problem, variant=variant, evaluations=evaluations[:n]))
        for n in SAMPLES
    ]


def on_grid(times: Array, column: Array) -> tuple[Array, int]:
    """A course as it was told before: 21 values, redrawn by straight lines; and its tokens."""
    grid = np.linspace(0.0, times[-1], 21)
    values = column[np.searchsorted(times, grid).clip(max=len(times) - 1)]
    text = ", ".join(plain(float(v), column_decimals(column)) for v in values)
    return np.interp(times, grid, values), count_tokens(text)


def redrawn(times: Array, drawn: Course) -> tuple[Array, Array]:
    """Lower and upper side of a course; the same where it is a line."""
    low, high = np.full_like(times, np.nan), np.full_like(times, np.nan)
    for points in drawn.lines:
        _fill(times, points, low, high)
    for swing in drawn.swings:
        inside = (times >= swing.start) & (times <= swing.end)
        for side, points in ((low, swing.lower), (high, swing.upper)):
            side[inside] = np.interp(times[inside], *np.array(points).T)
    known = ~np.isnan(low)
    return np.interp(times, times[known], low[known]), np.interp(times, times[known], high[known])


def _fill(times: Array, points: Points, low: Array, high: Array) -> None:
    inside = (times >= points[0][0]) & (times <= points[-1][0])
    low[inside] = high[inside] = np.interp(times[inside], *np.array(points).T)


def error(times: Array, column: Array, low: Array, high: Array) -> float:
    """Root mean square difference of the bands, as a share of the span."""
    width = max(3, len(times) // 50)
    sides = (minimum_filter1d(column, width) - minimum_filter1d(low, width)) ** 2
    sides += (maximum_filter1d(column, width) - maximum_filter1d(high, width)) ** 2
    return float(np.sqrt(np.mean(sides) / 2) / np.ptp(column))


def courses(problem: Problem, evaluations: Sequence[Evaluation]) -> tuple[float, float, float, float]:
    """Mean tokens and error of all real signals of all samples: on the grid, and as they are told."""
    view = View.of(problem)
    rows = []
    for evaluation in evaluations:
        trajectory = evaluation.trajectory
        for name in problem.experiment.outputs if trajectory is not None else ():
            assert trajectory is not None
            times, column = trajectory.times, trajectory[name]
            if is_discrete(column, kind=view.kind(name)) or np.ptp(column) == 0:
                continue
            line, cost = on_grid(times, column)
            drawn = drawn_course(view, name, column, times)
            rows.append(
                (
                    cost,
                    error(times, column, line, line),
                    count_tokens(course_line(view, drawn, column)),
                    error(times, column, *redrawn(times, drawn)),
                )
            )
    return tuple(np.mean(rows, axis=0))


def main() -> None:
    """Print the tables."""
    print("# Prompts\n\nMade by `python -m bench.prompts`; how, is said there.\n")
    print("## Tokens by number of samples\n")
    heads = " | ".join(str(n) for n in SAMPLES)
    print(
        f"| system | variant | {heads} | the same in every question |\n|---|---|{'---|' * (len(SAMPLES) + 1)}"
    )
    found = []
    for name in SYSTEMS:
        problem = load_problem(name)
        evaluations = samples(problem, max(SAMPLES))
        for variant in VARIANTS:
            counts = tokens(problem, evaluations, variant)
            standing = count_tokens(preview(problem, variant=variant)[0].content)
            print(f"| {name} | {variant} | {' | '.join(map(str, counts))} | {standing} |")
        print(f"| {name} | MP5 before | {' | '.join(map(str, BEFORE[name]))} | |", flush=True)
        found.append((name, courses(problem, evaluations)))
        problem.model.close()
    print("\n## Courses of single signals, mean over all real signals of 20 samples\n")
    print("| system | tokens, 21 values | error | tokens, as told | error |\n|---|---|---|---|---|")
    for name, (cost, wrong, new_cost, new_wrong) in found:
        print(f"| {name} | {cost:.0f} | {100 * wrong:.1f} % | {new_cost:.0f} | {100 * new_wrong:.1f} % |")


if __name__ == "__main__":
    main()
