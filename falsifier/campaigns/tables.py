"""The protocol's tables as values, beside what was published (published.toml): as text, Markdown or CSV."""

import json
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from typing import Any

from falsifier.campaigns.request import Method
from falsifier.campaigns.runs import RunProgress
from falsifier.campaigns.statistics import Interval, Statistics, group, statistics
from falsifier.core.files import bundled
from falsifier.core.literals import csv_text, markdown_text, one_line
from falsifier.core.words import aligned
from falsifier.stl.margins import signed

NONE = "–"
# Published means have one decimal, so means are compared with one decimal: 1.3 and 1.34 share a rank.
_DECIMALS = 1


@dataclass(frozen=True, slots=True)
class Score:
    """One cell of a table: how often a requirement was falsified, and in how many simulations.

    Attributes:
        falsified: number of falsified runs.
        runs: number of finished runs.
        mean: mean number of simulations over the falsified runs; None if there is none.
        tool: name of the tool, if the column combines several tools.
    """

    falsified: int
    runs: int
    mean: float | None
    tool: str = ""

    @property
    def key(self) -> tuple[float, float]:
        """Sort key of ranks: more falsified runs first, then fewer simulations."""
        mean = float("inf") if self.mean is None else round(self.mean, _DECIMALS)
        return -self.falsified / max(self.runs, 1), mean

    @property
    def text(self) -> str:
        """The cell without the tool: FR / S."""
        return f"{self.falsified}/{self.runs} / {_number(self.mean, 1)}"


@dataclass(frozen=True, slots=True)
class Published:
    """Content of published.toml.

    Attributes:
        columns: scores by column (``best``, ``uniform``, ``llm_falsifier``) and requirement.
        ablation: scores by prompt variant and requirement.
        tools: scores of single tools that have no column of their own, by tool and requirement.
        llms: scores by language model with effort, e.g. ``gpt-5-mini-high``, and requirement.
        sources: publication that a column was taken from.
    """

    columns: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    ablation: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    llms: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    tools: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def scores(self, requirement: str) -> dict[str, Score]:
        """Scores for one requirement by column."""
        return {name: scores[requirement] for name, scores in self.columns.items() if requirement in scores}

    def competitors(self, requirement: str) -> list[Score]:
        """Scores for one requirement of every published tool, each tool once."""
        best = self.columns.get("best", {}).get(requirement)
        shown = list(self.scores(requirement).values())
        return shown + [
            scores[requirement]
            for tool, scores in self.tools.items()
            if requirement in scores and (best is None or best.tool != tool)
        ]


COLUMNS = {"best": "best ARCH-COMP tool", "llm_falsifier": "LLM-Falsifier", "uniform": "uniform random"}


def place(own: Score, others: Sequence[Score]) -> str:
    """Rank of a score among others, which may be shared; NONE without a falsified run, or without others."""
    if own.falsified == 0 or not others:
        return NONE
    keys = [other.key for other in others if other.falsified]
    rank = 1 + sum(key < own.key for key in keys)
    return f"{rank} (tie)" if own.key in keys else str(rank)


@cache
def read_published() -> Published:
    """Read the bundled table of published results."""
    data = tomllib.loads((bundled("specs") / "published.toml").read_text(encoding="utf-8"))

    def columns(found: Mapping[str, Any]) -> dict[str, dict[str, Score]]:
        return {
            name: {
                requirement: Score(cell["falsified"], data["runs"], cell.get("mean"), cell.get("tool", ""))
                for requirement, cell in column.items()
                if requirement != "source"
            }
            for name, column in found.items()
        }

    best, tools = {name: data[name] for name in COLUMNS}, data["tools"]
    return Published(
        columns=columns(best),
        ablation=columns(data["ablation"]),
        llms=columns(data["llms"]),
        tools=columns(tools),
        sources={name: column.get("source", "") for name, column in (best | tools).items()},
    )


