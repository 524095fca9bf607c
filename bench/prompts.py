"""Tokens of prompts, how much of them providers can keep, and numbers told against trajectories.

    python -m bench.prompts > bench/prompts.md

Samples alternate between the surrogate engine and uniform random search, seed 1. Tokens are counted with the
vocabulary cl100k_base. Of each course that is told of a signal, every recorded time is compared: the line or
envelope as it is told, digits and all, must not be further from the signal than the prompt says, where times
are rounded as the prompt says. Values at the critical time and lists of changes are compared, too.
"""

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from falsifier.engines import make_engine
from falsifier.engines.briefing import preview
from falsifier.evaluation.evaluate import Evaluation, evaluate
from falsifier.llm.messages import Message
from falsifier.llm.prompts import VARIANTS, View
from falsifier.llm.prompts.numbers import coarse_clock
from falsifier.llm.prompts.observations import observed
from falsifier.llm.prompts.told_courses import (
    CLOSE_TOLERANCE,
    close_up_times,
    compared_columns,
    told_accuracy,
)
from falsifier.llm.usage import count_tokens
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem

SYSTEMS = ("AT1", "CC4", "CCx", "NN", "F16", "SC")
COMPARED = (*SYSTEMS, "AT51", "AT6a", "AFC27", "PulseMeter", "HeaterLimpHome", "ChargerHandshake")
SAMPLES = (0, 1, 5, 20)
Array = NDArray[np.float64]
_REGULAR = re.compile(r"by (\S+) every (\S+) s to (\S+)")
_OSCILLATION = re.compile(r"swings from (\S+) to (\S+) s.*?, between (.*?) and (.*)")
_WITHIN = re.compile(r" \(each value within (\S+); least \S+ at \S+ s, greatest \S+ at \S+ s\)$")


@dataclass(frozen=True, slots=True)
class Told:
    """One line of a prompt on a signal over time, and how far it is off.

    Attributes:
        name: what is told.
        stated: how far it may be off, by the prompt.
        error: how far it is off.
        span: the signal's span.
    """

    name: str
    stated: float
    error: float
    span: float


def samples(problem: Problem, count: int) -> list[Evaluation]:
    """The first samples of a search."""
    uniform, surrogate = (make_engine(name, problem, seed=1) for name in ("uniform", "surrogate"))
    found: list[Evaluation] = []
    for i in range(count):
        (candidate,) = (uniform if i % 2 else surrogate).ask(1)
        found.append(evaluate(problem, candidate))
        surrogate.tell(found[-1:])
    return found


def tokens(messages: Sequence[Message]) -> int:
    """Tokens of a prompt."""
    return sum(count_tokens(m.content) for m in messages)


def told_courses(view: View, evaluation: Evaluation) -> Iterator[Told]:
    """The courses that a prompt tells of one sample, in full and in short, against its trajectory."""
    trajectory = evaluation.trajectory
    assert trajectory is not None and evaluation.verdict is not None
    inside, critical = view.inside(trajectory), evaluation.verdict.critical_time
    columns = {n: inside[n] for n in view.experiment.outputs} | compared_columns(view, inside)
    seen = observed(view, evaluation)
    for line in (*seen.full, *seen.short):
        for name, column in columns.items():
            if line.startswith(f"{name}: ") and ", then " in line:
                yield _changes(name, line[len(name) + 2 :], inside.times, column)
            elif line.startswith(f"{name}: ") and ":" in line[len(name) + 2 :] and "irregular, " not in line:
                clock = coarse_clock(view.space.stop_time)
                stated = told_accuracy(view, name, column)
                yield _compared(name, line[len(name) + 2 :], inside.times, column, stated, clock)
            if line.startswith(f"{name} around t = ") and "irregular, " not in line:
                part = close_up_times(view, inside.times, column, critical, critical)
                times, column = inside.times[part], column[part]
                stated = CLOSE_TOLERANCE * float(np.ptp(column))
                yield _compared(name, line.partition(" s: ")[2], times, column, stated, 6)


