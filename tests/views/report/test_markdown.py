from pathlib import Path

from falsifier.views.report import markdown_report


def test_markdown_has_the_table_and_one_counterexample_a_requirement(campaign: Path) -> None:
    text = markdown_report(campaign)
    assert text.startswith("# Falsification report: nightly\n")
    assert "| HARD | uniform | 2/2 |" in text
    assert text.count("## ") == 2
    assert "## NEVER: what this does not show" in text
    assert "## HARD: falsified" in text
    assert "`G[0,10] (x <= 0.6)`" in text
    assert "What broke: x \\<= 0.6 was violated from " in text
    assert text.index("What broke") < text.index("Robustness -")
    assert "falsifier replay" in text