@dataclass(frozen=True, slots=True)
class Table:
    """A table of texts.

    Attributes:
        title: what the table shows.
        header: names of the columns.
        rows: cells.
        notes: explanations that belong below the table.
    """

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def only(self, *names: str) -> "Table":
        """Return the table with only these columns, in this order; ValueError for an unknown column."""
        picked = [self.header.index(name) for name in names]
        return replace(self, header=names, rows=tuple(tuple(row[i] for i in picked) for row in self.rows))

    def markdown(self) -> str:
        """Format as a Markdown table with its title and notes."""
        lines = [self.header, tuple("---" for _ in self.header), *self.rows]
        body = "\n".join(f"| {' | '.join(map(markdown_text, row))} |" for row in lines)
        notes = "".join(f"\n\n{note}" for note in self.notes)
        return f"**{markdown_text(self.title)}**\n\n{body}{notes}\n"

    def _repr_markdown_(self) -> str:
        return self.markdown()

    def csv(self) -> str:
        """Format as comma-separated values."""
        return csv_text((self.header, *self.rows))

    @property
    def width(self) -> int:
        """Number of characters in a row of text."""
        return len(self.text().splitlines()[3])

    def text(self) -> str:
        """Format as plain text with aligned columns."""
        rows = [tuple(map(one_line, row)) for row in (self.header, *self.rows)]
        rows.insert(1, tuple("-" * max(map(len, column)) for column in zip(*rows, strict=True)))
        return "\n".join([self.title, "", *aligned(rows), *(["", *self.notes] if self.notes else [])])


def main_table(runs: Iterable[RunProgress], published: Published) -> Table:
    """Make a table with one row per requirement and method, and the published results where they apply."""
    groups = group(runs)
    found = {key: statistics(members) for key, members in groups.items()}
    others = {key: published.scores(key[0]) for key, m in groups.items() if all(map(comparable, m))}
    names = COLUMNS if any(others.values()) else {}
    rows = []
    for (requirement, method), numbers in found.items():
        row = [requirement, method.label, *(text(numbers) for text in _NUMBERS.values())]
        if names:
            known = others.get((requirement, method), {})
            rank = place(score(numbers), published.competitors(requirement)) if known else NONE
            cells = map(known.get, names)
            row += [rank, *(f"{cell.tool} {cell.text}".strip() if cell else "" for cell in cells)]
        rows.append(tuple(row))
    notes = {_UNFINISHED} if any(s.unfinished_runs for s in found.values()) else set[str]()
    for told, count in _COUNTED.items():
        rows_of = (f"{r} {m.label} {n}" for (r, m), s in found.items() if (n := count(s)))
        notes |= {f"{told}: {listed}." for listed in [", ".join(rows_of)] if listed}
    legend = f"{_LEGEND} {_PUBLISHED_LEGEND}" if names else _LEGEND
    if names:
        named = ((COLUMNS.get(name, name), source) for name, source in published.sources.items() if source)
        notes |= {f"Source of {name}: {source}." for name, source in named}
    header = ("requirement", "method", *_NUMBERS, *(("rank",) if names else ()), *names.values())
    return Table("Falsification", header, tuple(rows), (legend, *sorted(notes)))


def ablation_table(runs: Iterable[RunProgress], published: Published) -> Table:
    """Make a table of prompt variants side by side, with the published results for each."""

    def column(m: Method) -> str:
        return f"{m.variant} ({replace(m, variant='').label})" if m.variant else ""

    return _side_by_side("Prompt variants: FR / S", runs, column, published.ablation)


def llms_table(runs: Iterable[RunProgress], published: Published) -> Table:
    """Make a table of language models side by side, with the published results."""
    return _side_by_side("Language models: FR / S", runs, lambda m: m.label if m.llm else "", published.llms)


TABLES: Mapping[str, Callable[[Iterable[RunProgress], Published], Table]] = {
    "main": main_table,
    "ablation": ablation_table,
    "llms": llms_table,
}


def statistics_json(runs: Iterable[RunProgress]) -> str:
    """All statistics as JSON: a list of objects, one per requirement and method."""
    rows = [
        {"requirement": requirement, "label": method.label, **asdict(method), **asdict(statistics(members))}
        for (requirement, method), members in group(runs).items()
    ]
    return json.dumps(rows, indent=2) + "\n"


def comparable(run: RunProgress) -> bool:
    """Whether a run may be compared with the published ones, which are of instance 1.

    That is a bundled requirement with its own (fixed) parameterization, searched alone and from the start.
    """
    method, asked = run.method, run.request
    is_theirs = asked.source is not None and asked.source.is_bundled and not asked.start_from
    return is_theirs and method.parameterization == "fixed" and not (method.profile or method.together)


