from pathlib import Path
from xml.etree import ElementTree

from falsifier.views.report import junit_report


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
