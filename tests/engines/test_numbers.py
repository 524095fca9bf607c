"""Whatever numbers a model puts out, engines go on and print no warnings."""

from collections.abc import Mapping

import numpy as np
import pytest

from falsifier.engines import ENGINES, make_engine
from falsifier.engines.surrogate import Settings
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import FREE, START, Array, Response, lag, lag_problem
from tests.engines.support import HASTY

NAMES = [name for name in ENGINES if name not in ("hybrid", "botorch")]


def constant(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    return {"x": np.zeros_like(times)}


def at_the_end_of_the_range(
    times: Array, inputs: dict[str, Array], parameters: dict[str, float]
) -> Mapping[str, Array]:
    return {"x": 1.7e308 * np.sign(lag(times, inputs, parameters)["x"])}


def with_spikes(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> Mapping[str, Array]:
    x = lag(times, inputs, parameters)["x"].copy()
    x[len(x) // 2] = 10.0 ** (300.0 * np.sin(1e6 * x[-1]))
    return {"x": x}


def often_failing(
    times: Array, inputs: dict[str, Array], parameters: dict[str, float]
) -> Mapping[str, Array]:
    x = lag(times, inputs, parameters)["x"]
    if int(abs(x[-1]) * 1e6) % 2:
        raise ValueError("it cannot be solved")
    return {"x": x}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("response", [constant, at_the_end_of_the_range, with_spikes, often_failing])
@pytest.mark.parametrize("name", NAMES)
def test_no_number_ends_a_search(name: str, response: Response) -> None:
    problem = lag_problem("G[0,10] (x <= 3)", free=FREE, points=2, parameters=[START], response=response)
    options: dict[str, Settings] = {"settings": HASTY} if name == "surrogate" else {}
    engine = make_engine(name, problem, seed=1, **options)
    for _ in range(12):
        (candidate,) = engine.ask(1)
        engine.tell([evaluate(problem, candidate)])
