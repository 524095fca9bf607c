from dataclasses import replace

import pytest

from falsifier.campaigns import suite
from falsifier.campaigns.analysis import Score, read_published
from falsifier.campaigns.tables import place
from falsifier.errors import SpecError
from falsifier.problem.loading import load_source

BEST, LLM = Score(10, 10, 1.3, "FReaK"), Score(10, 10, 2.3)


@pytest.mark.parametrize(
    ("score", "rank"),
    [
        (Score(10, 10, 1.0), "1"),
        (Score(10, 10, 1.34), "1 (tie)"),  # equal to a published 1.3: the first place is shared
        (Score(10, 10, 1.4), "2"),
        (Score(10, 10, 50.0), "3"),
        (Score(9, 10, 1.0), "3"),  # more falsified runs go before fewer simulations
        (Score(3, 3, 1.0), "1"),
        (Score(0, 10, None), "–"),
    ],
)
def test_rank_is_by_falsified_runs_then_by_simulations(score: Score, rank: str) -> None:
    assert place(score, [BEST, LLM, Score(0, 10, None)]) == rank


def test_the_bundled_table_has_all_columns() -> None:
    published = read_published()
    assert set(published.columns) == {"best", "llm_falsifier", "uniform"}
    assert {len(column) for column in published.columns.values()} == {21}
    assert published.scores("AT1")["best"] == Score(10, 10, 4.8, "FReaK")
    assert published.scores("AT1")["uniform"] == Score(0, 10, None)
    assert set(published.ablation) == {"MP1", "MP2", "MP3", "MP4"}
    assert published.llms["gpt-5-mini-high"]["NN"] == Score(1, 10, 97.0)
    assert published.scores("my own") == {}


def test_the_published_ranks_follow_from_the_published_numbers() -> None:
    """Where the published table gives its first place, our rule gives it too."""
    published = read_published()
    scores = published.columns["llm_falsifier"].items()
    ranks = [place(score, [*published.scores(name).values()]) for name, score in scores]
    assert sum(rank.startswith("1") for rank in ranks) == 14


def test_every_published_tool_counts_once_and_ties_are_known() -> None:
    published = read_published()
    # LLM-Falsifier falsified CC4 in 5 of 10 runs: behind the best tool and behind FalCAuN, as published.
    llm = published.columns["llm_falsifier"]["CC4"]
    assert place(llm, published.competitors("CC4")) == "3 (tie)", "with itself"
    assert place(llm, [*published.scores("CC4").values()]) == "2 (tie)"
    assert len(published.competitors("AT1")) == 4
    assert "FalCAuN" in published.sources
    again = replace(published, tools={"FReaK": {"AT1": Score(10, 10, 4.8)}})
    assert len(again.competitors("AT1")) == 3
    assert place(Score(0, 10, None), [Score(0, 10, None)]) == place(LLM, []) == "–"


def test_the_suite_has_the_published_requirements() -> None:
    names = [r.target for r in suite("arch-comp")]
    assert len(names) == 21
    assert {"AT:AT1", "AT:AT6abc", "NN:NN", "CC:CCx", "F16:F16", "SC:SC"} < set(names)
    assert [load_source(s).name for s in suite("arch-comp")] == [name.split(":")[1] for name in names]


def test_an_unknown_suite_is_named() -> None:
    with pytest.raises(SpecError, match="arch-comp"):
        suite("archcomp")
