"""What the plots of reports show, as numbers for plots.js, which has Bokeh's script draw them.

They hold no text from outside: names and formulas stand in the page around them.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.analysis import Run
from falsifier.campaigns.analysis.curves import falsification_curve, improvements, thinned
from falsifier.views.plotting.panels import Bound, Panel

Array = NDArray[np.float64]
Values = Mapping[str, object]

# Number of colours of methods.
COLOURS = 6

# A page draws about so many columns, each by the extremes within it, divided among its curves.
_PAGE_COLUMNS = 20_000
_FEWEST_COLUMNS, _MOST_COLUMNS = 100, 1000
# Maximum number of simulations drawn per run.
_DRAWN_SIMULATIONS = 1000
_DIGITS = 7


@dataclass(frozen=True, slots=True)
class Plots:
    """Plots above each other that share their horizontal axis.

    Attributes:
        start: left end of the axis.
        end: right end of the axis.
        axis: what is on the axis: "time", "simulation" or "simulations".
        plots: what each plot shows.
        mark: time in s to look at.
    """

    start: float
    end: float
    axis: str
    plots: Sequence[Values]
    mark: float | None = None

    def json(self) -> str:
        """Return what plots.js reads; it may stand in an HTML script element."""
        text = json.dumps(
            {
                "start": self.start,
                "end": self.end if self.end > self.start else self.start + 1.0,
                "axis": self.axis,
                "mark": self.mark,
                "plots": self.plots,
            },
            separators=(",", ":"),
            allow_nan=False,
        )
        return text.replace("<", "\\u003c")


def scripts() -> list[str]:
    """Return Bokeh's scripts and the one that draws with them; the package itself is not imported."""
    bokeh = find_spec("bokeh")
    assert bokeh is not None and bokeh.origin is not None, "a dependency of falsifier"
    folder = Path(bokeh.origin).parent / "server" / "static" / "js"
    ours = files("falsifier.views.report").joinpath("plots.js")
    return [
        *((folder / name).read_text(encoding="utf-8") for name in ("bokeh.min.js", "bokeh-api.min.js")),
        ours.read_text(encoding="utf-8"),
    ]


def columns(curves: int) -> int:
    """Return how finely each of so many curves is drawn, so that the page stays light."""
    return int(np.clip(_PAGE_COLUMNS // max(curves, 1), _FEWEST_COLUMNS, _MOST_COLUMNS))


def history_plot(runs: Sequence[Run]) -> Plots | None:
    """Plot robustness over simulations for the runs of one method, with each run's smallest so far.

    Returns:
        None if every simulation failed.
    """
    valid = [run for run in runs if not np.isnan(run.robustness).all()]
    if not valid:
        return None
    low = min(float(np.nanmin(run.robustness)) for run in valid)
    high = max(float(np.nanmax(run.robustness)) for run in valid)
    dots = [
        _curve(*thinned(run.robustness, _DRAWN_SIMULATIONS), "dots", read="robustness", seed=run.seed)
        for run in valid
    ]
    found = [
        _curve([at + 1], [run.robustness[at]], "critical", read="robustness", seed=run.seed)
        for run in valid
        if (at := run.counterexample) is not None
    ]
    plot = {
        "range": _padded([low, high, 0.0]),
        "levels": [{"y": 0.0, "style": "zero"}],
        "lines": [_curve(*_stairs(run.robustness), "best") for run in valid],
        "dots": dots + found,
    }
    return Plots(0.5, max(len(run.robustness) for run in valid) + 0.5, "simulation", [plot])


def rate_plot(by_method: dict[str, list[Run]]) -> Plots:
    """Plot the share of falsified runs over simulations, one curve per method."""
    curves = [falsification_curve(runs) for runs in by_method.values()]
    longest = max((float(x[-1]) for x, _ in curves), default=1.0)
    lines = [
        _curve(np.append(x, longest), np.append(y, y[-1]), f"s{i % COLOURS}", steps=True, read="share")
        for i, (x, y) in enumerate(curves)
    ]
    return Plots(0.0, max(longest, 1.0), "simulations", [{"range": [-0.03, 1.03], "lines": lines}])


def simulation_plots(drawn: Sequence[Panel], mark: float | None, columns: int) -> Plots | None:
    """Plot one simulation's quantities over time: bounds, windows, control points, what broke or decided.

    Args:
        drawn: the quantities.
        mark: time in s to look at.
        columns: how finely; each column of a long trajectory is drawn by its extremes.

    Returns:
        None without quantities.
    """
    if not drawn:
        return None
    times = drawn[0].times
    plots = [_panel(panel, columns) for panel in drawn]
    return Plots(float(times[0]), float(times[-1]), "time", plots, mark)


def _panel(panel: Panel, columns: int) -> Values:
    levels = [panel.values.min(), panel.values.max(), *(panel.limits or ()), *(v for _, v in panel.points)]
    levels += [extreme(bound.values) for bound in panel.bounds for extreme in (np.min, np.max)]
    style = "output" if panel.limits is None else "input"
    outline = _outline(panel.times, panel.values, columns)
    dots = (
        [_curve([t for t, _ in panel.points], [v for _, v in panel.points], "point")] if panel.points else []
    )
    for time, style_ in ((panel.critical, "critical"), (panel.decided, "decided")):
        if time is not None:
            k = int(np.abs(panel.times - time).argmin())
            dots.append(_curve([panel.times[k]], [panel.values[k]], style_))
    return {
        "range": _padded(map(float, levels)),
        "windows": [[bound.start, bound.end] for bound in panel.bounds],
        "broken": panel.broken,
        "levels": [{"y": limit, "style": "limit"} for limit in panel.limits or ()],
        "lines": [
            *(_bound(panel, bound, columns) for bound in panel.bounds),
            _curve(*outline, style, steps=panel.steps, read="value"),
        ],
        "dots": dots,
    }


def _bound(panel: Panel, bound: Bound, columns: int) -> Values:
    within = (panel.times >= bound.start) & (panel.times <= bound.end)
    return _curve(*_outline(panel.times[within], bound.values[within], columns), "bound")


def _curve(x: Iterable[float], y: Iterable[float], style: str, **more: object) -> Values:
    return {"x": _rounded(x), "y": _rounded(y), "style": style, **more}


def _rounded(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.{_DIGITS}g}") for value in values]


def _padded(values: Iterable[float]) -> tuple[float, float]:
    kept = list(values)
    low, high = min(kept), max(kept)
    margin = 0.06 * (high - low) or max(abs(high), 1.0) * 0.1
    return low - margin, high + margin


def _stairs(robustness: Array) -> tuple[Array, Array]:
    """The smallest robustness so far, as a line."""
    at, best = improvements(robustness)
    return np.repeat(np.append(at, len(robustness)), 2)[1:-1], np.repeat(best, 2)


def _outline(times: Array, values: Array, columns: int) -> tuple[Array, Array]:
    """Short trajectories unchanged; of long ones the extremes in each column, in order of time."""
    if len(times) <= 2 * columns:
        return times, values
    kept = {0, len(times) - 1}
    if np.ptp(values):
        for column in np.array_split(np.arange(len(times)), columns):
            kept |= {int(column[values[column].argmin()]), int(column[values[column].argmax()])}
    at = np.array(sorted(kept))
    return times[at], values[at]
