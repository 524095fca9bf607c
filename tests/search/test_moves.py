from dataclasses import replace

import pytest

from falsifier.search.moves import Ask, Costs, Situation, next_move

CHEAP = Costs().asked("engine", 1, 0.1).simulated("engine", 0.01)
DEAR = Costs().asked("engine", 1, 0.1).simulated("engine", 1.0)
ALONE = Situation(waiting=0, last="engine", cores=1, left=None, in_batches=False, may_scout=True, costs=CHEAP)


def test_on_one_core_the_scout_gets_as_much_time_as_the_engine_has_thought() -> None:
    assert next_move(ALONE) == Ask("scout", 8)  # 10 of 0.01 s are owed: first some to learn from
    spent = CHEAP.asked("scout", 8, 0.004)
    for _ in range(8):
        spent = spent.simulated("scout", 0.01)
    assert next_move(replace(ALONE, costs=spent, last="scout", waiting=3)) is None
    assert next_move(replace(ALONE, costs=spent, last="scout")) == Ask("scout", 1)
    spent = spent.told(1.0, 0.02)  # what it costs to learn from them counts
    assert next_move(replace(ALONE, costs=spent, last="scout")) == Ask("engine", 1)


def test_other_cores_simulate_while_the_engine_thinks() -> None:
    two = replace(ALONE, cores=2, costs=replace(CHEAP, thinking=0.0))
    assert next_move(two) == Ask("scout", 10)
    assert next_move(replace(two, last="scout", waiting=10)) == Ask("engine", 1)
    assert next_move(replace(two, last="engine", waiting=11)) is None
    assert next_move(replace(two, cores=4)) == Ask("scout", 30)
    assert next_move(replace(two, left=5)) == Ask("scout", 5)
    assert next_move(replace(two, left=1)) == Ask("engine", 1)


@pytest.mark.parametrize("change", [{"costs": DEAR}, {"may_scout": False}, {"costs": Costs()}])
def test_otherwise_only_the_engine_proposes_as_soon_as_a_core_is_free(change: dict[str, object]) -> None:
    three = replace(ALONE, cores=3, **change)  # type: ignore[arg-type]
    assert next_move(three) == Ask("engine", 1)
    assert next_move(replace(three, waiting=2)) == Ask("engine", 1)
    assert next_move(replace(three, waiting=3)) is None
    assert next_move(replace(three, waiting=2, left=0)) is None


def test_an_engine_whose_questions_cost_is_asked_for_all_cores_at_once() -> None:
    batch = replace(ALONE, cores=3, in_batches=True, may_scout=False)
    assert next_move(batch) == Ask("engine", 3)
    assert next_move(replace(batch, waiting=1)) is None
    assert next_move(replace(batch, left=2)) == Ask("engine", 2)


def test_costs_are_those_of_the_last_turns() -> None:
    costs = Costs()
    for _ in range(20):
        costs = costs.asked("engine", 1, 0.001)
    for _ in range(8):
        costs = costs.asked("engine", 2, 0.4).simulated("engine", 0.05)
    assert costs.proposal == pytest.approx(0.2) and costs.simulation == pytest.approx(0.05)
    assert costs.thinking == pytest.approx(3.22)
    assert costs.simulated("engine", 0.0) == costs  # not measured
