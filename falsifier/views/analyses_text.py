"""What a run has tried, and readings of a requirement, as text for terminals or as JSON."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from falsifier.analyses.coverage import FAST, PACES, SLOW, Coverage, ModeCoverage, PairCoverage, RangeCoverage
from falsifier.analyses.formalize import Difference, Formalized, Reading
from falsifier.core.literals import one_line
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import aligned, counted, ends, first_few, listed, readable, with_unit
from falsifier.stl.margins import margin_words, signed
from falsifier.views.text import Fact, llm_use

# Lists are cut after this many entries; JSON has all.
_SHOWN = 8


def coverage_text(found: Coverage, name: str) -> str:
    """Format coverage as tables: what was searched, what of it was not tried, what the system did."""
    count = sum(failure.count for failure in found.failures)
    failed = f", and {counted(count, 'failed one')}" if count else ""
    lines = [f"{name}: what {counted(found.simulations, 'simulation')} tried{failed}"]
    lines += [f"  {failure.text}" for failure in found.failures]
    if found.ranges:
        header = ("searched", "range", "tried", "parts tried", "changes")
        lines += _indented([header, *map(_range_row, found.ranges)])
        lines.append("  A part is a tenth of the range, or one number if there are only a few whole ones.")
        if any(r.paces for r in found.ranges):
            lines.append(
                "  Changes: the fastest of the input in each simulation; slow: the whole range takes "
                f"{readable(SLOW * found.stop_time, 4)} s or more; fast: "
                f"{readable(FAST * found.stop_time, 4)} s or less."
            )
    gaps = [*_gap_rows(found), *_pair_rows(found.pairs)]
    if gaps and found.simulations:
        lines += ["never tried", *_indented(gaps)]
    if found.outputs:
        lines.append(f"reached, in {counted(found.trajectories, 'simulation')} with a kept trajectory")
        lines += _indented(
            (with_unit(o.name, o.unit), _span(o.lows.min(), o.highs.max()))
            for o in sorted(found.outputs, key=lambda o: o.name)
        )
    if found.modes:
        lines += ["modes", *_indented([_mode_row(m) for m in found.modes])]
    for requirement, climb in found.climbs.items():
        if climb.is_told:
            of = f"{requirement}: " if len(found.climbs) > 1 else ""
            lines.append(f"{of}few values of robustness, and what is missing for a lower one")
            lines += [f"  {line}" for line in (climb.levels.told("simulation"), *climb.lines)]
    return "\n".join(map(one_line, lines))


def tried_facts(found: Coverage) -> list[Fact]:
    """Return of each input and parameter which values were tried, and which never; in one line each."""
    never: dict[str, list[str]] = {}
    for name, gap in _gap_rows(found):
        never.setdefault(name, []).append(gap)
    facts = []
    for r in found.ranges:
        name, bounds, values, parts, _ = _range_row(r)
        missing = f"; never tried: {'; '.join(never[r.searched.name])}" if r.searched.name in never else ""
        facts.append((name, f"tried {values} of {bounds}, {parts} parts{missing}"))
    return facts


def coverage_json(found: Coverage) -> dict[str, Any]:
    """Convert coverage to a value that can be dumped as one JSON object."""
    return {
        "simulations": found.simulations,
        "failures": [asdict(failure) for failure in found.failures],
        "trajectories": found.trajectories,
        "searched": [
            {
                "name": r.searched.name,
                "unit": r.searched.unit,
                "range": [r.searched.low, r.searched.high],
                "scale": r.searched.scale,
                "tried": None if r.low is None else [r.low, r.high],
                "parts": r.parts.tolist(),
                "gaps": [list(gap) for gap in r.gaps],
                "changes": dict(r.paces),
            }
            for r in found.ranges
        ],
        "pairs": [
            {"names": [p.first, p.second], "combinations": p.tried.size, "tried": p.count}
            for p in found.pairs
        ],
        "outputs": [
            {"name": o.name, "unit": o.unit, "reached": [float(o.lows.min()), float(o.highs.max())]}
            for o in found.outputs
        ],
        "modes": [asdict(mode) for mode in found.modes],
        "levels": [
            {"requirement": name, "levels": [asdict(x) for x in climb.levels.found], "missing": climb.lines}
            for name, climb in found.climbs.items()
            if climb.is_told
        ],
    }


def _span(low: float, high: float) -> str:
    return readable(low) if low == high else " to ".join(ends(low, high))


def _indented(rows: Iterable[Sequence[str]]) -> list[str]:
    return [f"  {line}" for line in aligned(rows)]


def _range_row(r: RangeCoverage) -> tuple[str, ...]:
    tried = "nothing" if r.low is None or r.high is None else _span(r.low, r.high)
    changes = ", ".join(f"{pace} in {r.paces[pace]}" for pace in PACES if r.paces.get(pace))
    return (
        with_unit(r.searched.name, r.searched.unit),
        _span(r.searched.low, r.searched.high) + r.searched.manner,
        tried,
        f"{r.tried} of {len(r.parts)}",
        changes if r.paces else "parameter",
    )


def _gap_rows(found: Coverage) -> Iterator[tuple[str, str]]:
    for r in found.ranges:
        if r.gaps:
            yield r.searched.name, f"values {listed([_span(*gap) for gap in r.gaps])}"
        # Values that are held between changes have no slope.
        possible = PACES if r.searched.kind == "real" else ("constant", "steps")
        missing = [pace for pace in possible if r.paces and not r.paces[pace]]
        if missing:
            yield r.searched.name, f"changes: {listed(missing)}"


def _pair_rows(pairs: Iterable[PairCoverage]) -> Iterator[tuple[str, str]]:
    partly = [p for p in pairs if p.count < p.tried.size]
    for p in partly[:_SHOWN]:
        missing = f"{p.tried.size - p.count} of {p.tried.size}"
        yield f"{p.first} with {p.second}", f"{missing} combinations at the same time"
    if len(partly) > _SHOWN:
        yield "", f"and some combinations of {counted(len(partly) - _SHOWN, 'more pair')}; --json has all"


def _mode_row(mode: ModeCoverage) -> tuple[str, str]:
    text = first_few(mode.seen, _SHOWN) or "nothing recorded"
    if mode.changes:
        text += f"; changes {first_few([f'{before} to {after}' for before, after in mode.changes], _SHOWN)}"
    elif mode.seen:
        text += "; no changes"
    return mode.name, text + (f"; never {first_few(mode.never, _SHOWN)}" if mode.never else "")


def formalized_text(found: Formalized) -> str:
    """Return all readings, how they differ, and what the language model has cost."""
    lines = [line for k, reading in enumerate(found.readings, start=1) for line in _reading_lines(k, reading)]
    lines += [line for difference in found.differences for line in _difference_lines(difference)]
    for reason in dict.fromkeys(found.rejected):
        # In one line, without the formula with a caret below it that errors of its syntax have.
        said = "; ".join(line for line in reason.splitlines() if not line.startswith("  "))
        lines.append(f"rejected: {said}")
    lines.append(f"language model: {llm_use(found.spent)}")
    return "\n".join(map(one_line, lines))


def _reading_lines(number: int, reading: Reading) -> Iterator[str]:
    yield f"{number}. {reading.formula}"
    yield f"   in words   {reading.words}"
    if reading.meaning:
        yield f"   meant      {reading.meaning}"
    if (nominal := reading.nominal) is not None:
        least, failed = nominal.robustness, f"the simulation failed: {nominal.reason}"
        told = failed if least is None else f"robustness {signed(least)} ({margin_words(least)})"
        yield f"   nominal    {told}"


def _difference_lines(difference: Difference) -> Iterator[str]:
    one, other = difference.first, difference.second
    if difference.only_first is None and difference.only_second is None:
        yield f"{one} and {other}: no example was found that satisfies only one of them"
    for number, rest, trajectory in (
        (one, other, difference.only_first),
        (other, one, difference.only_second),
    ):
        if trajectory is not None:
            yield f"only {number}, not {rest}, is satisfied by (0 to {readable(trajectory.times[-1])} s)"
            yield from (f"   {line}" for line in trace_lines(trajectory))


_BARS = "▁▂▃▄▅▆▇█"
_WIDTH = 48


def trace_lines(trajectory: Trajectory, *, width: int = _WIDTH) -> list[str]:
    """Return one line per signal: its name, its course over time, and its smallest and largest value.

    The course is a line of bars, each the value in the middle of its part of the time.
    """
    longest = max(map(len, trajectory.columns), default=0)
    at = ((np.arange(width) + 0.5) * len(trajectory) / width).astype(int)
    lines = []
    for name, column in trajectory.columns.items():
        low, high = float(np.min(column)), float(np.max(column))
        heights = np.zeros(width) if low == high else (column[at] - low) / (high - low)
        bars = "".join(_BARS[round(h * (len(_BARS) - 1))] for h in heights)
        span = "constant " * (low == high) + _span(low, high)
        lines.append(f"{name:<{longest}}  {bars}  {span}")
    return lines
