"""What simulations have in common is checked once; where one stopped is told in words."""

import numpy as np
import pytest

from falsifier.core.model import Experiment
from falsifier.errors import FalsifierError, ModelError, SimulationError, SpecError
from falsifier.fmu.description import read_description
from falsifier.fmu.process import encoding
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.outcome import check_range, failure
from falsifier.fmu.process.plan import Plan, make_plan
from tests.fmu import fixtures

ECHO = read_description(fixtures.path("Echo_3"))
PLAN = Plan((), (), (), 1.0, 2, 1, 1, 0.1, None, 5.0, (("file", "a.txt"),))


@pytest.mark.parametrize(
    ("name", "row", "fits"),
    [
        ("in_Int8", [-128.4, 127.4], True),
        ("in_Int8", [-129.0, 0.0], False),
        ("in_UInt8", [0.0, 256.0], False),
        ("in_UInt8", [-0.4, 255.0], True),  # is rounded
        ("in_Boolean", [0.0, 1.0], True),
        ("in_Float64", [-1e300, 1e300], True),
    ],
)
def test_values_must_fit_the_type_of_their_variable(name: str, row: list[float], fits: bool) -> None:
    limits, rows = encoding.limits(ECHO, [name]), np.array([row])
    if fits:
        check_range("Echo", [name], limits, rows)
    else:
        with pytest.raises(SimulationError, match=f"Echo: .*'{name}'"):
            check_range("Echo", [name], limits, rows)


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        (Reply(Where.STEPPING, 3, time=0.5), r"M: the step returned error at t = 0\.5 s, before .* 1 s"),
        (Reply(Where.TERMINATED, time=0.5), r"M: the FMU terminated the simulation at t = 0\.5 s"),
        (Reply(Where.CALLING, 3, "Initialize", 0.0), "M: Initialize returned error at the start"),
        (Reply(Where.WRITING, 2, "inputs", 0.0), "M: setting the inputs returned discard"),
        (Reply(Where.TEXT, 3, "0", 0.0), r"M: setting 'file' to 'a\.txt' returned error"),
        (Reply(Where.TEXT, 3, "9999999999999", 0.0), "M: setting 'a string' to 'a text' returned error"),
        (Reply(Where.TIMEOUT, time=0.5), r"M: stopped at t = 0\.5 s after the time limit of 5 s"),
    ],
)
def test_where_a_simulation_stopped_is_told(reply: Reply, said: str) -> None:
    found = failure("M", PLAN, reply, "", ("slow",))
    assert isinstance(found, SimulationError)
    with pytest.raises(SimulationError, match=rf"^{said}.*; its last message: slow$"):
        raise found
    assert (found.time, found.log) == (reply.time, ("slow",))
    assert found.status == ("timeout" if reply.where == Where.TIMEOUT else "failed")


def test_an_fmu_that_cannot_be_used_is_no_failed_simulation() -> None:
    with pytest.raises(ModelError, match=r"^M: it lacks fmi2DoStep$"):
        raise failure("M", PLAN, Reply(Where.IMPOSSIBLE, text="it lacks fmi2DoStep"), "", ())


LAG = read_description(fixtures.path("Lag_2"))


@pytest.mark.parametrize(
    ("inputs", "parameters", "outputs", "message"),
    [
        (["v"], [], ["y"], "no variable 'v'"),
        (["y"], [], ["y"], "'y' is not an input, its causality is output; the inputs are: u"),
        (["u"], ["y"], ["y"], "'y' cannot be set: the model computes"),
        (["u"], ["gian"], ["y"], "did you mean 'gain'"),
        (["u"], [], ["z"], "no variable 'z'"),
    ],
)
def test_wrong_names_are_refused_with_the_reason(
    inputs: list[str], parameters: list[str], outputs: list[str], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        make_plan(LAG, Experiment(1.0, 0.1, tuple(outputs)), inputs, parameters)


@pytest.mark.parametrize(
    ("step", "instead"),
    [(0.03, "0.0333333"), (0.2, "0.1")],
)
def test_steps_must_fit(step: float, instead: str) -> None:
    with pytest.raises(SpecError, match=f"try step_size = {instead}") as caught:
        make_plan(LAG, Experiment(1.0, 0.1, ("y",), step_size=step), [], [])
    assert caught.value.key == "step_size"


def test_smaller_steps_divide_the_output_interval() -> None:
    plan = make_plan(LAG, Experiment(2.0, 0.1, ("y",), step_size=0.02), ["u"], [])
    assert (plan.samples, plan.every, plan.steps) == (21, 5, 100)
    assert issubclass(SpecError, FalsifierError)
