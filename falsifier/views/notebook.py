"""How problems, trajectories, verdicts and results look in notebooks.

The values do not depend on this module: their formatters are registered with IPython by type name. The markup
consists of plain tables and PNG images, so that code hosts display it too::

    result = falsify("AT1", listeners=[progress()])
    result
"""

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from falsifier.core.candidate import Candidate
from falsifier.core.space import SearchSpace
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import choices, counted
from falsifier.evaluation.evaluate import Evaluation
from falsifier.problem.problem import Problem
from falsifier.search.result import Result
from falsifier.stl import in_words
from falsifier.stl.margins import signed
from falsifier.stl.monitor import Verdict
from falsifier.views.exchanges import exchanges_html
from falsifier.views.html import Html, el, join
from falsifier.views.text import seconds_text

# Images are stored in the notebook file; at this resolution about 20 kB each.
_DPI = 80
# Notebook front ends align table cells to the right by default.
_LEFT = "text-align: left"
# Maximum number of signals in a trajectory's figure; the table lists all.
_DRAWN_SIGNALS = 6
# Maximum number of questions to a language model that a result shows; each adds its prompt to the notebook.
_SHOWN_QUESTIONS = 5

Fact = tuple[str, str]


def register() -> None:
    """Let IPython show problems, verdicts, evaluations, trajectories and results; outside it do nothing."""
    from IPython.core import getipython

    shell: Any = getipython.get_ipython()
    if shell is None or shell.display_formatter is None:
        return
    formatter = shell.display_formatter.formatters["text/html"]
    for shown, html in _FORMATTERS.items():
        formatter.for_type_by_name(shown.__module__, shown.__name__, html)


def problem_html(problem: Problem) -> str:
    """The requirement as a formula and in words, the model, and the search space."""
    requirement, experiment = problem.requirement, problem.experiment
    facts: list[Fact] = [
        ("requirement", el("code", str(requirement.formula))),
        ("in words", requirement.description or in_words(requirement.formula)),
        ("model", ": ".join(part for part in (problem.info.name, problem.info.description) if part)),
        (
            "simulated",
            f"for {experiment.stop_time:g} s, recorded every {experiment.output_interval:g} s",
        ),
        *((f"fixed {name}", f"{value:g}") for name, value in problem.parameters.items()),
    ]
    return join(el("b", problem.name), _facts(facts), _space(problem.space))


def verdict_html(verdict: Verdict) -> str:
    """Robustness, and what decided it."""
    return _facts(_verdict_facts(verdict))


def evaluation_html(evaluation: Evaluation) -> str:
    """Verdict and candidate; without a verdict, the reason."""
    verdict = evaluation.verdict
    facts = [("status", f"{evaluation.status}: {evaluation.reason}")] if verdict is None else []
    facts += _verdict_facts(verdict) if verdict is not None else []
    return _facts([*facts, *_candidate_facts(evaluation.candidate)])


def trajectory_html(trajectory: Trajectory) -> str:
    """Range of each signal, and a figure of the first few."""
    from falsifier.views.plotting import plot_trajectory, png

    header = ("signal", "unit", "first", "smallest", "largest", "last")
    rows = [
        (name, trajectory.units.get(name, ""), *map(_number, (c[0], c.min(), c.max(), c[-1])))
        for name, c in trajectory.columns.items()
    ]
    end = trajectory.times[-1]
    about = f"{counted(len(trajectory), 'sample')} from 0 to {end:g} s, every {trajectory.step:g} s"
    parts = [el("p", about), _table(header, rows)]
    if trajectory.names:
        drawn = plot_trajectory(trajectory, trajectory.names[:_DRAWN_SIGNALS])
        parts.append(_picture(png(drawn, dpi=_DPI), "signals over time"))
    return join(*parts)


def result_html(result: Result) -> str:
    """How the run ended, with a figure of the counterexample or of the best evaluation."""
    from falsifier.views.plotting import plot_evaluation, png

    found, spent = result.counterexample, result.spent
    shown = found.evaluation if found else result.best
    title = f"{result.problem.name}: {result.status} after {spent.simulations_text}"
    facts: list[Fact] = [("confirmed" if found else "reason", found.reason if found else result.reason)]
    if shown is not None:
        facts += _verdict_facts(shown.verdict) if shown.verdict else []
        facts += _candidate_facts(shown.candidate)
    facts += [("failed", failure.text) for failure in result.failures]
    facts += [("fallback", remark) for remark in result.remarks]
    facts.append(("time", seconds_text(spent)))
    parts = [el("b", title), _facts(facts)]
    if shown is not None and shown.trajectory is not None:
        drawn = plot_evaluation(result.problem, shown)
        parts.append(_picture(png(drawn, dpi=_DPI), "counterexample" if found else "best evaluation"))
    if result.directory is not None and spent.calls:
        parts.append(exchanges_html(result.directory, result.problem.name, most=_SHOWN_QUESTIONS))
    return join(*parts)


_FORMATTERS: Mapping[type, Callable[[Any], str]] = {
    Problem: problem_html,
    Verdict: verdict_html,
    Evaluation: evaluation_html,
    Trajectory: trajectory_html,
    Result: result_html,
}


def _verdict_facts(verdict: Verdict) -> list[Fact]:
    sign = "violated" if verdict.violated else "satisfied"
    values = ", ".join(f"{name} = {value:g}" for name, value in verdict.values.items())
    return [
        *([("what broke", verdict.breach.text)] if verdict.breach else []),
        ("robustness", f"{signed(verdict.robustness)} ({sign})"),
        ("critical time", f"{verdict.critical_time:g} s"),
        ("decided by", el("code", verdict.predicate)),
        ("values then", values),
    ]


def _candidate_facts(candidate: Candidate) -> list[Fact]:
    facts = [(f"{c.role} {c.label}", c.text) for c in choices(candidate)]
    origin = ": ".join(part for part in (candidate.origin, candidate.rationale) if part)
    return [*facts, *([("proposed by", origin)] if origin else [])]


def _space(space: SearchSpace) -> Html:
    rows = [
        (r.name, r.unit, f"{r.low:g} to {r.high:g}", f"{r.control_points}, {r.interpolation}", r.description)
        for r in space.inputs
    ]
    rows += [
        (p.name, p.unit, f"{p.low:g} to {p.high:g}", "one value", p.description) for p in space.parameters
    ]
    return _table(("searched", "unit", "range", "control points", "description"), rows)


def _facts(facts: Iterable[Fact]) -> Html:
    rows = (el("tr", el("th", name, style=_LEFT), el("td", value, style=_LEFT)) for name, value in facts)
    return el("table", *rows)


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> Html:
    head = el("tr", *(el("th", name, style=_LEFT) for name in header))
    return el("table", head, *(el("tr", *(el("td", cell, style=_LEFT) for cell in row)) for row in rows))


def _picture(content: bytes, description: str) -> Html:
    """A PNG image embedded in the markup."""
    return Html(f'<img src="data:image/png;base64,{b64encode(content).decode()}" alt="{description}">')


def _number(value: float) -> str:
    return f"{value:.5g}"
