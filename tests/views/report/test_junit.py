from pathlib import Path
from xml.etree import ElementTree

from falsifier import falsify
from falsifier.testing import lag_problem
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
        message = failures[0].get("message") or ""
        assert message.startswith("x <= 0.6 was violated from ")
        assert "; robustness -" in message
        assert "x <= 0.6" in (failures[0].text or "")


def test_what_a_search_did_not_show_is_told(tmp_path: Path) -> None:
    result = falsify(lag_problem("G[0,10] (x >= 2 -> u <= 0)"), "sobol", budget=3, directory=tmp_path)
    case = ElementTree.fromstring(junit_report(tmp_path))[0][0]
    told = {p.get("name"): p.get("value") for p in case.iter("property")}
    assert told["falsifier.condition"] == result.findings[0].text
    assert f"what this does not show: {result.findings[0].text}" in (case.findtext("system-out") or "")