def score(found: Statistics) -> Score:
    """Reduce statistics to the values that published tables contain: FR and mean S."""
    return Score(found.falsified_runs, found.runs, found.mean)


# Columns with what they show of the statistics.
_NUMBERS: Mapping[str, Callable[[Statistics], str]] = {
    "FR": lambda s: f"{s.falsified_runs}/{s.runs}" + (f" +{s.unfinished_runs}" if s.unfinished_runs else ""),
    "budget": lambda s: ", ".join(map(str, s.budgets)) or NONE,
    "FR 95 %": lambda s: _interval(s.rate_interval, 2),
    "mean S": lambda s: _number(s.mean, 1),
    "mean 95 %": lambda s: _interval(s.mean_interval, 1),
    "median S": lambda s: _number(s.median, 1),
    "std S": lambda s: _number(s.deviation, 1),
    "best robustness": lambda s: NONE if s.smallest_robustness is None else signed(s.smallest_robustness, 4),
    "sim. s": lambda s: _per_run(s, s.spent.simulation_seconds, 2),
    "total s": lambda s: _per_run(s, s.spent.seconds, 2),
    "tokens": lambda s: _per_run(s, s.spent.tokens, 0),
    "cost $": lambda s: "unknown" if s.spent.cost is None else _per_run(s, s.spent.cost, 4),
}
_LEGEND = (
    "FR: falsified runs / finished runs (those that falsified, spent their budget or tried all candidates). "
    "Budget: limit on the simulations of a run; several if runs differ. S: simulations per falsified run; "
    "std is the sample standard deviation. Intervals, from five runs on: Wilson for FR, percentile bootstrap "
    "for the mean. Best robustness: the smallest of all runs, without violations that were not confirmed. "
    "Seconds, tokens and cost are means per run."
)
_PUBLISHED_LEGEND = (
    "Rank: position among all published tools known for the requirement, by FR, then by mean S, whatever the "
    "budgets; ties share a rank. Published cells: FR / mean S."
)

_LEGEND_SIDE = "FR / S: falsified runs/finished runs / mean number of simulations per falsified run."
_UNFINISHED = (
    "+n: n more runs failed, have not ended or have not begun; of the other numbers, only best robustness "
    "includes them."
)
# What is said below the table of rows in which it occurs.
_COUNTED: Mapping[str, Callable[[Statistics], str]] = {
    "Simulations that failed": lambda s: (
        f"{s.spent.failed} of {s.spent.simulations}" if s.spent.failed else ""
    ),
    "Replies from the cache, whose tokens and cost are not counted": lambda s: str(s.spent.kept or ""),
    "Runs that began with known inputs": lambda s: f"{s.known} of {s.runs}" if s.known else "",
    "Runs that repeat the seed of another, so intervals are too narrow": lambda s: str(s.repeated or ""),
    "Different ranges, options or context files, counted together": lambda s: (
        str(s.settings) if s.settings > 1 else ""
    ),
}


def _number(value: float | None, decimals: int) -> str:
    return NONE if value is None else f"{value:.{decimals}f}"


def _per_run(found: Statistics, total: float, decimals: int) -> str:
    return _number(total / found.runs if found.runs else None, decimals)


def _interval(interval: Interval | None, decimals: int) -> str:
    return NONE if interval is None else f"{interval[0]:.{decimals}f}..{interval[1]:.{decimals}f}"


def _side_by_side(
    title: str,
    runs: Iterable[RunProgress],
    column: Callable[[Method], str],
    theirs: Mapping[str, Mapping[str, Score]],
) -> Table:
    """Scores by column and requirement, ours before theirs; methods whose column is empty are omitted."""
    groups = {key: members for key, members in group(runs).items() if column(key[1])}
    known = {requirement for (requirement, _), m in groups.items() if all(map(comparable, m))}
    every: dict[str, dict[str, Score]] = {}
    for (requirement, method), members in groups.items():
        every.setdefault(column(method), {})[requirement] = score(statistics(members))
    for name, scores in theirs.items():
        every[f"{name} published"] = {r: found for r, found in scores.items() if r in known}
    rows = []
    for requirement in dict.fromkeys(requirement for requirement, _ in groups):
        cells = (scores.get(requirement) for scores in every.values())
        rows.append((requirement, *(cell.text if cell else NONE for cell in cells)))
    return Table(title, ("requirement", *every), tuple(rows), (_LEGEND_SIDE,))
