import sys

import pytest

from falsifier.engines import ENGINES, make_engine
from falsifier.errors import SpecError
from falsifier.testing import lag_problem


def test_every_engine_loads_and_bears_its_name() -> None:
    problem = lag_problem()
    for name in set(ENGINES) - {"hybrid", "botorch"}:
        assert make_engine(name, problem, seed=0).name == name


def test_botorch_loads_where_it_is_installed() -> None:
    pytest.importorskip("botorch", reason="it brings torch, several hundred MB")
    assert make_engine("botorch", lag_problem(), seed=0).name == "botorch"


@pytest.mark.parametrize(("engine", "module"), [("optuna", "optuna_tpe"), ("botorch", "botorch_gp")])
def test_an_absent_package_is_an_error_with_the_command_that_brings_it(
    engine: str, module: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, engine, None)
    monkeypatch.delitem(sys.modules, f"falsifier.engines.optimisers.{module}", raising=False)
    with pytest.raises(SpecError, match=rf"'{engine}' needs a package.*pip install 'falsifier\[{engine}\]'"):
        make_engine(engine, lag_problem(), seed=0)


def test_a_wrong_name_is_an_error_with_a_suggestion() -> None:
    with pytest.raises(SpecError, match="did you mean 'sobol'"):
        make_engine("sobl", lag_problem(), seed=0)


def test_nothing_to_vary_is_an_error() -> None:
    with pytest.raises(SpecError, match="nothing to search"):
        make_engine("uniform", lag_problem(inputs=0), seed=0)
