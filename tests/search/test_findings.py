from falsifier.search.findings import Finding


def test_only_findings_about_the_requirement_make_an_answer_vacuous() -> None:
    assert Finding(kind="condition", text="").vacuous
    assert not Finding(kind="parameterization", text="").vacuous
