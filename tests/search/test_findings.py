from falsifier.search.findings import Finding


def test_only_findings_about_the_requirement_make_an_answer_vacuous() -> None:
    assert Finding(kind="condition", text="").vacuous
    assert not Finding(kind="parameterization", text="").vacuous


def test_a_wide_margin_is_no_part_that_was_not_tested() -> None:
    assert Finding(kind="condition", text="").untested
    assert not Finding(kind="threshold", text="").untested
