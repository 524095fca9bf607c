from falsifier.fmu.trust import Trust
from falsifier.fmu.worker_order import Reuse


def known(trust: Trust) -> tuple[Reuse | None, tuple[Reuse, ...]]:
    return trust.reuse, trust.untrusted


def test_what_crashed_is_not_tried_again_nor_anything_cheaper() -> None:
    trust = Trust()
    trust.reuse = "state"
    trust.distrust("state")
    assert known(trust) == (None, ("reset", "state"))
    trust.distrust("process")
    assert known(trust)[0] == "process"


def test_a_quick_simulation_is_not_waited_for_long() -> None:
    trust = Trust()
    trust.took(0.01)
    quick = trust.patience
    assert quick < 2.0
    trust.took(3.0)
    trust.took(0.01)
    assert trust.patience > 20 * 3.0 > quick


def test_only_the_first_failures_are_repeated() -> None:
    trust = Trust()
    assert [trust.is_worth_repeating() for _ in range(5)] == [True, True, True, False, False]
