"""Plots with their captions and their numbers as tables; the tables are all there is without scripts."""

from collections.abc import Iterable, Sequence

import numpy as np

from falsifier.campaigns.analysis import Run
from falsifier.core.words import counted
from falsifier.stl.margins import shown
from falsifier.views.html import Html, el, join
from falsifier.views.plotting.panels import Bound, Panel
from falsifier.views.report.plots import COLOURS, Plots, history_plot, rate_plot, simulation_plots

# Evenly spaced times of a simulation's table, beside the marked one.
_ROWS = 11


def history_figure(runs: Sequence[Run], label: str) -> Html:
    """Show robustness over simulations for the runs of one method."""
    plots = history_plot(runs)
    if plots is None:
        nothing = "Every simulation failed: there is no robustness to show."
        return join(el("h3", label), el("p", nothing, class_="note"))
    caption = join(
        "Robustness: ",
        _key("dots", "of each simulation"),
        _key("best", "smallest so far"),
        _key("critical", "confirmed violation"),
    )
    rows = [
        (
            f"{run.seed}",
            f"{run.simulations}",
            "–" if np.isnan(run.robustness).all() else f"{shown(np.nanmin(run.robustness)):.6g}",
            "–" if run.counterexample is None else f"{run.counterexample + 1}",
        )
        for run in runs
    ]
    table = _table(("seed", "simulations", "smallest robustness", "violated in simulation"), rows)
    place = _place(f"Robustness over simulations, {label}")
    return join(el("h3", label), _group(plots, [el("figure", el("figcaption", caption), place)], table))


def rate_figure(by_method: dict[str, list[Run]]) -> Html:
    """Show the share of falsified runs over simulations, one curve per method."""
    keys = [
        _key(f"s{i % COLOURS}", f"{label} ({counted(len(runs), 'run')})")
        for i, (label, runs) in enumerate(by_method.items())
    ]
    rows = [
        (
            label,
            f"{sum(run.falsified for run in runs)} of {sum(run.finished for run in runs)}",
            ", ".join(map(str, sorted(run.simulations for run in runs if run.falsified))) or "–",
        )
        for label, runs in by_method.items()
    ]
    table = _table(("method", "falsified", "after simulations"), rows)
    figure = el(
        "figure", el("figcaption", *keys), _place("Share of falsified runs over simulations", "plot rate")
    )
    return join(el("h3", "Falsified runs"), _group(rate_plot(by_method), [figure], table))


def simulation_figures(drawn: Sequence[Panel], mark: float | None, columns: int) -> Html:
    """Show one simulation's quantities over time, zoomed together.

    Args:
        drawn: the quantities; without any, nothing is shown.
        mark: time in s to look at.
        columns: how finely curves are drawn.
    """
    plots = simulation_plots(drawn, mark, columns)
    if plots is None:
        return Html("")
    figures = [
        el(
            "figure",
            el("figcaption", el("b", _headed(panel)), *map(_bound_key, panel.bounds)),
            _place(f"{panel.title} over time", "plot panel"),
        )
        for panel in drawn
    ]
    return _group(plots, figures, _values(drawn, mark))


def _headed(panel: Panel) -> str:
    return f"{panel.component}: {panel.title}" if panel.component else panel.title


def _values(drawn: Sequence[Panel], mark: float | None) -> Html:
    """The quantities at evenly spaced times and at the marked one."""
    times = drawn[0].times
    at = {int(k) for k in np.linspace(0, len(times) - 1, _ROWS)}
    marked = None if mark is None else int(np.abs(times - mark).argmin())
    if marked is not None:
        at.add(marked)
    rows = [
        (
            f"{times[k]:.6g}" + (" (marked)" if k == marked else ""),
            *(f"{panel.values[k]:.6g}" for panel in drawn),
        )
        for k in sorted(at)
    ]
    return _table(("time [s]", *(panel.title for panel in drawn)), rows)


def _group(plots: Plots, figures: Sequence[Html], table: Html) -> Html:
    return el(
        "div",
        *figures,
        el("details", el("summary", "Numbers"), table, class_="numbers", open=""),
        el("script", Html(plots.json()), type="application/json"),
        class_="plots",
    )


def _place(label: str, class_: str = "plot history") -> Html:
    return el("div", class_=class_, role="img", aria_label=label)


def _key(kind: str, text: str) -> Html:
    """A line of a legend."""
    return el("span", el("span", class_=f"chip {kind}"), text, class_="key")


def _bound_key(bound: Bound) -> Html:
    text = join(el("code", bound.predicate), f" from {bound.start:.6g} s to {bound.end:.6g} s")
    return _key("bound", text)


def _table(header: Iterable[str], rows: Iterable[Sequence[str]]) -> Html:
    head = el("tr", *(el("th", name, scope="col") for name in header))
    body = [el("tr", el("th", row[0], scope="row"), *(el("td", cell) for cell in row[1:])) for row in rows]
    table = el("table", el("thead", head), el("tbody", *body))
    return el("div", table, class_="scroll", tabindex="0", role="region", aria_label="Numbers")
