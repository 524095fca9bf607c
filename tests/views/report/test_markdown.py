from pathlib import Path

from falsifier.record.run import falsify
from falsifier.views.report import markdown_report
from tests.problems import hard


def test_markdown_has_a_verdict_for_each_requirement_and_then_the_statistics(campaign: Path) -> None:
    text = markdown_report(campaign)
    assert text.startswith("# Falsification report: nightly\n")
    parts = [
        "## HARD: violated",
        "required x \\<= 0.6",
        "falsifier replay",
        "## NEVER: not violated",
        "What was tried:",
        "What this does not show:",
        "| HARD | uniform | 2/2 |",
    ]
    places = [text.index(part) for part in parts]
    assert places == sorted(places)
    assert "`G[0,10] (x <= 0.6)`" in text
    assert "Robustness" not in text.partition("required")[0]


def test_several_directories_are_compared(campaign: Path, tmp_path: Path) -> None:
    falsify(hard(), "corners", budget=3, directory=tmp_path / "again")
    text = markdown_report(campaign, tmp_path / "again")
    assert "## HARD in nightly: violated" in text and "## HARD in again: violated" in text
    assert "## NEVER in again: not searched" in text
