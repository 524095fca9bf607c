from pathlib import Path
from xml.etree import ElementTree

from falsifier.views.report import junit_report, markdown_report


def test_markdown_has_the_table_and_one_counterexample_a_requirement(campaign: Path) -> None:
    text = markdown_report(campaign)
    assert text.startswith("# Falsification report: nightly\n")
    assert "| HARD | uniform | 2/2 |" in text
    assert text.count("## ") == 1
    assert "## HARD: falsified" in text
    assert "`G[0,10] (x <= 0.6)`" in text
    assert "falsifier replay" in text


def test_junit_has_a_case_for_each_run(campaign: Path) -> None:
    root = ElementTree.fromstring(junit_report(campaign))
    suites = {suite.get("name"): suite for suite in root}
    assert set(suites) == {"uniform", "corners"}
    for suite in suites.values():
        assert [suite.get(k) for k in ("tests", "failures", "errors", "skipped")] == ["4", "2", "0", "0"]
        cases = list(suite)
        assert [case.get("name") for case in cases] == ["seed 0", "seed 1"] * 2
        failures = [case.find("failure") for case in cases]
        assert [f is not None for f in failures] == [True, True, False, False]
        assert failures[0] is not None
        assert (failures[0].get("message") or "").startswith("robustness -")
        assert "x <= 0.6" in (failures[0].text or "")
