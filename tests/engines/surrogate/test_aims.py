from falsifier.engines.surrogate.aims import Aims
from falsifier.engines.surrogate.settings import Settings


def after(*, aimed: list[bool], others: list[bool]) -> float:
    aims = Aims(Settings(aim_share=0.3, most_aimed=0.7, aim_trial=4))
    for is_new in aimed:
        aims.learn(aimed=True, is_new=is_new)
    for is_new in others:
        aims.learn(aimed=False, is_new=is_new)
    return aims.share


def test_levels_get_a_small_share_first() -> None:
    assert after(aimed=[], others=[]) == 0.3


def test_what_brings_nothing_is_given_up() -> None:
    assert after(aimed=[False] * 3, others=[]) > 0
    assert after(aimed=[False] * 4, others=[]) == 0
    assert after(aimed=[False] * 4 + [True], others=[]) > 0


def test_the_share_grows_and_shrinks_with_what_it_brings() -> None:
    assert after(aimed=[True] * 4, others=[False] * 8) == 0.7
    assert after(aimed=[True] + [False] * 30, others=[True] * 8) == 0.15