def _compared(name: str, text: str, times: Array, column: Array, stated: float, clock: int) -> Told:
    if within := _WITHIN.search(text):
        text, stated = text[: within.start()], max(stated, float(within[1]))
    # As far as the time of a breakpoint is rounded, the signal may be seen a little earlier or later.
    step = float(times[1] - times[0])
    width = 2 * round(0.5 * 10.0**-clock / step + 0.51) + 1
    low, high = minimum_filter1d(column, width), maximum_filter1d(column, width)
    error = np.zeros_like(times)
    for part in text.split("; "):
        if swing := _OSCILLATION.match(part):
            begin, end = float(swing[1]), float(swing[2])
            inside = (times >= begin) & (times <= end)
            lower, upper = (np.interp(times, *_points(side)) for side in (swing[3], swing[4]))
            error = np.where(inside, np.maximum(error, np.maximum(lower - high, low - upper)), error)
        else:
            at, values = _points(part)
            inside = (times >= at[0]) & (times <= at[-1])
            line = np.interp(times, at, values)
            error = np.where(inside, np.maximum(error, np.maximum(line - high, low - line)), error)
    return Told(name, stated, float(error.max()), float(np.ptp(column)))


def _changes(name: str, text: str, times: Array, column: Array) -> Told:
    """A list of changes; values with the name of an item are compared by their numbers."""
    first, _, rest = text.partition(", then ")
    last, start = float(first.split(" ")[0]), 0.0
    error, value = np.zeros_like(times), np.full_like(times, last)
    early = 0.5 * float(times[1] - times[0])
    for change in rest.split(", "):
        if "more changes" in change:  # what follows is told, what is left out is not
            value[:], start = np.nan, np.nan
            continue
        number, _, at = change.partition(" from ")
        end, regular = float(at.removesuffix(" s")), _REGULAR.match(number)
        if regular and not np.isnan(start):
            by, every = map(float, regular.groups()[:2])
            for _ in range(round((end - start) / every)):
                last, start = last + by, start + every
                value[times > start - early] = last
        last, start = float(regular[3] if regular else number.split(" ")[0]), end
        value[times > start - early] = last
    error = np.nan_to_num(np.abs(value - column))
    return Told(name, 0.0, float(error.max()), float(np.ptp(column)))


def _points(text: str) -> tuple[Array, Array]:
    pairs = [pair.split(":") for pair in text.split(" ")]
    return np.array([float(t) for t, _ in pairs]), np.array([float(v) for _, v in pairs])


def main() -> None:
    """Print the tables."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter).parse_args()
    print("# Prompts\n\nMade by `python -m bench.prompts`; how, is said there.\n")
    print("## Tokens by number of samples\n")
    print("Kept: share of the question after 20 samples that is the same as in the question before.\n")
    heads = " | ".join(str(n) for n in SAMPLES)
    print(f"| system | variant | {heads} | kept |\n|---|---|{'---|' * (len(SAMPLES) + 1)}")
    rows = []
    for name in COMPARED:
        problem = load_problem(name)
        evaluations = samples(problem, max(SAMPLES))
        for variant in VARIANTS if name in SYSTEMS else ():
            asked = {
                n: preview(problem, variant=variant, evaluations=evaluations[:n]) for n in (*SAMPLES, 19)
            }
            before, after = ("\0".join(m.content for m in asked[n]) for n in (19, 20))
            same = next((i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), 0)
            kept = count_tokens(after[:same]) / tokens(asked[20])
            counts = " | ".join(str(tokens(asked[n])) for n in SAMPLES)
            print(f"| {name} | {variant} | {counts} | {kept:.0%} |", flush=True)
        view = View.of(problem)
        for count in (8, 20):
            told = [
                one
                for e in evaluations[:count]
                if e.trajectory is not None and e.verdict is not None
                for one in told_courses(view, e)
            ]
            rows.append((name, count, told))
        problem.model.close()
    print("\n## Courses told, against trajectories\n")
    print("Beyond: lines whose error is larger than the prompt says. Coarse: lines that state an error of")
    print("more than 5 % of the signal's span.\n")
    print("| system | samples | lines | median error | worst error | coarse | beyond |")
    print("|---|---|---|---|---|---|---|")
    for name, count, told in rows:
        shares = [100 * one.error / one.span for one in told]
        beyond = sum(one.error > one.stated * (1 + 1e-6) for one in told)
        coarse = sum(one.stated > 0.05 * one.span for one in told)
        median, worst = (float(np.median(shares)), max(shares)) if shares else (0.0, 0.0)
        print(f"| {name} | {count} | {len(told)} | {median:.1f} % | {worst:.1f} % | {coarse} | {beyond} |")


if __name__ == "__main__":
    main()
