"""Readings of a requirement in words, for the terminal and as JSON."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from falsifier.analyses.formalize import Difference, Formalized, Reading
from falsifier.core.literals import one_line
from falsifier.core.trajectory import Trajectory
from falsifier.problem.template_advice import Advice, hint
from falsifier.stl.margins import margin_words, signed
from falsifier.views.sparkline import trace_lines
from falsifier.views.text import llm_use


def formalized_text(found: Formalized) -> str:
    """Return all readings, how they differ, and what the language model has cost."""
    lines: list[str] = []
    for number, reading in enumerate(found.readings, start=1):
        lines += _reading_lines(number, reading)
    for difference in found.differences:
        lines += _difference_lines(difference)
    lines += [f"rejected: {one_line(reason)}" for reason in found.rejected]
    lines.append(f"language model: {llm_use(found.spent)}")
    return "\n".join(lines)


def formalized_json(found: Formalized) -> dict[str, Any]:
    """Return the same as a JSON object."""
    readings = [
        {
            "formula": str(r.formula),
            "words": r.words,
            "meaning": r.meaning,
            "nominal_robustness": None if r.nominal is None else r.nominal.robustness,
        }
        for r in found.readings
    ]
    differences = [
        {
            "first": d.first,
            "second": d.second,
            "only_first": _points(d.only_first),
            "only_second": _points(d.only_second),
        }
        for d in found.differences
    ]
    spent = {"calls": found.spent.calls, "tokens": found.spent.tokens, "cost": found.spent.cost}
    return {
        "sentence": found.sentence,
        "readings": readings,
        "differences": differences,
        "rejected": list(found.rejected),
        "spent": spent,
    }


def advice_text(sentence: str, advice: list[Advice]) -> str:
    """Return which templates fit a sentence, how to write them, and what formulas cannot say."""
    hints = [f"note: {said}"] if (said := hint(sentence)) else []
    lines = []
    for one in advice:
        lines += [f"{one.template}: {one.summary}", *(f"  {line}" for line in one.section.splitlines())]
    lines.append("Fill in what is in capital letters. With --llm NAME, a language model proposes formulas.")
    return "\n".join([*lines, *hints])


def advice_json(sentence: str, advice: list[Advice]) -> dict[str, Any]:
    """Return the same as a JSON object."""
    return {
        "sentence": sentence.strip(),
        "templates": [asdict(one) for one in advice],
        "note": hint(sentence),
    }


def _reading_lines(number: int, reading: Reading) -> Iterator[str]:
    yield f"{number}. {reading.formula}"
    yield f"   in words   {reading.words}"
    if reading.meaning:
        yield f"   meant      {one_line(reading.meaning)}"
    if reading.nominal is not None:
        yield f"   nominal    {_nominal(reading)}"


def _nominal(reading: Reading) -> str:
    nominal = reading.nominal
    if nominal is None or nominal.robustness is None:
        return f"the simulation failed: {'' if nominal is None else one_line(nominal.reason)}"
    return f"robustness {signed(nominal.robustness)} ({margin_words(nominal.robustness)})"


def _difference_lines(difference: Difference) -> Iterator[str]:
    one, other = difference.first, difference.second
    if difference.only_first is None and difference.only_second is None:
        yield f"{one} and {other}: no example was found that satisfies only one of them"
    for number, rest, trajectory in (
        (one, other, difference.only_first),
        (other, one, difference.only_second),
    ):
        if trajectory is not None:
            yield f"only {number}, not {rest}, is satisfied by (0 to {trajectory.times[-1]:g} s)"
            yield from (f"   {line}" for line in trace_lines(trajectory))


def _points(trajectory: Trajectory | None) -> dict[str, list[list[float]]] | None:
    """Return the steps of each signal as [time, value]."""
    if trajectory is None:
        return None
    return {
        name: [
            [float(trajectory.times[k]), float(column[k])]
            for k in range(len(column))
            if k == 0 or column[k] != column[k - 1]
        ]
        for name, column in trajectory.columns.items()
    }
