from falsifier.search.findings import Finding, failures


def test_only_findings_about_the_requirement_make_an_answer_vacuous() -> None:
    assert Finding(kind="condition", text="").vacuous
    assert not Finding(kind="parameterization", text="").vacuous


def test_a_wide_margin_is_no_part_that_was_not_tested() -> None:
    assert Finding(kind="condition", text="").untested
    assert not Finding(kind="threshold", text="").untested


def test_failures_that_differ_only_in_numbers_have_one_cause() -> None:
    found = failures(
        [
            (2, "m: index 0 is outside of 1..5 at t = 1.25s"),
            (4, "m: car2 diverged at 0x7f01"),
            (5, "m: index -3 is outside of 1..5 at t = 2e-3s"),
            (6, "m: car3 diverged at 0x7f02"),
            (8, "m: index 17 is outside of 1..5 at t = 4s"),
        ]
    )
    assert [(f.count, f.simulation) for f in found] == [(3, 2), (1, 4), (1, 6)]
    assert found[0].text == (
        "3 simulations failed: m: index 0 is outside of 1..5 at t = 1.25s (for example simulation 3)"
    )
    assert found[1].text == "simulation 5 failed: m: car2 diverged at 0x7f01"
