"""Charts in SVG; their colours come from the page's style sheet, which also covers dark mode and print."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor, log10

import numpy as np
from numpy.typing import NDArray

from falsifier.campaigns.analysis import Run
from falsifier.campaigns.analysis.curves import falsification_curve, improvements, thinned
from falsifier.views.html import Html, el, join
from falsifier.views.panels import Panel

Array = NDArray[np.float64]

_WIDTH, _LEFT, _RIGHT, _TOP, _BOTTOM = 760.0, 62.0, 14.0, 22.0, 30.0
_TICKS = 5
# Maximum number of values drawn per run, and of columns for a long trajectory, each drawn by its extremes.
_DRAWN_VALUES = 300
_DRAWN_COLUMNS = 240
SERIES_COLOURS = 6


@dataclass(frozen=True, slots=True)
class _Frame:
    """Maps data to chart coordinates: x in [left, right], y in [low, high]."""

    left: float
    right: float
    low: float
    high: float
    height: float

    def x(self, value: float) -> float:
        share = (value - self.left) / (self.right - self.left)
        return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        share = (value - self.low) / (self.high - self.low)
        return self.height - _BOTTOM - share * (self.height - _TOP - _BOTTOM)

    def path(self, xs: Sequence[float] | Array, ys: Sequence[float] | Array, *, steps: bool = False) -> str:
        """Path through the points; with steps, each value is held until the next point."""
        commands = []
        for i, (x, y) in enumerate(zip(xs, ys, strict=True)):
            px, py = self.x(float(x)), self.y(float(y))
            if i == 0:
                commands.append(f"M{px:.1f} {py:.1f}")
            elif steps:
                commands.append(f"H{px:.1f}V{py:.1f}")
            else:
                commands.append(f"L{px:.1f} {py:.1f}")
        return "".join(commands)

    def dots(self, xs: Array, ys: Array) -> str:
        """Path of dots: zero-length strokes, which are drawn with round ends."""
        return "".join(
            f"M{self.x(float(x)):.1f} {self.y(float(y)):.1f}h0" for x, y in zip(xs, ys, strict=True)
        )


def history_chart(runs: Sequence[Run], label: str) -> Html:
    """Draw robustness over simulations for the runs of one method, with each run's smallest so far."""
    valid = [run for run in runs if not np.isnan(run.robustness).all()]
    if not valid:
        return el("p", "Every simulation failed: there is no robustness to show.", class_="note")
    longest = max(len(run.robustness) for run in valid)
    lowest = min(float(np.nanmin(run.robustness)) for run in valid)
    highest = max(float(np.nanmax(run.robustness)) for run in valid)
    frame = _frame(0.5, longest + 0.5, [lowest, highest, 0.0], 240)
    parts = [_axes(frame, "simulation", "robustness", whole=True), _level(frame, 0.0, "zero")]
    for run in valid:
        parts.append(el("path", d=frame.dots(*thinned(run.robustness, _DRAWN_VALUES)), class_="dots"))
    for run in valid:
        at, best = improvements(run.robustness)
        last = float(len(run.robustness))
        parts.append(el("path", d=frame.path([*at, last], [*best, best[-1]], steps=True), class_="best"))
    for run in valid:
        if run.counterexample is not None:
            at_x, at_y = run.counterexample + 1, float(run.robustness[run.counterexample])
            title = el(
                "title", f"seed {run.seed}: counterexample at simulation {at_x}, robustness {at_y:.5g}"
            )
            parts.append(el("circle", title, cx=frame.x(at_x), cy=frame.y(at_y), r=4, class_="critical"))
    return _svg(frame.height, f"Robustness over simulations, {label}", parts)


def rate_chart(by_method: dict[str, list[Run]]) -> Html:
    """Draw the share of falsified runs over simulations, one curve per method."""
    curves = {label: falsification_curve(runs) for label, runs in by_method.items()}
    longest = max((float(x[-1]) for x, _ in curves.values()), default=1.0)
    frame = _Frame(0.0, max(longest, 1.0), 0.0, 1.0, 200.0)
    parts = [_axes(frame, "simulations", "falsified runs", whole=True)]
    for i, (x, y) in enumerate(curves.values()):
        d = frame.path([*x, frame.right], [*y, y[-1]], steps=True)
        parts.append(el("path", d=d, class_=f"series s{i % SERIES_COLOURS}"))
    return _svg(frame.height, "Share of falsified runs over simulations", parts)


