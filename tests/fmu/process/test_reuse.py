from falsifier.fmu.process.worker import Experience, Reuse


def known(experience: Experience) -> tuple[Reuse | None, tuple[Reuse, ...]]:
    return experience.reuse, experience.untrusted


def test_what_crashed_is_not_tried_again_nor_anything_cheaper() -> None:
    experience = Experience()
    experience.reuse = "state"
    experience.distrust("state")
    assert known(experience) == (None, ("reset", "state"))
    experience.distrust("process")
    assert known(experience)[0] == "process"


def test_a_quick_simulation_is_not_waited_for_long() -> None:
    experience = Experience()
    experience.took(0.01)
    quick = experience.patience
    assert quick < 2.0
    experience.took(3.0)
    experience.took(0.01)
    assert experience.patience > 20 * 3.0 > quick


def test_only_the_first_failures_are_repeated() -> None:
    experience = Experience()
    assert [experience.is_worth_repeating() for _ in range(5)] == [True, True, True, False, False]
