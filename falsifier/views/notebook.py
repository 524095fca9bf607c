"""How problems, results and what they consist of look in notebooks.

The values do not depend on this module: their formatters are registered with IPython by type name. The markup
consists of plain tables and PNG images, so that code hosts display it too::

    result = falsify("AT1", listeners=[progress()])
    result
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from falsifier.analyses.assess import Assurance
from falsifier.analyses.coverage import Coverage
from falsifier.analyses.margin import Margin
from falsifier.core.candidate import Candidate
from falsifier.core.model import ModelInfo
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import candidate_facts, counted, ends, readable
from falsifier.counterexamples.explain import Explanation
from falsifier.counterexamples.robustness_map import RobustnessMap
from falsifier.counterexamples.shrink import Shrunk
from falsifier.evaluation.confirm import Confirmation
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.result import Result
from falsifier.stl import Verdict, in_words
from falsifier.views.analyses_text import coverage_text
from falsifier.views.exchanges import exchanges_html
from falsifier.views.html import el, join, picture, table
from falsifier.views.model_text import info_text
from falsifier.views.plotting import plot_evaluation, plot_trajectory, png
from falsifier.views.text import Fact, broken_facts, margin_facts, result_facts, seconds_text

# Images are stored in the notebook file; at this resolution about 20 kB each.
_DPI = 80
# Maximum number of signals in a trajectory's figure; the table lists all.
_DRAWN_SIGNALS = 6
# Maximum number of questions to a language model that a result shows; each adds its prompt to the notebook.
_SHOWN_QUESTIONS = 5


def register() -> None:
    """Let IPython show these values; outside it do nothing."""
    from IPython.core import getipython

    shell: Any = getipython.get_ipython()
    if shell is None or shell.display_formatter is None:
        return
    formatter = shell.display_formatter.formatters["text/html"]
    for shown, html in _FORMATTERS.items():
        formatter.for_type_by_name(shown.__module__, shown.__name__, html)
    pictures = shell.display_formatter.formatters["image/png"]
    if "matplotlib.figure.Figure" not in pictures:  # neither pyplot nor %matplotlib draws them
        pictures.for_type_by_name("matplotlib.figure", "Figure", partial(png, dpi=_DPI))


def problem_html(problem: Problem) -> str:
    """The requirement as a formula and in words, the model, and the search space."""
    requirement, experiment = problem.requirement, problem.experiment
    facts: list[Fact] = [
        ("requirement", el("code", str(requirement.formula))),
        ("in words", requirement.description or in_words(requirement.formula)),
        ("model", ": ".join(part for part in (problem.info.name, problem.info.description) if part)),
        ("simulated", f"for {experiment.stop_time:.10g} s, recorded every {experiment.output_interval:g} s"),
        *((f"fixed {name}", readable(value)) for name, value in problem.parameters.items()),
    ]
    header = ("searched", "unit", "range", "control points", "description")
    bounds = {r.name: f"{' to '.join(ends(r.low, r.high))}{r.manner}" for r in problem.space.ranges}
    points = {r.name: f"{r.control_points}, {r.interpolation}" for r in problem.space.inputs}
    rows = [
        (r.name, r.unit, bounds[r.name], points.get(r.name, "one value"), r.description)
        for r in problem.space.ranges
    ]
    return join(el("b", problem.name), table((), facts), table(header, rows))


def evaluation_html(evaluation: Evaluation) -> str:
    """What broke, the candidate, and what decided; without a verdict, the reason."""
    verdict, candidate = evaluation.verdict, evaluation.candidate
    units = evaluation.trajectory.units if evaluation.trajectory else {}
    failed = [("status", f"{evaluation.status}: {evaluation.reason}")] if verdict is None else []
    origin = ": ".join(part for part in (candidate.origin, candidate.rationale) if part)
    facts = [*failed, *broken_facts(verdict), *candidate_facts(candidate), *margin_facts(verdict, units, {})]
    return table((), [*facts, *([("proposed by", origin)] if origin else [])])


def trajectory_html(trajectory: Trajectory) -> str:
    """Range of each signal, and a figure of the first few."""
    header = ("signal", "unit", "first", "smallest", "largest", "last")
    rows = [
        (name, trajectory.units.get(name, ""), *(readable(v, 5) for v in (c[0], c.min(), c.max(), c[-1])))
        for name, c in trajectory.columns.items()
    ]
    end = trajectory.times[-1]
    about = f"{counted(len(trajectory), 'sample')} from 0 to {end:.10g} s, every {trajectory.step:g} s"
    parts = [el("p", about), table(header, rows)]
    if trajectory.names:
        drawn = plot_trajectory(trajectory, trajectory.names[:_DRAWN_SIGNALS])
        parts.append(picture(png(drawn, dpi=_DPI), "png", "signals over time"))
    return join(*parts)


def result_html(result: Result) -> str:
    """How the run ended, as on a terminal, with a figure of the counterexample or of the best evaluation."""
    found, spent, shown = result.counterexample, result.spent, result.shown
    title = f"{result.problem.name}: {result.status} after {spent.simulations_text}"
    parts = [el("b", title), table((), [*result_facts(result), ("time", seconds_text(spent))])]
    if shown is not None and shown.trajectory is not None:
        drawn = png(plot_evaluation(result.problem, shown), dpi=_DPI)
        parts.insert(1, picture(drawn, "png", "counterexample" if found else "best evaluation"))
    if result.directory is not None and spent.questions:
        parts.append(exchanges_html(result.directory, result.problem.name, most=_SHOWN_QUESTIONS))
    return join(*parts)


_FORMATTERS: Mapping[type, Callable[[Any], str]] = {
    Problem: problem_html,
    Verdict: lambda verdict: table((), [*broken_facts(verdict), *margin_facts(verdict, {}, {})]),
    Evaluation: evaluation_html,
    Candidate: lambda candidate: table((), candidate_facts(candidate)),
    Confirmation: lambda c: join(el("p", f"{c.outcome}: {c.reason}"), evaluation_html(c.evaluation)),
    **dict.fromkeys((Explanation, Margin, RobustnessMap), lambda found: el("p", found.text)),
    Assurance: lambda found: el("pre", found.text),
    Coverage: lambda found: el("pre", coverage_text(found, "Coverage")),
    Shrunk: lambda shrunk: evaluation_html(shrunk.evaluation),
    ModelInfo: lambda info: el("pre", info_text(info)),
    Trajectory: trajectory_html,
    Result: result_html,
}