def panel_chart(panel: Panel, critical_time: float | None) -> Html:
    """Draw one quantity over time: its bounds and windows, its control points, and the critical time."""
    high = [float(panel.values.max()), *(panel.limits or ()), *(v for _, v in panel.points)]
    low = [float(panel.values.min()), *(panel.limits or ()), *(v for _, v in panel.points)]
    for bound in panel.bounds:
        low.append(float(bound.values.min()))
        high.append(float(bound.values.max()))
    frame = _frame(float(panel.times[0]), float(panel.times[-1]), [min(low), max(high)], 170)
    parts = [_window(frame, bound.start, bound.end, bound.predicate) for bound in panel.bounds]
    parts.append(_axes(frame, "time [s]", panel.title))
    parts += [_level(frame, limit, "limit") for limit in panel.limits or ()]
    for bound in panel.bounds:
        within = (panel.times >= bound.start) & (panel.times <= bound.end)
        d = frame.path(*_drawable(panel.times[within], bound.values[within]))
        parts.append(el("path", el("title", bound.predicate), d=d, class_="bound"))
    values = _drawable(panel.times, panel.values)
    kind = "output" if panel.limits is None else "input"
    parts.append(el("path", d=frame.path(*values, steps=panel.steps), class_=kind))
    parts += [
        el("circle", el("title", f"{v:.6g} at {t:.6g} s"), cx=frame.x(t), cy=frame.y(v), r=3, class_="point")
        for t, v in panel.points
    ]
    if critical_time is not None:
        x = frame.x(critical_time)
        title = el("title", f"critical time {critical_time:.6g} s")
        parts.append(
            el("line", title, x1=x, x2=x, y1=_TOP, y2=frame.height - _BOTTOM, class_="critical-time")
        )
    if panel.critical is not None:
        k = int(np.abs(panel.times - panel.critical).argmin())
        at, value = float(panel.times[k]), float(panel.values[k])
        parts.append(el("circle", cx=frame.x(at), cy=frame.y(value), r=4.5, class_="critical"))
    return _svg(frame.height, f"{panel.title} over time", parts)


def _frame(left: float, right: float, values: Sequence[float], height: float) -> _Frame:
    low, high = min(values), max(values)
    margin = 0.06 * (high - low) or max(abs(high), 1.0) * 0.1
    return _Frame(left, right if right > left else left + 1, low - margin, high + margin, height)


def _axes(frame: _Frame, x_label: str, y_label: str, *, whole: bool = False) -> Html:
    bottom = frame.height - _BOTTOM
    parts = []
    for value in _ticks(frame.low, frame.high):
        y = frame.y(value)
        parts.append(el("line", x1=_LEFT, x2=_WIDTH - _RIGHT, y1=y, y2=y, class_="grid"))
        parts.append(el("text", f"{value:.6g}", x=_LEFT - 6, y=y + 4, class_="tick end"))
    for value in _ticks(frame.left, frame.right, whole=whole):
        parts.append(el("text", f"{value:.6g}", x=frame.x(value), y=bottom + 15, class_="tick middle"))
    parts.append(el("line", x1=_LEFT, x2=_WIDTH - _RIGHT, y1=bottom, y2=bottom, class_="axis"))
    parts.append(el("text", y_label, x=4, y=13, class_="label"))
    parts.append(el("text", x_label, x=_WIDTH - _RIGHT, y=frame.height - 2, class_="label end"))
    return join(*parts)


def _ticks(low: float, high: float, *, whole: bool = False) -> list[float]:
    """Round numbers within [low, high], about as many as fit."""
    raw = max((high - low) / _TICKS, 1.0 if whole else 0.0)
    power = 10.0 ** floor(log10(raw))
    step = next((m * power for m in (1, 2, 5) if m * power >= raw), 10 * power)
    return [step * i for i in range(ceil(low / step), floor(high / step) + 1)]


def _level(frame: _Frame, value: float, kind: str) -> Html:
    y = frame.y(value)
    return el("line", x1=_LEFT, x2=_WIDTH - _RIGHT, y1=y, y2=y, class_=kind)


def _window(frame: _Frame, start: float, end: float, predicate: str) -> Html:
    x = frame.x(start)
    return el(
        "rect",
        el("title", f"{predicate}, evaluated from {start:.6g} s to {end:.6g} s"),
        x=x,
        y=_TOP,
        width=max(frame.x(end) - x, 1.0),
        height=frame.height - _TOP - _BOTTOM,
        class_="window",
    )


def _drawable(times: Array, values: Array) -> tuple[Array, Array]:
    """Short trajectories unchanged; of long ones the extremes in each column, in order of time."""
    if len(times) <= 2 * _DRAWN_COLUMNS:
        return times, values
    kept = [0, len(times) - 1]
    for column in np.array_split(np.arange(len(times)), _DRAWN_COLUMNS):
        kept += [int(column[values[column].argmin()]), int(column[values[column].argmax()])]
    at = np.unique(kept)
    return times[at], values[at]


def _svg(height: float, title: str, parts: Sequence[Html]) -> Html:
    return el(
        "svg",
        el("title", title),
        *parts,
        viewBox=f"0 0 {_WIDTH:g} {height:g}",
        role="img",
        aria_label=title,
        class_="chart",
    )
