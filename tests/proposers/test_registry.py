import pytest

from falsifier.errors import SpecError
from falsifier.proposers import ENGINES, make_proposer
from falsifier.testing import lag_problem


def test_every_engine_loads_and_bears_its_name() -> None:
    problem = lag_problem()
    for name in set(ENGINES) - {"hybrid"}:
        assert make_proposer(name, problem, seed=0).name == name


def test_a_wrong_name_is_an_error_with_a_suggestion() -> None:
    with pytest.raises(SpecError, match="did you mean 'sobol'"):
        make_proposer("sobl", lag_problem(), seed=0)


def test_nothing_to_vary_is_an_error() -> None:
    with pytest.raises(SpecError, match="nothing may be varied"):
        make_proposer("uniform", lag_problem(inputs=0, parameters=0), seed=0)
