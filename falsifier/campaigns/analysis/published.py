"""Published numbers, and ranks among them."""

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from falsifier.core.files import bundled
from falsifier.errors import SpecError

# Published means have one decimal, so ours are compared at one decimal: 1.3 and 1.34 share a rank.
_DECIMALS = 1


@dataclass(frozen=True, slots=True)
class Score:
    """One cell of a table: how often, and in how many simulations.

    Attributes:
        falsified: falsified runs.
        runs: all runs.
        mean: mean simulations over the falsified runs, None where there is none.
        tool: whose, where a column is not one tool's.
    """

    falsified: int
    runs: int
    mean: float | None
    tool: str = ""

    @property
    def key(self) -> tuple[float, float]:
        """Order of ranks: more falsified runs first, then fewer simulations."""
        mean = float("inf") if self.mean is None else round(self.mean, _DECIMALS)
        return -self.falsified / max(self.runs, 1), mean


@dataclass(frozen=True, slots=True)
class Published:
    """Content of published.toml.

    Attributes:
        columns: scores by requirement, by column: ``best``, ``uniform``, ``llm_falsifier``.
        ablation: the same by prompt variant.
        llms: the same by language model and effort, e.g. ``gpt-5-mini-high``.
        sources: where each of them comes from, by column.
    """

    columns: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    ablation: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    llms: Mapping[str, Mapping[str, Score]] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    def scores(self, requirement: str) -> dict[str, Score]:
        """Scores on a requirement by column."""
        return {name: scores[requirement] for name, scores in self.columns.items() if requirement in scores}


COLUMNS = {"best": "best ARCH-COMP tool", "llm_falsifier": "LLM-Falsifier", "uniform": "uniform random"}


def rank(score: Score, others: Iterable[Score]) -> int | None:
    """Place of a score among others: one more than there are better ones; None without a falsified run."""
    if score.falsified == 0:
        return None
    return 1 + sum(other.falsified > 0 and other.key < score.key for other in others)


@lru_cache(maxsize=4)
def read_published(path: Path | None = None) -> Published:
    """Read a table of published numbers; without a path the bundled one.

    Raises:
        SpecError: when the file is not such a table.
    """
    file = path or bundled("specs") / "published.toml"
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
        runs = int(data["runs"])
        return Published(
            {name: _scores(data[name], runs) for name in COLUMNS},
            {name: _scores(column, runs) for name, column in data.get("ablation", {}).items()},
            {name: _scores(column, runs) for name, column in data.get("llms", {}).items()},
            {name: data[name].get("source", "") for name in COLUMNS},
        )
    except (OSError, tomllib.TOMLDecodeError, KeyError, TypeError, AttributeError) as error:
        raise SpecError(f"not a table of published numbers: {error!r}", file=str(file)) from None


def _scores(column: Mapping[str, Any], runs: int) -> dict[str, Score]:
    return {
        requirement: Score(cell["falsified"], runs, cell.get("mean"), cell.get("tool", ""))
        for requirement, cell in column.items()
        if requirement != "source"
    }
